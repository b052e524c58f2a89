"""MATLAB v5 logs: one variable per channel, a struct of structs with `data` and `units`, or the matrix of SIDPAC.

Structs that state their `Rate`, as those of DASHlink, have separate clocks, which begin together.

The layout of a file is checked before scipy parses it, because scipy's parser crashes on wrong sizes. Names follow
"MAT-File Format" by The MathWorks: a file is a sequence of data elements, each a tag (type, size) and data padded to
eight bytes; an array is an element made of elements.
"""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import first_line
from ..notes import Note
from . import raw
from .layouts import with_channels
from .raw import RawLog, ReadRequest
from .record import Track

# Types of elements, the sizes of their numbers and characters in bytes, and classes of arrays.
MATRIX, COMPRESSED = 14, 15
INT8, INT32, UINT32, UTF8 = 1, 5, 6, 16
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
TEXT = {1: 1, 2: 1, 4: 2, 16: 1, 17: 2, 18: 4}
CELL, STRUCT, CHAR = 1, 2, 4
UNLIKE = {3: "is an object", 5: "is a sparse matrix", 16: "is a function", 17: "is an object"}
NUMERIC = range(6, 16)
COMPLEX = 0x0800
# Limit of nested structs and cells, of which a log has two or three levels. Not tuned: it only has to stop a file that
# nests them without end.
DEEPEST = 20
# The matrix of flight data of SIDPAC, and the last of the columns that it always has: the acceleration along body z.
FDATA, LAST_AXIS = "fdata", 13


def read_matlab(path: str, asked: ReadRequest) -> RawLog:
    """Read a MATLAB v5 file.

    Raises
    ------
    LogError : truncated or damaged, no signals, no such struct.
    """
    from scipy.io import loadmat

    with raw.parsing(path, "MATLAB file"), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        what = ("its variables", "save fewer of them, or a part of the flight")
        raw.require_memory(path, Path(path).stat().st_size, *what)
        file = Path(path).read_bytes()
        raw.require_memory(path, unpacked_size(file), *what)
        arrays = variables(file)
        raw.require_memory(path, 8 * sum(variable.count for variable in arrays), *what)
        raw.require_few(path, len(arrays), "variables")
        unlike = {variable.name: variable.unlike for variable in arrays}
        del file
        wanted = [name for name, why in unlike.items() if why is None]
        loaded = loadmat(path, simplify_cells=True, variable_names=wanted)
    root = {name: value for name, value in loaded.items() if not name.startswith("__")}
    groups = [
        name for name, value in root.items() if isinstance(value, Mapping) and "data" not in map(str.lower, value)
    ]
    columns, refused = _signals(root)
    if FDATA in refused and (table := _table(root[FDATA])):
        columns = [*with_channels(table, "sidpac"), *columns]
        refused.pop(FDATA)
    chosen = raw.choose_group(path, asked.group, groups, has_signals=bool(columns))
    node = root if chosen is None else root[chosen]
    if chosen is not None:
        columns, refused = _signals(node)
    rate = raw.rate_of(path, node["sample_rate_hz"]) if "sample_rate_hz" in node else None
    if columns and all(column.time_s.size for column in columns):
        columns = with_channels(columns, "dashlink")
    notes = [Note.method(first_line(warning.message)) for warning in caught if isinstance(warning.message, Warning)]
    refused = {**{name: why for name, why in unlike.items() if name and why}, **refused}
    return RawLog(
        columns=columns,
        sample_rate_hz=rate,
        notes=tuple(notes),
        left_out={name: why for name, why in refused.items() if name != "sample_rate_hz"},
    )


def _table(values: Any) -> list[Track]:
    """Return the columns of SIDPAC's matrix, (n_samples, n_columns), that are not zero throughout; [] of any other."""
    matrix = np.asarray(values)
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiu" or not matrix.shape[0] > matrix.shape[1] > LAST_AXIS:
        return []
    return [
        Track(source=f"{FDATA}(:,{j})", values=column.astype(np.float64))
        for j, column in enumerate(matrix.T, start=1)
        if column.any()
    ]


def _signals(node: Mapping[str, Any]) -> tuple[list[Track], dict[str, str]]:
    """Return the signals of a struct, or of the file, and by name why its other members, structs aside, are none.

    They have separate clocks if all are structs that state a rate.
    """
    columns, refused, rates = list[Track](), dict[str, str](), list[float | None]()
    for name, value in node.items():
        is_struct = isinstance(value, Mapping)
        stated = {str(key).lower(): member for key, member in value.items()} if is_struct else {}
        if is_struct and "data" not in stated:
            continue
        data = stated["data"] if is_struct else value
        if isinstance(data, list | Mapping) or (array := np.asarray(data)).dtype.kind == "O":
            parts = list(data) if isinstance(data, list | np.ndarray) else []
            nested = isinstance(data, Mapping) or (parts and all(isinstance(part, Mapping) for part in parts))
            refused[name] = "is an array of structs" if nested else "is a cell array"
        elif why := raw.unlike(array.dtype.kind, array.shape):
            refused[name] = why
        else:
            unit = stated.get("units", stated.get("unit"))
            unit = unit.strip() or None if isinstance(unit, str) else None
            columns.append(Track(source=name, values=array.astype(np.float64).ravel(), unit=unit))
            rate_hz = raw.number_of(stated.get("rate"))
            rates.append(rate_hz if rate_hz is not None and 0.0 < rate_hz < math.inf else None)
    if all(rate is not None for rate in rates):
        columns = [
            replace(column, time_s=np.arange(column.values.size) / rate)
            for column, rate in zip(columns, rates, strict=True)
            if rate is not None
        ]
    return columns, refused


