"""The CSV file of a sampled shape: time in s after the onset, value."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import DictionaryError

# Two hours at 100 Hz, 25 letters each line.
MAX_BYTES = 20_000_000


def lies_inside(path: Path, folder: Path) -> bool:
    """Return whether a file lies in a folder or below it, links followed; the file need not exist."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def sample_bytes(path: str) -> bytes:
    """Return the content of a sample file.

    Raises
    ------
    DictionaryError : it cannot be read, or is larger than `MAX_BYTES`.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise _unreadable(path, (getattr(error, "strerror", None) or "no such file").lower()) from None
    if len(content) > MAX_BYTES:
        raise _unreadable(path, f"larger than {MAX_BYTES / 1e6:g} MB")
    return content


def read_samples(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n,) times, increasing, and (n,) values; a first line that holds no numbers is a header.

    Raises
    ------
    DictionaryError : it cannot be read or is no such file. What the file holds is not quoted: a stranger's dictionary
        may name any file of this machine.
    """
    try:
        lines = sample_bytes(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise _unreadable(path, "not a text file") from None
    rows: list[tuple[int, list[float]]] = []
    for i, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            row = [float(field) for field in line.replace(";", ",").split(",")]
        except ValueError:
            row = []
        rows.append((i, row if len(row) == 2 and all(map(math.isfinite, row)) else []))
    if rows and not rows[0][1]:
        del rows[0]
    for i, row in rows:
        if not row:
            raise DictionaryError(f"{path}: line {i}: not two finite numbers; each line is time in s, value")
    table = np.array([row for _, row in rows], dtype=np.float64).reshape(-1, 2)
    if len(table) == 0 or not np.all(np.diff(table[:, 0]) > 0):
        raise DictionaryError(f"{path}: times do not increase from line to line; sort the samples by time")
    return table[:, 0], table[:, 1]


def _unreadable(path: str, reason: str) -> DictionaryError:
    return DictionaryError(f"{path}: cannot read the samples, {reason}; give a CSV file of time, value")
