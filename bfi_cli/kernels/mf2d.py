"""MF2D: the bilinear problem as a convex one, with the nuclear norm for its rank and the l1 norm for few faults.

With ``M_i`` for the products of ``K_i`` and the magnitudes the predictor of `variable_projection` is linear,

    y(k) = sum K_i y(k-i) - sum M_i theta(k-i) + Z theta(k) + e(k),

and the matrix X with the rows [M_i K_i] of every lag and [Z I] at last has as low a rank as there are outputs. Instead
the sum of its singular values is charged for, and that of the magnitudes' sizes. The alternating direction method of
multipliers splits the three terms; its least squares are factorised once for every step size (Boyd et al. 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrmv
from scipy.linalg.lapack import dtpqrt, dtrtri

from . import FloatArray
from .admm import RELAXATION, step_change
from .variable_projection import ProjectedRegression

# Iterations between changes of the step size, each of which costs a factorisation.
EVERY = 30
# The first step size, in weights; the best ones of made records are 2 to 40.
FIRST_STEP = 5.0
# Columns that are reflected at once; the time hardly depends on it.
BLOCK = 32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mf2dSolution:
    """A solution, or the last iterate.

    Attributes
    ----------
    z : (n_signals,) magnitudes as solved, exactly zero where the l1 norm says so; they are shrunk.
    K : (order, n_outputs, n_outputs), M : (order, n_outputs, n_signals).
    objective : half the squared misfit, the nuclear norm and the l1 norm with their weights.
    """

    z: FloatArray
    K: FloatArray
    M: FloatArray
    objective: float
    iterations: int
    converged: bool


def largest_weight(problem: ProjectedRegression) -> float:
    """Return the weight of the l1 norm from about which on all magnitudes are zero: that of the fit without faults."""
    lags, now = problem.y[:, 1:].reshape(len(problem.y), -1), problem.y[:, 0]
    K = np.linalg.lstsq(lags, now, rcond=None)[0]
    error = now - lags @ K
    by_lag = K.reshape(problem.order, problem.n_outputs, problem.n_outputs)
    gradient = []
    for j, (output, _) in enumerate(problem.signals):
        filtered = -np.einsum("mi,ik->mk", problem.theta[:, 1:, j], by_lag[:, output])
        filtered[:, output] += problem.theta[:, 0, j]
        gradient.append(abs(float(np.sum(filtered * error))))
    return max(gradient, default=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """The coefficients of every output as one vector: of its lags, of the lagged signals, and its own magnitudes.

    Attributes
    ----------
    signals : by output the signals on it.
    columns : by output (n_rows, n_coefficients); factors : their triangular factors, the output beside as last column.
    """

    order: int
    n_outputs: int
    outputs: NDArray[np.intp]
    signals: tuple[NDArray[np.intp], ...]
    columns: tuple[FloatArray, ...]
    factors: tuple[FloatArray, ...]

    @property
    def n_lagged(self) -> int:
        """Coefficients of lags, of the output and of the signals."""
        return self.order * (self.n_outputs + len(self.outputs))

    def matrix_of(self, w: Sequence[FloatArray], z: FloatArray) -> FloatArray:
        """Return X, ((order + 1) n_outputs, n_signals + n_outputs)."""
        s, n_y, n_z = self.order, self.n_outputs, len(self.outputs)
        X = np.zeros((s + 1, n_y, n_z + n_y))
        for i, coefficients in enumerate(w):
            X[:s, i, n_z:] = coefficients[: s * n_y].reshape(s, n_y)
            X[:s, i, :n_z] = coefficients[s * n_y : self.n_lagged].reshape(s, n_z)
        X[s, self.outputs, np.arange(n_z)] = z
        X[s, :, n_z:] = np.eye(n_y)
        return X.reshape(-1, n_z + n_y)

    def solvers(self, step: float) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return by output R^-1, Q'f and the squared weights of the least squares with the quadratic of the splitting.

        Their rows [F; W] = Q R have the solution R^-1 (Q'f + R^-T W^2 x) near x, for W R^-1 are the lower rows of Q.
        """
        made = []
        for F, of in zip(self.factors, self.signals, strict=True):
            n = F.shape[1] - 1
            squared = step * np.concatenate([np.ones(self.n_lagged), np.full(len(of), 2.0)])
            # Rows below a triangle, themselves a triangle, cost a third of those of a full matrix.
            R = dtpqrt(n, min(BLOCK, n + 1), F, np.eye(n, n + 1) * np.sqrt(squared)[:, None])[0]
            made.append((dtrtri(R[:n, :n])[0], R[:n, n], squared))
        return made

    def nearest(
        self, solvers: Sequence[tuple[FloatArray, FloatArray, FloatArray]], X: FloatArray, z: FloatArray
    ) -> tuple[list[FloatArray], FloatArray]:
        """Return the coefficients and magnitudes of least misfit near a matrix and magnitudes."""
        s, n_z = self.order, len(self.outputs)
        target, magnitudes, w = X.reshape(s + 1, self.n_outputs, -1), np.zeros(n_z), []
        for i, ((inverse, explained, squared), of) in enumerate(zip(solvers, self.signals, strict=True)):
            near = 0.5 * (target[s, i, of] + z[of])
            wanted = np.concatenate([target[:s, i, n_z:].ravel(), target[:s, i, :n_z].ravel(), near])
            w.append(dtrmv(inverse, explained + dtrmv(inverse, squared * wanted, trans=1)))
            magnitudes[of] = w[-1][self.n_lagged :]
        return w, magnitudes


