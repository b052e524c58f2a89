"""Samples a second apart: means, integrals, gaps and faults that can be taken out again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flight import WIND, channels_at, log_of, made_log, made_record

from bfi_cli.flight.parity import record_of
from bfi_cli.flight.parity.record import HYPOTHESES, hypotheses, with_fault, without_fault

T = np.arange(121.0)
COURSE = np.maximum(T - 40.0, 0.0) / 80.0
LARGE = {"1": -0.3, "m/s": 10.0, "Pa": 500.0, "rad": 0.05, "m/s^2": 0.5}


@pytest.mark.parametrize("hypothesis", HYPOTHESES, ids=lambda one: one.fault)
def test_a_fault_taken_out_leaves_the_record_as_it_was(hypothesis):
    record = made_record()
    amount = (0.1 if hypothesis.fault == "mach" else LARGE[hypothesis.unit]) * COURSE
    faulty = with_fault(record, hypothesis.fault, amount)
    again = without_fault(faulty, hypothesis.fault, amount)
    assert any(np.abs(faulty.channels[name] - one).max() > 1e-3 for name, one in record.channels.items())
    for name, values in record.channels.items():
        np.testing.assert_allclose(again.channels[name], values, rtol=1e-10, atol=1e-12)


def test_a_fault_of_the_line_moves_what_follows_from_its_pressure_and_nothing_else():
    record = made_record()
    faulty = with_fault(record, "q_impact", -0.2 * COURSE)
    moved = {name for name, one in record.channels.items() if np.any(faulty.channels[name] != one)}
    assert moved == {"tas", "cas", "ias", "mach", "q_impact", "p_total", "sat"}
    np.testing.assert_allclose(faulty.channels["q_impact"], record.channels["q_impact"] * (1.0 - 0.2 * COURSE))


@pytest.mark.parametrize("lost", [0.5, 0.95, 0.995])
def test_what_is_nearly_lost_whole_comes_back_and_of_what_is_lost_whole_nothing_is_known(lost: float):
    record, whole = made_record(), np.ones(T.size)
    again = without_fault(with_fault(record, "q_impact", -lost * whole), "q_impact", -lost * whole)
    for name, values in record.channels.items():
        np.testing.assert_allclose(again.channels[name], values, rtol=1e-9, atol=1e-9)
    for gone in (1.0, 1.3):
        assert np.isnan(without_fault(record, "q_impact", -gone * whole).channels["tas"]).all()


def test_a_loss_of_the_pressure_is_half_the_loss_of_the_airspeed():
    record = made_record()
    faulty = with_fault(record, "q_impact", np.full(T.shape, -1e-4))
    lost = faulty.channels["tas"] / record.channels["tas"] - 1.0
    M = record.channels["mach"]
    x = record.channels["p_total"] / record.channels["p_static"]
    # d ln V / d ln qc by 15.4 of docs/theory.md; at low Mach numbers a half.
    slope = 5.0 / 7.0 * x ** (-5.0 / 7.0) * (x - 1.0) / M**2 / (1.0 + 0.2 * M**2)
    np.testing.assert_allclose(lost, -1e-4 * slope, rtol=1e-3)
    np.testing.assert_allclose(slope, 0.5, rtol=0.07)


def test_a_fault_of_the_only_airspeed_is_a_fault_of_the_true_airspeed_made_of_it():
    log = made_log()
    record = record_of(log_of(log.time_s, {n: c.values for n, c in log.channels.items() if n in ("cas", "altitude")}))
    assert record.airspeed == "cas"
    faulty = with_fault(record, "cas", np.full(record.time_s.shape, 1.0))
    assert np.all(faulty.channels["tas"] - record.channels["tas"] > 1.0)
    assert {one.fault for one in hypotheses(record)} == {"cas", "altitude_rate", "static_leak"}


def test_the_line_and_the_channel_are_two_faults_only_where_there_are_two_airspeeds():
    assert "q_impact" in {one.fault for one in hypotheses(made_record())}
    single = made_record(without=("cas", "ias", "mach", "q_impact", "p_total"))
    assert {one.fault for one in hypotheses(single)} == {
        *("tas", "aoa", "pitch", "normal_acc", "altitude_rate", "longitudinal_acc", "ground_speed", "static_leak")
    }


@pytest.mark.parametrize("start_s", [0.0, 1234.5678, -50.0, 1.7e9])
@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 10.0, 12.5])
def test_a_second_is_the_mean_of_its_samples_at_its_middle(start_s, rate_hz):
    """Of a straight line both are on it."""
    time_s = start_s + np.arange(round(60 * rate_hz)) / rate_hz
    record = record_of(log_of(time_s, {"tas": 50.0 + 0.5 * (time_s - start_s)}))
    np.testing.assert_allclose(np.diff(record.time_s), 1.0, rtol=1e-6)
    expected = 50.0 + 0.5 * (record.time_s - start_s)
    # At 12.5 Hz a second has 12 or 13 samples, so that their middle is off by up to half a step.
    np.testing.assert_allclose(record.channels["tas"][:-1], expected[:-1], atol=1e-5 if rate_hz != 12.5 else 0.021)


def test_below_a_sample_a_second_every_sample_keeps_its_time():
    time_s = 100.0 + 2.0 * np.arange(60)
    record = record_of(log_of(time_s, {"tas": 0.5 * time_s}))
    known = np.isfinite(record.channels["tas"])
    assert np.count_nonzero(known) == 60
    np.testing.assert_allclose(record.time_s[known], time_s)
    np.testing.assert_allclose(record.channels["tas"][known], 0.5 * record.time_s[known])


def test_less_than_half_of_a_second_is_none():
    log = made_log(20.0)
    values = {name: one.values.copy() for name, one in log.channels.items()}
    values["aoa"][50:56] = np.nan
    values["pitch"][50:55] = np.nan
    record = record_of(log_of(log.time_s, values))
    assert np.flatnonzero(np.isnan(record.channels["aoa"])).tolist() == [5]
    assert np.isfinite(record.channels["pitch"]).all()


def test_the_integral_of_the_acceleration_is_what_the_airspeed_gained():
    record = record_of(made_log(60.0, start_s=77.0))
    assert record.gained is not None
    np.testing.assert_allclose(np.diff(record.gained), np.diff(record.channels["tas"]), atol=2e-4)


def test_a_short_gap_is_bridged_and_a_long_one_is_none():
    log = made_log(60.0)
    values = {name: one.values.copy() for name, one in log.channels.items()}
    values["pitch"][100:120] = np.nan
    values["pitch"][300:400] = np.nan
    gained = record_of(log_of(log.time_s, values)).gained
    assert gained is not None
    assert np.isfinite(gained[:30]).all()
    assert np.isnan(gained[30:40]).all()
    assert np.isfinite(gained[40:]).all()
    tas = channels_at(np.arange(60) + 0.45)["tas"]
    np.testing.assert_allclose(gained[12:30] - gained[0], tas[12:30] - tas[0], atol=0.05)


def test_the_ground_velocity_of_a_position_is_that_of_the_channels():
    log = made_log(60.0)
    north, east = log.channels["velocity_north"].values, log.channels["velocity_east"].values
    latitude = 0.9 + np.cumsum(north) * 0.1 / 6.378e6
    longitude = 0.1 + np.cumsum(east) * 0.1 / (6.378e6 * np.cos(latitude))
    values = {name: one.values for name, one in log.channels.items() if not name.startswith("velocity")}
    record = record_of(log_of(log.time_s, values | {"latitude": latitude, "longitude": longitude}))
    seen = record_of(log).channels
    for name in ("velocity_north", "velocity_east"):
        np.testing.assert_allclose(record.channels[name][2:-2], seen[name][2:-2], rtol=0.01, atol=0.1)
    assert np.hypot(*WIND) > 5.0


def test_a_part_of_a_record_is_its_seconds():
    record = made_record(start_s=1000.5)
    part = record.between(1010.0, 1020.0)
    np.testing.assert_array_equal(part.time_s, 1010.5 + np.arange(10))
    np.testing.assert_array_equal(part.channels["tas"], record.channels["tas"][10:20])
    assert part.gained is not None
    assert len(part.gained) == 10


def test_a_log_of_two_samples_has_a_record():
    log = made_log()
    record = record_of(log.take(np.arange(log.n_samples) < 2))
    assert len(record.time_s) == 1


@pytest.mark.parametrize("airspeeds", [("q_impact",), ("q_impact", "tas"), ("q_impact", "mach", "cas")])
def test_an_impact_pressure_beside_no_static_pressure_is_no_line_that_could_fail(airspeeds):
    log = made_log(60.0)
    kept = {*airspeeds, "altitude_rate", "velocity_north", "velocity_east"}
    record = record_of(log_of(log.time_s, {n: c.values for n, c in log.channels.items() if n in kept}))
    assert "q_impact" not in {one.fault for one in hypotheses(record)}


@pytest.mark.parametrize("amount", [3.0, 40.0, -1.5])
def test_a_course_that_leaves_subsonic_flight_is_missing_where_it_does(amount):
    record = made_record()
    course = amount * COURSE
    for other in (with_fault(record, "q_impact", course), without_fault(record, "q_impact", course)):
        ratio = other.channels["q_impact"] / record.channels["p_static"]
        known = np.isfinite(ratio)
        assert known[:40].all()
        assert ratio[known].min() >= 0.0
        assert ratio[known].max() < 0.9
        np.testing.assert_array_equal(np.isfinite(other.channels["tas"]), known)


def test_a_leak_of_the_static_line_moves_no_inertial_rate_of_climb():
    log = made_log(60.0)
    channels = dict(log.channels)
    rate = channels["altitude_rate"]
    inertial = replace(log, channels={**channels, "altitude_rate": replace(rate, derived_from=("gps_altitude_rate",))})
    growing = 5.0 * np.arange(60.0)
    for one, moves in ((log, True), (inertial, False)):
        record = record_of(one)
        changed = with_fault(record, "static_leak", growing).channels["altitude_rate"]
        assert np.any(changed != record.channels["altitude_rate"]) == moves
        assert record.is_inertial != moves
