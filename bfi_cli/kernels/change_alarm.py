"""Sequential tests for a change of the mean of standardised white errors: the cumulative sum and its GLR form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray, IntArray
from .compiled import special

# Allowance of the cumulative sum, in standard deviations: half the change that it is fastest for (Page 1954).
ALLOWANCE = 0.5
# By how much a walk oversteps its threshold, in standard deviations (Siegmund 1985, eq. 2.57).
OVERSTEP = 1.166


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeAlarm:
    """An alarm at row `alarm` for a change from row `onset` on, by about `size` standard deviations."""

    alarm: int
    onset: int
    size: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChangeStatistic:
    """How much every row speaks for a change of the mean before it.

    Attributes
    ----------
    errors : (n,) over their standard deviation; values : (n,) the statistic; onset : (n,) first row of that change.
    """

    errors: FloatArray
    values: FloatArray
    onset: IntArray

    def alarm(self, threshold: float) -> ChangeAlarm | None:
        """Return the first row whose statistic is beyond the threshold, None where there is none."""
        beyond = np.flatnonzero(self.values > threshold)
        if not beyond.size:
            return None
        k, onset = int(beyond[0]), int(self.onset[beyond[0]])
        return ChangeAlarm(alarm=k, onset=onset, size=float(np.mean(self.errors[onset : k + 1])))


def cusum_threshold(n: int, false_alarm: float) -> float:
    """Return the threshold of a two-sided cumulative sum that n rows of white noise exceed with a probability.

    Alarms come at the average run length of Siegmund's approximation, (exp(2kb) - 2kb - 1) / (2k^2) on either side
    with b = h + 1.166, and are rare events.
    """
    wanted = -2.0 * n / np.log1p(-false_alarm)  # run length of one side
    low, high = 0.0, 100.0
    while high - low > 1e-9:
        h = 0.5 * (low + high)
        exponent = 2.0 * ALLOWANCE * (h + OVERSTEP)
        if (np.expm1(exponent) - exponent) / (2.0 * ALLOWANCE**2) < wanted:
            low = h
        else:
            high = h
    return high


def cumulative_sum(x: FloatArray) -> ChangeStatistic:
    """Return the larger of the two one-sided cumulative sums, of which the onset is the row after it was last 0.

    Parameters
    ----------
    x : (n,) errors over their standard deviation.
    """
    sums, start = np.zeros(2), np.zeros(2, dtype=int)
    values, onset = np.zeros(len(x)), np.zeros(len(x), dtype=int)
    for k, value in enumerate(x):
        sums += np.array([value, -value]) - ALLOWANCE
        start[sums <= 0.0] = k + 1
        sums = np.maximum(sums, 0.0)
        side = int(np.argmax(sums))
        values[k], onset[k] = sums[side], start[side]
    return ChangeStatistic(errors=x, values=values, onset=onset)


def glr_threshold(n: int, n_lengths: int, false_alarm: float) -> float:
    """Return the threshold that no (onset, alarm) of white noise exceeds but with a probability, by the union bound."""
    return float(special.ndtri(1.0 - 0.5 * false_alarm / (n * n_lengths)) ** 2 / 2.0)


def likelihood_ratio(x: FloatArray, n_lengths: int) -> ChangeStatistic:
    """Return the generalised likelihood ratio of a change of unknown size within the last rows.

    The statistic at row k is the largest (sum of x from j to k)^2 / (2 (k - j + 1)) over k - j < n_lengths
    (Lorden 1971).
    """
    total = np.concatenate([[0.0], np.cumsum(x)])
    best, onset = np.zeros(len(x)), np.arange(len(x))
    for length in range(1, min(n_lengths, len(x)) + 1):
        value = (total[length:] - total[:-length]) ** 2 / (2.0 * length)
        better = value > best[length - 1 :]
        best[length - 1 :][better] = value[better]
        onset[length - 1 :][better] = np.flatnonzero(better)
    return ChangeStatistic(errors=x, values=best, onset=onset)


def best_split(x: FloatArray) -> float:
    """Return the gain in natural units of one change of the mean of unit white noise at the best of all rows."""
    n, k = len(x), np.arange(1, len(x))
    before = np.cumsum(x - np.mean(x))[:-1]
    return float(np.max(before**2 * n / (2.0 * k * (n - k)), initial=0.0))
