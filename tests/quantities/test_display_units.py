"""Units for people: exact factors, rates and differences without offsets, and the way back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.faults.shapes import SHAPES
from bfi_cli.quantities.channels import STANDARD, to_si
from bfi_cli.quantities.text import AVIATION, SI, UNITS

KNOT, FOOT, DEGREE = (
    1852 / 3600,
    0.3048,
    math.pi / 180.0,
)  # both by definition: BIPM, the SI brochure, table 8, and 1959


@pytest.mark.parametrize(
    ("unit", "channel", "shown", "factor"),
    [
        ("m/s", "tas", "kt", KNOT),
        ("m/s", "", "kt", KNOT),
        ("m/s", "wind_north", "kt", KNOT),
        ("m/s^2", "tas", "kt/s", KNOT),
        ("m/s^3", "cas", "kt/s^2", KNOT),
        ("m/s", "altitude_rate", "ft/min", FOOT / 60),
        ("m/s^2", "altitude_rate", "ft/min/s", FOOT / 60),
        ("m", "altitude", "ft", FOOT),
        ("m/s", "altitude", "ft/min", FOOT / 60),
        ("m/s^2", "normal_acc", "m/s^2", 1.0),
        ("m/s^3", "normal_acc", "m/s^3", 1.0),
        ("m/s^2", "", "m/s^2", 1.0),
        ("rad", "aoa", "deg", DEGREE),
        ("rad/s", "aoa", "deg/s", DEGREE),
        ("rad/s", "pitch_rate", "deg/s", DEGREE),
        ("rad/s^2", "pitch_rate", "deg/s^2", DEGREE),
        ("rad/s^3", "pitch_rate", "deg/s^3", DEGREE),
        ("Pa", "p_static", "hPa", 100.0),
        ("Pa/s", "p_static", "hPa/s", 100.0),
        ("K", "tat", "degC", 1.0),
        ("K/s", "tat", "degC/s", 1.0),
        *((unit, "", unit, 1.0) for unit in ("", "1", "1/s", "1/s^2", "s", "Hz", "N", "kg/s", "V")),
    ],
)
def test_aviation_units_have_the_published_factors(unit: str, channel: str, shown: str, factor: float):
    found = AVIATION.of(unit, channel=channel)
    assert (found.unit, found.factor) == (shown, pytest.approx(factor, rel=1e-15))
    assert found.change(factor) == pytest.approx(1.0, rel=1e-15)


def test_a_drift_of_a_channel_that_is_no_standard_one_is_told_by_the_unit_of_the_channel():
    assert AVIATION.of("m/s^2", channel="my_speed", channel_unit="m/s").unit == "kt/s"
    assert AVIATION.of("m/s^2", channel="my_acc", channel_unit="m/s^2").unit == "m/s^2"
    assert AVIATION.of("rad/s", channel="my_gyro", channel_unit="rad/s").unit == "deg/s"


def test_temperatures_have_an_offset_and_their_differences_and_rates_none():
    shown = AVIATION.of("K", channel="tat")
    assert shown.reading(273.15) == 0.0
    assert shown.reading(288.15) == pytest.approx(15.0, rel=1e-14)
    assert shown.change(2.5) == 2.5
    assert AVIATION.of("K/s", channel="tat").reading(2.5) == 2.5


def test_si_shows_angles_in_degrees_and_files_as_they_are():
    assert [SI.of(unit).unit for unit in ("rad", "rad/s", "m/s", "m", "K", "Pa")] == [
        *("deg", "deg/s", "m/s", "m", "K", "Pa")
    ]
    assert SI.of("m/s", channel="altitude").unit == "m/s"
    assert SI.of("m/s^2", channel="altitude_rate").unit == "m/s^2"
    assert SI.in_file("rad", channel="aoa").unit == "rad"
    assert AVIATION.in_file("rad", channel="aoa").unit == "deg"


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
@given(channel=st.sampled_from(sorted(STANDARD)), value=st.floats(-1e6, 1e6))
def test_readers_of_files_take_every_shown_unit_back(units, channel: str, value: float):
    si = STANDARD[channel].unit
    shown = units.of(si, channel=channel)
    back, unit = to_si(shown.reading(value), shown.unit)
    assert unit == si
    assert float(back) == pytest.approx(value, rel=1e-12, abs=1e-9)
    np.testing.assert_array_equal(shown.readings([value, value]), shown.reading(value))
    np.testing.assert_array_equal(shown.changes([value]), shown.change(value))


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
@pytest.mark.parametrize("channel", STANDARD)
def test_a_drift_over_ten_seconds_is_ten_times_its_rate(units, channel: str):
    """Two roads: the rate of the channel is converted and added up, or the error of the channel is converted."""
    own = STANDARD[channel].unit
    rate = SHAPES["drift"].magnitude_unit(own, slope=None)
    shown_rate, shown_error = units.of(rate, channel=channel), units.of(own, channel=channel)
    seconds = 10.0 / (60.0 if shown_rate.unit == "ft/min" and shown_error.unit == "ft" else 1.0)
    assert shown_rate.change(0.3) * seconds == pytest.approx(shown_error.change(3.0), rel=1e-12)


def test_absent_stays_absent():
    shown = AVIATION.of("m/s")
    assert (shown.reading(None), shown.change(None)) == (None, None)
    assert np.isnan(shown.readings([None, 1.0])[0])


@pytest.mark.parametrize(
    ("sentence", "shown"),
    [
        ("a slow fault could reach 5 m/s on tas unseen", "a slow fault could reach 9.7 kt on tas unseen"),
        ("no slow fault above 5 m/s on altitude_rate", "no slow fault above 984 ft/min on altitude_rate"),
        ("a drift of 0.1 m/s^2 on tas from 3 s", "a drift of 0.19 kt/s on tas from 3 s"),
        ("a bias of 3.99 to 4.02 m/s", "a bias of 7.76 to 7.81 kt"),
        (
            "the calmest flight of the log moves by 120 Pa, too calm",
            "the calmest flight of the log moves by 1.2 hPa, too",
        ),
        ("'elevator' hardly moves (range 0.0004 rad); the", "'elevator' hardly moves (range 0.023 deg); the"),
        ("1000 m above", "3281 ft above"),
        ("'normal_acc' has a median of 9.81 m/s^2", "'normal_acc' has a median of 9.81 m/s^2"),
        ("in 240 s, at 4.5 Hz, 0.02 1/s, 3 metres", "in 240 s, at 4.5 Hz, 0.02 1/s, 3 metres"),
        ("flight_5 m.csv, '4 m', tas=4 m", "flight_5 m.csv, '4 m', tas=4 m"),
        (
            "'probe 12 m/s aft' differs from 'it's 3 m' and \"4 m\" by 5 m/s",
            "'probe 12 m/s aft' differs from 'it's 3 m' and \"4 m\" by 9.7 kt",
        ),
        (
            "the log's limit of 5 m/s is the aircraft's, not the pilots' 10 m/s",
            "the log's limit of 9.7 kt is the aircraft's, not the pilots' 19 kt",
        ),
        (
            "'tas' reaches 500 m/s, which no aircraft does: is it in km/h or kt? --unit tas=UNIT states another",
            "'tas' reaches 500 m/s, which no aircraft does: is it in km/h or kt? --unit tas=UNIT states another",
        ),
    ],
)
def test_stored_sentences_are_told_in_other_units_and_stay_in_si(sentence: str, shown: str):
    assert AVIATION.sentence(sentence).startswith(shown)
    assert SI.sentence(sentence) == sentence


def test_a_sentence_about_a_channel_takes_its_unit():
    assert AVIATION.sentence("declares 2 m/s", channel="altitude_rate") == "declares 394 ft/min"
