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
# Of the windows whose medians are taken at once, for memory.
MOST_VALUES = 10**6


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
    padded = np.pad(size, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    step = max(1, MOST_VALUES // (2 * half + 1))
    median = MAD * np.concatenate([np.nanmedian(windows[k : k + step], axis=1) for k in range(0, n, step)])
    box = np.ones(2 * half + 1)
    deviation = np.convolve(median, box, "same") / np.convolve(np.ones(n), box, "same")
    weights = 1.0 / np.maximum(deviation, LEAST * np.median(deviation))
    return np.asarray(weights / np.sqrt(np.mean(weights**2)))
