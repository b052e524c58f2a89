"""Long signals drawn with few points, without losing a spike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["MAX_POINTS", "thinned"]

MAX_POINTS = 2000


def thinned(x: NDArray[np.float64], *, max_points: int = MAX_POINTS) -> NDArray[np.intp]:
    """Return the samples to draw: the least and the greatest of each of `max_points / 2` equal stretches, in order.

    Parameters
    ----------
    x : (n_samples,), NaN where there is no value.

    Returns
    -------
    (n,) increasing indices, all of them where the signal is short; the first and the last are always among them.
    """
    if x.size <= max_points:
        return np.arange(x.size)
    stretch = -(-x.size // (max_points // 2))
    padding = np.full(-x.size % stretch, np.nan)
    table = np.concatenate([x, padding]).reshape(-1, stretch)
    least = np.argmin(np.where(np.isnan(table), np.inf, table), axis=1)
    greatest = np.argmax(np.where(np.isnan(table), -np.inf, table), axis=1)
    starts = np.arange(0, table.size, stretch)
    return np.unique(np.concatenate([[0], starts + least, starts + greatest, [x.size - 1]]))
