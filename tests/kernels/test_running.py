"""What a record does within moving stretches, against a direct computation of every stretch; and weights of rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from bfi_cli.kernels import runs as module
from bfi_cli.kernels.runs import (
    block_means,
    greatest_of_neighbours,
    interpolation_error,
    mean_of_stretches,
    median_of_neighbours,
    noise_of_second_differences,
    running_median,
    running_weights,
    sd_about_lines,
    travel,
)


@pytest.mark.parametrize(("n_points", "stride"), [(12, 5), (3, 1), (7, 4)])
def test_the_deviation_about_lines_is_a_fit_of_every_stretch(n_points, stride):
    x = 1e5 + np.cumsum(np.random.default_rng(0).standard_normal(200))
    made = sd_about_lines(x, n_points, stride)
    assert len(made) == len(x) - n_points * stride + 1
    for first in (0, 17, len(made) - 1):
        points = x[first : first + n_points * stride].reshape(n_points, stride).mean(axis=1)
        line = np.polyfit(np.arange(n_points), points - points[0], 1)
        rest = points - points[0] - np.polyval(line, np.arange(n_points))
        assert made[first] == pytest.approx(np.sqrt(np.sum(rest**2) / (n_points - 2)), rel=1e-8)


def test_a_line_has_no_deviation():
    x, at = np.random.default_rng(1).standard_normal(100), np.arange(100)
    np.testing.assert_allclose(sd_about_lines(x + 90_000.0 - 3.0 * at, 6, 5), sd_about_lines(x, 6, 5), atol=1e-9)
    assert sd_about_lines(5.0 + 0.25 * at, 6, 5).max() < 1e-12


def test_what_is_missing_or_short_has_no_deviation():
    x = np.zeros(50)
    x[20] = np.nan
    made = sd_about_lines(x, 3, 4)
    assert np.isnan(made[9:21]).all()
    assert (made[:9] == 0.0).all()
    assert sd_about_lines(x, 30, 2).size == 0


def test_the_noise_is_that_of_white_noise_beside_slow_motion():
    rng, at = np.random.default_rng(2), np.arange(20_000)
    x = 1e3 * np.sin(at / 500.0) + 0.7 * rng.standard_normal(at.size)
    assert noise_of_second_differences(x, 1000, 0.5) == pytest.approx(0.7, rel=0.05)
    x[4000:4100] = np.nan
    assert noise_of_second_differences(x, 1000, 0.5) == pytest.approx(0.7, rel=0.05)
    assert noise_of_second_differences(x[:5], 10, 0.5) == 0.0


def test_what_rests_shows_no_noise():
    x = 0.7 * np.random.default_rng(3).standard_normal(20_000)
    x[: x.size // 2] = 4.0
    assert noise_of_second_differences(x, 100, 0.05) == 0.0
    assert noise_of_second_differences(x, 100, 0.5, rests=1e-6) == pytest.approx(0.7, rel=0.05)


@given(
    coefficients=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), half=st.integers(1, 8), height=st.floats(1, 9)
)
def test_what_a_cubic_leaves_is_the_excursion_alone(coefficients: list[float], half: int, height: float):
    t = np.linspace(-1.0, 1.0, 101)
    x = np.polyval(coefficients, t)
    x[50 : 50 + half] += height
    error = interpolation_error(x, half)
    np.testing.assert_allclose(error[50 : 50 + half], height, atol=1e-9)
    assert not error[: 3 * half].any()
    assert not error[len(t) - 3 * half :].any()


def test_beside_a_missing_sample_nothing_is_said():
    x = np.ones(40)
    x[20] = np.nan
    error = interpolation_error(x, 2)
    assert np.isfinite(error).all()
    assert not error.any()


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), st.integers(2, 9))
def test_travel_is_the_range_of_every_stretch(values: list[float], size: int):
    x = np.array(values)
    expected = [float(np.ptp(x[k : k + size])) for k in range(len(x) - size + 1)]
    np.testing.assert_array_equal(travel(x, size), expected)


def test_the_running_median_ignores_what_fills_less_than_half_of_its_blocks():
    x = np.full(200, 2.0)
    x[90:105] = 50.0
    np.testing.assert_array_equal(running_median(x, 5, 9), 2.0)
    assert running_median(np.arange(7.0), 10, 5) == pytest.approx(3.0)


def test_weights_are_inverse_to_the_size_of_the_error():
    rng = np.random.default_rng(0)
    size = np.repeat([1.0, 2.0], 2000)
    weights = running_weights(size[:, None] * rng.standard_normal((4000, 1)), 200)
    ratio = np.median(weights[:1500]) / np.median(weights[2500:])
    assert 1.8 < ratio < 2.2
    np.testing.assert_allclose(np.mean(weights**2), 1.0)


def test_an_outlier_or_a_factor_changes_nothing():
    error = np.random.default_rng(1).standard_normal((500, 1))
    spoilt = error.copy()
    spoilt[250] = 1e6
    np.testing.assert_allclose(running_weights(spoilt, 50), running_weights(error, 50), rtol=0.1)
    np.testing.assert_allclose(running_weights(1e3 * error, 50), running_weights(error, 50))


def test_an_error_of_zeros_has_equal_weights():
    np.testing.assert_array_equal(running_weights(np.zeros((50, 1)), 10), np.ones(50))


@pytest.mark.parametrize("values", [1, 50, 1000])
@pytest.mark.parametrize("half", [1, 10, 199])
def test_windows_that_move_along_are_those_at_once(monkeypatch: pytest.MonkeyPatch, values: int, half: int):
    """Medians and means, in blocks that do not divide the record's length."""
    error = np.round(np.random.default_rng(0).standard_normal((401, 1)), 2)
    whole = running_weights(error, half)
    monkeypatch.setattr(module, "MOST_VALUES", values)
    monkeypatch.setattr(module, "BLOCK", 30)
    np.testing.assert_allclose(running_weights(error, half), whole, rtol=1e-12)


