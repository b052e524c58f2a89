"""Times of a log as clock times in its report: a column of each table and CSV file, the clock of figures, sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..epoch import Epoch
from .content import Columns, Drawing, ReportContent, Table

# Columns of CSV files that hold times of the log.
TIMES = ("time [s]", "time_s", "onset_s", "offset_s", "from_s", "to_s")
# A time of an axis that counts from 1970, or two with one unit, in a sentence. Quoted text is a name, or as typed.
SINCE_1970 = re.compile(
    r"(?<!\w)'.*?'(?!\w)|(?<![\w.=:/-])(?:(?P<low>\d{9,10}(?:\.\d+)?) to )?(?P<high>\d{9,10}(?:\.\d+)?) s\b(?!/)"
)


def with_clock(content: ReportContent, written: str | None, *, start_s: float, stop_s: float) -> ReportContent:
    """Return a report in which the times of a log stand as clock times too; as it is for a log without a clock.

    Tables and CSV files have a column with the clock, figures number the hours of the day, and the facts begin with
    the date. Where the axis itself counts from 1970, sentences have the clock time in place of its ten digits. Each
    clock time has its date where the log covers more than one day.

    Parameters
    ----------
    written : the moment from which the log counts, as its summary states it.
    start_s, stop_s : first and last time of the log.

    Raises
    ------
    ValueError : `written` is no moment.
    """
    if written is None:
        return content
    epoch = Epoch.from_iso(written)
    dated = epoch.date(start_s) != epoch.date(stop_s)
    between = _between(epoch, (start_s, stop_s), dated=True)
    if epoch.is_dated and epoch.since_1970_s == 0.0:
        change = partial(_sentence, epoch=epoch, dated=dated)
        content = replace(
            content,
            verdict=change(content.verdict),
            notes=tuple(replace(note, text=change(note.text)) for note in content.notes),
            drawings=tuple(replace(drawing, caption=change(drawing.caption)) for drawing in content.drawings),
            screen=content.screen and content.screen.with_sentences(change),
        )
    return replace(
        content,
        facts=(("Clock", f"{between}{' UTC' * epoch.is_utc}"), *content.facts),
        tables=tuple(_table(table, epoch, dated=dated) for table in content.tables),
        drawings=tuple(_drawing(drawing, epoch) for drawing in content.drawings),
        zoom=tuple(_drawing(drawing, epoch) for drawing in content.zoom),
        data={name: partial(_columns, columns, epoch) for name, columns in content.data.items()},
    )


def _between(epoch: Epoch, times_s: Iterable[float | None], *, decimals: int = 0, dated: bool) -> str:
    """Return a time of the log on its clock, or the first and the last of a stretch; "-" of an unknown time.

    "2011-07-01 13:20:01.5" where it is `dated`; the last time has a date if that is another.
    """
    texts, day = list[str](), ""
    for time_s in times_s:
        if time_s is not None and math.isfinite(time_s):
            text, before, day = epoch.time_of_day(time_s, decimals), day, epoch.date(time_s, decimals)
            texts.append(f"{day} {text}" if dated and day != before else text)
    return " to ".join(dict.fromkeys(texts)) or "-"


def _table(table: Table, epoch: Epoch, *, dated: bool) -> Table:
    """Return a table with the clock behind the last column of its times."""
    if not table.times_s:
        return table
    head = "clock [UTC]" if epoch.is_utc else "clock"
    at = table.last_time + 1

    def widened(row: tuple[str, ...], cell: str) -> tuple[str, ...]:
        return (*row[:at], cell, *row[at:])

    # As the seconds beside it: tenths where those have any.
    decimals = int(any(round(time_s, 1) % 1.0 for times_s in table.times_s for time_s in times_s if time_s is not None))
    cells = (_between(epoch, times_s, decimals=decimals, dated=dated) for times_s in table.times_s)
    rows = tuple(map(widened, table.rows, cells))
    return replace(table, heads=widened(table.heads, head), rows=rows)


def _columns(columns: Columns | Callable[[], Columns], epoch: Epoch) -> Columns:
    """Return the columns of a CSV file with the clock, in ISO 8601, behind each column of times."""
    made: dict[str, Any] = {}
    for name, values in (columns() if callable(columns) else columns).items():
        made[name] = values
        if name in TIMES:
            made[f"{name.removesuffix(' [s]').removesuffix('_s')}_clock"] = epoch.moments(
                np.array(values, dtype=np.float64)
            )
    return made


def _drawing(drawing: Drawing, epoch: Epoch) -> Drawing:
    return replace(drawing, panels=tuple(replace(panel, midnight_s=epoch.midnight_s) for panel in drawing.panels))


def _sentence(sentence: str, *, epoch: Epoch, dated: bool) -> str:
    """Return a sentence with clock times in place of seconds since 1970."""

    def shown(match: re.Match[str]) -> str:
        if match["high"] is None:
            return match[0]
        texts = [text for text in (match["low"], match["high"]) if text]
        decimals = max(len(text.partition(".")[2]) for text in texts)
        return _between(epoch, map(float, texts), decimals=decimals, dated=dated)

    return SINCE_1970.sub(shown, sentence)
