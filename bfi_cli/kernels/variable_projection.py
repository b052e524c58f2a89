"""Structured maximum likelihood of magnitudes and predictor, by variable projection on compressed data.

With ``yf = y - theta z`` the predictor ``yf(k) = c + sum B_i u(k-i) + sum K_i yf(k-i) + e(k)`` is linear in (c, B, K)
for given z. For the current z these are solved for; the derivative of the prediction error with respect to z_j is minus
the filtered signature ``g_j(k) = theta_j(k) - sum K_i theta_j(k-i)`` off the regressors, whitened by the residual
covariance. Golub and Pereyra (1973) for variable projection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from .lagged import Compressed, restrict
from .termination import Termination

__all__ = ["Fit", "ProjectedRegression", "fit_magnitudes", "project_inputs", "relaxed_bound"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

RANK_TOLERANCE = 1e-11
HALVINGS = 12
SETTLED = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProjectedRegression:
    """The regression of one order with constant and inputs projected out.

    Attributes
    ----------
    theta : (m, order + 1, n_signals) dictionary signals at lags 0..order.
    y : (m, order + 1, n_outputs) measured outputs at lags 0..order.
    signals : (output, atom) of each signal.
    n_rows : rows the compressed data stand for; n_base : constant and input regressors per output.
    floor : smallest standard deviation a prediction error can have, in the units of y.
    """

    theta: FloatArray
    y: FloatArray
    signals: tuple[tuple[int, int], ...]
    n_rows: int
    n_base: int
    floor: float

    @property
    def order(self) -> int:
        return int(self.y.shape[1]) - 1

    @property
    def n_outputs(self) -> int:
        return int(self.y.shape[2])

    @property
    def n_predictor(self) -> int:
        """Free coefficients of c, B and K."""
        return self.n_outputs * (self.n_base + self.order * self.n_outputs)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A maximum of the likelihood on one support and order.

    Attributes
    ----------
    order : of the predictor.
    atoms : the support, ascending.
    z : (n_active,) magnitudes.
    K : (order, n_outputs, n_outputs), K[i - 1] multiplies yf(k - i).
    log_det : log det of the floored residual covariance; sigma : (n_outputs, n_outputs) that covariance.
    information : (n_active, n_active) of z with the predictor eliminated: its inverse is the covariance of z.
    n_parameters : predictor and magnitudes.
    """

    order: int
    atoms: tuple[int, ...]
    z: FloatArray
    K: FloatArray
    log_det: float
    sigma: FloatArray
    information: FloatArray
    n_parameters: int
    iterations: int
    termination: Termination


