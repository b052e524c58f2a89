"""The rows of a state and of a control vector of the F-16: names and numbers. SI and radians; power in percent."""

from __future__ import annotations

__all__ = [
    "ALTITUDE",
    "AOA",
    "CONTROLS",
    "ELEVATOR",
    "GROUND",
    "NOZZLE",
    "PITCH",
    "POWER",
    "RATES",
    "ROLL",
    "SIDESLIP",
    "STATES",
    "SURFACES",
    "TAS",
    "THROTTLE",
    "YAW",
]

STATES = (
    *("tas", "aoa", "sideslip", "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate"),
    *("north", "east", "altitude", "power"),
)
TAS, AOA, SIDESLIP, ROLL, PITCH, YAW = range(6)
RATES = slice(6, 9)
GROUND = slice(9, 12)
ALTITUDE, POWER = 11, 12

CONTROLS = ("elevator", "aileron", "rudder", "throttle", "nozzle_yaw", "nozzle_pitch")
ELEVATOR, THROTTLE = 0, 3
SURFACES = slice(0, 3)
NOZZLE = slice(4, 6)
