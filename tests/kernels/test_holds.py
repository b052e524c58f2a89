"""Held samples and quantisation: the clock is found, and neither a resting control nor coarse steps are one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.kernels.quantisation import find_hold, find_quantum, repeat_fraction

T100 = np.arange(0.0, 120.0, 0.01)
PHUGOID = 90.0 + 5.0 * np.sin(2.0 * np.pi * T100 / 40.0)
KNOT_16TH = 1852.0 / 3600.0 / 16.0
FOOT = 0.3048


def wandering(n: int, seed: int) -> np.ndarray:
    return 90.0 + np.cumsum(np.random.default_rng(seed).normal(size=n)) * 0.2


def held(n: int, period: float, phase: float, seed: int = 0) -> np.ndarray:
    tick = np.floor((np.arange(n) - phase) / period).astype(int)
    return wandering(tick[-1] - tick[0] + 1, seed)[tick - tick[0]]


def three_two_one_one(times: int = 1) -> np.ndarray:
    elevator = np.zeros(T100.size)
    for i in range(times):
        for start, stop, way in ((0, 3, 1), (3, 5, -1), (5, 6, 1), (6, 7, -1)):
            elevator[(20 + 15 * i + start <= T100) & (20 + 15 * i + stop > T100)] = 0.02 * way
    return elevator


@given(period=st.floats(2.0, 40.0), phase=st.floats(0.0, 1.0), seed=st.integers(0, 99))
def test_any_clock_is_found(period: float, phase: float, seed: int):
    n = int(60 * period)
    hold = find_hold(held(n, period, phase * period, seed), np.arange(n, dtype=float))
    assert hold is not None
    assert hold.period == pytest.approx(period, rel=0.01)


@given(period=st.integers(2, 20), phase=st.integers(0, 19), quantum=st.sampled_from([KNOT_16TH, 0.01]))
def test_a_whole_period_is_exact_also_when_quantised(period: int, phase: int, quantum: float):
    phase %= period
    x = np.round(held(80 * period, period, phase) / quantum) * quantum
    hold = find_hold(x, np.arange(x.size, dtype=float))
    assert hold is not None
    assert hold.period == pytest.approx(period, rel=1e-9)
    assert hold.phase == pytest.approx(phase, abs=1e-6)


def test_one_hertz_airspeed_in_a_ten_hertz_log():
    x = held(600, 10, 0)
    hold = find_hold(x, np.arange(600.0))
    assert hold is not None
    assert hold.period == pytest.approx(10.0)
    assert repeat_fraction(x) == pytest.approx(0.9, abs=0.01)


def test_rest_between_two_moving_parts_does_not_hide_the_clock():
    x = held(1200, 10, 0)
    x[400:800] = x[399]
    assert find_hold(x, np.arange(1200.0)) is not None


@given(seed=st.integers(0, 10_000), digits=st.integers(1, 3))
def test_a_signal_that_is_new_at_every_sample_is_not_held(seed: int, digits: int):
    x = np.round(np.random.default_rng(seed).normal(size=500), digits)
    assert find_hold(x, np.arange(500.0)) is None


@pytest.mark.parametrize(
    "x",
    [
        pytest.param(np.zeros(500), id="constant"),
        pytest.param(three_two_one_one(), id="one 3-2-1-1"),
        pytest.param(three_two_one_one(6), id="six 3-2-1-1 on whole seconds"),
        pytest.param(
            np.repeat(np.random.default_rng(1).integers(0, 2, 240), 50) * 0.02, id="pseudo-random binary input"
        ),
        pytest.param(np.round(PHUGOID / KNOT_16TH) * KNOT_16TH, id="quantised slow phugoid"),
        pytest.param(np.round(PHUGOID / 0.5) * 0.5, id="coarsely quantised slow phugoid"),
        pytest.param(np.round((500.0 + 5.0 * T100) / FOOT) * FOOT, id="steady climb in whole feet"),
        pytest.param(np.round(PHUGOID + 0.02 * np.sin(31 * T100) / KNOT_16TH) * KNOT_16TH, id="quantised and rough"),
    ],
)
def test_repeats_without_a_clock_are_not_held(x: np.ndarray):
    assert find_hold(x, np.arange(x.size, dtype=float)) is None


@given(quantum=st.floats(1e-3, 10.0), offset=st.floats(-100.0, 100.0), seed=st.integers(0, 999))
def test_the_quantum_is_recovered(quantum: float, offset: float, seed: int):
    levels = np.random.default_rng(seed).integers(-200, 200, 2000)
    assert find_quantum(offset + quantum * levels) == pytest.approx(quantum, rel=1e-3)


def test_the_quantum_survives_single_precision_and_a_few_other_samples():
    x = (np.round(PHUGOID / KNOT_16TH) * KNOT_16TH).astype(np.float32).astype(float)
    assert find_quantum(x) == pytest.approx(KNOT_16TH, rel=1e-4)
    x[5000] += 0.4 * KNOT_16TH
    assert find_quantum(x) == pytest.approx(KNOT_16TH, rel=1e-3)


@given(seed=st.integers(0, 10_000), single=st.booleans())
def test_a_continuous_signal_has_no_quantum(seed: int, single: bool):
    x = 90.0 + np.random.default_rng(seed).normal(size=3000)
    assert find_quantum(x.astype(np.float32).astype(float) if single else x) is None


@pytest.mark.parametrize("x", [np.zeros(0), np.ones(5), np.array([0.0, 1.0, 0.0, 1.0])])
def test_too_few_levels_have_no_quantum(x: np.ndarray):
    assert find_quantum(x) is None
