"""Rank-constrained least squares by recursive importance sketching (thesis section 3-1; Luo, Huang, Li, Zhang).

One step solves the least squares over the tangent space of the rank-r matrices at the current X and maps the answer
back onto them. The published sketch splits the tangent space into the parts (U, V), (U_perp, V) and (U, V_perp); the
first two together are any matrix times V^T, so U_perp is never needed and X_U is solved for at once.

The form of several outputs is in coordinates in which a prediction error has unit covariance (`WhitenedOutputs`): a
fault may act on any output there, so its signals are dense. Least squares in these coordinates does not depend on the
units of the outputs nor on their order. One output is left as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import EPS, FloatArray
from .compiled import einsum, lapack
from .lagged import PANEL
from .progress import Iterate, StoppingRule, Termination, iterate
from .variable_projection import ProjectedRegression, without_signal

# Condition number, inverted, beyond which a least squares is taken to be rank deficient: its solution has four digits.
DEFICIENT = 1e-12
NO_SKETCH = np.zeros((1, 1))


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


def least_squares(S: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares solution of ``S x = y``, and S with columns of unit norm as a triangular factor.

    What lies below the factor's diagonal is not part of it. By QR; where S is rank deficient (condition number
    above 1e12), the solution of least norm in the scaled columns.
    """
    if not S.shape[1]:
        return np.zeros(0), np.zeros((0, 0))
    n = S.shape[1]
    norms = np.sqrt(einsum("ij,ij->j", S, S))
    norms[norms <= EPS * norms.max(initial=0.0)] = 1.0
    stacked = np.empty((max(len(S), n + 1), n + 1), order="F")
    stacked[: len(S), :n] = S / norms
    stacked[: len(S), n] = y
    stacked[len(S) :] = 0.0
    R = lapack.dgeqrt(min(PANEL, n + 1), stacked, overwrite_a=True)[0][:n]
    triangle, right = R[:, :n], R[:, n]
    if lapack.dtrcon(triangle)[0] > DEFICIENT:
        x = lapack.dtrtrs(triangle, right)[0]
    else:
        try:
            x = np.linalg.lstsq(np.triu(triangle), right, rcond=DEFICIENT)[0]
        except np.linalg.LinAlgError:
            # The SVD need not converge (seen with 40 noisy steps); a pivoted QR always ends.
            from scipy import linalg

            x = linalg.lstsq(np.triu(triangle), right, cond=DEFICIENT, lapack_driver="gelsy")[0]
    return x / norms, triangle


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WhitenedOutputs:
    """The regression of `ProjectedRegression` with rows (m) last.

    Attributes
    ----------
    y : (order + 1, n_outputs, m) outputs at lags 0..order.
    theta : (order + 1, n_outputs, n, m) signals of the atoms.
    atoms : (n,) of the dictionary, those with a signal.
    whiten : (n_outputs, n_outputs), measured outputs @ whiten are these.
    """

    y: FloatArray
    theta: FloatArray
    atoms: np.ndarray[tuple[int], np.dtype[np.intp]]
    whiten: FloatArray

    def coefficients(self, K: FloatArray) -> FloatArray:
        """Return (order n_outputs, n_outputs), past corrected outputs to outputs, of K in the outputs' own units.

        Of one output K is (order,), of several (order, n_outputs, n_outputs).
        """
        n_y = len(self.whiten)
        turned = np.linalg.solve(self.whiten, K.reshape(-1, n_y, n_y).transpose(0, 2, 1)) @ self.whiten
        return turned.reshape(-1, n_y)

    def predictor(self, H: FloatArray) -> FloatArray:
        """Return K in the outputs' own units of its coefficients here: the inverse of `coefficients`."""
        n_y = len(self.whiten)
        turned = self.whiten @ H.reshape(-1, n_y, n_y) @ np.linalg.inv(self.whiten)
        return turned.ravel() if n_y == 1 else turned.transpose(0, 2, 1)


def whitened_outputs(problem: ProjectedRegression, z: FloatArray, K: FloatArray) -> WhitenedOutputs:
    """Return the regression in coordinates in which the prediction errors of (z, K) are orthonormal.

    Where these depend on each other, as they do at round-off, each output is divided by its norm.

    Parameters
    ----------
    z : (n_atoms,) of the dictionary.
    K : (order,) of one output, which is left as it is; (order, n_outputs, n_outputs) of several.
    """
    y, (m, n_lags, n_y) = problem.y, problem.y.shape
    if n_y == 1:
        theta = problem.theta.transpose(1, 2, 0)[:, None]
        atoms = np.array([atom for _, atom in problem.signals], dtype=np.intp)
        return WhitenedOutputs(y=y.transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=np.eye(1))
    less = problem
    for present in np.flatnonzero(z):
        less = without_signal(less, int(present), float(z[present]))
    error = less.y[:, 0] - einsum("kic,imc->km", less.y[:, 1:], K)
    norms = np.linalg.norm(y[:, 0], axis=0)
    norms[norms == 0.0] = 1.0
    R, whiten = np.linalg.qr(error / norms)[1], np.diag(1.0 / norms)
    if m >= n_y and np.linalg.cond(R) * DEFICIENT < 1.0:
        whiten = whiten @ np.linalg.inv(R)
    atoms = np.unique(np.array([atom for _, atom in problem.signals], dtype=np.intp))
    theta = np.zeros((n_lags, n_y, len(atoms), m))
    for column, (output, atom) in enumerate(problem.signals):
        signature = problem.theta[:, :, column].T[:, None] * whiten[output][:, None]
        theta[:, :, np.searchsorted(atoms, atom)] += signature
    return WhitenedOutputs(y=(y @ whiten).transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=whiten)
