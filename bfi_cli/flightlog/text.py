"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments; Garmin's among them.

Cells are numbers, with decimal commas too, clocks and dates; columns of text are left out.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..epoch import DAY_S, Epoch, epoch_of_clock
from ..errors import LogError
from ..notes import Note
from ..quantities.channels import match_name, si_unit, to_si
from .axis import made_regular, note_on_order, out_of_order, with_midnights, without_jumps
from .cells import Kind, Lines, Table
from .layouts import Heading, heading_of, with_channels
from .raw import BESIDE_TIME, KEYS, FloatArray, RawLog, ReadRequest, annotated
from .record import CLEAN, Track

# s, and share of the record: by so much a clock of whole seconds may run apart from the time axis beside it.
ALIKE_S, ALIKE = 2.0, 0.01
# Limit of a text, bytes: a cell of two characters becomes a number of eight bytes, and assembling holds a log twice.
LARGEST_TEXT = 10**9
DECIMAL_POINT = re.compile(r"(?<![\d.])\d+\.\d+(?![\d.])")


def read_csv(path: str, asked: ReadRequest, encoding: str | None = None) -> RawLog:
    """Read a CSV log, or one with blanks between its columns; empty cells are NaN.

    Parameters
    ----------
    asked : its `columns` name the columns of a text without a header.
    encoding : of the text; None for UTF-8, or Latin-1 if that fails.

    Raises
    ------
    LogError : no header, ragged rows, text where a number belongs (with line and column), no samples; too large.
    """
    size = os.path.getsize(path)
    if size > LARGEST_TEXT:
        raise LogError(
            f"{path}: {size / 1e9:.1f} GB of text, the limit is {LARGEST_TEXT / 1e9:.0f} GB (numbers take up to four "
            "times as much in memory); cut the log, or export it as HDF5 and give --from/--to"
        )
    try:
        return _read(path, encoding or "utf-8-sig", asked)
    except UnicodeDecodeError:
        if encoding is not None:
            raise LogError(f"{path}: damaged {encoding.upper()} text; save it as UTF-8") from None
        return _read(path, "latin-1", asked)


def _read(path: str, encoding: str, asked: ReadRequest) -> RawLog:
    with open(path, encoding=encoding) as file:
        lines = Lines(path, file)
        heading = heading_of(path, lines, asked)
        first = [row for row in (lines.next(), lines.next()) if row is not None]
        if len(first) < 2:
            raise LogError(f"{path}: {len(first)} samples below the header, at least 2 are needed; give a recorded log")
        comma = heading.delimiter != "," and not any(DECIMAL_POINT.search(text) for _, text in first)
        for row in reversed(first):
            lines.put_back(row)
        table = Table(path, heading.names, heading.delimiter, comma=comma)
        table.read(lines)
    table.require_numbers(asked.sources)
    comments = {
        key: text.removeprefix(f"# {key}: ")
        for text in reversed(lines.comments)  # the first of each counts
        for key in KEYS
        if text.startswith(f"# {key}: ")
    }
    return _log_of(path, table, heading, comments)


def _log_of(path: str, table: Table, heading: Heading, comments: Mapping[str, str]) -> RawLog:
    """Return the log of a table, with the annotations that its comments hold."""
    tracks, kinds, left_out = list[Track](), list[Kind | None](), dict(heading.left_out)
    for read, unit in zip(table.columns, heading.units, strict=True):
        if read.is_text:
            left_out[read.name] = read.why_text
        elif read.name:
            tracks.append(Track(source=read.name, values=read.values, unit=unit))
            kinds.append(read.kind)
    if heading.recorder is not None:
        tracks = with_channels(tracks, heading.recorder)
    made = in_seconds(tracks, kinds)
    if min((column.values.size for column in made.columns), default=2) < 2:
        raise LogError(f"{path}: less than 2 samples with a time, at least 2 are needed; give a recorded log")
    log = annotated(made, comments, where=path)
    columns, clean = log.columns, dict[str, Track]()
    if log.faults is not None:
        clean = {c.source.removesuffix(CLEAN): c for c in columns if c.source.endswith(CLEAN)}
        columns = [c for c in columns if not c.source.endswith(CLEAN)]
    return replace(
        log,
        columns=columns,
        clean=clean,
        notes=(*table.notes, *made.notes),
        left_out={**left_out, **made.left_out},
    )


def _is_time(column: Track) -> bool:
    match = match_name(column.source) if column.channel is None else None
    return column.channel == "time" or (match is not None and match.name == "time")


