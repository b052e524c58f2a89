"""Coherence, dependence and homogeneous orders: identities of linear algebra and of difference equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from bfi_cli.kernels.coherence import (
    dependence,
    detectable_deviations,
    homogeneous_order,
    mutual_coherence,
)
from bfi_cli.kernels.covariance import whiten

K = np.arange(400.0)
SIGNALS = {
    "constant": (np.full(400, 3.7), 1),
    "geometric": (0.98**K, 1),
    "ramp": (0.23 * K - 5.0, 2),
    "sine": (np.sin(0.14 * K + 0.3), 2),
    "slow sine": (np.sin(0.01 * K), 2),
    "settling": (1.0 - np.exp(-K / 50.0), 2),
    "constant + sine": (2.0 + np.cos(0.14 * K), 3),
    "parabola": (K**2, 3),
    "ramp + sine": (0.01 * K + np.sin(0.3 * K), 4),
    "two sines": (np.sin(0.14 * K) + 0.2 * np.cos(0.9 * K), 4),
}

gaussian = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).normal(size=(40, 5)))


@given(gaussian)
def test_coherence_is_symmetric_with_a_unit_diagonal_and_within_0_and_1(G):
    coherence = mutual_coherence(G)
    np.testing.assert_array_equal(coherence, coherence.T)
    np.testing.assert_array_equal(np.diag(coherence), 1.0)
    assert np.all((coherence >= 0.0) & (coherence <= 1.0))


@given(
    gaussian,
    st.lists(st.floats(1e-150, 1e150), min_size=5, max_size=5),
    st.lists(st.booleans(), min_size=5, max_size=5),
)
def test_neither_scale_nor_sign_changes_anything(G, scales, signs):
    other = G * np.array(scales) * np.where(signs, -1.0, 1.0)
    np.testing.assert_allclose(mutual_coherence(other), mutual_coherence(G), atol=1e-12)
    assert dependence(other).condition_number == pytest.approx(dependence(G).condition_number, rel=1e-9)


@given(gaussian)
def test_an_orthogonal_change_of_rows_changes_nothing(G):
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(40, 40)))[0]
    np.testing.assert_allclose(mutual_coherence(Q @ G), mutual_coherence(G), atol=1e-12)


def test_duplicates_have_coherence_1_and_orthogonal_signals_0():
    g = np.random.default_rng(0).normal(size=(50, 1))
    np.testing.assert_allclose(mutual_coherence(np.hstack([g, -3.0 * g])), 1.0, atol=1e-12)
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(50, 4)))[0]
    np.testing.assert_allclose(mutual_coherence(Q), np.eye(4), atol=1e-12)


def test_the_coherence_is_the_cosine_of_the_angle():
    for angle in (0.1, 1.0, 2.5):
        G = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)]])
        assert mutual_coherence(G)[0, 1] == pytest.approx(abs(np.cos(angle)), abs=1e-12)


def test_a_signal_that_is_zero_has_no_coherence():
    coherence = mutual_coherence(np.array([[1.0, 0.0], [2.0, 0.0]]))
    np.testing.assert_array_equal(coherence, [[1.0, np.nan], [np.nan, np.nan]])


def test_two_signals_of_coherence_c_have_the_condition_number_of_their_gram_matrix():
    c = 0.6
    G = np.array([[1.0, c], [0.0, np.sqrt(1.0 - c**2)]])
    assert dependence(G).condition_number == pytest.approx(np.sqrt((1 + c) / (1 - c)), rel=1e-12)


def test_the_weakest_combination_names_the_dependent_signals():
    G = np.random.default_rng(3).normal(size=(60, 4))
    G[:, 3] = G[:, 0] + G[:, 2]
    found = dependence(G)
    assert (found.rank, found.condition_number) == (3, np.inf)
    assert abs(found.weakest[1]) < 1e-9
    assert np.all(np.abs(found.weakest[[0, 2, 3]]) > 0.1)


def test_more_signals_than_samples_are_dependent():
    found = dependence(np.random.default_rng(0).normal(size=(3, 5)))
    assert (found.rank, found.condition_number, found.weakest.shape) == (3, np.inf, (5,))


def test_no_signals_are_independent():
    assert (dependence(np.zeros((9, 0))).rank, dependence(np.zeros((9, 0))).condition_number) == (0, 1.0)


def test_whitened_inner_products_are_those_of_the_information_matrix():
    rng = np.random.default_rng(5)
    g, root = rng.normal(size=(30, 2, 3)), rng.normal(size=(2, 2))
    sigma = root @ root.T + np.eye(2)
    expected = np.einsum("koi,op,kpj->ij", g, np.linalg.inv(sigma), g)
    W = whiten(g, sigma)
    np.testing.assert_allclose(W.T @ W, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("name", SIGNALS)
def test_the_order_of_a_textbook_signal(name):
    x, order = SIGNALS[name]
    assert homogeneous_order(x, 6) == order
    assert homogeneous_order(-1e-9 * x, 6) == order
    assert homogeneous_order(x, order - 1) is None


@pytest.mark.parametrize("name", SIGNALS)
def test_an_onset_or_an_end_inside_the_window_breaks_the_equation(name):
    x = SIGNALS[name][0]
    assert homogeneous_order(np.where(K >= 130, x, 0.0), 6) is None
    assert homogeneous_order(np.where(K < 390, x, 0.0), 6) is None


def test_noise_obeys_no_equation_and_zero_the_empty_one():
    assert homogeneous_order(np.random.default_rng(0).normal(size=400), 6) is None
    assert homogeneous_order(np.zeros(400), 6) == 0


def test_a_signal_too_short_to_tell_is_not_judged():
    assert homogeneous_order(np.array([1.0, 5.0]), 6) is None


@given(st.floats(0.02, 1.5), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_shifting_a_sinusoid_in_time_keeps_its_order(frequency, phase, offset):
    assert homogeneous_order(np.sin(frequency * K + phase), 6) == 2
    expected = 2 if offset == 0.0 else 3
    if offset == 0.0 or abs(offset) > 1e-3:
        assert homogeneous_order(np.sin(frequency * K + phase) + offset, 6) == expected


def test_a_magnitude_of_that_many_deviations_is_declared_with_the_power_asked_for():
    needed = detectable_deviations(4, charge=0.0, false_alarm=0.01, power=0.9)
    threshold = stats.norm.isf(0.01 / 8.0)
    assert stats.norm.sf(threshold - needed) == pytest.approx(0.9, abs=1e-9)
    assert 4 * 2 * stats.norm.sf(threshold) == pytest.approx(0.01, abs=1e-12)


def test_the_stricter_of_criterion_and_false_alarm_rate_counts():
    lax, strict = (detectable_deviations(1, charge=c, false_alarm=0.01, power=0.5) for c in (1.0, 100.0))
    assert lax == pytest.approx(stats.norm.isf(0.005), abs=1e-9)
    assert strict == pytest.approx(10.0, abs=1e-12)
