"""What a method says, against what was injected."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bfi_cli.faults import Fault
from bfi_cli.lab.compare import Statement, Suspect
from bfi_cli.lab.compare.compare import score_of

STEP = Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=20.0)
DRIFT = Fault(shape="drift", channel="aoa", magnitude=0.1, onset_s=30.0)
SAYS_STEP = Suspect(channel="tas", shape="bias", onset_s=20.5, magnitude=3.0, declared_s=21.0)
SAYS_DRIFT = Suspect(channel="aoa", shape="drift", onset_s=28.0, magnitude=0.1)


def says(*suspects: Suspect) -> Statement:
    return Statement(decision="fault" if suspects else "no_fault", suspects=suspects)


def test_one_fault_is_scored_by_onset_size_and_delay():
    score = score_of(says(SAYS_STEP), [STEP])
    assert (score.isolated, score.false_alarms, score.missed) == ("fault", 0, 0)
    assert (score.onset_error_s, score.magnitude_error, score.delay_s) == pytest.approx((0.5, 0.25, 1.0))


@pytest.mark.parametrize("order", [1, -1])
def test_the_order_of_suspects_does_not_matter(order: int):
    score = score_of(says(*(SAYS_STEP, SAYS_DRIFT)[::order]), [STEP, DRIFT])
    assert (score.isolated, score.false_alarms, score.missed, score.onset_error_s) == ("fault", 0, 0, 0.5)


@pytest.mark.parametrize(
    ("suspects", "isolated", "false_alarms", "missed"),
    [
        ((), "no", 0, 1),
        ((replace(SAYS_STEP, shape=None),), "channel", 0, 0),
        ((replace(SAYS_STEP, shape="drift"),), "channel", 0, 0),
        ((replace(SAYS_STEP, shape="lagged_bias"),), "fault", 0, 0),
        ((replace(SAYS_STEP, channel="aoa"),), "no", 1, 1),
        ((SAYS_STEP, SAYS_DRIFT), "no", 1, 0),
        ((replace(SAYS_STEP, onset_s=10.0),), "no", 1, 1),
        ((replace(SAYS_STEP, onset_s=18.0, declared_s=18.0),), "no", 1, 1),
        ((replace(SAYS_STEP, onset_s=18.0, declared_s=None),), "fault", 0, 0),
    ],
)
def test_what_counts_as_isolated_false_and_missed(
    suspects: tuple[Suspect, ...], isolated: str, false_alarms: int, missed: int
):
    score = score_of(says(*suspects), [STEP])
    assert (score.isolated, score.false_alarms, score.missed) == (isolated, false_alarms, missed)


def test_every_suspect_of_a_log_without_a_fault_is_a_false_alarm():
    assert score_of(says(SAYS_STEP, SAYS_DRIFT), []).false_alarms == 2
    assert score_of(Statement(decision="fault"), []).false_alarms == 1
    assert score_of(says(), []).isolated is None
