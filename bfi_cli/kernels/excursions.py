"""How far samples lie from what their neighbours on both sides say of them, and how far a signal travels."""

from __future__ import annotations

import numpy as np

from . import FloatArray

__all__ = ["interpolation_error", "running_median", "travel"]


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
    medians = np.median(x[: n * block].reshape(n, -1), axis=1)
    padded = np.pad(medians, n_blocks // 2, mode="edge" if n <= n_blocks // 2 else "reflect")
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, n_blocks // 2 * 2 + 1), axis=1)
    return np.asarray(smooth[np.minimum(np.arange(len(x)) // block, n - 1)])


def travel(x: FloatArray, size: int) -> FloatArray:
    """Return the greatest less the least value of every stretch of `size` samples.

    Parameters
    ----------
    x : (n_samples,) finite values.

    Returns
    -------
    FloatArray : (n_samples - size + 1,) by the first sample of the stretch; empty for a shorter record.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    # The filters centre a stretch of an even number of samples on the sample after its middle.
    stretches = slice(size // 2, size // 2 + max(0, len(x) - size + 1))
    return np.asarray(maximum_filter1d(x, size)[stretches] - minimum_filter1d(x, size)[stretches])
