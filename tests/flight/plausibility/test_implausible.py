"""What arithmetic says of the channels of a flight in other units, signs or places, or with a constant error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight
from made_journeys import UNITS, made_journey
from made_logs import made_log

from bfi_cli.flight.plausibility import Implausible, implausible_channels, in_words, with_fixed_units
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array

KNOT, FOOT, DEGREE, G = 1852.0 / 3600.0, 0.3048, np.pi / 180.0, 9.80665
Change = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def flight() -> FlightLog:
    """Return a healthy flight with body rates; the aircraft turns as its bank tells."""
    log = made_journey()
    pitch, roll, speed = (log.channels[name].values for name in ("pitch", "roll", "tas"))
    turning = G * np.tan(roll) / np.maximum(speed, 20.0)
    pitching, rolling = (np.gradient(one, log.time_s) for one in (pitch, roll))
    rates = {
        "roll_rate": rolling - turning * np.sin(pitch),
        "pitch_rate": pitching * np.cos(roll) + turning * np.sin(roll) * np.cos(pitch),
        "yaw_rate": -pitching * np.sin(roll) + turning * np.cos(roll) * np.cos(pitch),
    }
    values = {name: channel.values for name, channel in log.channels.items()}
    return made_log(log.time_s, {**UNITS, **dict.fromkeys(rates, "rad/s")}, **values, **rates)


def changed(log: FlightLog, **changes: Change) -> FlightLog:
    """Return the log with some channels recorded in another way."""
    channels = {
        name: replace(one, values=frozen_array(changes[name](one.values))) if name in changes else one
        for name, one in log.channels.items()
    }
    return replace(log, channels=channels)


def found(log: FlightLog) -> Implausible:
    (one,) = implausible_channels(log)
    return one


def times(factor: float) -> Change:
    return lambda values: values * factor


def plus(offset: float) -> Change:
    return lambda values: values + offset


@pytest.mark.first_rows(2)
@pytest.mark.parametrize(
    ("changes", "what", "unit", "factor"),
    [
        ({"tas": times(1.0 / KNOT)}, "unit", "kt", KNOT),
        ({"tas": times(3.6)}, "unit", "km/h", 1.0 / 3.6),
        ({"tas": times(1.0 / KNOT), "cas": times(1.0 / KNOT)}, "unit", "kt", KNOT),
        ({"altitude": times(1.0 / FOOT)}, "unit", "ft", FOOT),
        ({"altitude_rate": times(60.0 / FOOT)}, "unit", "ft/min", FOOT / 60.0),
        ({"sat": plus(-273.15)}, "unit", "degc", 1.0),
        ({"tat": plus(-273.15), "sat": plus(-273.15)}, "unit", "degc", 1.0),
        ({"aoa": times(1.0 / DEGREE)}, "unit", "deg", DEGREE),
        ({"pitch": times(1.0 / DEGREE), "roll": times(1.0 / DEGREE)}, "unit", "deg", DEGREE),
        ({"pitch_rate": times(1.0 / DEGREE)}, "unit", "deg/s", DEGREE),
        ({"normal_acc": times(1.0 / G)}, "unit", "g", G),
        ({"longitudinal_acc": times(1.0 / G)}, "unit", "g", G),
        ({"aoa": times(-1.0)}, "sign", "", -1.0),
        ({"pitch": times(-1.0)}, "sign", "", -1.0),
        ({"roll": times(-1.0)}, "sign", "", -1.0),
        ({"roll_rate": times(-1.0)}, "sign", "", -1.0),
        ({"normal_acc": times(-1.0)}, "sign", "", -1.0),
        ({"longitudinal_acc": times(-1.0)}, "sign", "", -1.0),
    ],
)
def test_a_unit_and_a_sign_are_named(flight, changes: dict[str, Change], what: str, unit: str, factor: float):
    one = found(changed(flight, **changes))
    assert (one.what, set(one.channels), one.unit) == (what, set(changes), unit)
    assert one.factor == pytest.approx(factor)
    assert one.is_certain
    assert set(one.agrees_with).isdisjoint(changes)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("channel", "offset", "within"),
    [
        ("tas", 10.0, 0.1),
        ("tas", -2.0, 0.1),
        ("cas", 5.0, 0.2),
        ("mach", 0.03, 0.001),
        ("altitude", 100.0, 5.0),
        ("sat", 12.0, 0.2),
        ("aoa", 1.5 * DEGREE, 0.1 * DEGREE),
        ("altitude_rate", 3.0, 0.1),
        ("longitudinal_acc", 1.0, 0.05),
    ],
)
def test_a_constant_error_is_measured(flight, channel: str, offset: float, within: float):
    one = found(changed(flight, **{channel: plus(offset)}))
    assert one.what == "offset"
    assert one.channels == (channel,)
    assert one.offset == pytest.approx(-offset, abs=within)
    assert not one.is_certain


def test_a_scale_is_measured(flight):
    one = found(changed(flight, mach=times(1.1)))
    assert (one.what, one.channels) == ("scale", ("mach",))
    assert one.factor == pytest.approx(1.0 / 1.1, rel=0.01)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("pair", [("tas", "cas"), ("pitch", "roll"), ("pitch_rate", "roll_rate"), ("tat", "sat")])
def test_channels_in_each_others_place_are_named(flight, pair: tuple[str, str]):
    values = {one: flight.channels[other].values for one, other in (pair, pair[::-1])}
    one = found(changed(flight, **{name: lambda _, name=name: values[name] for name in pair}))
    assert (one.what, set(one.channels)) == ("swapped", set(pair))


@pytest.mark.parametrize(("slower", "words"), [(10.0, "ten times too slow"), (0.1, "ten times too fast")])
def test_a_clock_that_runs_wrong_is_named(flight, slower: float, words: str):
    one = found(replace(flight, time_s=flight.time_s * slower))
    assert (one.what, one.channels, one.unit) == ("clock", (), words)


def test_a_record_that_runs_backwards_is_named(flight):
    one = found(changed(flight, **dict.fromkeys(flight.channels, lambda values: values[::-1])))
    assert (one.what, one.unit) == ("clock", "backwards")


def test_a_healthy_flight_is_plausible(flight):
    assert implausible_channels(flight) == ()
    assert implausible_channels(made_flight()) == ()


def test_what_begins_during_the_flight_is_left_to_the_analyses(flight):
    late = flight.time_s > 300.0
    assert implausible_channels(changed(flight, tas=lambda values: values + 20.0 * late)) == ()


@pytest.mark.parametrize("course", [1.0, 0.12])
def test_what_begins_in_the_first_minutes_is_no_constant_error(flight, course: float):
    started = np.clip((flight.time_s - flight.time_s[0] - 90.0) / (course * 300.0), 0.0, 1.0)
    for name, size in (("aoa", 6.0 * DEGREE), ("tas", 18.0)):
        assert implausible_channels(changed(flight, **{name: lambda x, size=size: x + size * started})) == ()


def test_a_constant_error_that_changes_is_what_it_is_before(flight):
    late = flight.time_s > flight.time_s[0] + 0.85 * np.ptp(flight.time_s)
    one = found(changed(flight, tas=lambda values: values + 10.0 + 20.0 * late))
    assert (one.what, one.channels) == ("offset", ("tas",))
    assert one.offset == pytest.approx(-10.0, abs=0.5)


@pytest.mark.slow
def test_a_constant_error_has_an_interval_and_a_scale_too(flight):
    one = found(changed(flight, tas=plus(10.0)))
    assert one.offset_ci95 is not None
    assert one.offset_ci95[0] < one.offset < one.offset_ci95[1]
    assert one.factor_ci95 is None
    scaled = found(changed(flight, mach=times(1.1)))
    assert scaled.factor_ci95 is not None
    assert scaled.factor_ci95[0] < scaled.factor < scaled.factor_ci95[1]


def test_a_channel_that_no_aircraft_has_is_set_aside_and_says_nothing_of_others(flight):
    index = changed(flight, aoa=lambda values: -0.7 + 0.3 * np.sin(flight.time_s / 40.0) + 0.0 * values)
    one = found(index)
    assert (one.what, one.channels, one.fixed, one.is_open) == ("impossible", ("aoa",), True, False)
    assert "(-37.5 degrees)" in one.text
    assert "index" in one.text
    both = implausible_channels(changed(index, tas=plus(10.0)))
    assert [(one.what, one.channels) for one in both] == [("impossible", ("aoa",)), ("offset", ("tas",))]
    assert "aoa" not in both[1].agrees_with


def test_a_log_of_the_ground_or_about_zero_is_not_judged(flight):
    assert implausible_channels(changed(flight, **dict.fromkeys(("tas", "cas", "mach"), times(0.01)))) == ()
    about_zero = made_log(np.arange(600) / 10.0, tas=np.sin(np.arange(600.0)), cas=np.zeros(600))
    assert implausible_channels(about_zero) == ()


def test_channels_of_one_relation_are_all_named(flight):
    two = {
        name: flight.channels[name]
        for name in ("tas", "altitude_rate", "altitude", "ground_speed")
        if name in flight.channels
    }
    one = found(changed(replace(flight, channels=two), altitude_rate=plus(4.0)))
    assert one.channels == ("altitude_rate",)  # no constant error of an altitude makes a rate
    three = {name: flight.channels[name] for name in ("tas", "mach", "sat")}
    one = found(changed(replace(flight, channels=three), tas=times(1.05)))
    assert {*one.channels, *one.rivals} == {"tas", "mach", "sat"}


def test_what_is_certain_is_fixed(flight):
    log = changed(flight, tas=times(1.0 / KNOT))
    fixed, findings = with_fixed_units(log, implausible_channels(log))
    np.testing.assert_allclose(fixed.channels["tas"].values, flight.channels["tas"].values)
    assert [one.fixed for one in findings] == [True]
    assert "--fix-units" in fixed.notes[-1].text
    assert in_words(findings) == ""
    assert implausible_channels(fixed) == ()
    wrong = changed(flight, tas=plus(10.0))
    assert with_fixed_units(wrong, implausible_channels(wrong))[0] is wrong


def test_the_words_say_what_to_state(flight):
    said = in_words(implausible_channels(changed(flight, tas=times(1.0 / KNOT))))
    assert said.startswith("state the unit with --unit tas=kt: tas looks like kt: x 0.514 agrees with mach and ")
    assert in_words(implausible_channels(changed(flight, tas=plus(10.0)))).startswith("check tas: tas is 10 m/s above ")


def stating(log: FlightLog, **units: str) -> FlightLog:
    """Return the log whose file states the units of some channels."""
    stated = {name: replace(log.channels[name], source_unit=unit) for name, unit in units.items()}
    return replace(log, channels={**log.channels, **stated})


def test_a_stated_unit_is_kept_and_its_doubt_names_nothing(flight):
    doubt = found(stating(changed(flight, tas=times(1.0 / KNOT)), tas="m/s"))
    assert (doubt.what, doubt.unit, doubt.is_stated, doubt.is_open) == ("unit", "kt", True, False)
    assert doubt.text.startswith("tas is stated in m/s and looks like kt: x 0.514 agrees with ")
    assert in_words([doubt]) == ""


def test_of_two_units_the_one_that_is_not_stated_is_to_blame(flight):
    """Either the airspeed is in km/h, or the ground speed was m/s where km/h is stated."""
    channels = {name: flight.channels[name] for name in ("tas", "altitude")}
    channels["ground_speed"] = replace(flight.channels["tas"], name="ground_speed", source="ground_speed")
    log = stating(changed(replace(flight, channels=channels), tas=times(3.6)), ground_speed="km/h")
    doubt = found(log)
    assert (doubt.channels, doubt.unit, doubt.rivals, doubt.is_open) == (("tas",), "km/h", (), True)


def test_an_indicated_airspeed_is_held_against_ground_speed_as_a_true_one(flight):
    """At 10.7 km 140 m/s of indicated airspeed are 240 m/s."""
    t = np.arange(900.0)
    steady = {"altitude": 10_668.0 + 2.0 * np.sin(t / 30.0), "ground_speed": 241.0 + np.sin(t / 50.0)}
    units = {"ias": "m/s", "ground_speed": "m/s", "altitude": "m", "gps_altitude": "m"}
    assert implausible_channels(made_log(t, units, ias=138.9 + np.sin(t / 40.0), **steady)) == ()
    # With nothing that tells the height the two are not compared.
    del steady["altitude"]
    assert implausible_channels(made_log(t, units, ias=138.9 + np.sin(t / 40.0), **steady)) == ()
    steady["gps_altitude"] = 10_900.0 + np.sin(t)
    (one,) = implausible_channels(made_log(t, units, ias=270.0 + np.sin(t / 40.0), **steady))
    assert (one.what, one.unit) == ("unit", "kt")
