"""Static relations: the channel that errs is named, and nothing else is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from made_flights import RECORDED, made_flight
from made_logs import made_log

from bfi_cli.airdata import (
    calibrated_airspeed,
    impact_pressure_of_mach,
    isa_temperature,
    pressure_at,
    speed_of_sound,
)
from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flight.diagnose import diagnose_flight
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.naming import vote_against
from bfi_cli.flight.parity.relation_series import relation_series
from bfi_cli.flight.parity.static_relations import THRESHOLD, find_static
from bfi_cli.flight.parity.stuck import stuck_errors
from bfi_cli.flight.relations import drafts_of_relations, find_relations
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import Channel, frozen_array
from bfi_cli.model.preprocessing.defaults import tolerance_of
from bfi_cli.serialization import to_plain

FROM_S, TO_S, ONSET_S = 240.0, 360.0, 300.0
STEPS = {"altitude": 0.3048, "cas": 0.0322, "tas": 0.0322, "mach": 1e-4, "tat": 0.25, "sat": 0.25}


def with_error(log: FlightLog, channel: str, size: float, shape: str = "bias") -> FlightLog:
    return inject(log, [Fault(shape=shape, channel=channel, magnitude=size, onset_s=ONSET_S)])


def with_channel(log: FlightLog, name: str, values: np.ndarray, unit: str = "m/s") -> FlightLog:
    channel = Channel(name=name, values=frozen_array(values), unit=unit, source=name)
    return replace(log, channels={**log.channels, name: channel})


@pytest.mark.parametrize(
    ("channel", "size", "among"),
    [
        ("tas", 0.01, {"tas"}),
        ("tat", 0.1, {"tat"}),
        ("sat", -0.1, {"sat"}),
        ("mach", 1e-4, {"mach"}),
        ("cas", 0.05, {"cas", "altitude"}),
        ("altitude", 5.0, {"cas", "altitude"}),
    ],
)
def test_without_noise_an_error_is_named_exactly(channel: str, size: float, among: set[str]):
    answer = find_static(with_error(made_flight(), channel, size), FROM_S, TO_S)
    (found,) = answer.findings
    assert set(found.among) == among
    assert found.stage == "static relations"
    assert found.shape == "bias"
    assert found.onset_s == pytest.approx(ONSET_S, abs=1.0)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    if len(among) == 1:
        assert found.magnitude == pytest.approx(size, rel=5e-3)
        assert found.effect[channel] == pytest.approx(abs(size), rel=5e-3)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("grows_s", "until_s"), [(400.0, 720.0), (440.0, 1020.0)])
def test_a_ramp_is_described_in_eight_minutes_and_in_more_while_it_grows(grows_s: float, until_s: float):
    """From the first window of two minutes that shows it; what windows show later belongs to the same event."""
    ramp = Fault(shape="ramp_hold", channel="tas", magnitude=0.01 * grows_s, duration_s=grows_s, onset_s=ONSET_S)
    log = made_flight(seconds=until_s + 80.0, rate_hz=2.0, names=("altitude", "cas", "mach", "tas", "sat"))
    flight = flight_of(inject(log, [ramp]), Config())
    (draft,) = drafts_of_relations(flight, find_relations(flight))
    assert draft.window == (120.0, until_s)
    assert draft.until_s >= 780.0
    assert (draft.finding.shape, draft.finding.constant_s) == ("ramp_hold", pytest.approx(grows_s, abs=1.0))


def test_a_drift_is_a_drift():
    (found,) = find_static(with_error(made_flight(), "tas", 0.002, "drift"), FROM_S, TO_S).findings
    assert (found.fault, found.shape, found.unit) == ("tas", "drift", "m/s^2")
    assert found.magnitude == pytest.approx(0.002, rel=0.01)
    assert found.effect["tas"] == pytest.approx(0.002 * (TO_S - ONSET_S), rel=0.05)


@pytest.mark.parametrize("steps", [None, STEPS], ids=["exact", "recorded in steps"])
def test_without_a_fault_nothing_is_found(steps: Mapping[str, float] | None):
    log = made_flight(steps=steps)
    series = relation_series(log)
    for from_s in range(0, 480, 30):
        assert find_static(log, from_s, from_s + 120.0, series=series).findings == ()


@pytest.mark.parametrize("channel", ["tas", "tat", "mach", "altitude"])
def test_an_error_from_the_start_is_none_of_the_window(channel: str):
    """A constant is a nuisance: every channel has an offset of its own."""
    size = 1e-3 if channel == "mach" else 0.4
    log = inject(made_flight(steps=STEPS), [Fault(shape="bias", channel=channel, magnitude=size, onset_s=-1.0)])
    assert find_static(log, FROM_S, TO_S).findings == ()


@pytest.mark.parametrize(
    "fault",
    [
        Fault(shape="pitot_icing", magnitude=0.002, onset_s=ONSET_S),
        Fault(shape="pitot_blocked", onset_s=ONSET_S),
        Fault(shape="static_blocked", onset_s=ONSET_S),
        Fault(shape="static_leak", onset_s=ONSET_S, time_constant_s=20.0, cabin_altitude_m=1500.0),
    ],
    ids=lambda fault: fault.shape,
)
def test_a_wrong_pressure_breaks_no_relation(fault: Fault):
    assert find_static(inject(made_flight(), [fault]), FROM_S, TO_S).findings == ()


# m/s, K, m: a recorder of light aircraft keeps the true airspeed in whole knots and the indicated one in hundredths.
LIGHT = {"tas": 0.5144, "ias": 0.0051, "sat": 0.1, "altitude": 0.0305}


def light_aircraft(
    steps: Mapping[str, float] | None = None, position_error: float = 0.0, gusts: float = 1.0
) -> FlightLog:
    """Return tas, ias, altitude and sat of a cruise with slow flight in it; ias errs with the coefficient of lift."""
    time_s = np.arange(0.0, 600.0, 1.0 if steps else 0.1)
    rng, hat = np.random.default_rng(0), np.hanning(round(20.0 / time_s[1]))
    gust, rise = (np.convolve(rng.standard_normal(time_s.size), hat, "same") / np.linalg.norm(hat) for _ in range(2))
    altitude = 1000.0 + 100.0 * np.sin(time_s / 50.0) + 5.0 * rise
    sat, p_static = isa_temperature(altitude) + 4.0, pressure_at(altitude)
    tas = 50.0 - 24.0 * np.exp(-(((time_s - 330.0) / 40.0) ** 2)) + gusts * gust
    cas = calibrated_airspeed(impact_pressure_of_mach(tas / speed_of_sound(sat), p_static))
    signals = {"altitude": altitude, "sat": sat, "tas": tas, "ias": cas - position_error * 45.0**2 / cas}
    for name, step in (steps or {}).items():
        signals[name] = np.round(signals[name] / step) * step
    return made_log(time_s, {"altitude": "m", "sat": "K"}, **signals)


@pytest.mark.parametrize(
    ("channel", "size", "among"),
    [("tas", 0.01, {"tas", "ias"}), ("ias", 0.02, {"tas", "ias"}), ("sat", 0.2, {"sat"})],
)
def test_an_error_of_true_or_indicated_airspeed_is_told_without_a_calibrated_one(channel, size, among):
    (found,) = find_static(with_error(light_aircraft(), channel, size), FROM_S, TO_S).findings
    assert set(found.among) == among
    assert found.onset_s == pytest.approx(ONSET_S, abs=1.0)


@pytest.mark.parametrize("position_error", [0.0, 0.2])
@pytest.mark.parametrize("steps", [None, LIGHT], ids=["exact", "recorded in steps"])
def test_neither_whole_knots_nor_the_position_of_the_ports_are_a_fault(steps, position_error):
    log = light_aircraft(steps, position_error)
    series = relation_series(log)
    for from_s in range(0, 480, 30):
        assert find_static(log, from_s, from_s + 120.0, series=series).findings == ()


def test_the_steps_of_a_true_airspeed_are_none_that_its_relation_follows():
    """Less a share of tas the relation has less noise than whole knots make, and a change makes up for the share."""
    log = light_aircraft(LIGHT, gusts=0.2)
    series = relation_series(log)
    answers = [find_static(log, from_s, from_s + 120.0, series=series) for from_s in range(180, 330, 10)]
    assert max(one.statistic for answer in answers for one in answer.relations if one.name == "tas") < THRESHOLD


@pytest.mark.parametrize("shape", ["pitot_blocked", "static_blocked", "pitot_icing"])
def test_a_line_fault_breaks_no_relation_of_the_indicated_airspeed(shape):
    magnitude = {"magnitude": 0.002} if shape == "pitot_icing" else {}
    log = inject(light_aircraft(LIGHT), [Fault(shape=shape, onset_s=ONSET_S, **magnitude)])
    assert find_static(log, FROM_S, TO_S).findings == ()


def test_an_error_of_a_tenth_of_a_metre_per_second_is_found_in_recorded_steps():
    log = made_flight(steps=STEPS)
    (found,) = find_static(with_error(log, "tas", 0.1), FROM_S, TO_S).findings
    assert found.among == ("tas",)
    assert abs((found.magnitude or 0.0) - 0.1) < 4.0 * (found.sd or 0.0)


def stuck_values(log: FlightLog, quantity: str, shape: str) -> np.ndarray:
    """Return what a sensor of its own ports reads that is stuck from the onset on."""
    if shape == "frozen":
        values = log.channels[quantity].values
        return np.where(log.time_s >= ONSET_S, values[np.argmax(log.time_s >= ONSET_S)], values)
    return np.asarray(inject(log, [Fault(shape=shape, onset_s=ONSET_S)]).channels[quantity].values)


@pytest.mark.parametrize("quantity", ["tas", "cas", "mach"])
@pytest.mark.parametrize("shape", ["frozen", "pitot_blocked", "static_blocked"])
def test_what_a_stuck_sensor_reads_follows_from_its_twin(quantity: str, shape: str):
    flight = made_flight()
    values = {name: channel.values for name, channel in flight.channels.items()}
    air = {name: values[name] for name in ("altitude", "tat")}
    stuck, during = stuck_values(flight, quantity, shape), (flight.time_s >= ONSET_S)[:, None]
    errors = stuck_errors(quantity, stuck, values[quantity], air, during)[shape][:, 0]
    assert values[quantity] + errors == pytest.approx(stuck, rel=1e-5)


@pytest.mark.first_rows(7)
@pytest.mark.parametrize("faulty", ["tas", "tas_2"])
@pytest.mark.parametrize("shape", ["frozen", "pitot_blocked", "static_blocked"])
@pytest.mark.parametrize("alone", [True, False], ids=["of two airspeeds", "beside mach and tat"])
def test_of_two_sensors_the_one_that_is_stuck_is_named(faulty: str, shape: str, alone: bool):
    """In a window in which it begins, in one in which it lasts, and in one in which it ends."""
    flight, until_s = made_flight(steps=STEPS), ONSET_S + 150.0
    healthy = flight.channels["tas"].values
    stuck = np.where(flight.time_s < until_s, stuck_values(flight, "tas", shape), healthy)
    first, second = (stuck, healthy) if faulty == "tas" else (healthy, stuck)
    kept = made_flight(names=("altitude", "tas")) if alone else flight
    log = with_channel(with_channel(kept, "tas", first), "tas_2", second + 0.3)
    series = relation_series(log)
    for from_s, begins, ends in ((240.0, True, False), (325.0, False, False), (380.0, False, True)):
        (found,) = find_static(log, from_s, from_s + 120.0, series=series).findings
        assert (found.among, found.shape) == ((faulty,), shape)
        assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
        assert np.isfinite(found.onset_ci95[0]) == begins
        assert found.offset_s == (pytest.approx(until_s, abs=2.0) if ends else None)
        inside = (log.time_s >= from_s) & (log.time_s < from_s + 120.0)
        assert found.effect[faulty] == pytest.approx(np.abs(stuck - healthy)[inside].max(), rel=0.15)


def test_a_stuck_sensor_is_diagnosed_from_its_onset_to_its_end():
    flight, until_s = made_flight(steps=STEPS), ONSET_S + 150.0
    healthy = flight.channels["tas"].values
    stuck = np.where(flight.time_s < until_s, stuck_values(flight, "tas", "pitot_blocked"), healthy)
    log = with_channel(made_flight(names=("altitude", "tas")), "tas_2", stuck)
    part = flight_of(log, Config())
    (draft,) = drafts_of_relations(part, find_relations(part))
    found = draft.finding
    assert (found.among, found.shape) == (("tas_2",), "pitot_blocked")
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.offset_s == pytest.approx(until_s, abs=2.0)


def test_a_second_sensor_shows_which_of_two_errs_where_a_third_does():
    flight = made_flight(names=("altitude", "tas"))
    two = with_channel(flight, "tas_2", flight.channels["tas"].values + 0.3)
    (found,) = find_static(with_error(two, "tas_2", 0.5), FROM_S, TO_S).findings
    assert set(found.among) == {"tas", "tas_2"}
    three = with_channel(two, "tas_3", flight.channels["tas"].values - 0.1)
    (found,) = find_static(with_error(three, "tas_2", 0.5), FROM_S, TO_S).findings
    assert found.among == ("tas_2",)
    assert vote_against(found, list(three.channels)) == "tas and tas_3 agree with each other and not with it"
    assert vote_against(found, list(two.channels)) == ""
    assert found.magnitude == pytest.approx(0.5, rel=1e-3)


def test_numbered_sensors_without_a_plain_name_are_a_pair():
    flight = made_flight(names=("cas", "altitude"))
    values = flight.channels["cas"].values
    pair = with_channel(with_channel(made_flight(names=("tas", "altitude")), "cas_1", values), "cas_2", values + 0.01)
    assert [one.relation.name for one in relation_series(pair)[0]] == ["cas_1 - cas_2"]
    (found,) = find_static(with_error(pair, "cas_1", 1.0), FROM_S, TO_S).findings
    assert set(found.among) == {"cas_1", "cas_2"}


@pytest.mark.parametrize("faulty", ["tas_1", "tas_2"])
@pytest.mark.parametrize(("size", "shape"), [(0.5, "bias"), (0.01, "drift")])
def test_physics_tells_which_of_two_numbered_sensors_errs(faulty: str, size: float, shape: str):
    log = _with_two("tas", made_flight(), 0.3)
    (found,) = find_static(with_error(log, faulty, size, shape), FROM_S, TO_S).findings
    assert found.among == (faulty,)
    assert found.magnitude == pytest.approx(size, rel=0.02)


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("faulty", ["tas_1", "tas_2", "mach_1", "mach_2", "sat_1", "sat_2"])
def test_two_air_data_computers_are_each_held_against_their_own_channels(faulty: str):
    log = made_flight()
    for quantity, offset in (("tas", 0.3), ("mach", 1e-3), ("sat", 0.2)):
        log = _with_two(quantity, log, offset)
    size = 1e-3 if "mach" in faulty else 0.5
    (found,) = find_static(with_error(log, faulty, size), FROM_S, TO_S).findings
    assert found.among == (faulty,)
    assert find_static(log, FROM_S, TO_S).findings == ()


@pytest.mark.parametrize("quantity", ["tas", "cas"])
def test_two_sensors_alone_fly(quantity: str):
    only = made_flight(names=(quantity, "altitude"))
    log = _with_two(quantity, only, 0.3)
    assert phases_of(log) == phases_of(only)
    (found,) = find_static(with_error(log, f"{quantity}_2", 0.5), FROM_S, TO_S).findings
    assert set(found.among) == {f"{quantity}_1", f"{quantity}_2"}
    assert tolerance_of(log, log, f"{quantity}_1") == tolerance_of(only, only, quantity)


def _with_two(quantity: str, log: FlightLog, offset: float) -> FlightLog:
    """Return the log with two sensors of a quantity, under numbered names, in place of its one."""
    only = log.channels[quantity]
    others = {name: channel for name, channel in log.channels.items() if name != quantity}
    log = with_channel(replace(log, channels=others), f"{quantity}_1", only.values, only.unit)
    return with_channel(log, f"{quantity}_2", only.values + offset, only.unit)


def test_what_the_log_lacks_is_said():
    log = made_flight(names=("altitude", "tas"))
    answer, (_, missing) = find_static(log, FROM_S, TO_S), relation_series(log)
    assert answer.findings == answer.relations == answer.limits == ()
    assert any("lacks tat or sat, mach, or cas and altitude" in why for why in missing)
    assert any("lacks mach, cas" in why for why in missing)


def test_a_short_window_has_no_relations_and_a_log_on_the_ground_says_so():
    answer = find_static(made_flight(), 100.0, 120.0)
    assert answer.findings == answer.relations == ()
    rest = made_flight()
    still = made_log(rest.time_s, {}, **{name: np.zeros(rest.n_samples) for name in ("tas", "mach", "tat")})
    assert relation_series(still)[1] == ("no relation is checked: the log shows no flight",)


def test_samples_that_are_missing_are_left_out():
    log = with_error(made_flight(), "tas", 0.05)
    values = np.array(log.channels["mach"].values)
    values[2500:2600] = np.nan
    (found,) = find_static(with_channel(log, "mach", values, "1"), FROM_S, TO_S).findings
    assert found.among == ("tas",)


def test_a_limit_holds():
    """An error of three times what a window excludes is found there, one of a tenth is not."""
    log = made_flight(steps=STEPS)
    limits = {(one.channel, one.shape): one for one in find_static(log, FROM_S, TO_S).limits}
    assert {channel for channel, _ in limits} == set(RECORDED)
    for channel in ("tas", "tat", "mach"):
        size = limits[channel, "bias"].sizes.max()
        assert find_static(with_error(log, channel, 3.0 * size), FROM_S, TO_S).findings
        assert not find_static(with_error(log, channel, 0.1 * size), FROM_S, TO_S).findings


def test_the_same_comes_of_series_made_before():
    log = with_error(made_flight(steps=STEPS), "tas", 0.2)
    made_before = find_static(log, FROM_S, TO_S, series=relation_series(log))
    assert to_plain(made_before) == to_plain(find_static(log, FROM_S, TO_S))


def test_a_pair_without_physics_is_diagnosed_as_a_pair():
    log = _with_two("tas", made_flight(names=("tas", "altitude")), 0.3)
    answer = diagnose_flight(with_error(log, "tas_2", 0.1, "drift"), Config(window={"from_s": FROM_S, "to_s": TO_S}))
    assert {name for event in answer.events for name in event.among} == {"tas_1", "tas_2"}


def test_what_no_recorded_step_explains_counts_three_times():
    """The steps of a temperature that rests for a minute have 3 times the standard deviation of pieces of 20 s."""
    log = made_flight()
    noise = 0.2 * np.random.default_rng(3).standard_normal(log.n_samples)
    noisy = with_channel(log, "tas", log.channels["tas"].values + noise)
    (shown,) = (series for series in relation_series(noisy)[0] if series.relation.name == "tas")
    a_second = (
        noise[: noise.size // round(log.rate_hz) * round(log.rate_hz)].reshape(-1, round(log.rate_hz)).mean(axis=1)
    )
    assert shown.noise_sd == pytest.approx(3.0 * np.std(a_second), rel=0.15)


def test_an_indicated_airspeed_may_err_with_the_coefficient_of_lift_as_handbooks_have_it():
    """By 0.1 m/s per m/s; what a relation may follow else is in m/s per m/s, m, m/s^2 and m/s of climb."""
    series = {one.relation.name: one for one in relation_series(light_aircraft(LIGHT))[0]}
    np.testing.assert_allclose(series["tas"].sizes[1:], [0.05, 2e-4, 0.1, 0.02, 0.1])
