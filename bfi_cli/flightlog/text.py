"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments; Garmin's among them."""

from __future__ import annotations

import csv
import math
import os
import re
from array import array
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import TextIO

import numpy as np

from ..channels import split_unit
from ..errors import LogError
from ..filters import filters_from_json
from ..units import si_unit
from .cells import Cells, in_seconds
from .raw import RawLog, Track, require_few
from .record import CLEAN, faults_from_json, segments_from_json
from .topics import maps_of

FAULTS = "# faults: "
SEGMENTS = "# segments: "
FILTERS = "# filters: "
# Bytes; a cell of two characters becomes a number of eight bytes, and a log is held twice while it is put together.
LARGEST_TEXT = 10**9
# Garmin's first line, and the line of units below it.
AIRFRAME, UNITS = "#airframe_info", "# units"
DECIMAL_POINT = re.compile(r"(?<![\d.])\d+\.\d+(?![\d.])")
# Characters. The longest lines are the JSON of the faults of a log; a row of 10 000 channels has 250 000.
LONGEST_LINE = 10**6


def read_csv(path: str) -> RawLog:
    """Read a CSV log; empty cells are NaN.

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
        return _read(path, "utf-8-sig")
    except UnicodeDecodeError:
        return _read(path, "latin-1")


def _read(path: str, encoding: str) -> RawLog:
    comments: dict[str, str] = {}
    with open(path, encoding=encoding) as file:
        rows = _rows(path, file, comments)
        header = next(rows, None)
        if header is None:
            raise LogError(f"{path}: no header line, the file holds no text but comments; give a log with channels")
        delimiter = next((sign for sign in (";", "\t") if sign in header[1]), ",")
        garmin = AIRFRAME in comments
        second = next(rows, None)
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
        cells = Cells(names=names, comma=delimiter != "," and not any(DECIMAL_POINT.search(text) for _, text in first))
        numbers = array("d")  # eight bytes a number while it grows
        notes: list[str] = []
        all_numbers = False  # of a row so far, so that its columns are known
        for line, text in chain(first, rows):
            parts = text.split(delimiter)
            try:
                if not cells.plain or "_" in text or len(parts) != len(names):
                    raise ValueError
                numbers.extend([float(cell) for cell in parts])
                all_numbers = True
            except ValueError:
                parts = _cells(text, delimiter)
                if garmin and len(parts) < len(names) and next(rows, None) is None:
                    notes.append(f"line {line} is cut off and is left out")
                    break
                if all_numbers:
                    cells.kinds = [kind or "number" for kind in cells.kinds]
                numbers.extend(cells.numbers(f"{path}: line {line}", parts))
    values = np.frombuffer(numbers).reshape(-1, len(names))
    columns = [
        Track(source=source, values=values[:, i].copy(), unit=unit or units[i])
        for i, (source, unit) in enumerate(map(split_unit, names))
    ]
    if not cells.plain:
        columns, added = in_seconds(columns, cells.kinds)
        notes += added
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
    return RawLog(columns=columns, segments=segments, filters=filters, faults=faults, clean=clean, notes=tuple(notes))


def _two_headers(upper: str, lower: str, delimiter: str) -> str | None:
    """Return one header of the two of a Garmin G3X: short names below, the units of the long names above."""
    long, short = (_cells(line, delimiter) for line in (upper, lower))
    if len(long) != len(short) or any(map(_is_number, short)):
        return None
    units = [split_unit(one)[1] for one in long]
    return delimiter.join(f"{name.strip()} [{unit}]" if unit else name for name, unit in zip(short, units, strict=True))


def _units(line: str, delimiter: str, count: int) -> list[str | None] | None:
    """Return the units of a line of them, None where a line holds something else; those that are unknown are left."""
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
    """Yield number and text of the lines that are neither empty nor comments; keep those on faults, segments, filters.

    Raises
    ------
    LogError : a line that is longer than any log's.
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
        raise LogError(f"{path}: no header, line {line} holds numbers; write the channels' names above them")
    require_few(path, len(cells), "columns")
    places: dict[str, int] = {}
    for i, cell in enumerate(cells, start=1):
        if not cell:
            raise LogError(f"{path}: line {line}, column {i} has no name; name every channel in the header")
        if cell in places:
            raise LogError(f"{path}: columns {places[cell]} and {i} are both named '{cell}'; rename one of them")
        places[cell] = i
    return cells
