"""Likelihood ratios of faults in residuals: identities of generalised least squares, computed another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.kernels.likelihood_ratio import Residual, likelihood_ratio, noise_model

N = 60
TIME_S = np.arange(float(N))
LEVELS = np.geomspace(0.1, 5.0, 8)
SLOW = 0.3**2 * np.exp(-np.abs(TIME_S[:, None] - TIME_S[None, :]) / 30.0)
NOISE = noise_model(TIME_S, LEVELS, SLOW)
ONSETS_S = np.array([10.0, 20.0, 31.0, 40.0])
RAMPS = np.maximum(TIME_S[:, None] - ONSETS_S[None, :], 0.0)
NUISANCES = np.column_stack([np.ones(N), np.sin(0.1 * TIME_S)])
FREE = np.array([np.inf, np.inf])
FAST = np.exp(-np.abs(TIME_S[:, None] - TIME_S[None, :]))

seeds = st.integers(0, 2**32 - 1)


def drawn(seed: int, level: float = 0.5) -> np.ndarray:
    """Return noise of the model."""
    return np.linalg.cholesky(level**2 * FAST + SLOW) @ np.random.default_rng(seed).standard_normal(N)


def squares(values: np.ndarray, columns: np.ndarray, prior_sd: np.ndarray, level: float) -> tuple[float, np.ndarray]:
    """Return the least weighted sum of squares with columns in amounts of a prior, and these amounts: dense."""
    C = level**2 * FAST + SLOW
    finite = np.isfinite(prior_sd)
    C = C + (columns[:, finite] * prior_sd[finite] ** 2) @ columns[:, finite].T  # a prior is noise along a column
    X, precision = columns[:, ~finite], np.linalg.inv(C)
    normal = X.T @ precision @ X
    amounts = np.linalg.solve(normal, X.T @ precision @ values) if X.shape[1] else np.empty(0)
    left = values - X @ amounts
    return float(left @ precision @ left), amounts


@given(seeds, st.lists(st.floats(-1e4, 1e4), min_size=2, max_size=2))
def test_what_a_free_nuisance_adds_changes_nothing(seed, amounts):
    values = drawn(seed)
    plain = Residual.of(NOISE, values, NUISANCES, FREE, RAMPS)
    moved = Residual.of(NOISE, values + NUISANCES @ np.array(amounts), NUISANCES, FREE, RAMPS)
    np.testing.assert_allclose(moved.values, plain.values, atol=1e-7)
    assert moved.level == plain.level
    assert moved.cost == pytest.approx(plain.cost, abs=1e-6)


@given(seeds)
def test_the_unit_of_a_nuisance_is_of_no_account(seed):
    values = drawn(seed)
    plain = Residual.of(NOISE, values, NUISANCES, FREE, RAMPS)
    other = Residual.of(NOISE, values, NUISANCES * np.array([1e6, -1e-6]), FREE, RAMPS)
    np.testing.assert_allclose(other.values, plain.values, atol=1e-9)


@settings(max_examples=8)
@given(seeds, st.floats(0.1, 50.0))
def test_ratio_magnitude_and_deviation_are_those_of_dense_least_squares(seed, prior):
    """Of two residuals of other noise that share a fault, a nuisance of a prior among them."""
    rng = np.random.default_rng(seed)
    signatures = [RAMPS, 0.3 * RAMPS * np.cos(0.05 * TIME_S)[:, None]]
    prior_sds = [FREE, np.array([np.inf, prior])]
    series = [drawn(seed) + 0.2 * RAMPS[:, 1], drawn(seed + 1, level=rng.choice([0.2, 2.0]))]
    residuals = [Residual.of(NOISE, y, NUISANCES, sd, RAMPS) for y, sd in zip(series, prior_sds, strict=True)]
    answer = likelihood_ratio(residuals, signatures)
    magnitude, sd_of = answer.weighted(np.ones(2))
    for k in range(len(ONSETS_S)):
        power, shown, cost = 0.0, 0.0, 0.0
        for y, g, sd, residual in zip(series, signatures, prior_sds, residuals, strict=True):
            plain = squares(y, NUISANCES, sd, residual.level)[0]
            with_fault = squares(y + g[:, k], NUISANCES, sd, residual.level)[0]
            power += squares(g[:, k], NUISANCES, sd, residual.level)[0]
            shown += 0.5 * (with_fault - plain - squares(g[:, k], NUISANCES, sd, residual.level)[0])
            likelihoods = [
                -np.linalg.slogdet(level**2 * FAST + SLOW)[1] - squares(y, NUISANCES, sd, level)[0] for level in LEVELS
            ]
            cost += likelihoods[int(np.argmin(np.abs(LEVELS - residual.level)))] - max(likelihoods)
        assert magnitude[k] == pytest.approx(shown / power, rel=1e-7, abs=1e-9)
        assert sd_of[k] == pytest.approx(power**-0.5, rel=1e-7)
        assert answer.ratio[k] == pytest.approx(cost + shown**2 / power, rel=1e-7, abs=1e-6)
    np.testing.assert_allclose(answer.parts(magnitude).sum(axis=0), answer.ratio, atol=1e-9)


def test_residuals_of_other_noise_weigh_by_what_they_truly_have():
    """As if each of them were scaled by the standard deviation that its noise model lacks; with equal ones by that."""
    signatures = [RAMPS, 0.3 * RAMPS]
    residuals = [Residual.of(NOISE, drawn(seed), NUISANCES, FREE, RAMPS) for seed in (1, 2)]
    answer, lacks = likelihood_ratio(residuals, signatures), np.array([1.9, 0.7])
    scaled = [
        replace(one, values=one.values / s, whitening=one.whitening / s)
        for one, s in zip(residuals, lacks, strict=True)
    ]
    magnitude, sd = answer.weighted(lacks**-2.0)
    np.testing.assert_allclose((magnitude, sd), likelihood_ratio(scaled, signatures).weighted(np.ones(2)), rtol=1e-10)
    same, twice = answer.weighted(np.array([0.25, 0.25]))
    np.testing.assert_allclose((same, 0.5 * twice), answer.weighted(np.ones(2)), rtol=1e-12)


@given(seeds, st.floats(0.05, 20.0))
def test_the_unit_of_a_fault_changes_its_magnitude_and_nothing_else(seed, scale):
    residual = Residual.of(NOISE, drawn(seed) + 0.1 * RAMPS[:, 0], NUISANCES, FREE, RAMPS)
    plain, other = (likelihood_ratio([residual], [unit * RAMPS]) for unit in (1.0, -scale))
    np.testing.assert_allclose(other.magnitude, -plain.magnitude / scale, rtol=1e-12)
    np.testing.assert_allclose(other.weighted(np.ones(1))[1], plain.weighted(np.ones(1))[1] / scale, rtol=1e-12)
    np.testing.assert_allclose(other.ratio, plain.ratio, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("k", range(len(ONSETS_S)))
def test_without_noise_the_magnitude_is_exact_at_the_onset_and_the_ratio_largest(k):
    values = -0.37 * RAMPS[:, k] + NUISANCES @ np.array([40.0, -3.0])
    answer = likelihood_ratio([Residual.of(NOISE, values, NUISANCES, FREE, RAMPS)], [RAMPS])
    assert int(np.argmax(answer.ratio)) == k
    assert answer.magnitude[k] == pytest.approx(-0.37, rel=1e-10)


def test_a_fault_does_not_raise_the_noise_that_it_is_held_against():
    quiet = Residual.of(NOISE, drawn(3), NUISANCES, FREE, RAMPS)
    faulty = Residual.of(NOISE, drawn(3) + 2.0 * RAMPS[:, 1], NUISANCES, FREE, RAMPS)
    assert faulty.level == quiet.level
    # Without a fault, the level that the ramp would have needed is much likelier.
    assert faulty.cost < -50.0 <= quiet.cost <= 0.0


@pytest.mark.parametrize("level", LEVELS[1:-1])
def test_the_level_is_that_of_the_noise(level):
    """In the median of nine draws to a step of the grid: 1/sqrt(2 n) is a sixth of one."""
    taken = [Residual.of(NOISE, drawn(seed, level), NUISANCES, FREE, RAMPS).level for seed in range(9)]
    assert abs(np.log(np.median(taken) / level)) <= 1.001 * np.log(LEVELS[1] / LEVELS[0])


def test_the_ratio_has_the_distribution_of_one_degree_of_freedom():
    """Of noise at the level taken, the gain at one onset is chi-square: mean 1, 3.84 exceeded in 5 %."""
    one = noise_model(TIME_S, np.array([0.5]), SLOW)
    gains = np.array(
        [
            likelihood_ratio([Residual.of(one, drawn(seed), NUISANCES, FREE, RAMPS)], [RAMPS[:, 1:2]]).ratio[0]
            for seed in range(300)
        ]
    )
    assert abs(gains.mean() - 1.0) < 4.0 * np.sqrt(2.0 / 300)
    assert abs(np.mean(gains > 3.841) - 0.05) < 4.0 * np.sqrt(0.05 * 0.95 / 300)


def test_a_residual_that_a_fault_leaves_alone_says_its_cost_and_no_more():
    residuals = [Residual.of(NOISE, drawn(k) + k * RAMPS[:, 1], NUISANCES, FREE, RAMPS) for k in range(2)]
    answer = likelihood_ratio(residuals, [np.zeros_like(RAMPS), RAMPS])
    alone = likelihood_ratio(residuals[1:], [RAMPS])
    np.testing.assert_array_equal(answer.parts(answer.magnitude)[0], residuals[0].cost)
    np.testing.assert_array_equal(answer.magnitude, alone.magnitude)
    np.testing.assert_allclose(answer.ratio, alone.ratio + residuals[0].cost, rtol=1e-12)


def test_a_signature_that_a_nuisance_explains_says_nothing():
    residual = Residual.of(NOISE, drawn(5), NUISANCES, FREE, RAMPS)
    answer = likelihood_ratio([residual], [np.column_stack([RAMPS[:, 0], np.zeros(N), 7.0 * NUISANCES[:, 1]])])
    assert answer.ratio[1:] == pytest.approx(residual.cost, abs=1e-12)
    assert answer.magnitude[1:] == pytest.approx(0.0, abs=1e-12)
    assert np.isinf(answer.weighted(np.ones(1))[1][1:]).all()


def test_a_nuisance_twice_is_a_nuisance_once():
    values, twice = drawn(6), NUISANCES[:, [0, 1, 0]]
    plain = Residual.of(NOISE, values, NUISANCES, FREE, RAMPS)
    other = Residual.of(NOISE, values, twice, np.full(3, np.inf), RAMPS)
    np.testing.assert_allclose(other.values, plain.values, atol=1e-9)


def test_residuals_of_nothing_but_zeros_find_nothing():
    answer = likelihood_ratio([Residual.of(NOISE, np.zeros(N), NUISANCES, FREE, RAMPS)], [RAMPS])
    np.testing.assert_array_equal(answer.ratio, 0.0)
    np.testing.assert_array_equal(answer.magnitude, 0.0)


def test_inputs_are_left_as_they_are():
    values, nuisances, ramps = drawn(7), NUISANCES.copy(), RAMPS.copy()
    kept = values.copy()
    likelihood_ratio([Residual.of(NOISE, values, nuisances, FREE, ramps)], [ramps])
    np.testing.assert_array_equal(values, kept)
    np.testing.assert_array_equal(nuisances, NUISANCES)
    np.testing.assert_array_equal(ramps, RAMPS)
