"""Numbers and sentences as the reader sees them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.quantities.channels import shortened
from bfi_cli.quantities.text import axis_label, duration, instant, interval, number, quantity


@pytest.mark.parametrize(
    ("time_s", "text"),
    [(13.8, "13.8"), (0.0, "0"), (-3.25, "-3.25"), (1.7e9 + 40.25, "1700000040.25"), (1.7e9, "1700000000")],
)
def test_two_times_of_an_axis_from_1970_are_told_apart(time_s, text):
    assert instant(time_s) == text


@given(value=st.floats(-1e6, 1e6), spread=st.floats(1e-6, 1e4))
def test_rounding_never_moves_a_number_by_more_than_its_spread(value, spread):
    assert abs(float(number(value, spread=spread)) - value) <= 0.5001 * spread + 1e-9


@pytest.mark.parametrize(
    ("value", "spread", "text"),
    [
        (4.003, 0.014, "4.00"),
        (4.003, None, "4.003"),
        (-0.0004, 0.02, "0.00"),
        (12345.6, 300.0, "12346"),
        (None, 0.1, "-"),
        (math.nan, 0.1, "-"),
        (math.inf, None, "-"),
        (1.0, math.inf, "1"),
        (2.5e-9, 1e-10, "2.5e-09"),
    ],
)
def test_number(value, spread, text):
    assert number(value, spread=spread) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0333, "m/s", "0.033 m/s"),
        (0.67, "", "0.67"),
        (1234.5, "Pa", "1234 Pa"),
        (math.inf, "m/s", "-"),
        (99.7, "kt", "100 kt"),
        (0.012, "1", "0.012"),
    ],
)
def test_quantity(value, unit, text):
    assert quantity(value, unit) == text


def test_interval_of_the_unknown_is_absent():
    assert interval((math.nan, math.nan)) == "-"
    assert interval((3.989, 4.017)) == "3.99 to 4.02"


@pytest.mark.slow
@given(text=st.text(max_size=60), width=st.integers(3, 30))
def test_shortened_fits_on_one_line(text, width):
    assert len(shortened(text, width)) <= width
    assert shortened(text, width).isprintable()


def test_a_unit_nobody_stated_is_not_invented():
    assert axis_label("tas", "") == "tas [unit not stated]"


@pytest.mark.parametrize(("seconds", "said"), [(223.4, "220 s"), (17.5, "18 s"), (0.123, "0.12 s"), (None, "- s")])
def test_a_length_of_time_has_two_digits_and_no_exponent(seconds: float | None, said: str):
    assert duration(seconds) == said
