"""Steady flight of the F-16: straight and level, climbing, turning, pulling up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import ConfigError
from .aerodynamics import AOA_RANGE
from .airframe import SURFACE_LIMITS
from .engine import commanded_power
from .loads import Body
from .motion import derivatives
from .states import ALTITUDE, AOA, CONTROLS, ELEVATOR, PITCH, POWER, RATES, ROLL, SIDESLIP, STATES, TAS, THROTTLE

__all__ = ["SteadyFlight", "Trim", "trim"]

FloatArray = NDArray[np.float64]

UNKNOWN_STATES = (AOA, SIDESLIP, ROLL, PITCH)
UNKNOWN_CONTROLS = slice(ELEVATOR, THROTTLE + 1)
START = np.array([0.1, 0.0, 0.0, 0.1, -0.02, 0.0, 0.0, 0.3])
TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyFlight:
    """What is asked for: airspeed, altitude, climb angle; rates of a level turn and of a pull-up, rad/s."""

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

    start = START.copy()
    start[2] = np.arctan(flight.turn_rate * flight.tas_m_s / body.airframe.gravity_m_s2)
    found = root(_unsteadiness, start, args=(flight, body), method="hybr", options={"xtol": 1e-12})
    low, high = AOA_RANGE
    flyable = low <= np.degrees(found.x[0]) <= high and bool(np.all(np.abs(found.x[4:7]) <= SURFACE_LIMITS))
    if not flyable or np.max(np.abs(_unsteadiness(found.x, flight, body))) > TOLERANCE:
        raise ConfigError(
            f"f16: no steady flight at {flight.tas_m_s:g} m/s and {flight.altitude_m:g} m; change the airspeed"
        )
    x, u = _assembled(found.x, flight)
    return Trim(state=x[:, 0], controls=u[:, 0])


def _unsteadiness(unknown: FloatArray, flight: SteadyFlight, body: Body) -> FloatArray:
    """Return what must vanish, (8,): six derivatives, climb rate and lateral specific force as parts of V and of g."""
    x, u = _assembled(unknown, flight)
    change = derivatives(x, u, body)[:, 0]
    g = body.airframe.gravity_m_s2
    roll, pitch = unknown[2], unknown[3]
    p, _, r = x[RATES, 0]
    velocity = flight.tas_m_s * np.cos(unknown[1]) * np.array([np.cos(unknown[0]), np.sin(unknown[0])])
    side_force = (r * velocity[0] - p * velocity[1]) / g - np.cos(pitch) * np.sin(roll)
    climb = change[ALTITUDE] / flight.tas_m_s - np.sin(flight.climb_rad)
    steady = np.array([change[TAS] / g, change[AOA], change[SIDESLIP]])
    return np.concatenate([steady, change[RATES], [climb, side_force]])


def _assembled(unknown: FloatArray, flight: SteadyFlight) -> tuple[FloatArray, FloatArray]:
    x, u = np.zeros((len(STATES), 1)), np.zeros((len(CONTROLS), 1))
    x[TAS], x[ALTITUDE] = flight.tas_m_s, flight.altitude_m
    x[UNKNOWN_STATES, 0], u[UNKNOWN_CONTROLS, 0] = unknown[:4], unknown[4:]
    roll, pitch = unknown[2], unknown[3]
    level = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    x[RATES, 0] = flight.turn_rate * level
    x[RATES.start + 1] += flight.pull_up_rate
    x[POWER] = commanded_power(u[THROTTLE])
    return x, u
