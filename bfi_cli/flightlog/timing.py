"""The time axis: is it uniform, where are the gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["gap_starts", "is_uniform", "position", "time_jitter", "uneven_step"]

FloatArray = NDArray[np.float64]

UNEVEN = 0.02
GAP = 1.75


def position(time_s: FloatArray) -> FloatArray:
    """Return (n_samples,) time in samples: (t - t[0]) over the median time step."""
    return np.asarray((time_s - time_s[0]) / np.median(np.diff(time_s)))


def gap_starts(time_s: FloatArray) -> NDArray[np.intp]:
    """Return the samples after which at least one is missing."""
    step = np.diff(time_s)
    return np.flatnonzero(step > GAP * np.median(step))


def time_jitter(time_s: FloatArray) -> float:
    """Return the largest deviation of a time step from the median step, relative to it, gaps left out."""
    relative = np.diff(position(time_s))
    return float(np.max(np.abs(relative[relative <= GAP] - 1.0), initial=0.0))


def uneven_step(time_s: FloatArray) -> int | None:
    """Return the first sample k whose step t[k] - t[k-1] is off by more than 2 % and float32 rounding, else None."""
    step = np.diff(time_s)
    median = float(np.median(step))
    rounding = 2.0 * float(np.max(np.abs(np.spacing(time_s.astype(np.float32))))) if _is_float32(time_s) else 0.0
    bad = np.abs(step - median) > UNEVEN * median + rounding
    return int(np.argmax(bad)) + 1 if bad.any() else None


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples lie on a uniform grid."""
    return uneven_step(time_s) is None


def _is_float32(time_s: FloatArray) -> bool:
    return bool(np.array_equal(time_s.astype(np.float32), time_s))
