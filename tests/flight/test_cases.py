"""Small logs, each of one kind that is easily answered wrongly: what `diagnose` says of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bfi_cli import diagnose
from bfi_cli.faults import parse_spec
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.injection import inject

DATA = Path(__file__).resolve().parents[2] / "data"
# By log of the project what is named and what is a deviation within its tolerance: fault, shape, size, onset, s.
STEPS: dict[str, set[tuple[str, str, str, float, float]]] = {
    "citation_bias.h5": {("declared", "tas", "bias", 4.0, 13.8)},
    "citation_clean.h5": set(),
    "px4_bias.ulg": {("deviation", "tas", "bias", -3.0, 140.0)},
    "citation_two_faults.h5": {("declared", "tas", "bias", 4.0, 13.8), ("deviation", "tas", "sine", 2.0, 6.35)},
}
SESSION_TIME = {"channel_map": {"time": "Session Time"}, "unit_map": {"Session Time": "s"}}
# By log the options of reading, and what is declared: fault, shape, onset and end, s, and how often it is lost.
CASES: dict[str, tuple[dict[str, Any], set[tuple[str, str, int, int | None, int | None]]]] = {
    "kckn_circuit.csv": ({}, set()),
    "cruise_fl350.csv": ({"unit_map": {"ground_speed": "kt"}}, set()),
    "roll_jumps.csv": ({}, set()),
    "step_60kt.csv": ({}, {("ias", "bias", 400, None, None)}),
    "iced_60s.csv": ({}, {("ias", "bias", 400, 460, None)}),
    "sky_static_blocked.csv": (SESSION_TIME, {("static_blocked", "static_blocked", 700, None, None)}),
    "sky_healthy.csv": (SESSION_TIME, set()),
    "px4_dropouts.h5": ({}, {(name, "dropout", 400, 823, 22) for name in ("tas", "ias")}),
    "px4_flat_11s.h5": ({}, {(name, "frozen", 600, 612, None) for name in ("tas", "ias")}),
}


@pytest.mark.realdata
@pytest.mark.parametrize("name", CASES)
def test_what_is_declared_of_a_small_log(flights: Path, name: str):
    path = flights.parent / "cases" / name
    if not path.exists():
        pytest.skip(f"the small logs are not at {path.parent}")
    options, expected = CASES[name]
    events = {
        (
            event.fault,
            event.shape,
            round(event.onset_s),
            None if event.offset_s is None else round(event.offset_s),
            event.count,
        )
        for event in diagnose(read_log(path, **options)).events
        if event.state == "declared" and event.fault != "q_impact"
    }
    assert events == expected


@pytest.mark.realdata
def test_a_leak_that_lands_no_aircraft_is_named_from_when_it_begins(flights: Path):
    """The airspeed is gone within 15 s of the onset, with the ground speed as it was."""
    path, onset_s = flights.parent / "cases" / "b747_healthy.h5", 310.7
    if not path.exists():
        pytest.skip(f"the small logs are not at {path.parent}")
    log = inject(read_log(path), [parse_spec(f"static_leak,time_constant_s=8,onset_s={onset_s}")])
    (event,) = diagnose(log).events
    assert (event.fault, event.state, event.offset_s) == ("static_leak", "declared", None)
    assert event.onset_s == pytest.approx(onset_s, abs=1.0)
    assert event.onset_ci95[0] <= onset_s <= event.onset_ci95[1]
    assert {"altitude", "altitude_rate", "tas", "cas", "mach"} <= {*event.channels}


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("name", STEPS)
def test_a_flight_too_short_for_windows_is_searched_as_a_whole(name: str):
    result = diagnose(read_log(DATA / name))
    states = [
        *((event.state, event) for event in result.events),
        *(("deviation", event) for event in result.deviations),
    ]
    named = {
        (state, event.fault, event.shape, round(event.magnitude or 0.0), round(event.onset_s, 2))
        for state, event in states
    }
    assert named == STEPS[name]
