"""What is said of a table of `bfi calibrate`, and the report of its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..decision.calibration import FEWEST_WINDOWS, CalibrationTable, Null, check_calibration, null_of
from ..notes import Note
from .content import ReportContent, Table, notes_of

# A window stands far out where its statistic exceeds so many times the threshold of one false alarm in a thousand.
# Chosen without a tuning record; only a note on the table depends on it.
FAR_OUT, RARE = 2.0, 0.001


def calibration_content(document: Mapping[str, Any], *, where: str = "the calibration") -> ReportContent:
    """Return what the report of a file of `bfi calibrate` holds: the thresholds of every table in it."""
    tables, rows = check_calibration(document, where=where), []
    for table in tables:
        settings, enough = table.settings, table.n_windows >= FEWEST_WINDOWS
        null = null_of(table, settings.shapes) if enough else None
        for shape in settings.shapes:
            limits = ("-", "-") if null is None else _limits(table, null, shape)
            rows.append((shape, str(table.n_windows), *limits, f"{settings.duration_s:g}", f"{settings.rate_hz:g}"))
    heads = ("shape", "windows", "median", "1 % false alarms above", "length, s", "rate, Hz")
    return ReportContent(
        category="Calibration of the onset scan",
        title=str(document["provenance"]["command"]),
        heading=f"{len(tables)} tables",
        verdict=f"{sum(table.n_windows for table in tables)} windows without a fault in {len(tables)} tables.",
        tables=(Table(name="thresholds", title="Thresholds", heads=heads, rows=tuple(rows)),),
        notes=notes_of(document),
    )


def table_notes(table: CalibrationTable, logs: Sequence[str]) -> tuple[Note, ...]:
    """Return what a reader of a table should know: too few windows, windows left out, windows unlike the others.

    Parameters
    ----------
    logs : paths of all logs that were to be counted.
    """
    n, notes = table.n_windows, []
    if n < FEWEST_WINDOWS:
        notes.append(
            Note.advice(
                f"{n} windows are too few, bfi start-time asks for {FEWEST_WINDOWS}; give more or longer flights"
            )
        )
    if table.n_unusable:
        unused = [log for log in logs if Path(log).name not in table.logs]
        where = f", among them all of {', '.join(unused)}" if unused else ""
        notes.append(
            Note.limit(
                f"{table.n_unusable} windows could not be analysed{where}; bfi info says what is wrong with a log"
            )
        )
    if n >= FEWEST_WINDOWS:
        null = null_of(table, table.settings.shapes)
        for shape, values in table.statistics.items():
            beyond = int((values > FAR_OUT * null.threshold(shape, RARE)).sum())
            if beyond:
                notes.append(
                    Note.advice(
                        f"{shape}: {beyond} of {n} windows stand far out, as if they held a fault; leave them out"
                    )
                )
    return tuple(notes)


def table_lines(table: CalibrationTable) -> list[str]:
    """Return lines on a table: how many windows, and per shape the median and the threshold at 1 % false alarms."""
    counted = f"{table.n_windows} windows without a fault, {table.n_unusable} could not be analysed"
    if table.n_windows < FEWEST_WINDOWS:
        return [counted, f"too few for a threshold, {FEWEST_WINDOWS} are needed"]
    null = null_of(table, table.settings.shapes)
    limits = ((shape, *_limits(table, null, shape)) for shape in table.settings.shapes)
    return [counted, *(f"{shape}: median {median}, 1 % false alarms above {level}" for shape, median, level in limits)]


def _limits(table: CalibrationTable, null: Null, shape: str) -> tuple[str, str]:
    """Return the median of the statistic of a shape, and the threshold at 1 % false alarms."""
    return f"{np.median(table.statistics[shape]):.4g}", f"{null.threshold(shape, 0.01):.4g}"
