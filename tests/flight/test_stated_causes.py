"""What the engineer states to have happened: no fault is seen in what it moves, and every other one is."""

from __future__ import annotations

import json

import pytest
from made_diagnoses import Diagnoses

ONSET_S = 420.0
PART = ("--from", 300, "--to", 560, "--workers", 1)
PITCH = f"bias,channel=pitch,magnitude=0.03,onset_s={ONSET_S}"
TAS = f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}"


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("--event", "flap@420"), 2, "did you mean 'flaps'?"),
        (("--event", "flaps"), 2, "write one like flaps@4780"),
        (("--event", "flaps@soon"), 2, "write one like flaps@4780"),
        (("--event", "flaps@nan"), 2, "finite"),
        (("--event", "flaps@1e6"), 3, "give a time in it"),
        (("--event", "flaps@420", "--no-judge"), 2, "leave out --no-judge or the event"),
    ],
)
def test_a_bad_event_is_refused_in_a_line(diagnoses: Diagnoses, words: tuple[str, ...], code: int, says: str) -> None:
    outcome = diagnoses.bfi("diagnose", diagnoses.log(""), *PART, *words)
    assert outcome.code == code
    assert says in outcome.stderr
    assert len(outcome.stderr.strip().splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "explained"), [(PITCH, True), (TAS, False)])
def test_a_stated_cause_explains_what_it_moves_and_nothing_else(
    diagnoses: Diagnoses, fault: str, explained: bool
) -> None:
    said = json.loads(diagnoses.bfi("diagnose", diagnoses.log(fault), *PART, "--event", "flaps@422", "--json").stdout)
    assert {"flaps"} == {entry["cause"] for entry in said["ordinary"] if entry["stated"]}
    assert any(entry["from_s"] == 422.0 and entry["looks_like"] == "" for entry in said["ordinary"])
    assert any(entry["looks_like"] for entry in said["ordinary"] if entry["stated"]) == explained
    assert (said["decision"] == "fault") != explained
