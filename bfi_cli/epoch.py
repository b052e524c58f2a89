"""The clock of a log: the midnight from which its times count, and its times as a clock shows them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

DAY_S: Final = 86_400.0  # without leap seconds, which clocks of recorders do not count
# [s since 1970]: an axis within it counts from 1970. It covers 1990 to 2055; seconds of a flight and of a week are
# below it, and those since 1904 (LabVIEW) of these years beyond.
SINCE_1970: Final = (6.3e8, 2.7e9)
ISO = re.compile(r"(?:(?P<day>[+-]?\d{4,6}-\d\d-\d\d)T)?00:00:00(?P<utc>Z?)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """The midnight from which the times of a log count.

    Attributes
    ----------
    since_1970_s : that midnight, s since 1970 without leap seconds; None of an unknown day.
    is_utc : the clock shows UTC, else that of a zone which is not known.
    """

    since_1970_s: float | None
    is_utc: bool

    @classmethod
    def of_iso(cls, text: str) -> Epoch:
        """Return the epoch of a text as `iso` writes it.

        Raises
        ------
        ValueError : it is none.
        """
        if (match := ISO.fullmatch(text)) is None:
            raise ValueError(f"{text!r} is no midnight")
        since_1970_s = None
        if match["day"] is not None:
            since_1970_s = DAY_S * int(np.datetime64(match["day"], "D").astype(np.int64))
        return cls(since_1970_s=since_1970_s, is_utc=bool(match["utc"]))

    @property
    def iso(self) -> str:
        """In ISO 8601: "2011-07-01T00:00:00Z", without "Z" for no stated zone, "00:00:00" for no known day."""
        day = "" if self.since_1970_s is None else f"{self.date(0.0)}T"
        return f"{day}00:00:00{'Z' * self.is_utc}"

    def date(self, time_s: float) -> str:
        """Return the day of a time of the log: "2011-07-01", of an unknown epoch "day 1"."""
        if self.since_1970_s is None:
            return f"day {int(time_s // DAY_S) + 1}"
        return str(np.datetime64(int((self.since_1970_s + time_s) // DAY_S), "D"))

    def moments(self, times_s: ArrayLike) -> list[str]:
        """Return times of the log (n,) in ISO 8601 to 1 ms, "" for NaN; of an unknown day the time of day."""
        since_s = np.asarray(times_s, dtype=np.float64) + (self.since_1970_s or 0.0)
        is_known = np.isfinite(since_s)
        ms = np.round(1e3 * np.where(is_known, since_s, 0.0)).astype(np.int64)
        texts = np.datetime_as_string(ms.astype("datetime64[ms]"))
        kept = slice(None) if self.since_1970_s is not None else slice(-len("00:00:00.000"), None)
        zone = "Z" if self.is_utc else ""
        return [f"{text[kept]}{zone}" if known else "" for text, known in zip(texts, is_known, strict=True)]


def time_of_day(time_s: float, decimals: int = 0) -> str:
    """Return what the clock of a day shows at a time that counts from a midnight: "13:20:01", with `decimals` of s."""
    per_s = 10**decimals
    minutes, ticks = divmod(round(time_s * per_s) % (int(DAY_S) * per_s), 60 * per_s)
    seconds = f"{ticks // per_s:02d}" + (f".{ticks % per_s:0{decimals}d}" if decimals else "")
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds}"


def epoch_since_1970(first_s: float, last_s: float) -> Epoch | None:
    """Return the epoch of an axis that counts from 1970, None of any other."""
    low, high = SINCE_1970
    return Epoch(since_1970_s=0.0, is_utc=True) if low <= first_s and last_s <= high else None
