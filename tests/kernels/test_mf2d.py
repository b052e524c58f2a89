"""MF2D: the convex problem's solution, its limits, and its agreement with a general solver."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.mf2d import Mf2dSolution, largest_weight, solve_mf2d
from bfi_cli.kernels.variable_projection import ProjectedRegression, fit_magnitudes

ACTIVE = {1: 1.0, 4: -0.75}


def problem_of(seed: int, *, n_outputs: int = 2, n: int = 240, n_atoms: int = 6, noise: float = 0.02):
    """Return a predictor of order 2 with steps that begin at different times, two of them in the record."""
    rng = np.random.default_rng(seed)
    K = [0.6 * np.eye(n_outputs) + 0.1 * rng.standard_normal((n_outputs, n_outputs)), -0.2 * np.eye(n_outputs)]
    clean = np.zeros((n, n_outputs))
    for k in range(2, n):
        drive = 0.3 * np.sin(0.05 * k * np.arange(1, n_outputs + 1))
        clean[k] = K[0] @ clean[k - 1] + K[1] @ clean[k - 2] + drive + noise * rng.standard_normal(n_outputs)
    onsets = 20 + (n - 40) * np.arange(n_atoms) // n_atoms + rng.integers(0, 20, n_atoms)
    theta = (np.arange(n)[:, None] >= onsets).astype(float)
    y = clean.copy()
    for j, z in ACTIVE.items():
        y[:, j * n_outputs // n_atoms] += z * theta[:, j]
    theta, y = (np.stack([x[2 - i : n - i] for i in range(3)], axis=1) for x in (theta, y))
    signals = tuple((j * n_outputs // n_atoms, j) for j in range(n_atoms))
    return ProjectedRegression(theta=theta, y=y, signals=signals, n_rows=n - 2, n_base=0, floor=1e-9)


def objective(problem: ProjectedRegression, at: Mf2dSolution, dz: np.ndarray, nuclear: float, sparse: float) -> float:
    """Return the objective, written out, at a solution whose magnitudes are moved."""
    z, error = at.z + dz, problem.y[:, 0].copy()
    for i in range(problem.order):
        error -= problem.y[:, i + 1] @ at.K[i].T - problem.theta[:, i + 1] @ at.M[i].T
    Z = np.zeros((problem.n_outputs, len(z)))
    for j, (output, _) in enumerate(problem.signals):
        Z[output, j] = z[j]
    error -= problem.theta[:, 0] @ Z.T
    X = np.vstack([*(np.hstack([M, K]) for M, K in zip(at.M, at.K, strict=True)), np.hstack([Z, np.eye(len(Z))])])
    singular = np.linalg.svd(X, compute_uv=False)
    return 0.5 * float(np.sum(error**2)) + nuclear * float(singular.sum()) + sparse * float(np.abs(z).sum())


@pytest.mark.parametrize(("n_outputs", "n", "n_atoms"), [(1, 240, 6), (2, 240, 6), (3, 240, 6), (2, 60, 40)])
def test_the_objective_is_what_it_says_and_is_lowest(n_outputs: int, n: int, n_atoms: int):
    """The last problem has more coefficients than rows."""
    problem = problem_of(0, n_outputs=n_outputs, n=n, n_atoms=n_atoms)
    sparse = 0.1 * largest_weight(problem)
    found = solve_mf2d(problem, nuclear=0.3 * sparse, sparse=sparse, tolerance=1e-8)
    assert found.converged
    lowest = objective(problem, found, np.zeros(n_atoms), 0.3 * sparse, sparse)
    assert found.objective == pytest.approx(lowest, rel=1e-12)
    for j, step in np.ndindex(n_atoms, 2):
        moved = np.zeros(n_atoms)
        moved[j] = (-1.0) ** step * 1e-2
        assert objective(problem, found, moved, 0.3 * sparse, sparse) > lowest


def test_without_weights_it_is_least_squares():
    problem = problem_of(1)
    found = solve_mf2d(problem, nuclear=0.0, sparse=0.0, max_iterations=60)
    misfit = 0.0
    for i in range(2):
        own = [j for j in range(6) if j // 3 == i]
        lags = [x[:, 1:].reshape(238, -1) for x in (problem.y, problem.theta)]
        A = np.hstack([*lags, problem.theta[:, 0, own]])
        misfit += float(np.sum((problem.y[:, 0, i] - A @ np.linalg.lstsq(A, problem.y[:, 0, i], rcond=None)[0]) ** 2))
    assert found.objective == pytest.approx(0.5 * misfit, rel=1e-6)


def test_beyond_the_largest_weight_no_magnitude_is_left():
    problem = problem_of(2)
    sparse = 3.0 * largest_weight(problem)
    assert not solve_mf2d(problem, nuclear=0.0, sparse=sparse).z.any()


@pytest.mark.parametrize("n_outputs", [1, 2, 3])
def test_magnitudes_as_solved_are_shrunk_and_right_once_re_solved(n_outputs: int):
    problem = problem_of(3, n_outputs=n_outputs)
    sparse = 0.3 * largest_weight(problem)
    found = solve_mf2d(problem, nuclear=0.3 * sparse, sparse=sparse)
    assert set(np.flatnonzero(found.z)) == set(ACTIVE)
    for j, z in ACTIVE.items():
        assert 0.2 < found.z[j] / z < 0.9
    again = fit_magnitudes(problem, sorted(ACTIVE), found.z[sorted(ACTIVE)])
    assert again.z == pytest.approx([ACTIVE[j] for j in sorted(ACTIVE)], abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 0.03])
def test_the_objective_is_that_of_a_general_solver(share: float):
    cp = pytest.importorskip("cvxpy")
    for seed in range(3):
        problem = problem_of(seed)
        sparse = share * largest_weight(problem)
        found = solve_mf2d(problem, nuclear=0.3 * sparse, sparse=sparse)
        X, s, n_z = cp.Variable((6, 8)), 2, 6
        Z = X[4:, :n_z]
        rules = [X[4:, n_z:] == np.eye(2), *(Z[1 - output, j] == 0 for j, (output, _) in enumerate(problem.signals))]
        error = problem.y[:, 0] - problem.theta[:, 0] @ Z.T
        for i in range(s):
            K, M = X[2 * i : 2 * i + 2, n_z:], X[2 * i : 2 * i + 2, :n_z]
            error = error - problem.y[:, i + 1] @ K.T + problem.theta[:, i + 1] @ M.T
        cost = 0.5 * cp.sum_squares(error) + 0.3 * sparse * cp.normNuc(X) + sparse * cp.sum(cp.abs(Z))
        assert found.objective == pytest.approx(cp.Problem(cp.Minimize(cost), rules).solve(), rel=1e-4)
