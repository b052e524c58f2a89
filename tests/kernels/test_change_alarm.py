"""Sequential tests of a change of the mean."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.change_alarm import best_split, cumulative_sum, cusum_threshold, glr_threshold, likelihood_ratio


def test_a_step_without_noise_is_declared_when_the_sum_says_so():
    x = np.where(np.arange(100) >= 40, 2.0, 0.0)
    found = cumulative_sum(x).alarm(10.0)  # 1.5 a row: beyond 10 in the seventh
    assert found is not None
    assert (found.alarm, found.onset, found.size) == (46, 40, 2.0)
    found = likelihood_ratio(-x, 50).alarm(10.0)  # n 4 / 2: beyond 10 in the sixth
    assert found is not None
    assert (found.alarm, found.onset, found.size) == (45, 40, -2.0)


def test_nothing_is_declared_where_nothing_changes():
    assert cumulative_sum(np.zeros(100)).alarm(1.0) is None
    assert likelihood_ratio(np.zeros(100), 50).alarm(1.0) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sign_of_the_errors_does_not_matter(sign: float):
    x = np.random.default_rng(0).standard_normal(400) + np.where(np.arange(400) >= 200, 1.0, 0.0)
    plain, turned = cumulative_sum(x).alarm(8.0), cumulative_sum(sign * x).alarm(8.0)
    assert plain is not None
    assert turned is not None
    assert (turned.alarm, turned.onset) == (plain.alarm, plain.onset)


@pytest.mark.slow
def test_false_alarms_of_white_noise_are_no_more_often_than_wanted():
    """Binomial: at a rate of 5 %, 200 records have more than 21 alarms with a probability below 1e-3."""
    rng, n, wanted = np.random.default_rng(1), 300, 0.05
    h, g = cusum_threshold(n, wanted), glr_threshold(n, 100, wanted)
    records = rng.standard_normal((200, n))
    assert 1 <= sum(cumulative_sum(x).alarm(h) is not None for x in records) <= 21
    assert sum(likelihood_ratio(x, 100).alarm(g) is not None for x in records) <= 21
    assert cusum_threshold(n, 0.01) > h


def test_the_gain_of_the_best_split_is_what_the_sum_of_squares_falls_by():
    x = np.random.default_rng(2).standard_normal(60) + np.where(np.arange(60) >= 25, 1.5, 0.0)
    around = [np.sum((part - part.mean()) ** 2) for k in range(1, 60) for part in (x[:k], x[k:])]
    falls = np.sum((x - x.mean()) ** 2) - (np.array(around[::2]) + np.array(around[1::2]))
    assert best_split(x) == pytest.approx(0.5 * falls.max(), rel=1e-12)
    assert best_split(np.ones(60)) == pytest.approx(0.0, abs=1e-12)
