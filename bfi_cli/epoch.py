"""The clock of a log: the moment from which its times count, and its times as a clock shows them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

DAY_S: Final = 86_400.0  # without leap seconds, which clocks of recorders do not count
# [s since 1970]: an axis within it counts from 1970. It covers 1990 to 2055; seconds of a flight and of a week are
# below it, and those since 1904 (LabVIEW) of these years beyond.
SINCE_1970: Final = (6.3e8, 2.7e9)
# s since 1970: 1980-01-06, from which GPS counts; the beginnings of the counts of leap seconds since then, from 2006 on
# (IERS Bulletin C); GPS of before is not read.
GPS_S: Final = 315_964_800.0
LEAP_SECONDS: Final = (
    (-np.inf, 14),
    (DAY_S * 14_245, 15),  # 2009-01-01
    (DAY_S * 15_522, 16),  # 2012-07-01
    (DAY_S * 16_617, 17),  # 2015-07-01
    (DAY_S * 17_167, 18),  # 2017-01-01
)
ISO = re.compile(
    r"(?:(?P<day>[+-]?\d{4,6}-\d\d-\d\d)T)?"
    r"(?P<h>[01]\d|2[0-3]):(?P<m>[0-5]\d):(?P<s>[0-5]\d(?:\.\d{1,3})?)(?P<utc>Z?)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """The moment from which the times of a log count.

    Attributes
    ----------
    since_1970_s : that moment, s since 1970 without leap seconds, to 1 ms; of an unknown day since its midnight.
    is_utc : the clock shows UTC, else that of a zone which is not known.
    is_dated : whether the day is known.
    """

    since_1970_s: float
    is_utc: bool
    is_dated: bool = True

    @classmethod
    def from_iso(cls, text: str) -> Epoch:
        """Return the epoch of a text as `iso` writes it.

        Raises
        ------
        ValueError : it is none.
        """
        if (match := ISO.fullmatch(text)) is None:
            raise ValueError(f"{text!r} is no moment like 2011-07-01T00:00:00Z")
        day = 0 if match["day"] is None else int(np.datetime64(match["day"], "D").astype(np.int64))
        since_s = DAY_S * day + 3600.0 * int(match["h"]) + 60.0 * int(match["m"]) + float(match["s"])
        return cls(since_1970_s=round(since_s, 3), is_utc=bool(match["utc"]), is_dated=match["day"] is not None)

    @property
    def iso(self) -> str:
        """In ISO 8601: "2011-07-01T00:00:00Z", without "Z" in no known zone, "00:00:00" of no known day."""
        day = f"{self.date(0.0)}T" if self.is_dated else ""
        decimals = 0 if self.since_1970_s % 1.0 == 0.0 else 3
        return f"{day}{self.time_of_day(0.0, decimals)}{'Z' * self.is_utc}"

    @property
    def midnight_s(self) -> float:
        """The time of the log, s, at which its clock showed 0:00 last before it began to count: 0 or less."""
        return -(self.since_1970_s % DAY_S)

    def date(self, time_s: float, decimals: int = 3) -> str:
        """Return the day of a time, rounded as `time_of_day` does: "2011-07-01", of an unknown day "day 1"."""
        day = int(round(self.since_1970_s + time_s, decimals) // DAY_S)
        return str(np.datetime64(day, "D")) if self.is_dated else f"day {day + 1}"

    def time_of_day(self, time_s: float, decimals: int = 0) -> str:
        """Return what the clock shows at a time of the log: "13:20:01", with `decimals` of seconds."""
        per_s = 10**decimals
        ticks = round((self.since_1970_s % DAY_S + time_s) * per_s) % (int(DAY_S) * per_s)
        minutes, ticks = divmod(ticks, 60 * per_s)
        seconds = f"{ticks // per_s:02d}" + (f".{ticks % per_s:0{decimals}d}" if decimals else "")
        return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds}"

    def moments(self, times_s: ArrayLike) -> list[str]:
        """Return times of the log (n,) in ISO 8601 to 1 ms, "" for NaN; of an unknown day the time of day."""
        since_s = np.asarray(times_s, dtype=np.float64) + self.since_1970_s
        is_known = np.isfinite(since_s)
        ms = np.round(1e3 * np.where(is_known, since_s, 0.0)).astype(np.int64)
        texts = np.datetime_as_string(ms.astype("datetime64[ms]"))
        kept = slice(None if self.is_dated else -len("00:00:00.000"), None)
        zone = "Z" if self.is_utc else ""
        return [f"{text[kept]}{zone}" if known else "" for text, known in zip(texts, is_known, strict=True)]


def utc_of_gps(week: FloatArray, second: FloatArray) -> FloatArray:
    """Return the moments, s since 1970, of weeks and seconds of GPS (n,), which does not count leap seconds."""
    since_s = GPS_S + 7.0 * DAY_S * week + second
    starts, leaps = zip(*LEAP_SECONDS, strict=True)
    return np.asarray(since_s - np.array(leaps)[np.searchsorted(starts, since_s, side="right") - 1])


def epoch_since_1970(first_s: float, last_s: float) -> Epoch | None:
    """Return the epoch of an axis that counts from 1970, None of any other."""
    low, high = SINCE_1970
    return Epoch(since_1970_s=0.0, is_utc=True) if low <= first_s and last_s <= high else None


def epoch_of_clock(moments_s: FloatArray, times_s: FloatArray, *, is_utc: bool, is_dated: bool) -> Epoch | None:
    """Return the epoch of a log whose clock is recorded beside its time axis, None where it never was set.

    It is right to the resolution of the clock. Moments beyond `SINCE_1970` are those of a clock that was not set.

    Parameters
    ----------
    moments_s : (n,) of the clock, s since 1970, or since midnight if it is not `is_dated`; times_s : (n,) of the log.
    """
    first_s, last_s = SINCE_1970 if is_dated else (0.0, np.inf)
    is_set = np.isfinite(moments_s) & np.isfinite(times_s) & (moments_s >= first_s) & (moments_s <= last_s)
    if not is_set.any():
        return None
    since_s = round(float(np.median((moments_s - times_s)[is_set])), 3)
    return Epoch(since_1970_s=since_s if is_dated else since_s % DAY_S, is_utc=is_utc, is_dated=is_dated)
