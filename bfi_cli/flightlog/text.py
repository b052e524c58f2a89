"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments; Garmin's among them.

Cells are numbers, with decimal commas too, clocks and dates; columns of text are left out.
"""

from __future__ import annotations

import codecs
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..channels import match_name, split_unit
from ..errors import LogError
from ..filters import filters_from_json
from ..notes import Note
from ..units import si_unit
from .cells import ABSENT, Kind, Lines, Table, cells_of, with_commas
from .raw import BESIDE_TIME, DAY_S, Asked, RawLog, Track, from_midnight, require_few
from .record import CLEAN, faults_from_json, segments_from_json
from .topics import maps_of

FAULTS = "# faults: "
SEGMENTS = "# segments: "
FILTERS = "# filters: "
# Limit of a text, bytes: a cell of two characters becomes a number of eight bytes, and assembling holds a log twice.
LARGEST_TEXT = 10**9
# Garmin's first line, and the line of units below it.
AIRFRAME, UNITS = "#airframe_info", "# units"
DECIMAL_POINT = re.compile(r"(?<![\d.])\d+\.\d+(?![\d.])")


def wide_encoding(head: bytes) -> str | None:
    """Return the encoding of a text of two bytes per character from its first bytes; None for any other text."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = head[: len(head) // 2 * 2 : 2], head[1::2]
    if not even or b"\0" not in head:
        return None
    if not any(odd) and all(even):
        return "utf-16-le"
    return "utf-16-be" if not any(even) and all(odd) else None


def read_csv(path: str, asked: Asked, encoding: str | None = None) -> RawLog:
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


def _read(path: str, encoding: str, asked: Asked) -> RawLog:
    with open(path, encoding=encoding) as file:
        lines = Lines(path, file)
        header = lines.next()
        if header is None:
            raise LogError(f"{path}: no header line, the file holds no text but comments; give a log with channels")
        second = lines.next()
        if _is_spaced(header[1] if asked.columns or second is None else second[1]):
            lines.spaced = True
            header, second = with_commas(header), second and with_commas(second)
        delimiter = next((sign for sign in (";", "\t") if sign in header[1]), ",")
        if asked.columns:
            lines.put_back(second)
            header, second = (0, _named(path, header, asked.columns, delimiter)), header
        comments = _comments(lines.comments)
        garmin = AIRFRAME in comments
        if garmin and second is not None and (joined := _two_headers(header[1], second[1], delimiter)):
            header, second = (second[0], joined), lines.next()
        heads, left_out = _header(path, *header, delimiter=delimiter, asked=asked)
        names, units = [name for name, _ in heads], [unit for _, unit in heads]
        stated: list[str | None] | None = None
        if garmin and UNITS in comments:
            stated = _units(comments[UNITS].lstrip("#"), delimiter, len(names))
        elif second is not None and (stated := _units(second[1], delimiter, len(names))):
            second = lines.next()
        units = [unit or below for unit, below in zip(units, stated or units, strict=True)]
        first = [row for row in (second, lines.next()) if row is not None]
        if len(first) < 2:
            raise LogError(f"{path}: {len(first)} samples below the header, at least 2 are needed; give a recorded log")
        comma = delimiter != "," and not any(DECIMAL_POINT.search(text) for _, text in first)
        for row in reversed(first):
            lines.put_back(row)
        table = Table(path, names, delimiter, comma=comma)
        table.read(lines)
    table.require_numbers(asked.sources)
    return _log_of(path, table, units, _comments(lines.comments), left_out)


def _log_of(
    path: str, table: Table, units: Sequence[str | None], comments: Mapping[str, str], left_out: dict[str, str]
) -> RawLog:
    """Return the log of a table, with the annotations that its comments hold."""
    tracks, kinds = list[Track](), list[Kind | None]()
    for read, unit in zip(table.columns, units, strict=True):
        if read.is_text:
            left_out[read.name] = read.why_text
        elif read.name:
            tracks.append(Track(source=read.name, values=read.values, unit=unit))
            kinds.append(read.kind)
    made = in_seconds(tracks, kinds)
    columns = list(made.columns)
    if min((column.values.size for column in columns), default=2) < 2:
        raise LogError(f"{path}: less than 2 samples with a time, at least 2 are needed; give a recorded log")
    maps = {row.field: row for row in maps_of("garmin")} if AIRFRAME in comments else {}
    for i, column in enumerate(columns):
        if known := maps.get(column.source):
            values = known.scale * column.values + known.offset
            columns[i] = replace(column, values=values, unit=known.unit, channel=known.channel)
    segments = segments_from_json(comments.get(SEGMENTS, "[]"), where=f"{path}: segments")
    filters = filters_from_json(comments[FILTERS], where=f"{path}: filters") if FILTERS in comments else None
    faults, clean = None, dict[str, Track]()
    if FAULTS in comments:
        faults = faults_from_json(comments[FAULTS], where=f"{path}: faults")
        clean = {c.source.removesuffix(CLEAN): c for c in columns if c.source.endswith(CLEAN)}
        columns = [c for c in columns if not c.source.endswith(CLEAN)]
    return replace(
        made,
        columns=columns,
        segments=segments,
        filters=filters,
        faults=faults,
        clean=clean,
        notes=(*table.notes, *made.notes),
        left_out={**left_out, **made.left_out},
    )


