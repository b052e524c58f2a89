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

import numpy as np

__all__ = ["readable_variables"]

MATRIX, COMPRESSED = 14, 15
INT8, INT32, UINT32, UTF8 = 1, 5, 6, 16
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
TEXT = {1: 1, 2: 1, 4: 2, 16: 1, 17: 2, 18: 4}
CELL, STRUCT, CHAR = 1, 2, 4
NUMERIC = range(6, 16)
COMPLEX = 0x0800
DEEPEST = 20


@dataclass(frozen=True, slots=True)
class _Element:
    kind: int
    data: memoryview


def readable_variables(file: bytes) -> dict[str, bool]:
    """Return the variables of a file, false for a class that holds no signals (sparse, object, function).

    Parameters
    ----------
    file : the whole file.

    Raises
    ------
    ValueError : sizes that contradict each other or the length of the file.
    """
    if len(file) < 136 or file[126:128] not in (b"IM", b"MI"):
        raise ValueError("the header is damaged")
    order = "<" if file[126:128] == b"IM" else ">"
    return dict(_variable(element, order) for element in _elements(memoryview(file)[128:], order))


def _variable(element: _Element, order: str) -> tuple[str, bool]:
    if element.kind == COMPRESSED:
        try:
            inner = memoryview(zlib.decompress(element.data))
        except zlib.error as error:
            raise ValueError(f"compressed data are damaged ({error})") from None
        element = next(_elements(inner, order), element)
    if element.kind != MATRIX:
        raise ValueError(f"an element of type {element.kind} is no variable")
    return _array(element.data, order, depth=0)


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


def _array(data: memoryview, order: str, *, depth: int) -> tuple[str, bool]:
    """Check one array and return its name and whether it can hold signals."""
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
    known = _body(word & 0xFF, body, math.prod(shape), order, depth=depth, is_complex=bool(word & COMPLEX))
    return bytes(name.data).decode("latin-1"), known


def _body(kind: int, body: list[_Element], count: int, order: str, *, depth: int, is_complex: bool) -> bool:
    if kind in NUMERIC:
        _check_count(body, count, SIZES, copies=2 if is_complex else 1)
    elif kind == CHAR:
        if body or count:
            _check_text(body)
    elif kind == STRUCT:
        return _check_nested(body[2:], count * _n_fields(body, order), order, depth=depth)
    elif kind == CELL:
        return _check_nested(body, count, order, depth=depth)
    else:
        return False
    return True


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


def _check_nested(body: list[_Element], count: int, order: str, *, depth: int) -> bool:
    if len(body) != count or any(part.kind != MATRIX for part in body):
        raise ValueError(f"{count} arrays should be nested, got {len(body)}")
    known = [_array(part.data, order, depth=depth + 1)[1] for part in body if len(part.data)]
    return all(known)
