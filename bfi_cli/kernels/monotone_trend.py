"""A trend of a few scattered values: rank correlation with their order, and the median of the slopes of all pairs.

Neither assumes a distribution, and a third of the values may be anything. Kendall, Rank Correlation Methods (1975);
Sen, J. Am. Stat. Assoc. 63 (1968) 1379; both as in Gilbert, Statistical Methods for Environmental Pollution Monitoring
(1987), chapter 16.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .normal import TWO_SIDED_95


@dataclass(frozen=True, slots=True, kw_only=True)
class MonotoneTrend:
    """A trend of values in their order.

    Attributes
    ----------
    slope, ci95 : per value, the median of the slopes of all pairs and its 95 % interval.
    level : of the line at the first value, so that half the values lie above it.
    p_value : chance of such a rank correlation, of either sign, of values without a trend.
    """

    slope: float
    ci95: tuple[float, float]
    level: float
    p_value: float


def monotone_trend(values: FloatArray) -> MonotoneTrend:
    """Return the trend of values.

    Parameters
    ----------
    values : (n,) in their order, finite, n at least 3.

    Raises
    ------
    ValueError : fewer values.
    """
    n = values.size
    if n < 3:
        raise ValueError(f"a trend needs 3 values, got {n}")
    first, second = np.triu_indices(n, 1)
    rises = values[second] - values[first]
    slopes = np.sort(rises / (second - first))
    # Gilbert (16.2), with ties: groups of t equal values take t (t - 1)(2 t + 5) / 18 from the variance.
    ties = np.unique(values, return_counts=True)[1]
    variance = (n * (n - 1) * (2 * n + 5) - float(np.sum(ties * (ties - 1) * (2 * ties + 5)))) / 18.0
    score = abs(float(np.sum(np.sign(rises))))
    z = max(score - 1.0, 0.0) / math.sqrt(variance) if variance > 0.0 else 0.0
    # Gilbert (16.10): the slopes whose ranks lie that far from the middle.
    half = TWO_SIDED_95 * math.sqrt(max(variance, 0.0))
    ranks = ((slopes.size - half) / 2.0, (slopes.size + half) / 2.0 + 1.0)
    low, high = np.interp(ranks, np.arange(1, slopes.size + 1), slopes)
    slope = float(np.median(slopes))
    return MonotoneTrend(
        slope=slope,
        ci95=(float(low), float(high)),
        level=float(np.median(values - slope * np.arange(n))),
        p_value=math.erfc(z / math.sqrt(2.0)),
    )
