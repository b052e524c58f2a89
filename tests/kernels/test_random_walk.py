"""The smoothed course of a fault: two roads to one number, its limits, invariances, and what its band covers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bfi_cli.kernels.free_course import (
    Course,
    correlated_noise,
    fit_mixed,
    smoothed_course,
    walk_columns,
)

TIME_S = np.arange(0.0, 60.0)
ONSET_S = 20.0  # a sample, and 39 cells of a second after it, so that a filter's steps are the walk's
AFTER = TIME_S >= ONSET_S


def covariance(time_s: np.ndarray = TIME_S, fast: float = 0.4, slow: float = 0.3) -> np.ndarray:
    """Fast noise of a second, and slow noise of half a minute, as a residual of air data has."""
    return correlated_noise(time_s, sd=fast, time_constant_s=1.0) + correlated_noise(
        time_s, sd=slow, time_constant_s=30.0
    )


def drawn(seed: int, *, intensity: float, slope: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """Return a residual with a walk after the onset, and the walk."""
    rng = np.random.default_rng(seed)
    noise = np.linalg.cholesky(covariance()) @ rng.standard_normal(len(TIME_S))
    line, curved = walk_columns(TIME_S, onset_s=ONSET_S, stop_s=TIME_S[-1], cells=int(AFTER.sum()) - 1)
    fault = line @ [0.0, slope] + curved @ (np.sqrt(intensity) * rng.standard_normal(curved.shape[1]))
    return 5.0 + fault + noise, fault


def kalman(r: np.ndarray, intensity: float, start: float) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and sd of the walk: a Kalman filter and a Rauch-Tung-Striebel smoother, state by state.

    The state is (constant, fast, slow, level, slope); the walk's noise is held over the samples, and `start` is the
    variance of what is not known at first.
    """
    fast, slow = np.exp(-1.0), np.exp(-1.0 / 30.0)
    P = np.diag([start, 0.4**2, 0.3**2, 0.0, 0.0])
    x, C = np.zeros(5), np.array([[1.0, 1.0, 1.0, 1.0, 0.0]])
    cell = (TIME_S[-1] - ONSET_S) / (int(AFTER.sum()) - 1)
    means, covariances, predicted, transitions = [], [], [], []
    before = False
    for k in range(len(TIME_S)):
        A, Q = np.eye(5), np.zeros((5, 5))
        if k:
            A[1, 1], A[2, 2] = fast, slow
            Q[1, 1], Q[2, 2] = 0.4**2 * (1.0 - fast**2), 0.3**2 * (1.0 - slow**2)
        if k and before:
            A[3, 4] = 1.0
            held = np.array([0.0, 0.0, 0.0, 0.5, 1.0])
            Q += intensity / cell * np.outer(held, held)
        x, P = A @ x, A @ P @ A.T + Q
        if AFTER[k] and not before:
            P[3, 3] = P[4, 4] = start
            before = True
        predicted.append((x, P))
        transitions.append(A)
        S = C @ P @ C.T
        gain = (P @ C.T / S)[:, 0]
        x = x + gain * (r[k] - (C @ x)[0])
        kept = np.eye(5) - np.outer(gain, C[0])
        P = kept @ P @ kept.T
        means.append(x)
        covariances.append(P)
    mean, cov = means[-1], covariances[-1]
    level, sd = np.zeros(len(r)), np.zeros(len(r))
    for k in reversed(range(len(r))):
        if k < len(r) - 1:
            if not AFTER[k]:
                break
            x_next, P_next = predicted[k + 1]
            back = covariances[k] @ transitions[k + 1].T @ np.linalg.pinv(P_next, rcond=1e-14, hermitian=True)
            mean = means[k] + back @ (mean - x_next)
            cov = covariances[k] + back @ (cov - P_next) @ back.T
        level[k], sd[k] = mean[3], np.sqrt(cov[3, 3])
    return level, sd


def test_dense_generalised_least_squares_gives_the_same_course() -> None:
    r, _ = drawn(1, intensity=1e-2)
    course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    line, curved = walk_columns(TIME_S, onset_s=ONSET_S, stop_s=TIME_S[-1], cells=int(AFTER.sum()) - 1)
    X = np.column_stack([np.ones(len(r)), line])
    whole = course.intensity * curved @ curved.T + covariance()
    beta = np.linalg.solve(X.T @ np.linalg.solve(whole, X), X.T @ np.linalg.solve(whole, r))
    dense = line @ beta[1:] + course.intensity * curved @ curved.T @ np.linalg.solve(whole, r - X @ beta)
    assert course.intensity > 0.0
    assert_allclose(course.value, dense, rtol=0.0, atol=1e-9 * np.abs(r).max())
    # The error of the best linear unbiased predictor (Robinson 1991).
    hat = np.linalg.solve(X.T @ np.linalg.solve(whole, X), np.linalg.solve(whole, X).T)
    walk = course.intensity * curved @ curved.T
    to_course = np.column_stack([np.zeros(len(r)), line]) @ hat + walk @ np.linalg.solve(
        whole, np.eye(len(r)) - X @ hat
    )
    error = walk - to_course @ walk - walk @ to_course.T + to_course @ whole @ to_course.T
    assert_allclose(course.sd[AFTER], np.sqrt(np.diag(error))[AFTER], rtol=1e-7)


