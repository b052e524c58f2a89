"""Sequential tests of a change of the mean."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.change_alarm import cusum_alarm, cusum_threshold, glr_alarm, glr_threshold


def test_a_step_without_noise_is_declared_when_the_sum_says_so():
    x = np.where(np.arange(100) >= 40, 2.0, 0.0)
    found = cusum_alarm(x, 10.0)  # 1.5 a row: beyond 10 in the seventh
    assert found is not None
    assert (found.alarm, found.onset, found.size) == (46, 40, 2.0)
    found = glr_alarm(-x, 10.0, 50)  # n 4 / 2: beyond 10 in the sixth
    assert found is not None
    assert (found.alarm, found.onset, found.size) == (45, 40, -2.0)


def test_nothing_is_declared_where_nothing_changes():
    assert cusum_alarm(np.zeros(100), 1.0) is None
    assert glr_alarm(np.zeros(100), 1.0, 50) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sign_of_the_errors_does_not_matter(sign: float):
    x = np.random.default_rng(0).standard_normal(400) + np.where(np.arange(400) >= 200, 1.0, 0.0)
    plain, turned = cusum_alarm(x, 8.0), cusum_alarm(sign * x, 8.0)
    assert plain is not None
    assert turned is not None
    assert (turned.alarm, turned.onset) == (plain.alarm, plain.onset)


def test_false_alarms_of_white_noise_are_no_more_often_than_wanted():
    """Binomial: at a rate of 5 %, 200 records have more than 21 alarms with a probability below 1e-3."""
    rng, n, wanted = np.random.default_rng(1), 300, 0.05
    h, g = cusum_threshold(n, wanted), glr_threshold(n, 100, wanted)
    records = rng.standard_normal((200, n))
    assert 1 <= sum(cusum_alarm(x, h) is not None for x in records) <= 21
    assert sum(glr_alarm(x, g, 100) is not None for x in records) <= 21
    assert cusum_threshold(n, 0.01) > h
