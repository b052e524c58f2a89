"""A course of unknown shape beside a predictor: gradient, likelihood, recovery, and records drawn anew."""

from __future__ import annotations

import numpy as np
import pytest
from made_varx import made
from numpy.testing import assert_allclose

from bfi_cli.kernels import free_course
from bfi_cli.kernels.covariance import Layout
from bfi_cli.kernels.free_course import CourseProblem, course_problem, fit_course, redrawn, walk_columns
from bfi_cli.kernels.lagged import compress
from bfi_cli.kernels.variable_projection import fit_magnitudes, project_inputs

ORDER, N, ONSET = 2, 300, 120
TIME = np.arange(float(N))
LINE, WALK = walk_columns(TIME, onset_s=ONSET, stop_s=TIME[-1], cells=18)
AFTER = TIME >= ONSET
BUMP = np.where(AFTER, np.sin(np.pi * (TIME - ONSET) / 90.0), 0.0)


def layout_of(seed: int, fault: np.ndarray, *, noise_sd: float = 0.05, theta: np.ndarray | None = None) -> Layout:
    """Return a record of a stable system of two states, with a fault on its output."""
    rng = np.random.default_rng(seed)
    u, y = made(rng, order=ORDER).fly(N, rng, noise_sd=noise_sd)
    atoms = np.empty((N, 1, 0)) if theta is None else theta
    return Layout(u=u, y=y + fault[:, None], theta=atoms, first=4, feedthrough=False)


def problem_of(layout: Layout, **keys: object) -> CourseProblem:
    return course_problem(layout, **({"order": ORDER, "line": LINE, "walk": WALK} | keys))


@pytest.mark.parametrize("unit_root", [False, True])
def test_the_deviance_is_that_of_a_dense_normal_density(unit_root: bool) -> None:
    problem = problem_of(layout_of(1, BUMP), unit_root=unit_root)
    K, ratio = np.full(problem.y.shape[1] - 1, 0.3), 0.7
    taps = np.concatenate([[1.0], -K])
    w, L, Z = problem.y @ taps, np.tensordot(taps, problem.line, (0, 1)), np.tensordot(taps, problem.walk, (0, 1))
    V = np.eye(len(w)) + ratio * Z @ Z.T
    gamma = np.linalg.solve(L.T @ np.linalg.solve(V, L), L.T @ np.linalg.solve(V, w))
    misfit = (w - L @ gamma) @ np.linalg.solve(V, w - L @ gamma)
    value, _, _ = free_course.deviance(problem, K, ratio)
    assert_allclose(value, len(w) * np.log(misfit / len(w)) + np.linalg.slogdet(V)[1], rtol=1e-9)


@pytest.mark.parametrize("ratio", [1e-3, 1.0, 1e3])
def test_its_gradient_is_that_of_finite_differences(ratio: float) -> None:
    problem = problem_of(layout_of(2, BUMP))
    K, h = np.array([0.5, -0.1]), 1e-6
    _, by_K, by_ratio = free_course.deviance(problem, K, ratio)
    for i, step in enumerate(np.eye(2) * h):
        up, down = (free_course.deviance(problem, K + sign * step, ratio)[0] for sign in (1.0, -1.0))
        assert_allclose(by_K[i], (up - down) / (2.0 * h), rtol=1e-4, atol=1e-4)
    up, down = (free_course.deviance(problem, K, ratio * np.exp(sign * h))[0] for sign in (1.0, -1.0))
    assert_allclose(by_ratio, (up - down) / (2.0 * h), rtol=1e-4, atol=1e-4)


def test_the_ends_of_its_steps_are_maxima() -> None:
    problem = problem_of(layout_of(3, BUMP))
    fit = fit_course(problem)
    for ratio in np.geomspace(1e-6, 1e6, 13):
        for step in (0.0, 0.02, -0.02):
            assert free_course.deviance(problem, fit.K + step, ratio)[0] >= fit.deviance - 1e-6


def test_it_finds_a_course_that_no_shape_has() -> None:
    for seed in range(5):
        layout = layout_of(seed, 2.0 * BUMP)
        fit = fit_course(problem_of(layout))
        assert np.sum((fit.value - 2.0 * BUMP) ** 2) <= 0.1 * np.sum((2.0 * BUMP) ** 2)
        assert not fit.value[~AFTER].any()


@pytest.mark.slow
def test_its_band_covers_the_course() -> None:
    covered = []
    for seed in range(40):
        fit = fit_course(problem_of(layout_of(seed, 2.0 * BUMP)))
        covered.append(np.mean(np.abs(fit.value - 2.0 * BUMP)[AFTER] <= 1.96 * fit.sd[AFTER]))
    assert np.mean(covered) >= 0.95 - 3.0 * np.std(covered) / np.sqrt(40.0)


def test_a_named_fault_beside_it_keeps_its_magnitude() -> None:
    theta = np.zeros((N, 1, 1))
    theta[60:, 0, 0] = 1.0
    layout = layout_of(7, 2.0 * BUMP + 1.5 * theta[:, 0, 0], theta=theta)
    fit = fit_course(problem_of(layout, named=(0,)))
    assert abs(fit.z[0] - 1.5) <= 0.4
    assert np.sum((fit.value - 2.0 * BUMP) ** 2) <= 0.1 * np.sum((2.0 * BUMP) ** 2)


def test_without_a_walk_it_is_a_step_and_a_drift_of_the_selection() -> None:
    """Where no walk shows, the likelihood is that of the same record with level and slope as named faults."""
    layout = layout_of(8, LINE @ [1.0, 0.02])
    theta = LINE[:, None, :]
    data = compress(layout.u, layout.y, theta, order=layout.first)
    named = fit_magnitudes(project_inputs(data, ORDER), (0, 1))
    line = fit_course(problem_of(layout, walk=1e-9 * WALK[:, :1]))
    assert_allclose(line.deviance, (N - layout.first) * named.log_det, rtol=1e-6)
    assert_allclose(line.value, LINE @ named.z, atol=1e-4)


@pytest.mark.slow
def test_records_drawn_anew_are_of_the_fitted_model() -> None:
    layout = layout_of(9, 2.0 * BUMP)
    fit = fit_course(problem_of(layout))
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(20):
        drawn = redrawn(layout, fit, 2.0 * BUMP, named=(), unit_root=False, rng=rng)
        assert drawn.y.shape == layout.y.shape
        assert np.array_equal(drawn.y[:4], layout.y[:4] - fit.value[:4, None])
        errors.append(float(np.mean((fit_course(problem_of(drawn)).value - 2.0 * BUMP)[AFTER] ** 2)))
    assert 0.3 <= np.mean(errors) / np.mean(fit.sd[AFTER] ** 2) <= 3.0
