"""What physics says of a window: the faults of its outputs, how large others could be, and what would tell."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.airdata import isa_temperature
from bfi_cli.config import Config
from bfi_cli.decision import Evidence, conclude
from bfi_cli.errors import ConfigError
from bfi_cli.faults import Fault
from bfi_cli.flight import flight as room
from bfi_cli.flight.evidence import BESIDE_S, physics_evidence
from bfi_cli.flight.parity import record_of
from bfi_cli.flight.step_bounds import FRONT, INVERSION, error_of_probe
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.injection import inject

WINDOW = (400.0, 520.0)
ONSET_S = 440.0


def evidence(log: FlightLog, outputs: Collection[str] = ("tas",), window: tuple[float, float] = WINDOW) -> Evidence:
    values = {"window": {"from_s": window[0], "to_s": window[1]}, "outputs": tuple(outputs)}
    return physics_evidence(log, Config.model_validate(values))


def with_fault(log: FlightLog, shape: str, magnitude: float, channel: str = "") -> FlightLog:
    return inject(log, [Fault(shape=shape, channel=channel, magnitude=magnitude, onset_s=ONSET_S)])


def only(log: FlightLog, *names: str) -> FlightLog:
    return replace(log, channels={name: log.channels[name] for name in names})


@pytest.fixture(scope="module")
def cruise(journey: FlightLog) -> FlightLog:
    """Return the cruise of the journey alone, of which less is read."""
    return journey.window(320.0, 640.0)


@pytest.fixture(scope="module")
def healthy(cruise: FlightLog) -> Evidence:
    return evidence(cruise, ("tas", "cas", "aoa"))


def test_a_healthy_window_has_no_fault_and_a_limit_for_each_output(healthy: Evidence):
    assert healthy.source == "physics"
    assert healthy.faults == ()
    assert [one.channel for one in healthy.candidates] == ["tas", "cas", "aoa"]
    for one in healthy.candidates:
        assert (one.kind, one.shape, one.name) == ("slow", "drift", f"slow fault of {one.channel} (physics)")
        assert one.state == ("excluded" if one.effect <= one.tolerance else "not_seen")
        # The error at the window's end by a slope from an onset that the note counts.
        since_s = one.effect / one.excluded_above
        assert 0.0 < since_s <= WINDOW[1] - WINDOW[0] + 1e-6


def test_an_airspeed_is_bounded_no_better_than_the_line_that_it_comes_from(cruise: FlightLog, healthy: Evidence):
    """Relations to the other airspeeds bound what is wrong with one of them; a loss of the line they share remains."""
    tas, cas, _ = healthy.candidates
    assert cas.effect > 0.5  # m/s, of which the relation of cas to mach leaves hundredths
    without = evidence(only(cruise, *(cruise.channels.keys() - {"aoa", "normal_acc", "longitudinal_acc"})))
    assert without.candidates[0].effect > tas.effect


@pytest.mark.slow
def test_a_drift_of_an_output_is_declared_with_its_size(journey: FlightLog):
    found = evidence(with_fault(journey, "drift", 0.2, "tas"), ("tas", "cas"))
    (fault,) = found.faults
    assert (fault.fault.shape, fault.fault.channel, fault.source) == ("drift", "tas", "physics")
    assert fault.ci95[0] <= 0.2 <= fault.ci95[1]
    assert fault.onset_ci95[0] <= ONSET_S <= fault.onset_ci95[1]
    assert fault.effect == pytest.approx(0.2 * (WINDOW[1] - ONSET_S), rel=0.1)
    assert fault.beyond_tolerance is True
    assert [one.state for one in found.candidates] == ["declared"]
    assert conclude([found], ("slow",)).verdicts["slow"] == "fault"


@pytest.mark.slow
def test_ice_in_the_probe_is_a_fault_of_every_output_that_follows_from_it(journey: FlightLog):
    found = evidence(with_fault(journey, "pitot_icing", 0.004), ("tas", "cas"))
    assert [one.fault.channel for one in found.faults] == ["tas", "cas"]
    for one in found.faults:
        assert (one.fault.shape, one.among[0], one.unit) == ("pitot_icing", "pitot_icing", "1/s")
        assert one.ci95[0] <= 0.004 <= one.ci95[1]
    assert [one.state for one in found.candidates] == ["declared", "declared"]


@pytest.mark.slow
def test_what_errs_beside_the_outputs_is_told_in_a_note(journey: FlightLog):
    found = evidence(with_fault(journey, "drift", 0.2, "cas"), ("pitch",))
    assert found.faults == ()
    assert any("cas" in note for note in texts(found.notes))


@pytest.mark.slow
def test_a_held_line_has_no_size(journey: FlightLog):
    found = evidence(with_fault(journey, "pitot_blocked", 1.0), ("tas",), (400.0, 600.0))
    (fault,) = found.faults
    assert (fault.fault.shape, fault.fault.channel, fault.magnitude) == ("pitot_blocked", "tas", 1.0)
    assert np.isnan([fault.sd, *fault.ci95]).all()
    assert (fault.effect, fault.beyond_tolerance) == (None, None)


def test_a_temperature_probe_may_drift_by_what_the_air_may_change(journey: FlightLog):
    """Relations bound what is wrong with tas alone; a probe that it shares with them has a bound of its own."""
    part = record_of(journey).between(*WINDOW)
    warmth = part.channels["sat"] - isa_temperature(part.channels["altitude"])
    air = np.ptp(warmth) + FRONT + INVERSION * np.ptp(part.channels["altitude"])
    expected = 0.5 * np.max(part.channels["tas"] / part.channels["sat"]) * air
    assert error_of_probe(part, "tas") == pytest.approx(expected, rel=0.01)
    for channel, log in (("cas", journey), ("tas", only(journey, "tas", "cas", "altitude", "mach"))):
        assert error_of_probe(record_of(log).between(*WINDOW), channel) == np.inf


def test_a_calibration_of_the_aircraft_counts(cruise: FlightLog, tmp_path: Path):
    missing = str(tmp_path / "own.json")
    values = {"window": {"from_s": WINDOW[0], "to_s": WINDOW[1]}, "diagnose": {"calibration": missing}}
    with pytest.raises(ConfigError, match=r"own\.json"):
        physics_evidence(cruise, Config.model_validate(values))


def test_what_would_bound_an_output_is_named(journey: FlightLog):
    found = evidence(only(journey, "tas", "altitude", "pitch", "elevator"))
    assert (found.faults, found.candidates) == ((), ())
    (note,) = texts(found.notes)
    assert note.startswith("record ")
    assert note.endswith("would bound slow faults of tas")


def test_a_log_with_nothing_to_compare_says_nothing(journey: FlightLog):
    assert evidence(only(journey, "tas", "elevator")) == Evidence(source="physics")


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("window", [(0.0, 30.0), (400.0, 440.0)])
def test_on_the_ground_and_in_a_short_window_a_note_says_so(journey: FlightLog, window: tuple[float, float]):
    found = evidence(journey, window=window)
    assert (found.faults, found.candidates) == ((), ())
    assert texts(found.notes)[0].startswith("physics bounds no slow fault: ")


def test_a_tube_that_leaks_is_told_where_less_than_a_minute_looks_like_flight(journey: FlightLog):
    """Without an airspeed what follows may be no flight: relations and lift have no window left, a line needs none."""
    log = journey.window(320.0, 480.0)
    log = inject(log, [Fault(shape="pitot_leak", onset_s=ONSET_S - 10.0, time_constant_s=8.0)])
    found = evidence(log, window=(415.0, 470.0))
    assert [one.name for one in found.faults] == ["pitot_leak"]
    assert any("60 s of the window are in flight" in note for note in texts(found.notes))


def test_a_log_that_never_flies_says_so(journey: FlightLog):
    still = replace(
        journey,
        channels={
            name: replace(one, values=np.full_like(one.values, 280.0 if name in ("tat", "sat") else 0.0))
            for name, one in journey.channels.items()
        },
    )
    found = evidence(still)
    assert (found.faults, found.candidates) == ((), ())
    assert texts(found.notes)


@pytest.mark.slow
def test_of_a_long_log_only_what_lies_about_the_window_is_read(journey: FlightLog, monkeypatch: pytest.MonkeyPatch):
    """A second flight, hours later, changes nothing and is not looked at for defects."""
    later = replace(journey, time_s=journey.time_s + 20_000.0)
    channels = {
        name: replace(one, values=np.concatenate([one.values, later.channels[name].values]))
        for name, one in journey.channels.items()
    }
    both = replace(journey, time_s=np.concatenate([journey.time_s, later.time_s]), channels=channels)
    seen: list[float] = []
    whole = room.find_defects
    monkeypatch.setattr(room, "find_defects", lambda log: (seen.append(float(log.time_s[-1])), whole(log))[1])
    assert evidence(both).candidates[0].effect == pytest.approx(evidence(journey).candidates[0].effect, rel=0.05)
    assert max(seen) <= WINDOW[1] + BESIDE_S