def _problem_of(problem: ProjectedRegression) -> _Problem:
    s, n_y, n_rows = problem.order, problem.n_outputs, len(problem.y)
    outputs = np.array([output for output, _ in problem.signals], dtype=np.intp)
    past = np.concatenate([problem.y[:, 1:].reshape(n_rows, -1), -problem.theta[:, 1:].reshape(n_rows, -1)], axis=1)
    signals = tuple(np.flatnonzero(outputs == i) for i in range(n_y))
    columns = tuple(np.concatenate([past, problem.theta[:, 0, of]], axis=1) for of in signals)
    factors = tuple(_triangle(np.column_stack([A, problem.y[:, 0, i]])) for i, A in enumerate(columns))
    return _Problem(order=s, n_outputs=n_y, outputs=outputs, signals=signals, columns=columns, factors=factors)


def _triangle(A: FloatArray) -> FloatArray:
    """Return the square triangular factor of a matrix, which may have fewer rows than columns."""
    return np.asarray(np.linalg.qr(np.pad(A, ((0, max(0, A.shape[1] - len(A))), (0, 0))), mode="r"))


def solve_mf2d(
    problem: ProjectedRegression,
    *,
    nuclear: float,
    sparse: float,
    max_iterations: int = 5000,
    tolerance: float = 1e-6,
) -> Mf2dSolution:
    """Minimise half the squared misfit + nuclear ||X||_* + sparse ||z||_1.

    Parameters
    ----------
    problem : in scaled units; every signal has a magnitude of its own.
    nuclear, sparse : weights, not negative.
    tolerance : of both residuals, relative to the size of what they are differences of.
    """
    split, step = _problem_of(problem), FIRST_STEP * max(nuclear, sparse, 1e-12)
    n_y, n_z = split.n_outputs, len(split.outputs)
    solvers = split.solvers(step)
    Y, v = split.matrix_of([np.zeros(split.n_lagged)] * n_y, np.zeros(n_z)), np.zeros(n_z)
    U, t = np.zeros_like(Y), np.zeros(n_z)
    w: list[FloatArray] = []
    converged, iteration = False, 0
    for iteration in range(1, max_iterations + 1):
        # 1. Least squares, one output after the other.
        w, z = split.nearest(solvers, Y - U, v - t)
        X = split.matrix_of(w, z)
        # 2. Singular values and magnitudes are shrunk.
        relaxed, loose = RELAXATION * X + (1.0 - RELAXATION) * Y, RELAXATION * z + (1.0 - RELAXATION) * v
        before, v_before = Y, v
        left, values, right = np.linalg.svd(relaxed + U, full_matrices=False)
        Y = (left * np.maximum(values - nuclear / step, 0.0)) @ right
        v = np.sign(loose + t) * np.maximum(np.abs(loose + t) - sparse / step, 0.0)
        # 3. Multipliers.
        U, t = U + relaxed - Y, t + loose - v
        primal = float(np.hypot(np.linalg.norm(X - Y), np.linalg.norm(z - v)))
        dual = float(step * np.hypot(np.linalg.norm(Y - before), np.linalg.norm(v - v_before)))
        size, multiplier = float(np.linalg.norm(X)), float(step * np.hypot(np.linalg.norm(U), np.linalg.norm(t)))
        converged = primal <= tolerance * size and dual <= tolerance * max(multiplier, 1e-300)
        if converged:
            break
        if iteration % EVERY == 0:
            change = step_change(primal / size, dual / max(multiplier, 1e-300))
            if change != 1.0:
                step, U, t = step * change, U / change, t / change
                solvers = split.solvers(step)
    misfit = sum(
        float(np.sum((problem.y[:, 0, i] - A @ np.concatenate([coefficients[: split.n_lagged], v[of]])) ** 2))
        for i, (A, coefficients, of) in enumerate(zip(split.columns, w, split.signals, strict=True))
    )
    X = split.matrix_of(w, v)
    blocks = X[:-n_y].reshape(split.order, n_y, n_z + n_y)
    return Mf2dSolution(
        z=v,
        K=blocks[:, :, n_z:].copy(),
        M=blocks[:, :, :n_z].copy(),
        objective=0.5 * misfit + nuclear * float(np.linalg.norm(X, "nuc")) + sparse * float(np.sum(np.abs(v))),
        iterations=iteration,
        converged=converged,
    )
