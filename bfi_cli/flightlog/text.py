"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments, decimal point."""

from __future__ import annotations

import csv
import math
import os
from array import array
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from typing import TextIO

import numpy as np

from ..channels import split_unit
from ..errors import LogError
from .raw import RawColumn, RawLog, require_few
from .record import CLEAN, faults_from_json, segments_from_json

__all__ = ["FAULTS", "SEGMENTS", "read_csv"]

FAULTS = "# faults: "
SEGMENTS = "# segments: "
# Bytes; a cell of two characters becomes a number of eight bytes, and a log is held twice while it is put together.
LARGEST_TEXT = 10**9
# Characters. The longest lines are the JSON of the faults of a log; a row of 10 000 channels has 250 000.
LONGEST_LINE = 10**6
ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})


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
        names = _header(path, *header, delimiter=delimiter)
        first = list(islice(rows, 2))
        if len(first) < 2:
            raise LogError(f"{path}: {len(first)} samples below the header, at least 2 are needed; give a recorded log")
        numbers = array("d")  # eight bytes a number while it grows
        for line, text in chain(first, rows):
            cells = text.split(delimiter)
            try:
                if "_" in text or len(cells) != len(names):
                    raise ValueError
                numbers.extend([float(cell) for cell in cells])
            except ValueError:
                numbers.extend(_careful(f"{path}: line {line}", _cells(text, delimiter), names))
    values = np.frombuffer(numbers).reshape(-1, len(names))
    columns = []
    for i, name in enumerate(names):
        source, unit = split_unit(name)
        columns.append(RawColumn(source=source, values=values[:, i].copy(), unit=unit or None))
    segments = segments_from_json(comments.get(SEGMENTS, "[]"), where=f"{path}: segments")
    if FAULTS not in comments:
        return RawLog(columns=columns, segments=segments)
    return RawLog(
        columns=[c for c in columns if not c.source.endswith(CLEAN)],
        segments=segments,
        faults=faults_from_json(comments[FAULTS], where=f"{path}: faults"),
        clean={c.source.removesuffix(CLEAN): c for c in columns if c.source.endswith(CLEAN)},
    )


def _rows(path: str, file: TextIO, comments: dict[str, str]) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines that are neither empty nor comments; keep comments on faults and segments.

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
            for key in (FAULTS, SEGMENTS):
                if text.startswith(key):
                    comments.setdefault(key, text.removeprefix(key))
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
    for cell in cells:
        try:
            is_number = math.isfinite(float(cell))
        except ValueError:
            continue
        if is_number:
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


def _careful(where: str, cells: list[str], names: Sequence[str]) -> list[float]:
    """Return the numbers of a row with empty cells, quotes or a delimiter at its end."""
    if len(cells) == len(names) + 1 and not cells[-1].strip():
        cells = cells[:-1]
    if len(cells) != len(names):
        raise LogError(f"{where} has {len(cells)} values, the header names {len(names)} channels; mend the line")
    numbers = []
    for cell, name in zip(map(str.strip, cells), names, strict=True):
        try:
            if "_" in cell:  # which Python reads as a part of a number
                raise ValueError
            numbers.append(math.nan if cell.lower() in ABSENT else float(cell))
        except ValueError:
            raise LogError(
                f"{where}, column '{name}': not a number, got '{cell[:40]}'; mend the cell or empty it"
            ) from None
    return numbers
