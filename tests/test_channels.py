"""Names and units: identities first, then the spellings of known recorders."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.errors import LogError
from bfi_cli.quantities.channels import (
    BY_SPELLING,
    CONVERSIONS,
    INPUTS,
    LARGEST_ERROR,
    REPEATED,
    STANDARD,
    match_name,
    meant_channel,
    quantity_of,
    si_unit,
    split_unit,
    to_si,
)

FINITE = st.floats(-1e9, 1e9)


@given(value=FINITE, unit=st.sampled_from(sorted({c.si for c, _ in CONVERSIONS})))
def test_si_is_left_exactly_alone(value: float, unit: str):
    converted, si = to_si(value, unit)
    assert converted == value
    assert si == unit


@given(value=FINITE, unit=st.sampled_from(sorted(BY_SPELLING)))
def test_conversion_is_affine_and_its_result_is_si(value: float, unit: str):
    zero, one, there = (float(to_si(x, unit)[0]) for x in (0.0, 1.0, value))
    assert math.isclose(there, zero + (one - zero) * value, rel_tol=1e-9, abs_tol=1e-6 * (1 + abs(zero)))
    assert to_si(1.0, to_si(value, unit)[1])[0] == 1.0


@given(unit=st.sampled_from(sorted(BY_SPELLING)))
def test_case_blanks_and_brackets_do_not_matter(unit: str):
    assert to_si(3.0, f" [{unit.upper()}] ") == to_si(3.0, unit)


def test_every_spelling_stands_for_one_conversion():
    spellings = [spelling for _, text in CONVERSIONS for spelling in text.split()]
    assert len(spellings) == len(set(spellings))


@pytest.mark.parametrize(
    ("value", "unit", "expected", "si"),
    [
        (3600, "kt", 1852, "m/s"),
        (3600, "Knots", 1852, "m/s"),
        (36, "km/h", 10, "m/s"),
        (1, "mph", 0.44704, "m/s"),
        (1, "ft", 0.3048, "m"),
        (1, "in", 0.0254, "m"),
        (180, "°", math.pi, "rad"),
        (180, "deg/s", math.pi, "rad/s"),
        (180, "degrees per second", math.pi, "rad/s"),
        (-273.15, "°C", 0, "K"),
        (15, "deg C", 288.15, "K"),
        (32, "degF", 273.15, "K"),
        (212, "F", 373.15, "K"),
        (60, "ft/min", 0.3048, "m/s"),
        (60, "fpm", 0.3048, "m/s"),
        (1013.25, "hPa", 101325, "Pa"),
        (1013.25, "mbar", 101325, "Pa"),
        (101.325, "kPa", 101325, "Pa"),
        (1000, "inHg", 3386389, "Pa"),
        (14.695948775, "psi", 101325, "Pa"),
        (1, "g", 9.80665, "m/s^2"),
        (1, "m/s2", 1, "m/s^2"),
        (1, "m/s**2", 1, "m/s^2"),
        (1, "m s-2", 1, "m/s^2"),
        (1, "m.s⁻¹", 1, "m/s"),
        (50, "%", 0.5, "1"),
        (20, "ms", 0.02, "s"),
        (2, "min", 120, "s"),
        (1, "kN", 1000, "N"),
        (1, "MPa", 1e6, "Pa"),
        (7, "", 7, ""),
    ],
)
def test_units_as_people_write_them(value: float, unit: str, expected: float, si: str):
    converted, unit_si = to_si(value, unit)
    assert float(converted) == pytest.approx(expected, rel=1e-8, abs=1e-12)
    assert unit_si == si


def test_the_input_of_a_conversion_is_not_modified():
    values = np.array([1.0, 2.0])
    to_si(values, "kt")
    assert values.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("unit", "hint"), [("knotz", "did you mean 'knot'?"), ("furlong/fortnight", "give an SI unit")]
)
def test_an_unknown_unit_is_one_line_with_a_hint(unit: str, hint: str):
    with pytest.raises(LogError, match=f"^a.csv: 'tas': unknown unit '{unit}'; ") as caught:
        to_si(1.0, unit, where="a.csv: 'tas'")
    assert hint in str(caught.value)


@given(name=st.sampled_from(sorted(STANDARD)), upper=st.booleans())
def test_a_standard_name_is_itself(name: str, upper: bool):
    match = match_name(name.upper() if upper else name)
    assert match is not None
    assert match.name == name


def test_no_alias_stands_for_two_channels():
    aliases = [alias.partition("=")[0] for channel in STANDARD.values() for alias in channel.aliases]
    assert len(aliases) == len(set(aliases))
    assert not set(aliases) & set(STANDARD)


@pytest.mark.parametrize("quantity", REPEATED)
def test_a_sensor_has_the_unit_and_the_largest_error_of_its_quantity(quantity: str):
    for sensor in (f"{quantity}_{number}" for number in range(1, 10)):
        assert quantity_of(sensor) == quantity
        assert STANDARD[sensor].unit == STANDARD[quantity].unit
        assert LARGEST_ERROR.get(sensor) == LARGEST_ERROR.get(quantity)


@pytest.mark.parametrize(
    ("source", "name", "unit"),
    [
        ("mach_1", "mach_1", None),
        ("Mach (1)", "mach_1", None),
        ("TAS Captain", "tas_1", None),
        ("tas_fo", "tas_2", None),
        ("tas2", "tas_2", None),
        ("ALT1_ft", "altitude_1", "ft"),
        ("aoa (left)", "aoa_1", None),
        ("AOA Right", "aoa_2", None),
        ("cas standby", "cas_3", None),
        ("true_airspeed_2_kt", "tas_2", "kt"),
        ("mach_1_1", "mach_1", "1"),
    ],
)
def test_a_further_sensor_is_read_from_its_name(source: str, name: str, unit: str | None):
    match = match_name(source)
    assert match is not None
    assert (match.name, match.unit) == (name, unit)


def test_units_of_the_standard_channels_are_si():
    assert all(si_unit(channel.unit) == channel.unit for channel in STANDARD.values())
    assert set(INPUTS) <= set(STANDARD)


@pytest.mark.parametrize(
    ("source", "name", "unit"),
    [
        ("vtas", "tas", None),
        ("Dadc1_tas", "tas", None),
        ("true_airspeed_m_s", "tas", "m/s"),
        ("TAS_kt", "tas", "kt"),
        ("tas_ms", "tas", "m/s"),
        ("trueAirspeed", "tas", None),
        ("Vtrue,_ktas", "tas", "kt"),
        ("calibrated_airspeed_m_s", "cas", "m/s"),
        ("de", "elevator", None),
        ("delta_e", "elevator", None),
        ("delta_e_deg", "elevator", "deg"),
        ("alpha", "aoa", None),
        ("vane_AOA", "aoa", None),
        ("Ahrs1_bPitchRate", "pitch_rate", None),
        ("Ahrs1_bLongAcc", "longitudinal_acc", None),
        ("Dadc1_altRate", "altitude_rate", None),
        ("Dadc1_bcAlt", "baro_altitude", None),
        ("AltB", "baro_altitude", None),
        ("AltInd", "baro_altitude", None),
        ("baro_alt_2", "baro_altitude_2", None),
        ("Altitude QNH", "baro_altitude", None),
        ("BaroA", "baro_setting", "inHg"),
        ("qnh_hPa", "baro_setting", "hPa"),
        ("AltP", "altitude", None),
        ("Pressure Altitude (ft)", "altitude", "ft"),
        ("dadc1_alt", "altitude", None),
        ("GPS Altitude (feet)", "gps_altitude", "ft"),
        ("gps_altitude_2", "gps_altitude_2", None),
        *((name, "gps_altitude", None) for name in ("gps_alt", "gps2_alt", "altgps", "alt_gps", "AltMSL", "alt_msl")),
        *((name, "gps_altitude", None) for name in ("ins_alt", "irs_altitude", "alt_ellipsoid", "GPS_h", "AltGPS")),
        ("alt,ftmsl", "gps_altitude", "ft"),
        ("RALT", "radio_altitude", None),
        ("hgt", None, None),
        ("gps_lat", "latitude", None),
        ("gps_lon", "longitude", None),
        ("gps_speed", "ground_speed", None),
        ("gps_vn", "velocity_north", None),
        ("gps_vs", "gps_altitude_rate", None),
        ("VSpdG", "gps_altitude_rate", None),
        ("irs_vertical_speed_ft_min", "gps_altitude_rate", "ft/min"),
        ("ins_pitch", "pitch", None),
        ("GPS Ground Track", "track", None),
        *((name, None, None) for name in ("gps_tas", "imu_ias", "gps_mach", "gps_ps", "ins_sat", "irs_baro_alt")),
        ("Gload,norml", "normal_acc", "g"),
        ("q", "pitch_rate", None),
        ("theta", "pitch", None),
        ("Mach", "mach", None),
        ("TimeUS", "time", "us"),
        ("time_ms", "time", "ms"),
        ("t", "time", None),
        ("baro_alt_meter", "baro_altitude", "m"),
        ("tas_deg", None, None),
        ("xyz[0]", None, None),
        ("", None, None),
    ],
)
def test_names_of_known_recorders(source: str, name: str | None, unit: str | None):
    match = match_name(source)
    assert (match and match.name) == name
    if match is not None:
        assert (match.unit and to_si(1.0, match.unit)) == (unit and to_si(1.0, unit))


@pytest.mark.parametrize(
    ("header", "parts"),
    [
        ("tas [kt]", ("tas", "kt")),
        (" tas[kt] ", ("tas", "kt")),
        ("p (hPa)", ("p", "hPa")),
        ("aoa (left)", ("aoa (left)", None)),
        ("mach [1]", ("mach", "1")),
        ("mach []", ("mach", "")),
        ("accel[1]", ("accel[1]", None)),
        ("tas", ("tas", None)),
        ("[kt]", ("[kt]", None)),
    ],
)
def test_units_in_a_header(header: str, parts: tuple[str, str | None]):
    assert split_unit(header) == parts


@given(text=st.text(max_size=30))
def test_any_text_has_a_name_a_unit_or_neither(text: str):
    match_name(text)
    name, _ = split_unit(text)
    assert name in text
    if si_unit(text) is None and text.strip():
        with pytest.raises(LogError, match="unknown unit"):
            to_si(1.0, text)
    else:
        assert to_si(1.0, text)[1] in {"", *(c.si for c, _ in CONVERSIONS)}


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        *[(name, "tas") for name in ("TAS", "airspeed", "Air_Speed", "vtas", "true airspeed")],
        *[(name, "elevator") for name in ("Elevator", "elevater")],
        *[(name, None) for name in ("cas", "stick", "aoa", "groundspeed")],
    ],
)
def test_a_channel_that_is_meant_is_one_of_the_log_and_never_another_quantity(name: str, meant: str | None):
    assert meant_channel(name, ["elevator", "pitch", "tas"]) == meant


def test_a_numbered_sensor_is_meant_where_the_plain_name_is_missing():
    assert meant_channel("tas", ["cas", "tas_1", "tas_2"]) == "tas_1"
