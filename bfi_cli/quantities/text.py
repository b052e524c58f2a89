"""Numbers and words of tables, figures and reports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..printable import shortened
from .channels import unit_of
from .display_units import Shown, Units

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


def change(value: float | None, shown: Shown) -> str:
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
