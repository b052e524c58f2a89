"""Monte Carlo sweeps of reproductions: a shipped sweep, the methods to compare, any record; rates and errors drawn."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..config import merge
from ..flightlog import write_log
from ..montecarlo import check_records, load_sweep, run_sweep, summarise, wilson
from ..montecarlo.definition import RecordedLog
from ..montecarlo.summary import Proportion, ScenarioSummary
from ..report.content import Curve, Panel, Table, curve
from ..report.text import number
from .page import FOLDER, Page, load, table
from .record import Settings, thesis_record

__all__ = [
    *("Cell", "Swept", "Thin", "error_panel", "isolation_panel", "noise_words", "percent", "pooled", "rate_curve"),
    *("rates_table", "swept"),
]

LEAST_ERROR = 1e-16  # what a log axis shows of an error of zero
SPREAD = 0.06  # how far points of different methods stand apart, so that they do not hide each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Thin:
    """What a quick sweep keeps: so many trials of these numbers of active faults and these noises (m/s)."""

    trials: int
    active: Sequence[int]
    noise: Sequence[float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One method at one noise (m/s) and one number of active faults."""

    method: str
    noise: float
    active: int
    summary: ScenarioSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """All cells, trials per cell, and what the sweep has to say (failed trials)."""

    cells: tuple[Cell, ...]
    trials: int
    notes: tuple[str, ...]

    def of(self, method: str, noise: float) -> list[Cell]:
        """Return the cells of a method at a noise, by number of active faults."""
        return [cell for cell in self.cells if (cell.method, cell.noise) == (method, noise)]

    @property
    def noises(self) -> tuple[float, ...]:
        """The noises there are, m/s."""
        return tuple(dict.fromkeys(cell.noise for cell in self.cells))


def swept(name: str, settings: Settings, *, compare: Sequence[str], quick: Thin) -> Swept:
    """Run a shipped sweep for several methods, which meet the same faults and the same noise.

    Parameters
    ----------
    name : of the YAML file beside this one, without "_sweep".
    compare : names in `methods.yaml`.
    quick : what is left of it where `settings.quick`.

    Raises
    ------
    LogError, ConfigError, SweepError : the record cannot be used, or a worker died.
    """
    plain = load_sweep(FOLDER / f"{name}_sweep.yaml", seed=settings.seed)
    with TemporaryDirectory(prefix="bfi-") as folder:
        record = None
        if settings.log is not None:  # as a file that every worker can read
            record = RecordedLog(log=str(Path(folder) / "record.h5"))
            write_log(replace(thesis_record(settings), segments=()), Path(record.log))
        scenarios = []
        for scenario in plain.scenarios:
            if settings.quick and not (scenario.n_active in quick.active and scenario.axes["noise.tas"] in quick.noise):
                continue
            for method in compare:
                setting = scenario.setting
                source = record or setting.record
                config = merge(setting.config, load("methods")[method], where="methods.yaml")
                parts = [setting.digest, source.model_dump(mode="json"), config.model_dump(mode="json")]
                digest = hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
                scenarios.append(
                    replace(
                        scenario,
                        name=f"{scenario.name} method={method}",
                        axes={**scenario.axes, "method": method},
                        setting=replace(setting, digest=digest, record=source, config=config),
                    )
                )
        n_trials = settings.trials_or(plain.n_trials, quick.trials)
        sweep = replace(plain, n_trials=n_trials, scenarios=tuple(scenarios))
        check_records(sweep)
        total = n_trials * len(scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    summary = summarise(sweep, done)
    cells = [
        Cell(method=one.axes["method"], noise=one.axes["noise.tas"], active=one.axes["active"], summary=one)
        for one in summary.scenarios
    ]
    return Swept(cells=tuple(cells), trials=n_trials, notes=summary.notes)


def percent(share: Proportion) -> str:
    """Return "96 % (90 to 98)", the rate with its 95 % Wilson interval."""
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} % ({low:.0f} to {high:.0f})"


def noise_words(noise: float) -> str:
    """Return "no noise", or "noise 0.01 m/s"."""
    return f"noise {noise:g} m/s" if noise else "no noise"


def pooled(cells: Sequence[Cell]) -> Proportion:
    """Return how many of all trials of several cells are isolated."""
    count, of = (sum(getattr(cell.summary.isolation, key) for cell in cells) for key in ("count", "of"))
    return Proportion(count=count, of=of, rate=count / of if of else None, ci95=wilson(count, of))


def rates_table(page: Page, swept: Swept, labels: Mapping[str, str]) -> Table:
    """Return a row per cell, methods by their `labels`, rates as "96 (90-98)"."""
    rows = []
    for cell in swept.cells:
        one = cell.summary
        rates = [percent(share) for share in (one.isolation, one.false_alarm, one.missed_detection)]
        bare = [text.replace(" % ", " ").replace(" to ", "-") for text in rates]
        error = number(one.magnitude_error.get("p50"), digits=2)
        rows.append((labels[cell.method], f"{cell.noise:g}", str(cell.active), *bare, error))
    return table(page, "rates", rows)


def error_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return median magnitude error against the number of active faults, quartiles as bars."""
    curves = []
    for label, cells, at in _beside(swept, labels, noise):
        low, middle, high = (
            [float(np.maximum(cell.summary.magnitude_error.get(key, math.nan), LEAST_ERROR)) for cell in cells]
            for key in ("p25", "p50", "p75")
        )
        curves.append(curve(label, at, middle, style="points", low=low, high=high))
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="relative magnitude error [-]",
        curves=tuple(curves),
        log_y=True,
    )


def isolation_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return the isolation rate against the number of active faults, with Wilson intervals."""
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="isolated [%]",
        curves=tuple(
            rate_curve(label, at, [cell.summary.isolation for cell in cells])
            for label, cells, at in _beside(swept, labels, noise)
        ),
        y_limits=(-3.0, 103.0),
    )


def _beside(swept: Swept, labels: Mapping[str, str], noise: float) -> list[tuple[str, list[Cell], list[float]]]:
    """Return the label of every method, its cells, and their numbers of active faults moved a little aside."""
    found = [(label, swept.of(method, noise)) for method, label in labels.items()]
    aside = [SPREAD * (i - 0.5 * (len(found) - 1)) for i in range(len(found))]
    return [(label, cells, [one.active + d for one in cells]) for (label, cells), d in zip(found, aside, strict=True)]


def rate_curve(label: str, x: Sequence[float], shares: Sequence[Proportion]) -> Curve:
    """Return rates in % with their intervals as bars."""
    ends = [share.ci95 or (math.nan, math.nan) for share in shares]
    return curve(
        label,
        x,
        [100.0 * (math.nan if share.rate is None else share.rate) for share in shares],
        style="bars",
        low=[100.0 * low for low, _ in ends],
        high=[100.0 * high for _, high in ends],
    )
