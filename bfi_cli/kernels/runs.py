"""Stretches of samples and of seconds, each the first and the one after the last, and what a record does within them.

Such are lines over what is missing; how far a record strays from a line or from its neighbours, and travels; and the
weights of rows whose errors change in size, since gusts come and go within a flight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from . import MAD, BoolArray, FloatArray, IntArray

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


# Least running deviation, as a share of its median: calm stretches must not carry the whole record. Tuned with the
# half-width of ten seconds on two recorded flights; weights from mean squares or a t-distribution take the transient
# of a step for an outlier and lose the step (docs/theory.md, 7.5).
LEAST = 0.35
# Values of all windows together beyond which medians and means are taken by windows that move along; the speed only.
MOST_VALUES = 10**6
# Samples of which means are taken at once, for memory.
BLOCK = 65_536


def sd_about_lines(x: FloatArray, n_points: int, stride: int) -> FloatArray:
    """Return the standard deviation about its own line of every stretch of a signal; NaN where a point is missing.

    The points of a stretch are means of `stride` samples, so that white noise counts less than slow motion. Every
    stretch is projected by itself: running sums of squares lose the digits of a pressure of 100 000 Pa.

    Parameters
    ----------
    x : (n_samples,).
    n_points : of a stretch, 3 or more.
    stride : samples in a point.

    Returns
    -------
    FloatArray : (n_samples - n_points * stride + 1,) by the first sample of the stretch; empty for a shorter record.
    """
    if len(x) < n_points * stride:
        return np.zeros(0)
    means = np.lib.stride_tricks.sliding_window_view(x, stride).mean(axis=1)
    points = np.lib.stride_tricks.sliding_window_view(means, (n_points - 1) * stride + 1)[:, ::stride]
    centred = points - points.mean(axis=1, keepdims=True)
    at = np.arange(n_points) - 0.5 * (n_points - 1)
    slope = centred @ at / (at @ at)
    rest = centred - slope[:, None] * at
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", rest, rest) / (n_points - 2)))


def noise_of_second_differences(x: FloatArray, size: int, share: float, *, rests: float = -np.inf) -> float:
    """Return the standard deviation of white noise that the calmest pieces of a record show, 0 where there are none.

    Parameters
    ----------
    x : (n_samples,); pieces with a sample that is not finite are left out.
    size : samples of a piece.
    share : of the pieces that are calmer.
    rests : within which a piece stays that rests: held by its record, it shows no noise.
    """
    # The variance of x[k-1] - 2 x[k] + x[k+1] is 6 times that of white noise, and no line or slow motion is in it.
    second = np.diff(x, 2) / np.sqrt(6.0)
    n = len(second) // size * size
    sds = np.sqrt(np.mean(second[:n].reshape(-1, size) ** 2, axis=1))
    sds = sds[np.isfinite(sds) & (np.ptp(x[1 : n + 1].reshape(-1, size), axis=1) > rests)]
    return float(np.quantile(sds, share)) if sds.size else 0.0


def interpolation_error(x: FloatArray, half: int) -> FloatArray:
    """Return the difference of every sample from the cubic through the samples at -3, -1, 1 and 3 times `half`.

    No motion up to a cubic is in it; an excursion that is shorter than 2 `half` samples is, whole.

    Parameters
    ----------
    x : (n_samples,).

    Returns
    -------
    FloatArray : (n_samples,), 0 where one of the five samples is not finite or lies beyond an end.
    """
    error = np.zeros(len(x))
    n = len(x) - 6 * half
    if n > 0:
        near, far = x[2 * half :][:n] + x[4 * half :][:n], x[:n] + x[6 * half :]
        error[3 * half :][:n] = x[3 * half :][:n] - (9.0 * near - far) / 16.0
    return np.where(np.isfinite(error), error, 0.0)


def running_median(x: FloatArray, block: int, n_blocks: int) -> FloatArray:
    """Return the median of x (n_samples,) about every sample: of the medians of `n_blocks` blocks of `block` samples.

    At the ends of the record the blocks are those next to them.
    """
    n = max(1, len(x) // block)
    half = n_blocks // 2
    medians = medians_of_rows(x[: n * block].reshape(n, -1))
    padded = np.pad(medians, half, mode="edge" if n <= half else "reflect")
    smooth = _along(padded, 2 * half + 1, medians_of_rows)  # of odd width: a median is one of the values
    counts = np.full(n, block)
    counts[-1] = len(x) - (n - 1) * block
    return np.repeat(smooth, counts)


def median_of_neighbours(x: FloatArray, size: int) -> FloatArray:
    """Return the median of the `size` samples about every sample, the ends of the record repeated beyond it.

    Of an even number it is the greater of the two in the middle, and the stretch begins half of it before the sample.

    Parameters
    ----------
    x : (n_samples,); size : for the long stretches of a long record the running medians of scipy are faster.
    """
    padded = np.pad(x, (size // 2, (size - 1) // 2), mode="edge")
    return _along(padded, size, lambda rows: np.sort(rows, axis=1)[:, size // 2])


def greatest_of_neighbours(x: FloatArray, size: int) -> FloatArray:
    """Return the greatest of the `size` samples, an odd number, about every sample (n_samples,)."""
    padded = np.pad(x, size // 2, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, size).max(axis=1))


def medians_of_rows(x: FloatArray) -> FloatArray:
    """Return (n_rows,) medians of rows (n_rows, n), NaN of a row that holds NaN: `np.median`, sorted at once."""
    ordered, n = np.sort(x, axis=1), x.shape[1]
    middle = 0.5 * (ordered[:, (n - 1) // 2] + ordered[:, n // 2])
    return np.asarray(np.where(np.isnan(ordered[:, -1]), np.nan, middle))


def _along(x: FloatArray, size: int, by_row: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return (n - size + 1,) what a function of rows makes of every stretch of `size` samples, some at a time."""
    stretches, several = np.lib.stride_tricks.sliding_window_view(x, size), max(1, BLOCK * 16 // size)
    blocks = [by_row(stretches[start : start + several]) for start in range(0, len(stretches), several)]
    return np.concatenate([*blocks, np.zeros(0)])


def travel(x: FloatArray, size: int) -> FloatArray:
    """Return the greatest less the least value of every stretch of `size` samples.

    Parameters
    ----------
    x : (n_samples,) finite values.

    Returns
    -------
    FloatArray : (n_samples - size + 1,) by the first sample of the stretch; empty for a shorter record.
    """
    travels = np.zeros(max(0, len(x) - size + 1))
    for start in range(0, len(travels), BLOCK):
        greatest = least = x[start : start + BLOCK + size - 1]
        width = 1
        while 2 * width <= size:  # from stretches of `width` samples to those of twice as many
            greatest = np.maximum(greatest[:-width], greatest[width:])
            least = np.minimum(least[:-width], least[width:])
            width *= 2
        n, later = len(travels[start : start + BLOCK]), size - width
        travels[start : start + n] = np.maximum(greatest[:n], greatest[later:]) - np.minimum(least[:n], least[later:])
    return travels


def block_means(values: FloatArray, block: IntArray, n: int, *, least: FloatArray | float = 1.0) -> FloatArray:
    """Return (n,) means of the finite values of each block, NaN where fewer than `least` of a block are finite.

    Parameters
    ----------
    values, block : (n_samples,) samples, and the number of the block of each, from 0 to n - 1.
    least : of all blocks, or (n,) of each; no value at all is none.
    """
    known = np.isfinite(values)
    if not known.all():
        values, block = values[known], block[known]
    count = np.bincount(block, minlength=n)
    total = np.bincount(block, weights=values, minlength=n)
    return np.where(count >= np.maximum(least, 1.0), total / np.maximum(count, 1), np.nan)


def mean_of_stretches(x: FloatArray, size: int) -> FloatArray:
    """Return the mean of every stretch of `size` samples.

    Parameters
    ----------
    x : (n_samples,) finite values, n_samples >= size.

    Returns
    -------
    FloatArray : (n_samples - size + 1,) by the first sample of the stretch.
    """
    level = x.mean()  # off which sums keep the digits of a pressure of 100 000 Pa
    total = np.concatenate([[0.0], np.cumsum(x - level)])
    return np.asarray(level + (total[size:] - total[:-size]) / size)


def running_weights(error: FloatArray, half_width: int) -> FloatArray:
    """Return (n_rows,) weights, of mean square 1, inverse to the running deviation of an error.

    Parameters
    ----------
    error : (n_rows, n_outputs) without a fault; outputs count alike.
    half_width : rows on each side over which the median of the absolute error is taken, and then a mean.
    """
    n = len(error)
    half = min(half_width, (n - 1) // 2)
    typical = np.median(np.abs(error), axis=0)
    if half < 1 or not np.all(typical > 0.0):
        return np.ones(n)
    size = np.sqrt(np.mean((error / typical) ** 2, axis=1)) if error.shape[1] > 1 else np.abs(error[:, 0])
    size = _median_around(size, half)
    size *= MAD
    size = _mean_around(size, half)
    np.maximum(size, LEAST * np.median(size), out=size)
    np.divide(1.0, size, out=size)
    size /= np.sqrt(np.mean(size**2))
    return size


def _mean_around(x: FloatArray, half: int) -> FloatArray:
    """Return (n,) means of x (n,) over `half` samples on each side, at the ends over those that are there."""
    n, width = len(x), 2 * half + 1
    if n * width > MOST_VALUES:
        mean = np.empty(n)
        for start in range(0, n, BLOCK):
            k = np.arange(start, min(start + BLOCK, n))
            first, stop = np.maximum(k - half, 0), np.minimum(k + half + 1, n)
            total = np.concatenate([[0.0], np.cumsum(x[first[0] : stop[-1]])])
            mean[k] = (total[stop - first[0]] - total[first - first[0]]) / (stop - first)
        return mean
    box = np.ones(width)
    return np.asarray(np.convolve(x, box, "same") / np.convolve(np.ones(n), box, "same"))


def _median_around(x: FloatArray, half: int) -> FloatArray:
    """Return (n,) medians of x (n,) over `half` samples on each side, at the ends over those that are there."""
    n, width = len(x), 2 * half + 1
    if n * width > MOST_VALUES:
        from scipy.ndimage import median_filter  # a tenth of a second of imports that a short window does not need

        median = np.asarray(median_filter(x, width), dtype=np.float64)
        head, tail = x[: 2 * half], x[n - 2 * half :]
        for k in range(half):
            median[k], median[n - 1 - k] = np.median(head[: half + 1 + k]), np.median(tail[half - 1 - k :])
        return median
    at = np.arange(n)
    count = np.minimum(at, half) + np.minimum(n - 1 - at, half) + 1
    padded = np.pad(x, half, constant_values=np.inf)
    ordered = np.sort(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.asarray(0.5 * (ordered[at, (count - 1) // 2] + ordered[at, count // 2]))
