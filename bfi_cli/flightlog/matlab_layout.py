"""The layout of a MATLAB v5 file, checked before it is parsed: the parser trusts sizes and crashes on wrong ones.

Names follow "MAT-File Format" by The MathWorks: a file is a sequence of data elements, each a tag (type, size) and
data padded to eight bytes; an array is an element made of elements.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Variable", "unpacked_size", "variables"]

MATRIX, COMPRESSED = 14, 15
INT8, INT32, UINT32, UTF8 = 1, 5, 6, 16
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
TEXT = {1: 1, 2: 1, 4: 2, 16: 1, 17: 2, 18: 4}
CELL, STRUCT, CHAR = 1, 2, 4
UNLIKE = {3: "is an object", 5: "is a sparse matrix", 16: "is a function", 17: "is an object"}
NUMERIC = range(6, 16)
COMPLEX = 0x0800
DEEPEST = 20


@dataclass(frozen=True, slots=True)
class _Element:
    kind: int
    data: memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """An array: `count` numbers, its fields and cells included; `unlike` says why it holds no signals, or None."""

    name: str
    count: int
    unlike: str | None


def unpacked_size(file: bytes) -> int:
    """Return the bytes that the variables of a file claim to take unpacked; nothing is unpacked for it.

    Raises
    ------
    ValueError : as `variables`.
    """
    return sum(
        len(element.data) if element.kind != COMPRESSED else _claimed(zlib.decompressobj(), element, order)
        for element, order in _top(file)
    )


def variables(file: bytes) -> list[Variable]:
    """Return the variables of a file; what is compressed is unpacked no further than it claims.

    Raises
    ------
    ValueError : sizes that contradict each other or the length of the file.
    """
    found = []
    for element, order in _top(file):
        array = _unpacked(element, order) if element.kind == COMPRESSED else element
        if array.kind != MATRIX:
            raise ValueError(f"an element of type {array.kind} is no variable")
        found.append(_array(array.data, order, depth=0))
    return found


def _top(file: bytes) -> Iterator[tuple[_Element, str]]:
    if len(file) < 136 or file[126:128] not in (b"IM", b"MI"):
        raise ValueError("the header is damaged")
    order = "<" if file[126:128] == b"IM" else ">"
    for element in _elements(memoryview(file)[128:], order):
        yield element, order


def _claimed(unpacking: Any, element: _Element, order: str) -> int:
    """Unpack the tag of a compressed array and return the size it claims."""
    try:
        tag = unpacking.decompress(element.data, 8)
    except zlib.error as error:
        raise ValueError(f"compressed data are damaged ({error})") from None
    if len(tag) < 8:
        raise ValueError("compressed data are cut off")
    kind, size = struct.unpack(f"{order}II", tag)
    if kind != MATRIX:
        raise ValueError(f"an element of type {kind} is no variable")
    return int(size)


def _unpacked(element: _Element, order: str) -> _Element:
    unpacking = zlib.decompressobj()
    size = _claimed(unpacking, element, order)
    try:
        data = unpacking.decompress(unpacking.unconsumed_tail, max(size, 1))
        unpacking.decompress(unpacking.unconsumed_tail, 8)  # the padding, and with it the check sum
    except zlib.error as error:
        raise ValueError(f"compressed data are damaged ({error})") from None
    if len(data) < size or not unpacking.eof:
        raise ValueError(f"compressed data are damaged (they claim {size} bytes and hold others)")
    return _Element(MATRIX, memoryview(data)[:size])


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise ValueError("the last element is cut off")
        word, size = struct.unpack_from(f"{order}II", data, at)
        start, step = at + 8, 8 + (size if word == COMPRESSED else -(-size // 8) * 8)
        if word >> 16:
            word, size, start, step = word & 0xFFFF, word >> 16, at + 4, 8
            if size > 4:
                raise ValueError("a small element claims more than four bytes")
        if start + size > len(data):
            raise ValueError("an element claims more bytes than there are")
        yield _Element(word, data[start : start + size])
        at += step


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
    kind, count, inner = word & 0xFF, math.prod(shape), []
    if kind in NUMERIC:
        _check_count(body, count, SIZES, copies=2 if word & COMPLEX else 1)
    elif kind == CHAR:
        if body or count:
            _check_text(body)
    elif kind == STRUCT:
        inner = _nested(body[2:], count * _n_fields(body, order), order, depth=depth)
    elif kind == CELL:
        inner = _nested(body, count, order, depth=depth)
    else:
        return Variable(name=_name(name), count=0, unlike=UNLIKE.get(kind, "holds no numbers"))
    return Variable(
        name=_name(name),
        count=sum(part.count for part in inner) if inner else count,
        unlike=next((f"has a part that {part.unlike}" for part in inner if part.unlike), None),
    )


def _name(element: _Element) -> str:
    return bytes(element.data).decode("latin-1")


def _check_count(body: list[_Element], count: int, sizes: dict[int, int], *, copies: int) -> None:
    if len(body) != copies:
        raise ValueError(f"an array of numbers has {len(body)} parts")
    for part in body:
        if part.kind not in sizes or len(part.data) != count * sizes[part.kind]:
            raise ValueError(f"an array of {count} numbers has {len(part.data)} bytes of type {part.kind}")


def _check_text(body: list[_Element]) -> None:
    if len(body) != 1 or body[0].kind not in TEXT or len(body[0].data) % TEXT[body[0].kind]:
        raise ValueError("a text is damaged")


def _n_fields(body: list[_Element], order: str) -> int:
    if len(body) < 2 or (body[0].kind, len(body[0].data)) != (INT32, 4) or body[1].kind != INT8:
        raise ValueError("the fields of a struct are damaged")
    length = int(struct.unpack_from(f"{order}i", body[0].data)[0])
    if length < 1 or len(body[1].data) % length:
        raise ValueError("the field names of a struct are damaged")
    return len(body[1].data) // length


def _nested(body: list[_Element], count: int, order: str, *, depth: int) -> list[Variable]:
    if len(body) != count or any(part.kind != MATRIX for part in body):
        raise ValueError(f"{count} arrays should be nested, got {len(body)}")
    return [_array(part.data, order, depth=depth + 1) for part in body if len(part.data)]
