"""A whole log once a second, in flight: the values that relations between channels are held against."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ...airdata.relations import State
from ...flightlog import FlightLog
from ...flightlog.record import LARGEST_VALUE
from ...flightlog.signs import BORNE, FASTEST, METRES_PER_SECOND, MOVING, WALK
from ...kernels import BoolArray, FloatArray
from ...kernels.running import block_means
from ...kernels.runs import runs
from ...quantities.channels import STANDARD

# Samples of a large log that are looked at, from its middle: three hours at 100 Hz take a tenth of a second.
LOOKED_AT = 1_000_000
# Seconds on which every hypothesis is tried: a hundred for the median of each of eight pieces of a flight.
MOST_TRIED = 800
FEWEST = 100  # parts of a log that is shorter than so many seconds
# A speed that reads no more than a walk says that nothing flies.
SPEEDS = ("tas", "cas", "ias", "mach", "ground_speed")
# Seconds of take-off and landing, beside what is not flown, in which vanes and pressures settle.
SETTLING = 10
# An angle beyond is none in radians, from -pi to 2 pi with a turn to spare for rounding.
ONE_TURN = 6.4


def seconds_of(log: FlightLog, names: Collection[str]) -> State | None:
    """Return channels of a log once a second, in flight; None where nothing tells that it flies."""
    middle = max(0, (log.n_samples - LOOKED_AT) // 2)
    rows = slice(middle, middle + LOOKED_AT)
    time_s = log.time_s[rows]
    # A short log, whose clock may run too slowly, is cut into parts of a second.
    width_s = float(np.clip((time_s[-1] - time_s[0]) / FEWEST, (time_s[-1] - time_s[0]) / time_s.size, 1.0))
    bins = np.floor((time_s - time_s[0]) / width_s + 1e-6)
    first = np.flatnonzero(np.diff(bins, prepend=-1.0))
    if first.size < 3:
        return None
    block = np.cumsum(np.diff(bins, prepend=-1.0) > 0.0) - 1
    every = {
        name: block_means(_continuous(name, log.channels[name].between(rows)), block, first.size)
        for name in log.independent(names)
        if log.channels[name].unit in ("", "1", STANDARD[name].unit)
    }
    flown = _flown(every)
    if flown is None or not flown.any():
        return None
    at_s = width_s * bins[first]
    rates = {name: np.gradient(values, at_s) for name, values in every.items()}
    # Even steps through what is flown, so that pieces of it are pieces of the flight.
    kept = np.flatnonzero(flown)
    kept = kept[:: max(1, -(-kept.size // MOST_TRIED))]
    return State(
        values={name: _as_slow(values)[kept] for name, values in every.items()},
        rates={name: values[kept] for name, values in rates.items()},
        time_s=time_s[0] + at_s[kept],
    )


def _continuous(name: str, values: FloatArray) -> FloatArray:
    """Return the values without jumps by a whole turn, of headings; NaN where they are no measurements."""
    values = np.where(np.abs(values) < LARGEST_VALUE, values, np.nan)
    if name != "yaw" or not np.isfinite(values).any():
        return values
    period = 360.0 if np.nanmax(np.abs(values)) > ONE_TURN else 2.0 * np.pi
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)
    return values


def _as_slow(values: FloatArray) -> FloatArray:
    """Return means over as long as a rate is one of, by the differences between the seconds beside: weights 1, 2, 1."""
    slow = values.copy()
    slow[1:-1] = 0.25 * (values[:-2] + 2.0 * values[1:-1] + values[2:])
    return slow


def _flown(values: Mapping[str, FloatArray]) -> BoolArray | None:
    """Return (n_seconds,) where most of the speeds say that the aircraft flies; None where no speed says anything.

    Each is taken in parts of its own cruise, so that their units do not matter.
    """
    shares = []
    north, east = (values.get(name) for name in ("velocity_north", "velocity_east"))
    ground = {} if north is None or east is None else {"ground_speed": np.hypot(north, east)}
    for name, values_of in ({**values, **ground}).items():
        if name not in SPEEDS or not np.isfinite(values_of).any():
            continue
        speed = np.abs(values_of)
        known = speed[np.isfinite(speed)]
        cruise = float(np.median(known[known >= MOVING * np.quantile(known, FASTEST)]))
        flies = cruise * METRES_PER_SECOND.get(name, 1.0) > WALK
        shares.append(np.nan_to_num(speed) / cruise if flies else np.zeros(speed.size))
    if not shares:
        return None
    flown: BoolArray = np.median(shares, axis=0) >= BORNE
    for low, high in runs(~flown):
        flown[max(0, low - SETTLING) : high + SETTLING] = False
    return flown
