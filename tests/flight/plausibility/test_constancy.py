"""An error is constant, begins, or is constant and changes: whatever its unit, and in the noise of a flight."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.flight.plausibility.search import constant_part

T = np.arange(600.0)
TOLERANCE, ERROR = 1.0, 5.0
ONES = np.ones(T.size)


def gusts(seed: int, correlation: float = 0.9, sd: float = 0.5) -> np.ndarray:
    """Return (n,) AR(1) noise."""
    white = np.random.default_rng(seed).standard_normal(T.size) * sd * np.sqrt(1.0 - correlation**2)
    noise = np.zeros(T.size)
    for k in range(1, T.size):
        noise[k] = correlation * noise[k - 1] + white[k]
    return noise


def ramp(onset_s: float, duration_s: float) -> np.ndarray:
    return np.clip((T - onset_s) / duration_s, 0.0, 1.0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("course", "share"),
    [
        (ONES, 1.0),
        (ONES + 0.15 * ramp(300.0, 60.0), 1.0),  # within the tolerance of the same
        (ramp(60.0, 120.0), None),
        (ramp(300.0, 120.0), None),
        (ramp(300.0, 1e-9), None),
        (ramp(60.0, 1e-9), None),
        (ramp(300.0, 300.0), None),
    ],
)
def test_an_error_is_constant_or_begins(course: np.ndarray, share: float | None, seed: int):
    part = constant_part(ERROR * course + gusts(seed), ERROR * ONES, T, tolerance=TOLERANCE)
    assert (part is None) == (share is None)
    assert part is None or part[0] == share


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_there_before_a_change_is_the_constant_part(sign: float):
    before, size = 4.0, 10.0  # of ten minutes in half of which it is 4, then 10
    difference = sign * (before + (size - before) * ramp(300.0, 20.0)) + gusts(0)
    part = constant_part(difference, sign * size * ONES, T, tolerance=TOLERANCE)
    assert part is not None
    assert part[0] == pytest.approx(before / size, abs=0.03)


def test_units_gaps_and_the_number_of_samples_do_not_matter():
    noise = gusts(1)
    for course in (ONES, ramp(300.0, 120.0)):
        difference = ERROR * course + noise
        known = constant_part(difference, ERROR * ONES, T, tolerance=TOLERANCE)
        larger = constant_part(1e4 * difference, 1e4 * ERROR * ONES, T, tolerance=1e4 * TOLERANCE)
        holed = np.where(np.arange(T.size) % 7 == 3, np.nan, difference)
        part = constant_part(holed, ERROR * ONES, T, tolerance=TOLERANCE)
        assert (known is None) == (larger is None) == (part is None)
        if known is not None and larger is not None:
            assert larger[1] == pytest.approx(known[1])


def test_the_error_of_a_constant_is_that_of_its_mean_in_the_noise():
    inside = []
    for seed in range(60):
        noise = gusts(seed)
        part = constant_part(ERROR * ONES + noise, ERROR * ONES, T, tolerance=TOLERANCE)
        assert part is not None
        inside.append(abs(noise.mean() / ERROR) <= 1.96 * part[1])
    assert sum(inside) >= 49  # binomial, 95 % of 60: as few have a chance of 1e-3


def test_without_noise_and_without_a_tolerance():
    assert constant_part(ERROR * ONES, ERROR * ONES, T, tolerance=TOLERANCE) is not None
    assert constant_part(ERROR * ramp(300.0, 60.0), ERROR * ONES, T, tolerance=TOLERANCE) is None
    untold = constant_part(ERROR * ramp(300.0, 60.0), ERROR * ONES, T, tolerance=np.inf)
    assert untold == (1.0, np.inf)
