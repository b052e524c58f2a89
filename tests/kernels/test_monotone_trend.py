"""A trend by ranks: exact on a line, the same as scipy's two functions, right as often as it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bfi_cli.kernels.monotone_trend import monotone_trend

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("n", [3, 8, 41])
@pytest.mark.parametrize("slope", [-0.3, 0.05])
def test_a_line_is_exact(n: int, slope: float):
    trend = monotone_trend(2.0 + slope * np.arange(n))
    assert trend.slope == pytest.approx(slope, rel=1e-12)
    assert trend.ci95 == pytest.approx((slope, slope), rel=1e-9)
    assert trend.level == pytest.approx(2.0, rel=1e-12)


def test_values_turned_over_have_the_trend_turned_over():
    values = RNG.normal(size=25) + 0.05 * np.arange(25)
    trend, other = monotone_trend(values), monotone_trend(-values)
    assert (other.slope, other.p_value) == pytest.approx((-trend.slope, trend.p_value), rel=1e-12)
    assert other.ci95 == pytest.approx((-trend.ci95[1], -trend.ci95[0]), rel=1e-9)


def test_the_chance_depends_on_the_order_alone():
    values = RNG.normal(size=20)
    assert monotone_trend(np.exp(values)).p_value == monotone_trend(values).p_value


def test_a_third_of_the_values_may_be_anything():
    values = 0.1 * np.arange(30.0)
    values[::4] = RNG.normal(size=8) * 1e6
    assert monotone_trend(values).slope == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("ties", [False, True])
def test_the_slope_and_the_rank_correlation_are_those_of_scipy(ties: bool):
    for seed in range(20):
        values = np.random.default_rng(seed).normal(size=15 + seed) + 0.05 * np.arange(15 + seed)
        values = np.round(values) if ties else values
        trend = monotone_trend(values)
        assert trend.slope == pytest.approx(stats.theilslopes(values).slope, rel=1e-12, abs=1e-15)
        # The correction for continuity makes ours the larger.
        other = stats.kendalltau(np.arange(values.size), values, method="asymptotic").pvalue
        assert other - 1e-12 <= trend.p_value <= 1.2 * other + 0.06


def test_false_alarms_and_intervals_are_as_often_as_said():
    n, alarms, covered = 1000, 0, 0
    for seed in range(n):
        values = np.random.default_rng(seed).standard_t(3, size=20) + 0.05 * np.arange(20)
        trend = monotone_trend(values - 0.05 * np.arange(20))
        alarms += trend.p_value < 0.05
        covered += trend.ci95[0] <= 0.0 <= trend.ci95[1]
    assert alarms <= stats.binom.ppf(0.999, n, 0.05)
    assert covered >= stats.binom.ppf(0.001, n, 0.95)


def test_no_values_have_no_trend():
    with pytest.raises(ValueError, match="needs 3 values, got 2"):
        monotone_trend(np.zeros(2))
    assert monotone_trend(np.zeros(9)).p_value == 1.0
