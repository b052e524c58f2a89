"""Oscillations of airspeeds in a whole flight: frequency, size, onset and end, and whose they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from made_journeys import made_journey

from bfi_cli.config import Config
from bfi_cli.flight.bench import Bench, bench_of
from bfi_cli.flight.diagnose import diagnose_flight
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.model import flight_model
from bfi_cli.flight.oscillations import (
    HIGHEST_HZ,
    WINDOW_S,
    Line,
    oscillating_events,
    oscillation_of,
    spectral_lines,
)
from bfi_cli.flight.result import Event
from bfi_cli.flight.seconds import seconds_of
from bfi_cli.flight.weight import DECLARED
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels import FloatArray

ALL = ("tas", "cas", "mach")
SOUND_M_S = 330.0


def swinging(
    channels: tuple[str, ...],
    *,
    size: float = 3.0,
    frequency_hz: float = 0.1,
    from_s: float = 300.0,
    to_s: float = np.inf,
    rate_hz: float = 1.0,
) -> FlightLog:
    """Return a flight in which some channels swing between two times, a second is `rate_hz` samples."""
    log = made_journey(rate_hz=rate_hz)
    t = log.time_s
    error = size * np.sin(2.0 * np.pi * frequency_hz * (t - from_s) + 0.7) * ((t >= from_s) & (t < to_s))
    shares = {"mach": 1.0 / SOUND_M_S}
    if len(channels) > 1:
        shares["cas"] = log.channels["cas"].values / log.channels["tas"].values
    changed = {
        name: replace(
            log.channels[name], values=frozen_array(log.channels[name].values + error * shares.get(name, 1.0))
        )
        for name in channels
    }
    return replace(log, channels={**log.channels, **changed})


def bench_for(log: FlightLog) -> Bench:
    seconds = seconds_of(log)
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    return bench_of(model)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("channels", "fault"), [(ALL, "pitot_water"), (("tas",), "tas"), (("cas",), "cas")])
def test_whose_oscillation_it_is_with_size_and_onset(channels: tuple[str, ...], fault: str) -> None:
    bench = bench_for(swinging(channels))
    line = spectral_lines(bench)[-1]
    answer = oscillation_of(bench, line, rate_hz=1.0, until_s=np.inf)
    assert answer is not None
    best, other = answer.weights[:2]
    assert best.fault == fault
    assert best.margin > other.margin + 100.0
    assert best.sd is not None
    assert abs(best.size - 3.0) < 3.0 * best.sd < 0.5
    assert abs(answer.frequency_hz - 0.1) < 0.1 / WINDOW_S
    low, high = answer.onset_ci95
    assert low <= 300.0 <= high
    assert high - low < 15.0
    assert answer.offset_s is None


@pytest.mark.slow
def test_what_is_over_has_an_end() -> None:
    bench = bench_for(swinging(ALL, frequency_hz=0.23, to_s=560.0))
    line = spectral_lines(bench)[-1]
    answer = oscillation_of(bench, line, rate_hz=1.0, until_s=np.inf)
    assert answer is not None
    assert answer.offset_s == pytest.approx(560.0, abs=5.0)


@pytest.mark.slow
def test_a_mean_over_a_second_does_not_make_it_smaller() -> None:
    bench = bench_for(swinging(ALL, frequency_hz=0.4, rate_hz=4.0))
    line = spectral_lines(bench)[-1]
    answer = oscillation_of(bench, line, rate_hz=4.0, until_s=np.inf)
    assert answer is not None
    best = answer.weights[0]
    assert abs(best.size - 3.0) < 3.0 * (best.sd or 0.0)


def told(log: FlightLog, least: float = DECLARED) -> list[Event]:
    """Return the oscillations that a log shows, without what finders propose."""
    return list(oscillating_events(flight_of(log, Config()), bench_for(log), least))


@pytest.mark.slow
@pytest.mark.parametrize("frequency_hz", [0.02, HIGHEST_HZ + 0.04])
def test_no_oscillation_is_told_of_a_frequency_that_is_not_sought(frequency_hz: float) -> None:
    assert told(swinging(ALL, frequency_hz=frequency_hz)) == []


@pytest.mark.slow
def test_what_the_bounds_of_the_filter_make_of_an_oscillation_is_not_weighed_as_another() -> None:
    log = swinging(("cas",), size=20.0, frequency_hz=0.11, to_s=480.0)
    assert [line.frequency_hz > 0.4 for line in spectral_lines(bench_for(log))] == [True, False]
    (event,) = told(log, least=-np.inf)
    assert event.fault == "cas"
    assert event.frequency_hz == pytest.approx(0.11, abs=1e-3)


@pytest.mark.slow
def test_oscillations_of_two_channels_at_one_time_are_both_told() -> None:
    log = swinging(("tas",), size=6.0, frequency_hz=0.1)
    other = swinging(("cas",), size=4.0, frequency_hz=0.23)
    log = replace(log, channels={**log.channels, "cas": other.channels["cas"]})
    events = {event.fault: event for event in told(log)}
    assert {name: event.frequency_hz for name, event in events.items()} == {
        "tas": pytest.approx(0.1, abs=1e-3),
        "cas": pytest.approx(0.23, abs=1e-3),
    }
    for name, size in (("tas", 6.0), ("cas", 4.0)):
        assert events[name].ci95 is not None
        low, high = events[name].ci95
        assert low <= size <= high
        assert events[name].onset_ci95[0] <= 300.0 <= events[name].onset_ci95[1]


@pytest.mark.slow
def test_a_healthy_flight_has_no_line() -> None:
    assert spectral_lines(bench_for(made_journey(rate_hz=1.0))) == ()


@pytest.mark.slow
def test_a_diagnosis_names_it_and_nothing_else() -> None:
    log = swinging(ALL, size=6.0, frequency_hz=0.15)
    log = replace(log, channels={name: channel for name, channel in log.channels.items() if name != "elevator"})
    result = diagnose_flight(log, Config())
    assert [(event.fault, event.kind, event.state) for event in result.events] == [
        ("pitot_water", "oscillating", "declared")
    ]
    (event,) = result.events
    assert event.frequency_hz == pytest.approx(0.15, abs=1e-3)
    assert event.ci95 is not None
    assert event.ci95[0] <= 6.0 <= event.ci95[1]
    assert event.onset_ci95[0] <= 300.0 <= event.onset_ci95[1]
    assert result.verdicts["oscillating"] == "fault"


@pytest.mark.slow
@pytest.mark.parametrize(("size", "states"), [(1.0, []), (12.0, ["suspected"])])
def test_without_a_ground_speed_the_aircraft_itself_may_swing(size: float, states: list[str]) -> None:
    log = swinging(("tas",), size=size, frequency_hz=0.15)
    lacking = ("elevator", "cas", "mach", "velocity_north", "velocity_east", "sat", "tat")
    log = replace(log, channels={name: channel for name, channel in log.channels.items() if name not in lacking})
    result = diagnose_flight(log, Config())
    swings = [event for event in (*result.events, *result.deviations) if event.kind == "oscillating"]
    assert [event.state for event in swings] == states


@pytest.fixture(scope="module")
def healthy() -> Bench:
    return bench_for(made_journey(rate_hz=1.0))


# Seconds from the first sample of a window in the middle of which a click has a flat spectrum: of the density of white
# noise of this standard deviation.
SINCE_CLICK_S = np.arange(WINDOW_S) - 0.5 * WINDOW_S
NOISE_SD = 1.0 / np.sqrt(np.log(2.0) * np.sum(np.hanning(WINDOW_S) ** 2))


def window_with(sizes: dict[float, float]) -> FloatArray:
    """Return a window of noise with sines by frequency, each of so many times the noise's standard deviation."""
    swings = (size * np.sin(2.0 * np.pi * hz * SINCE_CLICK_S) for hz, size in sizes.items())
    return 1.0 * (SINCE_CLICK_S == 0.0) + NOISE_SD * sum(swings, np.zeros(WINDOW_S))


