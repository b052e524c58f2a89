"""A pressure that relaxes to another one: found as it is, and no other course taken for it."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.flight.parity.relaxation import relaxations

TIME_S = np.arange(400) * 0.5
EVERYWHERE, JUMP = np.ones(400, dtype=bool), np.full(400, 50.0)


def course(onset_s: float, time_constant_s: float, cabin: float) -> np.ndarray:
    flown = 80_000.0 - 6.0 * TIME_S
    amount = -np.expm1(-np.maximum(TIME_S - onset_s, 0.0) / time_constant_s)
    return flown + amount * (cabin - flown)


@pytest.mark.parametrize("cabin", [75_000.0, 81_500.0, 101_325.0])
@pytest.mark.parametrize("constant", [6, 20, 32])
def test_a_relaxation_is_found_as_it_is(constant: int, cabin: float):
    time_constant_s = float(np.geomspace(0.5, 30.0, 44)[constant])  # one of those that are tried
    (found,) = relaxations(TIME_S, course(80.0, time_constant_s, cabin), EVERYWHERE, JUMP)
    assert TIME_S[found.onset] == 80.0
    assert found.time_constant_s == time_constant_s
    assert found.level == pytest.approx(cabin, rel=1e-9)
    assert found.from_s <= 80.0 <= found.to_s


def test_an_onset_outside_of_what_is_looked_at_is_not_found():
    assert relaxations(TIME_S, course(80.0, 5.0, 75_000.0), TIME_S > 100.0, JUMP) == []


def test_what_is_no_exponential_is_none():
    ramp = 80_000.0 - 300.0 * np.clip(TIME_S - 80.0, 0.0, 20.0)
    assert relaxations(TIME_S, ramp, EVERYWHERE, JUMP) == []
    assert relaxations(TIME_S, np.full(400, 80_000.0), EVERYWHERE, JUMP) == []
    assert relaxations(TIME_S[:5], ramp[:5], EVERYWHERE[:5], JUMP[:5]) == []


def test_missing_samples_are_no_relaxation():
    broken = course(80.0, 5.0, 75_000.0)
    broken[165] = np.nan
    assert all(abs(TIME_S[one.onset] - 80.0) > 5.0 for one in relaxations(TIME_S, broken, EVERYWHERE, JUMP))


@pytest.mark.parametrize(("share", "is_found"), [(0.0245, True), (0.028, False)])
def test_a_course_strays_from_its_fit_by_three_hundredths_of_the_change(share: float, is_found: bool):
    """Of swings of this share of 5 500 Pa the fit leaves 1.2 times as much of the change that it takes for one."""
    flown = course(80.0, 5.0, 75_000.0)
    swings = share * np.sqrt(2.0) * 5_500.0 * np.sin(2.0 * np.pi * TIME_S / 2.3) * (TIME_S > 81.0)
    near = np.abs(TIME_S - 80.0) < 0.25
    assert bool(relaxations(TIME_S, flown + swings, near, JUMP)) == is_found
