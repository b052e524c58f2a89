"""What ordinarily happens in a flight of JSBSim: `bfi simulate jsbsim:NAME --ordinary CAUSE@S[:SIZE]`.

A cause is a row of `SIMULATED`, with what it does to the aircraft, to its pilot and to the wind. Gusts that begin are
made with the other gusts, before the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..faults.ordinary import Making
from ..quantities.channels import FOOT
from .pilot import Pilot

FRONT_S = 10.0  # in which the wind of a front changes
FLOOR_M = 150.0  # height above the runway at which the approach begins
FLAPS = "fcs/flap-cmd-norm"
Act = Callable[[Any, Pilot, float, float], float]


def _nothing(_fdm: Any, _pilot: Pilot, _since_s: float, _size: float) -> float:
    return 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated(Making):
    """An ordinary cause of a flight.

    Attributes
    ----------
    act : called in every step from its time on with the aircraft, its pilot, the seconds since then and the size; it
        returns the wind to the north that it adds, m/s.
    """

    act: Act = _nothing


def _move_flaps(fdm: Any, _pilot: Pilot, _since_s: float, size: float) -> float:
    fdm[FLAPS] = size
    return 0.0


def _hold_altitude(fdm: Any, pilot: Pilot, since_s: float, size: float) -> float:
    if since_s >= size:
        pilot.held_m = None
    elif pilot.held_m is None:
        pilot.held_m = float(fdm["position/h-sl-ft"]) * FOOT
    return 0.0


def _land(fdm: Any, pilot: Pilot, _since_s: float, size: float) -> float:
    if pilot.runway_m is None:
        pilot.runway_m = float(fdm["position/h-sl-ft"]) * FOOT - size
        fdm["position/terrain-elevation-asl-ft"] = pilot.runway_m / FOOT
        fdm["gear/gear-cmd-norm"] = 1.0
    return 0.0


def _front(_fdm: Any, _pilot: Pilot, since_s: float, size: float) -> float:
    return size * float(np.clip(since_s / FRONT_S, 0.0, 1.0))


def _shear(fdm: Any, pilot: Pilot, _since_s: float, size: float) -> float:
    height_m = float(fdm["position/h-sl-ft"]) * FOOT
    pilot.sheared_m = height_m if pilot.sheared_m is None else pilot.sheared_m
    return size * (height_m - pilot.sheared_m)


GUSTS = "gusts"
SIMULATED: Mapping[str, Simulated] = {
    "flaps": Simulated(text="flaps move to a part of their travel", size=0.25, unit="", act=_move_flaps),
    "altitude_held": Simulated(
        text="an autopilot holds the altitude, for so long", size=120.0, unit="s", act=_hold_altitude
    ),
    "on_ground": Simulated(
        text="approach and landing, from a height above the runway", size=FLOOR_M, unit="m", act=_land
    ),
    GUSTS: Simulated(text="turbulence begins, intensity", size=1.5, unit="m/s"),
    "wind": Simulated(text="the wind to the north changes in 10 s, a front", size=8.0, unit="m/s", act=_front),
    "wind_shear": Simulated(text="the wind to the north changes with height", size=0.03, unit="1/s", act=_shear),
}
