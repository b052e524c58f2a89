"""Units, numbers and words of tables, figures and reports, whose values are stored in SI: SI itself, or a cockpit's.

Files stay in SI, with radians where tables show degrees (`IN_FILES`). `Units` is a value that is passed to whatever
writes for people; there is no global setting.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..printable import shortened
from .channels import Conversion, conversion_of, split_rates, unit_of

FloatArray = NDArray[np.float64]
UnitsName = Literal["si", "aviation"]

# Heights and their rates: these are flown in ft/min, other velocities in kt.
VERTICAL = ("altitude", "altitude_rate")
# A number with a unit in a sentence, or two numbers with one unit, and the channel of a limit. Text in quotation marks
# (an apostrophe within a word is none) is a name, or quoted as typed; a number after a letter, an equals sign or a
# quotation mark belongs to a name or a command.
QUOTED = r"(?<!\w)'.*?'(?!\w)|(?<!\w)\".*?\"(?!\w)"
AMOUNT = re.compile(
    rf"{QUOTED}|"
    r"(?<![\w.='/-])(?:(?P<low>-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) to )?(?P<high>-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) "
    r"(?P<unit>m/s\^2|m/s|m|rad/s|rad|Pa)(?![\w/^])(?= on (?P<channel>\w+))?"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Units:
    """A system of units.

    Attributes
    ----------
    name : of the option and of the key of the configuration.
    names : the unit shown, by SI unit without its rates and number of divisions by seconds; an entry with more
        divisions takes precedence. Other units are shown in SI.
    climb : the unit shown for the rate of a height.
    """

    name: UnitsName
    names: Mapping[tuple[str, int], str]
    climb: str = "m/s"

    def of(self, unit: str, *, channel: str = "", channel_unit: str = "") -> Conversion:
        """Return the shown unit of values in the SI `unit`.

        A rate of a channel is the channel's unit per second: a drift of an airspeed in m/s^2 is shown in kt/s, while
        an acceleration in m/s^2 stays what it is.

        Parameters
        ----------
        unit : SI, as `quantities.channels` and the shapes of faults write it: "m/s", "rad/s^2", "1/s"; "" for none.
        channel : of the values, or of the fault; "" without a channel.
        channel_unit : unit of that channel, if it is not standard.
        """
        stem, power = split_rates(unit)
        channel_stem, channel_power = split_rates(unit_of(channel, channel_unit))
        most = channel_power if channel_stem == stem and channel_power <= power else power
        if stem == "m" and power and channel in VERTICAL:
            named, name = 1, self.climb
        else:
            named = max((k for known, k in self.names if known == stem and k <= most), default=-1)
            if named < 0:
                return Conversion(1.0, unit)
            name = self.names[stem, named]
        known, rates = conversion_of(name), power - named
        per_second = "" if not rates else "/s" if rates == 1 else f"/s^{rates}"
        if per_second and re.fullmatch(r".*/s(\^\d+)?", name):
            return Conversion(1.0, unit)
        return Conversion(known.factor, unit, 0.0 if rates else known.offset, f"{name}{per_second}")

    def in_file(self, unit: str, *, channel: str = "", channel_unit: str = "") -> Conversion:
        """Return the shown unit of values of a file: in SI as stored, angles in rad too."""
        return Conversion(1.0, unit) if self.name == "si" else self.of(unit, channel=channel, channel_unit=channel_unit)

    def sentence(self, text: str, *, channel: str = "") -> str:
        """Return a stored sentence with its amounts in these units, with as many digits as in SI, at least two.

        A sentence that asks for the unit of a file, which is about the numbers in that file, is not changed.

        Parameters
        ----------
        channel : of amounts without "on CHANNEL" after them.
        """
        if self.name == "si" or "--unit " in text:
            return text
        return AMOUNT.sub(lambda match: self._amount(match, channel), text)

    def _amount(self, match: re.Match[str], channel: str) -> str:
        if match["unit"] is None:  # quoted
            return match[0]
        shown = self.of(match["unit"], channel=match["channel"] or channel)
        if shown.unit == match["unit"]:
            return match[0]
        ends = [end for end in (match["low"], match["high"]) if end is not None]
        return f"{' to '.join(_with_digits_of(end, float(end) / shown.factor) for end in ends)} {shown.unit}"


def _with_digits_of(text: str, value: float) -> str:
    digits = max(2, len(re.sub(r"e.*|\D", "", text).lstrip("0")))
    shown = f"{value:.{digits}g}"
    return shown if "e" not in shown else f"{value:.0f}" if abs(value) >= 1.0 else shown


# Angles are shown in degrees in every system.
SI = Units(name="si", names={("rad", 0): "deg"})
# Accelerations stay in m/s^2; a file that has them in g is converted when it is read.
AVIATION = Units(
    name="aviation",
    names={
        ("m", 0): "ft",
        ("m", 1): "kt",
        ("m", 2): "m/s^2",
        ("rad", 0): "deg",
        ("Pa", 0): "hPa",
        ("K", 0): "degC",
    },
    climb="ft/min",
)
# Units of CSV files: as stored, angles in radians.
IN_FILES = Units(name="si", names={})
UNITS: Mapping[str, Units] = {units.name: units for units in (SI, AVIATION)}
assert tuple(UNITS) == get_args(UnitsName)


# Heading of a report by decision.
# From this size on, two significant digits would be written with an exponent.
TWO_DIGITS = 99.5


def number(value: float | None, *, spread: float | None = None, digits: int = 4, extra: int = 0) -> str:
    """Return `value` rounded as its precision allows, "-" if absent.

    Parameters
    ----------
    value : any number.
    spread : half the width of its interval; the last digit shown is the first digit of it.
    digits : significant digits where there is no spread.
    extra : digits shown beyond the first one of `spread`.
    """
    if value is None or not math.isfinite(value):
        return "-"
    if spread is None or not math.isfinite(spread) or spread <= 0.0:
        return _without_negative_zero(f"{value:.{digits}g}")
    decimals = extra - math.floor(math.log10(spread))
    return _without_negative_zero(f"{value:.{max(decimals, 0)}f}" if decimals <= 6 else f"{value:.6g}")


def _without_negative_zero(text: str) -> str:
    return text if text.strip("-0.") else text.removeprefix("-")


def capital(sentence: str) -> str:
    """Return a sentence with a capital letter."""
    return f"{sentence[:1].upper()}{sentence[1:]}"


def duration(seconds: float | None) -> str:
    """Return a length of time to two digits, without an exponent: "220 s"; "- s" for None."""
    return "- s" if seconds is None else f"{instant(float(f'{seconds:.2g}'))} s"


def instant(time_s: float) -> str:
    """Return a time in s to six digits, or to 10 ms on an axis that counts from 1970."""
    return f"{time_s:.6g}" if abs(time_s) < 1e5 else f"{time_s:.2f}".rstrip("0").rstrip(".")


def clock(time_s: float) -> str:
    """Return a time as h:mm:ss, below an hour as m:ss."""
    sign, whole = "−" if time_s <= -0.5 else "", round(abs(time_s))
    minutes, seconds = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{sign}{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{sign}{minutes}:{seconds:02d}"


def clock_of_day(time_s: float) -> str:
    """Return a time since a midnight as the clock of a day shows it, hh:mm:ss from 0 to 24 h."""
    minutes, seconds = divmod(round(time_s) % 86_400, 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}"


def counted(n: int, noun: str) -> str:
    """Return a number with a noun of regular plural: "1 iteration", "2 iterations"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def quantity(value: float | None, unit: str) -> str:
    """Return a number to two significant digits with its unit; "-" if absent."""
    if value is None or not math.isfinite(value):
        return "-"
    return with_unit(number(value, digits=2) if abs(value) < TWO_DIGITS else f"{value:.0f}", unit)