def lines_of_windows(bench: Bench, *windows: FloatArray) -> Sequence[Line]:
    """Return the lines of an airspeed in flights of a window each, the first of which ends at its own length."""
    model, taken_s = bench.model, 50  # after a take-off, in which nothing is looked for
    left, airborne = np.full(bench.innovation.shape, np.nan), np.zeros(model.n, dtype=bool)
    for k, window in enumerate(windows):
        first = k * (taken_s + WINDOW_S + 30)
        airborne[first : first + taken_s + WINDOW_S] = True
        left[first + taken_s : first + taken_s + WINDOW_S, model.row("tas")] = window
    flown = replace(model, frame=replace(model.frame, airborne=airborne))
    return spectral_lines(replace(bench, model=flown, innovation=left))


@pytest.mark.parametrize(("size", "seen"), [(1.9, False), (2.1, True)])
def test_a_sine_of_two_standard_deviations_of_the_noise_is_looked_at_more_closely(
    healthy: Bench, size: float, seen: bool
) -> None:
    assert [line.frequency_hz for line in lines_of_windows(healthy, window_with({0.1: size}))] == (
        [pytest.approx(0.1)] if seen else []
    )


@pytest.mark.parametrize("strongest", [0.0, 10.0])
@pytest.mark.parametrize(("share", "lasts"), [(0.115, True), (0.085, False)])
def test_a_line_lasts_while_it_has_a_tenth_of_the_power_of_one_that_is_looked_at(
    healthy: Bench, strongest: float, share: float, lasts: bool
) -> None:
    """Of the power of the strongest line of its window, and at least of the power from which on a line is seen."""
    size = float(np.sqrt(share)) * max(strongest, 2.0)
    lines = lines_of_windows(healthy, window_with({0.1: 4.0}), window_with({0.1: size, 0.3: strongest}))
    first = next(line for line in lines if line.frequency_hz == pytest.approx(0.1))
    assert (first.to_s - first.from_s > 2 * WINDOW_S) is lasts


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("after_s", "counts"), [(320.0, False), (240.0, True)])
def test_an_oscillation_is_weighed_for_five_minutes_from_where_it_is_seen(after_s: float, counts: bool) -> None:
    """One that grows to three times its size within these is larger; one that grows later is not."""
    log, grown = swinging(("tas",)), swinging(("tas",), size=9.0)
    tas = np.where(log.time_s < 300.0 + after_s, log.channels["tas"].values, grown.channels["tas"].values)
    few = {name: log.channels[name] for name in ("altitude", "sat", "velocity_north", "velocity_east")}
    log = replace(log, channels={"tas": replace(log.channels["tas"], values=frozen_array(tas)), **few})
    line = Line(from_s=240.0, to_s=840.0, frequency_hz=0.1, power=1e3)
    answer = oscillation_of(bench_for(log), line, rate_hz=1.0, until_s=np.inf)
    assert answer is not None
    best = answer.weights[0]
    assert best.sd is not None
    assert (best.size > 3.0 + 3.0 * best.sd) is counts
