"""The units in which tables, figures and reports show what is stored in SI: SI itself, or those of a cockpit.

Files stay SI, with radians where people are shown degrees (`IN_FILES`). `Units` is a value that whoever writes for
people is given, nothing here is remembered between two calls.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .channels import unit_of
from .units import factor_and_offset, split_rates

FloatArray = NDArray[np.float64]
UnitsName = Literal["si", "aviation"]

# Heights and their rates: these are flown in ft/min, other velocities in kt.
VERTICAL = ("altitude", "altitude_rate")
# A number with a unit in a sentence, or two that one unit belongs to, and the channel that a limit is on. What stands
# between quotation marks is a name or a text as it was given (an apostrophe within a word is none); what follows a
# letter, an equals sign or a quotation mark is a part of a name or of a command.
QUOTED = r"(?<!\w)'.*?'(?!\w)|(?<!\w)\".*?\"(?!\w)"
AMOUNT = re.compile(
    rf"{QUOTED}|"
    r"(?<![\w.='/-])(?:(?P<low>-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) to )?(?P<high>-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) "
    r"(?P<unit>m/s\^2|m/s|m|rad/s|rad|Pa)(?![\w/^])(?= on (?P<channel>\w+))?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """How values of one SI unit are shown: value in SI = factor * value shown + offset.

    Attributes
    ----------
    unit : shown, "" for a log that states none.
    offset : of readings; differences, limits and rates have none.
    """

    unit: str
    factor: float = 1.0
    offset: float = 0.0

    def reading(self, value: float | None) -> float | None:
        """Return what an instrument reads, None for None."""
        return None if value is None else (value - self.offset) / self.factor

    def change(self, value: float | None) -> float | None:
        """Return a difference of two readings: a fault, a limit, a standard deviation; None for None."""
        return None if value is None else value / self.factor

    def readings(self, values: ArrayLike) -> FloatArray:
        """Return readings of any shape; the same array where nothing changes."""
        if self.offset == 0.0:
            return self.changes(values)
        return (np.asarray(values, dtype=np.float64) - self.offset) / self.factor

    def changes(self, values: ArrayLike) -> FloatArray:
        """Return differences of readings, of any shape; the same array where nothing changes."""
        array = np.asarray(values, dtype=np.float64)
        return array if self.factor == 1.0 else array / self.factor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Units:
    """A system of units.

    Attributes
    ----------
    name : of the option and of the key of the configuration.
    names : by SI unit without its rates, and how often it is divided by seconds, what is shown; the unit of an entry
        with more divisions goes before that of one with fewer. What is not named is shown in SI.
    climb : of the rate of a height.
    """

    name: UnitsName
    names: Mapping[tuple[str, int], str]
    climb: str = "m/s"

    def of(self, unit: str, *, channel: str = "", own: str = "") -> Shown:
        """Return how values in the SI `unit` are shown.

        A rate of a channel is the channel's unit per second: a drift of an airspeed in m/s^2 is shown in kt/s, while
        an acceleration in m/s^2 stays what it is.

        Parameters
        ----------
        unit : SI, as `bfi_cli.units` and the shapes of faults write it: "m/s", "rad/s^2", "1/s"; "" for none.
        channel : what the values are of, or of whose faults; "" where that is no channel.
        own : unit of that channel, where it is no standard one.
        """
        stem, power = split_rates(unit)
        own_stem, own_power = split_rates(unit_of(channel, own))
        most = own_power if own_stem == stem and own_power <= power else power
        if stem == "m" and power and channel in VERTICAL:
            named, name = 1, self.climb
        else:
            named = max((k for known, k in self.names if known == stem and k <= most), default=-1)
            if named < 0:
                return Shown(unit=unit)
            name = self.names[stem, named]
        factor, offset = factor_and_offset(name)
        rates = power - named
        per_second = "" if not rates else "/s" if rates == 1 else f"/s^{rates}"
        if per_second and re.fullmatch(r".*/s(\^\d+)?", name):
            return Shown(unit=unit)
        return Shown(unit=f"{name}{per_second}", factor=factor, offset=0.0 if rates else offset)

    def of_file(self, unit: str, *, channel: str = "", own: str = "") -> Shown:
        """Return how values of a file are shown: in SI as they stand there, angles in rad too."""
        return Shown(unit=unit) if self.name == "si" else self.of(unit, channel=channel, own=own)

    def sentence(self, text: str, *, channel: str = "") -> str:
        """Return a stored sentence with its amounts in these units, to as many digits as they have, two or more.

        A sentence that asks for the unit of a file is about the numbers in it, and stays.

        Parameters
        ----------
        channel : what the amounts are of that name none themselves, "4 m/s on altitude_rate".
        """
        if self.name == "si" or "--unit " in text:
            return text
        return AMOUNT.sub(lambda found: self._amount(found, channel), text)

    def _amount(self, found: re.Match[str], channel: str) -> str:
        if found["unit"] is None:  # quoted
            return found[0]
        shown = self.of(found["unit"], channel=found["channel"] or channel)
        if shown.unit == found["unit"]:
            return found[0]
        ends = [end for end in (found["low"], found["high"]) if end is not None]
        return f"{' to '.join(_with_digits_of(end, float(end) / shown.factor) for end in ends)} {shown.unit}"


def _with_digits_of(text: str, value: float) -> str:
    digits = max(2, len(re.sub(r"e.*|\D", "", text).lstrip("0")))
    shown = f"{value:.{digits}g}"
    return shown if "e" not in shown else f"{value:.0f}" if abs(value) >= 1.0 else shown


# Angles are shown in degrees everywhere: nobody reads a vane or a surface in radians.
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
# Of CSV files: as stored, angles in radians.
IN_FILES = Units(name="si", names={})
UNITS: Mapping[str, Units] = {one.name: one for one in (SI, AVIATION)}
assert tuple(UNITS) == get_args(UnitsName)