@pytest.mark.parametrize(("n", "size"), [(100, 7), (100, 8), (33, 33), (50, 2), (20, 1), (70_000, 25)])
def test_medians_greatest_and_means_of_stretches_are_those_of_the_filters_of_scipy(n: int, size: int):
    x = np.random.default_rng(n + size).normal(size=n) + 1e5
    np.testing.assert_array_equal(median_of_neighbours(x, size), ndimage.median_filter(x, size, mode="nearest"))
    if size % 2:
        np.testing.assert_array_equal(greatest_of_neighbours(x, size), ndimage.maximum_filter1d(x, size))
    means = ndimage.uniform_filter1d(x, size)[size // 2 :][: n - size + 1]
    np.testing.assert_allclose(mean_of_stretches(x, size), means, rtol=1e-13)


def test_travel_of_a_record_longer_than_a_block_is_that_of_its_stretches(monkeypatch: pytest.MonkeyPatch):
    x = np.random.default_rng(0).normal(size=300)
    whole = travel(x, 24)
    monkeypatch.setattr(module, "BLOCK", 7)
    np.testing.assert_array_equal(travel(x, 24), whole)
    np.testing.assert_array_equal(travel(x, 24), np.ptp(np.lib.stride_tricks.sliding_window_view(x, 24), axis=1))


@pytest.mark.parametrize("least", [1.0, 3.0, np.array([1.0, 4.0, 2.0, 0.0, 1.0])])
def test_means_of_blocks_are_those_of_their_finite_values(least: float | np.ndarray):
    rng = np.random.default_rng(2)
    block = np.sort(rng.choice([0, 1, 2, 4], size=40))
    values = 1e5 + rng.standard_normal(block.size)
    values[rng.random(block.size) < 0.3] = np.nan
    values[block == 2] = np.nan
    made = block_means(values, block, 5, least=least)
    for k, needed in enumerate(np.broadcast_to(least, 5)):
        part = values[(block == k) & np.isfinite(values)]
        expected = part.mean() if part.size >= max(needed, 1.0) else np.nan
        assert made[k] == pytest.approx(expected, rel=1e-14, nan_ok=True)
    assert np.isnan(made[2])
    assert np.isnan(made[3])
