"""A sweep from its trials to its rows: what is done already is kept, the rest is given to the engine."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from itertools import islice

import numpy as np

from ..engine import in_order
from ..errors import LogError
from .flight import record_of
from .journal import Journal
from .row import Row
from .scenarios import Sweep
from .trial import run_trial

__all__ = ["check_records", "digest_of", "run_sweep"]

Report = Callable[[int], None]


def check_records(sweep: Sweep) -> dict[str, str]:
    """Load every record once and return sha256 by path of the logs among them.

    Raises
    ------
    LogError, ConfigError : a record cannot be used, or lacks a channel that the sweep needs.
    """
    digests: dict[str, str] = {}
    for setting in dict.fromkeys(scenario.setting for scenario in sweep.scenarios):
        log = record_of(setting, np.random.default_rng(0))
        for name in (*setting.config.inputs, *setting.config.outputs):
            log.channel(name)
        for name, _ in setting.noise:
            if name not in log.channels:
                raise LogError(f"{sweep.path}: noise: no channel '{name}'; {log.path} has: {', '.join(log.channels)}")
        if log.sha256:
            digests[log.path] = log.sha256
    return digests


def digest_of(sweep: Sweep, records: Mapping[str, str]) -> str:
    """Return what tells a sweep on its records from any other, the number of trials left aside."""
    return hashlib.sha256(" ".join([sweep.digest, *records.values()]).encode()).hexdigest()


def run_sweep(
    sweep: Sweep,
    *,
    journal: Journal | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    report: Report = lambda _: None,
) -> list[tuple[Row, float]]:
    """Return the row of every trial and the seconds it took, in the order of the trials.

    Parameters
    ----------
    journal : keeps the rows as they come and knows those done before.
    workers, scheduler : see `bfi_cli.engine.in_order`.
    report : called with the number of rows there are, first with those done before.

    Raises
    ------
    SweepError : see `bfi_cli.engine.in_order`.
    """
    done = list(journal.done) if journal else []
    report(len(done))
    rest = list(islice(sweep.trials(), len(done), None))
    results = in_order(run_trial, rest, workers=workers, scheduler=scheduler)
    try:
        for row, seconds in results:
            done.append((row, seconds))
            if journal is not None:
                journal.add(row, seconds)
            report(len(done))
    finally:
        results.close()
    return done
