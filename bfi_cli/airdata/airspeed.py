"""The standard atmosphere; airspeeds and Mach number from pressures and temperature, and back.

The atmosphere is that of ICAO Doc 7488 (ISO 2533) in geopotential metres; the U.S. Standard Atmosphere 1976 is the same
below 20 000 m. Air flows adiabatically, a perfect gas, subsonic:
T 2-1 to 2-4 with the root over the whole bracket (docs/theory.md, erratum 5). Powers of numbers near one go through
`log1p` and `expm1`: at Mach 0.05 the impact pressure is 0.2 % of the static one, and a plain power loses three digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

# The constants of ICAO Doc 7488.
SEA_LEVEL_PRESSURE = 101_325.0  # Pa
SEA_LEVEL_TEMPERATURE = 288.15  # K
G = 9.80665  # m/s^2
GAS_CONSTANT = 287.05287  # J/(kg K)
LAPSE_RATE = 0.0065  # K/m
TROPOPAUSE = 11_000.0  # m
# m; from the lowest layer of Doc 7488 to where the isothermal layer ends.
LOWEST = -5_000.0
HIGHEST = 20_000.0

TROPOPAUSE_TEMPERATURE = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * TROPOPAUSE
EXPONENT = G / (LAPSE_RATE * GAS_CONSTANT)
SCALE_HEIGHT = GAS_CONSTANT * TROPOPAUSE_TEMPERATURE / G
# Logarithm of the pressure at the tropopause over that at sea level; the pressure is 22 632.06 Pa.
LOG_TROPOPAUSE = EXPONENT * float(np.log1p(-LAPSE_RATE * TROPOPAUSE / SEA_LEVEL_TEMPERATURE))
WHERE = f"the standard atmosphere is known between {LOWEST:g} and {HIGHEST:g} m"


def checked(
    name: str, values: ArrayLike, unit: str, *, least: float, most: float = np.inf, above: bool = False, why: str
) -> FloatArray:
    """Return the values, of what the equations of air data hold for, as an array of floats.

    Parameters
    ----------
    least, most : between which they lie, in `unit`; NaN is let through.
    above : `least` itself is refused, too.
    why : what the equations hold for, for the message.

    Raises
    ------
    ValueError : a value lies outside.
    """
    array = np.asarray(values, dtype=np.float64)
    wrong = array <= least if above else array < least
    if most < np.inf:
        wrong = wrong | (array > most)
    if wrong.any():
        value = float(array[wrong].flat[0] if array.ndim else array)
        raise ValueError(f"{name}: {why}, got {value:.6g} {unit}".rstrip())
    return array


def positive_pressure(p_static: ArrayLike) -> FloatArray:
    """Return a static pressure, Pa, that is positive."""
    return checked("p_static", p_static, "Pa", least=0.0, above=True, why="a static pressure is positive")


def isa_temperature(altitude: ArrayLike) -> FloatArray:
    """Return the temperature of the standard atmosphere, K.

    Parameters
    ----------
    altitude : pressure altitude, m.

    Raises
    ------
    ValueError : below -5000 or above 20 000 m.
    """
    h = checked("altitude", altitude, "m", least=LOWEST, most=HIGHEST, why=WHERE)
    return np.asarray(SEA_LEVEL_TEMPERATURE - LAPSE_RATE * np.minimum(h, TROPOPAUSE))


def pressure_at(altitude: ArrayLike) -> FloatArray:
    """Return the static pressure, Pa.

    Parameters
    ----------
    altitude : pressure altitude, m.

    Raises
    ------
    ValueError : below -5000 or above 20 000 m.
    """
    h = checked("altitude", altitude, "m", least=LOWEST, most=HIGHEST, why=WHERE)
    below = EXPONENT * np.log1p(-LAPSE_RATE * np.minimum(h, TROPOPAUSE) / SEA_LEVEL_TEMPERATURE)
    return np.asarray(SEA_LEVEL_PRESSURE * np.exp(below - np.maximum(h - TROPOPAUSE, 0.0) / SCALE_HEIGHT))


PRESSURES = tuple(float(pressure_at(altitude)) for altitude in (HIGHEST, LOWEST))


def altitude_of(p_static: ArrayLike) -> FloatArray:
    """Return the pressure altitude, m.

    Parameters
    ----------
    p_static : static pressure, Pa.

    Raises
    ------
    ValueError : a pressure that is not positive, or of an altitude below -5000 or above 20 000 m.
    """
    p = positive_pressure(p_static)
    # The ends to within rounding, so that what `pressure_at` returns is taken back.
    p = checked("p_static", p, "Pa", least=PRESSURES[0] * (1.0 - 1e-12), most=PRESSURES[1] * (1.0 + 1e-12), why=WHERE)
    logarithm = np.log(p / SEA_LEVEL_PRESSURE)
    below = -SEA_LEVEL_TEMPERATURE / LAPSE_RATE * np.expm1(np.maximum(logarithm, LOG_TROPOPAUSE) / EXPONENT)
    altitude = below + SCALE_HEIGHT * np.maximum(LOG_TROPOPAUSE - logarithm, 0.0)
    return np.asarray(np.clip(altitude, LOWEST, HIGHEST))


GAMMA = 1.4  # of air, as ICAO Doc 7488 has it
HALF = 0.5 * (GAMMA - 1.0)  # (gamma - 1) / 2 = 0.2
POWER = GAMMA / (GAMMA - 1.0)  # 3.5
SEA_LEVEL_SPEED_OF_SOUND = float(np.sqrt(GAMMA * GAS_CONSTANT * SEA_LEVEL_TEMPERATURE))
# SONIC_RATIO: impact over static pressure at Mach 1; beyond, a shock stands before the probe (Rayleigh's equation).
SONIC_RATIO = float(np.expm1(POWER * np.log1p(HALF)))
# SONIC_SHARE: Mach 1 over the speed of sound at the total temperature.
SONIC_SHARE = (1.0 + HALF) ** -0.5
SUBSONIC = "the equations hold below Mach 1"
# Relative; what an exact Mach 1 may differ by after a conversion and back.
ROUNDING = 1e-12


def _relative_impact(mach: FloatArray) -> FloatArray:
    """Return q_impact / p_static at a Mach number, or q_impact / p0 at cas / a0."""
    return np.asarray(np.expm1(POWER * np.log1p(HALF * mach**2)))


def _mach_of_relative(name: str, ratio: FloatArray) -> FloatArray:
    checked(name, ratio, "", least=0.0, most=SONIC_RATIO * (1.0 + ROUNDING), why=SUBSONIC)
    return np.asarray(np.sqrt(np.expm1(np.log1p(ratio) / POWER) / HALF))


def _mach(mach: ArrayLike) -> FloatArray:
    return checked("mach", mach, "", least=0.0, most=1.0 + ROUNDING, why=SUBSONIC)


def _impact(q_impact: ArrayLike) -> FloatArray:
    return checked("q_impact", q_impact, "Pa", least=0.0, why="an impact pressure is not negative")


def _temperature(name: str, kelvin: ArrayLike) -> FloatArray:
    return checked(name, kelvin, "K", least=0.0, above=True, why="a temperature in kelvin is positive")


def calibrated_airspeed(q_impact: ArrayLike) -> FloatArray:
    """Return the calibrated airspeed, m/s: the true one where this impact pressure (Pa) were met at sea level, ISA.

    Raises
    ------
    ValueError : a negative impact pressure, or one of a calibrated airspeed above the speed of sound at sea level.
    """
    ratio = _impact(q_impact) / SEA_LEVEL_PRESSURE
    return np.asarray(SEA_LEVEL_SPEED_OF_SOUND * _mach_of_relative("q_impact / p0", ratio))


def impact_pressure_of_cas(cas: ArrayLike) -> FloatArray:
    """Return the impact pressure, Pa, of a calibrated airspeed, m/s.

    Raises
    ------
    ValueError : a negative calibrated airspeed, or one above the speed of sound at sea level.
    """
    most = SEA_LEVEL_SPEED_OF_SOUND * (1.0 + ROUNDING)
    speed = checked("cas", cas, "m/s", least=0.0, most=most, why=f"0 to {most:.1f} m/s, {SUBSONIC}")
    return np.asarray(SEA_LEVEL_PRESSURE * _relative_impact(speed / SEA_LEVEL_SPEED_OF_SOUND))


def mach_number(q_impact: ArrayLike, p_static: ArrayLike) -> FloatArray:
    """Return the Mach number of an impact and a static pressure, Pa.

    Raises
    ------
    ValueError : a negative impact pressure, a static pressure that is not positive, or a Mach number above 1.
    """
    p = positive_pressure(p_static)
    return _mach_of_relative("q_impact / p_static", _impact(q_impact) / p)


def impact_pressure_of_mach(mach: ArrayLike, p_static: ArrayLike) -> FloatArray:
    """Return the impact pressure, Pa, at a Mach number and a static pressure, Pa.

    Raises
    ------
    ValueError : a Mach number below 0 or above 1, or a static pressure that is not positive.
    """
    return np.asarray(positive_pressure(p_static) * _relative_impact(_mach(mach)))


def speed_of_sound(sat: ArrayLike) -> FloatArray:
    """Return the speed of sound, m/s, at a static temperature, K.

    Raises
    ------
    ValueError : a temperature that is not positive.
    """
    return np.asarray(np.sqrt(GAMMA * GAS_CONSTANT * _temperature("sat", sat)))


def static_temperature(tat: ArrayLike, mach: ArrayLike) -> FloatArray:
    """Return the static temperature, K, of a total temperature, K, and a Mach number.

    Raises
    ------
    ValueError : a temperature that is not positive, or a Mach number below 0 or above 1.
    """
    return np.asarray(_temperature("tat", tat) / (1.0 + HALF * _mach(mach) ** 2))


def total_temperature(sat: ArrayLike, mach: ArrayLike) -> FloatArray:
    """Return the total temperature, K, of a static temperature, K, and a Mach number.

    Raises
    ------
    ValueError : a temperature that is not positive, or a Mach number below 0 or above 1.
    """
    return np.asarray(_temperature("sat", sat) * (1.0 + HALF * _mach(mach) ** 2))


def true_airspeed(mach: ArrayLike, tat: ArrayLike) -> FloatArray:
    """Return the true airspeed, m/s, at a Mach number and a total temperature, K.

    Raises
    ------
    ValueError : a temperature that is not positive, or a Mach number below 0 or above 1.
    """
    return np.asarray(_mach(mach) * speed_of_sound(static_temperature(tat, mach)))


def mach_of_tas(tas: ArrayLike, tat: ArrayLike) -> FloatArray:
    """Return the Mach number of a true airspeed, m/s, at a total temperature, K.

    Raises
    ------
    ValueError : a temperature that is not positive, a negative airspeed, or one above the speed of sound.
    """
    total = speed_of_sound(_temperature("tat", tat))
    share = checked("tas", tas, "m/s", least=0.0, why="an airspeed is not negative") / total
    checked(
        "tas over the speed of sound at tat", share, "", least=0.0, most=SONIC_SHARE * (1.0 + ROUNDING), why=SUBSONIC
    )
    return np.asarray(share / np.sqrt(1.0 - HALF * share**2))
