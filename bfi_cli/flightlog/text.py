"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments; Garmin's among them.

Cells are numbers, with decimal commas too, clocks and dates; columns of text are left out.
"""

from __future__ import annotations

import codecs
import csv
import math
import os
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from itertools import chain
from typing import Literal, TextIO

import numpy as np

from ..channels import match_name, split_unit
from ..errors import LogError
from ..filters import filters_from_json
from ..notes import Note
from ..units import si_unit
from .raw import BESIDE_TIME, DAY_S, Asked, RawLog, Track, from_midnight, require_few
from .record import CLEAN, FloatArray, faults_from_json, segments_from_json
from .topics import maps_of

Kind = Literal["number", "clock", "date", "moment", "text"]

ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
CLOCK = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
EPOCH = date(1970, 1, 1).toordinal()


FAULTS = "# faults: "
SEGMENTS = "# segments: "
FILTERS = "# filters: "
# Limit of a text, bytes: a cell of two characters becomes a number of eight bytes, and assembling holds a log twice.
LARGEST_TEXT = 10**9
# Garmin's first line, and the line of units below it.
AIRFRAME, UNITS = "#airframe_info", "# units"
DECIMAL_POINT = re.compile(r"(?<![\d.])\d+\.\d+(?![\d.])")
# Characters. The longest lines are the JSON of the faults of a log; a row of 10 000 channels has 250 000.
LONGEST_LINE = 10**6


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
        return _read(path, encoding or "utf-8-sig", asked.columns)
    except UnicodeDecodeError:
        if encoding is not None:
            raise LogError(f"{path}: damaged {encoding.upper()} text; save it as UTF-8") from None
        return _read(path, "latin-1", asked.columns)


def _read(path: str, encoding: str, named: Sequence[str]) -> RawLog:
    comments: dict[str, str] = {}
    with open(path, encoding=encoding) as file:
        rows = _rows(path, file, comments)
        header = next(rows, None)
        if header is None:
            raise LogError(f"{path}: no header line, the file holds no text but comments; give a log with channels")
        second = next(rows, None)
        if _is_spaced(header[1] if named or second is None else second[1]):
            header, second, rows = _with_commas(header), second and _with_commas(second), map(_with_commas, rows)
        delimiter = next((sign for sign in (";", "\t") if sign in header[1]), ",")
        if named:
            first_row, rows = header, chain([] if second is None else [second], rows)
            header, second = (0, _named(path, header, named, delimiter)), first_row
        garmin = AIRFRAME in comments
        if garmin and second is not None and (heads := _two_headers(header[1], second[1], delimiter)):
            header, second = (second[0], heads), next(rows, None)
        names = _header(path, *header, delimiter=delimiter)
        units: list[str | None] = [None] * len(names)
        if garmin and UNITS in comments:
            units = _units(comments[UNITS].lstrip("#"), delimiter, len(names)) or units
        elif second is not None and (stated := _units(second[1], delimiter, len(names))):
            units, second = stated, next(rows, None)
        first = [row for row in (second, next(rows, None)) if row is not None]
        if len(first) < 2:
            raise LogError(f"{path}: {len(first)} samples below the header, at least 2 are needed; give a recorded log")
        comma = delimiter != "," and not any(DECIMAL_POINT.search(text) for _, text in first)
        cells = Cells(names=names, comma=comma, kinds=[None] * len(names))
        values, notes = cells.table(path, chain(first, rows), delimiter, may_be_cut=garmin)
    columns = [
        Track(source=source, values=values[:, i].copy(), unit=unit or units[i])
        for i, (source, unit) in enumerate(map(split_unit, names))
    ]
    made = RawLog(columns=columns) if cells.plain else in_seconds(columns, cells.kinds)
    columns = list(made.columns)
    if min((column.values.size for column in columns), default=2) < 2:
        raise LogError(f"{path}: less than 2 samples with a time, at least 2 are needed; give a recorded log")
    maps = {row.field: row for row in maps_of("garmin")} if garmin else {}
    for i, column in enumerate(columns):
        if row := maps.get(column.source):
            values = row.scale * column.values + row.offset
            columns[i] = replace(column, values=values, unit=row.unit, channel=row.channel)
    segments = segments_from_json(comments.get(SEGMENTS, "[]"), where=f"{path}: segments")
    filters = filters_from_json(comments[FILTERS], where=f"{path}: filters") if FILTERS in comments else None
    faults, clean = None, dict[str, Track]()
    if FAULTS in comments:
        faults = faults_from_json(comments[FAULTS], where=f"{path}: faults")
        clean = {c.source.removesuffix(CLEAN): c for c in columns if c.source.endswith(CLEAN)}
        columns = [c for c in columns if not c.source.endswith(CLEAN)]
    notes += made.notes
    return replace(
        made, columns=columns, segments=segments, filters=filters, faults=faults, clean=clean, notes=tuple(notes)
    )


def _is_spaced(line: str) -> bool:
    """Say whether a line holds several numbers with blanks between them."""
    cells = line.split()
    return len(cells) > 1 and not any(sign in line for sign in ",;\t") and all(map(_is_number, cells))


def _with_commas(row: tuple[int, str]) -> tuple[int, str]:
    return row[0], ",".join(row[1].split())


def _named(path: str, first: tuple[int, str], named: Sequence[str], delimiter: str) -> str:
    """Return a header line of the names that `--columns` gives to a table without one."""
    cells = _cells(first[1], delimiter)
    if not all(_is_number(cell) or cell.strip().lower() in ABSENT for cell in cells):
        raise LogError(f"{path}: line {first[0]} is a header; leave out --columns, or map its names with --channel")
    if len(cells) != len(named):
        raise LogError(f"{path}: line {first[0]} has {len(cells)} columns, --columns names {len(named)}; name them all")
    return delimiter.join(named)


def _two_headers(upper: str, lower: str, delimiter: str) -> str | None:
    """Return the header of a Garmin G3X: the short names of the lower line with the units of the upper line."""
    long, short = (_cells(line, delimiter) for line in (upper, lower))
    if len(long) != len(short) or any(map(_is_number, short)):
        return None
    units = [split_unit(one)[1] for one in long]
    return delimiter.join(f"{name.strip()} [{unit}]" if unit else name for name, unit in zip(short, units, strict=True))


def _units(line: str, delimiter: str, count: int) -> list[str | None] | None:
    """Return the units of a line of units, None for any other line; a unit that is not known is None."""
    cells = [cell.strip().strip("[]()").strip() for cell in _cells(line, delimiter)]
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


def _rows(path: str, file: TextIO, comments: dict[str, str]) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines that are neither empty nor comments.

    The comments on faults, segments, filters and the airframe are added to `comments`.

    Raises
    ------
    LogError : a line of more than `LONGEST_LINE` characters.
    """
    line = 0
    while text := file.readline(LONGEST_LINE + 1):
        line += 1
        if len(text) > LONGEST_LINE:
            raise LogError(
                f"{path}: line {line} is longer than {LONGEST_LINE} characters; write a line for each sample, or "
                "export the log again"
            )
        if text.lstrip().startswith("#"):
            for key in (FAULTS, SEGMENTS, FILTERS):
                if text.startswith(key):
                    comments.setdefault(key, text.removeprefix(key))
            if AIRFRAME in comments:
                comments.setdefault(UNITS, text.rstrip("\n"))
            elif text.startswith(AIRFRAME):
                comments[AIRFRAME] = text
        elif text.strip():
            yield line, text.rstrip("\n")


