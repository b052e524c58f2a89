"""When a log shows the aircraft in the air, from an airspeed alone: on the ground nothing else is as its model says."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .record import LARGEST_VALUE, FlightLog

__all__ = ["BORNE", "GRAVITY", "WALK", "FlightSpeed", "airborne_stretches", "flight_speed"]

# Airspeeds, the ones that bear the aircraft first: true airspeed and Mach number grow with altitude at the same lift.
AIRSPEEDS = ("cas", "ias", "tas", "mach", "ground_speed")
METRES_PER_SECOND = {"mach": 340.0}
GRAVITY = 9.8  # m/s^2
# A gust, or noise of a pitot tube at rest, is no flight: the median over this time counts.
SMOOTHING_S = 5.0
# What is slower than a quarter of the fastest sample is no flight either: an aircraft at a quarter of a speed has a
# sixteenth of its lift. The fastest is a quantile, since a single sample may be wrong.
FASTEST, MOVING = 0.99, 0.25
# Of the median speed of what is left, down to which an aircraft is borne: lift-off and touch-down lie at half to two
# thirds of the cruising speed, of a jet (55 of 95 m/s) as of a drone (6 of 10 m/s), slow flight at two thirds.
BORNE = 0.6
# Left out beside the ground, in units of the time V / g in which an aircraft can gain or lose the better part of its
# speed: 20 s of a jet at 100 m/s, 2 s of a drone at 10 m/s. Rotation, gear, flaps and the flare lie there.
MARGIN = 2.0
# Below a walk nothing flies, whatever the quantiles of a log on the ground say, m/s.
WALK = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightSpeed:
    """The airspeed that says whether an aircraft flies.

    Attributes
    ----------
    values : (n_samples,) the median over five seconds, m/s, interpolated where the channel is not a number.
    known : (n_samples,) where the channel is a number.
    cruise : the median of what is not slow, m/s; at walking speed or below it the log is one of the ground.
    """

    values: NDArray[np.float64]
    known: NDArray[np.bool_]
    cruise: float


def flight_speed(log: FlightLog, *, suspects: Collection[str] = ()) -> FlightSpeed | None:
    """Return the airspeed that says whether the aircraft flies; None where the log has none.

    Parameters
    ----------
    suspects : channels that may be faulty; another airspeed is taken where the log has one.
    """
    names = [name for name in AIRSPEEDS if name in log.channels]
    if not names or log.n_samples < 2:
        return None
    name = next((one for one in names if one not in suspects), names[0])
    values = log.channels[name].values
    known = np.abs(values) <= LARGEST_VALUE
    if not known.any():
        return None
    speed = np.abs(
        _running_median(
            np.interp(log.time_s, log.time_s[known], values[known]) * METRES_PER_SECOND.get(name, 1.0),
            round(SMOOTHING_S * log.rate_hz),
        )
    )
    # The copies that the brackets make are sorted in place: of a day at 100 Hz each takes 70 MB.
    fastest = float(np.quantile(speed[known], FASTEST, overwrite_input=True))
    cruise = float(np.median(speed[known & (speed >= MOVING * fastest)], overwrite_input=True))
    return FlightSpeed(values=speed, known=known, cruise=cruise)


def airborne_stretches(log: FlightLog, *, suspects: Collection[str] = ()) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches in which the aircraft flies; empty where the log has no airspeed.

    A stretch ends before a sample that is slow, or not a number. Where the log begins or ends in flight, or the nearest
    sample that is known flies, there is no margin.

    Parameters
    ----------
    suspects : channels that may be faulty; another airspeed is taken where the log has one.
    """
    speed = flight_speed(log, suspects=suspects)
    if speed is None or not speed.cruise > WALK:
        return []
    flies = speed.known & (speed.values >= BORNE * speed.cruise)
    known = np.flatnonzero(speed.known)
    margin_s, stretches = MARGIN * speed.cruise / GRAVITY, []
    edges = np.flatnonzero(np.diff(flies.astype(np.int8), prepend=0, append=0))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        at, then = np.searchsorted(known, [first, end])
        takes_off, lands = at > 0 and not flies[known[at - 1]], then < known.size and not flies[known[then]]
        from_s = float(log.time_s[first]) + (margin_s if takes_off else 0.0)
        to_s = float(log.time_s[end - 1]) + (-margin_s if lands else 1.0 / log.rate_hz)
        if from_s < to_s:
            stretches.append((from_s, to_s))
    return stretches


def _running_median(values: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    from scipy.ndimage import median_filter

    # A long window is thinned: the median of 25 samples of five seconds says the same at any rate.
    step = max(1, n // 25)
    if step == 1:
        return np.asarray(median_filter(values, max(1, n), mode="nearest"), dtype=np.float64)
    coarse = median_filter(values[::step], 25, mode="nearest")
    return np.asarray(np.repeat(coarse, step)[: len(values)], dtype=np.float64)
