"""Residuals are constant where nothing errs, whatever the log records of the system."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flight import WIND, ZERO_LIFT, made_record

from bfi_cli.airdata import G
from bfi_cli.flight.parity.record import with_fault
from bfi_cli.flight.parity.residuals import RESIDUALS, available, constants_of, weights_of
from bfi_cli.flight.parity.scan import residual_values

RECORD = made_record()
T = RECORD.time_s
CONSTANTS = constants_of(RECORD, zero_lift=ZERO_LIFT)
KINDS = {kind.name: kind for kind in RESIDUALS}
AIRSPEEDS = {"tas", "cas", "ias", "mach", "q_impact", "p_total"}


def spread(record, name, constants=CONSTANTS):
    """Return the range of a residual."""
    return float(np.ptp(residual_values(record, record, constants, KINDS[name])))


@pytest.mark.parametrize("name", KINDS)
def test_a_flight_without_a_fault_keeps_them_constant(name):
    # A constant wind is fitted with a prior of 50 m/s, which moves it by a part in 1e5.
    assert spread(RECORD, name) < (1e-3 if name == "ground_speed" else 1e-9)


@pytest.mark.parametrize("source", ["q_impact", "p_total", "cas", "mach", "tas", "ias"])
@pytest.mark.parametrize("static", ["p_static", "altitude"])
@pytest.mark.parametrize("temperature", ["tat", "sat"])
def test_lift_is_the_same_from_whatever_the_pressures_are_taken(source, static, temperature):
    record = made_record(
        without=(AIRSPEEDS - {source, "tas"}) | ({"p_static", "altitude", "tat", "sat"} - {static, temperature})
    )
    assert spread(record, "lift") < 1e-8


def test_without_a_temperature_the_climb_is_off_by_the_warmth_of_the_air_alone():
    record = made_record(without=("tat", "sat"))
    expected = np.degrees(RECORD.channels["altitude_rate"] / RECORD.channels["tas"]) * 0.03
    climb = residual_values(record, record, CONSTANTS, KINDS["climb"])
    np.testing.assert_allclose(climb, -expected, atol=1e-9)


def test_the_wind_is_found():
    assert CONSTANTS.wind == pytest.approx(WIND, abs=1e-2)
    assert CONSTANTS.speed == pytest.approx(RECORD.channels["tas"].mean())


def test_an_error_of_the_angle_of_zero_lift_is_a_nuisance_of_lift():
    """To first order: what is left of a tenth of a degree is of second order."""
    unknown = constants_of(RECORD, zero_lift=None)
    assert not unknown.knows_zero_lift
    off = constants_of(RECORD, zero_lift=ZERO_LIFT + np.radians(0.1))
    values = residual_values(RECORD, RECORD, off, KINDS["lift"])
    column = 0.5 * off.speed / (RECORD.channels["aoa"] - ZERO_LIFT)
    left = values + np.radians(0.1) * column
    assert np.ptp(values) > 20.0 * np.ptp(left)
    columns, prior_sd = KINDS["lift"].nuisances(RECORD, unknown)
    assert columns.shape == (len(T), 1)
    assert np.isinf(prior_sd).all()


def test_a_step_of_the_airspeed_is_a_step_of_lift_ground_speed_and_kinematics():
    step = np.where(T > 60.0, 0.5, 0.0)
    faulty = with_fault(RECORD, "tas", step)
    for name, size in (("kinematics", 0.5), ("ground_speed", 0.5)):
        values = residual_values(faulty, faulty, CONSTANTS, KINDS[name])
        assert values[-1] - values[0] == pytest.approx(size, rel=0.03)
    alone = made_record(without=AIRSPEEDS - {"tas"})
    values = residual_values(with_fault(alone, "tas", step), RECORD, CONSTANTS, KINDS["lift"])
    assert values[-1] - values[0] == pytest.approx(0.5, rel=0.15)


def test_what_a_log_lacks_is_named():
    kinds, lacking = available({"tas": 0, "altitude": 0, "aoa": 0})
    assert kinds == ()
    assert lacking == {
        "lift": "normal_acc",
        "climb": "pitch, roll, altitude_rate",
        "kinematics": "longitudinal_acc, normal_acc, pitch, roll",
        "ground_speed": "altitude_rate, velocity_north, velocity_east",
    }
    assert available({"aoa": 0})[1]["lift"].startswith("p_static or altitude, q_impact or p_total or cas")


@pytest.mark.parametrize("name", KINDS)
def test_what_no_flight_has_is_not_known_and_stops_nothing(name):
    """No airspeed, an angle of attack below that of zero lift, a pressure below none, a wind that carries all."""
    channels = {one: values.copy() for one, values in RECORD.channels.items()}
    channels["tas"][:5] = 0.0
    channels["q_impact"][5:10] = -500.0
    channels["aoa"][10:15] = ZERO_LIFT - 0.1
    channels["normal_acc"][15:20] = -12.0
    channels["velocity_north"][20:25], channels["velocity_east"][20:25] = CONSTANTS.wind
    record = made_record()
    record = type(record)(time_s=T, channels=channels, gained=record.gained, airspeed="tas")
    values = residual_values(record, record, CONSTANTS, KINDS[name])
    np.testing.assert_allclose(values[30:], values[30], atol=1e-3)
    assert not np.isinf(values).any()
    if KINDS[name].nuisances is not None:
        columns, _ = KINDS[name].nuisances(record, constants_of(record, zero_lift=None))
        assert not np.isinf(columns).any()


def test_the_columns_of_the_ground_speed_are_its_derivatives_by_the_wind_and_by_the_shear():
    """Of 1 m/s and of 1 m/s in 1000 m, which are known beforehand to 50 and to 10 m/s: a jet stream, common shear."""
    columns, prior_sd = KINDS["ground_speed"].nuisances(RECORD, CONSTANTS)
    height = RECORD.channels["altitude"] - RECORD.channels["altitude"].mean()
    values = residual_values(RECORD, RECORD, CONSTANTS, KINDS["ground_speed"])
    assert np.ptp(height) > 100.0
    np.testing.assert_allclose(prior_sd * np.array([1.0, 1.0, 1000.0, 1000.0]), [50.0, 50.0, 10.0, 10.0])
    for k, column in enumerate(columns.T):
        name, grown = ("velocity_north", "velocity_east")[k % 2], 1e-3 * (height / 1000.0 if k >= 2 else 1.0)
        moved = replace(RECORD, channels={**RECORD.channels, name: RECORD.channels[name] - grown})
        change = residual_values(moved, moved, CONSTANTS, KINDS["ground_speed"]) - values
        np.testing.assert_allclose(change, column * (1e-6 if k >= 2 else 1e-3), atol=1e-7)


def test_an_accelerometer_is_known_to_gravity_along_a_third_of_a_degree():
    """Its bias is a slope of the kinematics; one of 0.3 degrees of attitude makes it as well."""
    columns, prior_sd = KINDS["kinematics"].nuisances(RECORD, CONSTANTS)
    np.testing.assert_allclose(columns[:, 0], T - T[0])
    assert prior_sd[0] == pytest.approx(G * np.sin(np.radians(0.3)), rel=0.05)


def test_the_slow_noise_is_that_of_the_theory():
    """(15.10): correlated over half a minute or two, and an integral of which the increments are independent."""
    at = np.array([0.0, 1.0, 30.0, 120.0])
    for name, sd, seconds in (("lift", 0.3, 30.0), ("climb", 0.15, 30.0), ("ground_speed", 0.6, 120.0)):
        np.testing.assert_allclose(KINDS[name].slow(at)[0], sd**2 * np.exp(-at / seconds), rtol=1e-12)
    walk = KINDS["kinematics"].slow(at)
    steps = np.diff(np.diff(walk, axis=0), axis=1)
    np.testing.assert_allclose(steps, np.diag(0.3**2 * np.diff(at)), atol=1e-12)


def test_the_dispersion_of_a_residual_grows_with_the_length_of_its_window():
    """By the power 0.3 of it, as on the flights that the dispersions are of."""
    np.testing.assert_allclose(weights_of(RESIDUALS, 240.0) / weights_of(RESIDUALS, 120.0), 2.0**-0.6)
    np.testing.assert_allclose(weights_of(RESIDUALS, 120.0), [kind.dispersion**-2.0 for kind in RESIDUALS])
