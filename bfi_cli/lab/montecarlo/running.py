"""A sweep from its trials to its rows, in a journal as they come, so that a stopped sweep continues where it was.

Rows are kept in the order of the trials, so that files made of them are the same however often the sweep was stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from ...engine import in_order
from ...errors import ConfigError, LogError, SweepError
from ...flightlog.derived import with_derived
from ...journal import Journal, lines_of_journal
from ...serialization import Provenance, document_of, from_plain
from .flight import check_onsets, record_of
from .scenarios import Sweep
from .trial import Row, run_trial

Report = Callable[[int], None]

TIMING_COLUMNS = ("scenario", "trial", "seconds")
JOURNAL, KIND = "trials.jsonl", "montecarlo"


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedRow:
    """The row of a trial and the seconds that it took."""

    row: Row
    seconds: float


def timing_cells(row: Row, seconds: float) -> tuple[str, str, str]:
    """Return the line of a row in `timings.csv`."""
    return row.scenario, str(row.trial), f"{seconds:.6f}"


def open_journal(
    out: Path,
    sweep: Sweep,
    *,
    digest: str,
    origin: Provenance,
    resume: bool,
    inputs: Sequence[str] = (),
    force: bool = False,
) -> tuple[Journal, list[tuple[Row, float]]]:
    """Return the journal of a sweep in a folder of results, and the rows and seconds that it keeps.

    Parameters
    ----------
    out : folder of the results, made if it does not exist.
    digest : of the sweep and its records.
    resume : continue with the rows found there, of a stopped sweep or of a finished one.
    inputs : files that are never replaced; force : replace a file of that name that is no journal.

    Raises
    ------
    SweepError : there is an unfinished sweep and `resume` was not asked for, or it is of another sweep.
    ConfigError : the folder cannot be written to, or the file is not ours.
    """
    path = out / JOURNAL
    head, *entries = lines_of_journal(path) or [None]
    known = head if isinstance(head, Mapping) and head.get("kind") == KIND else {}
    is_of_this, anew = known.get("digest") == digest, "give another --out, or remove that file to start anew"
    if known and entries and known.get("rows") != len(entries):
        if not resume:
            raise SweepError(f"{path}: an unfinished sweep is there; add --resume to continue it, or {anew}")
        if not is_of_this:
            what = "the unfinished sweep is of another configuration, seed, log or version"
            raise SweepError(f"{path}: {what}; {anew}")
    done = _leading_rows(entries, sweep, where=str(path)) if resume and is_of_this else []
    total = sweep.n_trials * len(sweep.scenarios)
    begun = document_of(KIND, {"digest": digest, "rows": total}, (), origin)
    kept = [TimedRow(row=row, seconds=seconds) for row, seconds in done]
    return Journal(path, begun, kept, inputs=inputs, force=force), done


def _leading_rows(entries: Sequence[object], sweep: Sweep, *, where: str) -> list[tuple[Row, float]]:
    """Return the leading entries that are whole and those of the sweep."""
    known, wanted = len(entries) // len(sweep.scenarios), sweep.n_trials
    if known > wanted:
        what = f"has {known} trials per scenario, got --trials {wanted}"
        raise SweepError(f"{where}: {what}; ask for at least as many, or give another --out")
    done: list[tuple[Row, float]] = []
    for trial, entry in zip(sweep.trials(), entries, strict=False):
        try:
            timed = from_plain(TimedRow, entry, where=where)
        except ConfigError:
            break
        row = timed.row
        if (row.scenario, row.trial, row.seed) != (trial.scenario.name, trial.number, trial.seed):
            break
        done.append((row, timed.seconds))
    return done


def check_records(sweep: Sweep) -> dict[str, str]:
    """Load every record once and return sha256 by path of the logs among them.

    Raises
    ------
    LogError, ConfigError : a record cannot be used, lacks a channel that the sweep needs, or has no time for a fault.
    """
    digests: dict[str, str] = {}
    for setting in dict.fromkeys(scenario.setting for scenario in sweep.scenarios):
        log = record_of(setting, np.random.default_rng(0))
        used = (*setting.config.inputs, *setting.config.outputs)
        whole = with_derived(log, used, from_s=setting.config.window.from_s, to_s=setting.config.window.to_s)
        for name in used:
            whole.channel(name)
        for name, _ in setting.noise:
            if name not in log.channels:
                raise LogError(f"{sweep.path}: noise: no channel '{name}'; {log.path} has: {', '.join(log.channels)}")
        drawing = any(scenario.n_active for scenario in sweep.scenarios if scenario.setting == setting)
        check_onsets(log, setting, drawing=drawing, where=sweep.path)
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
    kept: Sequence[tuple[Row, float]] = (),
    workers: int = 1,
    scheduler: str | None = None,
    report: Report = lambda _: None,
) -> list[tuple[Row, float]]:
    """Return the row of every trial and the seconds it took, in the order of the trials.

    Parameters
    ----------
    journal : keeps the rows as they come; `kept` are those that it has, see `open_journal`.
    workers, scheduler : see `bfi_cli.engine.in_order`.
    report : called with the number of rows there are, first with those kept.

    Raises
    ------
    SweepError : see `bfi_cli.engine.in_order`.
    """
    done = list(kept)
    report(len(done))
    rest = list(islice(sweep.trials(), len(done), None))
    results = in_order(run_trial, rest, workers=workers, scheduler=scheduler)
    try:
        for row, seconds in results:
            done.append((row, seconds))
            if journal is not None:
                journal.add(TimedRow(row=row, seconds=seconds))
            report(len(done))
    finally:
        results.close()
    return done
