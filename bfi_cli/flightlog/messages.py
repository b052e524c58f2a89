"""The messages of a binary log: where each lies in the file, and their numbers as a table.

A log of many small messages takes several times its size as objects of Python, so that only their places are kept while
it is read, and memory is checked by their counts before it is taken.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from mmap import mmap

import numpy as np
from numpy.typing import NDArray

from .raw import require_memory

# Bytes of messages that are copied at once, each by an index of eight bytes.
AT_ONCE = 2**20


@dataclass(frozen=True, slots=True)
class Places:
    """Where in a file the bodies of the messages of a topic begin, and their lengths in bytes."""

    starts: array[int] = field(default_factory=lambda: array("Q"))
    sizes: array[int] = field(default_factory=lambda: array("H"))

    def add(self, start: int, size: int) -> None:
        """Append a message."""
        self.starts.append(start)
        self.sizes.append(size)


def table_of(data: mmap, places: Places, fields: Mapping[str, tuple[str, int]], size: int) -> NDArray[np.void]:
    """Return the numbers of messages as a structured array; messages shorter than `size` bytes are padded with zeros.

    Parameters
    ----------
    data : the file.
    fields : numpy type and offset in bytes by name.
    """
    types, offsets = zip(*fields.values(), strict=True)
    kind = np.dtype({"names": list(fields), "formats": types, "offsets": offsets, "itemsize": size})
    whole, within = np.frombuffer(data, dtype=np.uint8), np.arange(size)
    starts, sizes = np.asarray(places.starts, dtype=np.int64), np.asarray(places.sizes)
    table = np.zeros((starts.size, size), dtype=np.uint8)
    rows = max(1, AT_ONCE // size)
    for first in range(0, starts.size, rows):
        part = slice(first, first + rows)
        inside = within < sizes[part, None]
        table[part][inside] = whole[(starts[part, None] + within)[inside]]
    return np.asarray(table.view(kind)[:, 0])


def require_tables(path: str, counts: Iterable[tuple[int, int]]) -> None:
    """Check that memory holds the numbers of the topics of a file, before these are made.

    Parameters
    ----------
    counts : of each topic its messages, and the numbers in one.

    Raises
    ------
    LogError : see `raw.require_memory`.
    """
    require_memory(path, 8 * sum(n * fields for n, fields in counts), "its messages", "cut the log")
