"""Whether an aircraft slows down with its airspeed, by sensors that do not breathe: a landing and no lost pressure."""

from __future__ import annotations

import numpy as np

from ..airdata import G
from ..flightlog import FlightLog
from .lines import METRES

__all__ = ["LEFT", "brakes"]

# Less than this share of the impact pressure in flight is left on the ground, and in a tube with an open drain.
LEFT = 0.15
# Shares of the loss of airspeed that the ground speed, or the accelerometer, shows up to which the aircraft does not
# brake, and from which it does.
SLOWED = (0.25, 0.5)


def brakes(log: FlightLog, from_s: float, to_s: float, level: float, p_static: float) -> bool | None:
    """Say whether ground speed or acceleration show that the aircraft slows down with its airspeed; None for neither.

    Parameters
    ----------
    level : impact pressure before, Pa; about 0.4 of the speed is left at `to_s`.
    p_static : static pressure, Pa.
    """
    has = log.channels
    if "ground_speed" in has or {"velocity_north", "velocity_east"} <= has.keys():
        if "ground_speed" in has:
            speed = has["ground_speed"].values
        else:
            speed = np.hypot(has["velocity_north"].values, has["velocity_east"].values)
        before, after = np.interp([from_s, to_s], log.time_s, speed)
        share = (before - after) / max((1.0 - np.sqrt(LEFT)) * before, 1e-9)
        return None if SLOWED[0] < share < SLOWED[1] else bool(share >= SLOWED[1])
    if {"longitudinal_acc", "pitch"} <= has.keys():
        meanwhile = (log.time_s >= from_s) & (log.time_s <= to_s)
        ahead = has["longitudinal_acc"].values[meanwhile] - G * np.sin(has["pitch"].values[meanwhile])
        if not ahead.size or not level > 0.0:
            return None
        lost = (1.0 - np.sqrt(LEFT)) * np.sqrt(2.0 * level * G * METRES / p_static)
        share = -float(np.mean(ahead)) * (to_s - from_s) / lost
        return None if SLOWED[0] < share < SLOWED[1] else bool(share >= SLOWED[1])
    return None
