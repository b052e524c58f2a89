"""Is a prediction error white: autocorrelation, Ljung-Box test, effective sample size; thresholds of its maxima.

Gusts come in patches, so that amplitudes fall off exponentially, not as a normal density does (the exceedance model of
gust statistics). A threshold includes the uncertainty of a tail that few healthy values tell (docs/theory.md, 10.3 and
11.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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


# The mean excess of white noise enters the estimate like so many observed excesses.
WHITE_WEIGHT = 5
# Flights, aircraft, rates and lengths of windows other than those that were counted change the mean excess about as
# much as one known from so few excesses is uncertain. Chosen by hand: with 17 excesses the level of one in a hundred
# rises by a quarter, that of one in ten thousand doubles. Between shipped tables of twice the length the largest
# statistics differ by 1.0 to 1.9.
EXCESSES_UNFIT = 5
# Points of the midpoint rule over the upper half of the distribution of a largest deviate.
QUANTILES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcessTail:
    """A distribution that falls exponentially above a start, its mean excess known from k values there only.

    A further value exceeds the start by x with the probability (1 + x / (k mean))^-k times that of exceeding it at all:
    the predictive distribution of an exponential law under the prior 1 / mean, Pareto's.

    Attributes
    ----------
    start : where the tail begins; share : probability of what lies above.
    mean : of what is above the start, less it; k : number of independent values in that mean.
    """

    start: float
    mean: float
    k: float
    share: float

    def probability(self, x: float) -> float:
        """Return the probability to exceed x, which is at least the start."""
        return self.share * float((1.0 + (x - self.start) / (self.k * self.mean)) ** -self.k)

    @property
    def widened(self) -> ExcessTail:
        """The tail of what was counted otherwise: its mean excess is as unknown as one of `EXCESSES_UNFIT` besides."""
        return replace(self, k=1.0 / (1.0 / self.k + 1.0 / EXCESSES_UNFIT))

    def level(self, p: float) -> float:
        """Return what is exceeded with probability p, the start where the tail does not reach up to p."""
        return self.start + self.k * self.mean * float(np.expm1(np.log(max(self.share / p, 1.0)) / self.k))


def white_level(n_tests: float, false_alarm: float) -> float:
    """Return what the largest of `n_tests` absolute standard normal deviates exceeds with probability `false_alarm`.

    The bound is Bonferroni's: deviates that depend on each other exceed it less often.
    """
    return -float(special.ndtri(0.5 * false_alarm / n_tests))


def white_excess(n_tests: float) -> float:
    """Return the mean excess of the largest of `n_tests` absolute normal deviates over its median, where it has one."""
    upper = (np.arange(QUANTILES) + 0.5) / (2 * QUANTILES) + 0.5
    largest = special.ndtri(0.5 * (1.0 + np.append(0.5, upper) ** (1.0 / n_tests)))
    return float(np.mean(largest[1:]) - largest[0])


def block_maxima(deviates: FloatArray, size: int) -> FloatArray:
    """Return (n_blocks,) maxima over the channels and over blocks of `size` rows; a part of a block is left out.

    Parameters
    ----------
    deviates : (n_rows, n_channels).
    """
    n_blocks = len(deviates) // size
    return np.asarray(deviates[: n_blocks * size].reshape(n_blocks, size * deviates.shape[1]).max(axis=1))


def fit_tail(maxima: FloatArray, n_tests: float, *, alike: float = 1.0) -> ExcessTail:
    """Return the tail of block maxima above their median, that of white noise where there are none.

    The mean excess that white noise would give counts as `WHITE_WEIGHT` of the excesses.

    Parameters
    ----------
    maxima : (n_blocks,).
    n_tests : independent deviates that each is the largest of.
    alike : blocks in a row whose excesses are of one size: so many tell as much as one.
    """
    start = float(np.median(maxima)) if len(maxima) else white_level(n_tests, 0.5)
    above = maxima[maxima > start] - start
    mean = (float(above.sum()) + WHITE_WEIGHT * white_excess(n_tests)) / (len(above) + WHITE_WEIGHT)
    return ExcessTail(start=start, mean=mean, k=len(above) / max(alike, 1.0) + WHITE_WEIGHT, share=0.5)
