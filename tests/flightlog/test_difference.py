"""Two logs of one flight: the shift between their clocks, and their channels on common time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.errors import LogError
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.report.difference import difference, time_shift, values_at


def log_of(time_s: np.ndarray, **values: np.ndarray) -> FlightLog:
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit="m/s", source=name) for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels)


def flown(time_s: np.ndarray, seed: int = 0) -> np.ndarray:
    """Return an airspeed that a walk through many frequencies makes, at any times."""
    rng = np.random.default_rng(seed)
    rates, phases = 2 * np.pi * rng.uniform(0.002, 0.1, 30), rng.uniform(0.0, 2 * np.pi, 30)
    return 100.0 + np.sin(np.multiply.outer(time_s, rates) + phases).sum(axis=1)


def test_a_straight_line_is_the_same_at_any_rate() -> None:
    first, second = np.arange(0.0, 50.0, 0.5), np.arange(10.03, 80.0, 0.1)
    time_s, change = difference(log_of(first, tas=3.0 * first), log_of(second, tas=3.0 * second + 2.0), "tas")
    np.testing.assert_allclose(change, 2.0, atol=1e-9)
    assert (time_s[0], time_s[-1]) == (10.5, 49.5)


def test_the_difference_of_exchanged_logs_is_the_negative() -> None:
    t = np.arange(0.0, 50.0, 0.25)
    a, b = log_of(t, tas=flown(t)), log_of(t, tas=flown(t, 1))
    np.testing.assert_array_equal(difference(a, b, "tas")[1], -difference(b, a, "tas")[1])


def test_gaps_have_no_values() -> None:
    t = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(30.0, 40.0, 0.1)])
    log, asked = log_of(t, tas=t), np.array([-1.0, 5.0, 20.0, 35.0, 50.0])
    np.testing.assert_array_equal(np.isnan(values_at(log, "tas", asked)), [True, False, True, False, True])


def test_logs_without_common_time_are_refused() -> None:
    t = np.arange(0.0, 10.0, 0.1)
    with pytest.raises(LogError, match=r"shares no time with made, 1000 to 1009\.9 s and 0 to 9\.9 s; give --align"):
        difference(log_of(t, tas=t), log_of(t + 1000.0, tas=t), "tas")


@pytest.mark.parametrize("shift", [0.0, 3.37, -41.02, 5000.0])
@pytest.mark.parametrize("rate", [10.0, 4.0])
def test_the_shift_of_a_clock_is_told_to_a_tenth_of_a_sample(shift: float, rate: float) -> None:
    """Also where the second log has an offset, begins later, is noisy and misses samples."""
    rng = np.random.default_rng(1)
    t, own = np.arange(0.0, 400.0, 0.1), np.arange(60.0, 380.0, 1.0 / rate)
    second = flown(own) + 5.0 + 0.05 * rng.standard_normal(own.size)
    second[200:230] = np.nan
    found = time_shift(log_of(t, tas=flown(t)), log_of(own - shift, tas=second), ("tas",))
    assert found == pytest.approx(shift, abs=0.1 / min(rate, 5.0))


def test_a_channel_that_drifts_does_not_pull_the_shift() -> None:
    t = np.arange(0.0, 400.0, 0.2)
    own = t - 7.3
    drifting = flown(t) + 0.2 * np.maximum(t - 150.0, 0.0)
    first = log_of(t, tas=flown(t), pitch=flown(t, 2), roll=flown(t, 3))
    found = time_shift(first, log_of(own, tas=drifting, pitch=flown(t, 2), roll=flown(t, 3)), ("tas", "pitch", "roll"))
    assert found == pytest.approx(7.3, abs=0.01)


def test_the_time_axis_of_the_first_shifts_the_answer_by_as_much() -> None:
    t = np.arange(0.0, 200.0, 0.2)
    first, second = log_of(t, tas=flown(t)), log_of(t[50:], tas=flown(t[50:]))
    moved = replace(first, time_s=frozen_array(first.time_s + 77.0))
    shift = time_shift(first, second, ("tas",))
    assert time_shift(moved, second, ("tas",)) == pytest.approx(shift + 77.0, abs=1e-9)


def test_different_flights_and_still_channels_are_no_record_of_one_flight() -> None:
    t = np.arange(0.0, 400.0, 0.2)
    log = log_of(t, tas=flown(t))
    for other in (log_of(t, tas=flown(t, 1)), log_of(t, tas=0.0 * t)):
        with pytest.raises(LogError, match="no shift of its time makes tas those of made"):
            time_shift(log, other, ("tas",))
    with pytest.raises(LogError, match="no shift"):
        time_shift(log_of(t, tas=0.0 * t + 5.0), log, ("tas",))
