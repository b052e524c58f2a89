"""A change at an unknown time in a record with nuisances and noise of unknown size and correlation.

y = N b + x g_m + e, where e is a stationary AR(1) process whose correlation over a second is one of a few, g_m each of
many candidate courses of the change, and b is free or of a known size. Every candidate is compared with none by the
likelihoods at the best size and correlation of the noise under each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .generalised_least_squares import regressions

# Over a second: white noise, and time constants of 1.4, 4.5, 9.5, 20 and 50 s. A slower one is a change itself in a
# record of two minutes.
CORRELATIONS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98)
# LEAST_LEFT: share of a candidate's squared length left beside the nuisances: less is known to rounding and to
# the nuisances' own errors only.
LEAST_LEFT = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChangeScan:
    """What a scan says of every candidate.

    Attributes
    ----------
    statistic : (n_candidates,) twice the gain in log-likelihood, 0 for a candidate that the nuisances imitate.
    amplitude, sd : (n_candidates,) its size in units of y and the standard deviation of that, infinite for the same.
    leverage : (n_candidates,) how much an error of at most 1 in every sample, of any course, changes the size at most.
    hidden : (n_candidates,) the largest size, of either sign, that added to the record may leave its statistic below
        `declared_at`; infinite where any may.
    noise_sd : of the noise without a change.
    """

    statistic: FloatArray
    amplitude: FloatArray
    sd: FloatArray
    leverage: FloatArray
    hidden: FloatArray
    noise_sd: float


def steps_and_ramps(time_s: FloatArray, onsets_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n_samples, n_onsets) of 1 from an onset on, and of the seconds since an onset, 0 before."""
    since = time_s[:, None] - onsets_s
    return (since >= 0.0).astype(np.float64), np.maximum(since, 0.0)


def scan_changes(
    y: FloatArray,
    time_s: FloatArray,
    nuisances: FloatArray,
    candidates: FloatArray,
    *,
    floor: float,
    sizes: FloatArray | None = None,
    declared_at: float = np.inf,
) -> ChangeScan:
    """Return how much better each candidate explains a record than none.

    Parameters
    ----------
    y : (n_samples,) finite.
    time_s : (n_samples,) seconds, increasing; gaps are allowed.
    nuisances : (n_samples, n_nuisances), of any scale and rank.
    candidates : (n_samples, n_candidates).
    floor : the least standard deviation that the noise has, in units of y; greater than 0.
    sizes : (n_nuisances,) prior standard deviations of the nuisances' coefficients, infinite for a free one; None
        where all are free.
    declared_at : the statistic from which on a change is told, for `hidden`.

    Raises
    ------
    ValueError : there are no more samples than nuisances, or the floor is not greater than 0.
    """
    n = len(y)
    if not floor > 0.0:
        raise ValueError(f"floor: the least noise is greater than 0, got {floor:g}")
    if n <= nuisances.shape[1] + 1:
        raise ValueError(f"y: a scan needs more samples than its {nuisances.shape[1]} nuisances, got {n}")
    before = _carried(time_s)
    white, log_det = whitened(np.column_stack([y, candidates, nuisances]), time_s)
    courses = white[:, :, 1 : 1 + candidates.shape[1]]
    prior_sd = np.full(nuisances.shape[1], np.inf) if sizes is None else sizes / floor
    left = regressions(white[:, :, 0], white[:, :, 1 + candidates.shape[1] :], prior_sd)
    basis = left.basis[:, :n]
    shown, along = (left.y[:, None, :n] @ courses)[:, 0], basis.transpose(0, 2, 1) @ courses
    length = np.einsum("kij,kij->kj", courses, courses)
    power = length - np.einsum("kij,kij->kj", along, along)
    known = power > LEAST_LEFT * length
    power, squares = np.where(known, power, 0.0), left.squares[:, None]
    # Amplitudes of every correlation and candidate; the likeliest correlation is taken.
    amplitude = np.divide(shown, power, out=np.zeros(power.shape), where=known)
    with_change = np.maximum(squares - amplitude * shown, 0.0)
    likelihood = np.where(known, _log_likelihood(with_change, n, floor) - 0.5 * log_det, -np.inf)
    spread = np.sqrt(np.maximum(with_change / n, floor**2))
    sd = np.divide(spread, np.sqrt(power), out=np.full(power.shape, np.inf), where=known)
    likeliest = (likelihood.argmax(axis=0), np.arange(power.shape[1]))
    # The size is linear in y: the sum of its coefficients, each at its worst.
    total = np.zeros(power.shape[1])
    for i in np.unique(likeliest[0]):
        at = likeliest[0] == i
        total[at] = np.abs(_transposed(courses[i][:, at] - basis[i] @ along[i][:, at], before[i])).sum(axis=0)
    leverage = np.divide(total, power[likeliest], out=np.full(total.shape, np.inf), where=known[likeliest])
    without = (_log_likelihood(squares, n, floor) - 0.5 * log_det)[:, 0]
    k = int(without.argmax())
    # A change of size x that is added is explained by its candidate as well as what was there, so that the likelihood
    # with it stays the same, while the squares without it become S + 2 g x + p x^2, at every correlation.
    least = likelihood[likeliest] - 0.5 * declared_at
    more = np.where(known, _squares_of(least + 0.5 * log_det, n, floor) - squares, 0.0)
    root = np.sqrt(np.maximum(shown**2 + power * more, 0.0))
    hidden = np.divide(np.abs(shown) + root, power, out=np.full(power.shape, np.inf), where=known)
    return ChangeScan(
        statistic=2.0 * np.maximum(likelihood[likeliest] - without[k], 0.0),
        amplitude=amplitude[likeliest],
        sd=sd[likeliest],
        leverage=leverage,
        hidden=hidden.max(axis=0, initial=0.0),
        noise_sd=max(floor, float(np.sqrt(left.squares[k] / n))),
    )


