"""Is a prediction error white: autocorrelation, Ljung-Box test, effective sample size, and the plain 5-sigma test."""

from __future__ import annotations

import numpy as np

from . import FloatArray, IntArray
from .compiled import special

# Products beyond which autocorrelations are taken by Fourier transforms of blocks of so many rows; the speed only.
MOST_PRODUCTS, BLOCK = 10**8, 65_536


def autocorrelation(e: FloatArray, n_lags: int) -> FloatArray:
    """Return (n_lags,) autocorrelations of (n_rows,) `e` at lags 1..n_lags; zeros for a constant."""
    e = e - e.mean()
    power = float(e @ e)
    if power == 0.0:
        return np.zeros(n_lags)
    if len(e) * n_lags > MOST_PRODUCTS:
        return _lagged_products(e, n_lags)[1:] / power
    return np.array([float(e[lag:] @ e[:-lag]) / power for lag in range(1, n_lags + 1)])


def _lagged_products(e: FloatArray, n_lags: int) -> FloatArray:
    """Return (n_lags + 1,) sums of e(k) e(k + lag), by the Fourier transforms of blocks and of what follows them."""
    size = max(BLOCK, n_lags)
    n = 1 << (size + n_lags).bit_length()  # the products of two blocks do not wrap around
    total = np.zeros(n_lags + 1)
    for start in range(0, len(e), size):
        block, ahead = (np.fft.rfft(e[start : start + length], n) for length in (size, size + n_lags))
        total += np.fft.irfft(block.conj() * ahead, n)[: n_lags + 1]
    return total


def ljung_box(e: FloatArray, n_lags: int, n_fitted: int) -> float:
    """Return the p-value of the Ljung-Box whiteness test (Ljung and Box 1978), `n_fitted` lags having been fitted."""
    n, r = len(e), autocorrelation(e, n_lags)
    statistic = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, n_lags + 1))))
    return float(special.chdtrc(max(n_lags - n_fitted, 1), statistic))


def effective_rows(e: FloatArray) -> float:
    """Return how many independent rows the prediction error amounts to (Bartlett), the least over the outputs.

    A deterministic remainder is predictable from its past, so its rows are not independent evidence.

    Parameters
    ----------
    e : (n_rows, n_outputs).
    """
    n = len(e)
    n_lags = max(1, min(int(np.sqrt(n)), n - 2))
    excess = [np.sum(np.maximum(autocorrelation(column, n_lags) ** 2 - 4.0 / n, 0.0)) for column in e.T]
    return float(n / (1.0 + 2.0 * max(excess)))


def robust_sd(e: FloatArray) -> float:
    """Standard deviation from the median absolute deviation, so that a step does not hide itself."""
    deviation = e - np.median(e)
    np.abs(deviation, out=deviation)
    return float(np.median(deviation, overwrite_input=True) / special.ndtri(0.75))


def exceedances(e: FloatArray, sigmas: float = 5.0) -> IntArray:
    """Return the indices where |e| exceeds `sigmas` robust standard deviations."""
    sd = robust_sd(e)
    if not sd > 0:
        return np.zeros(0, dtype=np.intp)
    # A part at a time, for memory.
    parts = [k + np.flatnonzero(np.abs(e[k : k + BLOCK]) > sigmas * sd) for k in range(0, len(e), BLOCK)]
    return np.concatenate(parts)
