"""MF2D: the bilinear problem as a convex one, with the nuclear norm for its rank and the l1 norm for few faults.

With ``M_i`` for the products of ``K_i`` and the magnitudes the predictor of `variable_projection` is linear,

    y(k) = sum K_i y(k-i) - sum M_i theta(k-i) + Z theta(k) + e(k),

and the matrix X with the rows [M_i K_i] of every lag and [Z I] at last has as low a rank as there are outputs. Instead
the sum of its singular values is charged for, and that of the magnitudes' sizes. The alternating direction method of
multipliers splits the three terms; its least squares are factorised once for every step size (Boyd et al. 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from . import FloatArray
from .variable_projection import ProjectedRegression

# Relaxation and the balance of the two residuals by the step size (Boyd et al. 2011, sections 3.4.1 and 3.4.3).
RELAXATION, UNBALANCED, CHANGE, EVERY = 1.6, 5.0, 2.0, 20


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
    s, n_y, n_z = problem.order, problem.n_outputs, len(problem.signals)
    n_k, n_m = s * n_y, s * n_z
    outputs = np.array([output for output, _ in problem.signals], dtype=int)
    past = np.concatenate(
        [problem.y[:, 1:].reshape(len(problem.y), n_k), -problem.theta[:, 1:].reshape(len(problem.y), n_m)], axis=1
    )
    own = [np.flatnonzero(outputs == i) for i in range(n_y)]
    A = [np.concatenate([past, problem.theta[:, 0, of]], axis=1) for of in own]
    # Rows beyond the rank of a triangular factor say nothing of the coefficients; they are part of the misfit.
    factors: list[FloatArray] = [
        np.asarray(np.linalg.qr(np.column_stack([a, problem.y[:, 0, i]]), mode="r")) for i, a in enumerate(A)
    ]

    def matrix_of(w: list[FloatArray], z: FloatArray) -> FloatArray:
        """Return X, ((s + 1) n_y, n_z + n_y)."""
        X = np.zeros((s + 1, n_y, n_z + n_y))
        for i, one in enumerate(w):
            X[:s, i, n_z:], X[:s, i, :n_z] = one[:n_k].reshape(s, n_y), one[n_k : n_k + n_m].reshape(s, n_z)
        X[s, outputs, np.arange(n_z)] = z
        X[s, :, n_z:] = np.eye(n_y)
        return X.reshape(-1, n_z + n_y)

    def factorised(step: float) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return Q, R and the weights of the least squares with the quadratic of the splitting below."""
        made = []
        for F, of in zip(factors, own, strict=True):
            weight = np.sqrt(step * np.concatenate([np.ones(n_k + n_m), np.full(len(of), 2.0)]))
            Q, R = np.linalg.qr(np.vstack([F[:, :-1], np.diag(weight)]))
            made.append((Q, R, weight))
        return made

    step = max(nuclear, sparse, 1e-12)
    solvers = factorised(step)
    Y, v = matrix_of([np.zeros(n_k + n_m)] * n_y, np.zeros(n_z)), np.zeros(n_z)
    U, t = np.zeros_like(Y), np.zeros(n_z)
    converged, iteration = False, 0
    for iteration in range(1, max_iterations + 1):
        # 1. Least squares, one output after the other.
        target, z = (Y - U).reshape(s + 1, n_y, n_z + n_y), np.zeros(n_z)
        w: list[FloatArray] = []
        for i, ((Q, R, weight), F, of) in enumerate(zip(solvers, factors, own, strict=True)):
            near = 0.5 * (target[s, i, of] + v[of] - t[of])
            wanted = np.concatenate([target[:s, i, n_z:].ravel(), target[:s, i, :n_z].ravel(), near])
            one: FloatArray = solve_triangular(R, Q.T @ np.concatenate([F[:, -1], weight * wanted]), check_finite=False)
            w.append(one)
            z[of] = one[n_k + n_m :]
        X = matrix_of(w, z)
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
            uneven = (primal / size) / max(dual / max(multiplier, 1e-300), 1e-300)
            if uneven > UNBALANCED or uneven < 1.0 / UNBALANCED:
                change = CHANGE if uneven > 1.0 else 1.0 / CHANGE
                step, U, t = step * change, U / change, t / change
                solvers = factorised(step)
    misfit = sum(
        float(np.sum((problem.y[:, 0, i] - a @ np.concatenate([one[: n_k + n_m], v[of]])) ** 2))
        for i, (a, one, of) in enumerate(zip(A, w, own, strict=True))
    )
    X = matrix_of(w, v)
    objective = 0.5 * misfit + nuclear * float(np.linalg.norm(X, "nuc")) + sparse * float(np.sum(np.abs(v)))
    blocks = X[: s * n_y].reshape(s, n_y, n_z + n_y)
    return Mf2dSolution(
        z=v,
        K=blocks[:, :, n_z:].copy(),
        M=blocks[:, :, :n_z].copy(),
        objective=objective,
        iterations=iteration,
        converged=converged,
    )
