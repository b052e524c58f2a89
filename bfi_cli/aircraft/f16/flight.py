"""The F-16 flown by hand from level flight at 125 m/s and 3000 m: surfaces and throttle move as told."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...errors import ConfigError
from ..model import Flown, NonlinearModel
from .airframe import ALTITUDE, AOA, CONTROLS, RATES, SIDESLIP, STATES, SURFACE_LIMITS, YAW
from .loads import AOA_RANGE, Body, accelerations, conditions_at, thrust_force
from .motion import SteadyFlight, Trim, derivatives, trim

__all__ = ["F16", "fly"]

FloatArray = NDArray[np.float64]

INPUTS = CONTROLS[:4]
ACCELERATIONS = ("longitudinal_acc", "lateral_acc", "normal_acc")
LEAST, MOST = (np.array([*(sign * limit for limit in SURFACE_LIMITS), end]) for sign, end in ((-1.0, 0.0), (1.0, 1.0)))
LONGEST_STEP = 0.02  # seconds of one Runge-Kutta step, as in the F-16 diagnosability reproduction
SIDESLIP_RANGE = (-30.0, 30.0)  # degrees, the ends of the tables

# At the tables' own centre of gravity, 0.35, the aircraft is so close to neutral that steps of two degrees of elevator
# loop it; at the book's other one it is stable, as an aircraft flown without augmentation must be.
STABLE = Body(cg=0.30)


@cache
def _cruise() -> Trim:
    return trim(SteadyFlight(), STABLE)


def fly(deviations: FloatArray, rate_hz: float) -> Flown:
    """Return the flight from level trim with input deviations, (n, 4), held between samples; Runge-Kutta of order 4.

    Raises
    ------
    ConfigError : angle of attack or sideslip leave the tables.
    """
    wanted = _cruise().controls[:4] + deviations
    inputs = np.clip(wanted, LEAST, MOST)
    u = np.zeros((len(CONTROLS), len(inputs)))
    u[:4] = inputs.T
    states = np.empty((len(STATES), len(inputs)))
    steps = max(1, int(np.ceil(1.0 / (rate_hz * LONGEST_STEP))))
    h = 1.0 / (rate_hz * steps)
    x = _cruise().state[:, None].copy()
    for k in range(len(inputs)):
        states[:, k] = x[:, 0]
        for name, row, (low, high) in (("aoa", AOA, AOA_RANGE), ("sideslip", SIDESLIP, SIDESLIP_RANGE)):
            angle = float(np.degrees(x[row, 0]))
            if not low <= angle <= high:
                raise ConfigError(
                    f"f16: {name} leaves the tables, {low:g} to {high:g} degrees, at {k / rate_hz:.3g} s, got "
                    f"{angle:.3g} degrees; give a smaller --amplitude or a shorter --step"
                )
        now = u[:, [k]]
        for _ in range(steps if k < len(inputs) - 1 else 0):
            first = derivatives(x, now, STABLE)
            second = derivatives(x + 0.5 * h * first, now, STABLE)
            third = derivatives(x + 0.5 * h * second, now, STABLE)
            x = x + h / 6.0 * (first + 2.0 * (second + third) + derivatives(x + h * third, now, STABLE))
    at = conditions_at(states, STABLE)
    felt = accelerations(at, at.coefficients(states[RATES], u), thrust_force(at, u)) - at.weight
    stops = [name for name, beyond in zip(INPUTS, (wanted != inputs).any(axis=0), strict=True) if beyond]
    return Flown(
        inputs=inputs,
        outputs=np.vstack([states[: RATES.stop], states[ALTITUDE], felt]).T,
        notes=tuple(f"{name} is held at its stop" for name in stops),
    )


F16 = NonlinearModel(
    name="f16",
    title="F-16, six degrees of freedom, from level flight at 125 m/s and 3000 m",
    inputs=INPUTS,
    outputs=(*STATES[: RATES.stop], "altitude", *ACCELERATIONS),
    units={
        **dict.fromkeys(("elevator", "aileron", "rudder", *STATES[AOA : YAW + 1]), "rad"),
        **dict.fromkeys(STATES[RATES], "rad/s"),
        **dict.fromkeys(ACCELERATIONS, "m/s^2"),
        "throttle": "1",
        "tas": "m/s",
        "altitude": "m",
    },
    fly=fly,
    source="Stevens and Lewis, Aircraft Control and Simulation, after NASA TP-1538; centre of gravity at 0.30 chord",
    manoeuvred=("elevator",),
)
