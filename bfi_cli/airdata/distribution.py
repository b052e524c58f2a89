"""The linear fault distribution of T 2-5: how far a channel moves for a small error of a pressure."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .airspeed import (
    HALF,
    POWER,
    SEA_LEVEL_SPEED_OF_SOUND,
    calibrated_airspeed,
    mach_number,
    speed_of_sound,
    static_temperature,
)
from .atmosphere import GAS_CONSTANT, SEA_LEVEL_PRESSURE, G, altitude_of, isa_temperature
from .domain import FloatArray

__all__ = ["fault_distribution"]

Distributed = Literal["p_static", "p_total", "q_impact", "cas", "mach", "tas", "sat", "altitude"]


def fault_distribution(
    channel: Distributed,
    p_static: ArrayLike,
    p_total: ArrayLike,
    tat: ArrayLike,
    *,
    held: Literal["total", "static"] = "total",
) -> FloatArray:
    """Return (..., 2) the derivatives of a channel by static and total pressure, [a11, a12] of T 2-5.

    Parameters
    ----------
    channel : by its standard name.
    p_static, p_total : where it is linearised, Pa.
    tat : total temperature there, K.
    held : the temperature that stays as it is while the pressures err. An air-data computer measures the total one;
        T 2-3 holds the static one, through its constant A_o. It matters for `tas` (and `sat`) only.

    Raises
    ------
    ValueError : pressures that are not those of subsonic flow, or of an aircraft at rest, where an airspeed has no
        derivative.
    """
    p_static, p_total = np.asarray(p_static, dtype=np.float64), np.asarray(p_total, dtype=np.float64)
    q_impact = p_total - p_static
    mach = mach_number(q_impact, p_static)
    if np.any(mach == 0.0):
        raise ValueError("q_impact: an airspeed has no derivative at rest, got 0 Pa")
    zero, one = np.zeros(mach.shape), np.ones(mach.shape)
    ratio = p_total / p_static
    by_ratio = ratio ** (1.0 / POWER - 1.0) / (2.0 * HALF * POWER * mach)  # of the Mach number
    mach_by = (-by_ratio * ratio / p_static, by_ratio / p_static)
    sat = static_temperature(tat, mach)
    warming = 1.0 + HALF * mach**2
    columns: tuple[FloatArray, FloatArray]
    if channel == "p_static":
        columns = (one, zero)
    elif channel == "p_total":
        columns = (zero, one)
    elif channel == "q_impact":
        columns = (-one, one)
    elif channel == "altitude":
        columns = (-GAS_CONSTANT * isa_temperature(altitude_of(p_static)) / (G * p_static), zero)
    elif channel == "cas":
        speed = calibrated_airspeed(q_impact) / SEA_LEVEL_SPEED_OF_SOUND
        ratio = 1.0 + q_impact / SEA_LEVEL_PRESSURE
        slope = ratio ** (1.0 / POWER - 1.0) / (2.0 * HALF * POWER * speed)
        slope *= SEA_LEVEL_SPEED_OF_SOUND / SEA_LEVEL_PRESSURE
        columns = (-slope, slope)
    else:
        slope = one
        if channel == "tas":
            slope = speed_of_sound(sat) / (warming if held == "total" else 1.0)
        elif channel == "sat":
            slope = -2.0 * HALF * mach * sat / warming if held == "total" else zero
        columns = (slope * mach_by[0], slope * mach_by[1])
    return np.stack(np.broadcast_arrays(*columns), axis=-1)
