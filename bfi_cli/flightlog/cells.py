"""The cells of a text log: numbers, decimal commas, clocks and dates; columns of text are left out."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime
from typing import Literal

import numpy as np

from ..channels import match_name
from ..errors import LogError
from .raw import Track, left_out

Kind = Literal["number", "clock", "date", "moment", "text"]

ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
CLOCK = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
DAY_S = 86400.0  # without leap seconds, which clocks of recorders do not count
EPOCH = date(1970, 1, 1).toordinal()


@dataclass(slots=True)
class Cells:
    """What the columns of a text hold, each told by its first cell that is not empty; None until there is one.

    Attributes
    ----------
    comma : whether a comma in a number is a decimal comma.
    plain : whether all columns hold numbers so far.
    """

    names: Sequence[str]
    comma: bool
    plain: bool = True
    kinds: list[Kind | None] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.kinds = [None] * len(self.names)

    def numbers(self, where: str, cells: list[str]) -> list[float]:
        """Return the numbers of a row: NaN for empty cells and text, seconds for clocks and dates.

        Raises
        ------
        LogError : a row of another length, or a cell that does not fit its column.
        """
        if len(cells) == len(self.names) + 1 and not cells[-1].strip():
            cells = cells[:-1]
        if len(cells) != len(self.names):
            raise LogError(
                f"{where} has {len(cells)} values, the header names {len(self.names)} channels; mend the line"
            )
        numbers = []
        for i, cell in enumerate(map(str.strip, cells)):
            if cell.lower() in ABSENT or self.kinds[i] == "text":
                numbers.append(math.nan)
                continue
            kind, value = self._read(cell)
            if self.kinds[i] is None:
                self.kinds[i] = kind
                self.plain = self.plain and kind == "number"
            elif kind != self.kinds[i]:
                what = {"clock": "a time of day", "date": "a date", "moment": "a date and time"}
                raise LogError(
                    f"{where}, column '{self.names[i]}': not {what.get(str(self.kinds[i]), 'a number')}, got "
                    f"'{cell[:40]}'; mend the cell or empty it"
                )
            numbers.append(value)
        return numbers

    def _read(self, cell: str) -> tuple[Kind, float]:
        try:
            if "_" not in cell:  # which Python reads as a part of a number
                return "number", float(cell.replace(",", ".") if self.comma else cell)
        except ValueError:
            pass
        if clock := CLOCK.fullmatch(cell):
            hours, minutes, seconds = clock[1], clock[2], clock[3].replace(",", ".")
            return "clock", 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
        try:
            if DATE.fullmatch(cell):
                return "date", DAY_S * (date.fromisoformat(cell).toordinal() - EPOCH)
            if DATE.match(cell):
                moment = datetime.fromisoformat(cell)
                return "moment", (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
        except (ValueError, OverflowError):
            pass
        return "text", math.nan


def in_seconds(columns: Sequence[Track], kinds: Sequence[Kind | None]) -> tuple[list[Track], list[str]]:
    """Return the columns with a time axis made of clock and date where no number is one, and sentences on it.

    Time counts from midnight of the first day (UTC where an offset is stated), through later ones. Rows without a time
    are left out, those that repeat the second before too; where most seconds have several rows, these are spread over
    their second.
    """
    by_kind: dict[Kind | None, list[Track]] = {}
    for column, kind in zip(columns, kinds, strict=True):
        by_kind.setdefault(kind, []).append(column)
    texts, dates = by_kind.get("text", []), by_kind.get("date", [])
    clocks, moments = by_kind.get("clock", []), by_kind.get("moment", [])
    notes = [left_out(column.source, "holds text") for column in texts]
    kept = [c for c, kind in zip(columns, kinds, strict=True) if kind in ("number", None)]
    timed = [*moments, *clocks, *dates]
    matches = (match_name(column.source) for column in kept)
    if not timed or timed[0] in dates or any(match is not None and match.name == "time" for match in matches):
        return kept, notes + [left_out(c.source, "holds dates or times beside the time axis") for c in timed]
    chosen = timed[0]
    time_s = chosen.values.copy()
    if chosen in clocks and dates:
        time_s += dates[0].values
    rows = np.isfinite(time_s)
    if chosen in clocks and not dates:
        known = time_s[rows]
        time_s[rows] = known + DAY_S * np.cumsum(np.diff(known, prepend=known[:1]) < -0.5 * DAY_S)
    if rows.any() and time_s[rows][0] >= DAY_S:
        first = np.floor(time_s[rows][0] / DAY_S) * DAY_S
        time_s -= first
        notes.append(f"time counts from midnight of {date.fromordinal(EPOCH + round(first / DAY_S)).isoformat()}")
    if not rows.all():
        notes.append(f"{np.count_nonzero(~rows)} rows without a time are left out")
    steps = np.diff(time_s[rows])
    if np.any(steps == 0.0) and np.all(time_s[rows] % 1.0 == 0.0):
        if np.median(steps) == 0.0:
            time_s[rows] = _spread(time_s[rows])
            notes.append(f"the clock '{chosen.source}' has whole seconds; the rows of a second are spread over it")
        else:
            repeated = np.flatnonzero(rows)[1:][steps == 0.0]
            rows[repeated] = False
            notes.append(f"rows that repeat the second before are left out: {repeated.size}")
    steps = np.diff(time_s[rows])
    missing = int(np.count_nonzero(steps > 1.5 * np.median(steps))) if steps.size else 0
    if missing:
        notes.append(
            f"the clock '{chosen.source}' skips {missing} times; --rate {1.0 / float(np.median(steps)):.4g} fills "
            "single missing samples"
        )
    time = Track(source=chosen.source, values=time_s[rows], unit="s", channel="time")
    return [time, *(replace(column, values=column.values[rows]) for column in kept)], notes


def _spread(time_s: np.ndarray) -> np.ndarray:
    """Return whole seconds with the rows of each laid evenly over it, the first and last as dense as is usual."""
    starts = np.flatnonzero(np.diff(time_s, prepend=time_s[0] - 1.0))
    counts = np.diff(np.append(starts, time_s.size))
    usual = max(int(np.median(counts)), int(counts[-1]))
    within = np.arange(time_s.size) - np.repeat(starts, counts)
    dense = counts.copy()
    dense[-1] = usual
    if counts[0] < usual:  # the log began inside this second
        dense[0], within[: counts[0]] = usual, within[: counts[0]] + usual - counts[0]
    return np.asarray(time_s + within / np.repeat(dense, counts))
