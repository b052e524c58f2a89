"""Trials on one record: faults of known magnitude added, the answer of the default method counted."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import numpy as np
from bars import FULL
from threadpoolctl import threadpool_limits

from bfi_cli.config import Config
from bfi_cli.dictionary import Dictionary
from bfi_cli.faults import unit_signal
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.result import IdentifyResult

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


Piece, Answer = TypeVar("Piece"), TypeVar("Answer")


def spread(job: Callable[[Piece], Answer], pieces: Iterable[Piece], workers: int = 2) -> list[Answer]:
    """Return what a job makes of each piece: here where pytest's own workers share the cores, else on processes.

    A process spends a second or two on its imports, as much as on some trials.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        return [job(piece) for piece in pieces]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return list(pool.map(job, pieces))


def sized(full: int, share: float = 0.25) -> int:
    """Return how many trials to run: all of them where BFI_FULL=1 is set, a share of them otherwise."""
    return full if FULL else max(1, round(share * full))


@dataclass(frozen=True)
class Trial:
    """What went in: seed, true magnitudes by atom name, measurement noise in m/s."""

    seed: int
    noise: float
    truth: dict[str, float]


@dataclass(frozen=True)
class Outcome:
    """What came out."""

    trial: Trial
    decision: str
    found: dict[str, tuple[float, float, float]]

    @property
    def isolated(self) -> bool:
        return set(self.found) == set(self.trial.truth)


def draw(dictionary: Dictionary, n_active: int, seed: int, noise: float) -> Trial:
    """Draw active atoms and integer magnitudes 1 to 10."""
    rng = np.random.default_rng([n_active, seed])
    names = [atom.name for atom in dictionary.atoms]
    active = rng.choice(len(names), n_active, replace=False)
    return Trial(seed, noise, {str(names[j]): float(rng.integers(1, 11)) for j in sorted(active)})


def with_faults(log: FlightLog, dictionary: Dictionary, trial: Trial, output: str = "tas") -> FlightLog:
    """Return the log with the trial's faults and noise on one output."""
    start = float(log.time_s[0])
    values = log.channel(output).values.copy()
    for atom in dictionary.resolved(start):
        if atom.name in trial.truth:
            values += trial.truth[atom.name] * unit_signal(atom, log.time_s, window_start_s=start)
    noise = np.random.default_rng([9, len(trial.truth), trial.seed]).standard_normal(len(values))
    values += trial.noise * noise
    channels = dict(log.channels)
    channels[output] = replace(log.channel(output), values=frozen_array(values))
    return replace(log, channels=channels)


def run(trial: Trial, *, log: FlightLog, dictionary: Dictionary, config: Config) -> Outcome:
    """Identify one trial."""
    with threadpool_limits(1):
        result: IdentifyResult = identify_faults(with_faults(log, dictionary, trial), dictionary, config)
    found = {fault.name: (fault.magnitude, *fault.ci95) for fault in result.faults}
    return Outcome(trial, result.decision, found)


def run_all(trials: Iterable[Trial], log: FlightLog, dictionary: Dictionary, config: Config) -> list[Outcome]:
    """Identify all trials."""
    return spread(partial(run, log=log, dictionary=dictionary, config=config), trials)


def worst_relative_error(outcome: Outcome) -> float:
    """Largest relative magnitude error of the atoms that are really active."""
    return max((abs(outcome.found[name][0] / z - 1.0) for name, z in outcome.trial.truth.items()), default=0.0)
