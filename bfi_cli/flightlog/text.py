"""CSV logs: a header `name` or `name [unit]`, comma, semicolon or tab, `#` comments, decimal point."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..channels import split_unit
from ..errors import LogError
from ..faults import Fault
from .annotations import faults_from_json, segments_from_json
from .raw import RawColumn, RawLog

__all__ = ["CLEAN", "FAULTS", "SEGMENTS", "read_csv"]

FAULTS = "# faults: "
SEGMENTS = "# segments: "
CLEAN = "_clean"
ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})


def read_csv(path: str) -> RawLog:
    """Read a CSV log; empty cells are NaN.

    Raises
    ------
    LogError : no header, ragged rows, text where a number belongs (with line and column), no samples.
    """
    lines = _decode(Path(path).read_bytes()).splitlines()
    rows = [(i, line) for i, line in enumerate(lines, start=1) if line.strip() and line.lstrip()[0] != "#"]
    if not rows:
        raise LogError(f"{path}: no header line, the file holds no text but comments; give a log with channels")
    delimiter = _delimiter(rows[0][1])
    names = _header(path, *rows[0], delimiter=delimiter)
    values = _numbers(path, rows[1:], names, delimiter=delimiter)
    columns = _columns(names, values)
    faults = _comment(lines, FAULTS)
    if faults is None:
        return RawLog(columns=columns, segments=segments_from_json(_comment(lines, SEGMENTS) or "[]", where=path))
    return _with_truth(path, columns, lines, faults_from_json(faults, where=f"{path}: faults"))


def _with_truth(path: str, columns: list[RawColumn], lines: list[str], faults: tuple[Fault, ...]) -> RawLog:
    clean = {c.source.removesuffix(CLEAN): c for c in columns if c.source.endswith(CLEAN)}
    return RawLog(
        columns=[c for c in columns if not c.source.endswith(CLEAN)],
        segments=segments_from_json(_comment(lines, SEGMENTS) or "[]", where=f"{path}: segments"),
        faults=faults,
        clean=clean,
    )


def _decode(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _comment(lines: Sequence[str], key: str) -> str | None:
    return next((line.removeprefix(key) for line in lines if line.startswith(key)), None)


def _delimiter(header: str) -> str:
    return next((sign for sign in (";", "\t") if sign in header), ",")


def _cells(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error:
        return line.split(delimiter)


def _header(path: str, line: int, text: str, *, delimiter: str) -> list[str]:
    cells = [cell.strip() for cell in _cells(text, delimiter)]
    if cells and not cells[-1]:
        cells.pop()
    if any(_is_number(cell) for cell in cells):
        raise LogError(f"{path}: no header, line {line} holds numbers; write the channels' names above them")
    for i, cell in enumerate(cells):
        if not cell:
            raise LogError(f"{path}: line {line}, column {i + 1} has no name; name every channel in the header")
        if cell in cells[:i]:
            at = cells.index(cell) + 1
            raise LogError(f"{path}: columns {at} and {i + 1} are both named '{cell}'; rename one of them")
    return cells


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _numbers(
    path: str, rows: Sequence[tuple[int, str]], names: Sequence[str], *, delimiter: str
) -> NDArray[np.float64]:
    if len(rows) < 2:
        raise LogError(f"{path}: {len(rows)} samples below the header, at least 2 are needed; give a recorded log")
    values = np.empty((len(rows), len(names)))
    for i, (line, text) in enumerate(rows):
        cells = text.split(delimiter)
        try:
            if "_" in text or len(cells) != len(names):
                raise ValueError
            values[i] = [float(cell) for cell in cells]
        except ValueError:
            values[i] = _careful(f"{path}: line {line}", _cells(text, delimiter), names)
    return values


def _careful(where: str, cells: list[str], names: Sequence[str]) -> list[float]:
    if len(cells) == len(names) + 1 and not cells[-1].strip():
        cells = cells[:-1]
    if len(cells) != len(names):
        raise LogError(f"{where} has {len(cells)} values, the header names {len(names)} channels; mend the line")
    return [_number(where, cell.strip(), name) for cell, name in zip(cells, names, strict=True)]


def _number(where: str, cell: str, name: str) -> float:
    if cell.lower() in ABSENT:
        return math.nan
    try:
        if "_" in cell:
            raise ValueError
        return float(cell)
    except ValueError:
        raise LogError(
            f"{where}, column '{name}': not a number, got '{cell[:40]}'; mend the cell or empty it"
        ) from None


def _columns(names: Sequence[str], values: NDArray[np.float64]) -> list[RawColumn]:
    split = [split_unit(name) for name in names]
    return [RawColumn(source=s, values=values[:, i].copy(), unit=u or None) for i, (s, u) in enumerate(split)]
