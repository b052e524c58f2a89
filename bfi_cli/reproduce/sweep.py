"""Monte Carlo sweeps of reproductions: a shipped sweep, the methods to compare, any record in place of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..config import merge
from ..errors import ConfigError
from ..flightlog import FlightLog, write_log
from ..montecarlo import Summary, Sweep, check_records, load_sweep, run_sweep, summarise
from ..montecarlo.definition import RecordedLog
from ..montecarlo.scenarios import Scenario
from ..montecarlo.summary import ScenarioSummary
from ..yaml12 import load_yaml, read_text
from .record import FOLDER, thesis_record
from .settings import Settings

__all__ = ["Cell", "Swept", "Thin", "methods", "swept"]


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

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods there are."""
        return tuple(dict.fromkeys(cell.method for cell in self.cells))


@cache
def methods() -> Mapping[str, Mapping[str, Any]]:
    """Return settings by method, from `methods.yaml`."""
    path = FOLDER / "methods.yaml"
    loaded: Mapping[str, Mapping[str, Any]] = load_yaml(
        read_text(path, error=ConfigError), where=str(path), error=ConfigError
    )
    return loaded


def swept(name: str, settings: Settings, *, compare: Sequence[str], quick: Thin) -> Swept:
    """Run a shipped sweep for several methods, which meet the same faults and the same noise.

    Parameters
    ----------
    name : of the YAML file beside this one, without its suffix.
    compare : names in `methods.yaml`.
    quick : what is left of it where `settings.quick`.

    Raises
    ------
    LogError, ConfigError, SweepError : the record cannot be used, or a worker died.
    """
    plain = load_sweep(FOLDER / f"{name}.yaml", seed=settings.seed)
    sweep = replace(plain, n_trials=settings.trials_or(plain.n_trials, quick.trials))
    with _recorded(settings) as record:
        scenarios = [one for one in sweep.scenarios if not settings.quick or _kept(one, quick)]
        chosen = tuple(_variant(one, method, record) for one in scenarios for method in compare)
        sweep = replace(sweep, scenarios=chosen)
        check_records(sweep)
        total = sweep.n_trials * len(sweep.scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    return _swept(sweep, summarise(sweep, done))


def _swept(sweep: Sweep, summary: Summary) -> Swept:
    cells = [
        Cell(method=one.axes["method"], noise=one.axes["noise.tas"], active=one.axes["active"], summary=one)
        for one in summary.scenarios
    ]
    return Swept(cells=tuple(cells), trials=sweep.n_trials, notes=summary.notes)


def _kept(scenario: Scenario, quick: Thin) -> bool:
    return scenario.n_active in quick.active and scenario.axes["noise.tas"] in quick.noise


def _variant(scenario: Scenario, method: str, record: RecordedLog | None) -> Scenario:
    """Return the scenario with a method's settings and, where given, another record."""
    setting = scenario.setting
    source = setting.record if record is None else record
    config = merge(setting.config, methods()[method], where="methods.yaml")
    parts = [setting.digest, source.model_dump(mode="json"), config.model_dump(mode="json")]
    digest = hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
    return replace(
        scenario,
        name=f"{scenario.name} method={method}",
        axes={**scenario.axes, "method": method},
        setting=replace(setting, digest=digest, record=source, config=config),
    )


@contextmanager
def _recorded(settings: Settings) -> Iterator[RecordedLog | None]:
    """Yield the log of the settings as a file that every worker can read, None for the sweep's own record."""
    if settings.log is None:
        yield None
        return
    with TemporaryDirectory(prefix="bfi-") as folder:
        yield _file_of(thesis_record(settings), Path(folder))


def _file_of(log: FlightLog, folder: Path) -> RecordedLog:
    path = folder / "record.h5"
    write_log(replace(log, segments=()), path)
    return RecordedLog(log=str(path))
