"""Lift, attitude, acceleration and ground velocity: vector algebra, exact recovery, published lengths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize
from scipy.spatial.transform import Rotation

from bfi_cli.airdata import (
    G,
    climb_angle,
    constant_wind,
    ground_velocity,
    impact_pressure_of_mach,
    isa_temperature,
    kinematic_acceleration,
    lift_speed,
    mach_of_tas,
    pressure_at,
    total_temperature,
    zero_lift_angle,
)

N = 400
T = np.arange(N) * 0.5
RNG = np.random.default_rng(5)
AOA, PITCH, ROLL = (RNG.uniform(-limit, limit, N) for limit in (0.3, 0.8, 1.2))
AHEAD = np.column_stack([np.cos(AOA), np.zeros(N), np.sin(AOA)])  # of the motion through the air, body axes, z down
ATTITUDE = Rotation.from_euler("ZYX", np.column_stack([np.zeros(N), PITCH, ROLL]))


def test_the_acceleration_is_that_of_specific_force_and_gravity_along_the_motion():
    longitudinal, normal = RNG.uniform(-3.0, 3.0, (2, N))
    gravity = ATTITUDE.inv().apply([0.0, 0.0, G])
    force = np.column_stack([longitudinal, np.zeros(N), -(normal + G)])
    expected = np.sum((force + gravity) * AHEAD, axis=1)
    made = kinematic_acceleration(longitudinal, normal, AOA, PITCH, ROLL)
    np.testing.assert_allclose(made, expected, rtol=0, atol=1e-12)


def test_the_climb_angle_is_that_of_the_motion_turned_into_the_earths_axes():
    np.testing.assert_allclose(np.sin(climb_angle(AOA, PITCH, ROLL)), -ATTITUDE.apply(AHEAD)[:, 2], atol=1e-12)
    np.testing.assert_allclose(climb_angle(0.0 * AOA, PITCH, ROLL), PITCH, atol=1e-12)


def flight(zero_lift: float = -0.02):
    """Return normal_acc, aoa, q_impact, tas, altitude of a flight whose lift grows as the angle of attack."""
    altitude, tas = 2000.0 + 5.0 * T, 100.0 + 20.0 * np.sin(0.05 * T)
    sat = isa_temperature(altitude) + 8.0
    q_impact = 0.5 * pressure_at(altitude) / (287.05287 * sat) * tas**2
    normal_acc = 2.0 * np.sin(0.3 * T)
    return normal_acc, zero_lift + (normal_acc + G) / (0.02 * q_impact), q_impact, tas, altitude, sat


def test_the_angle_of_zero_lift_is_recovered_exactly():
    normal_acc, aoa, q_impact, *_ = flight(zero_lift=-0.02)
    assert zero_lift_angle(normal_acc, aoa, q_impact) == pytest.approx(-0.02, abs=1e-12)


def test_missing_and_outlying_samples_do_not_move_it():
    normal_acc, aoa, q_impact, *_ = flight(zero_lift=-0.02)
    rng = np.random.default_rng(0)
    aoa = aoa + 1e-4 * rng.standard_normal(N)
    clean = zero_lift_angle(normal_acc, aoa, q_impact)
    spoilt = normal_acc.copy()
    spoilt[:8], spoilt[50] = 15.0, np.nan  # flaps, and a gap
    assert clean == pytest.approx(-0.02, abs=1e-3)
    assert zero_lift_angle(spoilt, aoa, q_impact) == pytest.approx(clean, abs=1e-3)


@pytest.mark.parametrize(("off", "counts"), [(4.5, True), (6.0, False)])
def test_samples_beyond_three_and_a_half_robust_standard_deviations_are_left_out_and_no_others(off, *, counts):
    """Errors of 1 and -1, of which the median is 1: the bound is 3.5 x 1.4826 of that."""
    n, slope, zero_lift = 402, 0.02, -0.02
    aoa = np.tile(np.linspace(0.0, 0.1, n // 2), 2)
    error = 1e-5 * np.repeat([1.0, -1.0], n // 2)
    error[n // 2 - 1] = 1e-5 * off
    q_impact = np.full(n, 6000.0)
    q_impact[10] = np.nan  # a gap, which is no reason to keep or to leave out others
    lift = slope * (aoa - zero_lift) + error
    kept = np.isfinite(q_impact)
    kept[n // 2 - 1] = counts
    tilt, level = np.polyfit(aoa[kept], lift[kept], 1)
    assert zero_lift_angle(lift * 6000.0 - G, aoa, q_impact) == pytest.approx(-level / tilt, abs=1e-9)


@pytest.mark.parametrize("spoil", ["still", "noise", "turned over", "no samples", "no airspeed"])
def test_a_lift_that_does_not_follow_the_angle_tells_no_angle(spoil):
    normal_acc, aoa, q_impact, *_ = flight()
    rng = np.random.default_rng(1)
    spoilt = {
        "still": (normal_acc * 0.0, np.full(N, 0.05), q_impact),
        "noise": (normal_acc, rng.normal(0.05, 0.05, N), q_impact),
        "turned over": (normal_acc, -aoa, q_impact),
        "no samples": (normal_acc, np.full(N, np.nan), q_impact),
        "no airspeed": (normal_acc, aoa, 0.0 * q_impact),
    }[spoil]
    with pytest.raises(ValueError, match=r"the angle of zero lift needs a correlation of 0\.9"):
        zero_lift_angle(*spoilt)


def test_where_lift_is_proportional_to_the_dynamic_pressure_the_lift_speed_is_the_airspeed():
    normal_acc, aoa, _, tas, altitude, sat = flight(zero_lift=-0.02)
    shape = lift_speed(normal_acc, aoa, pressure_at(altitude), sat, zero_lift=-0.02)
    np.testing.assert_allclose(shape / shape[0], tas / tas[0], rtol=1e-12)


def test_without_lift_there_is_no_lift_speed():
    made = lift_speed(np.array([-12.0, 0.0, 0.0]), np.array([0.1, -0.1, 0.1]), np.full(3, 9e4), 280.0, zero_lift=0.0)
    assert np.isnan(made).tolist() == [True, True, False]


def test_the_wind_of_a_circling_flight_is_recovered_exactly():
    heading, wind = 0.05 * T, np.array([8.0, -5.0])
    north, east = 30.0 * np.cos(heading) + wind[0], 30.0 * np.sin(heading) + wind[1]
    horizontal = np.full(N, 30.0)
    horizontal[7] = np.nan
    # The prior of 50 m/s pulls by 1 / (400 / 2 * 50^2) of the wind.
    assert constant_wind(north, east, horizontal) == pytest.approx(wind, abs=5e-5)


def test_a_wind_that_few_samples_tell_is_the_likeliest_with_its_prior():
    """Errors of 1 m/s beside a wind of 50 m/s: a weighted least squares problem, solved by another solver."""
    north, east, speed = np.array([45.0, 4.0, 30.0]), np.array([-3.0, 33.0, 28.0]), np.array([36.0, 38.0, 40.0])

    def cost(wind):
        misfit = speed - np.hypot(north - wind[0], east - wind[1])
        return np.sum(misfit**2) + np.sum(wind**2) / 50.0**2

    expected = optimize.minimize(cost, [5.0, -5.0], tol=1e-14).x
    assert constant_wind(north, east, speed) == pytest.approx(expected, abs=1e-5)
    free = optimize.minimize(lambda wind: cost(wind) - np.sum(wind**2) / 50.0**2, expected, tol=1e-14).x
    assert np.abs(expected - free).max() > 1e-3


def test_a_flight_straight_ahead_shows_the_wind_along_its_track_only():
    north, east = np.full(N, 60.0), np.zeros(N)
    assert constant_wind(north, east, np.full(N, 50.0)) == pytest.approx((10.0, 0.0), abs=1e-3)
    with pytest.raises(ValueError, match="got no sample with both"):
        constant_wind(north, east, np.full(N, np.nan))


def test_the_lengths_of_a_degree_on_the_ellipsoid():
    """At 45 degrees 111 131.7 m of latitude and 78 846.8 m of longitude (NIMA TR 8350.2, WGS 84)."""
    degree = np.pi / 180.0
    time_s = np.array([0.0, 1.0, 2.0])
    still = np.full(3, 45.0 * degree)
    north, _ = ground_velocity(time_s, still + 1e-3 * degree * (time_s - 1.0), still)
    _, east = ground_velocity(time_s, still, np.pi + 1e-3 * degree * (time_s - 1.0))
    assert north[1] == pytest.approx(111.1317, abs=1e-3)
    assert east[1] == pytest.approx(78.8468, abs=1e-3)


def test_crossing_the_date_line_is_no_speed():
    time_s = np.arange(5.0)
    longitude = (np.pi - 1e-6 + 1e-6 * time_s + np.pi) % (2.0 * np.pi) - np.pi
    _, east = ground_velocity(time_s, np.zeros(5), longitude)
    np.testing.assert_allclose(east, 6.378137, rtol=1e-6)


def positions(time_s, speed=60.0, turn=0.02):
    """Return latitude and longitude of a steady turn near the equator, and its velocity to the north and east."""
    north, east = speed / turn * np.sin(turn * time_s), speed / turn * (1.0 - np.cos(turn * time_s))
    # On the equator a radian of latitude is a (1 - e^2), one of longitude a.
    scales = (6_378_137.0 * (1.0 - 6.694_379_990_14e-3), 6_378_137.0)
    return north / scales[0], east / scales[1], speed * np.cos(turn * time_s), speed * np.sin(turn * time_s)


CLOCK = np.arange(0.0, 120.0)
PAIRS = np.where(np.arange(120) % 10 == 5, CLOCK - 1.0, CLOCK)  # a second repeated, the next one skipped


@pytest.mark.parametrize(
    ("time_s", "shown_at", "digits", "limit"),
    [
        (np.arange(0.0, 120.0, 0.1), np.arange(0.0, 120.0, 0.1), 12, 0.3),
        (CLOCK, CLOCK, 12, 0.3),
        (PAIRS, CLOCK, 12, 8.0),
        (np.arange(0.0, 120.0, 0.1), np.floor(np.arange(0.0, 120.0, 0.1)), 12, 1.5),  # held for a second
        (CLOCK, CLOCK - (CLOCK % 17 == 3), 12, 13.0),  # repeats now and then
        (CLOCK, CLOCK, 7, 0.5),  # the seventh decimal of a radian is 0.6 m
    ],
)
def test_positions_that_repeat_lag_or_are_rounded_make_no_wild_velocity(time_s, shown_at, digits, limit):
    latitude, longitude, _, _ = positions(shown_at)
    *_, north, east = positions(time_s)
    made = ground_velocity(time_s, np.round(latitude, digits), np.round(longitude, digits))
    error = np.hypot(made[0] - north, made[1] - east)
    assert np.isfinite(error).all()
    inner = (time_s > 3.0) & (time_s < 117.0)
    assert error[inner].max() < limit


def test_positions_across_a_gap_make_a_velocity_on_either_side_alone():
    latitude, longitude, north, _ = positions(CLOCK)
    latitude[40:70] = np.nan
    made, _ = ground_velocity(CLOCK, latitude, longitude)
    assert np.isnan(made[44:66]).all()
    np.testing.assert_allclose(made[5:40], north[5:40], atol=1.0)
    assert np.isnan(ground_velocity(CLOCK, np.full(120, np.nan), longitude)[0]).all()


def test_the_dynamic_pressure_of_these_flights_is_below_the_impact_pressure():
    """So that the two are not mixed up here: 1 + M^2 / 4 at Mach 0.35."""
    *_, q_dynamic, tas, altitude, sat = flight()
    mach = tas / np.sqrt(1.4 * 287.05287 * sat)
    np.testing.assert_allclose(mach_of_tas(tas, total_temperature(sat, mach)), mach, rtol=1e-12)
    ratio = impact_pressure_of_mach(mach, pressure_at(altitude)) / q_dynamic
    np.testing.assert_allclose(ratio, 1.0 + mach**2 / 4.0, rtol=1e-3)
