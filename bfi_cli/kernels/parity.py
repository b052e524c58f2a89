"""Parity residuals of a noisy record: the left null space of stacked data, estimated on what is known to be healthy.

Stack the outputs of a sample on the regressors of its past, [y(i); x(i)]. Up to noise the stacked data of a healthy
record have a left null space; its basis with the identity on y(i) is [I, -Theta'], and the parity residual
y(i) - Theta' x(i) is a prediction error. Where noise is measured and motion slow, the past itself has a left null
space: only the components of the stacked past outputs that stand out of the noise enter x (`past_basis`).

Theta is estimated on the rows before (`recursive_least_squares`); the residuals are independent and of equal covariance
as long as the record is healthy. A step failure of a sensor adds a known pattern to them. The failure is in the channel
whose step, once admitted, lowers the chi-square most. The filter of the record smears the first row of the step, which
therefore has a height of its own.

A predictor that goes on learning takes a step in, and one that is asked at the first rows sees it before it has risen
through the filters of the record. So the height of a step is told by the coefficients of the last row before it: the
first rows have a height of their own each, and that which the others share is the answer (`step_height`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray, IntArray
from .compiled import lapack, special
from .lagged import lagged
from .recursive_least_squares import RecursiveResiduals, running_covariances

# Motion or power below this share of the largest is round-off.
FLOOR = 1e-12
# A height is not estimated where less than this share of its pattern's power is orthogonal to the patterns of the rows
# before, which have heights of their own.
DEPENDENT = 1e-6
# exp of more overflows.
LARGEST_EXPONENT = 700.0
# Heights that a step has: that of its first row, smeared by the filter, and that of all later ones.
STEP_FREEDOM = 2
# Stretches beside each other of which a variance is told at least: Student's t of fewer hardly bounds anything.
FEWEST_APART = 4
# Stretches that are looked at: more of them overlap so far that they add nothing.
MOST_STRETCHES = 400
# Variance in the units of the outputs' noise that is round-off.
SMALLEST = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drops:
    """By how much a step in one channel lowers the chi-square of the last residuals, at the best onset.

    Attributes
    ----------
    deviate : (n_rows, n_outputs) the drop, as the standard normal deviate that is as rare in a healthy record.
    age : (n_rows, n_outputs) rows from the best onset to the row.
    size : (n_rows, n_outputs) height of that step after its first row, in the outputs' units; 0 at the first row.
    old_size, old_sd : (n_rows, n_old, n_outputs) height and its standard deviation, infinite where it is not estimated,
        of the steps that began window - n_old, ..., window - 1 rows before, the oldest last.
    freedom : (n_rows,) degrees of freedom of the covariance.
    """

    deviate: FloatArray
    age: IntArray
    size: FloatArray
    old_size: FloatArray
    old_sd: FloatArray
    freedom: FloatArray


def past_basis(
    y: FloatArray, *, lags: int, rank: int | None = None, edge: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the directions in which the stacked past outputs move, and the root mean square along each.

    The stack is reduced by QR; no singular value decomposition sees the samples.

    Parameters
    ----------
    y : (n_samples, n_outputs) healthy outputs, each in units of its own noise.
    lags : the past is y(i - 1) ... y(i - lags).
    rank : at most so many directions; None for all.
    edge : directions along which the stack moves less are its left null space and left out.

    Returns
    -------
    (lags * n_outputs, r) orthonormal directions, the largest first, and (r,) their root mean squares, none of them
    smaller than round-off.

    Raises
    ------
    ValueError : there are no more samples than lags.
    """
    if len(y) <= lags:
        raise ValueError(f"{len(y)} samples have no past of {lags} lags")
    stack = lagged(y, range(1, lags + 1))
    triangle = np.linalg.qr(stack - stack.mean(axis=0), mode="r")
    _, values, V = np.linalg.svd(triangle, full_matrices=False)
    spread = values / np.sqrt(len(stack))
    kept = spread > max(edge, FLOOR * spread[0])
    if rank is not None:
        kept[rank:] = False
    return V[kept].T, spread[kept]


def step_response(K: FloatArray, n: int) -> FloatArray:
    """Return what a unit step in each channel adds to the prediction errors of the rows from its onset on.

    Parameters
    ----------
    K : (lags, n_outputs, n_outputs), K[l - 1] maps y(i - l) to the prediction of y(i), as a row times a matrix.
    n : rows.

    Returns
    -------
    (n, n_outputs, n_outputs) by row, prediction error, faulty channel.
    """
    lags, q, _ = K.shape
    absorbed = np.zeros((n, q, q))
    known = min(lags, n - 1)
    absorbed[1 : known + 1] = np.cumsum(K[:known], axis=0).transpose(0, 2, 1)
    absorbed[known + 1 :] = absorbed[known]
    return np.eye(q) - absorbed


