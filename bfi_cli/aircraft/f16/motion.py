"""The F-16's equations of motion: thirteen states, flat earth, still air. SI and radians, one column per aircraft.

Stevens and Lewis, section 3.5, in the wind-axis form of Wang, Tang, Chen (F-16 diagnosability), eq. 1, with two of its
signs mended: alpha-dot has -(p cos a + r sin a) tan b, and beta-dot -F_z sin b sin a, the sideslip direction being
orthogonal to the velocity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .airframe import Airframe
from .engine import power_rate
from .loads import Body, Conditions, accelerations, conditions_at, moments, thrust_force
from .states import AOA, GROUND, PITCH, POWER, RATES, ROLL, SIDESLIP, TAS, THROTTLE, YAW

__all__ = ["derivatives", "drift", "rate_derivatives"]

FloatArray = NDArray[np.float64]


def derivatives(
    x: FloatArray, u: FloatArray, body: Body, *, at: Conditions | None = None, variation: FloatArray | None = None
) -> FloatArray:
    """Return dx/dt, (13, n).

    Parameters
    ----------
    x : (13, n) in the order of `STATES`; power in percent.
    u : (6, n) in the order of `CONTROLS`; the nozzle turns the thrust to the right and down.
    at : the conditions of the states, None to find them.
    variation : (3, n) relative changes of Cl, Cm, Cn, None for none.
    """
    at = at or conditions_at(x, body)
    C = at.coefficients(x[RATES], u)
    if variation is not None:
        C[3:] *= 1.0 + variation
    F_T = thrust_force(at, u)
    sin, cos = np.sin(x[AOA : YAW + 1]), np.cos(x[AOA : YAW + 1])
    p, q, r = x[RATES]
    turning = q * sin[2] + r * cos[2]
    change = np.empty_like(x)
    change[: SIDESLIP + 1] = drift(x, accelerations(at, C, F_T))
    change[AOA] += q - (p * cos[0] + r * sin[0]) * sin[1] / cos[1]
    change[SIDESLIP] += p * sin[0] - r * cos[0]
    change[ROLL] = p + sin[3] / cos[3] * turning
    change[PITCH] = q * cos[2] - r * sin[2]
    change[YAW] = turning / cos[3]
    change[RATES] = rate_derivatives(x[RATES], moments(at, C, F_T), body.airframe)
    change[GROUND] = _ground_velocity(x[TAS], sin, cos)
    change[POWER] = power_rate(x[POWER], u[THROTTLE])
    return change


def drift(x: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return what tas, aoa and sideslip change by, (3, n) per second, where the aircraft does not rotate."""
    ax, ay, az = acceleration
    (sin_a, sin_b), (cos_a, cos_b) = np.sin(x[AOA : SIDESLIP + 1]), np.cos(x[AOA : SIDESLIP + 1])
    forward = ax * cos_a + az * sin_a
    return np.array(
        [
            forward * cos_b + ay * sin_b,
            (az * cos_a - ax * sin_a) / (x[TAS] * cos_b),
            (ay * cos_b - forward * sin_b) / x[TAS],
        ]
    )


def rate_derivatives(rates: FloatArray, M: FloatArray, airframe: Airframe) -> FloatArray:
    """Return d(p, q, r)/dt, (3, n), from rates, (3, n) rad/s, and moments, (3, n) N m."""
    c1, c2, c3, c4, c5, c6, c7, c8, c9 = airframe.inertia
    (p, q, r), (roll, pitch, yaw), h = rates, M, airframe.engine_momentum
    return np.array(
        [
            (c2 * p + c1 * r + c4 * h) * q + c3 * roll + c4 * yaw,
            (c5 * p - c7 * h) * r + c6 * (r * r - p * p) + c7 * pitch,
            (c8 * p - c2 * r + c9 * h) * q + c4 * roll + c9 * yaw,
        ]
    )


def _ground_velocity(tas: FloatArray, sin: FloatArray, cos: FloatArray) -> FloatArray:
    """Return north, east and up, (3, n); sines and cosines of aoa, sideslip, roll, pitch, yaw."""
    u, v, w = tas * cos[0] * cos[1], tas * sin[1], tas * sin[0] * cos[1]
    down = v * sin[2] + w * cos[2]
    ahead, right = u * cos[3] + down * sin[3], v * cos[2] - w * sin[2]
    return np.array([ahead * cos[4] - right * sin[4], ahead * sin[4] + right * cos[4], u * sin[3] - down * cos[3]])
