"""The parts of a flight in which its air data are bounded, the windows cut from them, and the angle of zero lift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...airdata import IMPACT_SOURCES, STATIC_SOURCES, G, air_data_of, zero_lift_angle
from ...flightlog.phases import Phase, airborne_phases
from ...flightlog.phases import flight_stretches as flight_stretches
from ...kernels.runs import runs
from ...kernels.runs import within as within
from .record import Record

Window = tuple[float, float]

# Slow faults need long windows, fast ones are over in them (docs/theory.md, 15.7).
LENGTHS_S = (60.0, 120.0, 240.0)
OVERLAP = 0.5  # of two windows, so that every onset lies well inside of one; the rate of a window counts it
# Flaps and gear move after take-off, for so many V / g or seconds, and from the last descent on.
CLEAN_UP, CLEAN_UP_S = 10.0, 120.0
# DEFLECTED [rad]: deflection of flaps that changes the lift: more is no play of a sensor. Chosen by hand.
DEFLECTED = 0.02
ROUNDING = 1e-9  # of a length, of times that are computed
# Seconds of flight that tell the angle of zero lift: shorter ones hold too few angles of attack.
LEAST_S = 300.0
# Parts of the flight in a row that must tell the same, rad: a fault that lasts through one of them moves the angle, and
# the wrong one makes faults of healthy windows. Parts of 1000 s of two recorded Citations lie within 0.2 degrees.
PARTS, LEAST_PART_S, SAME_ANGLE = 3, 150.0, np.radians(1.0)


def overlaps(window: Window, stretches: Sequence[Window]) -> bool:
    """Return whether a window shares time with one of the stretches."""
    return any(window[0] < last and first < window[1] for first, last in stretches)


def windows_in(phases: Sequence[Phase], length_s: float, *, step_s: float | None = None) -> list[Window]:
    """Return overlapping windows; the last of a stretch ends where that ends.

    Parameters
    ----------
    step_s : from one to the next; None for half a length.
    """
    step_s = (1.0 - OVERLAP) * length_s if step_s is None else step_s
    windows = []
    for first, last in flight_stretches(phases):
        spare = last - first - length_s
        if spare < -ROUNDING * length_s:
            continue
        n = int(spare / step_s + ROUNDING) + 1
        starts = [first + step_s * k for k in range(n)]
        if last - length_s - starts[-1] > 0.25 * step_s:
            starts.append(last - length_s)
        windows += [(start, start + length_s) for start in starts]
    return windows


def configuration_changes(phases: Sequence[Phase], record: Record | None = None) -> list[Window]:
    """Return the stretches in which recorded flaps are out, or else may be: after take-off, and from the last descent.

    V / g is the time in which an aircraft can gain the better part of its speed: 12 s of a jet, 1 s of a drone.

    Parameters
    ----------
    record : which says how fast the aircraft flies; without an airspeed it takes two minutes.
    """
    if record is not None and "flaps" in record.channels:
        position = record.channels["flaps"]
        flown = position[within(record.time_s, airborne_phases(phases)) & np.isfinite(position)]
        if flown.size:
            out = runs(np.abs(position - np.median(flown)) > DEFLECTED)
            return [(float(record.time_s[first]) - 0.5, float(record.time_s[end - 1]) + 0.5) for first, end in out]
    speeds = np.empty(0)
    if record is not None and "tas" in record.channels:
        speeds = record.channels["tas"][within(record.time_s, flight_stretches(phases))]
    known = speeds[np.isfinite(speeds)]
    clean_up_s = min(CLEAN_UP * float(np.median(known)) / G, CLEAN_UP_S) if known.size else CLEAN_UP_S
    parts = [phase for phase in phases if phase.phase not in ("turn", "stall", "parabola")]
    changes = []
    for k, part in enumerate(parts):
        if part.phase == "take-off":
            changes.append((part.from_s, part.to_s + clean_up_s))
        elif part.phase in ("approach", "landing"):
            before = [phase for phase in parts[:k] if phase.phase in ("descent", "take-off", "ground")]
            first = before[-1].from_s if before and before[-1].phase == "descent" else part.from_s
            changes.append((first, part.to_s))
    return changes


def zero_lift_of(record: Record, phases: Sequence[Phase], *, without: Sequence[Window] = ()) -> float | None:
    """Return the angle of attack of zero lift, rad, None where the log does not tell it, or parts of it disagree.

    Parameters
    ----------
    without : stretches that are left out beside take-off, landing and parabolas, such as a fault's.
    """
    channels = record.channels
    if not ({"aoa", "normal_acc"} <= channels.keys() and channels.keys() & set(STATIC_SOURCES)):
        return None
    if not channels.keys() & set(IMPACT_SOURCES):
        return None
    moved = configuration_changes(phases, record)
    used = within(record.time_s, flight_stretches(phases)) & ~within(record.time_s, (*moved, *without))
    if np.count_nonzero(used) < LEAST_S:
        return None
    impact = air_data_of(channels).q_impact
    every = np.flatnonzero(used)
    parts = [every, *(np.array_split(every, PARTS) if len(every) >= PARTS * LEAST_PART_S else [])]
    angles: list[float] = []
    for part in parts:
        try:
            angles.append(zero_lift_angle(channels["normal_acc"][part], channels["aoa"][part], impact[part]))
        except ValueError:
            if part is every:
                return None
    return angles[0] if max(angles) - min(angles) <= SAME_ANGLE else None
