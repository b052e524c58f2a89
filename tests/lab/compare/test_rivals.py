"""The rules of autopilots and the plain detectors on logs: what each declares, and when."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from bfi_cli.config import Config
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.lab.compare import PEERS, ComparisonResult, compare
from bfi_cli.lab.compare.document import compare_content, compare_document
from bfi_cli.serialization import provenance

TIME_S = np.arange(1200) / 10.0
RULES = ("px4", "px4-all", "ardupilot")


def circling(error: np.ndarray | float, **more: np.ndarray) -> FlightLog:
    """Return a log of two minutes of circles at 20 m/s in a wind of 5 m/s, with an error of the airspeed."""
    rng = np.random.default_rng(0)
    heading = 0.1 * TIME_S
    values = {
        "tas": 20.0 + error + 0.05 * rng.standard_normal(1200),
        "velocity_north": 20.0 * np.cos(heading) + 3.0,
        "velocity_east": 20.0 * np.sin(heading) - 4.0,
        **more,
    }
    channels = {name: Channel(name=name, values=frozen_array(x), unit="m/s", source=name) for name, x in values.items()}
    return FlightLog(path="circles.h5", time_s=frozen_array(TIME_S), channels=channels)


def declared(result: ComparisonResult) -> dict[str, float | None]:
    statements = {one.method: one.statement for one in result.outcomes}
    return {
        name: None if said is None or not said.suspects else said.suspects[0].declared_s
        for name, said in statements.items()
    }


def tripped(result: ComparisonResult) -> dict[str, str | None]:
    """Return the check that each rule names."""
    statements = {one.method: one.statement for one in result.outcomes}
    return {name: said.suspects[0].name for name, said in statements.items() if said is not None and said.suspects}


def run(log: FlightLog, *names: str) -> ComparisonResult:
    return compare(log, None, Config(), {name: PEERS[name] for name in names})


def test_a_healthy_airspeed_is_trusted():
    assert declared(run(circling(0.0), *RULES)) == dict.fromkeys(RULES)


def test_a_large_step_is_declared_by_the_innovation():
    """12 m/s: 7 beyond PX4's 5 fill 10 m in 1.5 s, and 1.0 s pass before the sensor is given up."""
    result = run(circling(np.where(TIME_S >= 80.0, -12.0, 0.0)), *RULES)
    assert tripped(result) == {"px4": "innovation", "px4-all": "innovation", "ardupilot": "wind gate"}
    found = declared(result)
    assert found["px4"] == pytest.approx(82.5, abs=0.25)
    assert found["px4-all"] == found["px4"]
    assert found["ardupilot"] is not None
    assert found["ardupilot"] > 80.0 + 22 * 0.2


def test_a_frozen_airspeed_is_stuck_after_two_seconds():
    log = circling(0.0)
    values = log.channels["tas"].values.copy()
    values[800:] = values[800]
    result = run(circling(0.0, tas=values), "px4")
    assert declared(result) == {"px4": pytest.approx(82.1)}
    assert tripped(result) == {"px4": "stuck"}
    content = compare_content(compare_document(result, provenance(log_sha256="")))
    assert "tas: stuck" in content.tables[0].rows[0]


def test_a_rule_without_the_ground_velocity_says_what_it_lacks():
    log = circling(0.0)
    alone = FlightLog(path="x.h5", time_s=log.time_s, channels={"tas": log.channels["tas"]})
    result = run(alone, *RULES)
    assert declared(result) == dict.fromkeys(RULES)
    assert [one.reason for one in result.outcomes][:2] == [None, None]
    assert "needs velocity_north, velocity_east" in str(result.outcomes[2].reason)


def test_change_points_without_their_package_are_a_reason(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ruptures", None)
    (one,) = run(circling(0.0), "ruptures").outcomes
    assert one.statement is None
    assert "pip install bfi-cli[compare]" in str(one.reason)
