"""A sweep from its trials to its rows, on disk as they come, so that a stopped sweep continues where it was.

An unfinished sweep lies in the folder `unfinished` of its results: `trials.csv` and `timings.csv` as far as they are
written, and `sweep.json`, which says of what sweep. Lines are written in the order of the trials, each whole, so the
finished files are the same however often the sweep was stopped.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ...engine import in_order
from ...errors import LogError, SweepError
from ...files import MARK, replace_files
from ...flightlog.derived import with_derived
from ...serialization import csv_lines, to_csv
from .flight import check_onsets, record_of
from .scenarios import Sweep
from .trial import COLUMNS, Row, row_from_cells, run_trial

Report = Callable[[int], None]

TIMING_COLUMNS = ("scenario", "trial", "seconds")
FOLDER, ROWS, TIMES, OF = "unfinished", "trials.csv", "timings.csv", "sweep.json"
START_ANEW = "give another --out, or remove that folder to start anew"


class Journal:
    """The rows of a sweep in a folder of results.

    Attributes
    ----------
    done : rows and seconds found when it was opened, in the order of the trials.
    """

    def __init__(self, out: Path, sweep: Sweep, *, digest: str, resume: bool, force: bool = False) -> None:
        """Open the journal of a sweep.

        Parameters
        ----------
        out : folder of the results, made if it does not exist.
        digest : of the sweep and its records.
        resume : continue with the rows found there, of a stopped sweep or of a finished one.
        force : replace files of a folder of the same name that holds no sweep.

        Raises
        ------
        SweepError : there is an unfinished sweep and `resume` was not asked for, or it is of another sweep.
        ConfigError : the folder cannot be written to, or holds files of these names and no sweep.
        """
        self.folder = out / FOLDER
        self.done = _found(out, sweep, digest) if resume else []
        if not resume and _lines(self.folder / ROWS, COLUMNS):
            raise SweepError(
                f"{self.folder}: an unfinished sweep is there; add --resume to continue it, or {START_ANEW}"
            )
        # What is known is written whole, and rows are added to it: a torn last line is gone.
        begun = {
            OF: json.dumps({"digest": digest, "path": sweep.path}).encode(),
            ROWS: to_csv(COLUMNS, [row.cells() for row, _ in self.done]),
            TIMES: to_csv(TIMING_COLUMNS, [timing_cells(*pair) for pair in self.done]),
        }
        replace_files(begun, self.folder, force=force or "digest" in _document(self.folder / OF))
        self._rows, self._times = (
            (self.folder / name).open("a", encoding="utf-8", newline="") for name in (ROWS, TIMES)
        )

    def add(self, row: Row, seconds: float) -> None:
        """Append a row and hand it to the operating system.

        Raises
        ------
        SweepError : it cannot be written.
        """
        try:
            for file, cells in ((self._rows, row.cells()), (self._times, timing_cells(row, seconds))):
                file.write(csv_lines([cells]))
                file.flush()
        except OSError as error:
            raise SweepError(
                f"{self.folder}: {(error.strerror or str(error)).lower()}; make room, then continue with --resume"
            ) from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._rows.close()
        self._times.close()

    def remove(self) -> None:
        """Remove the folder, and nothing of others in it; to be called when the results are in place."""
        with contextlib.suppress(OSError):
            for name in (ROWS, TIMES, OF):
                (self.folder / name).unlink(missing_ok=True)
            self.folder.rmdir()


def timing_cells(row: Row, seconds: float) -> tuple[str, str, str]:
    """Return the line of a row in `timings.csv`."""
    return row.scenario, str(row.trial), f"{seconds:.6f}"


def _found(out: Path, sweep: Sweep, digest: str) -> list[tuple[Row, float]]:
    """Return what is done of a sweep that was stopped, or that is finished and may now be longer."""
    unfinished = out / FOLDER
    if not unfinished.exists():
        return _done(out, sweep) if _document(out / "summary.json").get("digest") == digest else []
    if _document(unfinished / OF).get("digest") != digest:
        raise SweepError(
            f"{unfinished}: the unfinished sweep is of another configuration, seed, log or version; {START_ANEW}"
        )
    return _done(unfinished, sweep)


def _document(path: Path) -> Mapping[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, Mapping) else {}


def _done(folder: Path, sweep: Sweep) -> list[tuple[Row, float]]:
    """Return the leading rows that are whole and those of the sweep."""
    rows, times = _lines(folder / ROWS, COLUMNS), _lines(folder / TIMES, TIMING_COLUMNS)
    known, wanted = len(rows) // len(sweep.scenarios), sweep.n_trials
    if known > wanted:
        raise SweepError(
            f"{folder}: has {known} trials per scenario, got --trials {wanted}; ask for at least as many, or give "
            "another --out"
        )
    done: list[tuple[Row, float]] = []
    for trial, cells, timing in zip(sweep.trials(), rows, times, strict=False):
        try:
            row, seconds = row_from_cells(cells), float(timing[2])
        except (ValueError, IndexError):
            break
        if (row.scenario, row.trial, row.seed) != (trial.scenario.name, trial.number, trial.seed):
            break
        done.append((row, seconds))
    return done


def _lines(path: Path, columns: Sequence[str]) -> list[list[str]]:
    """Return the whole lines of a CSV file below its header; a last line without its end is left out."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    text = text.removeprefix(f"{MARK}\n")
    reader = csv.reader(io.StringIO(text[: text.rfind("\n") + 1], newline=""))
    return list(islice(reader, 1, None)) if text.startswith(",".join(columns)) else []


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
