"""How far a signal strays from a straight line over every stretch of a record."""

from __future__ import annotations

import numpy as np

from . import FloatArray

__all__ = ["noise_of_second_differences", "sd_about_lines"]


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


def noise_of_second_differences(x: FloatArray, size: int, share: float) -> float:
    """Return the standard deviation of white noise that the calmest pieces of a record show, 0 where there are none.

    Parameters
    ----------
    x : (n_samples,); pieces with a sample that is not finite are left out.
    size : samples of a piece.
    share : of the pieces that are calmer.
    """
    # The variance of x[k-1] - 2 x[k] + x[k+1] is 6 times that of white noise, and no line or slow motion is in it.
    second = np.diff(x, 2) / np.sqrt(6.0)
    pieces = second[: len(second) // size * size].reshape(-1, size)
    sds = np.sqrt(np.mean(pieces**2, axis=1))
    sds = sds[np.isfinite(sds)]
    return float(np.quantile(sds, share)) if sds.size else 0.0
