"""A document that contradicts itself is refused in one line; one that the program wrote is not."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_results import fault_result, no_fault_result, two_output_result

from bfi_cli.model.result import identify_document
from bfi_cli.report.consistency import contradiction_of
from bfi_cli.serialization import to_plain

HEALTHY = {"abrupt": "no_fault", "oscillating": "no_fault", "slow": "inconclusive"}
EVENT = {"state": "declared", "kind": "abrupt", "magnitude": 4.0, "ci95": [3.9, 4.1], "sd": 0.05, "p_value": 0.01}
EVENT |= {"onset_s": 13.8, "onset_ci95": [13.6, 14.0], "offset_s": 20.0, "beyond_tolerance": None}
DIAGNOSIS: dict[str, Any] = {
    "kind": "diagnose",
    "decision": "fault",
    "verdicts": {**HEALTHY, "abrupt": "fault"},
    "events": [EVENT],
}


def changed(changes: dict[str, Any]) -> dict[str, Any]:
    document = copy.deepcopy(DIAGNOSIS)
    for place, value in changes.items():
        node, *keys = place.split(".")
        target: Any = document
        for key in (node, *keys)[:-1]:
            target = target[int(key) if key.isdigit() else key]
        target[(node, *keys)[-1]] = value
    return document


@pytest.mark.parametrize("result", [fault_result, no_fault_result, two_output_result])
def test_what_the_program_wrote_does_not_contradict_itself(result: Callable, provenance: Any):
    assert contradiction_of(to_plain(identify_document(result(), provenance))) is None


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"events.0.magnitude": None, "events.0.ci95": None, "events.0.sd": None, "events.0.offset_s": None},
        {"decision": "inconclusive", "verdicts": HEALTHY, "events": []},
        {"decision": "no_fault", "verdicts": HEALTHY, "events": []},
        {"decision": "no_fault", "verdicts": HEALTHY, "events.0.beyond_tolerance": False},
        {"decision": "inconclusive", "verdicts": HEALTHY, "events.0.state": "suspected"},
        {"kind": "info"},
    ],
)
def test_what_does_not_contradict_itself(changes: dict[str, Any]):
    assert contradiction_of(changed(changes)) is None


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"decision": "perhaps"}, "decision is 'perhaps', known: fault, no_fault, inconclusive"),
        ({"decision": None}, "decision is None"),
        ({"verdicts.slow": "maybe"}, "verdicts.slow is 'maybe'"),
        ({"verdicts": {"abrupt": "fault"}}, "verdicts are on abrupt, not on"),
        ({"decision": "no_fault"}, "decision is 'no_fault', but the verdicts are fault"),
        ({"decision": "inconclusive"}, "decision is 'inconclusive', but the verdicts are fault"),
        ({"verdicts": HEALTHY}, "decision is 'fault', but the verdicts are no_fault"),
        ({"events": []}, "decision is 'fault', but 'events' holds none"),
        ({"events.0.state": "suspected"}, "decision is 'fault', but 'events' holds none"),
        ({"events.0.beyond_tolerance": False}, "decision is 'fault', but 'events' holds none"),
        ({"decision": "no_fault", "verdicts": HEALTHY}, "decision is 'no_fault', but 'events' holds 1"),
        (
            {"decision": "no_fault", "verdicts": dict.fromkeys(HEALTHY, "inconclusive"), "events": []},
            "decision is 'no_fault', but no verdict is",
        ),
        ({"events.0.kind": "slow"}, "events has a declared fault that is slow, but that verdict is 'inconclusive'"),
        ({"events.0.ci95": [4.1, 3.9]}, "events[0]: ci95 runs from 4.1 to 3.9"),
        ({"events.0.ci95": [5.0, 6.0]}, "events[0]: magnitude 4 lies outside of ci95, 5 to 6"),
        ({"events.0.magnitude": -4.0}, "events[0]: magnitude -4 lies outside of ci95, 3.9 to 4.1"),
        ({"events.0.onset_ci95": [20.0, 21.0]}, "events[0]: onset_s 13.8 lies outside of onset_ci95"),
        ({"events.0.offset_s": 3.0}, "events[0]: it ends at 3 s, before it begins at 13.8 s"),
        ({"events.0.sd": -1.0}, "events[0]: sd is -1.0"),
        ({"events.0.p_value": 1.5}, "events[0]: p_value is 1.5"),
        ({"events.0.count": 2, "events.0.times_s": [1.0]}, "events[0]: count is 2, but times_s holds 1"),
    ],
)
def test_a_contradiction_is_named(changes: dict[str, Any], said: str):
    assert str(contradiction_of(changed(changes))).startswith(said)


def test_the_command_says_it_in_one_line(bfi: Callable, provenance: Any, tmp_path: Path):
    document = to_plain(identify_document(fault_result(), provenance))
    path = tmp_path / "result.json"
    path.write_text(json.dumps({**document, "decision": "no_fault"}))
    outcome = bfi("report", path)
    assert (outcome.code, outcome.stdout, outcome.stderr.count("\n")) == (2, "", 1)
    assert "result.json: contradicts itself, decision is 'no_fault', but the verdicts are" in outcome.stderr
    assert [one.name for one in tmp_path.iterdir()] == ["result.json"]