def _cells(line: str, delimiter: str) -> list[str]:
    if '"' in line:
        try:
            return next(csv.reader([line], delimiter=delimiter))
        except csv.Error:
            pass
    return line.split(delimiter)


def _header(path: str, line: int, text: str, *, delimiter: str) -> list[str]:
    cells = [cell.strip() for cell in _cells(text, delimiter)]
    if cells and not cells[-1]:
        cells.pop()
    if any(map(_is_number, cells)):
        raise LogError(
            f"{path}: no header, line {line} holds numbers; write the channels' names above them, or give --columns"
        )
    require_few(path, len(cells), "columns")
    places: dict[str, int] = {}
    for i, cell in enumerate(cells, start=1):
        if not cell:
            raise LogError(f"{path}: line {line}, column {i} has no name; name every channel in the header")
        if cell in places:
            raise LogError(f"{path}: columns {places[cell]} and {i} are both named '{cell}'; rename one of them")
        places[cell] = i
    return cells


@dataclass(slots=True)
class Cells:
    """Reader of the cells of a table.

    Attributes
    ----------
    comma : whether a comma in a number is a decimal comma.
    kinds : of each column, by its first cell that is not empty; None before that.
    plain : whether all columns hold numbers so far.
    """

    names: Sequence[str]
    comma: bool
    kinds: list[Kind | None]
    plain: bool = True

    def table(
        self, path: str, rows: Iterator[tuple[int, str]], delimiter: str, *, may_be_cut: bool
    ) -> tuple[FloatArray, list[Note]]:
        """Return the numbers of all rows, (n_rows, n_columns), and a note where the last row is cut off.

        Raises
        ------
        LogError : a row of another length, or a cell that does not fit its column.
        """
        numbers = array("d")  # eight bytes a number while it grows
        all_numbers, notes = False, list[Note]()  # of a row so far, so that its columns are known
        for line, text in rows:
            parts = text.split(delimiter)
            try:
                if not self.plain or "_" in text or len(parts) != len(self.names):
                    raise ValueError
                numbers.extend([float(cell) for cell in parts])
                all_numbers = True
            except ValueError:
                parts = _cells(text, delimiter)
                if may_be_cut and len(parts) < len(self.names) and next(rows, None) is None:
                    notes = [Note.limit(f"line {line} is cut off and is left out")]
                    break
                if all_numbers:
                    self.kinds = [kind or "number" for kind in self.kinds]
                numbers.extend(self.numbers(f"{path}: line {line}", parts))
        return np.frombuffer(numbers).reshape(-1, len(self.names)), notes

    def numbers(self, where: str, cells: list[str]) -> list[float]:
        """Return the numbers of a row: NaN for empty cells and text, seconds for clocks and dates."""
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


