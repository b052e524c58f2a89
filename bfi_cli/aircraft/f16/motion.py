"""The F-16's equations of motion and its steady flights: thirteen states, flat earth, still air. SI and radians.

Stevens and Lewis, section 3.5, in the wind-axis form of Wang, Tang, Chen (F-16 diagnosability), eq. 1, with two of its
signs mended: alpha-dot has -(p cos a + r sin a) tan b, and beta-dot -F_z sin b sin a, the sideslip direction being
orthogonal to the velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import ConfigError
from .airframe import (
    ALTITUDE,
    AOA,
    CONTROLS,
    ELEVATOR,
    GROUND,
    PITCH,
    POWER,
    RATES,
    ROLL,
    SIDESLIP,
    STATES,
    SURFACE_LIMITS,
    TAS,
    THROTTLE,
    YAW,
    Airframe,
)
from .loads import (
    AOA_RANGE,
    Body,
    Conditions,
    accelerations,
    commanded_power,
    conditions_at,
    moments,
    power_rate,
    thrust_force,
)

__all__ = ["SteadyFlight", "Trim", "derivatives", "rate_derivatives", "translation", "trim"]

FloatArray = NDArray[np.float64]

UNKNOWN_STATES = (AOA, SIDESLIP, ROLL, PITCH)
UNKNOWN_CONTROLS = slice(ELEVATOR, THROTTLE + 1)
START = np.array([0.1, 0.0, 0.0, 0.1, -0.02, 0.0, 0.0, 0.3])  # rad and throttle, near level flight at 125 m/s
TOLERANCE = 1e-9  # of every part of what must vanish in a steady flight


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
    change[: SIDESLIP + 1] = translation(x, accelerations(at, C, F_T))
    change[AOA] += q - (p * cos[0] + r * sin[0]) * sin[1] / cos[1]
    change[SIDESLIP] += p * sin[0] - r * cos[0]
    change[ROLL] = p + sin[3] / cos[3] * turning
    change[PITCH] = q * cos[2] - r * sin[2]
    change[YAW] = turning / cos[3]
    change[RATES] = rate_derivatives(x[RATES], moments(at, C, F_T), body.airframe)
    # Velocity over the ground: body axes turned by roll, pitch and yaw; the last row counts upwards.
    tas = x[TAS]
    forward, v, w = tas * cos[0] * cos[1], tas * sin[1], tas * sin[0] * cos[1]
    down = v * sin[2] + w * cos[2]
    ahead, right = forward * cos[3] + down * sin[3], v * cos[2] - w * sin[2]
    change[GROUND] = (
        ahead * cos[4] - right * sin[4],
        ahead * sin[4] + right * cos[4],
        forward * sin[3] - down * cos[3],
    )
    change[POWER] = power_rate(x[POWER], u[THROTTLE])
    return change


def translation(x: FloatArray, acceleration: FloatArray) -> FloatArray:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyFlight:
    """The flight to trim: airspeed, altitude, climb angle; rates of a level turn and of a pull-up, rad/s."""

    tas_m_s: float = 125.0
    altitude_m: float = 3000.0
    climb_rad: float = 0.0
    turn_rate: float = 0.0
    pull_up_rate: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trim:
    """State, (13,), and controls, (6,), in which the aircraft stays; in the orders of `STATES` and `CONTROLS`."""

    state: FloatArray
    controls: FloatArray


def trim(flight: SteadyFlight, body: Body) -> Trim:
    """Return the steady flight without side force along body y (a turn is coordinated).

    The throttle may come out above 1, as in the book's pull-up: its tables of thrust are extrapolated.

    Raises
    ------
    ConfigError : none was found within the tables and the surfaces' limits.
    """
    from scipy.optimize import root

    g = body.airframe.gravity_m_s2
    start = START.copy()
    start[2] = np.arctan(flight.turn_rate * flight.tas_m_s / g)
    found = root(_unsteadiness, start, args=(flight, body), method="hybr", options={"xtol": 1e-12})
    low, high = AOA_RANGE
    flyable = low <= np.degrees(found.x[0]) <= high and bool(np.all(np.abs(found.x[4:7]) <= SURFACE_LIMITS))
    if not flyable or np.max(np.abs(_unsteadiness(found.x, flight, body))) > TOLERANCE:
        raise ConfigError(
            f"f16: no steady flight at {flight.tas_m_s:g} m/s and {flight.altitude_m:g} m; change the airspeed"
        )
    x, u = _state_and_controls(found.x, flight)
    return Trim(state=x[:, 0], controls=u[:, 0])


def _unsteadiness(unknown: FloatArray, flight: SteadyFlight, body: Body) -> FloatArray:
    """Return what must vanish, (8,): six derivatives, climb rate and lateral specific force as parts of V and of g."""
    x, u = _state_and_controls(unknown, flight)
    change = derivatives(x, u, body)[:, 0]
    g = body.airframe.gravity_m_s2
    roll, pitch = unknown[2], unknown[3]
    p, _, r = x[RATES, 0]
    velocity = flight.tas_m_s * np.cos(unknown[1]) * np.array([np.cos(unknown[0]), np.sin(unknown[0])])
    side_force = (r * velocity[0] - p * velocity[1]) / g - np.cos(pitch) * np.sin(roll)
    climb = change[ALTITUDE] / flight.tas_m_s - np.sin(flight.climb_rad)
    steady = np.array([change[TAS] / g, change[AOA], change[SIDESLIP]])
    return np.concatenate([steady, change[RATES], [climb, side_force]])


def _state_and_controls(unknown: FloatArray, flight: SteadyFlight) -> tuple[FloatArray, FloatArray]:
    """Return the state and the controls, as columns, of angles, surfaces and throttle."""
    x, u = np.zeros((len(STATES), 1)), np.zeros((len(CONTROLS), 1))
    x[TAS], x[ALTITUDE] = flight.tas_m_s, flight.altitude_m
    x[UNKNOWN_STATES, 0], u[UNKNOWN_CONTROLS, 0] = unknown[:4], unknown[4:]
    roll, pitch = unknown[2], unknown[3]
    level = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    x[RATES, 0] = flight.turn_rate * level
    x[RATES.start + 1] += flight.pull_up_rate
    x[POWER] = commanded_power(u[THROTTLE])
    return x, u
