"""The height of a step in one output, by the predictor as it was before the step, and how far it can be trusted.

A predictor that goes on learning takes a step in, and one that is asked at the first rows sees it before it has risen
through the filters of the record. Here the coefficients are those of the last row before the step. The first rows of
the step have a height of their own each, whatever the filters make of them; the height that the others share is the
answer, by generalised least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from . import FloatArray
from .parity import step_response

# Stretches beside each other of which a variance is told at least: Student's t of fewer hardly bounds anything.
FEWEST_APART = 4
# Stretches that are looked at: more of them overlap so far that they add nothing.
MOST_STRETCHES = 400
# The shared height is not determined where less than this share of its pattern's power is its own.
DEPENDENT = 1e-6
# Variance in the units of the outputs' noise that is round-off.
SMALLEST = 1e-12


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
    start: int,
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
    coefficients : (n_rows - start, n_regressors, n_outputs) with which every row from `start` on is predicted.
    basis : (lags * n_outputs, r) maps the lag-major past outputs to the last r regressors.
    begin : row before which there is no step; rows from there on are consecutive samples.
    n_free, n_shared : rows from `begin` on whose heights are their own; rows after these, whose height is the answer.

    Returns
    -------
    None where it is not determined: the rows after or before the step are too few, or the patterns of the free heights
    and of the shared one are the same.
    """
    n, q = n_free + n_shared, Y.shape[1]
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
        return np.asarray(linalg.solve_triangular(lower, errors.reshape(-1, q).T, lower=True).T.reshape(errors.shape))

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
