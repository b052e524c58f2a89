"""How an input moves, and which stretches of a flight are worth analysing for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .record import FlightLog, FloatArray

__all__ = ["Excitation", "ExcitedWindow", "excitation", "suggest_windows"]

# Means of this long are compared: shorter than a pilot's stroke, longer than the noise of a position sensor.
BLOCK_S = 0.25
# Of the range of an input, what counts as a move; and of its variance, what the bandwidth holds.
MOVE, POWER = 0.05, 0.95
# A minute: slower changes are those of the trim.
SEGMENT_S = 60.0
# Kept before the first and after the last move; two moves further apart than both belong to two windows.
BEFORE_S, AFTER_S = 5.0, 15.0
# A window with fewer holds a single correction, no manoeuvre.
FEWEST_MOVES = 3
# Of the airspeed in flight: below it the aircraft stands or rolls.
SLOWEST_AIRSPEED = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """How an input moves.

    Attributes
    ----------
    range : between its 0.5 % and 99.5 % quantiles, in `unit`.
    moves : how often it travels by more than 5 % of that range in one direction.
    bandwidth_hz : 95 % of its variance about its mean over a minute lies below; None where it does not move.
    """

    channel: str
    unit: str
    range: float
    moves: int
    bandwidth_hz: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitedWindow:
    """A stretch without gaps in which `channel` moves `moves` times."""

    start_s: float
    stop_s: float
    channel: str
    moves: int


def excitation(log: FlightLog, name: str) -> Excitation:
    """Return how the channel `name` moves in flight (a parked elevator would dwarf it); NaN are left out."""
    channel = log.channels[name]
    x = channel.values[_flying(log) & np.isfinite(channel.values)]
    extent = _extent(x)
    return Excitation(
        channel=name,
        unit=channel.unit,
        range=extent,
        moves=_move_times(log, name).size,
        bandwidth_hz=_bandwidth(x, log.rate_hz) if extent > 0.0 else None,
    )


def _extent(x: FloatArray) -> float:
    return float(np.ptp(np.quantile(x, [0.005, 0.995]))) if x.size else 0.0


def _move_times(log: FlightLog, name: str) -> FloatArray:
    """Return the times at which moves begin: runs of block means that travel one way by more than the threshold."""
    good = _flying(log) & np.isfinite(log.channels[name].values)
    x, t = log.channels[name].values[good], log.time_s[good]
    size = max(1, round(BLOCK_S * log.rate_hz))
    n = x.size // size
    travel = np.diff(x[: n * size].reshape(n, size).mean(axis=1))
    if not travel.size or _extent(x) == 0.0:
        return np.empty(0)
    way = np.sign(travel)
    starts = np.flatnonzero(np.concatenate([[True], way[1:] != way[:-1]]))
    runs = np.add.reduceat(travel, starts)
    return np.asarray(t[starts[np.abs(runs) > MOVE * _extent(x)] * size])


def _bandwidth(x: FloatArray, rate_hz: float) -> float | None:
    size = min(x.size, round(SEGMENT_S * rate_hz))
    if size < 8:
        return None
    pieces = x[: x.size // size * size].reshape(-1, size)
    pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * np.hanning(size)
    power = np.cumsum((np.abs(np.fft.rfft(pieces, axis=1)) ** 2).sum(axis=0))
    if power[-1] == 0.0:
        return None
    return float(np.searchsorted(power, POWER * power[-1]) * rate_hz / size)


def suggest_windows(
    log: FlightLog, inputs: Sequence[str], gaps: Sequence[tuple[float, float]], *, at_most: int = 10
) -> tuple[ExcitedWindow, ...]:
    """Return the stretches in which the first input that moves at all does so, in order of time.

    Parameters
    ----------
    inputs : channels in order of preference.
    gaps : (start_s, stop_s) that no window may span.
    at_most : the stretches with the most moves are kept.
    """
    for name in inputs:
        times = _move_times(log, name)
        # Moves are apart where the input rests for longer than the margins, or the log has a gap.
        rests = np.diff(times) > BEFORE_S + AFTER_S
        for start, _ in gaps:
            rests |= (times[:-1] <= start) & (times[1:] > start)
        windows = []
        for group in np.split(times, np.flatnonzero(rests) + 1):
            if group.size >= FEWEST_MOVES:
                low = max([log.time_s[0], *(stop for _, stop in gaps if stop <= group[0])])
                high = min([log.time_s[-1], *(start for start, _ in gaps if start >= group[-1])])
                start_s = round(float(max(low, group[0] - BEFORE_S)), 3)
                stop_s = round(float(min(high, group[-1] + AFTER_S)), 3)
                windows.append(ExcitedWindow(start_s=start_s, stop_s=stop_s, channel=name, moves=group.size))
        if windows:
            best = sorted(windows, key=lambda w: -w.moves)[:at_most]
            return tuple(sorted(best, key=lambda w: w.start_s))
    return ()


def _flying(log: FlightLog) -> NDArray[np.bool_]:
    """Mark the samples at which the airspeed, where there is one, does not say that the aircraft stands or rolls."""
    airspeed = next((log.channels[name].values for name in ("tas", "cas", "ias") if name in log.channels), None)
    if airspeed is None or not np.isfinite(airspeed).any():
        return np.ones(log.n_samples, dtype=bool)
    return np.asarray(airspeed >= SLOWEST_AIRSPEED * np.nanquantile(airspeed, 0.95))
