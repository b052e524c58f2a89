"""The clock of a log: epochs as text and back, days and times of day."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.epoch import DAY_S, SINCE_1970, Epoch, epoch_since_1970, time_of_day

JULY_S = DAY_S * 15_156  # 2011-07-01


@pytest.mark.parametrize(
    ("since_1970_s", "is_utc", "text"),
    [
        (JULY_S, False, "2011-07-01T00:00:00"),
        (JULY_S, True, "2011-07-01T00:00:00Z"),
        (0.0, True, "1970-01-01T00:00:00Z"),
        (-DAY_S * 24_107, True, "1904-01-01T00:00:00Z"),
        (None, False, "00:00:00"),
        (None, True, "00:00:00Z"),
    ],
)
def test_an_epoch_is_written_and_read_in_iso_8601(since_1970_s: float | None, is_utc: bool, text: str):
    epoch = Epoch(since_1970_s=since_1970_s, is_utc=is_utc)
    assert epoch.iso == text
    assert Epoch.of_iso(text) == epoch


@pytest.mark.parametrize(
    "text",
    [
        "",
        "2011-07-01",
        "9999999-01-01T00:00:00",
        "2011-07-01T12:00:00Z",
        "2011-07-01T00:00:00+02:00",
        "2011-13-41T00:00:00",
    ],
)
def test_what_is_no_midnight_is_refused(text: str):
    with pytest.raises(ValueError, match=r"midnight|out of range|datetime"):
        Epoch.of_iso(text)


@given(st.integers(-100_000, 1_000_000), st.booleans())
def test_every_day_comes_back(day: int, is_utc: bool):
    epoch = Epoch(since_1970_s=DAY_S * day, is_utc=is_utc)
    assert Epoch.of_iso(epoch.iso) == epoch


def test_moments_are_those_of_numpy_to_a_millisecond():
    epoch, times_s = Epoch(since_1970_s=JULY_S, is_utc=True), np.array([0.0, 47_920.25, -1.0, 2.0 * DAY_S, math.nan])
    expected = [
        "2011-07-01T00:00:00.000Z",
        "2011-07-01T13:18:40.250Z",
        "2011-06-30T23:59:59.000Z",
        "2011-07-03T00:00:00.000Z",
        "",
    ]
    assert epoch.moments(times_s) == expected
    assert Epoch(since_1970_s=None, is_utc=False).moments([47_920.25, DAY_S + 1.0]) == ["13:18:40.250", "00:00:01.000"]


@pytest.mark.parametrize(
    ("time_s", "decimals", "text"),
    [
        (0.0, 0, "00:00:00"),
        (47_920.0, 0, "13:18:40"),
        (86_399.4, 0, "23:59:59"),
        (86_399.6, 0, "00:00:00"),
        (DAY_S + 61.25, 2, "00:01:01.25"),
        (-1.0, 1, "23:59:59.0"),
        (59.96, 1, "00:01:00.0"),
        (1_721_484_013.79, 2, "14:00:13.79"),
    ],
)
def test_times_of_day(time_s: float, decimals: int, text: str):
    assert time_of_day(time_s, decimals) == text


def test_days_have_a_date_or_a_number():
    assert Epoch(since_1970_s=JULY_S, is_utc=False).date(DAY_S + 1.0) == "2011-07-02"
    assert Epoch(since_1970_s=None, is_utc=False).date(DAY_S + 1.0) == "day 2"


@pytest.mark.parametrize(
    ("first_s", "is_epoch"),
    [
        (0.0, False),
        (DAY_S, False),
        (604_799.0, False),  # of a week, as GPS counts
        (SINCE_1970[0], True),
        (1_700_000_000.0, True),
        (3_786_912_000.0, False),  # 2024, since 1904
    ],
)
def test_an_axis_counts_from_1970_where_it_lies_in_the_years_of_recorders(first_s: float, is_epoch: bool):
    epoch = epoch_since_1970(first_s, first_s + 3600.0)
    assert (epoch == Epoch(since_1970_s=0.0, is_utc=True)) is is_epoch
