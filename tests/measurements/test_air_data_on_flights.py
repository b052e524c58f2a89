"""Air data on recorded flights: the equations against the air-data computer, what bounds it, and trapped lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.airdata import air_data_of, static_temperature, true_airspeed
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.derived import with_derived

pytestmark = pytest.mark.realdata

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")


@pytest.fixture(scope="module")
def flight(flights: Path) -> Callable[[str], FlightLog]:
    """Return a function that reads a flight; both are airborne between 1000 and 3800 s."""
    return lambda name: read_log(flights / name)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_equations_are_those_of_the_air_data_computer(flight, name):
    """To a few quanta of the airspeed (0.032 m/s) and half a quantum of the temperature (0.25 K)."""
    log = flight(name).window(1000.0, 3800.0)
    air = air_data_of({one: log.channel(one).values for one in ("altitude", "cas", "tat")})
    tas = log.channel("tas").values - true_airspeed(air.mach, air.tat)
    sat = log.channel("sat").values - static_temperature(air.tat, air.mach)
    assert abs(np.median(tas)) < 0.2
    assert np.std(tas) < 0.12
    assert abs(np.median(sat)) < 0.05
    assert np.std(sat) < 0.125
    assert np.abs(log.channel("mach").values - air.mach).max() < 0.004


@pytest.mark.parametrize("name", FLIGHTS)
def test_lift_and_the_ground_bound_the_airspeed_of_two_minutes(flight, name):
    log = flight(name)
    span = {"from_s": 3000.0, "to_s": 3120.0}
    made = with_derived(log, ["lift_speed"], **span).window(3000.0, 3120.0)
    error = made.channel("lift_speed").values - made.channel("tas").values
    assert np.std(error) < 1.0
    assert "with an angle of zero lift of -" in texts(made.notes)[-1]
    if {"latitude", "longitude"} <= log.channels.keys():
        made = with_derived(log, ["ground_airspeed"], **span).window(3000.0, 3120.0)
        assert np.std(made.channel("ground_airspeed").values - made.channel("tas").values) < 1.2


@pytest.mark.parametrize("name", FLIGHTS)
def test_attitude_and_acceleration_follow_the_flight(flight, name):
    log = with_derived(flight(name), ["kinematic_acc", "climb_angle"]).window(2000.0, 3000.0)
    tas, rise = log.channel("tas").values, log.channel("altitude_rate").values
    error = np.degrees(log.channel("climb_angle").values - np.arcsin(rise / tas))
    assert np.std(error) < 0.6
    gained = np.gradient(tas, log.time_s)
    assert np.corrcoef(log.channel("kinematic_acc").values, gained)[0, 1] > 0.6


@pytest.mark.parametrize("name", FLIGHTS)
@pytest.mark.parametrize("onset_s", [1500.0, 2500.0, 3300.0])
def test_a_trapped_line_is_still_behind_the_recorder(flight, name, onset_s):
    log = flight(name)
    assert log.filters
    for shape, pressure in (("pitot_blocked", "p_total"), ("static_blocked", "p_static")):
        faulty = inject(log, [Fault(shape=shape, onset_s=onset_s, offset_s=onset_s + 80.0)])
        after = with_derived(faulty, [pressure]).window(onset_s + 3.0, onset_s + 77.0).channel(pressure).values
        before = with_derived(log, [pressure]).window(onset_s + 3.0, onset_s + 77.0).channel(pressure).values
        assert np.ptp(after) < 1e-3
        assert np.ptp(before) > 20.0