def _comments(lines: Sequence[str]) -> dict[str, str]:
    """Return the comments on faults, segments, filters and the airframe, and the line of units below the last."""
    comments: dict[str, str] = {}
    for text in lines:
        for key in (FAULTS, SEGMENTS, FILTERS):
            if text.startswith(key):
                comments.setdefault(key, text.removeprefix(key))
        if AIRFRAME in comments:
            comments.setdefault(UNITS, text)
        elif text.startswith(AIRFRAME):
            comments[AIRFRAME] = text
    return comments


def _is_spaced(line: str) -> bool:
    """Say whether a line holds several numbers with blanks between them."""
    cells = line.split()
    return len(cells) > 1 and not any(sign in line for sign in ",;\t") and all(map(_is_number, cells))


def _named(path: str, first: tuple[int, str], named: Sequence[str], delimiter: str) -> str:
    """Return a header line of the names that `--columns` gives to a table without one."""
    cells = cells_of(first[1], delimiter)
    if not all(_is_number(cell) or cell.strip().lower() in ABSENT for cell in cells):
        raise LogError(f"{path}: line {first[0]} is a header; leave out --columns, or map its names with --channel")
    if len(cells) != len(named):
        raise LogError(f"{path}: line {first[0]} has {len(cells)} columns, --columns names {len(named)}; name them all")
    return delimiter.join(named)


def _two_headers(upper: str, lower: str, delimiter: str) -> str | None:
    """Return the header of a Garmin G3X: the short names of the lower line with the units of the upper line."""
    long, short = (cells_of(line, delimiter) for line in (upper, lower))
    if len(long) != len(short) or any(map(_is_number, short)):
        return None
    units = [split_unit(one)[1] for one in long]
    return delimiter.join(f"{name.strip()} [{unit}]" if unit else name for name, unit in zip(short, units, strict=True))


def _units(line: str, delimiter: str, count: int) -> list[str | None] | None:
    """Return the units of a line of units, None for any other line; a unit that is not known is None."""
    cells = [cell.strip().strip("[]()").strip() for cell in cells_of(line, delimiter)]
    stated = [cell for cell in cells[:count] if cell]
    known = {cell for cell in stated if cell != "-" and si_unit(cell) is not None}
    if not stated or any(map(_is_number, stated)) or 2 * sum(cell in known for cell in stated) < len(stated):
        return None
    return [cell if cell in known else None for cell in cells[:count]] + [None] * (count - len(cells))


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _header(
    path: str, line: int, text: str, *, delimiter: str, asked: Asked
) -> tuple[list[tuple[str, str | None]], dict[str, str]]:
    """Return names and units of the columns, and by name or place why a column is left out.

    A column that is left out, because it has no name or that of one before it, has the name "".

    Raises
    ------
    LogError : the line holds numbers, or several columns have a name that an option mentions.
    """
    cells = [cell.strip() for cell in cells_of(text, delimiter)]
    if cells and not cells[-1]:
        cells.pop()
    if any(map(_is_number, cells)):
        raise LogError(
            f"{path}: no header, line {line} holds numbers; write the channels' names above them, or give --columns"
        )
    require_few(path, len(cells), "columns")
    columns, places, left_out = list[tuple[str, str | None]](), dict[str, int](), dict[str, str]()
    for i, (name, unit) in enumerate(map(split_unit, cells), start=1):
        if name in places and name in asked.sources:
            raise LogError(f"{path}: columns {places[name]} and {i} are both named '{name}'; rename one of them")
        if not name:
            left_out[f"column {i}"] = "has no name"
        elif name in places:
            left_out[f"column {i}"] = f"is a second '{name}'"
        columns.append(("" if name in places else name, unit))
        places.setdefault(name, i)
    return columns, left_out


def in_seconds(columns: Sequence[Track], kinds: Sequence[Kind | None]) -> RawLog:
    """Return the columns; without a column of seconds the time axis is made of clock and date.

    Time counts from midnight of the first day (UTC where an offset is stated) and goes on through later days. Rows
    without a time are left out. Of a clock in whole seconds, rows that repeat the second of the row before are left
    out, unless most seconds have several rows, which are then spread evenly over their second.
    """
    by_kind: dict[Kind | None, list[Track]] = {}
    for column, kind in zip(columns, kinds, strict=True):
        by_kind.setdefault(kind, []).append(column)
    dates, clocks, moments = by_kind.get("date", []), by_kind.get("clock", []), by_kind.get("moment", [])
    notes = list[Note]()
    kept = [c for c, kind in zip(columns, kinds, strict=True) if kind in ("number", None)]
    timed = [*moments, *clocks, *dates]
    matches = (match_name(column.source) for column in kept)
    if not timed or timed[0] in dates or any(match is not None and match.name == "time" for match in matches):
        return RawLog(columns=kept, left_out=dict.fromkeys((column.source for column in timed), BESIDE_TIME))
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
        notes.append(from_midnight(first, zone=""))
    if not rows.all():
        notes.append(Note.method(f"{np.count_nonzero(~rows)} rows without a time are left out"))
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
    steps = np.diff(time_s[rows])
    missing = int(np.count_nonzero(steps > 1.5 * np.median(steps))) if steps.size else 0
    if missing:
        notes.append(
            Note.advice(
                f"the clock '{chosen.source}' skips {missing} times; --rate {1.0 / float(np.median(steps)):.4g} fills "
                "single missing samples"
            )
        )
    time = Track(source=chosen.source, values=time_s[rows], unit="s", channel="time")
    kept = [time, *(replace(column, values=column.values[rows]) for column in kept)]
    return RawLog(columns=kept, notes=tuple(notes))


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
