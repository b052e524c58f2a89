"""The F-16's engine: throttle to power, its lag, thrust; and the book's standard atmosphere. SI, power in percent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .airframe import FOOT, POUND
from .tables import tables

__all__ = ["air_density", "commanded_power", "mach_number", "power_rate", "thrust"]

FloatArray = NDArray[np.float64]

MILITARY = 50.0
DENSITY_0 = 0.002377 * POUND / FOOT**4
LAPSE = 0.703e-5 / FOOT
TEMPERATURE_0, STRATOSPHERE, TROPOPAUSE = 519.0, 390.0, 35000.0 * FOOT
GAS = 1.4 * 1716.3 * FOOT**2


def air_density(altitude: FloatArray) -> FloatArray:
    """Return kg/m^3 at altitudes in m."""
    return np.asarray(DENSITY_0 * (1.0 - LAPSE * altitude) ** 4.14)


def mach_number(tas: FloatArray, altitude: FloatArray) -> FloatArray:
    """Return the Mach number of an airspeed in m/s at an altitude in m."""
    rankine = np.where(altitude >= TROPOPAUSE, STRATOSPHERE, TEMPERATURE_0 * (1.0 - LAPSE * altitude))
    return np.asarray(tas / np.sqrt(GAS * rankine))


def commanded_power(throttle: FloatArray) -> FloatArray:
    """Return the power, percent, that a throttle position asks for; 0.77 is military power."""
    return np.where(throttle <= 0.77, 64.94 * throttle, 217.38 * throttle - 117.38)


def power_rate(power: FloatArray, throttle: FloatArray) -> FloatArray:
    """Return d power / dt, percent/s: a first-order lag, slow for large steps, that enters the afterburner at 60 %."""
    wanted = commanded_power(throttle)
    burning, rising = power >= MILITARY, wanted >= MILITARY
    goal = np.where(rising & ~burning, 60.0, np.where(burning & ~rising, 40.0, wanted))
    quickness = np.minimum(np.maximum(1.9 - 0.036 * (goal - power), 0.1), 1.0)
    return np.asarray(np.where(burning, 5.0, quickness) * (goal - power))


def thrust(power: FloatArray, altitude: FloatArray, mach: FloatArray) -> FloatArray:
    """Return thrust, N, from power in percent, altitude in m and Mach number, all (n,)."""
    data = tables()
    i, up = data.mach.place(mach)
    j, across = data.altitude.place(altitude)
    low = (1.0 - across) * data.thrust[:, i, j] + across * data.thrust[:, i, j + 1]
    high = (1.0 - across) * data.thrust[:, i + 1, j] + across * data.thrust[:, i + 1, j + 1]
    idle, military, maximum = (1.0 - up) * low + up * high
    dry = power < MILITARY
    part = power / MILITARY - np.where(dry, 0.0, 1.0)
    return np.asarray(np.where(dry, idle + part * (military - idle), military + part * (maximum - military)))
