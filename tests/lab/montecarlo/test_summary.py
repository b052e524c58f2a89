"""Rates with Wilson intervals: published values, the score test they invert, what is counted of what."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noted import texts

from bfi_cli.lab.montecarlo import Sweep, summarise, wilson
from bfi_cli.lab.montecarlo.trial import Row


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_published_intervals(count: int, of: int, low: float, high: float):
    """Newcombe (1998), Statistics in Medicine 17, table I, method 3."""
    assert wilson(count, of) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 500).flatmap(lambda of: st.tuples(st.integers(0, of), st.just(of))))
def test_its_ends_are_where_the_score_test_is_at_its_level(counts: tuple[int, int]):
    count, of = counts
    low, high = wilson(count, of)
    assert 0.0 <= low <= count / of <= high <= 1.0
    for end in {low, high} - {0.0, 1.0}:
        assert (count / of - end) ** 2 == pytest.approx(1.959963984540054**2 * end * (1 - end) / of, rel=1e-6)
    assert np.allclose(wilson(of - count, of), (1.0 - high, 1.0 - low), atol=1e-12)


def test_nothing_to_count():
    assert wilson(0, 0) is None


def row(number: int, **answer: object) -> Row:
    return Row(scenario="all", trial=number, seed=0, truth={"bias": 2.0}, **answer)


FOUND = {"abrupt": "fault", "oscillating": "no_fault", "slow": "inconclusive", "states": {"bias": "declared"}}
FOUND |= {"beyond_tolerance": ("bias",), "wrong_no_fault": ()}
MISSED = dict.fromkeys(("abrupt", "oscillating", "slow"), "no_fault") | {"states": {"bias": "excluded"}}
MISSED |= {"beyond_tolerance": ("bias",), "wrong_no_fault": ("bias",)}


def test_a_fault_within_the_tolerance_is_no_wrong_no_fault(sweep: Callable[..., Sweep]):
    whole = sweep("record: {model: citation}\ndictionary: dictionary.yaml\nactive: 1\ntrials: 1\n")
    small = {**MISSED, "beyond_tolerance": (), "wrong_no_fault": ()}
    answer = {"estimate": {}, "decision": "no_fault", "isolated": False, "false_alarms": (), "missed": ("bias",)}
    (scenario,) = summarise(whole, [(row(0, **answer, **small), 0.1)]).scenarios
    wrong = scenario.wrong_no_fault_rate
    assert (wrong.count, wrong.of, wrong.rate, wrong.ci95) == (0, 0, None, None)


def test_what_is_counted_of_what(sweep: Callable[..., Sweep]):
    whole = sweep("record: {model: citation}\ndictionary: dictionary.yaml\nactive: 1\ntrials: 4\n")
    right = {"estimate": {"bias": 2.0}, "decision": "fault", "isolated": True, "false_alarms": (), "missed": ()}
    both = {"estimate": {"bias": 3.0, "sine": 1.0}, "decision": "fault", "isolated": False}
    rows = [
        row(0, **right, **FOUND, magnitude_error=0.01, intervals=1, covered=1),
        row(1, **both, **FOUND, false_alarms=("sine",), missed=(), magnitude_error=0.5, intervals=1, covered=0),
        row(
            2,
            **MISSED,
            estimate={},
            decision="no_fault",
            isolated=False,
            false_alarms=(),
            missed=("bias",),
            magnitude_error=1.0,
        ),
        row(3, error="no room"),
    ]
    summary = summarise(whole, [(one, 0.1 * (n + 1)) for n, one in enumerate(rows)])
    (scenario,) = summary.scenarios
    shares = (scenario.isolation_rate, scenario.false_alarm_rate, scenario.missed_detection_rate, scenario.coverage)
    assert [(share.count, share.of) for share in shares] == [(1, 4), (1, 3), (1, 3), (1, 2)]
    assert (scenario.trials, scenario.failed) == (4, 1)
    assert (scenario.wrong_no_fault_rate.count, scenario.wrong_no_fault_rate.of) == (1, 3)
    assert scenario.wrong_no_fault_rate.ci95 == wilson(1, 3)
    assert {key: (one.count, one.of) for key, one in scenario.decisions.items()} == {
        "fault": (2, 3),
        "no_fault": (1, 3),
        "inconclusive": (0, 3),
    }
    assert {kind: shares["no_fault"].count for kind, shares in scenario.verdicts.items()} == {
        "abrupt": 1,
        "oscillating": 3,
        "slow": 1,
    }
    assert scenario.magnitude_error["p50"] == 0.5
    assert scenario.magnitude_error["max"] == 1.0
    assert scenario.seconds == pytest.approx(0.25)
    assert texts(summary.notes) == ("1 of 4 trials of 'all' failed and count as not isolated; the first: no room",)