@dataclass(frozen=True, slots=True)
class _Element:
    kind: int
    data: memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A variable of `count` numbers, those in its fields and cells included; `unlike` says why it is no signal."""

    name: str
    count: int
    unlike: str | None


def unpacked_size(file: bytes) -> int:
    """Return the size of all variables in bytes as their tags state it, without unpacking them.

    Raises
    ------
    ValueError : as `variables`.
    """
    return sum(
        len(element.data) if element.kind != COMPRESSED else _claimed(zlib.decompressobj(), element, order)
        for element, order in _top(file)
    )


def variables(file: bytes) -> list[Variable]:
    """Return the variables of a file; a compressed one is unpacked up to the size that its tag states.

    Raises
    ------
    ValueError : sizes that contradict each other or the length of the file.
    """
    arrays = []
    for element, order in _top(file):
        array = _unpacked(element, order) if element.kind == COMPRESSED else element
        if array.kind != MATRIX:
            raise ValueError(f"an element of type {array.kind} is no variable")
        arrays.append(_array(array.data, order, depth=0))
    return arrays


def _top(file: bytes) -> Iterator[tuple[_Element, str]]:
    """Yield the variables of a file, each with the byte order of the file."""
    if len(file) < 136 or file[126:128] not in (b"IM", b"MI"):
        raise ValueError("the header is damaged")
    order = "<" if file[126:128] == b"IM" else ">"
    yield from ((element, order) for element in _elements(memoryview(file)[128:], order))


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise ValueError("the last element is cut off")
        word, size = struct.unpack_from(f"{order}II", data, at)
        start, step = at + 8, 8 + (size if word == COMPRESSED else -(-size // 8) * 8)
        if word >> 16:  # a small element: type, size and up to four bytes of data in eight
            word, size, start, step = word & 0xFFFF, word >> 16, at + 4, 8
            if size > 4:
                raise ValueError("a small element claims more than four bytes")
        if start + size > len(data):
            raise ValueError("an element claims more bytes than there are")
        yield _Element(word, data[start : start + size])
        at += step


def _decompress(unpacking: Any, data: bytes | memoryview, most: int) -> bytes:
    try:
        return bytes(unpacking.decompress(data, most))
    except zlib.error as error:
        raise ValueError(f"compressed data are damaged ({error})") from None


def _claimed(unpacking: Any, element: _Element, order: str) -> int:
    """Unpack the tag of a compressed array and return the size it claims."""
    tag = _decompress(unpacking, element.data, 8)
    if len(tag) < 8:
        raise ValueError("compressed data are cut off")
    kind, size = struct.unpack(f"{order}II", tag)
    if kind != MATRIX:
        raise ValueError(f"an element of type {kind} is no variable")
    return int(size)


def _unpacked(element: _Element, order: str) -> _Element:
    unpacking = zlib.decompressobj()
    size = _claimed(unpacking, element, order)
    data = _decompress(unpacking, unpacking.unconsumed_tail, max(size, 1))
    _decompress(unpacking, unpacking.unconsumed_tail, 8)  # the padding, and with it the check sum
    if len(data) < size or not unpacking.eof:
        raise ValueError(f"compressed data are damaged (they claim {size} bytes and hold others)")
    return _Element(MATRIX, memoryview(data)[:size])


def _array(data: memoryview, order: str, *, depth: int) -> Variable:
    """Check one array, and those in it."""
    parts = list(_elements(data, order))
    if depth > DEEPEST or len(parts) < 3:
        raise ValueError("an array lacks its flags, size or name")
    flags, size, name, *body = parts
    kinds_fit = flags.kind == UINT32 and size.kind in (INT32, UINT32) and name.kind in (INT8, UTF8)
    if not kinds_fit or len(flags.data) != 8 or len(size.data) % 4:
        raise ValueError("the head of an array is damaged")
    word = struct.unpack_from(f"{order}I", flags.data)[0]
    shape = np.frombuffer(size.data, f"{order}i4").tolist()
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError(f"an array has the size {shape}")
    kind, count, text = word & 0xFF, math.prod(shape), bytes(name.data).decode("latin-1")
    nested: list[_Element] | None = None
    if kind in NUMERIC:
        if len(body) != (2 if word & COMPLEX else 1):
            raise ValueError(f"an array of numbers has {len(body)} parts")
        for part in body:
            if part.kind not in SIZES or len(part.data) != count * SIZES[part.kind]:
                raise ValueError(f"an array of {count} numbers has {len(part.data)} bytes of type {part.kind}")
    elif kind == CHAR:
        characters = [TEXT.get(part.kind, 0) for part in body]
        if (body or count) and (len(body) != 1 or not characters[0] or len(body[0].data) % characters[0]):
            raise ValueError("a text is damaged")
    elif kind == STRUCT:
        if len(body) < 2 or (body[0].kind, len(body[0].data)) != (INT32, 4) or body[1].kind != INT8:
            raise ValueError("the fields of a struct are damaged")
        length = int(struct.unpack_from(f"{order}i", body[0].data)[0])
        if length < 1 or len(body[1].data) % length:
            raise ValueError("the field names of a struct are damaged")
        count, nested = count * (len(body[1].data) // length), body[2:]
    elif kind == CELL:
        nested = body
    else:
        return Variable(name=text, count=0, unlike=UNLIKE.get(kind, "holds no numbers"))
    if nested is None:
        return Variable(name=text, count=count, unlike=None)
    if len(nested) != count or any(part.kind != MATRIX for part in nested):
        raise ValueError(f"{count} arrays should be nested, got {len(nested)}")
    inner = [_array(part.data, order, depth=depth + 1) for part in nested if len(part.data)]
    return Variable(
        name=text,
        count=sum(part.count for part in inner) if inner else math.prod(shape),
        unlike=next((f"has a part that {part.unlike}" for part in inner if part.unlike), None),
    )