def test_a_kalman_smoother_gives_the_same_course() -> None:
    r, _ = drawn(2, intensity=1e-2)
    course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    level, sd = kalman(r, course.intensity, 1e6)
    assert course.intensity > 0.0
    assert_allclose(course.value, level, atol=1e-5 * np.ptp(r))
    assert_allclose(course.sd, sd, rtol=1e-4)


def test_its_likelihood_is_that_of_a_dense_normal_density_off_the_fixed_columns() -> None:
    rng = np.random.default_rng(3)
    X, Z = rng.standard_normal((30, 3)), rng.standard_normal((30, 8))
    y = Z @ rng.standard_normal(8) + rng.standard_normal(30)
    fit = fit_mixed(y, X, Z, noise_variance=1.0)
    basis = np.linalg.svd(X)[0][:, 3:]  # orthonormal contrasts

    def deviance(ratio: float) -> float:
        whole = basis.T @ (ratio * Z @ Z.T + np.eye(30)) @ basis
        return float(np.linalg.slogdet(whole)[1] + (basis.T @ y) @ np.linalg.solve(whole, basis.T @ y))

    assert_allclose(fit.without, deviance(0.0), rtol=1e-12)
    assert_allclose(fit.deviance, deviance(fit.ratio), rtol=1e-12)
    assert all(fit.deviance <= deviance(fit.ratio * factor) for factor in (0.5, 0.9, 1.1, 2.0))


def test_an_unknown_noise_scales_with_the_data() -> None:
    rng = np.random.default_rng(4)
    X, Z = rng.standard_normal((40, 2)), rng.standard_normal((40, 6))
    y = Z @ rng.standard_normal(6) + 0.5 * rng.standard_normal(40)
    one, other = fit_mixed(y, X, Z), fit_mixed(3.0 * y, X, Z)
    assert_allclose(other.noise_variance, 9.0 * one.noise_variance, rtol=1e-7)
    assert_allclose(other.ratio, one.ratio, rtol=1e-6)
    assert_allclose(other.combine(X, Z)[1], 3.0 * one.combine(X, Z)[1], rtol=1e-6)


def test_without_curvature_it_is_the_line_of_least_squares() -> None:
    line, _ = walk_columns(TIME_S, onset_s=ONSET_S, stop_s=TIME_S[-1], cells=1)
    r = 2.0 + line @ [1.5, -0.3]
    course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    assert course.intensity == 0.0
    assert_allclose(course.value, line @ [1.5, -0.3], atol=1e-10)
    whitener = np.linalg.inv(np.linalg.cholesky(covariance()))
    X = whitener @ np.column_stack([np.ones(len(r)), line])
    spread = np.linalg.inv(X.T @ X)[1:, 1:]
    assert_allclose(course.sd, np.sqrt(np.einsum("ij,jk,ik->i", line, spread, line)), rtol=1e-9)


def test_it_is_zero_before_the_onset_and_knows_it() -> None:
    r, _ = drawn(5, intensity=1e-2)
    course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    assert not course.value[~AFTER].any()
    assert not course.sd[~AFTER].any()
    assert (course.sd[AFTER] > 0.0).all()


def test_noise_free_courses_are_reproduced() -> None:
    since = np.maximum(TIME_S - ONSET_S, 0.0)
    fault = 3.0 * np.sin(2.0 * np.pi * since / 40.0)
    course = smoothed_course(TIME_S, 7.0 + fault, onset_s=ONSET_S, covariance=1e-10 * covariance())
    assert_allclose(course.value, fault, atol=1e-3)
    assert np.all(np.abs(course.value - fault) <= np.maximum(6.0 * course.sd, 1e-6))


@pytest.mark.parametrize("seed", [6, 7])
def test_units_constants_and_signs(seed: int) -> None:
    r, _ = drawn(seed, intensity=1e-2)
    one = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    other = smoothed_course(TIME_S, -2.0 * r + 11.0, onset_s=ONSET_S, covariance=4.0 * covariance())
    assert_allclose(other.value, -2.0 * one.value, atol=1e-6)
    assert_allclose(other.sd, 2.0 * one.sd, rtol=1e-5)
    assert_allclose(other.intensity, 4.0 * one.intensity, rtol=1e-5)
    slower = smoothed_course(
        10.0 * TIME_S,
        r,
        onset_s=10.0 * ONSET_S,
        covariance=correlated_noise(10.0 * TIME_S, sd=0.4, time_constant_s=10.0)
        + correlated_noise(10.0 * TIME_S, sd=0.3, time_constant_s=300.0),
    )
    assert_allclose(slower.value, one.value, atol=1e-6)
    assert_allclose(slower.intensity, 1e-3 * one.intensity, rtol=1e-5)


