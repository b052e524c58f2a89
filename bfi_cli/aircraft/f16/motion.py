"""The F-16's equations of motion, its steady flights, and its flight by hand. Flat earth, still air, SI and radians.

Stevens and Lewis, section 3.5, in the wind-axis form of Wang, Tang, Chen (F-16 diagnosability), eq. 1, with two of its
signs mended: alpha-dot has -(p cos a + r sin a) tan b, and beta-dot -F_z sin b sin a, the sideslip direction being
orthogonal to the velocity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from ...errors import ConfigError
from ...kernels import FloatArray
from ...kernels.progress import Report, silent
from ...notes import Note
from ..model import Flown, NonlinearModel
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
from .loads import AOA_RANGE, Body, Conditions, commanded_power, conditions_at, power_rate

UNKNOWN_STATES = (AOA, SIDESLIP, ROLL, PITCH)
UNKNOWN_CONTROLS = slice(ELEVATOR, THROTTLE + 1)
START = np.array([0.1, 0.0, 0.0, 0.1, -0.02, 0.0, 0.0, 0.3])  # rad and throttle, near level flight at 125 m/s
TOLERANCE = 1e-9  # of every part of what must vanish in a steady flight

INPUTS = CONTROLS[:4]
ACCELERATIONS = ("longitudinal_acc", "lateral_acc", "normal_acc")
# Stops of elevator, aileron, rudder and throttle.
LEAST, MOST = (np.array([*(sign * limit for limit in SURFACE_LIMITS), end]) for sign, end in ((-1.0, 0.0), (1.0, 1.0)))
LONGEST_STEP = 0.02  # seconds of one Runge-Kutta step, as in the F-16 diagnosability reproduction
BEFORE_THE_END = 1.0 - 1e-6  # of a Runge-Kutta step, where its last stage lies
SIDESLIP_RANGE = (-30.0, 30.0)  # degrees, the ends of the tables

# At the tables' own centre of gravity, 0.35, the aircraft is so close to neutral that steps of two degrees of elevator
# loop it; at the book's other one it is stable, as an aircraft flown without augmentation must be.
STABLE = Body(cg=0.30)


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
    F_T = at.thrust_force(u)
    sin, cos = np.sin(x[AOA : YAW + 1]), np.cos(x[AOA : YAW + 1])
    p, q, r = x[RATES]
    turning = q * sin[2] + r * cos[2]
    change = np.empty_like(x)
    change[: SIDESLIP + 1] = translation(x, at.accelerations(C, F_T))
    change[AOA] += q - (p * cos[0] + r * sin[0]) * sin[1] / cos[1]
    change[SIDESLIP] += p * sin[0] - r * cos[0]
    change[ROLL] = p + sin[3] / cos[3] * turning
    change[PITCH] = q * cos[2] - r * sin[2]
    change[YAW] = turning / cos[3]
    change[RATES] = rate_derivatives(x[RATES], at.moments(C, F_T), body.airframe)
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


def runge_kutta(change: Callable[[float, FloatArray], FloatArray], t: float, x: FloatArray, h: float) -> FloatArray:
    """Return x(t + h) of dx/dt = change(t, x) by the classical method of order 4.

    The last stage lies just before t + h, so that an input which jumps there belongs to the next step.
    """
    first = change(t, x)
    second = change(t + 0.5 * h, x + 0.5 * h * first)
    third = change(t + 0.5 * h, x + 0.5 * h * second)
    fourth = change(t + BEFORE_THE_END * h, x + h * third)
    return x + h / 6.0 * (first + 2.0 * (second + third) + fourth)


def translation(x: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return d(tas, aoa, sideslip)/dt, (3, n), of an aircraft that does not rotate."""
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


CRUISE = SteadyFlight()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trim:
    """State, (13,), and controls, (6,), of a steady flight, in the orders of `STATES` and `CONTROLS`."""

    state: FloatArray
    controls: FloatArray


