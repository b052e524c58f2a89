"""Neighbours on both sides: a cubic leaves no error, an excursion its whole height; travel and running median."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.kernels.running import interpolation_error, running_median, travel


@settings(max_examples=50)
@given(
    coefficients=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), half=st.integers(1, 8), height=st.floats(1, 9)
)
def test_what_a_cubic_leaves_is_the_excursion_alone(coefficients: list[float], half: int, height: float):
    t = np.linspace(-1.0, 1.0, 101)
    x = np.polyval(coefficients, t)
    x[50 : 50 + half] += height
    error = interpolation_error(x, half)
    np.testing.assert_allclose(error[50 : 50 + half], height, atol=1e-9)
    assert not error[: 3 * half].any()
    assert not error[len(t) - 3 * half :].any()


def test_beside_a_missing_sample_nothing_is_said():
    x = np.ones(40)
    x[20] = np.nan
    error = interpolation_error(x, 2)
    assert np.isfinite(error).all()
    assert not error.any()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), st.integers(2, 9))
def test_travel_is_the_range_of_every_stretch(values: list[float], size: int):
    x = np.array(values)
    expected = [float(np.ptp(x[k : k + size])) for k in range(len(x) - size + 1)]
    np.testing.assert_array_equal(travel(x, size), expected)


def test_the_running_median_ignores_what_fills_less_than_half_of_its_blocks():
    x = np.full(200, 2.0)
    x[90:105] = 50.0
    np.testing.assert_array_equal(running_median(x, 5, 9), 2.0)
    assert running_median(np.arange(7.0), 10, 5) == pytest.approx(3.0)