def change(value: float | None, shown: Conversion) -> str:
    """Return a difference in SI (a fault, a limit, a standard deviation) as a `quantity` in the unit that is shown."""
    return quantity(shown.change(value), shown.unit)


def noise_levels(noise_sd: Mapping[str, float], units: Units, channel_units: Mapping[str, str]) -> str:
    """Return "tas 0.03 m/s, aoa 0.002 rad".

    Parameters
    ----------
    channel_units : of the channels of the log by name, for those that are not standard; a unit in neither is left out.
    """
    shown = {name: units.of(unit_of(name, channel_units.get(name, "")), channel=name) for name in noise_sd}
    return ", ".join(f"{name} {change(sd, shown[name])}" for name, sd in noise_sd.items())


def with_unit(text: str, unit: str) -> str:
    """Return the text of a number or an interval with its unit; a ratio, and "-" for no number, have no unit."""
    return text if text == "-" or unit == "1" else f"{text} {unit}".rstrip()


def interval(ci95: Sequence[float], *, extra: int = 0) -> str:
    """Return "low to high", both rounded to the first digit of the half width; "-" where it is unknown."""
    low, high = ci95
    if not (math.isfinite(low) and math.isfinite(high)):
        return "-"
    spread = 0.5 * abs(high - low)
    return " to ".join(number(value, spread=spread, extra=extra) for value in (low, high))


def axis_label(name: str, unit: str) -> str:
    """Return "name [unit]", or "name [unit not stated]"."""
    return f"{shortened(name, 28)} [{unit or 'unit not stated'}]"
