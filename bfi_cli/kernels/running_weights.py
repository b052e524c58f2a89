"""Weights of rows whose errors change in size: gusts come and go within a flight."""

from __future__ import annotations

import numpy as np

from . import FloatArray

# Normal consistency of the median absolute deviation.
MAD = 1.4826
# Least running deviation, as a share of its median: calm stretches must not carry the whole record. Tuned with the
# half-width of ten seconds on two recorded flights; weights from mean squares or a t-distribution take the transient
# of a step for an outlier and lose the step (docs/theory.md, 7.5).
LEAST = 0.35
# Values of all windows together beyond which medians and means are taken by windows that move along; the speed only.
MOST_VALUES = 10**6
# Samples of which means are taken at once, for memory.
BLOCK = 65_536


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
    size = _running_median(size, half)
    size *= MAD
    size = _running_mean(size, half)
    np.maximum(size, LEAST * np.median(size), out=size)
    np.divide(1.0, size, out=size)
    size /= np.sqrt(np.mean(size**2))
    return size


def _running_mean(x: FloatArray, half: int) -> FloatArray:
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


def _running_median(x: FloatArray, half: int) -> FloatArray:
    """Return (n,) medians of x (n,) over `half` samples on each side, at the ends over those that are there."""
    n, width = len(x), 2 * half + 1
    if n * width > MOST_VALUES:
        from scipy.ndimage import median_filter  # a tenth of a second of imports that a short window does not need

        median = np.asarray(median_filter(x, width), dtype=np.float64)
        head, tail = x[: 2 * half], x[n - 2 * half :]
        for k in range(half):
            median[k], median[n - 1 - k] = np.median(head[: half + 1 + k]), np.median(tail[half - 1 - k :])
        return median
    padded = np.pad(x, half, constant_values=np.nan)
    return np.asarray(np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