def trim(flight: SteadyFlight, body: Body) -> Trim:
    """Return the steady flight without side force along body y (a turn is coordinated).

    The throttle may come out above 1, as in the book's pull-up: its tables of thrust are extrapolated.

    Raises
    ------
    ConfigError : no such flight within the tables and the surfaces' limits.
    """
    from scipy.optimize import root

    g = body.airframe.gravity_m_s2

    def state_and_controls(unknown: FloatArray) -> tuple[FloatArray, FloatArray]:
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

    def unsteadiness(unknown: FloatArray) -> FloatArray:
        """Return what must vanish, (8,): six derivatives, climb rate, lateral specific force; as parts of V and g."""
        x, u = state_and_controls(unknown)
        change = derivatives(x, u, body)[:, 0]
        p, _, r = x[RATES, 0]
        velocity = flight.tas_m_s * np.cos(unknown[1]) * np.array([np.cos(unknown[0]), np.sin(unknown[0])])
        side_force = (r * velocity[0] - p * velocity[1]) / g - np.cos(unknown[3]) * np.sin(unknown[2])
        climb = change[ALTITUDE] / flight.tas_m_s - np.sin(flight.climb_rad)
        steady = np.array([change[TAS] / g, change[AOA], change[SIDESLIP]])
        return np.concatenate([steady, change[RATES], [climb, side_force]])

    start = START.copy()
    start[2] = np.arctan(flight.turn_rate * flight.tas_m_s / g)
    solved = root(unsteadiness, start, method="hybr", options={"xtol": 1e-12}).x
    low, high = AOA_RANGE
    flyable = low <= np.degrees(solved[0]) <= high and bool(np.all(np.abs(solved[4:7]) <= SURFACE_LIMITS))
    if not flyable or np.max(np.abs(unsteadiness(solved))) > TOLERANCE:
        raise ConfigError(
            f"f16: no steady flight at {flight.tas_m_s:g} m/s and {flight.altitude_m:g} m; change the airspeed"
        )
    x, u = state_and_controls(solved)
    return Trim(state=x[:, 0], controls=u[:, 0])


@cache
def _cruise(start: SteadyFlight) -> Trim:
    return trim(start, STABLE)


def fly(
    deviations: FloatArray,
    rate_hz: float,
    gusts: FloatArray | None = None,
    report: Report = silent,
    *,
    start: SteadyFlight = CRUISE,
) -> Flown:
    """Return the flight from level trim with input deviations, (n, 4), held between samples; Runge-Kutta of order 4.

    Raises
    ------
    ConfigError : no such trim; angle of attack or sideslip leave the tables.
    """
    assert gusts is None, "the model has no airspeed_m_s, so that nobody asks for gusts"
    trimmed = _cruise(start)
    wanted = trimmed.controls[:4] + deviations
    inputs = np.clip(wanted, LEAST, MOST)
    u = np.zeros((len(CONTROLS), len(inputs)))
    u[:4] = inputs.T
    states = np.empty((len(STATES), len(inputs)))
    steps = max(1, int(np.ceil(1.0 / (rate_hz * LONGEST_STEP))))
    h = 1.0 / (rate_hz * steps)
    x = trimmed.state[:, None].copy()

    def change(held: FloatArray, _t: float, x: FloatArray) -> FloatArray:
        return derivatives(x, held, STABLE)

    for k in range(len(inputs)):
        report(k / len(inputs))
        states[:, k] = x[:, 0]
        for name, row, (low, high) in (("aoa", AOA, AOA_RANGE), ("sideslip", SIDESLIP, SIDESLIP_RANGE)):
            angle = float(np.degrees(x[row, 0]))
            if not low <= angle <= high:
                raise ConfigError(
                    f"f16: {name} leaves the tables, {low:g} to {high:g} degrees, at {k / rate_hz:.3g} s, got "
                    f"{angle:.3g} degrees; give a smaller --amplitude or a shorter --step"
                )
        for _ in range(steps if k < len(inputs) - 1 else 0):
            x = runge_kutta(partial(change, u[:, [k]]), 0.0, x, h)
    at = conditions_at(states, STABLE)
    along, lateral, down = at.accelerations(at.coefficients(states[RATES], u), at.thrust_force(u)) - at.weight
    upward = -down - STABLE.airframe.gravity_m_s2
    stops = [name for name, beyond in zip(INPUTS, (wanted != inputs).any(axis=0), strict=True) if beyond]
    return Flown(
        inputs=inputs,
        outputs=np.vstack([states[: RATES.stop], states[ALTITUDE], along, lateral, upward]).T,
        notes=tuple(Note.limit(f"{name} is held at its stop") for name in stops),
    )


F16 = NonlinearModel(
    name="f16",
    title="F-16, six degrees of freedom, from level flight at 125 m/s and 3000 m",
    inputs=INPUTS,
    outputs=(*STATES[: RATES.stop], "altitude", *ACCELERATIONS),
    fly=fly,
    source="Stevens and Lewis, Aircraft Control and Simulation, after NASA TP-1538; centre of gravity at 0.30 chord",
    travel={"elevator": SURFACE_LIMITS[0], "throttle": 1.0},
)
