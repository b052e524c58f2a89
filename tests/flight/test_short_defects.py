"""Dropouts of one channel are an event with count and times, and no other analysis takes them for a fault."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_flights import made_flight
from noted import texts

from bfi_cli.flight import diagnose_content
from bfi_cli.flight.exact_events import events_of_defects, notes_on_defects
from bfi_cli.flight.parity import Finding
from bfi_cli.flightlog import FlightLog, write_log
from bfi_cli.flightlog.defects import Defect
from bfi_cli.flightlog.record import frozen_array

AT_S = (420.0, 505.0)
SPIKES_S = (300.0, 400.2, 500.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, journey: FlightLog) -> Path:
    folder = tmp_path_factory.mktemp("defects")
    names = ("elevator", "velocity_north", "velocity_east", "sat")
    tas = journey.channels["tas"].values.copy()
    for at_s in AT_S:
        tas[(journey.time_s >= at_s) & (journey.time_s < at_s + 2.0)] = 0.0
    channels = {name: one for name, one in journey.channels.items() if name not in names}
    channels["tas"] = replace(channels["tas"], values=frozen_array(tas))
    write_log(replace(journey, channels=channels), folder / "dropouts.h5")
    return folder


@pytest.fixture(scope="module")
def known() -> dict[str, Any]:
    return {}


@pytest.fixture
def document(folder: Path, bfi: Callable, known: dict[str, Any]) -> dict[str, Any]:
    """Return what is said of three minutes with two dropouts, asked once."""
    if not known:
        part = ("--from", 390, "--to", 570, "--workers", 1, "--json", "--series")
        outcome = bfi("diagnose", folder / "dropouts.h5", *part)
        assert outcome.code == 0, outcome.stderr
        known.update(json.loads(outcome.stdout))
    return known


@pytest.mark.slow
def test_dropouts_are_one_event_and_the_only_one(document: dict[str, Any]):
    [event] = document["events"]
    assert (event["fault"], event["shape"], event["count"], event["kind"]) == ("tas", "dropout", 2, "abrupt")
    np.testing.assert_allclose(event["times_s"], AT_S, atol=0.2)
    assert event["duration_s"] == pytest.approx(4.0, abs=0.1)
    assert event["effect"]["tas"] == pytest.approx(-105.0, abs=10.0)
    assert event["beyond_tolerance"] is True
    assert document["decision"] == "fault"
    assert document["verdicts"]["abrupt"] == "fault"


@pytest.mark.slow
def test_what_was_left_out_is_said_and_shown(document: dict[str, Any]):
    said = [note for note in texts(document["notes"]) if "left out of the other analyses" in note]
    assert said == ["'tas' drops out 2 times, 4 s in all, first at 420 s; left out of the other analyses"]
    time_s, tas = (
        np.array(values, dtype=float)
        for values in (document["series"]["time_s"], document["series"]["measured"]["tas"])
    )
    assert np.nanmin(tas[(time_s > AT_S[0]) & (time_s < AT_S[0] + 2.0)]) < 1.0


@pytest.mark.slow
def test_the_report_counts_them(document: dict[str, Any]):
    content = diagnose_content(document)
    assert "true airspeed drops out 2 times from 420 to 507 s, 4 s in all" in content.verdict
    [table] = [one for one in content.tables if one.name == "events"]
    assert "dropout, 2 in all" in table.rows[0]
    lanes = [lane for panel in content.drawings[0].panels for lane in panel.lanes if lane.label == "event"]
    assert [len(lane.blocks) for lane in lanes] == [2]


def test_a_defect_of_a_channel_that_is_not_stored_has_no_figure_of_its_own(document: dict[str, Any]):
    [event] = document["events"]
    of_roll = {**event, "fault": "roll", "among": ["roll"], "channels": ["roll"], "effect": {"roll": 3.0}}
    content = diagnose_content({**document, "events": [of_roll]})
    assert all(drawing.panels for drawing in content.drawings)
    assert "event_1" in {one.name for one in diagnose_content(document).drawings}
    assert "event_1" not in {one.name for one in content.drawings}


def test_within_the_tolerance_they_are_no_fault(document: dict[str, Any]):
    [event] = document["events"]
    small = {**document, "decision": "inconclusive", "events": [], "deviations": [{**event, "beyond_tolerance": False}]}
    content = diagnose_content(small)
    assert content.heading == "Deviation"
    assert content.verdict.startswith("true airspeed drops out 2 times ")
    assert ", within its tolerance" in content.verdict


@pytest.mark.slow
def test_info_names_them(folder: Path, bfi: Callable):
    outcome = bfi("info", folder / "dropouts.h5", "--json")
    [one] = json.loads(outcome.stdout)["defects"]
    assert (one["channel"], one["shape"], one["count"]) == ("tas", "dropout", 2)
    assert "'tas' drops out 2 times, 4 s in all, first at 420 s" in bfi("info", folder / "dropouts.h5").stdout


@pytest.mark.parametrize(("doubt", "left"), [("", (300.0, 500.0)), ("the aircraft may have landed", SPIKES_S)])
def test_where_a_held_line_lets_go_its_channels_have_no_defect(doubt: str, left: tuple[float, ...]):
    """A port that is freed in a climb makes a spike of the rate of climb; only a certain hold explains it."""
    hold = Finding(
        fault="static_blocked",
        among=("static_blocked",),
        channels=("altitude", "altitude_rate"),
        stage="holds",
        shape="static_blocked",
        onset_s=340.0,
        onset_ci95=(338.0, 341.0),
        offset_s=400.0,
        statistic=2.0,
        threshold=1.0,
        doubt=doubt,
    )
    spikes = Defect(
        channel="altitude",
        unit="m",
        shape="spikes",
        times_s=SPIKES_S,
        durations_s=(0.2,) * 3,
        largest=90.0,
        statistic=3.0,
        hidden=tuple((time_s - 1.0, time_s + 1.0) for time_s in SPIKES_S),
    )
    flight: Any = SimpleNamespace(
        defects=(spikes,),
        held=SimpleNamespace(findings=(hold,)),
        tolerances={"altitude": 10.0},
        log=made_flight(seconds=30.0),
        from_s=0.0,
        to_s=600.0,
    )
    (event,) = events_of_defects(flight)
    assert (event.times_s, event.count) == (left, len(left))
    assert len(notes_on_defects(flight)) == 1  # the samples are left out in any case
