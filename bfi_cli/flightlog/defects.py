"""Short defects of one channel: dropouts, spikes, and readings that freeze.

Dropouts and spikes are errors of the cubic through the neighbours of a sample, in units of the usual error in the same
half minute and of the largest errors of other channels in the same seconds, so that a manoeuvre or a gust, which moves
several channels, is no defect. A frozen reading is compared with its course as other channels tell it, or without such
channels with its motion just before and just after.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np

from ..airdata import IMPACT_SOURCES
from ..airdata.relations import RELATIONS, relatives
from ..faults.filters import response_of
from ..kernels import MAD, BoolArray, IntArray
from ..kernels.generalised_least_squares import least_squares
from ..kernels.runs import (
    block_means,
    bridged,
    greatest_of_neighbours,
    interpolation_error,
    running_median,
    runs,
    travel,
    within,
)
from ..quantities.text import instant
from .phases import HOVER, TRANSITION, Phase, phases_of
from .quality import hold_of
from .rates import AS_FAST
from .raw import ANGLES
from .record import LARGEST_VALUE, Channel, FlightLog, FloatArray

# By half length of the gap, in ticks, the errors (n,) of the cubic, and their ratios to the usual error.
_Errors = dict[int, tuple[FloatArray, FloatArray]]
# The course of a channel as another channel tells it, the scatter about it, and where it is known, (n,) each.
_Expected = tuple[FloatArray, FloatArray, BoolArray]
DefectShape = Literal["dropout", "frozen", "spikes"]

# Sensors that always move in flight, unlike switches and surfaces.
WATCHED: tuple[str, ...] = ("tas", "cas", "ias", "mach", "q_impact", "p_total", "p_static", "altitude", "altitude_rate")
WATCHED += ("tat", "sat", "aoa", "sideslip", "pitch", "roll", "normal_acc", "longitudinal_acc", "lateral_acc")
WATCHED += ("pitch_rate", "roll_rate", "yaw_rate", "velocity_north", "velocity_east", "ground_speed")
WATCHED += ("latitude", "longitude")
# Phases in which airspeeds come and go without a defect, and the margin on both sides, s.
UNWATCHED, BESIDE_S = ("ground", "take-off", "landing", "stall", HOVER, TRANSITION), 2.0
# By channel the channels that each predict its motion over some seconds; "+" stands for the integral of a rate.
RELATIVES = relatives(RELATIONS)

# Faster samples are averaged: no air-data sensor follows faster.
FASTEST_HZ = 20.0
# Half lengths, s, of the gap that the cubic bridges: an excursion is seen if it is shorter than twice that.
HALVES_S = (0.8, 1.5, 2.5, 5.0)
# Times, s, over which the usual error of a channel, and the errors of other channels, are taken.
AROUND_S, TOGETHER_S = 30.0, 2.0
# Least usual error, as a share of the usual error over the record.
CALMEST = 0.25
# Level of an excursion in usual errors: no less than LEAST, and where the errors of the channel are wilder, the level
# of a Frechet law through the median and the upper quartile of the largest ratios of half minutes, at a rate of 1e-3 of
# them: with ln(ln(4/3) / 1e-3) / ln(ln 2 / ln(4/3)) the power of their quotient. On 38 channels of two flights of a
# Citation and one of a Cessna 172, in flight, the largest ratio is 2 to 6 on airspeeds, altitudes and temperatures of
# the former, 12 of the latter, and 23 on a longitudinal acceleration.
LEAST, BEYOND, STEEPEST, FEWEST_BLOCKS = 24.0, 6.4, 10.0, 20
# A ratio is divided by this share of the second largest ratio of other channels at the same time, where that exceeds 1.
MOST_ALIKE = 0.5
FEWEST_QUANTA = 3.0
MOST_PASSES = 25
ROUNDING = 1e-6  # of the largest value, some digits above single precision
TINY = float(np.sqrt(np.finfo(np.float64).tiny))  # least reading of a ratio, which is finite for any other
FEWEST_TICKS, MOST_TICKS = 32, 10**7
# Ticks per reading [1]: bounds what a wrong time far beyond the others costs, for a tick of a gap takes as much memory
# as one with a reading. A sensor of 1 Hz among ticks of FASTEST_HZ has 20.
SPARSEST = 100
# Sensors that may fail to 0, which they never read in flight.
POSITIVE = ("tas", "cas", "ias", "mach", "q_impact", "p_total", "p_static", "tat", "sat")
# An excursion returns: it swings back by less than the first share of its height, and falls below the second share
# within the gap.
RETURNED, FOOT = 0.35, 0.1
# rad/s, by channel, that an aircraft does: a roll and back between samples is none of the sensor's. Unlimited aerobatic
# aircraft roll by 420 degrees/s (Extra 330SC, manufacturer's data).
FASTEST_MOTION: Mapping[str, float] = {"roll": np.radians(420.0)}
# Longest spike: so many seconds, or so many samples of a slow log.
SPIKE_S, SPIKE_SAMPLES = 0.4, 3.0
# A dropout is off by the first share of the reading, rests within the second share of that, and lasts so long, s.
DROPS, RESTS, DROPOUT_S = 0.5, 0.05, 0.5
# MIDDLE: quantiles of a dropout between which it rests: a mean or an interpolated sample at each edge holds both sides,
# a fifth of the fewest that tell a rest (FEWEST_STILL samples).
MIDDLE = (0.2, 0.8)
FEWEST_RESTING = 3
# Shares of the reading up to which a reading is zero, through a recorder's low-pass and without one.
ZERO, ZERO_SHARP = 0.1, 0.01
# AT_ONCE_S [s]: within which half a reading (DROPS) is lost, or back, that no flight loses: of the 10 m/s (20 kt) from
# which airspeeds are read that takes 5 g along the path, of 20 m/s 10 g; what flies has 1 g and gusts
# (`parity.sensors.FASTEST`).
AT_ONCE_S = 0.1
# Width of an unknown recorder's response at half of its height, s: that of 0.75 Hz.
UNKNOWN_WIDTH_S = 0.6

# Channels that a channel must contradict to be the faulty one.
FEWEST_WITNESSES = 2
# Lengths of the stretches in which frozen readings are sought, s, and their fewest samples.
STILL_S, FEWEST_STILL = (2.0, 3.0, 4.5, 7.0, 10.0, 15.0, 22.0, 33.0), 5
# A frozen reading travels by less than this share of the travel that other channels predict, and agrees with them to
# that amount over so many seconds before and after.
STILL, AGREES_S = 0.35, 2.0
# Predicted travel over the scatter of the prediction from which a reading is frozen, by one other channel and by two or
# more: on the same three flights the largest ratio of an airspeed that stays as still is 3.2 by one channel and 2.5 by
# two, of an altitude 4.8 by one.
MOVED, MOVED_BY_TWO = 5.5, 4.0
# Without other channels, the travel both before and after over that in the stretch from which a reading is frozen: on
# the same flights the largest ratio is 180 over 3 s, and 25 over 7 s and more.
STILLER = 400.0
# A channel that rests half as long in more than this share of the remaining record does so without a defect. Less than
# so many remaining seconds do not tell: in 120 s of a healthy flight a rate of climb rests for 5 s.
RARELY, KNOWN_S = 0.005, 300.0
# A channel is predicted in blocks of this length from so many samples within the second time on either side.
BLOCK_S, OUTSIDE_S, MOST_ROWS = 10.0, 30.0, 300
# MOST_SLOPE: largest slope of a prediction, in that of the physics of one line: the 273 K of SCALE_HEIGHT_M, the height
# in which a pressure falls to 1/e, over the 210 K of a cold tropopause (216.65 K in ISO 2533). Beyond, an error of the
# channel is fitted as motion of the other.
MOST_SLOPE, SCALE_HEIGHT_M = 1.3, 8000.0
BLOCKS = 256  # predicted at once, for memory
NOISE_S = 11  # s of the running median of the prediction's noise
# Least scatter of a prediction over the quantum of the other channel.
COARSE = 0.7
# Samples with an error beyond so many median errors are left out of the prediction.
OUTLYING = 6.0
# A channel rests where it travels by less than the first share of its quantum; without a quantum, of its travel in the
# second share of its seconds, the calmest.
STILL_QUANTUM, CALMEST_SECONDS = 0.3, 0.02
# A frozen stretch is grown over samples within this share of the predicted travel.
STILL_BESIDE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """All short defects of one channel and shape.

    Attributes
    ----------
    times_s, durations_s : of each defect the time of its first sample, on the log's axis, and its duration.
    largest : the largest error, in `unit`.
    statistic : of the clearest defect, over the level from which it is one.
    hidden : stretches, s, in which the reading must not be used.
    """

    channel: str
    unit: str
    shape: DefectShape
    times_s: tuple[float, ...]
    durations_s: tuple[float, ...]
    largest: float
    statistic: float
    hidden: tuple[tuple[float, float], ...]

    @property
    def count(self) -> int:
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        """Seconds in all."""
        return float(sum(self.durations_s))

    def between(self, from_s: float, to_s: float) -> Defect | None:
        """Return the defects that begin in a window, None without any; `largest` and `statistic` stay those of all."""
        inside = [k for k, time_s in enumerate(self.times_s) if from_s <= time_s < to_s]
        kept: dict[str, Any] = {
            key: tuple(getattr(self, key)[k] for k in inside) for key in ("times_s", "durations_s", "hidden")
        }
        return replace(self, **kept) if inside else None


@dataclass(slots=True, kw_only=True, eq=False)
class _Track:
    """A channel at the times of its new values, its ticks.

    Attributes
    ----------
    time_s : (n,) of the ticks; step_s : between them.
    values : (n,) readings, interpolated where none is known or one was taken out; known : (n,) where it is a reading.
    quantum : of the values, 0 where none is found.
    """

    channel: Channel
    time_s: FloatArray
    step_s: float
    values: FloatArray
    known: BoolArray
    quantum: float

    def size(self, seconds: float) -> int:
        return max(1, round(seconds / self.step_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Flaw:
    """One defect: time of its first sample, duration, error, statistic over its level, and the stretch to hide, s."""

    shape: DefectShape
    time_s: float
    duration_s: float
    height: float
    share: float
    hidden: tuple[float, float]


def find_defects(log: FlightLog) -> tuple[Defect, ...]:
    """Return the short defects of the sensors of a log, in flight where that is known.

    Parameters
    ----------
    log : with the filters of its recorder, if known, see `recorder.with_seen_recorder`.
    """
    ticks = lru_cache(maxsize=1)(partial(_ticks, log))  # most channels have one clock
    tracks = {name: track for name in log.independent(WATCHED) if (track := _track(log, log.channels[name], ticks))}
    ticks.cache_clear()
    width_s, reach_s = _recorder(log)
    # Errors are made once more where a channel is searched: those of all channels of a day do not fit in memory.
    loudness = {name: _loudness(track, _errors(track), log) for name, track in tracks.items()}
    flaws: dict[str, list[_Flaw]] = {}
    for name, track in tracks.items():
        # Errors of other channels at the same time count against an error; the second largest does.
        others = np.sort([values for other, values in loudness.items() if other != name] or [np.ones(1)], axis=0)
        alike = np.maximum(1.0, MOST_ALIKE * others[max(0, len(others) - 2)])
        is_positive, loud = name in POSITIVE, loudness[name]
        may_be_lost = is_positive and (loud.max() > LEAST or (_lost_at_once(track, _usual_size(track)) >= 1.0).any())
        flaws[name] = []
        if may_be_lost or (loud / alike).max() > LEAST:
            flaws[name] = _excursions(track, _at_seconds(alike, track, log), width_s, reach_s, is_positive=is_positive)
    calm = {name: _at_seconds(loudness[name], track, log) <= LEAST for name, track in tracks.items()}
    if (rate := tracks.get("altitude_rate")) is not None:
        tracks = {**tracks, "+altitude_rate": replace(rate, values=rate.step_s * np.cumsum(rate.values))}
        calm["+altitude_rate"] = calm["altitude_rate"]
    for name in flaws:
        movers = [(tracks[other], calm[other]) for other in RELATIVES.get(name, ()) if other in tracks]
        predictions = [_expected(tracks[name], *mover) for mover in movers]
        flaws[name] += _against(tracks[name], predictions, width_s, reach_s)
        flaws[name] += _rests(tracks[name], predictions, movers, width_s, reach_s)
    unwatched = unwatched_in(phases_of(with_bridges(log, _defects(flaws, tracks))))
    for name, every in flaws.items():
        is_out = within(np.array([flaw.time_s for flaw in every]), unwatched)
        moved = FASTEST_MOTION.get(name, 0.0) * tracks[name].step_s
        flaws[name] = [
            flaw
            for flaw, out in zip(every, is_out, strict=True)
            if not out and not (flaw.shape == "spikes" and abs(flaw.height) <= moved)
        ]
    return _defects(flaws, tracks)


def unwatched_in(phases: Sequence[Phase]) -> list[tuple[float, float]]:
    """Return the stretches, s, in which airspeeds come and go without a defect."""
    return [(phase.from_s - BESIDE_S, phase.to_s + BESIDE_S) for phase in phases if phase.phase in UNWATCHED]


def with_bridges(log: FlightLog, defects: Sequence[Defect]) -> FlightLog:
    """Return the log with straight lines over the stretches that defects hide, for analyses that take no gap."""
    return _replaced(log, defects, with_lines=True)


def without_defects(log: FlightLog, defects: Sequence[Defect]) -> FlightLog:
    """Return the log with NaN in the stretches that defects hide."""
    return _replaced(log, defects, with_lines=False)


def sentence_of_defect(defect: Defect) -> str:
    """Return a defect in words: "'tas' drops out 5 times, 9.3 s in all, first at 812 s"."""
    times = "once" if defect.count == 1 else f"{defect.count} times"
    what = {"dropout": "drops out", "frozen": "stays still", "spikes": "jumps out"}[defect.shape]
    first = "at" if defect.count == 1 else "first at"
    first_s = instant(round(defect.times_s[0], 1))
    return f"'{defect.channel}' {what} {times}, {defect.duration_s:.2g} s in all, {first} {first_s} s"


def _replaced(log: FlightLog, defects: Sequence[Defect], *, with_lines: bool) -> FlightLog:
    for defect in defects:
        hidden = np.zeros(log.n_samples, dtype=bool)
        for first_s, last_s in defect.hidden:
            hidden |= (log.time_s >= first_s) & (log.time_s <= last_s)
        values = np.where(hidden, np.nan, log.channels[defect.channel].values)
        values = np.where(hidden, bridged(values, log.time_s), values) if with_lines else values
        log = log.with_values({defect.channel: values})
    return log


def _ticks(log: FlightLog, period: float, phase: float) -> IntArray:
    """Return (n_samples,) the ticks of a clock, its period and phase in samples."""
    ticks = np.floor(((log.time_s - log.time_s[0]) * log.rate_hz - phase + 0.5) / period)
    return np.asarray(np.maximum(ticks, 0.0), dtype=np.intp)


def _track(log: FlightLog, channel: Channel, ticks: Callable[[float, float], IntArray]) -> _Track | None:
    """Return a channel at its ticks, None where it is constant, unknown, or has too few, too many or empty ones.

    Parameters
    ----------
    ticks : of the samples, by period and phase, see `_ticks`.
    """
    recorded = channel.values  # read once from the file of a day, and copied only where some of it is no number
    finite = np.abs(recorded) < LARGEST_VALUE
    rows = slice(None) if finite.all() else finite
    readings = recorded[rows]
    if not readings.size or (travelled := float(np.ptp(readings))) == 0.0:
        return None
    period, phase, is_averaged = 1.0, 0.0, False
    if channel.own_rate_hz is not None and channel.own_rate_hz < AS_FAST * log.rate_hz:
        period = log.rate_hz / channel.own_rate_hz
    elif (hold := hold_of(log, recorded)) is not None:
        period, phase = hold.period, hold.phase
    elif log.rate_hz > FASTEST_HZ:
        period, is_averaged = log.rate_hz / FASTEST_HZ, True
    tick = ticks(period, phase)[rows]
    n = int(tick[-1]) + 1
    if not FEWEST_TICKS <= n <= min(MOST_TICKS, SPARSEST * tick.size):
        return None
    readings = np.unwrap(readings) if channel.name in ANGLES and travelled >= np.pi else readings
    values, known = np.full(n, np.nan), np.zeros(n, dtype=bool)
    known[tick] = True
    if is_averaged:
        values = block_means(readings, tick, n)
    else:
        values[tick[::-1]] = readings[::-1]  # the first of each tick
    at, step_s = np.arange(n), period / log.rate_hz
    values = values if known.all() else np.interp(at, at[known], values[known])
    at_ticks = channel if np.array_equal(values, recorded) else replace(channel, values=values)
    quantum = at_ticks.plateau_step(1.0 / step_s) or at_ticks.step or 0.0
    if not quantum:  # a short record shows too few steps: of a channel that mostly rests the usual change in a second
        apart = max(1, round(1.0 / step_s))
        moves = np.abs(values[apart:] - values[:-apart])
        moved = moves > ROUNDING * float(np.abs(values).max())
        quantum = float(np.median(moves[moved])) if moved.any() and float(np.mean(moved)) < 0.5 else 0.0
    return _Track(
        channel=channel,
        time_s=np.asarray(log.time_s[0] + phase / log.rate_hz + step_s * at, dtype=np.float64),
        step_s=step_s,
        values=values,
        known=known,
        quantum=quantum,
    )


def _recorder(log: FlightLog) -> tuple[float, float]:
    """Return the width at half height of the recorder's response to a spike, and its reach to either side, s."""
    if log.filters is None:
        return (UNKNOWN_WIDTH_S, 1.5 * UNKNOWN_WIDTH_S) if log.rate_hz > 2.0 / UNKNOWN_WIDTH_S else (0.0, 0.0)
    response = response_of(log.filters, log.rate_hz)
    taps = np.abs(response.taps)
    top, half = int(np.argmax(taps)), 0.5 * float(taps.max())
    rise = np.interp(half, np.append(0.0, taps[: top + 1]), np.arange(-1, top + 1))
    fall = np.interp(half, np.append(0.0, taps[top:][::-1]), np.arange(len(taps), top - 1, -1))
    left = np.flatnonzero(np.cumsum(taps) > 1e-3 * taps.sum())
    right = np.flatnonzero(np.cumsum(taps[::-1]) > 1e-3 * taps.sum())
    reach = max(response.before - int(left[0]), response.after - int(right[0]))
    return (float(fall - rise) / log.rate_hz if len(taps) > 1 else 0.0), reach / log.rate_hz


