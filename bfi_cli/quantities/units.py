"""Units as people write them, and their conversion to SI and radians."""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import LogError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Conversion:
    """SI value = factor * value + offset."""

    factor: float
    si: str
    offset: float = 0.0


# Exact by definition: the international foot, inch and pound (1959), the standard gravity (CGPM 1901).
DEGREE, FOOT, INCH, G, POUND = math.pi / 180.0, 0.3048, 0.0254, 9.80665, 0.45359237
PSI = POUND * G / INCH**2

CONVERSIONS = (
    (Conversion(1.0, "1"), "1 - ratio none no_unit no_units dimensionless part mach norm bool flag"),
    (Conversion(0.01, "1"), "% percent pct"),
    (Conversion(1.0, "s"), "s sec secs second seconds"),
    (Conversion(1e-3, "s"), "ms msec millisecond milliseconds"),
    (Conversion(1e-6, "s"), "us usec microsecond microseconds"),
    (Conversion(1e-9, "s"), "ns nsec nanosecond nanoseconds"),
    (Conversion(60.0, "s"), "min minute minutes"),
    (Conversion(3600.0, "s"), "h hr hour hours"),
    (Conversion(1.0, "m"), "m meter meters metre metres"),
    (Conversion(1000.0, "m"), "km kilometer kilometers kilometre kilometres"),
    (Conversion(0.01, "m"), "cm"),
    (Conversion(1e-3, "m"), "mm"),
    (Conversion(FOOT, "m"), "ft foot feet ftmsl ft_msl ft_baro ft_wgs"),
    (Conversion(INCH, "m"), "in inch inches"),
    (Conversion(1852.0, "m"), "nm nmi"),
    (Conversion(1.0, "m/s"), "m/s mps m/sec ms-1 m_s meter/second meters/second metre/second metres/second"),
    (Conversion(FOOT, "m/s"), "ft/s fps ft/sec feet/second foot/second ft_s"),
    (Conversion(FOOT / 60.0, "m/s"), "ft/min fpm feet/minute feet/min ft_min"),
    (Conversion(1.0 / 3.6, "m/s"), "km/h kmh kph kmph km/hr km_h"),
    (Conversion(1852.0 / 3600.0, "m/s"), "kt kts kn knot knots ktas kias kcas ktgs"),
    (Conversion(0.01, "m/s"), "cm/s"),
    (Conversion(0.44704, "m/s"), "mph mi/h miles/hour"),
    (Conversion(1.0, "rad"), "rad radian radians rads"),
    (Conversion(DEGREE, "rad"), "deg degree degrees degs"),
    (Conversion(1e-3, "rad"), "mrad"),
    (Conversion(1.0, "rad/s"), "rad/s rad/sec radians/second rps rad_s"),
    (Conversion(DEGREE, "rad/s"), "deg/s deg/sec degree/second degrees/second degs/s dps deg_s"),
    (Conversion(2.0 * math.pi / 60.0, "rad/s"), "rpm rev/min"),
    (Conversion(1.0, "rad/s^2"), "rad/s2 rad/sec2"),
    (Conversion(DEGREE, "rad/s^2"), "deg/s2 deg/sec2"),
    (Conversion(1.0, "m/s^2"), "m/s2 m/s/s m/sec2 mps2 m_s2"),
    (Conversion(G, "m/s^2"), "g gs g0"),
    (Conversion(FOOT, "m/s^2"), "ft/s2 ft/sec2"),
    (Conversion(1.0, "Pa"), "pa pascal pascals n/m2"),
    (Conversion(100.0, "Pa"), "hpa mbar mb millibar millibars hectopascal"),
    (Conversion(1000.0, "Pa"), "kpa kilopascal"),
    (Conversion(1e5, "Pa"), "bar"),
    (Conversion(3386.389, "Pa"), "inhg in_hg inch_hg"),
    (Conversion(PSI, "Pa"), "psi psia psid lbf/in2"),
    (Conversion(PSI / 144.0, "Pa"), "psf lbf/ft2"),
    (Conversion(1.0, "K"), "k kelvin degk deg_k"),
    (Conversion(1.0, "K", 273.15), "degc c celsius deg_c degrees_c degrees_celsius"),
    (Conversion(5.0 / 9.0, "K", 459.67 * 5.0 / 9.0), "degf f fahrenheit deg_f degrees_f degrees_fahrenheit"),
    (Conversion(1.0, "N"), "n newton newtons"),
    (Conversion(POUND * G, "N"), "lbf pound_force"),
    (Conversion(1.0, "kg"), "kg kilogram kilograms"),
    (Conversion(POUND, "kg"), "lb lbs pound pounds"),
    (Conversion(1.0, "kg/s"), "kg/s kg/sec"),
    (Conversion(POUND / 3600.0, "kg/s"), "lb/h lbs/h lb/hr lbs/hr pph"),
    (Conversion(1.0 / 3600.0, "kg/s"), "kg/h kg/hr"),
    (Conversion(1.0, "Hz"), "hz hertz"),
    (Conversion(1.0, "V"), "v volt volts"),
    (Conversion(1.0, "A"), "a amp ampere amps"),
)
CASE_MATTERS = {"kN": Conversion(1000.0, "N"), "MPa": Conversion(1e6, "Pa"), "mPa": Conversion(1e-3, "Pa")}
BY_SPELLING = {spelling: conversion for conversion, spellings in CONVERSIONS for spelling in spellings.split()}
# "5kt", "1.5e1 ft", "0.01 1/s", "0.01/s": a number and a unit, which begins with no digit but that of "1/".
AMOUNT = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>(?:(?<=\s)1\s*/|[^\d\s.]).*)")
# "deg/s" is the rate of "deg", "1/s^2" that of "1/s^1".
RATE = re.compile(r"(?P<of>.+?)\s*/\s*s(?:ec)?(?:\^?(?P<power>[1-9]))?")
RESPELL = str.maketrans({"°": "deg", "º": "deg", "µ": "u", "μ": "u", "²": "2", "·": ".", "⁻": "-", "¹": "1"})