def _with_epoch(time: Track, moments_s: FloatArray, is_utc: bool, is_dated: bool) -> Track:
    """Return a time axis with the epoch that a clock beside it shows, unless the two do not run alike."""
    stated = time.unit or "s"
    if si_unit(stated) != "s":
        return time
    time_s = to_si(time.values, stated)[0]
    known = np.flatnonzero(np.isfinite(time_s) & np.isfinite(moments_s))
    if known.size < 2:
        return time
    span_s, by_clock = (float(values[known[-1]] - values[known[0]]) for values in (time_s, moments_s))
    if abs(by_clock - span_s) > ALIKE_S + ALIKE * abs(span_s):
        return time
    return replace(time, epoch=epoch_of_clock(moments_s, time_s, is_utc=is_utc, is_dated=is_dated))


def in_seconds(columns: Sequence[Track], kinds: Sequence[Kind | None]) -> RawLog:
    """Return the columns; without a column of seconds the time axis is made of clock and date.

    Time counts from midnight of the first day (UTC where an offset is stated) and goes on through later days. Rows
    without a time are left out. Of a clock in whole seconds, rows that repeat the second of the row before are left
    out, unless most seconds have several rows, which are then spread evenly over their second.
    """
    by_kind: dict[Kind | None, list[Track]] = {}
    for column, kind in zip(columns, kinds, strict=True):
        by_kind.setdefault(kind, []).append(column)
    dates, clocks = by_kind.get("date", []), by_kind.get("clock", [])
    in_utc = by_kind.get("utc_moment", [])
    moments = [column for column in columns if column in by_kind.get("moment", []) or column in in_utc]
    notes = list[Note]()
    kept = [c for c, kind in zip(columns, kinds, strict=True) if kind in ("number", None)]
    timed = [*moments, *clocks, *dates]
    if not timed or timed[0] in dates or any(map(_is_time, kept)):
        beside = dict.fromkeys((column.source for column in timed), BESIDE_TIME)
        if timed and (moments or clocks):
            moments_s = timed[0].values + (dates[0].values if timed[0] in clocks and dates else 0.0)
            dated = bool(moments or dates)
            kept = [_with_epoch(c, moments_s, timed[0] in in_utc, dated) if _is_time(c) else c for c in kept]
        return RawLog(columns=kept, left_out=beside)
    chosen = timed[0]
    time_s = chosen.values.copy()
    if chosen in clocks and dates:
        time_s += dates[0].values
    rows = np.isfinite(time_s)
    if chosen in clocks and not dates:
        time_s[rows] = with_midnights(time_s[rows])
    time_s[rows], jumps = without_jumps(chosen.source, time_s[rows], zones=True)
    notes += jumps
    if not rows.all():
        notes.append(Note.method(f"{np.count_nonzero(~rows)} rows without a time are left out"))
    if (single := out_of_order(time_s[rows])).any():
        rows[rows] = ~single
        notes.append(note_on_order(int(np.count_nonzero(single))))
    epoch = Epoch(since_1970_s=0.0, is_utc=chosen in in_utc, is_dated=False)
    if rows.any() and time_s[rows][0] >= DAY_S:
        first = float(np.floor(time_s[rows][0] / DAY_S) * DAY_S)
        time_s -= first
        epoch = replace(epoch, since_1970_s=first, is_dated=True)
    time_s[rows], regular = made_regular(chosen.source, time_s[rows])
    notes += regular
    steps = np.diff(time_s[rows])
    if np.any(steps == 0.0) and np.all(time_s[rows] % 1.0 == 0.0):
        if np.median(steps) == 0.0:
            time_s[rows] = _spread(time_s[rows])
            notes.append(
                Note.method(f"the clock '{chosen.source}' has whole seconds; the rows of a second are spread over it")
            )
        else:
            repeated = np.flatnonzero(rows)[1:][steps == 0.0]
            rows[repeated] = False
            notes.append(Note.method(f"rows that repeat the second before are left out: {repeated.size}"))
    used = dates[:1] if chosen in clocks else []
    why = f"the clock of the log{''.join(f', with the dates of {track.source!r}' for track in used)}"
    time = Track(source=chosen.source, values=time_s[rows], unit="s", channel="time", epoch=epoch, why=why)
    kept = [time, *(replace(column, values=column.values[rows]) for column in kept)]
    aside = {track.source: BESIDE_TIME for track in timed if track is not chosen and track not in used}
    return RawLog(columns=kept, notes=tuple(notes), left_out=aside)


def _spread(time_s: np.ndarray) -> np.ndarray:
    """Return whole seconds with the rows of each spread evenly over it; first and last second at the usual rate."""
    starts = np.flatnonzero(np.diff(time_s, prepend=time_s[0] - 1.0))
    counts = np.diff(np.append(starts, time_s.size))
    usual = max(int(np.median(counts)), int(counts[-1]))
    within = np.arange(time_s.size) - np.repeat(starts, counts)
    dense = counts.copy()
    dense[-1] = usual
    if counts[0] < usual:  # the log began inside this second
        dense[0], within[: counts[0]] = usual, within[: counts[0]] + usual - counts[0]
    return np.asarray(time_s + within / np.repeat(dense, counts))
