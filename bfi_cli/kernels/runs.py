"""Stretches of samples and of seconds, of each the first and the one after the last; lines over what is missing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Run = tuple[int, int]
Number = TypeVar("Number", int, float)


SAME = 1e-9  # of the largest value: what sums of it are rounded by, many times over


def runs(mask: BoolArray) -> list[Run]:
    """Return the runs in which a mask is true."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def repeats(values: FloatArray) -> list[Run]:
    """Return the runs of samples of one value but for rounding, two and more, each from its first sample to the end."""
    return [(first, end + 1) for first, end in runs(is_repeated(values))]


def is_repeated(values: FloatArray) -> BoolArray:
    """Return (n - 1,) whether samples repeat the one before, but for rounding."""
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
    return np.asarray(np.abs(np.diff(values)) <= SAME * largest)


def runs_with(strong: BoolArray, weak: BoolArray) -> list[Run]:
    """Return the runs of either mask that hold a sample of `strong`: hysteresis, forwards and backwards."""
    return [(first, end) for first, end in runs(strong | weak) if strong[first:end].any()]


def joined(stretches: Iterable[tuple[Number, Number]], apart: Number) -> list[tuple[Number, Number]]:
    """Return stretches in order of their beginning, those as one that begin no further behind the end of another."""
    whole: list[tuple[Number, Number]] = []
    for first, end in stretches:
        if whole and first - whole[-1][1] <= apart:
            whole[-1] = (whole[-1][0], end)
        else:
            whole.append((first, end))
    return whole


def union(stretches: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stretches in order of time, those that overlap or touch as one."""
    whole: list[tuple[float, float]] = []
    for first, last in sorted(stretches):
        if whole and first <= whole[-1][1]:
            whole[-1] = (whole[-1][0], max(whole[-1][1], last))
        else:
            whole.append((first, last))
    return whole


def left_of(
    stretches: Iterable[tuple[float, float]], covered: Iterable[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return what is left of stretches less what is covered."""
    left = list(stretches)
    for first, last in covered:
        pieces = [
            piece
            for interval in left
            for piece in ((interval[0], min(interval[1], first)), (max(interval[0], last), interval[1]))
        ]
        left = [interval for interval in pieces if interval[1] > interval[0]]
    return left


def within(time_s: FloatArray, stretches: Iterable[tuple[float, float]]) -> BoolArray:
    """Return (n,) which times lie in one of the stretches; the end of a stretch is no part of it."""
    inside = np.zeros(time_s.shape, dtype=np.bool_)
    for first, last in stretches:
        inside |= (time_s >= first) & (time_s < last)
    return inside


def shared(window: tuple[float, float], stretches: Iterable[tuple[float, float]]) -> float:
    """Return how much of a window lies in stretches that do not overlap."""
    return float(sum(max(0.0, min(window[1], last) - max(window[0], first)) for first, last in stretches))


def bridged(values: FloatArray, at: FloatArray | None = None, *, most: int | None = None) -> FloatArray:
    """Return (n,) values with straight lines over what is NaN or infinite, at the ends the value beside that.

    Where nothing is known the values come back as they are.

    Parameters
    ----------
    at : (n,) places of the values, increasing; None for equal steps.
    most : longer runs of samples than this are NaN.
    """
    bad = ~np.isfinite(values)
    if bad.all() or not bad.any():
        return values
    places = np.arange(values.size, dtype=np.float64) if at is None else at
    filled = np.interp(places, places[~bad], values[~bad])
    if most is not None:
        for first, end in runs(bad):
            filled[first:end] = np.nan if end - first > most else filled[first:end]
    return filled