def in_seconds(columns: Sequence[Track], kinds: Sequence[Kind | None]) -> RawLog:
    """Return the columns; without a column of seconds the time axis is made of clock and date.

    Time counts from midnight of the first day (UTC where an offset is stated) and goes on through later days. Rows
    without a time are left out. Of a clock in whole seconds, rows that repeat the second of the row before are left
    out, unless most seconds have several rows, which are then spread evenly over their second.
    """
    by_kind: dict[Kind | None, list[Track]] = {}
    for column, kind in zip(columns, kinds, strict=True):
        by_kind.setdefault(kind, []).append(column)
    texts, dates = by_kind.get("text", []), by_kind.get("date", [])
    clocks, moments = by_kind.get("clock", []), by_kind.get("moment", [])
    notes, left_out = list[Note](), dict.fromkeys((column.source for column in texts), "holds text")
    kept = [c for c, kind in zip(columns, kinds, strict=True) if kind in ("number", None)]
    timed = [*moments, *clocks, *dates]
    matches = (match_name(column.source) for column in kept)
    if not timed or timed[0] in dates or any(match is not None and match.name == "time" for match in matches):
        left_out |= dict.fromkeys((column.source for column in timed), BESIDE_TIME)
        return RawLog(columns=kept, left_out=left_out)
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
    return RawLog(columns=kept, notes=tuple(notes), left_out=left_out)


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