def test_residuals_are_stacked_by_their_gains() -> None:
    """Two residuals that show the fault doubled and not at all: the second says nothing, the first all."""
    r, _ = drawn(8, intensity=1e-2)
    one = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
    n = len(TIME_S)
    both, nuisances = np.zeros((2 * n, 2 * n)), np.kron(np.eye(2), np.ones((n, 1)))
    both[:n, :n], both[n:, n:] = 4.0 * covariance(), covariance(fast=0.1)
    stacked = smoothed_course(
        np.tile(TIME_S, 2),
        np.concatenate([2.0 * r, np.random.default_rng(9).standard_normal(n)]),
        onset_s=ONSET_S,
        covariance=both,
        gain=np.concatenate([np.full(n, 2.0), np.zeros(n)]),
        nuisances=nuisances,
    )
    assert_allclose(stacked.time_s, TIME_S)
    assert_allclose(stacked.value, one.value, atol=1e-6)
    assert_allclose(stacked.sd, one.sd, rtol=1e-5)


def test_missing_samples_widen_the_band_where_they_are_missing() -> None:
    r, _ = drawn(10, intensity=1e-2)
    kept = (TIME_S < 35.0) | (TIME_S > 45.0)
    one = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance(), cells=20)
    gap = smoothed_course(
        TIME_S[kept], r[kept], onset_s=ONSET_S, covariance=covariance(TIME_S[kept]), at_s=TIME_S, cells=20
    )
    assert gap.sd[40] > 1.1 * one.sd[40]
    assert gap.time_s.size == TIME_S.size


def test_a_walk_of_the_noise_itself_is_its_covariance() -> None:
    noise = correlated_noise(TIME_S + 100.0, sd=0.3, time_constant_s=np.inf)
    steps = np.diag(np.concatenate([[0.0], np.full(len(TIME_S) - 1, 0.09)]))
    summed = np.tril(np.ones(noise.shape))
    assert_allclose(noise, summed @ steps @ summed.T, atol=1e-12)


@pytest.mark.slow
def test_the_band_covers_what_it_says() -> None:
    """Points of a course are dependent; its average coverage over courses is what a band of Wahba (1983) promises."""
    covered, errors = [], []
    for seed in range(100, 200):
        r, fault = drawn(seed, intensity=2e-3)
        course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=covariance())
        covered.append(float(np.mean((course.low <= fault)[AFTER] & (fault <= course.high)[AFTER])))
        errors.append(float(np.mean(((course.value - fault)[AFTER] / course.sd[AFTER]) ** 2)))
    # The intensity is estimated, which the band does not know; sd of a mean of 100 courses from their own spread.
    spread = float(np.std(covered)) / np.sqrt(len(covered))
    assert 0.90 <= np.mean(covered) <= 0.95 + 3.0 * spread
    assert 0.8 <= np.mean(errors) <= 1.5


def test_without_a_walk_the_evidence_of_one_is_small() -> None:
    """A restricted likelihood at the edge of its parameter: half of the time 0, the rest below a chi-square of 1."""
    line, curved = walk_columns(TIME_S, onset_s=ONSET_S, stop_s=TIME_S[-1], cells=30)
    rng = np.random.default_rng(200)
    fits = [fit_mixed(rng.standard_normal(len(line)), line, curved, noise_variance=1.0) for _ in range(100)]
    evidence = np.array([fit.without - fit.deviance for fit in fits])
    assert np.mean(evidence > 6.63) <= 0.01 + 3.0 * np.sqrt(0.01 * 0.99 / 100.0)
    assert np.mean(evidence < 1e-9) >= 0.35


@pytest.mark.parametrize(
    ("onset_s", "factor", "message"),
    [
        (58.0, 1.0, "3 samples after its onset, got 2"),
        (-5.0, 1.0, "the fixed columns are dependent"),
        (20.0, 0.0, "not positive definite"),
    ],
)
def test_what_cannot_be_told_is_refused(onset_s: float, factor: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        smoothed_course(TIME_S, np.ones(60), onset_s=onset_s, covariance=factor * covariance())


def test_inputs_are_left_alone() -> None:
    r, _ = drawn(11, intensity=1e-2)
    C = covariance()
    before = r.copy(), C.copy()
    course: Course = smoothed_course(TIME_S, r, onset_s=ONSET_S, covariance=C)
    assert np.array_equal(before[0], r)
    assert np.array_equal(before[1], C)
    assert np.isfinite(course.low).all()
    assert np.isfinite(course.high).all()
