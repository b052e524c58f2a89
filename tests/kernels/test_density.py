"""Adaptive kernel densities: the equations, invariances, draws, and what has no density."""

from __future__ import annotations

import numpy as np
import plain_density as plain
import pytest
from scipy import stats

from bfi_cli.kernels import divergence as module
from bfi_cli.kernels.divergence import (
    Density,
    convolve,
    draw,
    gaussian_density,
    kernel_density,
    log_density,
)

rng = np.random.default_rng(5)
NORMAL = rng.standard_normal(60)
SKEWED = rng.exponential(2.0, 60)
TWO_HUMPS = np.concatenate([rng.normal(-4.0, 0.5, 40), rng.normal(3.0, 1.0, 40)])
SETS = {"normal": NORMAL, "skewed": SKEWED, "two humps": TWO_HUMPS}
each_set = pytest.mark.parametrize("samples", SETS.values(), ids=SETS)


@each_set
@pytest.mark.parametrize("a", [0.0, 0.5, 1.0])
def test_bandwidths_and_density_are_those_of_the_equations(samples: np.ndarray, a: float):
    found = kernel_density(samples, exponent=a)
    widths = plain.local_bandwidths(samples, a)
    np.testing.assert_allclose(found.bandwidths, widths, rtol=1e-12)
    points = np.linspace(-8.0, 12.0, 30)
    expected = [plain.density(x, samples, widths) for x in points]
    np.testing.assert_allclose(np.exp(log_density(found, points)), expected, rtol=1e-12, atol=1e-300)


@pytest.mark.first_rows(1)
@each_set
def test_the_exponent_is_the_most_likely_of_the_grid(samples: np.ndarray):
    grid = np.linspace(0.0, 1.0, 21)
    best = grid[int(np.argmax([plain.left_out(samples, a) for a in grid]))]
    assert kernel_density(samples, exponent=None).exponent == best


@each_set
def test_the_constant_of_the_kernel_is_in_no_bandwidth(samples: np.ndarray):
    printed = plain.local_bandwidths(samples, 0.5, constant=1.0 / (2.0 * np.pi))
    np.testing.assert_allclose(kernel_density(samples).bandwidths, printed, rtol=1e-12)


@each_set
def test_integrates_to_one(samples: np.ndarray):
    found = kernel_density(samples)
    x = np.linspace(samples.min() - 40.0, samples.max() + 40.0, 40_001)
    assert np.trapezoid(np.exp(log_density(found, x)), x) == pytest.approx(1.0, abs=1e-9)


@each_set
def test_local_factors_have_geometric_mean_one_and_fall_with_the_density(samples: np.ndarray):
    found = kernel_density(samples, exponent=0.5)
    assert np.exp(np.mean(np.log(found.bandwidths / found.pilot_bandwidth))) == pytest.approx(1.0, rel=1e-12)
    pilot = log_density(kernel_density(samples, exponent=0.0), samples)
    np.testing.assert_array_equal(np.argsort(-pilot), np.argsort(found.bandwidths))


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e6, -3e6), (-2.0, 100.0)])
@each_set
def test_follows_the_unit_and_the_origin(samples: np.ndarray, scale: float, shift: float):
    before, after = kernel_density(samples, exponent=None), kernel_density(scale * samples + shift, exponent=None)
    assert after.exponent == before.exponent
    np.testing.assert_allclose(after.bandwidths, abs(scale) * before.bandwidths, rtol=1e-8)
    expected = log_density(before, samples) - np.log(abs(scale))
    np.testing.assert_allclose(log_density(after, scale * samples + shift), expected, atol=1e-7)


@pytest.mark.parametrize(("amplitude", "expected"), [(2.0, 0.533), (4.0, 1.066)])
def test_bandwidth_of_the_faults_of_the_f16_experiment(amplitude: float, expected: float):
    """80 samples of a sine at ten phases: the quartiles are wider than the deviation, which therefore counts."""
    residual = amplitude * np.sin(2.0 * np.pi * np.arange(80) / 10.0)
    assert kernel_density(residual).pilot_bandwidth == pytest.approx(expected, abs=5e-4)


def test_bandwidth_takes_the_narrower_measure_of_spread():
    outlier = np.append(np.linspace(-1.0, 1.0, 99), 1e3)
    low, high = np.percentile(outlier, [25, 75])
    assert kernel_density(outlier).pilot_bandwidth == pytest.approx(0.9 * (high - low) / 1.34 * 100**-0.2, rel=1e-12)
    tied = np.append(np.zeros(99), 1.0)
    assert kernel_density(tied).pilot_bandwidth == pytest.approx(0.9 * np.std(tied, ddof=1) * 100**-0.2, rel=1e-12)