def project_inputs(data: Compressed, order: int, *, floor: float = 0.0) -> ProjectedRegression:
    """Return the regression of `order` on the rows of `data`, constant and inputs projected out."""
    lower = restrict(data, order=order)
    columns, R = lower.columns, lower.R
    rest = R[columns.n_base :]
    n, n_signals = len(rest), len(columns.signals)
    theta = np.empty((n, order + 1, n_signals))
    theta[:, 0] = rest[:, columns.theta]
    theta[:, 1:] = rest[:, columns.theta_lags].reshape(n, order, n_signals)
    y = np.empty((n, order + 1, columns.n_outputs))
    y[:, 0] = rest[:, columns.y]
    y[:, 1:] = rest[:, columns.y_lags].reshape(n, order, columns.n_outputs)
    return ProjectedRegression(
        theta=theta, y=y, signals=columns.signals, n_rows=data.n_rows, n_base=columns.n_base, floor=floor
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Predictor:
    """(K, prediction error) for given z: Q spans the lagged corrected outputs."""

    Q: FloatArray
    K: FloatArray
    error: FloatArray
    root: FloatArray
    log_det: float


def fit_magnitudes(
    problem: ProjectedRegression,
    atoms: Sequence[int],
    start: FloatArray | None = None,
    *,
    max_iterations: int = 50,
    tolerance: float = 1e-9,
) -> Fit:
    """Maximise the likelihood over (c, B, K, z) with z supported on `atoms`, from `start` (zero by default).

    Parameters
    ----------
    problem : from `bilinear`.
    atoms : the support, ascending.
    start : (len(atoms),) magnitudes to start from.
    tolerance : on the fall of the log-likelihood per row, and on the step relative to the magnitudes' own deviations.
    """
    atoms = tuple(atoms)
    theta, scatter = _support(problem, atoms)
    z = np.zeros(len(atoms)) if start is None else np.array(start, dtype=np.float64)
    at = _predict(problem, theta, scatter, z)
    termination, iterations = Termination.CONVERGED, 0
    while atoms:
        if iterations == max_iterations:
            termination = Termination.MAX_ITERATIONS
            break
        iterations += 1
        G, e = _whitened(problem, theta, scatter, at)
        step = _least_squares(G, e)
        trial, z_new = _line_search(problem, theta, scatter, (z, step, at))
        if trial is None:
            settled = float(np.sum((G @ step) ** 2)) < SETTLED * problem.n_rows
            termination = Termination.CONVERGED if settled else Termination.STAGNATED
            break
        fall = at.log_det - trial.log_det
        z, at = z_new, trial
        if fall < tolerance and float(np.sum((G @ step) ** 2)) < tolerance * problem.n_rows:
            break
    G, _ = _whitened(problem, theta, scatter, at)
    return Fit(
        order=problem.order,
        atoms=atoms,
        z=z,
        K=at.K,
        log_det=at.log_det,
        sigma=at.root.T @ at.root,
        information=G.T @ G,
        n_parameters=problem.n_predictor + len(atoms),
        iterations=iterations,
        termination=termination,
    )


def relaxed_bound(problem: ProjectedRegression, base: Fit | None, extra: int) -> tuple[float, float]:
    """Free the lagged coefficients of atom `extra`: the bilinear constraint dropped.

    The atoms of `base` may move along their filtered signatures, so with a support the value is a guide rather than a
    strict bound; without one it bounds every magnitude of `extra`.

    Returns
    -------
    log_det : what the freed problem reaches.
    magnitude : the coefficient of `extra` at lag 0, a start for `fit_magnitudes`.
    """
    theta, scatter = _support(problem, base.atoms if base else ())
    z = base.z if base else np.zeros(0)
    corrected = problem.y - theta @ (scatter @ z)
    own, place = _support(problem, (extra,))
    n = len(corrected)
    moves = _signatures(theta, scatter, base.K).reshape(n, -1) if base and base.atoms else np.zeros((n, 0))
    regressors = np.hstack([corrected[:, 1:].reshape(n, -1), own.reshape(n, -1), moves])
    Q, _, K = _regress(regressors, corrected[:, 0])
    error = corrected[:, 0] - Q @ (Q.T @ corrected[:, 0])
    _, log_det = _root(error, problem)
    now = K[problem.order * problem.n_outputs :][: own.shape[2]]
    outputs = np.argmax(place[:, :, 0], axis=1)
    return log_det, float(np.mean(now[np.arange(len(outputs)), outputs])) if len(outputs) else 0.0


def _support(problem: ProjectedRegression, atoms: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    place = {atom: j for j, atom in enumerate(atoms)}
    kept = [n for n, (_, atom) in enumerate(problem.signals) if atom in place]
    scatter = np.zeros((len(kept), problem.n_outputs, len(atoms)))
    for n, signal in enumerate(kept):
        output, atom = problem.signals[signal]
        scatter[n, output, place[atom]] = 1.0
    return problem.theta[:, :, kept], scatter


def _predict(problem: ProjectedRegression, theta: FloatArray, scatter: FloatArray, z: FloatArray) -> _Predictor:
    corrected = problem.y - theta @ (scatter @ z)
    n, n_y = len(corrected), problem.n_outputs
    Q, _, K = _regress(corrected[:, 1:].reshape(n, -1), corrected[:, 0])
    error = corrected[:, 0] - Q @ (Q.T @ corrected[:, 0])
    root, log_det = _root(error, problem)
    lags = K.reshape(problem.order, n_y, n_y).transpose(0, 2, 1)
    return _Predictor(Q=Q, K=lags, error=error, root=root, log_det=log_det)


def _regress(X: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Orthonormal basis of X, its factor, and the coefficients of Y; a basis of lower rank where X is deficient."""
    Q, R = np.linalg.qr(X)
    diagonal = np.abs(np.diag(R))
    if diagonal.size and diagonal.min() > RANK_TOLERANCE * diagonal.max():
        return Q, R, np.asarray(lapack.dtrtrs(R, Q.T @ Y)[0])
    U, s, Vt = np.linalg.svd(X, full_matrices=False)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[0])) if s.size else 0
    U, s, Vt = U[:, :rank], s[:rank], Vt[:rank]
    return U, R, Vt.T @ ((U.T @ Y) / s[:, None])


def _root(error: FloatArray, problem: ProjectedRegression) -> tuple[FloatArray, float]:
    """Triangular root of the floored residual covariance, and log det of that covariance."""
    floor = max(problem.floor, np.finfo(float).tiny ** 0.25)
    stacked = np.vstack([error / np.sqrt(problem.n_rows), floor * np.eye(problem.n_outputs)])
    root = np.asarray(np.linalg.qr(stacked, mode="r"), dtype=np.float64)
    return root, 2.0 * float(np.sum(np.log(np.abs(np.diag(root)))))


def _whitened(
    problem: ProjectedRegression, theta: FloatArray, scatter: FloatArray, at: _Predictor
) -> tuple[FloatArray, FloatArray]:
    """Filtered signatures off the regressors and the prediction error, both whitened, outputs stacked."""
    n, n_y = len(theta), problem.n_outputs
    G = _signatures(theta, scatter, at.K)
    G -= (at.Q @ (at.Q.T @ G.reshape(n, -1))).reshape(G.shape)
    stacked = np.concatenate([G, at.error[:, :, None]], axis=2).transpose(1, 0, 2).reshape(n_y, -1)
    white = _forward_substitute(at.root, stacked).reshape(n_y * n, -1)
    return white[:, :-1], white[:, -1]


def _signatures(theta: FloatArray, scatter: FloatArray, K: FloatArray) -> FloatArray:
    """Return (m, n_outputs, n_active) signals filtered by the predictor: theta(k) - sum K_i theta(k - i)."""
    place = scatter.sum(axis=2)
    filtered = theta[:, 0, None, :] * place.T - np.einsum("nls,los->nos", theta[:, 1:], K @ place.T)
    return np.asarray(filtered @ scatter.sum(axis=1))


def _forward_substitute(root: FloatArray, B: FloatArray) -> FloatArray:
    """Solve root^T x = B for an upper triangular root."""
    return np.asarray(lapack.dtrtrs(root, B, trans=1)[0])


def _least_squares(G: FloatArray, e: FloatArray) -> FloatArray:
    scale = np.linalg.norm(G, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(G / scale, e, rcond=RANK_TOLERANCE)[0] / scale)


def _line_search(
    problem: ProjectedRegression,
    theta: FloatArray,
    scatter: FloatArray,
    state: tuple[FloatArray, FloatArray, _Predictor],
) -> tuple[_Predictor | None, FloatArray]:
    z, step, at = state
    length = 1.0
    for _ in range(HALVINGS):
        trial = _predict(problem, theta, scatter, z + length * step)
        if trial.log_det < at.log_det:
            return trial, z + length * step
        length /= 2.0
    return None, z
