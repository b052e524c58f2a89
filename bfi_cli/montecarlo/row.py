"""What one trial gives, and its line in `trials.csv`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from ..serialization import to_json

__all__ = ["COLUMNS", "ERROR_DIGITS", "Row", "rounded", "row_from_cells"]

ESTIMATE_DIGITS = 12
ERROR_DIGITS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The answer of one trial beside its truth; everything after `truth` is None where the trial failed.

    Attributes
    ----------
    scenario, trial, seed : which it is.
    truth, estimate : magnitude by name of the faults added and of those declared.
    decision : see `bfi identify`; isolated : whether the declared faults are those added.
    false_alarms, missed : names of faults declared and not added, added and not declared.
    magnitude_error : 2-norm of estimate - truth relative to that of truth; None without a true fault.
    intervals, covered : 95 % intervals of rightly declared faults, and how many of them hold the truth; None with
        method risro, which has none of its own.
    detection_delay_s : None for a dictionary, which states the onset.
    error : why the trial failed.
    """

    scenario: str
    trial: int
    seed: int
    truth: Mapping[str, float]
    estimate: Mapping[str, float] | None = None
    decision: str | None = None
    isolated: bool | None = None
    false_alarms: tuple[str, ...] | None = None
    missed: tuple[str, ...] | None = None
    magnitude_error: float | None = None
    intervals: int | None = None
    covered: int | None = None
    detection_delay_s: float | None = None
    error: str | None = None

    def cells(self) -> list[str]:
        """Return the row as text, one cell per column: mappings and lists as JSON, absent ones empty."""
        return [_cell(getattr(self, column)) for column in COLUMNS]


COLUMNS = tuple(field.name for field in fields(Row))
TEXTS = ("scenario", "decision", "error")


def row_from_cells(cells: Sequence[str]) -> Row:
    """Return the row of a line of `trials.csv`, the inverse of `Row.cells`.

    Raises
    ------
    ValueError : it is no such line.
    """
    text = dict(zip(COLUMNS, cells, strict=True))
    read: dict[str, Any] = {
        key: json.loads(value) if value else None for key, value in text.items() if key not in TEXTS
    }
    read |= {key: tuple(read[key]) for key in ("false_alarms", "missed") if read[key] is not None}
    return Row(**{key: text[key] or None for key in TEXTS} | {"scenario": text["scenario"]} | read)


def rounded(value: float, digits: int = ESTIMATE_DIGITS) -> float:
    """Return `value` at so many significant digits: what a file says is what a summary is made of."""
    return float(f"{value:.{digits}g}")


def _cell(value: object) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return to_json(value, indent=None)
