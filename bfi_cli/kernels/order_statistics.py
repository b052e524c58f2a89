"""Medians, quantiles and distinct values: the numbers of numpy's, which imports its masked arrays for them.

That import takes longer than all the medians of a short log.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

T = TypeVar("T", bound=np.generic)


def median_of(x: ArrayLike, axis: int | None = None, *, overwrite: bool = False) -> Any:
    """Return the median of values, or those along an axis; NaN where a value is, and of none.

    Parameters
    ----------
    overwrite : `x` may be left in another order, which saves the memory of a copy.
    """
    values = _first(x, axis)
    n = len(values)
    if not n:
        return np.full(values.shape[1:], np.nan)[()]
    kth = ((n - 1) // 2, n // 2, n - 1)  # NaN is last
    if overwrite:
        values.partition(kth, axis=0)
    else:
        values = np.partition(values, kth, axis=0)
    return np.where(np.isnan(values[-1]), np.nan, 0.5 * (values[kth[0]] + values[kth[1]]))[()]


def quantile_of(x: ArrayLike, q: ArrayLike, axis: int | None = None, *, higher: bool = False) -> Any:
    """Return quantiles of values, or those along an axis, interpolated or `higher` values; NaN where a value is.

    Of several `q` the quantiles are along the first axis.
    """
    values, share = _first(x, axis), np.asarray(q, dtype=np.float64)
    place = (len(values) - 1) * share
    low = np.floor(place).astype(np.intp)
    high = np.ceil(place).astype(np.intp) if higher else np.minimum(low + 1, len(values) - 1)
    values = np.partition(values, sorted({*low.ravel().tolist(), *high.ravel().tolist(), len(values) - 1}), axis=0)
    at = values[high]
    if not higher:
        part = (place - low).reshape(share.shape + (1,) * (values.ndim - 1))
        between = at - values[low]
        # From the nearer of the two, as numpy does.
        at = np.where(part >= 0.5, at - between * (1.0 - part), values[low] + between * part)
    return np.where(np.isnan(values[-1]), np.nan, at)[()]


def _first(x: ArrayLike, axis: int | None) -> NDArray[np.float64]:
    """Return the values with the axis first that an order is along: all of them where it is None."""
    values = np.asarray(x, dtype=np.float64)
    return values.ravel() if axis is None else np.moveaxis(values, axis, 0)


def distinct(x: NDArray[T]) -> NDArray[T]:
    """Return the distinct values, ascending."""
    ordered = np.sort(x, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if ordered.size else ordered
