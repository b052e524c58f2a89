"""Numbers and sentences as the reader sees them."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_results import fault_result, inconclusive_result, no_fault_result, two_output_result

from bfi_cli.faults import Fault
from bfi_cli.model.report import identify_content
from bfi_cli.report.faults import describe
from bfi_cli.report.text import axis_label, instant, interval, number, quantity, shortened


@pytest.mark.parametrize(
    ("time_s", "text"),
    [(13.8, "13.8"), (0.0, "0"), (-3.25, "-3.25"), (1.7e9 + 40.25, "1700000040.25"), (1.7e9, "1700000000")],
)
def test_two_times_of_an_axis_from_1970_are_told_apart(time_s, text):
    assert instant(time_s) == text


@given(value=st.floats(-1e6, 1e6), spread=st.floats(1e-6, 1e4))
@settings(max_examples=100, deadline=None)
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
@settings(max_examples=60, deadline=None)
def test_shortened_fits_on_one_line(text, width):
    assert len(shortened(text, width)) <= width
    assert shortened(text, width).isprintable()


def test_a_unit_nobody_stated_is_not_invented():
    assert axis_label("tas", "") == "tas [unit not stated]"


def test_verdict_names_size_interval_place_and_time_then_the_other_kinds():
    assert identify_content(fault_result()).verdict == (
        "Fault: a bias of 4.00 m/s (95 % interval 3.99 to 4.02) on tas from 13.8 s. "
        "No oscillation above 0.03 m/s; a slow fault could reach 4.4 m/s unseen."
    )


def test_verdict_lists_several_faults():
    text = identify_content(two_output_result()).verdict
    assert text.startswith("2 faults: a bias of ")
    assert "on tas from 113.8 s to 125 s; a 1.15 Hz sine of 4.00 m/s" in text


def test_verdict_without_a_fault_says_what_could_not_have_been_seen():
    assert identify_content(no_fault_result()).verdict == (
        "No fault: no step above 0.033 m/s; no oscillation above 0.03 m/s; a slow fault could reach 4.4 m/s unseen."
    )


def test_verdict_where_the_log_cannot_tell():
    content = identify_content(inconclusive_result())
    assert (content.heading, content.tone) == ("Inconclusive", "inconclusive")
    assert content.verdict == (
        "Inconclusive: a step of any size could be there unseen; an oscillation was not looked for; "
        "a slow fault was not looked for."
    )


def test_a_drift_is_told_by_its_physical_rate():
    estimate = replace(
        fault_result().faults[0],
        fault=Fault(shape="drift", channel="tas", slope=-0.23, onset_s=7.93),
        magnitude=4.0,
        unit="",
        ci95=(3.6, 4.4),
        physical_value=-0.92,
        physical_unit="m/s^2",
    )
    assert describe(estimate) == "a drift of -0.92 m/s^2 (95 % interval -1.01 to -0.83) on tas from 7.93 s"
