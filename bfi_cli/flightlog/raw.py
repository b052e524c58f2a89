"""What a reader hands over: the columns of a file under their own names and units, nothing interpreted yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..faults import Fault
from .record import Segment

__all__ = ["RawColumn", "RawLog", "choose_group", "is_signal", "numeric"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawColumn:
    """One column of a file: (n_samples,) values in the file's own unit, None where it states none."""

    source: str
    values: NDArray[np.float64]
    unit: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawLog:
    """One file as read. `faults` is None where the file carries no truth; `clean` is by channel."""

    columns: Sequence[RawColumn]
    sample_rate_hz: float | None = None
    segments: tuple[Segment, ...] = ()
    faults: tuple[Fault, ...] | None = None
    clean: Mapping[str, RawColumn] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def is_signal(shape: Sequence[int]) -> bool:
    """Say whether an array of this shape is one signal: a vector, a row or a column of more than one sample."""
    return len(shape) >= 1 and max(shape) > 1 and sum(n > 1 for n in shape) == 1


def numeric(values: Any) -> NDArray[np.float64] | None:
    """Return values as a flat float64 array, None where they are no real numbers."""
    array = np.asarray(values)
    return array.astype(np.float64).ravel() if array.dtype.kind in "fiub" else None


def choose_group(path: str, wanted: str | None, groups: Sequence[str], *, has_signals: bool) -> str | None:
    """Return the group (or struct) to read: the wanted one, None for the root, or the only one there is.

    Raises
    ------
    LogError : the wanted one does not exist, or there are several and none is wanted.
    """
    listed = ", ".join(groups) or "none"
    if wanted is not None:
        if wanted.strip("/") not in groups:
            raise LogError(f"{path}: no group '{wanted}'; the file has: {listed}; give one of them with --group")
        return wanted.strip("/")
    if has_signals:
        return None
    if len(groups) > 1:
        raise LogError(f"{path}: several groups: {listed}; give one of them with --group")
    if not groups:
        raise LogError(f"{path}: no signals, got no array of more than one number; give a log with a channel each")
    return groups[0]
