"""A trend of scattered values: exact on a line, the slope as scipy has it, right as often as it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bfi_cli.kernels.monotone_trend import MonotoneTrend, monotone_trend

RNG = np.random.default_rng(0)


def trend_of(values: np.ndarray) -> MonotoneTrend:
    return monotone_trend(values, rng=np.random.default_rng(1))


@pytest.mark.parametrize("n", [3, 8, 41])
@pytest.mark.parametrize("slope", [-0.3, 0.05])
def test_a_line_is_exact(n: int, slope: float):
    trend = trend_of(2.0 + slope * np.arange(n))
    assert trend.slope == pytest.approx(slope, rel=1e-12)
    assert trend.ci95 == pytest.approx((slope, slope), rel=1e-9)
    assert trend.level == pytest.approx(2.0, rel=1e-12)


def test_values_turned_over_have_the_trend_turned_over():
    values = RNG.normal(size=25) + 0.05 * np.arange(25)
    trend, other = trend_of(values), trend_of(-values)
    assert (other.slope, other.p_value) == pytest.approx((-trend.slope, trend.p_value), rel=1e-12)
    assert other.ci95 == pytest.approx((-trend.ci95[1], -trend.ci95[0]), rel=1e-9)


def test_scale_and_level_of_the_values_do_not_matter():
    values = RNG.normal(size=20)
    trend, other = trend_of(values), trend_of(1e6 + 1e-3 * values)
    assert other.p_value == trend.p_value
    assert other.slope == pytest.approx(1e-3 * trend.slope, rel=1e-5)


def test_a_third_of_the_values_may_be_anything():
    values = 0.1 * np.arange(30.0)
    values[::4] = RNG.normal(size=8) * 1e6
    trend = trend_of(values)
    assert trend.slope == pytest.approx(0.1, abs=0.02)
    assert trend.p_value < 0.001


def test_the_slope_is_that_of_scipy():
    for seed in range(20):
        values = np.random.default_rng(seed).normal(size=15 + seed) + 0.05 * np.arange(15 + seed)
        assert trend_of(values).slope == pytest.approx(stats.theilslopes(values).slope, rel=1e-12, abs=1e-15)


def test_of_few_values_the_chance_is_that_of_all_orders():
    """Of four values two of 24 orders rise or fall throughout, and no score is larger."""
    assert trend_of(np.array([1.0, 2.0, 3.0, 4.0])).p_value == pytest.approx(2 / 24, abs=0.02)


def test_values_far_off_take_little_of_the_power():
    """A tenth of them; a trend of as much in all as three standard deviations in twenty values."""
    n, found = 100, 0
    for seed in range(n):
        rng = np.random.default_rng(seed)
        values = rng.normal(size=20) + 15.0 * rng.choice([-1.0, 1.0], 20) * (rng.uniform(size=20) < 0.1)
        found += trend_of(values + 3.0 / 12.0 * np.arange(20)).p_value < 0.05
    assert found >= stats.binom.ppf(0.001, n, 0.9)


@pytest.mark.slow
def test_false_alarms_and_intervals_are_as_often_as_said():
    n, alarms, covered = 500, 0, 0
    for seed in range(n):
        values = np.random.default_rng(seed).standard_t(3, size=20) + 0.05 * np.arange(20)
        trend = trend_of(values - 0.05 * np.arange(20))
        alarms += trend.p_value < 0.05
        covered += trend.ci95[0] <= 0.0 <= trend.ci95[1]
    assert alarms <= stats.binom.ppf(0.999, n, 0.05)
    assert covered >= stats.binom.ppf(0.001, n, 0.95)


def test_no_values_have_no_trend():
    with pytest.raises(ValueError, match="needs 3 values, got 2"):
        trend_of(np.zeros(2))
    assert trend_of(np.zeros(9)).p_value == 1.0
    assert trend_of(np.array([0.0, 0.0, 0.0, 0.0, 1.0])).p_value > 0.1
