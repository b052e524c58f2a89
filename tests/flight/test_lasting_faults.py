"""A fault that lasts to the end of the log is one event: what it leaves in later windows is no fault of another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flight import DiagnoseResult, diagnose_flight
from bfi_cli.flight.flight import flight_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array

ONSET_S = 350.0
# A log whose only airspeed is the true one, without a scan for steps.
LACKING = ("cas", "mach", "tat", "sat", "elevator")
TURNED = float(np.radians(2.4))
FAULTS = (
    Fault(shape="ramp_hold", channel="aoa", magnitude=TURNED, duration_s=60.0, onset_s=ONSET_S),
    Fault(shape="ramp_hold", channel="tas", magnitude=12.0, duration_s=60.0, onset_s=ONSET_S),
)


@pytest.fixture(scope="module")
def bare(journey: FlightLog) -> FlightLog:
    return replace(journey, channels={name: one for name, one in journey.channels.items() if name not in LACKING})


def without_elevator(log: FlightLog, *others: str) -> FlightLog:
    """Return the log without the input that the scan for steps, which takes its time, asks for."""
    lacking = ("elevator", *others)
    return replace(log, channels={name: one for name, one in log.channels.items() if name not in lacking})


def diagnosed(log: FlightLog, *faults: Fault) -> DiagnoseResult:
    return diagnose_flight(inject(log, faults) if faults else log, Config())


def plus(log: FlightLog, name: str, course: Callable[[np.ndarray], np.ndarray]) -> FlightLog:
    """Return the log with an error of a channel."""
    channel = log.channels[name]
    faulty = replace(channel, values=frozen_array(channel.values + course(log.time_s)))
    return replace(log, channels={**log.channels, name: faulty})


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda one: one.channel)
def test_a_ramp_that_stays_is_one_event(bare: FlightLog, fault: Fault) -> None:
    declared = [one for one in diagnosed(bare.window(240.0, 560.0), fault).events if one.state == "declared"]
    assert [one.fault for one in declared] == [fault.channel]
    assert declared[0].onset_s == pytest.approx(ONSET_S, abs=6.0)
    assert declared[0].offset_s is None


@pytest.mark.slow
def test_the_angle_of_zero_lift_is_from_before_a_vane_fails(bare: FlightLog) -> None:
    late = replace(FAULTS[0], onset_s=560.0)
    healthy, faulty = diagnosed(bare), diagnosed(bare, late)
    assert [one.fault for one in faulty.events if one.state == "declared"] == ["aoa"]
    assert healthy.zero_lift_rad is not None
    assert faulty.zero_lift_rad == pytest.approx(healthy.zero_lift_rad, abs=np.radians(0.2))


@pytest.mark.slow
def test_a_drift_to_the_end_is_told_from_its_beginning(journey: FlightLog) -> None:
    log = without_elevator(journey)
    (event,) = diagnosed(plus(log, "tas", lambda t: 0.03 * np.maximum(t - ONSET_S, 0.0))).events
    assert (event.fault, event.state, event.shape) == ("tas", "declared", "drift")
    assert event.onset_s == pytest.approx(ONSET_S, abs=5.0)
    assert event.magnitude == pytest.approx(0.03, rel=0.05)
    assert event.seen_until_s > ONSET_S + 200.0


@pytest.mark.slow
def test_a_step_that_goes_back_ends_there(journey: FlightLog) -> None:
    log = without_elevator(journey)
    (event,) = diagnosed(plus(log, "tas", lambda t: 5.0 * ((t >= ONSET_S) & (t < 550.0)))).events
    assert (event.fault, event.shape) == ("tas", "bias")
    assert event.onset_s == pytest.approx(ONSET_S, abs=1.5)
    assert event.offset_s == pytest.approx(550.0, abs=1.5)


@pytest.mark.slow
def test_an_airspeed_that_is_lost_in_flight_is_said(journey: FlightLog) -> None:
    """The rest of the flight, its descent among it, is neither judged nor taken for a stay on the ground."""
    failed = without_elevator(journey, "sat", "tat")
    for name in ("tas", "cas", "mach"):
        recorded = journey.channels[name].values
        failed = plus(failed, name, lambda t, recorded=recorded: np.where(t > 600.0, -0.97, 0.0) * recorded)
    answer = diagnosed(failed)
    assert [one.phase for one in answer.phases if one.to_s > 590.0 and one.from_s < 700.0] == ["cruise", "no airspeed"]
    assert any("no airspeed shows the flight that other channels show" in one for one in answer.missing)


@pytest.mark.slow
def test_an_airspeed_that_alone_is_too_slow_for_flight_is_named(journey: FlightLog) -> None:
    """What is compared with it is no second fault."""
    recorded = journey.channels["cas"].values
    failed = plus(without_elevator(journey), "cas", lambda t: np.where(t >= 500.0, -0.8, 0.0) * recorded)
    answer = diagnose_flight(failed, merge(Config(), {"window.from_s": 440.0, "window.to_s": 580.0}))
    (event,) = [one for one in answer.events if "cas" in one.channels]
    assert (event.fault, event.among, event.state, event.stages[0]) == ("cas", ("cas",), "declared", "sensors")
    assert event.onset_s == pytest.approx(500.0, abs=3.0)
    assert event.effect["cas"] == pytest.approx(0.8 * np.median(recorded[journey.time_s > 500.0]), rel=0.2)


def test_the_phases_of_a_diagnosis_are_those_of_the_log(journey: FlightLog) -> None:
    """A tube that is blocked in the last descent once made the landing roll a cruise."""
    few = replace(journey, channels={name: journey.channels[name] for name in ("tas", "altitude", "pitch")})
    blocked = inject(few, [Fault(shape="pitot_blocked", onset_s=600.0)])
    assert flight_of(blocked, Config()).phases == phases_of(blocked)


@pytest.mark.slow
def test_a_spike_of_the_altitude_on_the_ground_is_no_loss_of_airspeed(journey: FlightLog) -> None:
    higher = plus(without_elevator(journey), "altitude", lambda t: np.where(t < 2.0, 0.0, 500.0))
    answer = diagnosed(plus(higher, "altitude", lambda t: np.where(np.abs(t - 5.0) < 0.2, 2500.0, 0.0)))
    assert not answer.events
    assert answer.phases[0].phase == "ground"


@pytest.mark.slow
def test_a_second_fault_is_named_beside_a_computation_that_is_off(journey: FlightLog) -> None:
    off = plus(without_elevator(journey), "tas", lambda t: 5.0 * (t >= 250.0))
    answer = diagnosed(off, Fault(shape="pitot_icing", magnitude=0.001, onset_s=520.0))
    assert {one.fault for one in answer.events if one.state == "declared"} == {"tas", "pitot_icing"}


@pytest.mark.slow
def test_a_fault_found_again_is_described_once(journey: FlightLog) -> None:
    """A window of the second fault is not moved back to before the first."""
    rate = Fault(shape="drift", channel="altitude_rate", magnitude=0.1, onset_s=400.0)
    vane = Fault(shape="drift", channel="aoa", magnitude=float(np.radians(0.1)), onset_s=490.0)
    answer = diagnosed(without_elevator(journey), rate, vane)
    onsets = {one.fault: one.onset_s for one in answer.events if one.state == "declared"}
    assert onsets == {"altitude_rate": pytest.approx(400.0, abs=5.0), "aoa": pytest.approx(490.0, abs=5.0)}


@pytest.mark.slow
def test_a_fault_before_a_hold_is_an_event_of_its_own(journey: FlightLog) -> None:
    ice = Fault(shape="pitot_icing", magnitude=0.001, onset_s=480.0)
    answer = diagnosed(without_elevator(journey), ice, Fault(shape="pitot_blocked", onset_s=740.0))
    # What has no size comes before what has one.
    assert [one.fault for one in answer.events if one.state == "declared"] == ["pitot_blocked", "pitot_icing"]


@pytest.mark.slow
def test_what_is_small_is_a_deviation_and_hides_no_fault(journey: FlightLog) -> None:
    off = plus(without_elevator(journey), "tas", lambda t: 0.4 * (t >= 500.0))
    healthy = diagnosed(off)
    assert healthy.decision != "fault"
    assert not healthy.events
    assert [(one.fault, one.beyond_tolerance) for one in healthy.deviations] == [("tas", False)]
    answer = diagnosed(off, Fault(shape="pitot_icing", magnitude=0.002, onset_s=480.0))
    assert [(one.fault, one.state, one.beyond_tolerance) for one in answer.events] == [
        ("pitot_icing", "declared", True)
    ]
    assert answer.events[0].onset_s == pytest.approx(480.0, abs=6.0)