def drop_at(deviate: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the drop of chi-square that is as rare as a standard normal deviate, see `largest_drops`."""
    tail = np.minimum(special.log_ndtr(-np.asarray(deviate)) + np.log(2.0), 0.0)
    # A few degrees of freedom and a high level need more than a double holds: no step is as rare.
    return np.asarray(freedom * np.expm1(np.minimum(-2.0 * tail / freedom, LARGEST_EXPONENT)))


def largest_drops(
    errors: RecursiveResiduals, basis: FloatArray, *, window: int, recent: int = 60, patch: int = 0, n_old: int = 1
) -> Drops:
    """Return the largest drops of chi-square over the steps that begin in the last `window` rows, at every row.

    The covariance of the residuals is that of all rows before the window. It is enlarged, never reduced, by how much
    larger each channel's residuals were in the `recent` rows before the window, or typically are in the last `patch`
    rows, and by what a step leaves unexplained of the rows since its onset: gusts and manoeuvres disturb many channels,
    a broken sensor is explained by its step.

    Parameters
    ----------
    errors : of outputs in units of their own noise.
    basis : (lags * n_outputs, r) maps the lag-major past outputs to the last r regressors.
    window : longest time a step is looked back for.
    recent, patch : rows, 0 for none; see `running_covariances`.
    n_old : of how many onsets, the oldest in the window, sizes are wanted as well.
    """
    n, q = errors.residual.shape
    covariances, freedoms = running_covariances(errors, window=window, recent=recent, patch=patch)
    freedom = np.maximum(freedoms - q + 1.0, 1.0)
    every, r, ages = np.arange(q), basis.shape[1], np.arange(window)
    # By age of the onset and rows since then: whether there is such a row, and its index among the last, oldest first.
    since = ages <= ages[:, None]
    place = np.where(since, window - 1 - ages[:, None] + ages, 0)
    spare = np.maximum(q * (ages + 1) - STEP_FREEDOM, 1)[:, None]
    # Whitened residuals, and one over the root of 1 + leverage; zero where the record has no row yet.
    white, shrink = np.zeros((window, q)), np.zeros(window)
    deviate, size, age = np.zeros((n, q)), np.zeros((n, q)), np.zeros((n, q), dtype=np.intp)
    old_size, old_sd = np.zeros((n, n_old, q)), np.full((n, n_old, q), np.inf)
    for i in range(n):
        whitener = np.linalg.inv(np.linalg.cholesky(covariances[i]))
        K = (basis @ errors.coefficients[i, len(errors.coefficients[i]) - r :]).reshape(-1, q, q)
        pattern = whitener @ step_response(K, window)
        known = min(i + 1, window)
        white[-known:] = errors.residual[i + 1 - known : i + 1] @ whitener.T
        shrink[-known:] = 1.0 / np.sqrt(1.0 + errors.leverage[i + 1 - known : i + 1])

        # Inner products, by age and channel, of the residuals (a, s) and of each other (aa, as_, ss) of the patterns of
        # a height of the first row alone and of one of all later rows.
        later = np.concatenate([np.zeros((1, q, q)), pattern[:-1]])
        first = pattern - later
        seen = (white * shrink[:, None])[place] * since[:, :, None]
        along = seen.reshape(window, -1) @ np.concatenate([first, later], axis=2).reshape(window * q, 2 * q)
        a, s = along[:, :q], along[:, q:]
        weight = (shrink**2)[place] * since
        aa, as_, ss = (weight @ np.sum(x * y, axis=1) for x, y in ((first, first), (first, later), (later, later)))
        aa = np.maximum(aa, FLOOR * max(float(aa.max()), 1.0))

        # The drop of chi-square over what it leaves per degree of freedom, at the best age of each channel.
        step_power = ss - as_**2 / aa
        step = np.where(step_power > DEPENDENT * aa, s - as_ * a / aa, 0.0) / np.maximum(step_power, DEPENDENT * aa)
        drop = a**2 / aa + step**2 * np.maximum(step_power, 0.0)
        total = np.cumsum(np.sum(white**2, axis=1)[::-1])[:, None]
        left = np.maximum(1.0, (total - drop) / spare)
        drop /= left
        best = drop.argmax(axis=0)
        age[i], size[i] = best, step[best, every]
        spread = np.full((window, q), np.inf)
        np.sqrt(left / np.maximum(step_power, DEPENDENT * aa), out=spread, where=step_power > DEPENDENT * aa)
        reached = min(max(i + 1 - window + n_old, 0), n_old)
        old_size[i, :reached], old_sd[i, :reached] = (
            each[window - n_old : window - n_old + reached] for each in (step, spread)
        )

        # The standard normal deviate that is as rare as F = drop / 2 with 2 and `freedom` degrees of freedom.
        tail = -0.5 * freedom[i] * np.log1p(drop[best, every] / freedom[i])
        deviate[i] = -special.ndtri_exp(tail - np.log(2.0))
    return Drops(deviate=deviate, age=age, size=size, old_size=old_size, old_sd=old_sd, freedom=freedom)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepHeight:
    """Height of a step and its 95 % interval, in the units of the outputs."""

    height: float
    low: float
    high: float


def step_height(
    X: FloatArray,
    Y: FloatArray,
    coefficients: FloatArray,
    basis: FloatArray,
    *,
    begin: int,
    n_free: int,
    n_shared: int,
    output: int,
) -> StepHeight | None:
    """Return the height of a step in one output.

    Its standard deviation is that which the same weighted sum of prediction errors shows over the stretches of equal
    length before the step, each with the coefficients of its own beginning: errors of real records are neither
    independent nor of one size, and the coefficients are not known exactly. It is never less than that of least
    squares, and is enlarged by what a step leaves unexplained. As many stretches as do not overlap are the degrees of
    freedom of Student's t.

    Parameters
    ----------
    X : (n_rows, n_regressors); Y : (n_rows, n_outputs) in units near the noise of the outputs.
    coefficients : (n_predicted, n_regressors, n_outputs) with which the last rows are predicted.
    basis : (lags * n_outputs, r) maps the lag-major past outputs to the last r regressors.
    begin : row before which there is no step; rows from there on are consecutive samples.
    n_free, n_shared : rows from `begin` on whose heights are their own; rows after these, whose height is the answer.

    Returns
    -------
    None where it is not determined: the rows after or before the step are too few, or the patterns of the free heights
    and of the shared one are the same.
    """
    n, q = n_free + n_shared, Y.shape[1]
    start = len(Y) - len(coefficients)
    apart = (begin - start) // n
    if begin + n > len(Y) or apart < FEWEST_APART:
        return None

    def errors_from(row: int) -> FloatArray:
        return np.asarray(Y[row : row + n] - X[row : row + n] @ coefficients[row - start])

    step = max(1, (begin - n - start) // MOST_STRETCHES)
    before = np.array([errors_from(row) for row in range(start, begin - n + 1, step)])
    covariance = np.einsum("tmi,tmj->ij", before, before) / (len(before) * n) + SMALLEST * np.eye(q)
    lower = np.linalg.cholesky(covariance)

    def whitened(errors: FloatArray) -> FloatArray:
        """Return errors, or patterns, with the outputs on the last axis, whitened."""
        return np.asarray(lapack.dtrtrs(lower, errors.reshape(-1, q).T, lower=True)[0].T.reshape(errors.shape))

    # What a unit step of this output adds from its first row on; the same from each later row on.
    r = basis.shape[1]
    K = (basis @ coefficients[begin - start, X.shape[1] - r :]).reshape(-1, q, q)
    unit = step_response(K, n)[:, :, output]
    later = np.array([np.vstack([np.zeros((row, q)), unit[: n - row]]) for row in range(n_free + 1)])
    patterns = np.concatenate([later[:-1] - later[1:], later[-1:]])
    A = whitened(patterns).reshape(n_free + 1, -1).T
    Q, R = np.linalg.qr(A)
    if R[-1, -1] ** 2 <= DEPENDENT * float(A[:, -1] @ A[:, -1]):
        return None
    weights = Q[:, -1] / R[-1, -1]
    errors = whitened(errors_from(begin)).reshape(-1)
    height = float(weights @ errors)

    sums = whitened(before).reshape(len(before), -1) @ weights
    variance = max(float(np.mean(sums**2)), float(weights @ weights))
    left = errors - Q @ (Q.T @ errors)
    variance *= max(1.0, float(left @ left) / (len(errors) - n_free - 1))
    half = float(special.stdtrit(apart, 0.975) * np.sqrt(variance))
    return StepHeight(height=height, low=height - half, high=height + half)
