"""The first screens of the stored answers of every kind: rows, first line, and what no first screen says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from screens import check_screen, screen

from bfi_cli.detection.report import detect_screen
from bfi_cli.detection.result import DetectResult
from bfi_cli.faults.shapes import SHAPES
from bfi_cli.flight.first_screen import diagnose_screen
from bfi_cli.flight.result import DiagnoseResult
from bfi_cli.model.onset.report import onset_from_document, onset_screen
from bfi_cli.model.report import CHANGES, READINGS, identify_screen
from bfi_cli.model.result import identify_from_document
from bfi_cli.quantities.channels import unit_of
from bfi_cli.quantities.text import SI
from bfi_cli.report.content import ReportContent
from bfi_cli.report.first_screen import Screen, error_in_words
from bfi_cli.serialization import SCHEMA, from_plain, provenance, to_plain

ANSWERS = Path(__file__).parents[1] / "lock" / "answers"
KINDS = ("identify", "start_time", "detect", "diagnose")
STORED = [path for kind in KINDS for path in sorted(ANSWERS.glob(f"{kind}_*.json"))]
# Of a flight's courses, which a stored answer leaves out.
NO_COURSES: dict[str, Any] = {
    **{name: [] for name in ("time_s", "strips", "limit_courses", "courses")},
    **{name: {} for name in ("measured", "corrected", "units")},
}
PROFILE = ("shape", "channel", "frequency_hz", "threshold", "unit", "onset_s", "statistic", "magnitude", "sd")


def screen_of(document: dict[str, Any]) -> Screen:
    match document["kind"]:
        case "identify":
            signals = {name: [0.0, 0.0] for name in (*CHANGES, *READINGS)}
            outputs = [{"channel": name, "unit": unit_of(name), **signals} for name in document["model"]["outputs"]]
            series = {"time_s": [0.0, 1.0], "inputs": {}, "input_units": {}, "outputs": outputs}
            return identify_screen(identify_from_document({**document, "series": series})[0], SI)
        case "start-time":
            empty = {"profile": {key: [] for key in PROFILE}, "series": {"time_s": [], "outputs": []}}
            return onset_screen(onset_from_document({**document, **empty}), SI)
        case "detect":
            return detect_screen(from_plain(DetectResult, {**document, "time_s": [], "series": []}, where="stored"), SI)
        case _:
            return diagnose_screen(from_plain(DiagnoseResult, {**document, **NO_COURSES}, where="stored"), SI)


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_answer_is_one_screen(path: Path):
    stored = {"schema": SCHEMA, "provenance": to_plain(provenance(log_sha256=""))}
    document = json.loads(path.read_text("utf-8"))["document"] | stored
    made = screen_of(document)
    content = ReportContent(category="", title="", heading=made.head, verdict=made.text, tone=None, screen=made)
    lines = screen(content, 100)
    check_screen(lines, content)
    assert made.text == document["headline"]["text"]
    assert (made.state == "fault") == (document["decision"] == "fault")
    assert not made.text.endswith(".")


def stored_flight(name: str, **changes: Any) -> Screen:
    document = json.loads((ANSWERS / f"diagnose_{name}.json").read_text("utf-8"))["document"]
    return screen_of({**document, **{key: make(document) for key, make in changes.items()}})


def test_the_state_of_a_flight_is_that_of_the_largest_that_it_shows():
    nothing = {"events": lambda _: [], "decision": lambda _: "inconclusive"}
    assert stored_flight("drift").state == "fault"
    suspected = stored_flight(
        "drift",
        events=lambda one: [{**one["events"][0], "state": "suspected", "note": "rough air"}],
        decision=lambda _: "inconclusive",
    )
    assert suspected.state == "suspected"
    assert suspected.text.endswith(": rough air")
    small = stored_flight("drift", **nothing, deviations=lambda one: one["events"])
    assert (small.state, small.channel) == ("deviation", "tas")
    assert ", within its tolerance of 3.3 m/s" in small.text
    assert stored_flight("healthy").state == "no_fault_found"
    assert stored_flight("ulog").state == "deviation"
    assert stored_flight("ulog", deviations=lambda _: []).state == "cannot_tell"


def test_a_blocked_line_names_what_is_wrong_and_what_to_look_at():
    lines = stored_flight("blocked").lines
    assert lines["Wrong from then on"] == ("calibrated airspeed, Mach number, static air temperature, true airspeed",)
    assert lines["Look at"] == ("pitot tube, drain, heater, line",)
    assert any("the fault there masks others" in part for part in lines["Not checked"])


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_has_a_sentence_with_its_size_and_without(shape: str):
    sized, between = error_in_words(shape, "tas", 213.0, (43.0, 384.0), SI.of("Pa"), frequency_hz=0.2, seconds=17.0)
    assert "21" in sized
    assert between == "43 to 384"
    for said in (sized, error_in_words(shape, "tas", None, None, SI.of("Pa"))[0]):
        assert len(said.split()) > 1
        assert said == said.strip()
