"""Thresholds of the largest deviate: against exact distributions, simulation, and with few observed blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from bfi_cli.kernels.whiteness import (
    ExcessTail,
    block_maxima,
    fit_tail,
    white_excess,
    white_level,
)


@pytest.mark.parametrize("n_tests", [1, 10, 100_000])
@pytest.mark.parametrize("false_alarm", [0.001, 0.05])
def test_the_white_level_bounds_the_largest_of_independent_deviates_tightly(n_tests, false_alarm):
    level = white_level(n_tests, false_alarm)
    exact = -np.expm1(n_tests * np.log1p(-2.0 * stats.norm.sf(level)))
    assert 0.95 * false_alarm < exact <= false_alarm * (1.0 + 1e-9)


def test_the_white_excess_is_the_mean_excess_of_the_largest_over_its_median():
    rng = np.random.default_rng(0)
    for n_tests in (1, 50):
        largest = np.abs(rng.standard_normal((20_000, n_tests))).max(axis=1)
        above = largest[largest > np.median(largest)] - np.median(largest)
        sd = above.std() / np.sqrt(len(above))
        assert white_excess(n_tests) == pytest.approx(above.mean(), abs=5.0 * sd + 2e-3)


def test_block_maxima_are_over_channels_and_whole_blocks():
    deviates = np.array([[1.0, 2.0], [5.0, 0.0], [0.0, 3.0], [1.0, 1.0], [9.0, 9.0]])
    np.testing.assert_array_equal(block_maxima(deviates, 2), [5.0, 3.0])
    assert block_maxima(deviates, 6).shape == (0,)


def test_without_a_block_the_tail_is_that_of_white_noise_known_from_some():
    found = fit_tail(np.empty(0), 50.0)
    assert (found.start, found.mean, found.k) == (white_level(50.0, 0.5), white_excess(50.0), 5)
    assert found.level(1e-4) > white_level(50.0, 1e-4)


def test_the_mean_excess_counts_that_of_white_noise_as_some_more_blocks():
    """Five: docs/theory.md, 11.3."""
    found = fit_tail(np.r_[np.zeros(11), np.full(10, 2.0)], 50.0)
    assert (found.start, found.k, found.share) == (0.0, 10 + 5, 0.5)
    assert found.mean == pytest.approx((10 * 2.0 + 5 * white_excess(50.0)) / 15, rel=1e-12)


def test_excesses_that_are_alike_tell_less_of_the_tail():
    """Each value four times says what it says once, of the mean and of how well that is known."""
    values = np.random.default_rng(5).exponential(size=400)
    once, again = fit_tail(values, 50.0), fit_tail(np.repeat(values, 4), 50.0, alike=4.0)
    assert again.k == once.k
    assert again.mean == pytest.approx(once.mean, rel=0.05)
    assert fit_tail(np.repeat(values, 4), 50.0).level(1e-6) < again.level(1e-6)


@given(k=st.integers(1, 200), share=st.floats(0.05, 1.0), rarer=st.floats(1e-12, 1.0))
def test_level_and_probability_are_inverse(k: int, share: float, rarer: float):
    tail = ExcessTail(start=4.0, mean=0.5, k=k, share=share)
    assert tail.probability(tail.level(share * rarer)) == pytest.approx(share * rarer, rel=1e-9)


def test_a_tail_known_from_many_values_is_exponential_and_from_few_lies_higher():
    p = 1e-3
    levels = [ExcessTail(start=4.0, mean=0.5, k=k, share=0.5).level(p) for k in (10, 100, 10_000_000)]
    assert levels[0] > levels[1] > levels[2]
    assert levels[2] == pytest.approx(4.0 + 0.5 * np.log(0.5 / p), rel=1e-5)


def test_the_tail_is_the_predictive_distribution_of_an_exponential_law():
    """One more value of the law exceeds the level for p, its mean estimated from k of them, with probability p."""
    k, p, runs = 4, 0.05, 20_000
    values = np.random.default_rng(3).exponential(size=(runs, k + 1))
    alarms = sum(own[k] > ExcessTail(start=0.0, mean=float(own[:k].mean()), k=k, share=1.0).level(p) for own in values)
    assert stats.binomtest(int(alarms), runs, p).pvalue > 1e-3


def test_the_level_is_never_below_the_start():
    assert ExcessTail(start=4.0, mean=0.5, k=30, share=0.5).level(1.0) == 4.0


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("n_blocks", [12, 40])
def test_blocks_with_an_exponential_tail_exceed_the_level_as_often_as_wanted(n_blocks):
    """The level of few observed blocks, judged on as many new ones; the pseudo-blocks have the right mean here."""
    rng, runs, false_alarm = np.random.default_rng(1), 4000, 0.05
    alarms, mean = 0, white_excess(50.0)
    for _ in range(runs):
        tail = fit_tail(mean * rng.exponential(size=n_blocks), 50.0)
        alarms += mean * rng.exponential(size=n_blocks).max() > tail.level(false_alarm / n_blocks)
    rate = alarms / runs
    sd = np.sqrt(false_alarm * (1.0 - false_alarm) / runs)
    print(f"{n_blocks} blocks: {100.0 * rate:.2f} % of runs alarm, wanted {100.0 * false_alarm:.0f} %")
    assert 0.5 * false_alarm - 2.0 * sd < rate < 1.6 * false_alarm + 2.0 * sd


def test_gusty_blocks_raise_the_level():
    rng = np.random.default_rng(2)
    calm, gusty = 4.0 + 0.3 * rng.exponential(size=50), 4.0 + 1.5 * rng.exponential(size=50)
    levels = [fit_tail(maxima, 50.0).level(0.01 / 20) for maxima in (calm, gusty)]
    assert levels[1] > levels[0] + 4.0
