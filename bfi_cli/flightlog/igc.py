"""IGC files of gliders' flight recorders: fixes (B records) with the extensions that the I record names.

Names follow appendix A of the "Technical Specification for GNSS Flight Recorders" of the FAI's gliding commission.
Times are UTC, altitudes m, speeds km/h and directions degrees, both with three digits before the decimals.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from datetime import date

import numpy as np

from ..epoch import DAY_S, Epoch
from ..errors import LogError
from ..notes import Note
from .axis import with_midnights
from .layouts import with_channels
from .rates import in_order
from .raw import RawLog, ReadRequest
from .record import Track

FIX = re.compile(
    r"B(\d\d)([0-5]\d)([0-5]\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})(.*)", re.DOTALL
)
DAY = re.compile(r"H[FOP]DTE(?:DATE:)?\s*([0-3]\d)([01]\d)(\d\d)")
EXTENSION = re.compile(r"(\d\d)(\d\d)([A-Z0-9]{3})")
# Characters: a record has 99 at most.
LONGEST_RECORD = 1000
LARGEST = 2 * 10**8  # bytes; a fix each second for a month
# Codes of numbers of three digits and decimals behind them, with their units.
DECIMAL = ("TAS", "IAS", "GSP", "TRT", "TRM", "HDT", "HDM", "OAT", "WSP", "WDI")
# Codes of further digits: of the minutes of latitude and longitude, and of the seconds.
FURTHER = ("LAD", "LOD", "TDS")


def read_igc(path: str, _: ReadRequest) -> RawLog:
    """Read the fixes of an IGC file; the GNSS altitude of a fix without one is NaN.

    Raises
    ------
    LogError : fewer than two fixes, or the file is too large.
    """
    if os.path.getsize(path) > LARGEST:
        raise LogError(f"{path}: more than {LARGEST / 1e6:.0f} MB of fixes; cut the file")
    extensions: dict[str, slice] = {}
    fixes, day, n_damaged = list[tuple[float, ...]](), None, 0
    with open(path, encoding="latin-1") as file:
        while text := file.readline(LONGEST_RECORD):
            if text.startswith("I") and not fixes:
                # The characters of a B record that hold each extension, by its code.
                places = EXTENSION.findall(text[3:].strip())
                extensions = {c: slice(int(a) - 1, int(z)) for a, z, c in places if 36 <= int(a) <= int(z)}
            elif day is None and (stated := DAY.match(text)):
                day = stated
            elif text.startswith("B"):
                fix = FIX.match(text.rstrip("\r\n"))
                if fix is None:
                    n_damaged += 1
                else:
                    fixes.append(_numbers(fix, extensions))
    if len(fixes) < 2:
        raise LogError(f"{path}: {len(fixes)} fixes, at least 2 are needed; give a file with B records")
    time_s, *values = np.array(fixes).T
    time_s = with_midnights(time_s)
    # A microsecond more for each fix: one that repeats the second before is in order.
    ordered, why = in_order(
        Track(
            source="B", values=np.arange(time_s.size, dtype=np.float64), time_s=time_s + 1e-6 * np.arange(time_s.size)
        )
    )
    if ordered is not None and why is not None:
        kept = ordered.values.astype(np.intp)
        time_s, values = time_s[kept], [column[kept] for column in values]
    names = ("latitude", "longitude", "pressure_altitude", "gnss_altitude", *_channels(extensions))
    first_day = None if day is None else _since_1970(*map(int, day.groups()))
    epoch = Epoch(since_1970_s=first_day or 0.0, is_utc=True, is_dated=first_day is not None)
    columns = [Track(source="time", values=time_s, unit="s", channel="time", epoch=epoch, why="UTC of the fixes")]
    columns += [Track(source=name, values=column) for name, column in zip(names, values, strict=True)]
    left_out = {}
    if not columns[3].values.any():  # a recorder without a pressure sensor
        left_out[columns.pop(3).source] = "is zero throughout"
    notes = [Note.limit(f"B records that are damaged are left out: {n_damaged}")] if n_damaged else []
    notes += [Note.limit(f"B records: {why}")] if ordered is not None and why is not None else []
    return RawLog(columns=with_channels(columns, "igc"), notes=tuple(notes), left_out=left_out)


def _channels(extensions: Mapping[str, slice]) -> list[str]:
    return [code for code in extensions if code not in FURTHER]


def _numbers(fix: re.Match[str], extensions: Mapping[str, slice]) -> tuple[float, ...]:
    """Return time of day, s, latitude and longitude, degrees, the two altitudes, m, and the extensions of a fix."""
    text = fix[0]

    def further(code: str) -> str:
        digits = text[extensions[code]] if code in extensions else ""
        return digits if digits.isdecimal() and digits.isascii() else ""

    hours, minutes, seconds, north, latitude, south, east, longitude, west, validity, pressure, gnss, _ = fix.groups()
    time_s = 3600.0 * int(hours) + 60.0 * int(minutes) + float(f"{seconds}.{further('TDS') or 0}")
    return (
        time_s,
        math.copysign(int(north) + _minutes(latitude, further("LAD")) / 60.0, 1 if south == "N" else -1),
        math.copysign(int(east) + _minutes(longitude, further("LOD")) / 60.0, 1 if west == "E" else -1),
        float(pressure),
        float(gnss) if validity == "A" else math.nan,
        *(_extension(code, text[extensions[code]]) for code in _channels(extensions)),
    )


def _minutes(digits: str, further: str) -> float:
    return float(f"{digits[:2]}.{digits[2:]}{further}")


def _extension(code: str, text: str) -> float:
    """Return the number of an extension, NaN where it is none."""
    if not re.fullmatch(r"[-+]?[0-9]+", text.strip()) or len(text) > 15:
        return math.nan
    return int(text) / 10.0 ** max(len(text.strip()) - 3, 0) if code in DECIMAL else float(int(text))


def _since_1970(day: int, month: int, year: int) -> float | None:
    """Return the midnight of a date with a year of two digits, 1980 to 2079, in s since 1970; None of no date."""
    try:
        return DAY_S * (date(year + (1900 if year >= 80 else 2000), month, day) - date(1970, 1, 1)).days
    except ValueError:
        return None
