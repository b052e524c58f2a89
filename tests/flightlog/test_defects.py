"""Dropouts, spikes and readings that stay still are named, sharp and behind a recorder; what a flight does is none."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_flights import made_flight
from made_logs import made_log

from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.defects import find_defects, sentence_of_defect, with_bridges, without_defects
from bfi_cli.flightlog.record import frozen_array

RATE_HZ = 10.0
AT_S = (60.0, 130.0, 222.5)
RECORDER = (Filter(kind="gaussian", edge_hz=0.75, rate_hz=RATE_HZ),)

Fault = Callable[[np.ndarray, int], np.ndarray]


@cache
def flight(*, recorded: bool) -> FlightLog:
    """Return five minutes of calm and of gusts, as measured, or as a recorder stores them."""
    log = made_flight(seconds=300.0, noise_pa=2.0)
    return through(log) if recorded else replace(log, filters=())


def through(log: FlightLog) -> FlightLog:
    response = response_of(RECORDER, RATE_HZ)
    channels = {}
    for name, one in log.channels.items():
        padded = np.pad(one.values, (response.after, response.before), mode="edge")
        channels[name] = replace(one, values=frozen_array(response.filtered(padded)))
    return replace(log, channels=channels, filters=RECORDER)


def with_fault(name: str, fault: Fault, *, recorded: bool, at_s: tuple[float, ...] = AT_S) -> FlightLog:
    log = made_flight(seconds=300.0, noise_pa=2.0)
    x = log.channels[name].values.copy()
    for at in at_s:
        first = round(at * RATE_HZ)
        part = x[first:]
        part[:] = fault(part, round(at))
    log = replace(log, channels={**log.channels, name: replace(log.channels[name], values=frozen_array(x))})
    return through(log) if recorded else replace(log, filters=())


def drop(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate([np.zeros(10 + k % 21), x[10 + k % 21 :]])


def jump(x: np.ndarray, k: int) -> np.ndarray:
    n = 1 + k % 3
    return np.concatenate([x[:n] + (25.0 if k % 2 else -25.0), x[n:]])


def stay(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate([np.full(50, x[0]), x[50:]])


@pytest.mark.parametrize("recorded", [False, True])
def test_a_flight_has_none(recorded: bool):
    assert find_defects(flight(recorded=recorded)) == ()


@pytest.mark.first_rows(4)
@pytest.mark.parametrize("recorded", [False, True])
@pytest.mark.parametrize(
    ("fault", "shape", "largest", "lasts_s"),
    [(drop, "dropout", -115.0, 6.4), (jump, "spikes", -25.0, 0.4), (stay, "frozen", None, 15.0)],
)
def test_defects_of_one_channel_are_named(
    fault: Fault, shape: str, largest: float | None, lasts_s: float, recorded: bool
):
    [one] = find_defects(with_fault("tas", fault, recorded=recorded))
    assert (one.channel, one.shape, one.count) == ("tas", shape, 3)
    np.testing.assert_allclose(one.times_s, AT_S, atol=1.5 if shape == "frozen" else 0.2)
    assert one.duration_s == pytest.approx(lasts_s, rel=0.15, abs=0.1)
    if largest is not None and (shape == "dropout" or not recorded):
        assert one.largest == pytest.approx(largest, rel=0.05)


def test_what_every_channel_does_is_no_defect_of_one():
    """A gust of half a second and of three, in the pressure that all are made of."""
    log = flight(recorded=False)
    gust = np.zeros(log.n_samples)
    gust[1000:1005], gust[2000:2030] = 0.1, -0.08
    names = ("tas", "cas", "mach")
    channels = {name: replace(log.channels[name], values=log.channels[name].values * (1.0 + gust)) for name in names}
    assert find_defects(replace(log, channels={**log.channels, **channels})) == ()


@pytest.mark.parametrize("recorded", [False, True])
def test_a_step_that_stays_is_none(recorded: bool):
    log = with_fault("tas", lambda x, _: x + 5.0, recorded=recorded, at_s=(130.0,))
    assert find_defects(log) == ()


def test_all_airspeeds_that_read_zero_at_once_drop_out():
    log = flight(recorded=True)
    lost = np.ones(log.n_samples)
    lost[900:920] = 0.0
    names = ("tas", "cas", "mach")
    clean = made_flight(seconds=300.0, noise_pa=2.0)
    channels = {name: replace(one, values=one.values * lost) for name, one in clean.channels.items() if name in names}
    found = find_defects(through(replace(clean, channels={**clean.channels, **channels})))
    assert {(one.channel, one.shape, one.count) for one in found} == {(name, "dropout", 1) for name in names}


@pytest.mark.parametrize(("within_s", "count"), [(0.0, 1), (2.0, 0)])
def test_a_reading_that_is_lost_at_once_drops_out_however_wild_the_flight(within_s: float, count: int):
    log, rng = replace(made_flight(seconds=300.0, noise_pa=2.0), filters=()), np.random.default_rng(3)
    # Turns that change the airspeed by a third within seconds: an error of 5 usual ones.
    wild = np.convolve(rng.standard_normal(log.n_samples), np.hanning(40), mode="same")
    tas = log.channels["tas"].values * (1.0 + 0.15 * wild / wild.std())
    tas *= np.interp(log.time_s, (150.0 - within_s, 150.0, 153.0, 153.0 + within_s), (1.0, 0.0, 0.0, 1.0))
    channels = {**log.channels, "tas": replace(log.channels["tas"], values=frozen_array(tas))}
    dropouts = [defect for defect in find_defects(replace(log, channels=channels)) if defect.shape == "dropout"]
    assert sum(defect.count for defect in dropouts) == count


def test_where_an_airspeed_does_not_read_yet_it_predicts_none():
    """Ratios to readings of 0 are finite: no warning, and no defect of the other airspeed."""
    log = flight(recorded=False)
    unread = np.where(log.time_s < np.median(log.time_s), 0.0, log.channels["cas"].values)
    channels = {**log.channels, "cas": replace(log.channels["cas"], values=unread)}
    assert "tas" not in {defect.channel for defect in find_defects(replace(log, channels=channels))}


def test_a_channel_that_is_renewed_seldom_does_not_stay_still():
    """Values held for a second, and steps of a knot: nothing between two of them is a defect."""
    log = flight(recorded=False)
    held = np.arange(log.n_samples) // 10 * 10
    slow = {name: replace(log.channels[name], values=log.channels[name].values[held]) for name in ("tas", "altitude")}
    assert find_defects(replace(log, channels={**log.channels, **slow})) == ()
    knots = {
        name: replace(log.channels[name], values=np.round(log.channels[name].values / 0.514) * 0.514)
        for name in ("tas", "cas")
    }
    assert find_defects(replace(log, channels={**log.channels, **knots})) == ()


@pytest.mark.parametrize(("rate_hz", "shapes"), [(1.0, []), (10.0, ["spikes"])])
def test_a_roll_between_two_samples_is_none(rate_hz: float, shapes: list[str]):
    log = made_flight(seconds=600.0, rate_hz=rate_hz)
    x = 0.02 * np.random.default_rng(0).standard_normal(log.n_samples)
    x[[round(250 * rate_hz), round(400 * rate_hz)]] += 3.0
    roll = Channel(name="roll", values=frozen_array(x), unit="rad", source="roll")
    found = find_defects(replace(log, channels={**log.channels, "roll": roll}))
    assert [one.shape for one in found] == shapes


def test_a_dropout_of_a_log_at_one_hertz():
    log = made_flight(seconds=600.0, rate_hz=1.0)
    x = log.channels["tas"].values.copy()
    x[[100, 101, 300]] = 0.0
    x[450] += 30.0
    found = find_defects(replace(log, channels={**log.channels, "tas": replace(log.channels["tas"], values=x)}))
    assert [(one.shape, one.count) for one in found] == [("dropout", 2), ("spikes", 1)]
    assert found[0].durations_s == pytest.approx((2.0, 1.0), rel=0.05)


@pytest.mark.parametrize("recorded", [False, True])
def test_what_is_taken_out_holds_the_defect_and_nothing_far_from_it(recorded: bool):
    clean, log = flight(recorded=recorded), with_fault("tas", drop, recorded=recorded)
    found = find_defects(log)
    left, bridged = without_defects(log, found), with_bridges(log, found)
    hidden = np.isnan(left.channels["tas"].values)
    near = np.min(np.abs(log.time_s[:, None] - (np.array(AT_S) + 1.0)), axis=1) < 4.0
    assert not hidden[~near].any()
    error = left.channels["tas"].values - clean.channels["tas"].values
    assert np.nanmax(np.abs(error)) < 0.5
    assert np.abs(bridged.channels["tas"].values - clean.channels["tas"].values).max() < 10.0
    assert left.channels["cas"] is log.channels["cas"]


def test_a_part_of_the_flight_has_those_that_begin_in_it():
    [one] = find_defects(with_fault("tas", drop, recorded=False))
    inside = one.between(100.0, 200.0)
    assert inside is not None
    assert inside.times_s == one.times_s[1:2]
    assert inside.count == len(inside.hidden) == len(inside.durations_s) == 1
    assert one.between(140.0, 200.0) is None
    assert sentence_of_defect(one) == "'tas' drops out 3 times, 6.4 s in all, first at 60 s"


@pytest.mark.parametrize("n", [2, 3, 9, 40])
def test_a_log_of_a_few_samples_or_without_numbers_has_none(n: int):
    t = np.arange(n) / 10.0
    log = made_log(t, tas=np.full(n, np.nan), cas=np.linspace(0.0, 1e200, n), mach=np.arange(n) % 2)
    assert find_defects(log) == ()


def test_one_sample_days_after_the_others_takes_no_memory():
    """A tick for each tenth of a second of the gap, of each channel, would take 100 MB and more."""
    time_s = np.append(np.arange(600) / 10.0, 90_000.0)
    names = ("tas", "altitude", "pitch")
    log = made_log(time_s, {"tas": "m/s", "altitude": "m", "pitch": "rad"}, **{n: np.sin(time_s**1.1) for n in names})
    tracemalloc.start()
    try:
        assert find_defects(log) == ()
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()