def whitened(x: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n_correlations, ...) x with AR(1) noise of unit variance made white.

    And (n_correlations, 1) the logarithms of the determinants of its covariances.
    """
    before = _carried(time_s)
    share = 1.0 - before**2
    innovation = (x[1:] - before * x[:-1]) / np.sqrt(share)
    first = np.broadcast_to(x[:1], (len(before), *x[:1].shape))
    return np.concatenate([first, innovation], axis=1), np.log(share).sum(axis=1)


def _carried(time_s: FloatArray) -> FloatArray:
    """Return (n_correlations, n - 1, 1) what of the noise of a sample is in that of the next."""
    return np.asarray(np.power(np.array(CORRELATIONS)[:, None, None], np.diff(time_s)[:, None]))


def _transposed(x: FloatArray, before: FloatArray) -> FloatArray:
    """Return the transpose of the matrix that makes noise of one correlation white, times x (n, ...)."""
    turned = x.copy()
    turned[1:] /= np.sqrt(1.0 - before**2)
    turned[:-1] -= before * turned[1:]
    return turned


def _squares_of(likelihood: FloatArray, n: int, floor: float) -> FloatArray:
    """Return the squares at which white noise has a log-likelihood: the inverse of `_log_likelihood`."""
    at_floor = -0.5 * (n * np.log(floor**2) + n)
    with np.errstate(over="ignore"):
        above = n * np.exp(-(2.0 * likelihood + n) / n)
    return np.asarray(np.where(likelihood <= at_floor, above, floor**2 * (-2.0 * likelihood - n * np.log(floor**2))))


def _log_likelihood(squares: FloatArray, n: int, floor: float) -> FloatArray:
    """Return the log-likelihood of white noise at its best variance, or at the least it has; constants left out."""
    variance = np.maximum(squares / n, floor**2)
    return np.asarray(-0.5 * (n * np.log(variance) + squares / variance))
