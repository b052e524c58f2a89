"""How the inputs of a log move, and the windows with the most moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..kernels import BoolArray
from ..kernels.runs import shared, within
from ..quantities.channels import INPUTS
from .phases import Phase, phases_of, spans_of
from .quality import UNFIT, gap_starts
from .record import FlightLog, FloatArray

# Length of the means in which moves are counted, s: shorter than a pilot's stroke, longer than the sensor's noise.
BLOCK_S = 0.25
MOVE = 0.05  # share of an input's range that counts as a move
POWER = 0.95  # share of an input's variance below its bandwidth
SEGMENT_S = 60.0  # slower changes are those of the trim
# Time kept before the first and after the last move; moves further apart than both together belong to two windows.
BEFORE_S, AFTER_S = 5.0, 15.0
FEWEST_MOVES = 3  # a window with fewer holds a single correction, no manoeuvre
MOST_WINDOWS, MOST_NAMED = 10, 3  # suggested in all, and in a sentence
UNFIT_SHARE = 0.05  # a window with more of it in phases that no linear model follows ranks after the others


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """How an input moves.

    Attributes
    ----------
    range : between its 0.5 % and 99.5 % quantiles, in `unit`.
    moves : number of travels in one direction by more than 5 % of that range.
    bandwidth_hz : 95 % of the variance about the mean of each minute lies below it; None for an input at rest.
    """

    channel: str
    unit: str
    range: float
    moves: int
    bandwidth_hz: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitedWindow:
    """A stretch without gaps in which `channel` moves `moves` times; the one of rank 1 is the best to analyse."""

    start_s: float
    stop_s: float
    channel: str
    moves: int
    rank: int = 1


def advice_on_windows(log: FlightLog) -> str:
    """Return a sentence that names the windows of a long log with the most moves."""
    duration_s = float(log.time_s[-1] - log.time_s[0])
    windows = _suggested_windows(log, phases_of(log), at_most=MOST_NAMED)
    named = [f"--from {w.start_s:.10g} --to {w.stop_s:.10g} ({w.channel})" for w in windows]
    return f"the record is {duration_s / 60.0:.0f} min long; windows to take: {', '.join(named) or 'none stands out'}"


def samples_in_flight(log: FlightLog, phases: Sequence[Phase]) -> BoolArray:
    """Return (n_samples,) which samples are not on the ground."""
    return ~within(log.time_s, spans_of(phases, ("ground",)))


def excitation_of(log: FlightLog, name: str, flying: BoolArray) -> Excitation:
    """Return how an input moves in flight, NaN left out; a parked elevator, at its stop, would widen the range."""
    channel = log.channels[name]
    x = channel.values[flying & np.isfinite(channel.values)]
    extent = _extent(x)
    size, bandwidth_hz = min(x.size, round(SEGMENT_S * log.rate_hz)), None
    if extent > 0.0 and size >= 8:
        pieces = x[: x.size // size * size].reshape(-1, size)
        pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * np.hanning(size)
        power = np.cumsum((np.abs(np.fft.rfft(pieces, axis=1)) ** 2).sum(axis=0))
        if power[-1] > 0.0:
            bandwidth_hz = float(np.searchsorted(power, POWER * power[-1]) * log.rate_hz / size)
    moves = _move_times(log, name, flying).size
    return Excitation(channel=name, unit=channel.unit, range=extent, moves=moves, bandwidth_hz=bandwidth_hz)


def _extent(x: FloatArray) -> float:
    return float(np.ptp(np.quantile(x, [0.005, 0.995]))) if x.size else 0.0


def _move_times(log: FlightLog, name: str, flying: BoolArray) -> FloatArray:
    """Return the times at which moves begin: runs of block means that change one way by more than the threshold."""
    values = log.channels[name].values
    good = flying & np.isfinite(values)
    x, t = (values, log.time_s) if good.all() else (values[good], log.time_s[good])
    size = max(1, round(BLOCK_S * log.rate_hz))
    n = x.size // size
    travel = np.diff(x[: n * size].reshape(n, size).mean(axis=1))
    if not travel.size or (extent := _extent(x)) == 0.0:
        return np.empty(0)
    way = np.sign(travel)
    starts = np.flatnonzero(np.concatenate([[True], way[1:] != way[:-1]]))
    runs = np.add.reduceat(travel, starts)
    return np.asarray(t[starts[np.abs(runs) > MOVE * extent] * size])


def ranked_windows(log: FlightLog, phases: Sequence[Phase]) -> tuple[ExcitedWindow, ...]:
    """Return the suggested windows in order of time, ranked by flight first, then by the number of moves."""
    unfit = spans_of(phases, UNFIT)

    def worth(window: ExcitedWindow) -> tuple[bool, int, float]:
        inside = shared((window.start_s, window.stop_s), unfit)
        return inside > UNFIT_SHARE * (window.stop_s - window.start_s), -window.moves, window.start_s

    windows = _suggested_windows(log, phases, at_most=MOST_WINDOWS)
    ranks = {window: rank for rank, window in enumerate(sorted(windows, key=worth), start=1)}
    return tuple(replace(window, rank=ranks[window]) for window in windows)


def _suggested_windows(log: FlightLog, phases: Sequence[Phase], *, at_most: int) -> tuple[ExcitedWindow, ...]:
    """Return the stretches without gaps in which the first input with moves has them, in order of time.

    In a log without inputs the pitch attitude is used instead.

    Parameters
    ----------
    at_most : the stretches with the most moves are kept.
    """
    before, flying = gap_starts(log.time_s), samples_in_flight(log, phases)
    inputs = [name for name in INPUTS if name in log.channels]
    for name in inputs or [name for name in ("pitch",) if name in log.channels]:
        times = _move_times(log, name, flying)
        # Two windows where the input rests for longer than the margins, or the log has a gap.
        rests, windows = np.diff(times) > BEFORE_S + AFTER_S, []
        for start_s in log.time_s[before]:
            rests |= (times[:-1] <= start_s) & (times[1:] > start_s)
        for group in np.split(times, np.flatnonzero(rests) + 1):
            if group.size >= FEWEST_MOVES:
                low = max([log.time_s[0], *(stop for stop in log.time_s[before + 1] if stop <= group[0])])
                high = min([log.time_s[-1], *(start for start in log.time_s[before] if start >= group[-1])])
                start_s = round(float(max(low, group[0] - BEFORE_S)), 3)
                stop_s = round(float(min(high, group[-1] + AFTER_S)), 3)
                windows.append(ExcitedWindow(start_s=start_s, stop_s=stop_s, channel=name, moves=group.size))
        if windows:
            best = sorted(windows, key=lambda w: -w.moves)[:at_most]
            return tuple(sorted(best, key=lambda w: w.start_s))
    return ()
