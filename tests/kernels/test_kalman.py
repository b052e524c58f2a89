"""The Kalman filter is Gaussian conditioning, settles at the Riccati equation's gain, and knows its own errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2, multivariate_normal

from bfi_cli.kernels.kalman import Filtered, Gaussian, StateSpace, filter_bank, predict, update

N_X, N_U, N_Y = 3, 2, 2
START = Gaussian(mean=np.array([1.0, -2.0, 0.5]), covariance=np.diag([2.0, 1.0, 0.5]))


def covariance(rng: np.random.Generator, n: int, size: float) -> np.ndarray:
    half = rng.standard_normal((n, n))
    return size * (half @ half.T + 0.1 * np.eye(n))


def system(seed: int = 0) -> StateSpace:
    """Return a stable system with full noise covariances."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((N_X, N_X))
    return StateSpace(
        A=0.9 * A / np.abs(np.linalg.eigvals(A)).max(),
        B=rng.standard_normal((N_X, N_U)),
        C=rng.standard_normal((N_Y, N_X)),
        D=rng.standard_normal((N_Y, N_U)),
        Q=covariance(rng, N_X, 0.1),
        R=covariance(rng, N_Y, 0.3),
    )


def flown(plant: StateSpace, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (x, y, u) of one run of the system from a state drawn from START."""
    u = rng.standard_normal((n, N_U))
    w = rng.multivariate_normal(np.zeros(N_X), plant.Q, n)
    v = rng.multivariate_normal(np.zeros(N_Y), plant.R, n)
    x = np.empty((n, N_X))
    x[0] = rng.multivariate_normal(START.mean, START.covariance)
    for k in range(n - 1):
        x[k + 1] = plant.A @ x[k] + plant.B @ u[k] + w[k]
    return x, x @ plant.C.T + u @ plant.D.T + v, u


def filtered(plant: StateSpace, y: np.ndarray, u: np.ndarray, *, initial: Gaussian) -> Filtered:
    """Return the run of one filter over a record."""
    return filter_bank((plant,), y, u, initial=(initial,), probability=(1.0,)).filters[0]


def joint(plant: StateSpace, u: np.ndarray) -> tuple[Gaussian, np.ndarray]:
    """Return the stacked outputs' distribution, and their covariance with the last state, by plain propagation."""
    n = len(u)
    mean, noise = [START.mean], [np.hstack([np.linalg.cholesky(START.covariance), np.zeros((N_X, (n - 1) * N_X))])]
    for k in range(n - 1):
        mean.append(plant.A @ mean[-1] + plant.B @ u[k])
        moved = plant.A @ noise[-1]
        moved[:, (k + 1) * N_X : (k + 2) * N_X] += np.linalg.cholesky(plant.Q)
        noise.append(moved)
    stacked = np.vstack([plant.C @ part for part in noise])
    outputs = np.concatenate([plant.C @ m + plant.D @ u_k for m, u_k in zip(mean, u, strict=True)])
    spread = stacked @ stacked.T + np.kron(np.eye(n), plant.R)
    return Gaussian(mean=outputs, covariance=spread), noise[-1] @ stacked.T


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_log_likelihoods_add_up_to_that_of_all_outputs_at_once(seed):
    plant = system(seed)
    _, y, u = flown(plant, 6, np.random.default_rng(seed))
    outputs, _ = joint(plant, u)
    expected = multivariate_normal(outputs.mean, outputs.covariance).logpdf(y.ravel())
    run = filtered(plant, y, u, initial=START)
    assert run.log_likelihood.sum() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_last_estimate_is_the_state_conditioned_on_all_outputs(seed):
    plant = system(seed)
    _, y, u = flown(plant, 6, np.random.default_rng(seed))
    mean = START.mean
    for u_k in u[:-1]:
        mean = plant.A @ mean + plant.B @ u_k
    outputs, cross = joint(plant, u)
    weights = np.linalg.solve(outputs.covariance, cross.T).T
    run = filtered(plant, y, u, initial=START)
    np.testing.assert_allclose(run.mean[-1], mean + weights @ (y.ravel() - outputs.mean), rtol=0, atol=1e-12)


@pytest.mark.slow
@given(seed=st.integers(0, 10_000))
def test_gain_settles_at_the_solution_of_the_riccati_equation(seed):
    plant = system(seed)
    P = solve_discrete_are(plant.A.T, plant.C.T, plant.Q, plant.R)
    S = plant.C @ P @ plant.C.T + plant.R
    gain = np.linalg.solve(S, plant.C @ P).T
    run = filtered(plant, np.zeros((400, N_Y)), np.zeros((400, N_U)), initial=START)
    settled = predict(Gaussian(mean=run.mean[-1], covariance=run.covariance[-1]), plant, u=np.zeros(N_U))
    np.testing.assert_allclose(settled.covariance, P, rtol=0, atol=1e-9 * np.abs(P).max())
    for j, unit in enumerate(np.eye(N_Y)):
        step = update(Gaussian(mean=np.zeros(N_X), covariance=settled.covariance), plant, y=unit, u=np.zeros(N_U))
        np.testing.assert_allclose(step.mean, gain[:, j], rtol=0, atol=1e-9 * np.abs(gain).max())


def test_errors_and_innovations_have_the_size_the_filter_says():
    plant, runs, n = system(), 60, 25
    rng = np.random.default_rng(3)
    nees = nis = 0.0
    for _ in range(runs):
        x, y, u = flown(plant, n, rng)
        run = filtered(plant, y, u, initial=START)
        error = x[-1] - run.mean[-1]
        nees += error @ np.linalg.solve(run.covariance[-1], error)
        scaled = np.linalg.solve(run.innovation_covariance, run.innovation[..., None])[..., 0]
        nis += np.einsum("ki,ki->", run.innovation, scaled)
    for statistic, freedom in ((nees, runs * N_X), (nis, runs * n * N_Y)):
        low, high = chi2.ppf([0.0005, 0.9995], freedom)
        assert low < statistic < high


def test_innovations_are_white():
    plant, n = system(), 1500
    _, y, u = flown(plant, n, np.random.default_rng(5))
    run = filtered(plant, y, u, initial=START)
    white = np.linalg.solve(np.linalg.cholesky(run.innovation_covariance), run.innovation[..., None])[..., 0]
    for lag in (1, 2, 5):
        correlation = white[lag:].T @ white[:-lag] / n
        assert np.abs(correlation).max() < 4.0 / np.sqrt(n)


def test_covariances_stay_positive_where_the_measurement_is_nearly_exact():
    plant = replace(system(), Q=np.zeros((N_X, N_X)), R=1e-8 * np.eye(N_Y))
    huge = Gaussian(mean=np.zeros(N_X), covariance=1e4 * np.eye(N_X))
    run = filtered(plant, np.zeros((50, N_Y)), np.zeros((50, N_U)), initial=huge)
    assert np.all(np.linalg.eigvalsh(run.covariance) > -1e-12 * 1e4)
    np.testing.assert_array_equal(run.covariance, run.covariance.transpose(0, 2, 1))


def test_an_outlier_of_a_million_deviations_costs_its_square_and_nothing_overflows():
    plant = system()
    _, y, u = flown(plant, 5, np.random.default_rng(0))
    step = filtered(plant, y, u, initial=START)
    bad = y.copy()
    deviation = 1e6 * np.linalg.cholesky(step.innovation_covariance[-1])[:, 0]
    bad[-1] += deviation - step.innovation[-1]
    assert filtered(plant, bad, u, initial=START).log_likelihood[-1] == pytest.approx(-5e11, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"B": np.zeros((2, 2))}, "B has shape"),
        ({"C": np.zeros((2, 4))}, "C has shape"),
        ({"R": np.zeros((N_Y, N_Y))}, "R must be symmetric and positive definite"),
        ({"R": np.array([[1.0, 0.5], [0.0, 1.0]])}, "R must be symmetric"),
        ({"Q": -np.eye(N_X)}, "Q must be symmetric and positive semidefinite"),
        ({"Q": np.full((N_X, N_X), np.nan)}, "Q must be"),
    ],
)
def test_what_is_no_system_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(system(), **change)


def test_a_prior_that_is_no_covariance_is_refused():
    broken = Gaussian(mean=np.zeros(N_X), covariance=-1e3 * np.eye(N_X))
    with pytest.raises(ValueError, match="not positive definite"):
        update(broken, system(), y=np.zeros(N_Y), u=np.zeros(N_U))
