"""Faults of known start on simulated flights, the answer of the onset scan counted.

`ONSET_SEEDS` is the number of seeds (default 6, or 100 where BFI_FULL=1), `ONSET_WORKERS` that of the processes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits
from trials import sized, spread

from bfi_cli.config import Config
from bfi_cli.decision.calibration import CalibrationTable, save_tables
from bfi_cli.faults import Fault, FaultEstimate
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import OnsetResult, find_onset, table_of_windows
from bfi_cli.serialization import provenance

SEEDS = range(int(os.environ.get("ONSET_SEEDS", sized(100, 0.06))))
WORKERS = int(os.environ.get("ONSET_WORKERS", "2"))
FAULT_FREE = 10_000


@dataclass(frozen=True)
class Trial:
    """What went in: the seed of the noise, the fault (None for none), noise in m/s."""

    seed: int
    fault: Fault | None
    noise: float


@dataclass(frozen=True)
class Outcome:
    """What came out; statistics are the largest of each shape, thresholds theirs. `defect` is what went wrong."""

    trial: Trial
    faults: tuple[FaultEstimate, ...]
    statistics: dict[str, float]
    thresholds: dict[str, float]
    order: int
    defect: str | None = None

    @property
    def shape(self) -> str:
        """Of the strongest fault, "none" where nothing is declared."""
        return self.first.fault.shape if self.faults else "none"

    @property
    def first(self) -> FaultEstimate:
        """The fault with the largest statistic."""
        return max(self.faults, key=lambda one: one.statistic)

    @property
    def late_s(self) -> float:
        """Onset found less the true one."""
        assert self.trial.fault is not None
        return float(self.first.fault.onset_s - self.trial.fault.onset_s)

    @property
    def covered(self) -> bool:
        """Whether the interval holds the true onset; what is not declared is not covered."""
        assert self.trial.fault is not None
        if not self.faults:
            return False
        low, high = self.first.onset_ci95
        return bool(low <= self.trial.fault.onset_s <= high)


def described(outcome: Outcome) -> str:
    """Return a trial and its answer on one line."""
    if outcome.defect is not None:
        return f"seed {outcome.trial.seed}: {outcome.trial.fault} -> {outcome.defect}"
    found = [
        f"{one.fault.shape} {one.magnitude:.3g} from {one.fault.onset_s:.2f} "
        f"({one.onset_ci95[0]:.2f} to {one.onset_ci95[1]:.2f}) until {one.fault.offset_s} "
        f"at {one.fault.frequency_hz} Hz, statistic {one.statistic:.0f}"
        for one in outcome.faults
    ]
    shapes = {shape: f"{value:.0f} of {outcome.thresholds[shape]:.0f}" for shape, value in outcome.statistics.items()}
    return f"seed {outcome.trial.seed}: {outcome.trial.fault} -> {found}, order {outcome.order}, statistics {shapes}"


def noisy(log: FlightLog, trial: Trial) -> FlightLog:
    """Return the log with the trial's fault and noise on the airspeed."""
    faulty = log if trial.fault is None else inject(log, [trial.fault])
    tas = faulty.channel("tas")
    noise = np.random.default_rng([5, trial.seed]).standard_normal(faulty.n_samples)
    values = frozen_array(tas.values + trial.noise * noise)
    return replace(faulty, channels={**faulty.channels, "tas": replace(tas, values=values)})


def run(trial: Trial, *, log: FlightLog, config: Config) -> Outcome:
    """Scan one trial; one that fails is an outcome, so that the others are counted."""
    try:
        with threadpool_limits(1):
            result: OnsetResult = find_onset(noisy(log, trial), config)
    except Exception as problem:
        return Outcome(trial=trial, faults=(), statistics={}, thresholds={}, order=0, defect=repr(problem))
    return Outcome(
        trial=trial,
        faults=result.faults,
        statistics={one.shape: float(one.statistic.max()) for one in result.profiles},
        thresholds={one.shape: float(one.threshold or np.nan) for one in result.profiles},
        order=result.model.order,
    )


def run_all(trials: Sequence[Trial], log: FlightLog, config: Config) -> list[Outcome]:
    """Scan all trials."""
    return spread(partial(run, log=log, config=config), trials, WORKERS)


def calibrated(log: FlightLog, config: Config, *, noise: float, windows: int, folder: Path) -> Config:
    """Return the configuration with a table of fault-free copies of a log, made with noises no trial has."""
    trials = [Trial(FAULT_FREE + seed, None, noise) for seed in range(windows)]
    pieces = np.array_split(np.array(trials, dtype=object), WORKERS)
    parts = spread(partial(_table, log=log, config=config), pieces, WORKERS)
    statistics = {shape: np.concatenate([one.statistics[shape] for one in parts]) for shape in parts[0].statistics}
    path = folder / "table.json"
    path.write_text(save_tables([replace(parts[0], statistics=statistics)], provenance(log_sha256="")))
    return config.model_copy(
        update={"start_time": config.start_time.model_copy(update={"calibration": str(path)})}, deep=True
    )


def _table(trials: Sequence[Trial], *, log: FlightLog, config: Config) -> CalibrationTable:
    whole = (float(log.time_s[0]), float(log.time_s[-1]) + 1.0 / log.rate_hz)
    with threadpool_limits(1):
        return table_of_windows([(noisy(log, trial), whole) for trial in trials], config)
