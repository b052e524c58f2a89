"""Banks of filters: Bayes in logarithms, mixtures, and the two filters of the double model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from bfi_cli.kernels.kalman import (
    FAULT,
    NO_FAULT,
    Filtered,
    Gaussian,
    RandomWalk,
    SelectiveReinitialisation,
    StateSpace,
    augment,
    double_model,
    filter_bank,
    mixture,
    restart,
    state_and_fault,
    update_probabilities,
)

PLANT = StateSpace(
    A=np.array([[0.95, 0.1], [-0.1, 0.9]]),
    B=np.array([[0.0], [0.5]]),
    C=np.eye(2),
    D=np.zeros((2, 1)),
    Q=1e-4 * np.eye(2),
    R=0.01 * np.eye(2),
)
START = Gaussian(mean=np.zeros(2), covariance=0.01 * np.eye(2))
N, ONSET = 300, 120
probabilities = st.lists(st.floats(1e-3, 1.0), min_size=2, max_size=5).map(lambda p: np.array(p) / np.sum(p))


def record(seed: int = 0, *, fault: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return (y, u) of the plant, the first output biased by `fault` from ONSET on."""
    rng = np.random.default_rng(seed)
    u, x = rng.standard_normal((N, 1)), np.zeros((N, 2))
    for k in range(N - 1):
        x[k + 1] = PLANT.A @ x[k] + PLANT.B @ u[k] + 0.01 * rng.standard_normal(2)
    y = x + 0.1 * rng.standard_normal((N, 2))
    y[ONSET:, 0] += fault
    return y, u


@given(p=probabilities, shift=st.floats(-1e6, 1e6), seed=st.integers(0, 99))
def test_probabilities_follow_bayes_and_ignore_a_common_factor(p, shift, seed):
    likelihood = np.random.default_rng(seed).uniform(0.1, 10.0, p.size)
    expected = p * likelihood / (p @ likelihood)
    after = np.exp(update_probabilities(np.log(p), np.log(likelihood) + shift))
    np.testing.assert_allclose(after, expected, rtol=1e-8)


@given(p=probabilities, seed=st.integers(0, 99))
def test_probabilities_sum_to_one_and_keep_to_the_floor(p, seed):
    log_likelihood = -(10.0 ** np.random.default_rng(seed).uniform(0, 8, p.size))
    after = np.exp(update_probabilities(np.log(p), log_likelihood, floor=0.001))
    assert after.sum() == pytest.approx(1.0, abs=1e-12)
    assert after.min() >= 0.001 / (1.0 + 0.001 * p.size)


def test_log_likelihoods_of_minus_a_million_survive():
    even = np.log([0.5, 0.5])
    np.testing.assert_allclose(
        np.exp(update_probabilities(even, np.array([-1e6, -1e6 - np.log(3.0)]))), [0.75, 0.25], rtol=1e-9
    )
    kept = np.exp(update_probabilities(even, np.array([-1e6, -3e6]), floor=0.001))
    np.testing.assert_allclose(kept, np.array([1.0, 0.001]) / 1.001, rtol=1e-12)


def test_two_identical_filters_give_that_filter():
    y, u = record()
    alone = filter_bank((PLANT,), y, u, initial=(START,), probability=(1.0,)).filters[0]
    bank = filter_bank((PLANT, PLANT), y, u, initial=(START, START), probability=(0.95, 0.05))
    both = mixture(
        np.stack([run.mean for run in bank.filters], axis=1),
        np.stack([run.covariance for run in bank.filters], axis=1),
        bank.probability,
    )
    np.testing.assert_allclose(bank.probability, np.tile([0.95, 0.05], (N, 1)), rtol=1e-10)
    np.testing.assert_allclose(both.mean, alone.mean, rtol=0, atol=1e-14)
    np.testing.assert_allclose(both.covariance, alone.covariance, rtol=0, atol=1e-16)


def test_mixture_has_the_moments_of_its_samples():
    rng = np.random.default_rng(0)
    mean, p, n = np.array([[0.0, 0.0], [3.0, -1.0]]), np.array([0.3, 0.7]), 200_000
    covariances = np.array([np.diag([1.0, 0.2]), [[0.5, 0.3], [0.3, 0.8]]])
    parts = [rng.multivariate_normal(m, c, round(n * w)) for m, c, w in zip(mean, covariances, p, strict=True)]
    both = mixture(mean[None], covariances[None], p[None])
    np.testing.assert_allclose(both.mean[0], np.vstack(parts).mean(axis=0), atol=0.02)
    np.testing.assert_allclose(both.covariance[0], np.cov(np.vstack(parts).T), atol=0.03)


def test_the_right_model_wins_and_a_change_of_model_is_followed():
    y, u = record()
    noisy = replace(PLANT, R=25.0 * PLANT.R)
    rng = np.random.default_rng(1)
    y[150:] += 0.5 * rng.standard_normal((N - 150, 2))
    bank = filter_bank((PLANT, noisy), y, u, initial=(START, START), probability=(0.5, 0.5))
    assert bank.probability[50:150, 0].min() > 0.95
    assert bank.probability[160:, 1].min() > 0.9


def test_augmented_system_adds_the_fault_to_its_channel_only():
    wider = augment(PLANT, 1, fault_variance=0.3)
    x, u, fault = np.array([1.0, 2.0]), np.array([3.0]), 5.0
    np.testing.assert_array_equal(wider.C @ np.append(x, fault), PLANT.C @ x + [0.0, fault])
    expected = np.append(PLANT.A @ x + PLANT.B @ u, fault)
    np.testing.assert_allclose(wider.A @ np.append(x, fault) + wider.B @ u, expected, rtol=1e-15)
    np.testing.assert_array_equal(wider.Q, np.diag([1e-4, 1e-4, 0.3]))


