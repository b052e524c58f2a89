"""The standard atmosphere: temperature and pressure at a pressure altitude, and back.

ICAO Doc 7488 (ISO 2533) in geopotential metres; the U.S. Standard Atmosphere 1976 is the same below 20 000 m.
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
