"""Is a prediction error white: autocorrelation, Ljung-Box test, effective sample size, and the plain 5-sigma test."""

from __future__ import annotations

import numpy as np
from scipy import special

from . import FloatArray, IntArray


def autocorrelation(e: FloatArray, n_lags: int) -> FloatArray:
    """Return (n_lags,) autocorrelations of (n_rows,) `e` at lags 1..n_lags; zeros for a constant."""
    e = e - e.mean()
    power = float(e @ e)
    if power == 0.0:
        return np.zeros(n_lags)
    return np.array([float(e[lag:] @ e[:-lag]) / power for lag in range(1, n_lags + 1)])


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
    return float(np.median(np.abs(e - np.median(e))) / special.ndtri(0.75))


def exceedances(e: FloatArray, sigmas: float = 5.0) -> IntArray:
    """Return the indices where |e| exceeds `sigmas` robust standard deviations."""
    sd = robust_sd(e)
    return np.flatnonzero(np.abs(e) > sigmas * sd) if sd > 0 else np.zeros(0, dtype=np.intp)