def test_restart_takes_over_the_state_and_forgets_the_fault():
    state = Gaussian(mean=np.array([1.0, 2.0]), covariance=np.array([[2.0, 0.5], [0.5, 1.0]]))
    start = restart(state, RandomWalk(value=1e-3, variance=100.0))
    np.testing.assert_array_equal(start.mean, [1.0, 2.0, 1e-3])
    np.testing.assert_array_equal(start.covariance, [[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 100.0]])


@pytest.mark.parametrize("fault", [0.0, 3.0])
def test_after_every_sample_the_loser_restarts_from_the_winner(fault):
    y, u = record(fault=fault)
    seen = []

    def watched(systems, steps, winner):
        systems, after = SelectiveReinitialisation(RandomWalk(), channel=0)(systems, steps, winner)
        seen.append((winner, steps, after))
        return systems, after

    filter_bank(
        (PLANT, augment(PLANT, 0)),
        y,
        u,
        initial=(START, restart(START, RandomWalk())),
        probability=(0.95, 0.05),
        exchange=watched,
    )
    assert {winner for winner, _, _ in seen[ONSET + 5 :]} == {FAULT if fault else NO_FAULT}
    for winner, steps, (free, faulty) in seen:
        kept = (free, faulty)[winner]
        assert kept is steps[winner]
        np.testing.assert_array_equal(free.mean, faulty.mean[:-1])
        np.testing.assert_array_equal(free.covariance, faulty.covariance[:-1, :-1])
        if winner == NO_FAULT:
            assert faulty.mean[-1] == 1e-3
            np.testing.assert_array_equal(faulty.covariance[-1], [0.0, 0.0, 100.0])


def test_without_a_fault_the_double_model_is_the_plain_filter():
    y, u = record()
    run = double_model(PLANT, y, u, channel=0, initial=START)
    alone = filter_bank((PLANT,), y, u, initial=(START,), probability=(1.0,)).filters[0]
    np.testing.assert_allclose(run.filters[NO_FAULT].mean, alone.mean, rtol=0, atol=1e-14)
    assert run.probability[20:, FAULT].max() < 0.1


@pytest.mark.parametrize("fault", [-3.0, 1.0, 40.0])
def test_a_bias_is_found_at_its_sample_within_three_deviations(fault):
    y, u = record(fault=fault)
    run = double_model(PLANT, y, u, channel=0, initial=START)
    faulty = run.probability[:, FAULT] > 0.5
    assert not faulty[:ONSET].any()
    assert ONSET <= np.argmax(faulty) <= ONSET + 2
    sd = np.sqrt(run.filters[FAULT].covariance[-1, -1, -1])
    assert abs(run.filters[FAULT].mean[-1, -1] - fault) < 3.0 * sd < 0.2


@pytest.mark.slow
def test_estimated_fault_has_the_error_it_claims():
    """The final fault error over its sd, squared and summed over seeds, is chi-square with one degree each."""
    errors = []
    for seed in range(20):
        y, u = record(seed, fault=2.0)
        filters = double_model(PLANT, y, u, channel=0, initial=START).filters
        errors.append((filters[FAULT].mean[-1, -1] - 2.0) / np.sqrt(filters[FAULT].covariance[-1, -1, -1]))
    low, high = chi2.ppf([0.0005, 0.9995], len(errors))
    assert low < np.sum(np.square(errors)) < high


def test_adaptive_noise_follows_a_fault_that_a_constant_cannot():
    y, u = record()
    fault = np.where(np.arange(N) >= ONSET, 5.0 * np.sin(0.3 * np.arange(N)), 0.0)
    y[:, 0] += fault
    constant, adaptive = (
        state_and_fault(double_model(PLANT, y, u, channel=0, initial=START, fault=RandomWalk(window=window))).mean[
            :, -1
        ]
        for window in (None, 10)
    )
    rms = [np.sqrt(np.mean((estimate - fault)[ONSET:] ** 2)) for estimate in (constant, adaptive)]
    assert rms[1] < 0.5 * rms[0]


def test_adaptive_noise_is_what_the_innovations_have_too_much_of_and_stays_there():
    exchange = SelectiveReinitialisation(RandomWalk(window=2), channel=0)
    systems = (PLANT, augment(PLANT, 0, fault_variance=0.1))
    least, state = 1.0, restart(START, RandomWalk())

    def told(systems, innovation, variance):
        free, faulty = (
            Filtered(mean=e.mean, covariance=e.covariance, innovation=i, innovation_covariance=c, log_likelihood=0.0)
            for e, i, c in (
                (START, np.zeros(2), np.eye(2)),
                (state, np.array([innovation, 9.0]), np.diag([variance, 1.0])),
            )
        )
        systems, _ = exchange(systems, (free, faulty), FAULT)
        return systems, systems[FAULT].Q[-1, -1]

    systems, first = told(systems, 3.0, least)
    systems, again = told(systems, 3.0, least + 8.0)
    systems, half = told(systems, 1.0, least + 8.0)
    systems, none = told(systems, 0.5, least + 4.0)
    np.testing.assert_allclose([first, again, half, none], [0.1 + 8.0, 0.1 + 8.0, 0.1 + 4.0, 0.1], rtol=1e-12)
    assert systems[NO_FAULT] is PLANT


def test_mixed_fault_is_zero_where_a_fault_is_ruled_out():
    y, u = record()
    run = double_model(PLANT, y, u, channel=0, initial=START, floor=1e-9)
    both = state_and_fault(run)
    np.testing.assert_allclose(both.mean[-1, -1], run.probability[-1, FAULT] * run.filters[FAULT].mean[-1, -1])
    assert abs(both.mean[-1, -1]) < 1e-6
