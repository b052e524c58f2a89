"""Every reproduction by its name; the module behind a name is imported when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

from ..errors import ConfigError
from ..faults import did_you_mean
from ..report.content import ReportContent
from .record import Settings

__all__ = ["REPRODUCTIONS", "Entry", "find", "run"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A reproduction: what it shows, and the function of a module of this package that makes it.

    Names that share a computation share the function; its exhibit then shows all of their figures.
    """

    title: str
    module: str
    function: str


def _entry(title: str, place: str) -> Entry:
    module, _, function = place.partition(":")
    return Entry(title=title, module=module, function=function)


REPRODUCTIONS = {
    "fir": _entry("Thesis, chapter 3: blind identification of an FIR system", "fir:fir"),
    "thesis-5-1": _entry("Thesis, figure 5-1: elevator and airspeed", "thesis_data:thesis_5_1"),
    "thesis-5-2": _entry("Thesis, figure 5-2: the fault dictionary", "thesis_data:thesis_5_2"),
    "thesis-5-3": _entry("Thesis, figure 5-3: magnitude error, 1 to 7 faults", "thesis_sweeps:thesis_monte_carlo"),
    "thesis-5-4": _entry("Thesis, figure 5-4: isolation, 1 to 7 faults", "thesis_sweeps:thesis_monte_carlo"),
    "thesis-5-5": _entry("Thesis, figure 5-5: a fast sinusoid, beside DMAE", "thesis_cases:thesis_5_5"),
    "thesis-5-6": _entry("Thesis, figure 5-6: a slow sinusoid, beside DMAE", "thesis_cases:thesis_5_6"),
    "thesis-5-7": _entry("Thesis, figure 5-7: a bias with a perturbation", "thesis_perturbed:thesis_5_7"),
    "thesis-5-8": _entry("Thesis, figure 5-8: the perturbation grows", "thesis_perturbed:thesis_5_8"),
    "thesis-5-9": _entry("Thesis, figure 5-9: the order grows", "thesis_perturbed:thesis_5_9"),
    "thesis-5-10": _entry("Thesis, figure 5-10: the perturbed bias at order 45", "thesis_cases:thesis_5_10"),
    "thesis-5-11": _entry("Thesis, figure 5-11: a sinusoid shifted in time", "thesis_cases:thesis_5_11"),
    "thesis-5-12": _entry("Thesis, figure 5-12: a drift shifted in time", "thesis_cases:thesis_5_12"),
    "thesis-5-13": _entry("Thesis, figure 5-13: a bias of unknown start", "thesis_onset:thesis_5_13"),
    "thesis-5-14": _entry("Thesis, figure 5-14: the start of a bias", "thesis_onset:thesis_5_14"),
    "thesis-5-15": _entry("Thesis, figure 5-15: the start of a drift", "thesis_onset:thesis_5_15"),
    "thesis-5-16": _entry("Thesis, figure 5-16: the wrong shape", "thesis_onset:thesis_5_16"),
    "thesis-A-1": _entry("Thesis, figure A-1: magnitude error without sparsity stage", "thesis_sweeps:thesis_a"),
    "thesis-A-2": _entry("Thesis, figure A-2: magnitude error with sparsity stage", "thesis_sweeps:thesis_a"),
    "thesis-A-3": _entry("Thesis, figure A-3: isolation without sparsity stage", "thesis_sweeps:thesis_a"),
    "thesis-A-4": _entry("Thesis, figure A-4: isolation with sparsity stage", "thesis_sweeps:thesis_a"),
    "isolation-noise": _entry("Isolation against noise, the thesis's rule and ours", "thesis_sweeps:isolation_noise"),
    "f16-table2": _entry("F-16 diagnosability, table II", "f16_table2:f16_table2"),
    "hankel-b747": _entry("Hankel null space, Boeing 747, figure 1", "hankel_b747:hankel_b747"),
}


def find(name: str) -> str:
    """Return the name as it is listed, whatever its case.

    Raises
    ------
    ConfigError : there is none.
    """
    known = {one.lower(): one for one in REPRODUCTIONS}
    if name.lower() not in known:
        raise ConfigError(
            f"reproduce: no such figure, got '{name}'{did_you_mean(name, (*REPRODUCTIONS, 'all', 'list'))}"
        )
    return known[name.lower()]


def run(name: str, settings: Settings) -> ReportContent:
    """Make a reproduction.

    Raises
    ------
    ConfigError : there is none of that name.
    LogError, DictionaryError : the log of the settings cannot be used for it.
    """
    entry = REPRODUCTIONS[find(name)]
    module = importlib.import_module(f"{__package__}.{entry.module}")
    make: Callable[[Settings], ReportContent] = getattr(module, entry.function)
    return make(settings)
