"""The F-16's tables, engine and atmosphere: their entries, what lies between and beyond them."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.aircraft.f16.airframe import AIRFRAME, FOOT, POUND, Grid, interpolate, tables
from bfi_cli.aircraft.f16.loads import (
    Body,
    air_density,
    commanded_power,
    conditions_at,
    mach_number,
    power_rate,
    thrust,
)

DEG = np.pi / 180.0


def still_air(
    aoa_deg: float, slip_deg: float, surfaces_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    x, u = np.zeros((13, 1)), np.zeros((6, 1))
    x[:3, 0], u[:3, 0] = (150.0, aoa_deg * DEG, slip_deg * DEG), DEG * np.array(surfaces_deg)
    return conditions_at(x, Body(cg=0.35)).coefficients(np.zeros((3, 1)), u)[:, 0]


def test_the_stack_is_whole():
    data = tables()
    assert data.stack.shape == (62, 12)
    assert data.thrust.shape == (3, 6, 6)
    assert not data.stack.flags.writeable
    assert not data.thrust.flags.writeable
    assert tables() is data


def test_interpolation_of_a_plane_is_exact_inside_and_outside():
    grid = Grid(first=-2.0, step=0.5, size=4)
    rows = np.repeat((3.0 * grid.points + 1.0)[None, :, None], 5, axis=2)
    at = np.array([-3.0, -2.0, -1.3, -0.5, 4.0])
    np.testing.assert_allclose(interpolate(rows, grid, at), [3.0 * at + 1.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("where", "coefficient", "entry"),
    [
        ((15.0, 0.0, (12.0, 0.0, 0.0)), 0, 0.062),
        ((-5.0, 0.0, (0.0, 0.0, 0.0)), 2, 0.241),
        ((20.0, 15.0, (0.0, 0.0, 0.0)), 3, -0.050),
        ((35.0, -10.0, (0.0, 0.0, 0.0)), 5, 0.035),
        ((25.0, 0.0, (-24.0, 0.0, 0.0)), 4, 0.238),
        ((0.0, 0.0, (0.0, 20.0, 0.0)), 3, -0.051),
        ((45.0, 0.0, (0.0, 0.0, 30.0)), 5, -0.016),
    ],
)
def test_entries_of_the_book(where: tuple[float, float, tuple[float, float, float]], coefficient: int, entry: float):
    assert still_air(*where)[coefficient] == pytest.approx(entry, abs=1e-14)


def test_rolling_and_yawing_are_odd_in_sideslip_and_the_side_force_too():
    left, right = still_air(17.0, -12.0), still_air(17.0, 12.0)
    np.testing.assert_allclose(left[[1, 3, 5]], -right[[1, 3, 5]], rtol=1e-14)
    np.testing.assert_allclose(left[[0, 2, 4]], right[[0, 2, 4]], rtol=1e-14)


def test_angles_of_attack_beyond_the_tables_count_as_their_ends():
    np.testing.assert_array_equal(still_air(60.0, 5.0), still_air(45.0, 5.0))
    np.testing.assert_array_equal(still_air(-30.0, 5.0), still_air(-10.0, 5.0))


def test_the_elevator_is_extrapolated_from_24_to_25_degrees():
    at = [still_air(10.0, 0.0, (angle, 0.0, 0.0))[4] for angle in (12.0, 24.0, 25.0)]
    assert at[2] - at[1] == pytest.approx((at[1] - at[0]) / 12.0, rel=1e-12)


def test_forces_act_about_the_centre_of_gravity():
    """Behind the tables' own, lift pitches up and a force to the right yaws left."""
    x, rates, u = np.zeros((13, 1)), np.array([[0.1], [0.2], [0.3]]), np.full((6, 1), 0.05)
    x[:3, 0] = 150.0, 0.2, 0.1
    ours, moved = (conditions_at(x, Body(cg=cg)).coefficients(rates, u)[:, 0] for cg in (0.35, 0.40))
    np.testing.assert_array_equal(moved[:4], ours[:4])
    assert moved[4] - ours[4] == pytest.approx(-0.05 * ours[2], rel=1e-12)
    assert moved[5] - ours[5] == pytest.approx(0.05 * ours[1] * AIRFRAME.chord_m / AIRFRAME.span_m, rel=1e-12)


@pytest.mark.parametrize(
    ("power", "pounds"), [(0.0, -710.0), (50.0, 9839.0), (100.0, 18910.0), (25.0, 4564.5), (75.0, 14374.5)]
)
def test_thrust_at_10000_feet_and_mach_06(power: float, pounds: float):
    found = thrust(np.array([power]), np.array([1e4 * FOOT]), np.array([0.6]))
    assert found[0] / POUND == pytest.approx(pounds, rel=1e-12)


def test_thrust_has_no_step_at_military_power():
    below, above = (thrust(np.array([p]), np.array([2e3]), np.array([0.3]))[0] for p in (50.0 - 1e-9, 50.0 + 1e-9))
    assert below == pytest.approx(above, rel=1e-8)


def test_thrust_between_four_entries_is_their_mean():
    middle = thrust(np.array([50.0]), np.array([5e3 * FOOT]), np.array([0.1]))[0]
    assert middle / POUND == pytest.approx((12680.0 + 9150.0 + 12680.0 + 9150.0) / 4.0, rel=1e-12)


@pytest.mark.parametrize(
    ("power", "wanted", "rate"),
    [
        (60.0, 90.0, 5.0 * 30.0),
        (30.0, 90.0, 1.0 * (1.9 - 0.036 * 30.0) * 30.0),
        (90.0, 30.0, 5.0 * (40.0 - 90.0)),
        (30.0, 20.0, 1.0 * -10.0),
        (0.0, 49.0, (1.9 - 0.036 * 49.0) * 49.0),
        (1.0, 80.0, 0.1 * 59.0),
    ],
)
def test_the_lag_of_the_engine(power: float, wanted: float, rate: float):
    throttle = wanted / 64.94 if wanted <= 50.0 else (wanted + 117.38) / 217.38
    assert power_rate(np.array([power]), np.array([throttle]))[0] == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize("throttle", [0.0, 0.3, 0.77, 0.9, 1.0])
def test_the_commanded_power_stays(throttle: float):
    power = commanded_power(np.array([throttle]))
    assert power_rate(power, np.array([throttle]))[0] == pytest.approx(0.0, abs=1e-9)


def test_military_power_is_at_a_throttle_of_077():
    below, above = commanded_power(np.array([0.77, 0.77 + 1e-12]))
    assert below == pytest.approx(50.0, abs=0.01)
    assert above == pytest.approx(below, abs=0.01)
    assert commanded_power(np.array([1.0]))[0] == pytest.approx(100.0, rel=1e-12)


def test_the_atmosphere_at_sea_level_and_above_the_tropopause():
    assert air_density(np.array([0.0]))[0] == pytest.approx(1.2250, abs=5e-4)
    sound = 1.0 / mach_number(np.ones(3), np.array([0.0, 11e3, 15e3]))
    assert sound[0] == pytest.approx(340.3, abs=0.5)
    assert sound[1] == pytest.approx(295.1, abs=0.6)
    assert sound[2] == sound[1]
