"""Rank-constrained least squares by recursive importance sketching (thesis section 3-1; Luo, Huang, Li, Zhang).

One step solves the least squares over the tangent space of the rank-r matrices at the current X and maps the answer
back onto them. The published sketch splits the tangent space into the parts (U, V), (U_perp, V) and (U, V_perp); the
first two together are any matrix times V^T, so U_perp is never needed and X_U is solved for at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import EPS, FloatArray
from .compiled import lapack
from .progress import Iterate, StoppingRule, Termination, iterate
from .triangular import DEFICIENT, NO_SKETCH, least_squares


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Factors:
    """A matrix of low rank as ``left @ right.T``: left (p1, r), right (p2, r)."""

    left: FloatArray
    right: FloatArray

    @property
    def X(self) -> FloatArray:
        """The matrix itself, (p1, p2)."""
        return np.asarray(self.left @ self.right.T)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RisroSolution:
    """The minimiser found.

    Attributes
    ----------
    factors : X = left @ right.T.
    misfit : 2-norm of y - A(X).
    iterations, termination : steps made, and why no more were.
    condition_number : of the last sketched regressor, columns scaled to unit norm; infinite if there was none.
    """

    factors: Factors
    misfit: float
    iterations: int
    termination: Termination
    condition_number: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State(Iterate):
    """An iterate with orthonormal bases of its spaces, A V, and the triangular factor of the sketch behind it."""

    factors: Factors
    X: FloatArray
    U: FloatArray
    V: FloatArray
    V_perp: FloatArray
    AV: FloatArray
    misfit: float
    sketch: FloatArray


def risro(
    A: FloatArray,
    y: FloatArray,
    *,
    rank: int,
    initial: Factors | None = None,
    max_iterations: int = 50,
    tolerance: float = 1e-10,
    fixed: bool = False,
    between: Callable[[Factors], Factors] | None = None,
) -> RisroSolution:
    """Minimise ||y - A(X)|| over X of the given rank (eq. 3-12 to 3-16, algorithm 3).

    Regressors without a rank constraint are projected out of A and y by the caller.

    Parameters
    ----------
    A : (n, p1, p2) covariates, A(X)_k = <A_k, X>.
    y : (n,).
    rank : of X, 1 <= rank <= min(p1, p2).
    initial : the start; by default the unconstrained least squares cut to the rank, or where the data do not
        determine that, the leading part of sum_k y_k A_k.
    max_iterations, tolerance, fixed : see `progress.StoppingRule`.
    between : changes X after every step but the last (the sparsity stage).

    Raises
    ------
    ValueError : shapes disagree or the rank is out of range.
    """
    if A.ndim != 3 or y.shape != (len(A),):
        raise ValueError(f"A must be (n, p1, p2) and y (n,), got {A.shape} and {y.shape}")
    if not 1 <= rank <= min(A.shape[1:]):
        raise ValueError(f"rank must lie in 1..{min(A.shape[1:])}, got {rank}")
    last, iterations, termination = iterate(
        lambda state: _step(A, y, state),
        _state(A, y, _start(A, y, rank) if initial is None else initial, NO_SKETCH),
        scale=float(np.linalg.norm(y)),
        settings=StoppingRule(max_iterations=max_iterations, tolerance=tolerance, fixed=fixed),
        between=None if between is None else lambda state: _state(A, y, between(state.factors), state.sketch),
    )
    return RisroSolution(
        factors=last.factors,
        misfit=last.misfit,
        iterations=iterations,
        termination=termination,
        condition_number=float(np.linalg.cond(np.triu(last.sketch))),
    )


def _start(A: FloatArray, y: FloatArray, rank: int) -> Factors:
    """Return the unconstrained least squares, or where it is undetermined sum_k y_k A_k, cut to the rank."""
    n, p1, p2 = A.shape
    flat = A.reshape(n, p1 * p2)
    whole = flat.T @ y
    if n >= p1 * p2:
        x, triangle = least_squares(flat, y)
        whole = x if lapack.dtrcon(triangle)[0] > DEFICIENT else whole
    U, values, Vt = np.linalg.svd(whole.reshape(p1, p2), full_matrices=False)
    return Factors(left=U[:, :rank] * values[:rank], right=Vt[:rank].T)


def _state(A: FloatArray, y: FloatArray, factors: Factors, sketch: FloatArray) -> _State:
    r = factors.left.shape[1]
    U, V_all = _orthonormal(factors.left)[:, :r], _orthonormal(factors.right)
    V, V_perp = V_all[:, :r], V_all[:, r:]
    same = Factors(left=factors.left @ (V.T @ factors.right).T, right=V)
    AV = (A.reshape(-1, A.shape[2]) @ V).reshape(*A.shape[:2], -1)
    misfit = float(np.linalg.norm(y - AV.reshape(len(A), -1) @ same.left.ravel()))
    return _State(factors=same, X=same.X, U=U, V=V, V_perp=V_perp, AV=AV, misfit=misfit, sketch=sketch)


def _step(A: FloatArray, y: FloatArray, state: _State) -> _State | None:
    """Return the next iterate, None where the sketched core is singular."""
    n, p1, p2 = A.shape
    U, V, V_perp, r = state.U, state.V, state.V_perp, state.U.shape[1]
    across = np.matmul(U.T, A) @ V_perp
    x, sketch = least_squares(np.hstack([state.AV.reshape(n, p1 * r), across.reshape(n, r * (p2 - r))]), y)
    X_U = x[: p1 * r].reshape(p1, r)
    B = U.T @ X_U
    X_V = V @ B.T + V_perp @ x[p1 * r :].reshape(r, p2 - r).T
    left, values, right = np.linalg.svd(B)
    if not values[-1] > EPS * p1 * np.linalg.norm(X_U):
        return None
    return _state(A, y, Factors(left=X_U @ (right.T / values) @ left.T, right=X_V), sketch)


def _orthonormal(M: FloatArray) -> FloatArray:
    """Return a square orthogonal matrix whose first columns span those of M."""
    reflectors, tau = lapack.dgeqrf(M)[:2]
    square = np.zeros((len(M), len(M)), order="F")
    square[:, : M.shape[1]] = reflectors
    return np.asarray(lapack.dorgqr(square, tau, overwrite_a=True)[0])
