"""The air data of a log as one system: whatever is recorded of it, it is the same system."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.airdata import DEPENDS_ON, air_data_of, channels_of, impact_pressure_of_mach, isa_temperature, pressure_at

N = 50
ALTITUDE = np.linspace(500.0, 12_000.0, N)
P_STATIC = pressure_at(ALTITUDE)
Q_IMPACT = impact_pressure_of_mach(np.linspace(0.1, 0.8, N), P_STATIC)
TAT = isa_temperature(ALTITUDE) + 20.0
CHANNELS = {**channels_of(P_STATIC, Q_IMPACT, TAT, rate_of=np.arange(N)), "tat": TAT}


@pytest.mark.parametrize("static", ["p_static", "altitude"])
@pytest.mark.parametrize("impact", ["q_impact", "p_total", "cas", "mach", "tas", "ias"])
@pytest.mark.parametrize("temperature", ["tat", "sat", "tas"])
def test_any_set_of_channels_that_tells_the_system_tells_the_same(static, impact, temperature):
    if temperature == "tas" and impact in ("tas", "ias"):  # then it is the source of the impact pressure already
        temperature = "sat"
    air = air_data_of({name: CHANNELS[name] for name in (static, impact, temperature)})
    np.testing.assert_allclose(air.p_static, P_STATIC, rtol=1e-12)
    np.testing.assert_allclose(air.q_impact, Q_IMPACT, rtol=1e-10)
    np.testing.assert_allclose(air.tat, TAT, rtol=1e-10)
    assert air.made_of == {"p_static": (static,), "q_impact": (impact,), "tat": (temperature,)}
    assert air.impossible == ()
    again = channels_of(air.p_static, air.q_impact, air.tat)
    for name in again:
        np.testing.assert_allclose(again[name], CHANNELS[name], rtol=1e-10)


def test_without_a_temperature_the_standard_atmosphere_is_taken():
    air = air_data_of({"altitude": ALTITUDE, "cas": CHANNELS["cas"]})
    np.testing.assert_allclose(air.sat, isa_temperature(ALTITUDE), rtol=1e-12)
    assert air.made_of["tat"] == ()


def test_every_channel_that_is_made_depends_on_the_pressures_that_move_it():
    """And on no other: a change of one pressure moves exactly the channels of the table."""
    moved = {
        "p_static": channels_of(P_STATIC * 1.001, CHANNELS["p_total"] - P_STATIC * 1.001, TAT, rate_of=np.arange(N)),
        "p_total": channels_of(P_STATIC, Q_IMPACT * 1.001, TAT, rate_of=np.arange(N)),
    }
    assert DEPENDS_ON["baro_altitude"] == DEPENDS_ON["altitude"]  # apart by what the setting makes, a constant
    for name, pressures in DEPENDS_ON.items():
        if name == "baro_altitude":
            continue
        for pressure, channels in moved.items():
            change = np.abs(channels[name] - CHANNELS[name]).max() / np.abs(CHANNELS[name]).max()
            assert (change > 1e-8) == (pressure in pressures), (name, pressure)


def test_a_sensor_at_rest_may_show_a_little_less_than_nothing():
    air = air_data_of({"altitude": np.zeros(2), "cas": np.array([-0.02, 0.0])})
    assert air.q_impact.tolist() == [0.0, 0.0]
    assert air.impossible == ()


@pytest.mark.parametrize(
    ("channel", "value", "why"),
    [
        ("altitude", 25_000.0, "known between -5000 and 20000 m"),
        ("p_static", -3.0, "a static pressure lies between"),
        ("cas", 400.0, "below Mach 1"),
        ("cas", -30.0, "0 to 340.3 m/s"),
        ("cas", 300.0, "with the static pressure, the equations hold below Mach 1"),
        ("mach", 1.2, "below Mach 1"),
        ("tas", 500.0, "below Mach 1"),
        ("q_impact", -5_000.0, "an impact pressure is not negative"),
        ("p_total", 1_000.0, "it is below the static pressure"),
        ("tat", 4.0, "no air temperature in kelvin"),
    ],
)
def test_what_no_subsonic_flight_has_is_left_out_and_named(channel, value, why):
    static = "p_static" if channel == "p_static" else "altitude"
    impact = channel if channel in ("cas", "mach", "tas", "q_impact", "p_total") else "cas"
    recorded = {name: CHANNELS[name].copy() for name in (static, impact, "tat")}
    recorded[channel][40] = value
    air = air_data_of(recorded)
    assert [one.channel for one in air.impossible] == [channel]
    assert why in air.impossible[0].why
    assert np.flatnonzero(air.impossible[0].where).tolist() == [40]
    assert np.flatnonzero(~np.isfinite(air.mach + air.tat)).tolist() == [40]
    assert recorded[channel][40] == value


def test_what_does_not_tell_the_system_is_named():
    with pytest.raises(ValueError, match="p_static: needs p_static or altitude, got none of them"):
        air_data_of({"cas": CHANNELS["cas"]})
    with pytest.raises(ValueError, match="q_impact: needs q_impact or p_total or cas or mach or ias or tas"):
        air_data_of({"altitude": ALTITUDE})


def test_an_impact_pressure_beyond_the_sound_at_sea_level_is_left_out_below_it():
    """At 4000 m below the level of the sea Mach 0.9 has a calibrated airspeed above the speed of sound there."""
    air = air_data_of({"altitude": np.full(2, -4000.0), "mach": np.array([0.5, 0.9])})
    made = channels_of(air.p_static, air.q_impact, air.tat)
    assert np.isfinite(made["cas"]).tolist() == [True, False]
    assert [(one.channel, one.where.tolist()) for one in air.impossible] == [("mach", [False, True])]


def test_an_indicated_airspeed_tells_the_impact_pressure_without_a_temperature():
    """A true airspeed would bring the errors of its computation and of its temperature into the pressures."""
    recorded = {"altitude": ALTITUDE, "ias": CHANNELS["cas"], "tas": CHANNELS["tas"], "sat": CHANNELS["sat"]}
    wrong = recorded | {"tas": np.round(CHANNELS["tas"]) + 3.0, "sat": CHANNELS["sat"] + 10.0}
    air, with_errors = air_data_of(recorded), air_data_of(wrong)
    assert air.made_of["q_impact"] == with_errors.made_of["q_impact"] == ("ias",)
    np.testing.assert_array_equal(air.p_total, with_errors.p_total)
    np.testing.assert_allclose(air.q_impact, CHANNELS["q_impact"], rtol=1e-12)
