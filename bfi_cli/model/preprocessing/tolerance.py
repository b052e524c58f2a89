"""The largest error of a channel that may stay unseen: the tolerance by which a fault is excluded or not."""

from __future__ import annotations

import numpy as np

from ...config import Config
from ...errors import ConfigError
from ...faults import did_you_mean
from ...flightlog import FlightLog
from ...flightlog.record import FloatArray
from ...flightlog.signs import cruise_of
from ...quantities.channels import quantity_of

# Exact by definition.
KNOT, FOOT, DEGREE = 1852.0 / 3600.0, 0.3048, np.pi / 180.0
AIRSPEEDS = ("tas", "cas", "ias", "lift_speed", "ground_airspeed")
# CS/FAR 25.1323(b): the error of an airspeed may be 3 % or 5 kt, whichever is greater; of a slow aircraft that would
# be most of its speed, so no more than a tenth.
AIRSPEED_SHARE, AIRSPEED_LEAST, AIRSPEED_MOST = 0.03, 5.0 * KNOT, 0.1
# CS/FAR 25.1325(e): the error of an altitude may be 30 ft per 100 kt, and at least 30 ft.
ALTITUDE_PER_SPEED, ALTITUDE_LEAST = 30.0 * FOOT / (100.0 * KNOT), 30.0 * FOOT
# No regulation names these; they are what a flight-test engineer would repeat a test point for.
FIXED = {
    "mach": 0.01,
    "altitude_rate": 1.5,
    **dict.fromkeys(("aoa", "sideslip", "pitch", "roll", "yaw", "flight_path_angle", "climb_angle"), DEGREE),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), DEGREE),
    **dict.fromkeys(("longitudinal_acc", "lateral_acc", "normal_acc", "kinematic_acc"), 0.3),
}
OTHER_SHARE = 0.1  # of the range of a channel that neither names


def is_any(error: float, window: FlightLog, channel: str) -> bool:
    """Return whether an error is as large as any could be: of a speed, larger than all that it reads in the window."""
    known = window.channel(channel)
    if quantity_of(known.name) not in (*AIRSPEEDS, "ground_speed", "mach"):
        return not np.isfinite(error)
    return not error <= float(np.max(np.abs(known.values[np.isfinite(known.values)]), initial=0.0))


def tolerances_of(log: FlightLog, window: FlightLog, channels: tuple[str, ...], config: Config) -> dict[str, float]:
    """Return the tolerance of each channel, the one that the configuration states or that of `tolerance_of`.

    Raises
    ------
    ConfigError : a tolerance is stated for a channel that is no output.
    """
    stated = config.tolerances
    for name in stated:
        if name not in channels:
            place = config.place(f"tolerances.{name}")
            raise ConfigError(f"{place}: '{name}' is no output of this analysis{did_you_mean(name, channels)}")
    return {name: stated.get(name) or tolerance_of(log, window, name) for name in channels}


def tolerance_of(log: FlightLog, window: FlightLog, channel: str) -> float:
    """Return the default tolerance of a channel, in its unit.

    Parameters
    ----------
    log : the flight, of which the part outside the window says how far a channel without a rule travels.
    window : the part analysed, whose airspeed counts.
    """
    name = window.channel(channel).name
    quantity = quantity_of(name)
    if quantity in FIXED:
        return FIXED[quantity]
    if quantity in AIRSPEEDS:
        speed = _cruising_speed(window, name)
        # An airspeed that is lost from the first sample on has no share of a speed.
        return min(max(AIRSPEED_SHARE * speed, AIRSPEED_LEAST), AIRSPEED_MOST * speed) or AIRSPEED_LEAST
    if quantity in ("altitude", "baro_altitude"):
        known = [name for name in AIRSPEEDS if name in window.channels]
        speed = _cruising_speed(window, known[0]) if known else 0.0
        return max(ALTITUDE_PER_SPEED * speed, ALTITUDE_LEAST)
    outside = (log.time_s < window.time_s[0]) | (log.time_s > window.time_s[-1])
    # Travels of the window alone where it is the whole log, the channel is derived within it, or rests elsewhere.
    elsewhere = [log.channel(name).values[outside]] if name in log.channels else []
    travels = (_travel(values) for values in (*elsewhere, window.channel(name).values))
    return OTHER_SHARE * next((travel for travel in travels if travel > 0.0), 0.0)


def _travel(values: FloatArray) -> float:
    """Return the distance between the least and the greatest value; 0 of none."""
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _cruising_speed(window: FlightLog, channel: str) -> float:
    """Return the median of an airspeed where it is not lost, nor the aircraft on the ground; 0 where there is none."""
    return cruise_of(np.abs(window.channel(channel).values))
