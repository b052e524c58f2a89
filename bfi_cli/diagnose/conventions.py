"""Accelerations that are not what their names say: with gravity left in or out, or turned over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..airdata import GRAVITY_LEFT_IN
from ..flightlog import FlightLog
from ..flightlog.phases import Phase
from ..parity import Record, record_of
from ..parity.windows import flight_stretches, within

# m/s^2 by which the mean rate of the airspeed may differ from that of the accelerometers: two degrees of attitude.
# Gravity that was taken out of the longitudinal acceleration is its sine of the pitch, as much in a climb.
MEAN_RATE = 0.35


def without_other_conventions(log: FlightLog, phases: Sequence[Phase]) -> tuple[FlightLog, tuple[str, ...]]:
    """Return the log without accelerations whose mean over the flight no aircraft has, and a sentence on each."""
    said = []
    if "normal_acc" in log.channels:
        flown = log.channels["normal_acc"].values[within(log.time_s, flight_stretches(phases))]
        middle = float(np.nanmedian(flown)) if np.isfinite(flown).any() else 0.0
        if abs(middle) > GRAVITY_LEFT_IN:
            said.append(
                f"'normal_acc' has a median of {middle:.3g} m/s^2 in flight, where it should be 0 in level flight: "
                "it was not used"
            )
            log = without(log, "normal_acc")
    record = record_of(log)
    if record.gained is not None and "tas" in record.channels:
        off = _mean_rate(record, phases)
        if abs(off) > MEAN_RATE:
            said.append(
                f"'longitudinal_acc' and attitude give {off:.2g} m/s^2 more acceleration than the airspeed shows in "
                "the mean over the flight: it was not used; it should be the specific force along body x, "
                "forward, and the pitch be right"
            )
            log = without(log, "longitudinal_acc")
    return log, tuple(said)


def without(log: FlightLog, *names: str) -> FlightLog:
    """Return a log without some of its channels."""
    return replace(log, channels={name: one for name, one in log.channels.items() if name not in names})


def _mean_rate(record: Record, phases: Sequence[Phase]) -> float:
    """Return by how much the accelerometers' mean rate of the airspeed exceeds the airspeed's, m/s^2."""
    gained, seconds = 0.0, 0.0
    for first, last in flight_stretches(phases):
        part = record.between(first, last)
        assert part.gained is not None
        excess = part.gained - part.channels["tas"]
        left = np.flatnonzero(np.isfinite(excess))
        if left.size > 1:
            gained += float(excess[left[-1]] - excess[left[0]])
            seconds += float(part.time_s[left[-1]] - part.time_s[left[0]])
    return gained / seconds if seconds > 0.0 else 0.0
