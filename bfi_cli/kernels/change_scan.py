"""A change at an unknown time in a record with nuisances and noise of unknown size and correlation.

y = N b + x g_m + e, where e is a stationary AR(1) process whose correlation over a second is one of a few, g_m each of
many candidate courses of the change, and b is free or of a known size. Every candidate is compared with none by the
likelihoods at the best size and correlation of the noise under each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray

# Over a second: white noise, and time constants of 1.4, 4.5, 9.5, 20 and 50 s. A slower one is a change itself in a
# record of two minutes.
CORRELATIONS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98)
# Of the squared length of a candidate, what has to be left of it beside the nuisances: less is known to rounding and to
# the nuisances' own errors only.
LEAST_LEFT = 1e-4
# Relative, of the singular values of the nuisances.
RANK = 1e-9


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
    scale = np.linalg.norm(nuisances, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    stacked = np.column_stack([y, candidates, nuisances / scale])
    # A coefficient of a known size is one more row: 0 with a standard deviation of the least noise.
    prior = np.diag(floor / (np.full(len(scale), np.inf) if sizes is None else sizes) / scale)
    prior = np.hstack([np.zeros((len(scale), 1 + candidates.shape[1])), prior])
    m = candidates.shape[1]
    none, with_one = [], []
    without_change: list[tuple[float, float, FloatArray, FloatArray]] = []
    for correlation in CORRELATIONS:
        white, log_det = _whitened(stacked, time_s, correlation)
        white = np.vstack([white, prior])
        left, singular, _ = np.linalg.svd(white[:, 1 + m :], full_matrices=False)
        basis = left[:, singular > RANK * singular[0]] if singular.size else left
        rest = white[:, : 1 + m] - basis @ (basis.T @ white[:, : 1 + m])
        own, others = rest[:, 0], rest[:, 1:]
        power, gain = np.einsum("ij,ij->j", others, others), others.T @ own
        known = power > LEAST_LEFT * np.einsum("ij,ij->j", white[:, 1 : 1 + m], white[:, 1 : 1 + m])
        size = np.divide(gain, power, out=np.zeros(m), where=known)
        squares = float(own @ own)
        without_change.append((squares, log_det, gain, np.where(known, power, 0.0)))
        without = _log_likelihood(np.array(squares), n, floor) - 0.5 * log_det
        with_change = np.maximum(squares - size * gain, 0.0)
        likelihood = np.where(known, _log_likelihood(with_change, n, floor) - 0.5 * log_det, -np.inf)
        none.append((float(without), max(floor, float(np.sqrt(squares / n)))))
        spread = np.sqrt(np.maximum(with_change / n, floor**2))
        sd = np.divide(spread, np.sqrt(power), out=np.full(m, np.inf), where=known)
        # The size is linear in y: the sum of its coefficients, each at its worst.
        total = np.abs(_transposed(others[:n], time_s, correlation)).sum(axis=0)
        leverage = np.divide(total, power, out=np.full(m, np.inf), where=known)
        with_one.append((likelihood, size, sd, leverage))
    best_none, noise_sd = max(none, key=lambda one: one[0])
    tried = np.array(with_one)  # (n_correlations, 4, n_candidates), of which the likeliest is taken
    best, amplitude, sd, leverage = np.take_along_axis(tried, tried[:, :1].argmax(axis=0)[None], axis=0)[0]
    return ChangeScan(
        statistic=2.0 * np.maximum(best - best_none, 0.0),
        amplitude=amplitude,
        sd=sd,
        leverage=leverage,
        hidden=_hidden(without_change, best - 0.5 * declared_at, n, floor),
        noise_sd=noise_sd,
    )


def _whitened(x: FloatArray, time_s: FloatArray, correlation: float) -> tuple[FloatArray, float]:
    """Return x with AR(1) noise of unit variance made white, and the logarithm of the determinant of its covariance."""
    before = np.power(correlation, np.diff(time_s))[:, None]
    share = 1.0 - before**2
    innovation = (x[1:] - before * x[:-1]) / np.sqrt(share)
    return np.concatenate([x[:1], innovation]), float(np.sum(np.log(share)))


def _transposed(x: FloatArray, time_s: FloatArray, correlation: float) -> FloatArray:
    """Return the transpose of the matrix that makes noise white, times x."""
    before = np.power(correlation, np.diff(time_s))[:, None]
    turned = x.copy()
    turned[1:] /= np.sqrt(1.0 - before**2)
    turned[:-1] -= before * turned[1:]
    return turned


def _hidden(
    without_change: list[tuple[float, float, FloatArray, FloatArray]], least: FloatArray, n: int, floor: float
) -> FloatArray:
    """Return (n_candidates,) the size beyond which a change makes "no change" less likely than `least` allows.

    A change of size x that is added is explained by its candidate as well as what was there, so that the likelihood
    with it stays the same, while the squares without it become S + 2 g x + p x^2, at every correlation.

    Parameters
    ----------
    without_change : of every correlation S, the logarithm of the determinant, and (n_candidates,) g and p, 0 where the
        nuisances imitate the candidate.
    least : (n_candidates,) the log-likelihood without a change at which the change is declared.
    """
    size = np.zeros(len(least))
    for squares, log_det, gain, power in without_change:
        more = np.where(power > 0.0, _squares_of(least + 0.5 * log_det, n, floor) - squares, 0.0)
        root = np.sqrt(np.maximum(gain**2 + power * more, 0.0))
        told = np.divide(np.abs(gain) + root, power, out=np.full(len(least), np.inf), where=power > 0.0)
        size = np.maximum(size, told)
    return size


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
