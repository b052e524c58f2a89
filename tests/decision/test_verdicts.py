"""States of candidates, verdicts on the kinds of fault, and the line that names all of them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from bfi_cli.decision import KINDS, Candidate, decide, kind_of, verdicts_of
from bfi_cli.decision.candidate import BUILD_UP_S, state_of
from bfi_cli.decision.conclude import summarise
from bfi_cli.faults import Fault
from bfi_cli.faults.shapes import SHAPES

STATES = ("declared", "suspected", "excluded", "not_seen")


def candidate(kind, state, *, effect=None, channel="tas", unit="m/s"):
    return Candidate(
        name=f"{kind}_{state}",
        shape={"abrupt": "bias", "oscillating": "sine", "slow": "drift"}[kind],
        channel=channel,
        kind=kind,
        state=state,
        magnitude=None,
        unit=unit,
        sd=None,
        effect=effect,
        tolerance=3.0,
        channel_unit=unit,
    )


@pytest.mark.parametrize("states", [c for n in (1, 2, 3) for c in itertools.combinations_with_replacement(STATES, n)])
def test_a_kind_is_excluded_only_if_all_of_it_is(states):
    verdict = verdicts_of([candidate("abrupt", state) for state in states])["abrupt"]
    if "declared" in states:
        assert verdict == "fault"
    else:
        assert verdict == ("no_fault" if set(states) == {"excluded"} else "inconclusive")


def test_what_was_not_looked_for_is_never_excluded():
    assert verdicts_of([]) == dict.fromkeys(KINDS, "inconclusive")
    left_out = [candidate("slow", None), candidate("abrupt", "excluded"), candidate("oscillating", "excluded")]
    assert verdicts_of(left_out) == {"abrupt": "no_fault", "oscillating": "no_fault", "slow": "inconclusive"}


@pytest.mark.parametrize(
    ("verdicts", "required", "decision"),
    [
        (("no_fault", "no_fault", "no_fault"), KINDS, "no_fault"),
        (("no_fault", "no_fault", "inconclusive"), KINDS, "inconclusive"),
        (("no_fault", "no_fault", "inconclusive"), ("abrupt", "oscillating"), "no_fault"),
        (("inconclusive", "no_fault", "no_fault"), ("slow",), "no_fault"),
        (("fault", "inconclusive", "inconclusive"), KINDS, "fault"),
        (("no_fault", "no_fault", "fault"), ("abrupt",), "fault"),
    ],
)
def test_the_decision_is_the_worst_of_the_kinds_required_and_a_fault_is_a_fault(verdicts, required, decision):
    assert decide(dict(zip(KINDS, verdicts, strict=True)), required) == decision


@pytest.mark.parametrize(
    ("effect", "tolerance", "state"),
    [(1.0, 2.0, "excluded"), (2.0, 2.0, "excluded"), (2.1, 2.0, "not_seen"), (None, 2.0, "not_seen")],
)
def test_a_fault_is_excluded_within_the_tolerance_only(effect, tolerance, state):
    assert state_of(declared=False, suspected=False, effect=effect, tolerance=tolerance) == state
    assert state_of(declared=False, suspected=True, effect=effect, tolerance=tolerance) == "suspected"
    assert state_of(declared=True, suspected=True, effect=effect, tolerance=tolerance) == "declared"


def test_lags_and_ramps_are_abrupt_where_declared_and_excluded_with_what_is_as_slow():
    fast = Fault(shape="lagged_bias", time_constant_s=5.0)
    slow = Fault(shape="ramp_hold", duration_s=20.0)
    assert [kind_of(one, declared=True) for one in (fast, slow)] == ["abrupt", "abrupt"]
    assert [kind_of(one, declared=False) for one in (fast, slow)] == ["abrupt", "slow"]
    edge = Fault(shape="ramp_hold", duration_s=BUILD_UP_S / 0.9)
    assert kind_of(edge, declared=False) == "abrupt"
    for shape, one in SHAPES.items():
        if one.kind != "abrupt":
            assert kind_of(Fault(shape=shape, frequency_hz=1.0, file="x"), declared=False) == one.kind


def test_the_first_line_names_every_kind_without_a_fault():
    candidates = [
        candidate("abrupt", "excluded", effect=0.41),
        candidate("oscillating", "excluded", effect=0.2),
        candidate("slow", "not_seen", effect=9.3),
    ]
    assert summarise(verdicts_of(candidates), candidates) == (
        "no step above 0.41 m/s; no oscillation above 0.2 m/s; a slow fault could reach 9.3 m/s unseen"
    )
    scanned = [
        replace(
            candidate("oscillating", "excluded", effect=0.2), note="of 0.05 to 0.4 Hz", onsets_checked=((3.0, 50.0),)
        )
    ]
    assert "no oscillation of 0.05 to 0.4 Hz above 0.2 m/s" in summarise(verdicts_of(scanned), scanned)
    declared = [candidate("abrupt", "declared"), candidate("slow", "not_seen")]
    assert summarise(verdicts_of(declared), declared) == (
        "an oscillation was not looked for; a slow fault of any size could be there unseen"
    )
    at_the_end = replace(
        candidate("abrupt", "not_seen"), name="late", onset_s=59.0, note="too near an end of the window"
    )
    both = [at_the_end, candidate("abrupt", "excluded", effect=0.4)]
    assert summarise(verdicts_of(both), both).startswith(
        "a step of any size could be there unseen (late: too near an end of the window); an oscillation was not"
    )
    vast = [candidate("slow", "not_seen", effect=363.0)]  # more than an airspeed can be wrong
    assert summarise(verdicts_of(vast), vast).endswith("; a slow fault of any size could be there unseen")
    suspected = [candidate("slow", "suspected"), candidate("slow", "excluded", effect=1.0)]
    assert summarise(verdicts_of(suspected), suspected).endswith("a slow fault is suspected (slow_suspected)")
    angles = [candidate("abrupt", "excluded", effect=0.0175, channel="aoa", unit="rad")]
    assert summarise(verdicts_of(angles), angles).startswith("no step above 1 deg")
