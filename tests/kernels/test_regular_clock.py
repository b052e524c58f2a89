"""Written times of a regular clock: rounded, repeated, skipped; what comes back is the clock and every row."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.regular_clock import quantum_of, regular_times

KINDS = ("single precision", "1 ms", "0.1 s", "0.01 s", "0.1 ms")


def written(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Return true and written times of a clock with up to four gaps, and its period, s."""
    start_s = rng.uniform(0.0, 9e4)
    if kind == "single precision":  # at 70 000 s its steps are 0.0078 s
        period, start_s = 1.0 / rng.choice([10.0, 16.0, 25.0, 50.0, 64.0, 100.0, 128.0]), rng.uniform(1e4, 1.2e5)
    else:
        highest = {"1 ms": 400.0, "0.1 s": 9.7, "0.01 s": 97.0, "0.1 ms": 60.0}[kind]
        period = 1.0 / rng.uniform(1.0, highest)
    steps = np.ones(int(rng.integers(600, 6000)), dtype=int)
    gaps = rng.choice(np.arange(20, steps.size - 20), int(rng.integers(0, 5)), replace=False)
    steps[gaps] += rng.integers(3, 60, gaps.size)
    true = start_s + period * np.cumsum(steps)
    if kind == "single precision":
        return true, true.astype(np.float32).astype(np.float64), period
    quantum = {"1 ms": 1e-3, "0.1 s": 0.1, "0.01 s": 0.01, "0.1 ms": 1e-4}[kind]
    return true, (np.floor if rng.random() < 0.5 else np.round)(true / quantum) * quantum, period


@pytest.mark.parametrize("seed", range(200))
def test_any_rounded_clock_has_its_rate_and_all_its_rows(seed: int):
    true, times, period = written(np.random.default_rng(seed), KINDS[seed % len(KINDS)])
    regular = regular_times(times)
    even = times if regular is None else regular.time_s
    assert even.size == true.size
    assert float(np.median(np.diff(even))) == pytest.approx(period, rel=1e-4)
    quantum = quantum_of(times) or 0.0
    assert np.ptp(even - true) < max(2.0 * quantum, 1e-3 * period)
    # A gap stays one: where rows are missing the step is longer, and nowhere else.
    np.testing.assert_array_equal(np.diff(even) > 1.75 * period, np.diff(true) > 1.75 * period)


@pytest.mark.parametrize("seed", range(20))
def test_seconds_repeated_and_skipped_in_pairs(seed: int):
    """As a Garmin writes them: a third of the rows a second late, some rows really missing."""
    rng = np.random.default_rng(seed)
    steps = np.ones(600, dtype=int)
    steps[rng.choice(np.arange(5, 595), 20, replace=False)] += 1
    true = 36_000.0 + np.cumsum(steps)
    times = true - (rng.random(600) < 0.3)
    regular = regular_times(times)
    assert regular is not None
    assert regular.period_s == 1.0
    assert np.all(np.abs(regular.time_s - true) <= 1.0)
    assert np.diff(regular.time_s).min() == 1.0
    assert np.count_nonzero(np.diff(regular.time_s) > 1.0) == pytest.approx(20, abs=2)
    assert abs(regular.n_moved - np.count_nonzero(times != true)) < 60


def test_one_late_row_at_the_start_moves_no_other():
    true = np.delete(np.arange(2000.0), np.arange(40, 2000, 45))
    times = true.copy()
    times[0] = times[1]
    regular = regular_times(times)
    assert regular is not None
    np.testing.assert_array_equal(regular.time_s[1:], times[1:])
    assert regular.time_s[0] == times[0] - 1.0


@pytest.mark.parametrize(
    "times",
    [
        np.arange(1000.0),
        0.01 * np.arange(5000),
        np.delete(np.arange(1000.0), [30, 31, 500]),
        np.cumsum(np.random.default_rng(1).uniform(0.6, 1.4, 800)),
        np.round(np.cumsum(np.random.default_rng(1).uniform(0.6, 1.4, 800)), 3),
        np.cumsum(np.random.default_rng(2).choice([0.1, 0.4], 800)),
        np.arange(12.0) // 2,
    ],
    ids=["seconds", "even", "missing", "uneven", "uneven and rounded", "two steps", "few"],
)
def test_what_is_even_or_of_no_regular_clock_stays(times: np.ndarray):
    assert regular_times(times) is None


@pytest.mark.parametrize("rate_hz", [20.0, 13.7, 250.0])
def test_several_rows_of_one_written_time(rate_hz: float):
    true = 7.03 + np.arange(4000) / rate_hz
    regular = regular_times(np.floor(10.0 * true) / 10.0)
    assert regular is not None
    assert 1.0 / regular.period_s == pytest.approx(rate_hz, rel=1e-4)
    assert np.ptp(regular.time_s - true) < 0.01


def test_a_quartz_that_drifts_stays_even():
    """By 20 parts in a million over half an hour, written to a millisecond."""
    n = np.arange(90_000)
    true = 0.02 * n + 2e-5 * 0.02 * n * (n / n.size)
    regular = regular_times(np.round(true, 3))
    assert regular is not None
    assert np.max(np.abs(np.diff(regular.time_s) / 0.02 - 1.0)) < 2e-3
    assert np.max(np.abs(regular.time_s - true)) < 2e-3