def test_a_given_bandwidth_is_taken():
    found = kernel_density(NORMAL, exponent=0.0, bandwidth=0.25)
    assert found.pilot_bandwidth == 0.25
    np.testing.assert_array_equal(found.bandwidths, 0.25)


def test_gaussian_is_the_fit_of_two_moments():
    found = gaussian_density(SKEWED)
    expected = stats.norm.logpdf([-1.0, 0.0, 50.0], SKEWED.mean(), SKEWED.std(ddof=1))
    np.testing.assert_allclose(log_density(found, np.array([-1.0, 0.0, 50.0])), expected, rtol=1e-12)


def test_draws_have_the_distribution():
    found = kernel_density(TWO_HUMPS)

    def cdf(x: np.ndarray) -> np.ndarray:
        return stats.norm.cdf((np.asarray(x)[..., None] - found.samples) / found.bandwidths).mean(axis=-1)

    assert stats.kstest(draw(found, 4000, rng=np.random.default_rng(1)), cdf).pvalue > 1e-4


def test_is_finite_however_far_out():
    found = log_density(kernel_density(NORMAL), np.array([-1e6, 1e9]))
    assert np.isfinite(found).all()
    assert (found < -1e9).all()


def test_the_size_of_the_blocks_does_not_matter(monkeypatch: pytest.MonkeyPatch):
    whole, points = kernel_density(TWO_HUMPS, exponent=None), np.linspace(-9.0, 9.0, 50).reshape(5, 10)
    expected = log_density(whole, points)
    assert expected.shape == points.shape
    monkeypatch.setattr(module, "BLOCK", 7)
    assert kernel_density(TWO_HUMPS, exponent=None).exponent == whole.exponent
    np.testing.assert_allclose(log_density(whole, points), expected, rtol=1e-12)


def test_samples_are_copied_and_frozen():
    samples = NORMAL.copy()
    found = kernel_density(samples)
    np.testing.assert_array_equal(samples, NORMAL)
    samples[0] = 99.0
    assert found.samples[0] == NORMAL[0]
    with pytest.raises(ValueError, match="read-only"):
        found.samples[0] = 0.0


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        ([1.0, 2.0], "needs 3 samples or more"),
        ([], "needs 3 samples or more"),
        ([[1.0, 2.0], [3.0, 4.0]], "in one dimension"),
        ([3.5] * 20, "must differ, got 20 times 3.5"),
        ([0.0] * 5, "must differ"),
        ([1e6 + 1e-10, 1e6, 1e6], "must differ"),
        ([1.0, 2.0, np.nan], "must be finite"),
        ([1.0, 2.0, np.inf], "must be finite"),
    ],
)
@pytest.mark.parametrize("function", [kernel_density, gaussian_density])
def test_what_has_no_density(function, samples: list[float], message: str):
    with pytest.raises(ValueError, match=message):
        function(np.array(samples))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"exponent": -0.1}, "exponent must not be negative"),
        ({"exponent": np.nan}, "exponent must not be negative"),
        ({"bandwidth": 0.0}, "bandwidth must be positive"),
        ({"bandwidth": np.inf}, "bandwidth must be positive"),
    ],
)
def test_settings_out_of_range(settings: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        kernel_density(NORMAL, **settings)


def test_converges_to_what_the_samples_came_from():
    """The integrated squared error falls with the sample, n^(-4/5) in theory: by 5 from 100 to 800 samples."""
    x = np.linspace(-6.0, 6.0, 601)

    def error(n: int, seed: int) -> float:
        found: Density = kernel_density(np.random.default_rng(seed).standard_normal(n))
        return float(np.trapezoid((np.exp(log_density(found, x)) - stats.norm.pdf(x)) ** 2, x))

    few, many = (np.mean([error(n, seed) for seed in range(20)]) for n in (100, 800))
    assert many < few / 2.5


def test_a_convolved_density_is_that_of_a_sum():
    found = convolve(kernel_density(TWO_HUMPS), 3.0)
    x = np.linspace(-40.0, 40.0, 8001)
    before = np.exp(log_density(kernel_density(TWO_HUMPS), x))
    expected = np.convolve(before, stats.norm.pdf(x, scale=3.0), mode="same") * (x[1] - x[0])
    np.testing.assert_allclose(np.exp(log_density(found, x)), expected, atol=1e-9)
    with pytest.raises(ValueError, match="must not be negative, got -1"):
        convolve(found, -1.0)
