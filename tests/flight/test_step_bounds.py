"""What physics leaves of steps, lags and ramps: by onset, of whichever sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.airdata import isa_temperature, speed_of_sound
from bfi_cli.config import Config
from bfi_cli.decision import STEPS, Evidence
from bfi_cli.faults import Fault
from bfi_cli.faults.shapes import SHAPES
from bfi_cli.flight.evidence import physics_evidence
from bfi_cli.flight.parity.record import Record
from bfi_cli.flight.step_bounds import error_of_probe
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.injection import inject
from bfi_cli.flightlog.record import frozen_array

WINDOW, ONSET_S = (400.0, 520.0), 440.0
# From three seconds after the window's start to three before its end.
SPANS = ((403.0, 517.0),)
AIRSPEEDS = ("tas", "cas", "mach")


def evidence(log: FlightLog, *outputs: str) -> Evidence:
    values = {"window": {"from_s": WINDOW[0], "to_s": WINDOW[1]}, "outputs": outputs or ("tas",)}
    return physics_evidence(log, Config.model_validate(values))


@pytest.fixture(scope="module")
def cruise(journey: FlightLog) -> FlightLog:
    return journey.window(320.0, 640.0)


@pytest.fixture(scope="module")
def healthy(cruise: FlightLog) -> Evidence:
    return evidence(cruise, "tas", "cas", "altitude_rate")


def test_steps_of_a_healthy_airspeed_are_bounded_at_every_onset(healthy: Evidence):
    bounds = {bound.channel: bound for bound in healthy.bounds}
    for channel in ("tas", "cas"):
        largest, spans_s = bounds[channel].over(SPANS, None)
        assert 0.0 < largest < 3.0
        assert spans_s == SPANS
        assert np.all(np.diff(bounds[channel].onsets_s) > 0.0)
    # A static pressure that jumps is a climb of any rate for a moment.
    assert "altitude_rate" not in bounds


@pytest.mark.parametrize("shape", STEPS)
def test_a_step_of_the_line_that_is_there_is_not_excluded(cruise: FlightLog, healthy: Evidence, shape: str):
    """All airspeeds follow it, so that only lift, climb and inertia tell; what they hide is what it leaves unseen."""
    bound = healthy.bounds[0]
    error = 0.9 * bound.over(((ONSET_S, ONSET_S),), None)[0]
    course, seconds = SHAPES[shape].course, max(SHAPES[shape].claimed_s, default=0.0)
    share = error * course(cruise.time_s - ONSET_S, seconds) / cruise.channel("tas").values
    channels = {name: cruise.channel(name) for name in AIRSPEEDS}
    moved = {name: replace(one, values=frozen_array(one.values * (1.0 + share))) for name, one in channels.items()}
    found = evidence(replace(cruise, channels={**cruise.channels, **moved}))
    assert found.bounds[0].over(((ONSET_S, ONSET_S),), None)[0] > error


def test_a_step_of_one_airspeed_alone_is_declared_and_nothing_is_excluded_beside_it(cruise: FlightLog):
    found = evidence(inject(cruise, [Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=ONSET_S)]))
    assert [estimate.fault.channel for estimate in found.faults] == ["tas"]
    assert found.bounds == ()


def test_a_log_whose_sensors_say_nothing_of_each_other_has_no_bound(cruise: FlightLog):
    names = ("tas", "altitude", "pitch", "elevator")
    assert evidence(replace(cruise, channels={name: cruise.channels[name] for name in names})).bounds == ()


def test_a_step_near_the_start_of_the_window_is_told_by_what_is_recorded_before_it(cruise: FlightLog):
    onset_s = WINDOW[0] + 3.0
    stepped = inject(cruise, [Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=onset_s)])
    (fault,) = evidence(stepped).faults
    assert (fault.fault.shape, fault.fault.channel) == ("bias", "tas")
    assert fault.fault.onset_s == pytest.approx(onset_s, abs=0.5)
    # A log that is the window shows one side of it alone.
    assert evidence(stepped.window(*WINDOW)).faults == ()


@pytest.mark.parametrize(("size", "is_shown"), [(4.0, True), (0.5, False)])
def test_an_oscillation_that_is_older_than_the_window_is_shown_by_a_relation(
    cruise: FlightLog, healthy: Evidence, size: float, is_shown: bool
):
    assert healthy.since_start == {}
    fault = Fault(shape="sine", channel="tas", magnitude=size, onset_s=402.0, frequency_hz=0.21)
    since_start = evidence(inject(cruise, [fault]), "tas", "cas").since_start
    assert [*since_start] == (["tas"] if is_shown else [])
    if is_shown:
        assert "at 0.21 Hz since the start" in since_start["tas"]


@pytest.mark.parametrize(("climb_m", "warmer_k"), [(0.0, 3.0), (1000.0, 13.0)])
def test_a_probe_errs_by_no_more_than_air_departs_from_the_standard_one(climb_m: float, warmer_k: float):
    """A front of 3 K; an inversion of 3.5 K in 1000 m, in which the standard atmosphere cools by 6.5."""
    time_s = np.arange(60.0)
    height = np.linspace(1000.0, 1000.0 + climb_m, 60)
    sat, tas = isa_temperature(height) + 5.0, np.full(60, 100.0)
    channels = {"altitude": height, "tas": tas, "sat": sat, "mach": tas / speed_of_sound(sat)}
    part = Record(time_s=time_s, channels=channels, gained=None, airspeed="tas")
    coldest = float(sat.min())
    assert error_of_probe(part, "tas") == pytest.approx(0.5 * 100.0 / coldest * warmer_k, rel=1e-6)
    assert error_of_probe(part, "cas") == np.inf
