"""What a window and what a single sample tell of a fault: theorems on white errors, and the two extremes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bfi_cli.kernels.divergence import (
    Density,
    convolve,
    distinguishability,
    jensen_shannon_quadrature,
    kernel_density,
    sample_bits,
    window_bits,
)

WHITE = np.random.default_rng(0).standard_normal(400)
FOUND = distinguishability(WHITE)


def gaussian(sd: float) -> Density:
    return Density(samples=np.zeros(1), bandwidths=np.array([sd]), pilot_bandwidth=sd, exponent=0.0)


def test_one_coordinate_has_all_that_the_window_tells():
    """The log density ratio of the whole window is that of the error along the signature, for any magnitude spread."""
    rng = np.random.default_rng(1)
    g, sd = rng.standard_normal(12), 3.0
    along = g / np.linalg.norm(g)
    covariance = np.eye(12) + sd**2 * np.outer(along, along)
    x = rng.multivariate_normal(np.zeros(12), covariance, size=20)
    whole = stats.multivariate_normal(np.zeros(12), covariance).logpdf(x) - stats.norm.logpdf(x).sum(axis=1)
    one = stats.norm.logpdf(x @ along, 0.0, np.hypot(1.0, sd)) - stats.norm.logpdf(x @ along)
    np.testing.assert_allclose(one, whole, atol=1e-10)


def test_rises_from_nothing_to_a_bit():
    assert (np.diff(FOUND.bits) > 0.0).all()
    assert FOUND.bits[0] < 1e-4
    assert FOUND.bits[-1] > 1.0 - 1e-4
    fine = window_bits(FOUND, np.logspace(-1.0, 6.0, 400))
    assert (np.diff(fine) > 0.0).all()


def test_interpolates_what_quadrature_gives():
    sizes = 10.0 ** np.random.default_rng(2).uniform(-1.0, 5.0, 12)
    exact = [jensen_shannon_quadrature(FOUND.errors, convolve(FOUND.errors, float(d))) for d in sizes]
    np.testing.assert_allclose(window_bits(FOUND, sizes), exact, atol=1e-3)


def test_gaussian_errors_give_what_gaussians_do():
    """The estimated density of 4000 errors is wider by its bandwidth, which costs a fiftieth of a bit."""
    found = distinguishability(np.random.default_rng(3).standard_normal(4000))
    sizes = np.array([0.5, 2.0, 5.0, 50.0])
    exact = [jensen_shannon_quadrature(gaussian(1.0), gaussian(float(np.hypot(1.0, d)))) for d in sizes]
    np.testing.assert_allclose(window_bits(found, sizes), exact, atol=0.03)


def test_does_not_depend_on_the_unit_or_the_shape_of_the_errors():
    for other in (distinguishability(1e-7 * WHITE), distinguishability(WHITE.reshape(200, 2))):
        np.testing.assert_allclose(other.bits, FOUND.bits, atol=1e-9)


def test_what_is_not_seen_tells_nothing_and_what_is_beyond_the_range_everything():
    np.testing.assert_array_equal(window_bits(FOUND, np.array([[0.0, np.nan], [np.inf, 1e12]])), [[0, 0], [1, 1]])


def test_without_noise_a_gaussian_stands_for_the_errors():
    expected = jensen_shannon_quadrature(gaussian(1.0), gaussian(np.sqrt(26.0)))
    assert float(window_bits(distinguishability(np.zeros(50)), np.array(5.0))) == pytest.approx(expected, abs=1e-3)


def test_many_errors_are_thinned_evenly():
    many = distinguishability(np.random.default_rng(4).standard_normal(20_000))
    assert many.errors.samples.size == 512
    assert np.std(many.errors.samples) == pytest.approx(1.0, abs=0.03)
    assert np.median(many.errors.samples) == pytest.approx(0.0, abs=0.03)


def test_a_sample_compares_the_two_densities():
    trace = np.full(400, np.nan)
    trace[100:] = np.sin(np.arange(300))
    expected = jensen_shannon_quadrature(kernel_density(WHITE), kernel_density(WHITE[100:] + trace[100:]))
    assert sample_bits(WHITE, trace[:, None]) == pytest.approx([expected], abs=1e-12)


def test_single_samples_miss_a_short_trace_that_the_window_sees():
    """One error of 50 deviations is certain to a window; among 400 samples its density hardly counts."""
    spike, spread = np.zeros(400), np.full(400, 50.0 / 20.0)
    spike[200] = 50.0
    short, long = sample_bits(WHITE, np.column_stack([spike, spread]))
    assert short < 0.02
    assert long > 0.5
    assert window_bits(FOUND, np.array(np.linalg.norm(spike))) == window_bits(FOUND, np.array(np.linalg.norm(spread)))


@pytest.mark.parametrize(
    ("errors", "trace"), [(WHITE, np.full(400, np.nan)), (WHITE[:2], np.ones(2)), (np.zeros(9), np.zeros(9))]
)
def test_too_little_has_no_density(errors: np.ndarray, trace: np.ndarray):
    assert np.isnan(sample_bits(errors, trace[:, None])).all()
