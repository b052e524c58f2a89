"""When a log flies: the same for every aircraft but for scale, and never on the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.record import frozen_array

RATE_HZ = 5.0
TAKE_OFF_S, TOUCH_DOWN_S = 300.0, 900.0


def log_of(speed: np.ndarray, name: str = "cas") -> FlightLog:
    time_s = frozen_array(np.arange(len(speed)) / RATE_HZ)
    channel = Channel(name=name, values=frozen_array(speed), unit="m/s", source=name)
    return FlightLog(path="made", time_s=time_s, channels={name: channel})


def flight(cruise: float, *, noise: float = 0.0, ground_s: float = 0.0) -> np.ndarray:
    """Return an airspeed: at rest, a take-off run of 20 s to 0.65 of the cruise, slow flight amid, a landing."""
    knots_s = [0, 280, 300, 330, 500, 520, 600, 620, 870, 900, 930, 1200 + ground_s]
    shares = [0, 0, 0.65, 1, 1, 0.75, 0.75, 1.2, 1.2, 0.65, 0, 0]
    time_s = np.arange(0.0, 1200.0 + ground_s, 1.0 / RATE_HZ)
    rng = np.random.default_rng(0)
    return cruise * np.interp(time_s, knots_s, shares) + noise * rng.standard_normal(len(time_s))


# A drone whose pitot tube is as noisy at rest as real ones are, a light aircraft, a jet.
@pytest.mark.parametrize(("cruise", "noise"), [(13.0, 1.5), (50.0, 1.0), (100.0, 0.5), (230.0, 0.5)])
@pytest.mark.parametrize("ground_s", [0.0, 3600.0])
def test_taxi_and_take_off_are_left_out_of_any_flight(cruise: float, noise: float, ground_s: float):
    (stretch,) = airborne_stretches(log_of(flight(cruise, noise=noise, ground_s=ground_s)))
    margin_s = 2.0 * cruise / 9.8
    assert TAKE_OFF_S < stretch[0] < TAKE_OFF_S + 1.5 * margin_s
    assert TOUCH_DOWN_S - 1.5 * margin_s < stretch[1] <= TOUCH_DOWN_S


def test_a_part_in_flight_flies_from_end_to_end():
    part = log_of(flight(100.0)).window(400.0, 800.0)
    assert airborne_stretches(part) == [(400.0, pytest.approx(800.0))]


@pytest.mark.parametrize("noise", [0.0, 1.5])
def test_a_log_on_the_ground_does_not_fly(noise: float):
    assert airborne_stretches(log_of(flight(0.0, noise=noise))) == []


def test_a_log_without_an_airspeed_does_not_say():
    assert airborne_stretches(log_of(flight(100.0), "pitch")) == []


def test_the_airspeed_that_may_be_faulty_is_not_asked():
    log, wrong = log_of(flight(100.0)), log_of(np.zeros(6000), "tas")
    both = replace(log, channels={**log.channels, **wrong.channels})
    assert airborne_stretches(both, suspects=["tas"]) == airborne_stretches(log)
    assert airborne_stretches(both, suspects=["cas"]) == []


def test_samples_that_are_no_numbers_end_a_stretch():
    """Where they are missing for longer than half of V / g, 5 s here."""
    speed = flight(100.0)
    speed[2000:2050] = np.nan
    first, second = airborne_stretches(log_of(speed))
    assert first[1] == pytest.approx(400.0, abs=1.5)
    assert second[0] == pytest.approx(410.0, abs=1.5)


def test_mach_is_an_airspeed():
    (stretch,) = airborne_stretches(log_of(flight(238.0) / 340.0, "mach"))
    assert stretch == pytest.approx(airborne_stretches(log_of(flight(238.0)))[0])


@pytest.mark.parametrize(
    "missing", [slice(-1, None), slice(0, 1), slice(-40, None), slice(1000, 1001), slice(1000, 1100)]
)
def test_a_missing_sample_is_no_landing(missing: slice):
    """A margin of 20 s beside it would leave out what is in the air; the grid of the phases is a tenth of V / g."""
    speed = flight(100.0)[round(400.0 * RATE_HZ) : round(800.0 * RATE_HZ)]
    speed[missing] = np.nan
    flown_s = sum(to_s - from_s for from_s, to_s in airborne_stretches(log_of(speed)))
    assert flown_s == pytest.approx(np.isfinite(speed).sum() / RATE_HZ, abs=2.1)
