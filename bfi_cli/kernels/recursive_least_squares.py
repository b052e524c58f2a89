"""Recursive residuals: every row of a regression predicted from the rows before it, by updates of a triangular factor.

Divided by the root of 1 + leverage, the prediction errors of a regression that holds are independent and of equal
covariance, however little is known of the coefficients (Brown, Durbin and Evans 1975): the uncertainty of a model
estimated on a short healthy past is in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import MAD, FloatArray
from .compiled import lapack
from .lagged import add_rows

# A coefficient is known before the record to about noise / PRIOR, that is, next to nothing is known.
PRIOR = 1e-3
# A coefficient known a priori to the noise or better takes no degree of freedom.
KNOWN = 1.0
# Fewest recent rows from which the variance of a channel is estimated.
FEWEST_RECENT = 20
# Floor of the residuals' standard deviation, in the units of the noise.
SMALLEST_SD = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecursiveResiduals:
    """Recursive residuals (Brown, Durbin and Evans 1975) of the rows from `start` on.

    Attributes
    ----------
    start : the first row that was predicted; the rows before were fitted.
    residual : (n_rows - start, n_outputs) prediction errors over the root of 1 + leverage.
    leverage : (n_rows - start,) uncertainty of the prediction relative to the noise.
    coefficients : (n_rows - start, n_regressors, n_outputs) each row was predicted with.
    scatter : (n_outputs, n_outputs) sum of squares of the residuals of the fitted rows.
    freedom : their degrees of freedom, less one for each coefficient known a priori no better than to the noise.
    """

    start: int
    residual: FloatArray
    leverage: FloatArray
    coefficients: FloatArray
    scatter: FloatArray
    freedom: int


def recursive_residuals(
    X: FloatArray, Y: FloatArray, *, start: int, forgetting: float = 1.0, prior: float | FloatArray = PRIOR
) -> RecursiveResiduals:
    """Predict every row from the rows before it, by updates of one triangular factor.

    Parameters
    ----------
    X : (n_rows, n_regressors), Y : (n_rows, n_outputs).
    start : rows fitted before the first prediction.
    forgetting : weight of a row relative to the next.
    prior : (n_regressors,) or one for all; the coefficients are known a priori to be about noise / prior, so that a
        regressor that has not moved yet makes the prediction uncertain, not the equations singular.

    Raises
    ------
    ValueError : shapes disagree, `start` leaves no degree of freedom or no row, or forgetting is not in (0, 1].
    """
    X, Y = np.asarray(X, dtype=np.float64), np.asarray(Y, dtype=np.float64)
    (n, p), q = X.shape, Y.shape[1]
    prior = np.broadcast_to(np.asarray(prior, dtype=np.float64), (p,))
    unknown = int(np.count_nonzero(prior < KNOWN))
    if len(Y) != n or not unknown < start < n:
        raise ValueError(
            f"start must lie between {unknown} regressors and {n} rows of X and {len(Y)} of Y, got {start}"
        )
    if not 0.0 < forgetting <= 1.0:
        raise ValueError(f"forgetting must lie in (0, 1], got {forgetting:g}")
    rows = np.hstack([X, Y])
    first = np.vstack([np.eye(p, p + q) * prior[:, None], rows[:start]])
    T = np.asfortranarray(np.linalg.qr(first, mode="r"))
    residual, leverage, coefficients = np.empty((n - start, q)), np.empty(n - start), np.empty((n - start, p, q))
    scatter = T[p:, p:].T @ T[p:, p:]
    for i in range(start, n):
        T *= np.sqrt(forgetting)
        theta = lapack.dtrtrs(T[:p, :p], T[:p, p:])[0]
        reach = lapack.dtrtrs(T[:p, :p], X[i], trans=1)[0]
        leverage[i - start] = reach @ reach
        coefficients[i - start] = theta
        residual[i - start] = (Y[i] - X[i] @ theta) / np.sqrt(1.0 + reach @ reach)
        T = add_rows(T, rows[i : i + 1])
    return RecursiveResiduals(
        start=start,
        residual=residual,
        leverage=leverage,
        coefficients=coefficients,
        scatter=scatter,
        freedom=start - unknown,
    )


def running_covariances(
    errors: RecursiveResiduals, *, window: int, recent: int, patch: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return for each row the covariance of the residuals, estimated on the rows before, and its degrees of freedom.

    Parameters
    ----------
    window : number of last rows, this one included, that are left out of the estimate.
    recent : number of rows before these; the variance of a channel is enlarged to that of these rows where it is larger
        there than over all rows. 0 for none.
    patch : number of last rows, this one included; the variance of a channel is enlarged to that which the median of
        its absolute residuals in them tells, where it is larger. A median knows a patch of gusts from the few rows of
        a step. 0 for none.

    Returns
    -------
    (n, n_outputs, n_outputs), with a floor for residuals in units near their standard deviation, and (n,).
    """
    w = errors.residual
    n, q = w.shape
    squares = np.concatenate([np.zeros((1, q, q)), np.cumsum(w[:, :, None] * w[:, None, :], axis=0)])
    before = np.maximum(np.arange(n) - window + 1, 0)
    freedom = errors.freedom + before
    covariance = (errors.scatter + squares[before]) / freedom[:, None, None]
    covariance = covariance + SMALLEST_SD**2 * np.eye(q)
    since = np.maximum(before - recent, 0)
    power = np.diagonal(squares[before] - squares[since], axis1=1, axis2=2)
    count = (before - since)[:, None]
    ratio = power / np.maximum(count, 1) / np.diagonal(covariance, axis1=1, axis2=2)
    rough = np.sqrt(np.where(count >= FEWEST_RECENT, np.maximum(ratio, 1.0), 1.0))
    if patch:
        padded = np.pad(np.abs(w), ((patch - 1, 0), (0, 0)), constant_values=np.nan)
        median = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, patch, axis=0), axis=2)
        known = np.minimum(np.arange(1, n + 1), patch)[:, None] >= min(patch, FEWEST_RECENT)
        sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        rough = np.where(known, np.maximum(rough, MAD * median / sd), rough)
    return covariance * rough[:, :, None] * rough[:, None, :], freedom.astype(np.float64)


def predictive_score(errors: RecursiveResiduals) -> float:
    """Return the mean logarithm of the density with which every row was predicted (Student's t), up to a constant."""
    covariances, freedom = running_covariances(errors, window=1, recent=0)
    q = errors.residual.shape[1]
    distance = np.einsum(
        "ij,ij->i", errors.residual, np.linalg.solve(covariances, errors.residual[:, :, None])[:, :, 0]
    )
    spread = np.linalg.slogdet(covariances)[1] + q * np.log1p(errors.leverage)
    return float(-0.5 * np.mean(spread + (freedom + q) * np.log1p(distance / freedom)))
