"""The clock of a log: epochs as text and back, days and times of day."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.epoch import DAY_S, SINCE_1970, Epoch, epoch_of_clock, epoch_since_1970, utc_of_gps

JULY_S = DAY_S * 15_156  # 2011-07-01


@pytest.mark.parametrize(
    ("since_1970_s", "is_utc", "is_dated", "text"),
    [
        (JULY_S, False, True, "2011-07-01T00:00:00"),
        (JULY_S, True, True, "2011-07-01T00:00:00Z"),
        (JULY_S + 47_920.25, True, True, "2011-07-01T13:18:40.250Z"),
        (0.0, True, True, "1970-01-01T00:00:00Z"),
        (-DAY_S * 24_107, True, True, "1904-01-01T00:00:00Z"),
        (0.0, False, False, "00:00:00"),
        (47_920.0, True, False, "13:18:40Z"),
    ],
)
def test_an_epoch_is_written_and_read_in_iso_8601(since_1970_s: float, is_utc: bool, is_dated: bool, text: str):
    epoch = Epoch(since_1970_s=since_1970_s, is_utc=is_utc, is_dated=is_dated)
    assert epoch.iso == text
    assert Epoch.from_iso(text) == epoch


@pytest.mark.parametrize(
    "text",
    [
        "",
        "2011-07-01",
        "9999999-01-01T00:00:00",
        "2011-07-01T24:00:00Z",
        "2011-07-01T00:00:00+02:00",
        "2011-13-41T00:00:00",
    ],
)
def test_what_is_no_moment_is_refused(text: str):
    with pytest.raises(ValueError, match=r"moment|out of range|datetime"):
        Epoch.from_iso(text)


@given(st.integers(-100_000, 1_000_000), st.integers(0, 86_399_999), st.booleans())
def test_every_moment_comes_back(day: int, ms: int, is_utc: bool):
    epoch = Epoch(since_1970_s=round(DAY_S * day + 1e-3 * ms, 3), is_utc=is_utc)
    assert Epoch.from_iso(epoch.iso) == epoch


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
    of_day = Epoch(since_1970_s=0.0, is_utc=False, is_dated=False)
    assert of_day.moments([47_920.25, DAY_S + 1.0]) == ["13:18:40.250", "00:00:01.000"]


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
    assert Epoch(since_1970_s=0.0, is_utc=True).time_of_day(time_s, decimals) == text
    assert Epoch(since_1970_s=JULY_S + 3600.0, is_utc=True).time_of_day(time_s - 3600.0, decimals) == text


def test_days_have_a_date_or_a_number():
    assert Epoch(since_1970_s=JULY_S, is_utc=False).date(DAY_S + 1.0) == "2011-07-02"
    assert Epoch(since_1970_s=JULY_S + 0.5 * DAY_S, is_utc=False).date(0.5 * DAY_S - 0.4, 0) == "2011-07-02"
    assert Epoch(since_1970_s=0.0, is_utc=False, is_dated=False).date(DAY_S + 1.0) == "day 2"


@pytest.mark.parametrize(
    ("week", "second", "moment"),
    [
        (1694, 0.0, "2012-06-23T23:59:45Z"),
        (2086, 0.25, "2019-12-28T23:59:42.250Z"),
        (2200, 604_799.0, "2022-03-12T23:59:41Z"),
    ],
)
def test_weeks_of_gps(week: int, second: float, moment: str):
    (utc_s,) = utc_of_gps(np.array([float(week)]), np.array([second]))
    assert Epoch(since_1970_s=utc_s, is_utc=True).iso == moment


def test_a_clock_beside_the_axis_gives_the_epoch_once_it_is_set():
    time_s = np.arange(100) / 10.0
    moments = JULY_S + 47_920.25 + time_s
    moments[:20], moments[50], moments[70] = 0.0, math.nan, moments[70] + 1e4
    epoch = epoch_of_clock(moments, time_s, is_utc=True, is_dated=True)
    assert epoch == Epoch(since_1970_s=JULY_S + 47_920.25, is_utc=True)
    assert epoch_of_clock(np.zeros(100), time_s, is_utc=True, is_dated=True) is None
    of_day = epoch_of_clock((moments - JULY_S)[20:50], time_s[20:50] + DAY_S, is_utc=False, is_dated=False)
    assert of_day == Epoch(since_1970_s=47_920.25, is_utc=False, is_dated=False)


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
