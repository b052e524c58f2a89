"""Least squares with a nuclear-norm penalty, the convex stand-in for a rank constraint (thesis section 3-1).

The penalty takes the same amount off every singular value of the unpenalised answer (exactly so for orthonormal
covariates): directions survive, sizes shrink. The solver is the alternating direction method of multipliers on the
singular value decomposition of the covariates, so its steps do not depend on the number of samples; it stops on the
duality gap, which bounds the distance to the minimum without knowing it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .termination import Termination

# Steps between two looks at the duality gap, which costs as much as a step.
CHECK_EVERY = 10
# Boyd et al. (2011), section 3.4.1: the penalty parameter changes by 2 where one residual is ten times the other.
IMBALANCE = 10.0
RESCALE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuclearSolution:
    """The minimiser found.

    Attributes
    ----------
    X : (p1, p2), of low rank exactly.
    misfit : 2-norm of y - A(X).
    gap : duality gap over 1/2 ||y||^2; the objective lies no more than that above its minimum.
    iterations, termination : steps made, and why no more were.
    """

    X: FloatArray
    misfit: float
    gap: float
    iterations: int
    termination: Termination


def nuclear_least_squares(
    A: FloatArray, y: FloatArray, *, penalty: float, max_iterations: int = 20_000, tolerance: float = 1e-10
) -> NuclearSolution:
    """Minimise 1/2 ||y - A(X)||^2 + penalty ||X||_* over X.

    Parameters
    ----------
    A : (n, p1, p2) covariates, A(X)_k = <A_k, X>.
    y : (n,).
    penalty : positive; X is zero from `largest_penalty` on.
    max_iterations, tolerance : limit of the steps, and the `gap` to stop at; round-off allows about 1e-12 at best.

    Raises
    ------
    ValueError : shapes disagree or the penalty is not positive.
    """
    if A.ndim != 3 or y.shape != (len(A),):
        raise ValueError(f"A must be (n, p1, p2) and y (n,), got {A.shape} and {y.shape}")
    if not penalty > 0:
        raise ValueError(f"the penalty must be positive, got {penalty:g}")
    # The covariates as U diag(values) V^T.
    U, values, Vt = np.linalg.svd(A.reshape(len(A), -1), full_matrices=False)
    shape, b, scale = A.shape[1:], U.T @ y, float(y @ y) / 2.0 or 1.0
    X, price = np.zeros(shape), np.zeros(shape)
    rho, gap = float(np.median(values**2)) or 1.0, np.inf
    termination, count = Termination.MAX_ITERATIONS, 0
    for count in range(1, max_iterations + 1):
        before, target = X, X - price
        # The minimiser of 1/2 ||y - A(X)||^2 + rho/2 ||X - target||^2.
        step = values * (b - values * (Vt @ target.ravel())) / (values**2 + rho)
        fitted = target + (Vt.T @ step).reshape(shape)
        X = soft_threshold(fitted + price, penalty / rho)
        price = price + fitted - X
        if count % CHECK_EVERY == 0 or count == max_iterations:
            # The duality gap: the residual, shortened until feasible, is the dual point.
            residual = b - values * (Vt @ X.ravel())
            steepest = float(np.linalg.norm((Vt.T @ (values * residual)).reshape(shape), 2))
            dual = residual * min(1.0, penalty / steepest) if steepest > 0.0 else residual
            objective = residual @ residual / 2.0 + penalty * np.linalg.norm(X, "nuc")
            gap = float(objective - dual @ (b - dual / 2.0)) / scale
            if gap <= tolerance:
                termination = Termination.CONVERGED
                break
            infeasible, moved = float(np.linalg.norm(fitted - X)), float(np.linalg.norm(X - before))
            factor = 1.0
            if infeasible > IMBALANCE * moved:
                factor = RESCALE
            elif moved > IMBALANCE * infeasible:
                factor = 1.0 / RESCALE
            rho, price = rho * factor, price / factor
    return NuclearSolution(
        X=X, misfit=float(np.linalg.norm(y - np.tensordot(A, X))), gap=gap, iterations=count, termination=termination
    )


def soft_threshold(X: FloatArray, by: float) -> FloatArray:
    """Return X with its singular values lowered by `by`, those below it zero: the proximal map of by ||X||_*."""
    U, values, Vt = np.linalg.svd(X, full_matrices=False)
    return np.asarray((U * np.maximum(values - by, 0.0)) @ Vt)


def largest_penalty(A: FloatArray, y: FloatArray) -> float:
    """Return the smallest penalty at which the minimiser is zero: the spectral norm of sum_k y_k A_k."""
    return float(np.linalg.norm(np.tensordot(y, A, axes=1), 2))
