"""Pressures, temperature and what follows from them: inverses, derivatives, identities, then published tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli import airdata
from bfi_cli.airdata import (
    altitude_of,
    calibrated_airspeed,
    fault_distribution,
    impact_pressure_of_cas,
    impact_pressure_of_mach,
    isa_temperature,
    mach_number,
    mach_of_tas,
    pressure_at,
    speed_of_sound,
    static_temperature,
    total_temperature,
    true_airspeed,
)

ALTITUDE, MACH, OFF_ISA = np.meshgrid(
    np.r_[np.linspace(-500.0, 16_000.0, 34), 0.0, 11_000.0], np.linspace(0.05, 0.9, 18), [-30.0, 0.0, 30.0]
)
P_STATIC = pressure_at(ALTITUDE)
P_TOTAL = P_STATIC + impact_pressure_of_mach(MACH, P_STATIC)
SAT = isa_temperature(ALTITUDE) + OFF_ISA
TAT = total_temperature(SAT, MACH)


def relative(one, other):
    return float(np.max(np.abs(one / other - 1.0)))


def test_pressures_come_back_from_cas_tas_mach_and_altitude():
    cas, mach = calibrated_airspeed(P_TOTAL - P_STATIC), mach_number(P_TOTAL - P_STATIC, P_STATIC)
    tas, altitude = true_airspeed(mach, TAT), altitude_of(P_STATIC)
    p_static = pressure_at(altitude)
    assert relative(p_static, P_STATIC) <= 1e-12
    assert relative(p_static + impact_pressure_of_cas(cas), P_TOTAL) <= 1e-12
    for again in (mach, mach_of_tas(tas, TAT)):
        assert relative(p_static + impact_pressure_of_mach(again, p_static), P_TOTAL) <= 1e-12


def test_the_impact_pressure_itself_comes_back_at_the_slowest_airspeed():
    """Where it is 0.2 % of the static pressure, so that plain powers lose it."""
    q_impact = impact_pressure_of_mach(MACH, P_STATIC)
    assert relative(mach_number(q_impact, P_STATIC), MACH) <= 1e-13
    assert relative(impact_pressure_of_cas(calibrated_airspeed(q_impact)), q_impact) <= 1e-13
    assert relative(mach_of_tas(true_airspeed(MACH, TAT), TAT), MACH) <= 1e-13


@given(st.floats(-5000.0, 20_000.0))
def test_altitude_is_the_inverse_of_pressure(altitude):
    assert altitude_of(pressure_at(altitude)) == pytest.approx(altitude, rel=1e-12, abs=1e-8)


def test_at_sea_level_in_the_standard_atmosphere_true_and_calibrated_airspeed_are_one():
    mach = np.linspace(0.0, 0.9, 10)
    tas = true_airspeed(mach, total_temperature(288.15, mach))
    np.testing.assert_allclose(calibrated_airspeed(impact_pressure_of_mach(mach, 101_325.0)), tas, rtol=1e-13)


def test_bernoulli_holds_where_air_is_hardly_compressed():
    density = P_STATIC / (287.05287 * SAT)
    tas = true_airspeed(MACH, TAT)
    expansion = 0.5 * density * tas**2 * (1.0 + MACH**2 / 4.0 + MACH**4 / 40.0)
    np.testing.assert_allclose((P_TOTAL - P_STATIC)[MACH < 0.2], expansion[MACH < 0.2], rtol=1e-6)


def test_energy_is_kept():
    """cp tat = cp sat + tas^2 / 2."""
    cp = 3.5 * 287.05287
    np.testing.assert_allclose(cp * SAT + 0.5 * true_airspeed(MACH, TAT) ** 2, cp * TAT, rtol=1e-13)


def test_the_atmosphere_is_in_balance_with_its_weight():
    """dp/dh = -g p / (R T), through the tropopause."""
    h = np.linspace(-4_900.0, 19_900.0, 200)
    slope = (pressure_at(h + 0.5) - pressure_at(h - 0.5)) / 1.0
    np.testing.assert_allclose(slope, -9.80665 * pressure_at(h) / (287.05287 * isa_temperature(h)), rtol=1e-7)


def channels_of(p_static, p_total, *, held):
    q_impact = p_total - p_static
    mach = mach_number(q_impact, p_static)
    sat = static_temperature(TAT, mach) if held == "total" else SAT
    return {
        "p_static": p_static,
        "p_total": p_total,
        "q_impact": q_impact,
        "cas": calibrated_airspeed(q_impact),
        "mach": mach,
        "tas": mach * speed_of_sound(sat),
        "sat": sat,
        "altitude": altitude_of(p_static),
    }


@pytest.mark.parametrize("held", ["total", "static"])
@pytest.mark.parametrize("channel", ["p_static", "p_total", "q_impact", "cas", "mach", "tas", "sat", "altitude"])
def test_the_distribution_is_the_slope_of_the_equations(channel, held):
    """Central differences of 0.1 % of the impact pressure, away from the corner of the tropopause."""
    away = np.abs(ALTITUDE - 11_000.0) > 1.0
    slopes = fault_distribution(channel, P_STATIC, P_TOTAL, TAT, held=held)
    step = 1e-3 * (P_TOTAL - P_STATIC)
    for k, (by_static, by_total) in enumerate([(step, 0.0), (0.0, step)]):
        up = channels_of(P_STATIC + by_static, P_TOTAL + by_total, held=held)[channel]
        down = channels_of(P_STATIC - by_static, P_TOTAL - by_total, held=held)[channel]
        size = np.abs(slopes[..., k]).max()
        np.testing.assert_allclose(((up - down) / (2.0 * step) - slopes[..., k])[away], 0.0, rtol=0, atol=2e-6 * size)


def test_holding_the_static_temperature_is_the_published_airspeed_of_t_2_4():
    speed_of_air = np.sqrt(1.4 * 287.05287 * SAT)

    def published(p_static, p_total):
        return speed_of_air * np.sqrt(5.0 * (((p_total - p_static) / p_static + 1.0) ** (2.0 / 7.0) - 1.0))

    np.testing.assert_allclose(published(P_STATIC, P_TOTAL), true_airspeed(MACH, TAT), rtol=1e-12)
    a11, a12 = np.moveaxis(fault_distribution("tas", P_STATIC, P_TOTAL, TAT, held="static"), -1, 0)
    error = 1e-4 * (P_TOTAL - P_STATIC)
    np.testing.assert_allclose(
        published(P_STATIC, P_TOTAL + error) - published(P_STATIC, P_TOTAL), a12 * error, rtol=1e-4
    )
    np.testing.assert_allclose(
        published(P_STATIC + error, P_TOTAL) - published(P_STATIC, P_TOTAL), a11 * error, rtol=1e-3
    )


# ICAO Doc 7488/3, table 1, at geopotential altitudes; the U.S. Standard Atmosphere 1976, table I, has the same values.
@pytest.mark.parametrize(
    ("altitude", "temperature", "pressure", "sound"),
    [
        (-500.0, 291.400, 107_477.0, 342.208),
        (0.0, 288.150, 101_325.0, 340.294),
        (1_000.0, 281.650, 89_874.6, 336.434),
        (5_000.0, 255.650, 54_019.9, 320.529),
        (10_000.0, 223.150, 26_436.3, 299.463),
        (11_000.0, 216.650, 22_632.1, 295.069),
        (15_000.0, 216.650, 12_044.6, 295.069),
        (20_000.0, 216.650, 5_474.89, 295.069),
    ],
)
def test_the_table_of_the_standard_atmosphere(altitude, temperature, pressure, sound):
    assert isa_temperature(altitude) == pytest.approx(temperature, abs=5e-4)
    assert pressure_at(altitude) == pytest.approx(pressure, rel=5e-6)
    assert speed_of_sound(isa_temperature(altitude)) == pytest.approx(sound, abs=1e-3)


# NACA report 1135 (1953), table I: p/pt and T/Tt at a Mach number, four figures.
@pytest.mark.parametrize(
    ("mach", "pressure_ratio", "temperature_ratio"),
    [(0.3, 0.9395, 0.9823), (0.5, 0.8430, 0.9524), (0.8, 0.6560, 0.8865), (0.9, 0.5913, 0.8606)],
)
def test_the_table_of_compressible_flow(mach, pressure_ratio, temperature_ratio):
    p_total = 1000.0 + impact_pressure_of_mach(mach, 1000.0)
    assert 1000.0 / p_total == pytest.approx(pressure_ratio, abs=6e-5)
    assert static_temperature(1.0, mach) == pytest.approx(temperature_ratio, abs=6e-5)


def test_an_airspeed_of_a_published_calculator():
    """290 kt CAS at 10 000 m is 472.0033 kt TAS: hochwarth.com, Aviation Calculator, constants of six figures."""
    knot = 1852.0 / 3600.0
    p_static = pressure_at(10_000.0)
    mach = mach_number(impact_pressure_of_cas(290.0 * knot), p_static)
    assert true_airspeed(mach, total_temperature(223.15, mach)) / knot == pytest.approx(472.0032987, rel=5e-7)


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        (
            "pressure_at",
            (20_001.0,),
            "altitude: .* is known between -5000 and 20000 m, got 20001 m",
        ),
        ("isa_temperature", (-5_001.0,), "altitude: the standard atmosphere is known .*, got -5001 m"),
        ("altitude_of", (-10.0,), "p_static: a static pressure is positive, got -10 Pa"),
        ("altitude_of", (0.0,), "p_static: a static pressure is positive, got 0 Pa"),
        ("altitude_of", (5_000.0,), "p_static: the standard atmosphere is known .*, got 5000 Pa"),
        ("calibrated_airspeed", (-1.0,), "q_impact: an impact pressure is not negative, got -1 Pa"),
        ("calibrated_airspeed", (95_000.0,), "the equations hold below Mach 1, got 0.937577"),
        ("impact_pressure_of_cas", (350.0,), "cas: 0 to 340.3 m/s, the equations hold below Mach 1, got 350 m/s"),
        ("impact_pressure_of_cas", (-0.1,), "cas: 0 to 340.3 m/s, .*, got -0.1 m/s"),
        ("mach_number", (1000.0, -1.0), "p_static: a static pressure is positive, got -1 Pa"),
        ("mach_number", (-5.0, 1000.0), "q_impact: an impact pressure is not negative, got -5 Pa"),
        ("mach_number", (900.0, 1000.0), "the equations hold below Mach 1, got 0.9"),
        ("impact_pressure_of_mach", (1.1, 1000.0), "mach: the equations hold below Mach 1, got 1.1"),
        ("true_airspeed", (0.5, -3.0), "tat: a temperature in kelvin is positive, got -3 K"),
        ("mach_of_tas", (330.0, 288.15), "the equations hold below Mach 1, got 0.9697"),
        ("mach_of_tas", (-330.0, 288.15), "tas: an airspeed is not negative, got -330 m/s"),
        ("speed_of_sound", ([250.0, np.nan, 0.0],), "sat: a temperature in kelvin is positive, got 0 K"),
        ("fault_distribution", ("tas", 1000.0, 1000.0, 288.15), "q_impact: an airspeed has no derivative at rest"),
        ("fault_distribution", ("cas", 1000.0, 900.0, 288.15), "q_impact: an impact pressure is not negative"),
    ],
)
def test_what_the_equations_do_not_hold_for_is_refused(name, arguments, message):
    with pytest.raises(ValueError, match=message):
        getattr(airdata, name)(*arguments)


def test_missing_samples_stay_missing_and_arguments_are_left_alone():
    altitude = np.array([1000.0, np.nan, 12_000.0])
    before = altitude.copy()
    assert np.isnan(altitude_of(pressure_at(altitude))).tolist() == [False, True, False]
    assert np.isnan(calibrated_airspeed([1e3, np.nan])).tolist() == [False, True]
    np.testing.assert_array_equal(altitude, before)


def test_a_number_gives_a_number_and_arrays_broadcast():
    assert np.ndim(pressure_at(0.0)) == 0
    assert true_airspeed(np.array([[0.1], [0.2]]), np.array([250.0, 260.0, 270.0])).shape == (2, 3)
    assert fault_distribution("tas", 9e4, np.array([9.2e4, 9.3e4]), 280.0).shape == (2, 2)
