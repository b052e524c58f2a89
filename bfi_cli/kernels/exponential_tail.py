"""Thresholds for the largest of many deviates: that of white noise, and that of the heavier tail of healthy data.

Gusts come in patches, so that amplitudes fall off exponentially, not as a normal density does (the exceedance model of
gust statistics). The tail is fitted to the maxima of blocks of healthy data; the threshold includes the uncertainty of
a tail that few blocks tell (docs/theory.md, 11.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from . import FloatArray

# Block maxima that a tail is fitted to, at least.
FEWEST_BLOCKS = 10
# The mean excess of white noise enters the estimate like so many observed excesses.
WHITE_WEIGHT = 5
# Points of the midpoint rule over the upper half of the distribution of a largest deviate.
QUANTILES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialTail:
    """The largest deviate of a block: exponential above its median.

    Attributes
    ----------
    start : the median of the block maxima.
    excess : mean excess of the maxima above the median, of which that of white noise counts as `WHITE_WEIGHT`.
    weight : number of excesses in that mean.
    """

    start: float
    excess: float
    weight: int

    def level(self, n_blocks: float, false_alarm: float) -> float:
        """Return what the largest of `n_blocks` blocks exceeds with probability `false_alarm`.

        With a mean excess that is estimated from few values, the next excess is Pareto, not exponentially, distributed.
        """
        odds = max(0.5 * n_blocks / false_alarm, 1.0)
        return self.start + self.weight * self.excess * float(np.expm1(np.log(odds) / self.weight))


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


def fit_tail(maxima: FloatArray, *, white: float) -> ExponentialTail | None:
    """Return the tail of block maxima, None where they are fewer than `FEWEST_BLOCKS`.

    Parameters
    ----------
    maxima : (n_blocks,).
    white : mean excess over the median that white noise would give.
    """
    if len(maxima) < FEWEST_BLOCKS:
        return None
    start = float(np.median(maxima))
    above = maxima[maxima > start] - start
    weight = len(above) + WHITE_WEIGHT
    return ExponentialTail(start=start, excess=(float(above.sum()) + WHITE_WEIGHT * white) / weight, weight=weight)
