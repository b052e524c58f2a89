"""The angle of attack of zero lift, from the flight itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..airdata import IMPACT_SOURCES, STATIC_SOURCES, air_data_of, zero_lift_angle
from ..flightlog.phases import Phase
from .record import Record
from .windows import Window, clean_up_time, configuration_changes, flight_stretches, within

# Seconds of flight that tell it: shorter ones hold too few angles of attack.
LEAST_S = 300.0
# Parts of the flight in a row that must tell the same, rad: a fault that lasts through one of them moves the angle, and
# the wrong one makes faults of healthy windows. Parts of 1000 s of two recorded Citations lie within 0.2 degrees.
PARTS, LEAST_PART_S, ALIKE = 3, 150.0, np.radians(1.0)


def zero_lift_of(record: Record, phases: Sequence[Phase], *, without: Sequence[Window] = ()) -> float | None:
    """Return it in rad, None where the channels or the flight do not tell it, or where parts of the flight disagree.

    Parameters
    ----------
    without : stretches that are left out beside take-off, approach, landing and parabolas, such as a fault's.
    """
    channels = record.channels
    if not ({"aoa", "normal_acc"} <= channels.keys() and channels.keys() & set(STATIC_SOURCES)):
        return None
    if not channels.keys() & set(IMPACT_SOURCES):
        return None
    moved = configuration_changes(phases, clean_up_s=clean_up_time(phases, record))
    used = within(record.time_s, flight_stretches(phases)) & ~within(record.time_s, (*moved, *without))
    if np.count_nonzero(used) < LEAST_S:
        return None
    impact = air_data_of(channels).q_impact
    every = np.flatnonzero(used)
    parts = [every, *(np.array_split(every, PARTS) if len(every) >= PARTS * LEAST_PART_S else [])]
    told: list[float] = []
    for part in parts:
        try:
            told.append(zero_lift_angle(channels["normal_acc"][part], channels["aoa"][part], impact[part]))
        except ValueError:
            if part is every:
                return None
    return told[0] if max(told) - min(told) <= ALIKE else None
