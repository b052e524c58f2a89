"""The scale of the true airspeed by turns over the ground: a wrong one needs a wind that turns with the aircraft.

In a turn the ground velocity less a steady wind has the airspeed's size in every direction, so that both follow from
half a circle alone, whatever the heading reads. Half circles differ by what the wind changes between them; their spread
is the error of the mean.
"""

from __future__ import annotations

import math

import numpy as np

from ...decision.implausible import Implausible
from ...flightlog import FlightLog
from ...flightlog.phases import airborne
from ...kernels import FloatArray
from ...kernels.compiled import special
from ...model.preprocessing.defaults import tolerance_of

NEEDS = ("tas", "velocity_north", "velocity_east")
# Hz at which velocities are compared; gusts are slower.
RATE_HZ = 2.0
# s: a turn that takes longer, twice that at the standard rate of 3 degrees a second, meets another wind; one that takes
# less has too few gusts for their mean.
SLOWEST_S, FASTEST_S = 120.0, 15.0
# rad over the ground: half a circle tells the scale from the wind. Of 40 windows of 120 to 170 s of a circling glider
# all had three half circles and most not three full ones; all intervals held the scale of the whole flight.
TURN = math.pi
# Turns below which their spread says little, and that are looked at of a long flight.
FEWEST, MOST = 3, 60


def scale_by_circles(log: FlightLog) -> Implausible | None:
    """Return the finding of a true airspeed of a wrong scale; None where turns show none beyond the tolerance."""
    if not log.channels.keys() >= {*NEEDS}:
        return None
    scales = circle_scales(log)
    if scales.size < FEWEST:
        return None
    mean = float(scales.mean())
    half = float(special.stdtrit(scales.size - 1, 0.975) * scales.std(ddof=1) / math.sqrt(scales.size))
    flown = log.time_s[airborne(log, log.time_s)]
    part = log.window(float(flown[0]), float(flown[-1]))
    speed = float(np.nanmedian(part.channels["tas"].values))
    if abs(mean - 1.0) <= half or abs(mean - 1.0) * speed <= tolerance_of(log, part, "tas"):
        return None
    low, high = 1.0 / (mean + half), 1.0 / max(mean - half, 1e-3)
    return Implausible(
        channels=("tas",),
        what="scale",
        unit="",
        factor=mean,
        offset=0.0,
        agrees_with=NEEDS[1:],
        relative_misfit=half / mean,
        rivals=(),
        text=f"tas is {1.0 / mean:.3g} times ({low:.3g} to {high:.3g}) what the ground velocity in {scales.size} "
        "half circles implies: the wind would have to turn with the aircraft",
        advice="check tas",
        factor_ci95=(mean - half, mean + half),
    )


def circle_scales(log: FlightLog) -> FloatArray:
    """Return (n_circles,) by what the true airspeed must be multiplied in each circle of a flight."""
    every = max(1, round(log.rate_hz / RATE_HZ))
    flown = np.flatnonzero(airborne(log, log.time_s))[::every]
    speed, north, east = (log.channels[name].values[flown] for name in NEEDS)
    known = np.isfinite(speed + north + east)
    time_s, speed, north, east = log.time_s[flown][known], speed[known], north[known], east[known]
    pieces = _circles(time_s, np.unwrap(np.arctan2(east, north)))
    chosen = pieces[:: max(1, -(-len(pieces) // MOST))]
    return np.array([_scale(speed[circle], north[circle], east[circle]) for circle in chosen])


def _circles(time_s: FloatArray, course: FloatArray) -> list[slice]:
    """Return the stretches, one after the other, in which the course (n,) over the ground turns by half a circle."""
    pieces, first = [], 0
    for k in range(len(time_s)):
        while time_s[k] - time_s[first] > SLOWEST_S:
            first += 1
        turned = abs(course[k] - course[first]) >= TURN
        if turned and time_s[k] - time_s[first] >= FASTEST_S:
            pieces.append(slice(first, k + 1))
            first = k + 1 if k + 1 < len(time_s) else k
    return pieces


def _scale(speed: FloatArray, north: FloatArray, east: FloatArray) -> float:
    """Return the scale s of least squares of |ground velocity - wind| - s speed, with the wind free."""
    from scipy.optimize import least_squares  # takes as long to import as a short log to read

    def misfit(p: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(north - p[1], east - p[2]) - p[0] * speed)

    # Exact without noise: |v|^2 = s^2 speed^2 + 2 v w - |w|^2 is linear.
    A = np.column_stack([speed**2, 2.0 * north, 2.0 * east, np.ones(len(speed))])
    unit = np.linalg.norm(A, axis=0)
    unit[unit == 0.0] = 1.0
    start = np.linalg.lstsq(A / unit, north**2 + east**2, rcond=None)[0] / unit
    steady = np.median(speed) * 0.01 > speed.std()
    begin = [1.0 if steady else math.sqrt(max(start[0], 0.01)), start[1], start[2]]
    return float(least_squares(misfit, begin).x[0])
