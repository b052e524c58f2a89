"""Altitudes and ground velocities of recorded flights of light aircraft with a Garmin."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.airdata import ground_velocity
from bfi_cli.flight.parity import record_of
from bfi_cli.flightlog import read_log

pytestmark = pytest.mark.realdata

# The times at which the altimeter was set in flight, s.
SET = {
    "g1000_c172_110812": (207, 2869),
    "gnxi_pa28_240720": (227, 9672, 9678),
    "sr22t_210623_141501": (68, 750, 2178),
    "sr22t_220417_125002": (376, 1853),
    "sr22t_220417_135002": (1026, 1106, 4053, 4241),
    "sr22t_220825_142831": (47, 1579),
}


@pytest.mark.parametrize("name", SET)
def test_an_altitude_that_was_set_by_hand_is_a_baro_altitude_and_the_pressure_altitude_has_no_step(flights, name):
    log = read_log(flights / f"{name}.h5")
    assert log.channels["altitude"].derived_from == ("baro_altitude", "baro_setting")
    climbed = log.channels["altitude_rate"].values
    for at in SET[name]:
        part = slice(*np.searchsorted(log.time_s, (at - 4.0, at + 6.0)))
        errors = {}
        for channel in ("altitude", "baro_altitude"):
            values = log.channels[channel].values[part]
            between = 0.5 * (climbed[part][1:] + climbed[part][:-1]) * np.diff(log.time_s[part])
            errors[channel] = np.nanmax(np.abs(np.diff(values) - between))
        # A click of 0.01 inHg is 2.8 m; the rate of climb is damped.
        assert errors["altitude"] < 2.0
        assert errors["baro_altitude"] > errors["altitude"] + 0.5


@pytest.mark.parametrize("name", ["g3x_homebuilt_mfd", "citation_20190305_v4_bcalt", "px4_swiss1"])
def test_an_altitude_whose_setting_is_not_turned_or_recorded_stays(flights, name):
    log = read_log(flights / f"{name}.h5")
    assert log.channels["altitude"].derived_from == ()
    assert "baro_altitude" not in log.channels


def test_a_clock_that_repeats_and_skips_seconds_makes_no_ground_speed_of_a_rocket(flights):
    path = flights.parent / "cases" / "kckn_circuit.csv"
    if not path.exists():
        pytest.skip("the folder ../shared/cases is not there")
    log = read_log(path)
    assert log.channels["velocity_north"].derived_from == ("ground_speed", "track")
    speed = np.hypot(*(record_of(log).channels[name] for name in ("velocity_north", "velocity_east")))
    assert np.nanmax(speed) < 75.0
    above = log.channels["gps_altitude"].values - log.channels["baro_altitude"].values
    assert np.nanquantile(np.abs(above), 0.99) < 12.0


@pytest.mark.parametrize("name", ["reader_samples/g3x_homebuilt.csv", "reader_samples/g1000_c172.csv"])
def test_the_track_is_the_direction_of_the_positions_from_true_north(flights, name):
    log = read_log(flights / name)
    north, east = ground_velocity(log.time_s, log.channels["latitude"].values, log.channels["longitude"].values)
    moving = np.hypot(north, east) > 20.0
    apart = np.angle(np.exp(1j * (np.arctan2(east, north) - log.channels["track"].values)))[moving]
    assert abs(np.degrees(np.nanmedian(apart))) < 1.0