def to_si(values: ArrayLike, unit: str, *, where: str = "unit") -> tuple[FloatArray, str]:
    """Convert values to SI units and radians.

    Parameters
    ----------
    values : any shape.
    unit : as people write it ("kt", "deg/s", "°C", "ft/min"); "" leaves the values alone.
    where : start of the error message.

    Returns
    -------
    The converted copy, exactly equal to `values` where the unit is SI already, and its SI unit ("" for "").

    Raises
    ------
    LogError : the unit is not known.
    """
    array = np.array(values, dtype=np.float64)
    if not unit.strip():
        return array, ""
    conversion = _known(unit, where)
    if conversion.factor != 1.0:
        array *= conversion.factor
    if conversion.offset:
        array += conversion.offset
    return array, conversion.si


def factor_and_offset(unit: str) -> tuple[float, float]:
    """Return factor and offset of a unit: the SI value is factor * value + offset.

    Raises
    ------
    LogError : the unit is not known.
    """
    conversion = _known(unit)
    return conversion.factor, conversion.offset


def change_in_si(text: str) -> tuple[float, str]:
    """Return a difference with its unit, "5kt", "0.5 kt/s", "0.01 1/s" or "2 degC", in SI, and its SI unit.

    Offsets, as that of degC, do not apply. Rates of any known unit are known, and rates of these, "m/s^3".

    Raises
    ------
    ValueError : the text is no number with a unit.
    LogError : the unit is not known.
    """
    amount = AMOUNT.fullmatch(text.strip())
    if amount is None:
        raise ValueError(text)
    unit, rates = amount["unit"].strip(), 0
    stem = f"1{unit}" if unit.startswith("/") else unit
    while _conversion(stem) is None and (rate := RATE.fullmatch(stem.translate(RESPELL))) is not None:
        power = int(rate["power"] or 1)
        stem = f"{rate['of'].strip()}/s^{power - 1}" if power > 1 else rate["of"].strip()
        rates += 1
    conversion = _known(stem, stated=unit)
    si = conversion.si
    for _ in range(rates):
        si = per_second(si)
    return conversion.factor * float(amount["number"]), si


def per_second(unit: str) -> str:
    """Return the unit of the rate of a quantity in `unit`: "m/s^2" for "m/s", "1/s" for ""."""
    stem, power = split_rates(unit or "1")
    return f"{stem}/s" if not power else f"{stem}/s^{power + 1}"


def split_rates(unit: str) -> tuple[str, int]:
    """Return an SI unit without its divisions by seconds, and how many these are: ("m", 2) for "m/s^2"."""
    rate = re.fullmatch(r"(.+?)/s(?:\^(\d+))?", unit)
    return (unit, 0) if rate is None else (rate[1], int(rate[2] or 1))


def si_unit(unit: str) -> str | None:
    """Return the SI unit a spelling converts to, None where it is not known."""
    conversion = _conversion(unit)
    return None if conversion is None else conversion.si


def _known(unit: str, where: str = "unit", *, stated: str | None = None) -> Conversion:
    """Return the conversion of a unit; the error names the one that was `stated`."""
    conversion = _conversion(unit)
    if conversion is None:
        close = difflib.get_close_matches(_plain(stated or unit), BY_SPELLING, n=1, cutoff=0.6)
        hint = f"did you mean '{close[0]}'?" if close else "give an SI unit, or one like kt, ft, deg, degC, hPa, g"
        raise LogError(f"{where}: unknown unit '{stated or unit}'; {hint}")
    return conversion


def _conversion(unit: str) -> Conversion | None:
    stripped = unit.strip().strip("[]()<>").strip()
    if stripped in CASE_MATTERS:
        return CASE_MATTERS[stripped]
    plain = _plain(stripped)
    return BY_SPELLING.get(plain) or BY_SPELLING.get(plain.replace("_", ""))


def _plain(unit: str) -> str:
    """Lower-case spelling with one sign for "per", no sign for "to the power of" and "_" for a blank."""
    text = unit.translate(RESPELL).lower().strip()
    text = re.sub(r"(?:\s+|_)per(?:\s+|_)", "/", text)
    text = re.sub(r"(\*\*|\^)(?=-?\d)", "", text)
    text = re.sub(r"(?<=[a-z])[ .*]s-(?=[12])", "/s", text)
    text = re.sub(r"/s1$", "/s", text)
    return re.sub(r"\s+", "" if "/" in text else "_", text)