def _errors(track: _Track) -> _Errors:
    errors = {}
    least = max(track.quantum, ROUNDING * float(np.abs(track.values).max()), TINY)
    for half in dict.fromkeys(track.size(seconds) for seconds in HALVES_S):
        error = np.where(track.known, interpolation_error(track.values, half), 0.0)
        size = np.abs(error)
        usual = running_median(size, half, max(5, track.size(AROUND_S) // half))
        usual = MAD * np.maximum(usual, CALMEST * float(np.median(size)))
        errors[half] = error, size / np.maximum(usual, least)
    return errors


def _loudness(track: _Track, errors: _Errors, log: FlightLog) -> FloatArray:
    """Return by second of the log the largest ratio of an error to the usual error within `TOGETHER_S`."""
    seconds = np.zeros(int(log.time_s[-1] - log.time_s[0]) + 2)
    at = (track.time_s - log.time_s[0]).astype(np.intp)
    np.maximum.at(seconds, np.minimum(at, len(seconds) - 1), np.max([r for _, r in errors.values()], axis=0))
    return greatest_of_neighbours(seconds, 2 * round(TOGETHER_S) + 1)


def _at_seconds(seconds: FloatArray, track: _Track, log: FlightLog) -> FloatArray:
    """Return (n,) at the ticks of a channel the values that are given by second of the log."""
    at = (track.time_s - log.time_s[0]).astype(np.intp)
    return np.asarray(seconds[np.minimum(at, len(seconds) - 1)])


def _excursions(
    track: _Track,
    others: FloatArray,
    width_s: float,
    reach_s: float,
    *,
    is_positive: bool,
) -> list[_Flaw]:
    """Return the dropouts and spikes of a channel, and take them out of its track.

    Parameters
    ----------
    is_positive : it is one of `POSITIVE`: errors of other channels do not count against a reading of 0.
    """
    flaws: list[_Flaw] = []
    refused = np.zeros(len(track.values), dtype=bool)
    level: dict[int, float] = {}  # of the ratio, from which it is an excursion
    block = track.size(AROUND_S)
    n_blocks = len(track.values) // block
    for _ in range(MOST_PASSES):
        errors = _errors(track)
        for half, (_, ratio) in errors.items() if not level else ():
            level[half] = LEAST
            if n_blocks >= FEWEST_BLOCKS:
                largest = (ratio / others)[: n_blocks * block].reshape(n_blocks, block).max(axis=1)
                middle, high = np.quantile(largest, (0.5, 0.75))
                level[half] = max(LEAST, float(high * min(high / max(middle, TINY), STEEPEST) ** BEYOND))
        usual = _usual_size(track)
        lost = np.abs(track.values) < ZERO * usual
        at_once = _lost_at_once(track, usual) if is_positive else np.zeros(len(lost))
        stands_out = {
            half: ((ratio / others > level[half]) | (is_positive & lost & (ratio > LEAST)) | (at_once >= 1.0))
            & ~refused
            for half, (_, ratio) in errors.items()
        }
        size = np.max([np.where(mask, np.abs(errors[half][0]), 0.0) for half, mask in stands_out.items()], axis=0)
        if not size.any():
            break
        widest, known_before = 3 * max(errors), len(flaws)
        while size.any():
            k = int(np.argmax(size))
            ratios = {half: ratio[k] / others[k] / level[half] for half, (_, ratio) in errors.items()}
            share = float(max(at_once[k], *(ratio for half, ratio in ratios.items() if stands_out[half][k])))
            drafts = (_described(track, k, half, width_s, 0.5 * float(size[k]), share) for half in errors)
            flaw = next(filter(None, drafts), None)
            if flaw is None:
                beside = slice(max(0, k - track.size(0.5)), k + track.size(0.5) + 1)
                refused[beside], size[beside] = True, 0.0
                continue
            sure_s = reach_s + 0.5 * track.step_s
            flaws.append(replace(flaw, hidden=(flaw.hidden[0] - sure_s, flaw.hidden[1] + sure_s)))
            _take_out(track, flaws[-1].hidden)
            size[max(0, k - widest) : k + widest + 1] = 0.0
        if len(flaws) == known_before:  # all that stands out is refused
            break
    return flaws


def _usual_size(track: _Track) -> FloatArray:
    """Return (n,) the usual size of the reading in the minute about each tick."""
    return running_median(np.abs(track.values), track.size(1.0), 61)


def _lost_at_once(track: _Track, usual: FloatArray) -> FloatArray:
    """Return (n,) at the middle of each reading of 0 by how much of what is usual it falls or comes back at once.

    In units of `DROPS`, from 1 on faster than any flight; 0 elsewhere.

    Parameters
    ----------
    usual : see `_usual_size`.
    """
    reach = round(AT_ONCE_S / track.step_s)
    size, shares = np.abs(track.values), np.zeros(len(track.values))
    for first, end in runs(size <= ZERO_SHARP * usual) if reach else ():
        before, after = max(0, first - reach), min(end - 1 + reach, len(size) - 1)
        shares[(first + end) // 2] = max(size[before], size[after]) / max(DROPS * usual[first], TINY)
    return shares


def _described(track: _Track, k: int, half: int, width_s: float, least: float, share: float) -> _Flaw | None:
    """Return the defect around tick `k` within `half` ticks of it, None where the error is no defect."""
    low, high = k - half, k + half
    beside = max(1, half // 3)
    if low - beside < 0 or high + beside >= len(track.values):
        return None
    x = track.values
    before, after = float(np.median(x[low - beside : low + 1])), float(np.median(x[high : high + beside + 1]))
    ticks = np.arange(low + 1, high)
    course = np.interp(ticks, (low - 0.5 * beside, high + 0.5 * beside), (before, after))
    error = x[low + 1 : high] - course
    peak = int(np.argmax(np.abs(error)))
    height, sign = float(error[peak]), float(np.sign(error[peak]))
    if abs(height) < max(least, FEWEST_QUANTA * track.quantum):
        return None
    if max(float(np.max(-sign * error)), abs(after - before)) > RETURNED * abs(height):
        return None
    foot, upper = (_around(sign * error > level * abs(height), peak) for level in (FOOT, 0.5))
    if half > 1 and (foot[0] == 0 or foot[1] == len(error)):  # it goes on beyond the gap
        return None
    reading, step_s = float(course[peak]), track.step_s
    wide_s = (upper[1] - upper[0]) * step_s
    # Where the recorder's response has passed, a reading that dropped out shows its own level.
    inner = round(0.9 * width_s / step_s)
    core = x[low + 1 + upper[0] + inner : low + 1 + upper[1] - inner]
    if not core.size:
        core = x[low + 1 + peak : low + 2 + peak]
    level = float(np.median(core))
    is_sharp = width_s < step_s
    is_zero = abs(level) <= (ZERO_SHARP if is_sharp else ZERO) * abs(reading) and sign != np.sign(reading)
    rests = float(np.ptp(np.quantile(core, MIDDLE))) <= max(RESTS * abs(height), STILL_QUANTUM * track.quantum)
    to_s = float(track.time_s[low + 1 + upper[1] - 1]) + 0.5 * step_s
    from_s = float(track.time_s[low + 1 + upper[0]]) - 0.5 * step_s
    middle_s = 0.5 * (from_s + to_s)
    spike_s = max(float(np.hypot(width_s, SPIKE_S)) + 0.5 * step_s, SPIKE_SAMPLES * step_s if is_sharp else 0.0)
    shape: DefectShape = "dropout"
    if is_zero and rests and wide_s >= (step_s if is_sharp else DROPOUT_S):
        # No low-pass changes the area.
        height, lasts_s = -reading, float(error[foot[0] : foot[1]].sum()) * step_s / -reading
    elif wide_s <= spike_s * (1.0 + ROUNDING):
        shape, lasts_s = "spikes", max(step_s, float(np.sqrt(max(wide_s**2 - width_s**2, 0.0))))
    elif rests and core.size >= FEWEST_RESTING and abs(level - reading) >= DROPS * abs(reading):
        height, lasts_s = level - reading, wide_s
    else:
        return None
    return _Flaw(
        shape=shape,
        time_s=middle_s - 0.5 * lasts_s + 0.5 * step_s,  # its first sample
        duration_s=lasts_s,
        height=height,
        share=share,
        hidden=(from_s, to_s),
    )


def _around(marked: BoolArray, at: int) -> tuple[int, int]:
    """Return the run of marked entries around `at`: its first entry, and the entry after its last."""
    gaps = np.flatnonzero(~marked)
    first = gaps[gaps < at]
    last = gaps[gaps > at]
    return (int(first[-1]) + 1 if first.size else 0), (int(last[0]) if last.size else len(marked))


def _take_out(track: _Track, hidden: tuple[float, float]) -> None:
    track.known &= ~((track.time_s >= hidden[0]) & (track.time_s <= hidden[1]))
    track.values = np.interp(track.time_s, track.time_s[track.known], track.values[track.known])


def _against(track: _Track, predictions: Sequence[_Expected], width_s: float, reach_s: float) -> list[_Flaw]:
    """Return the spikes of a channel against the predictions of two or more others, and take them out of its track.

    A spike of one of the others is none of this channel: the least difference counts, where all have the same sign.
    """
    if len(predictions) < FEWEST_WITNESSES:
        return []
    errors = np.array([track.values - course for course, _, _ in predictions])
    alike = np.all(errors > 0.0, axis=0) | np.all(errors < 0.0, axis=0)
    least = errors[np.argmin(np.abs(errors), axis=0), np.arange(errors.shape[1])]
    known = np.all([known for _, _, known in predictions], axis=0) & track.known
    spread = np.max([spread for _, spread, _ in predictions], axis=0)
    if not np.isfinite(spread).any():
        return []
    scatter = float(np.quantile(spread[np.isfinite(spread)], 0.75))
    differences = replace(
        track, values=np.where(alike & known, least, 0.0), known=known, quantum=max(track.quantum, scatter)
    )
    excursions = _excursions(differences, np.ones(len(known)), width_s, reach_s, is_positive=False)
    spikes = [flaw for flaw in excursions if flaw.shape == "spikes"]
    for spike in spikes:
        _take_out(track, spike.hidden)
    return spikes


def _rests(
    track: _Track,
    relatives: Sequence[_Expected],
    movers: Sequence[tuple[_Track, BoolArray]],
    width_s: float,
    reach_s: float,
) -> list[_Flaw]:
    """Return where a channel is frozen though others predict that it moves, or though it moves before and after.

    Of stretches that overlap the longest counts, grown over the samples that stay as still.

    Parameters
    ----------
    relatives : predictions by other channels. Those from before and from after a stretch alone have to move as well:
        an error that begins beside a stretch is in one of them only.
    movers : these channels, and where they have no large error.
    """
    apart = track.size(reach_s) if reach_s else 0
    moves = travel(track.values, max(2, track.size(1.0)))
    moves = moves[moves > 0.0]
    # The least that the channel moves by: its quantum, or its travel in the calmest seconds where it has none.
    least = track.quantum or (float(np.quantile(moves, CALMEST_SECONDS)) if moves.size else 0.0)
    floor = max(STILL_QUANTUM * least, ROUNDING * float(np.abs(track.values).max()))
    sizes = [size for size in map(track.size, reversed(STILL_S)) if size >= FEWEST_STILL]
    sizes = [size for size in sizes if len(track.values) >= 3 * size + 4 * apart + 1]
    rests = _rests_beside(track, relatives, sizes, floor)
    sides = [
        _expected(track, *mover, before=before, after=not before, asked=rests)
        for mover in (movers if rests.any() else ())
        for before in (True, False)
    ]
    flaws: list[_Flaw] = []
    taken = ~track.known
    for size in sizes if rests.any() or not relatives else ():
        here, shift = travel(track.values, size), size + 2 * apart
        if relatives:
            should, needed = _should_move(relatives, size, floor, track.quantum)
            should = np.minimum(should, _least_travel(sides, size))
            marked = (here <= STILL * should) & (should > needed)
        else:
            should = np.zeros(len(here))
            should[shift:-shift] = np.minimum(here[: -2 * shift], here[2 * shift :])
            needed = STILLER * np.maximum(here, floor)
            # Wings are level between turns: a sensor shows its noise there, one that stays still shows nothing.
            marked = (should > needed) & (here <= floor)
            if marked.any():
                marked &= ~_often_still(track, size, here, floor)
        while marked.any() and (marked := marked & _all_of(~taken, size)).any():
            k = int(np.argmax(np.where(marked, should, 0.0)))
            # The samples about the middle of the stretch that stay at its level, and those beside it that do as well.
            off = np.abs(track.values - np.median(track.values[k : k + size]))
            is_still = off <= max(floor, STILL_BESIDE * float(should[k]))
            first, last = _around(is_still, k + int(np.argmin(off[k : k + size])))
            marked[max(0, first - size) : last] = False
            if last - first < min(size, max(FEWEST_STILL, track.size(STILL_S[0]))):
                continue
            error = _error_of_rest(track, first, last, apart, relatives, STILL * float(should[k]))
            if error is None:
                continue
            taken[max(0, first - apart) : last + apart] = True
            from_s = float(track.time_s[first]) - 0.5 * width_s
            to_s = float(track.time_s[last - 1]) + max(0.5 * width_s, track.step_s)
            beside_s = reach_s - 0.5 * track.step_s
            flaws.append(
                _Flaw(
                    shape="frozen",
                    time_s=from_s,
                    duration_s=to_s - from_s,
                    height=error,
                    share=float(should[k] / needed[k]),
                    hidden=(from_s - max(beside_s, 0.0), to_s + beside_s),
                )
            )
    return flaws


def _rests_beside(track: _Track, relatives: Sequence[_Expected], sizes: Sequence[int], floor: float) -> BoolArray:
    """Return (n,) the ticks of stretches of some sizes in which a channel rests though all others say that it moves."""
    rests = np.zeros(len(track.values), dtype=bool)
    for size in sizes if relatives else ():
        should, needed = _should_move(relatives, size, floor, track.quantum)
        for first, end in runs((travel(track.values, size) <= STILL * should) & (should > needed)):
            rests[first : end + size - 1] = True
    return rests


def _should_move(
    predictions: Sequence[_Expected], size: int, floor: float, quantum: float
) -> tuple[FloatArray, FloatArray]:
    """Return by stretch of `size` ticks how far a channel should move, and from how much on a still one is frozen.

    Parameters
    ----------
    floor : travel of a channel that rests; quantum : of the channel.
    """
    scatter = np.max([spread for _, spread, _ in predictions], axis=0)[size // 2 :]
    should = _least_travel(predictions, size)
    sure = MOVED if len(predictions) < FEWEST_WITNESSES else MOVED_BY_TWO
    return should, sure * np.maximum(scatter[: len(should)], floor) + quantum


def _least_travel(predictions: Sequence[_Expected], size: int) -> FloatArray:
    """Return by stretch of `size` ticks the least travel of several predictions, 0 where one is not known."""
    return np.asarray(np.min([travel(course, size) * _all_of(known, size) for course, _, known in predictions], axis=0))


def _often_still(track: _Track, size: int, here: FloatArray, floor: float) -> BoolArray:
    """Return by stretch whether the channel often rests half as long elsewhere, or the record does not tell."""
    rests = travel(track.values, max(2, size // 2)) <= floor
    count = np.concatenate([[0], np.cumsum(rests)])
    first = np.arange(len(here))
    low, high = np.maximum(first - size, 0), np.minimum(first + 2 * size, len(rests))
    others = len(rests) - (high - low)
    still = count[-1] - (count[high] - count[low])
    return np.asarray((still > RARELY * others) | (others < max(2 * size, track.size(KNOWN_S))))


def _error_of_rest(
    track: _Track, first: int, last: int, apart: int, relatives: Sequence[_Expected], alike: float
) -> float | None:
    """Return the largest error of a frozen reading; None where other channels do not agree with it before and after.

    Without other channels it is the step with which the reading moves on.
    """
    if not relatives:
        after = min(last + 2 * apart, len(track.values) - 1)
        return float(track.values[last - 1] - track.values[after])
    some = track.size(AGREES_S)
    beside = slice(max(0, first - apart - some), max(0, first - apart)), slice(last + apart, last + apart + some)
    errors = []
    for course, _, _ in relatives:
        error = track.values - course
        if not all(error[part].size and np.median(np.abs(error[part])) <= alike for part in beside):
            return None
        errors.append(error[first:last])
    return min((float(error[np.argmax(np.abs(error))]) for error in errors), key=abs)


def _all_of(marked: BoolArray, size: int) -> BoolArray:
    """Return (n - size + 1,) whether all `size` entries from each entry on are marked."""
    count = np.concatenate([[0], np.cumsum(marked)])
    return np.asarray(count[size:] - count[:-size] == size)


def _expected(
    track: _Track,
    other: _Track,
    is_calm: BoolArray,
    *,
    before: bool = True,
    after: bool = True,
    asked: BoolArray | None = None,
) -> _Expected:
    """Return the prediction of a channel from another, (n,), its scatter with noise, (n,), and where it is known, (n,).

    In blocks of `BLOCK_S`, by least squares with a trend over the block and `OUTSIDE_S` on either side.

    Parameters
    ----------
    is_calm : (n_other,) where the other channel has no large error.
    before, after : whether what lies before and after a block is used.
    asked : (n,) ticks whose blocks are predicted; None for all.
    """
    other_values = np.interp(track.time_s, other.time_s, other.values)
    known = np.interp(track.time_s, other.time_s, (other.known & is_calm).astype(np.float64)) > 0.99
    n, block, outside = len(other_values), track.size(BLOCK_S), track.size(OUTSIDE_S)
    course, spread = np.full(n, np.nan), np.full(n, np.inf)
    usable, starts = np.flatnonzero(known & track.known), np.arange(0, n, block)
    begin = np.searchsorted(usable, np.maximum(0, starts - before * outside))
    count = np.searchsorted(usable, np.minimum(n, starts + block + after * outside)) - begin
    is_asked = np.full(len(starts), True) if asked is None else np.logical_or.reduceat(asked, starts)
    enough = np.flatnonzero((count >= FEWEST_TICKS) & is_asked)
    for some in (enough[k : k + BLOCKS] for k in range(0, len(enough), BLOCKS)):
        stride = np.maximum(1, count[some] // MOST_ROWS)[:, None]
        k = begin[some, None] + stride * np.arange(int(np.max(-(-count[some] // stride[:, 0]))))
        is_row = k < (begin + count)[some, None]
        rows = usable[np.minimum(k, len(usable) - 1)]
        values, x = track.values[rows], other_values[rows]
        trend, level = (np.mean(of, axis=1, where=is_row) for of in (rows, x))
        columns = np.stack([np.ones(x.shape), rows - trend[:, None], x - level[:, None]], axis=2)
        factors = least_squares(columns, values, is_row)
        error = np.abs(values - _combined(columns, factors))
        usual = is_row & (error <= np.maximum(OUTLYING * _medians(error, is_row), track.quantum)[:, None])
        (rough,) = np.nonzero((usual != is_row).any(axis=1))
        factors[rough] = least_squares(columns[rough], values[rough], usual[rough])
        most = MOST_SLOPE * _slope(track, other, _medians(values, is_row), level)
        bounded = np.clip(factors[:, 2], np.minimum(most, 0.0), np.maximum(most, 0.0))
        (steep,) = np.nonzero(bounded != factors[:, 2])  # an error of the channel is taken for motion of the other
        factors[:, 2] = bounded
        left = values[steep] - bounded[steep, None] * columns[steep, :, 2]
        factors[steep, :2] = least_squares(columns[steep, :, :2], left, usual[steep])
        scatter = MAD * _medians(np.abs(values - _combined(columns, factors)), is_row)
        at = starts[some, None] + np.arange(block)
        inside, at = at < n, np.minimum(at, n - 1)
        wanted = np.stack([np.ones(at.shape), at - trend[:, None], other_values[at] - level[:, None]], axis=2)
        course[at[inside]] = _combined(wanted, factors)[inside]
        scatter = np.maximum(scatter, COARSE * np.abs(factors[:, 2]) * other.quantum)
        spread[at[inside]] = np.broadcast_to(scatter[:, None], at.shape)[inside]
    known &= np.isfinite(course)
    course = np.where(known, course, 0.0)
    # White noise makes the prediction travel by several of its standard deviations within seconds.
    second = np.abs(np.diff(course, 2, prepend=course[:1], append=course[-1:]))
    noise = MAD / np.sqrt(6.0) * running_median(second, track.size(1.0), NOISE_S)
    return course, spread + noise, known


def _slope(track: _Track, other: _Track, value: FloatArray, other_value: FloatArray) -> FloatArray:
    """Return by how much a channel changes with another, (n,) at values of both, (n,): an airspeed, or a height."""
    name, relative = track.channel.name, other.channel.name
    if name in IMPACT_SOURCES:
        power = {"q_impact": 2.0}
        share = power.get(name, 1.0) / power.get(relative, 1.0)
        return share * np.maximum(np.abs(value), TINY) / np.maximum(np.abs(other_value), TINY)
    pressure = value if name == "p_static" else other_value
    slopes = {"p_static": -np.maximum(np.abs(pressure), TINY) / SCALE_HEIGHT_M}
    return np.asarray(slopes.get(name, np.ones(len(value))) / slopes.get(relative, 1.0))


def _combined(columns: FloatArray, factors: FloatArray) -> FloatArray:
    """Return (n_blocks, n) sums of columns, (n_blocks, n, n_columns), times the factors of their block."""
    return np.asarray((columns @ factors[:, :, None])[:, :, 0])


def _medians(x: FloatArray, known: BoolArray) -> FloatArray:
    """Return (n_rows,) the median of the known values of every row of x, (n_rows, n); each has one or more."""
    ordered, count, row = np.sort(np.where(known, x, np.inf), axis=1), known.sum(axis=1), np.arange(len(x))
    return np.asarray(0.5 * (ordered[row, (count - 1) // 2] + ordered[row, count // 2]))


def _defects(flaws: Mapping[str, Sequence[_Flaw]], tracks: Mapping[str, _Track]) -> tuple[Defect, ...]:
    """Return the flaws joined by channel and shape, in order of their first time."""
    joined = []
    for name, every in flaws.items():
        for shape in ("dropout", "frozen", "spikes"):
            alike = sorted((flaw for flaw in every if flaw.shape == shape), key=lambda flaw: flaw.time_s)
            if not alike:
                continue
            joined.append(
                Defect(
                    channel=name,
                    unit=tracks[name].channel.unit,
                    shape=shape,
                    times_s=tuple(flaw.time_s for flaw in alike),
                    durations_s=tuple(flaw.duration_s for flaw in alike),
                    largest=max((flaw.height for flaw in alike), key=abs),
                    statistic=max(flaw.share for flaw in alike),
                    hidden=tuple(flaw.hidden for flaw in alike),
                )
            )
    return tuple(sorted(joined, key=lambda defect: defect.times_s[0]))
