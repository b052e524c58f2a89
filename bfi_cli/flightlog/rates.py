"""Signals of many rates on one time base.

The base is the clock of the airspeed, made uniform: its own mean rate, for it is the sensor in question and must not be
filtered. Faster signals are low-passed to it, slower ones are held, and nothing is bridged: where the base has a gap
there are no samples, where another signal has one it is NaN.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..kernels.decimation import WHITE, lowpass_taps
from ..notes import Note
from .raw import FLAGS, FloatArray, RawLog, Track, require_memory

# Whose rate is that of the log, and what takes its place in a log without an airspeed.
BASES = ("tas", "cas", "ias", "pitch", "pitch_rate", "longitudinal_acc")
# Of a signal's typical step, between one and two: a sample is missing from here on.
GAP = 1.75
# Steps of a regular clock: this part of them within this part of their median; their mean is the rate, and not that of
# the two half steps, or the gaps, that the log has besides.
NEARLY_ALL, ALIKE = 0.9, 0.1
# Of an irregular clock: steps of so many means are gaps if they are few, this part of all; messages that come in bursts
# have many.
LONG, FEW = 4.0, 0.02
# The longest steps of a clock that jitters are not gaps: its typical step is the larger of the mean and this quantile.
TYPICAL = 0.95
# A signal of this part of the base's rate is as fast as it: clocks of one nominal rate differ by less.
AS_FAST = 0.9
# A signal that starts or ends so much later or earlier than the base shortens the log, one more than that is missing
# there: seconds, and part of the base's length. Topics of a recorder start within a second or two.
EDGE_S, EDGE_PART = 5.0, 0.05
# Of a step, by which a recorder's clock may wander before it is said, and by which the first sample of the base may
# lie beside its grid.
JITTER, BESIDE = 0.02, 0.05
# Steps backwards, of all, that are mended by leaving a sample out; more are a broken clock.
MENDED = 0.01
# A clock starts again where it jumps back by more than so many seconds and typical steps, from samples that are all in
# order to others that are: the medians of so many on both sides tell it from single times that are wrong. A clock that
# is set by a satellite jumps back by less. With more jumps than so many the times are in no order at all.
RESTART_S, RESTART_STEPS, BESIDE_RESTART, MOST_BOOTS = 2.0, 10.0, 5, 100
# Rows filtered at once, for memory.
BLOCK = 50_000


def one_base(path: str, tracks: Sequence[Track], *, output: str | None = None, notes: Sequence[Note] = ()) -> RawLog:
    """Return the log of signals of different rates, on one uniform time base.

    Parameters
    ----------
    tracks : of several for one channel the earlier ones are the better source.
    output : the source of the airspeed that gives the base; by default that of the fastest.
    notes : sentences on the file.

    Raises
    ------
    LogError : no signal has two samples in order of time, or none of the base's.
    """
    mended = [in_order(track) for track in tracks]
    usable = [track for track, _ in mended if track is not None]
    if not usable:
        raise LogError(f"{path}: no channels, got no signal of two samples; give a log that was recorded in flight")
    rates = {track: mean_rate(track.time_s) for track in usable}
    base = next((track for track in usable if track.source == output), None)
    for name in BASES if base is None else ():
        if of_name := [track for track in usable if track.channel == name]:
            fastest = max(rates[track] for track in of_name)
            base = next(track for track in of_name if rates[track] >= AS_FAST * fastest)
            break
    base = base or max(usable, key=lambda track: rates[track])
    rate_hz = rates[base]
    grid = _grid(path, base, rate_hz)
    edge_s = min(EDGE_S, EDGE_PART * float(grid[-1] - grid[0]))
    first = max([grid[0], *(t.time_s[0] for t in usable if t.time_s[0] - grid[0] <= edge_s)])
    last = min([grid[-1], *(t.time_s[-1] + _patience(t) for t in usable if grid[-1] - t.time_s[-1] <= edge_s)])
    beside = BESIDE / rate_hz
    cut = grid[(grid >= first - beside) & (grid <= last + beside)]
    grid = cut if cut.size > 1 else grid
    ranked = sorted(usable, key=lambda t: (t is not base, rates[t] < AS_FAST * rate_hz))
    size = 8 * len(ranked) * grid.size
    require_memory(path, size, f"{len(ranked)} channels of {grid.size} samples", "cut the log")
    columns = [Track(source="time", values=grid, unit="s", channel="time")]
    slow = [t for t in ranked if t.channel in FLAGS or rates[t] < AS_FAST * rate_hz]
    for t in ranked:
        if t in slow:  # the last value at or before each time, NaN before the first and in gaps
            before = np.searchsorted(t.time_s, grid, side="right") - 1
            late = grid - t.time_s[before.clip(0)] > _patience(t)
            values = np.where((before < 0) | late, np.nan, t.values[before.clip(0)])
        else:
            values = _filtered(t, grid, rate_hz)
        columns.append(replace(t, values=values, time_s=np.empty(0), rate_hz=rates[t]))
    reasons: dict[str, list[str]] = {}
    for track, (_, why) in zip(tracks, mended, strict=True):
        if why is not None:
            reasons.setdefault(why, []).append(f"'{track.source}'")
    sentences = (
        *(f"{', '.join(names)}: {why}" for why, names in reasons.items()),
        f"the signals have clocks of their own; all are brought to {rate_hz:.4g} Hz, the mean rate of '{base.source}', "
        "faster ones through a low-pass",
        *_about(base, ranked, slow, grid),
    )
    # No filters, stated as such: one-quantum jumps between interpolated samples would look like those of a low-pass.
    return RawLog(columns=columns, filters=(), notes=(*notes, *map(Note.method, sentences)))


def boot_starts(time_s: FloatArray) -> list[int]:
    """Return the samples at which a clock starts again, the first sample of all among them."""
    step = np.diff(time_s)
    forward = step[step > 0.0]
    least = max(RESTART_S, RESTART_STEPS * float(np.median(forward))) if forward.size else RESTART_S
    starts = [0]
    for k in (np.flatnonzero(step < -least) + 1).tolist():
        before = np.sort(time_s[max(starts[-1], k - BESIDE_RESTART) : k])
        after = np.sort(time_s[k : k + BESIDE_RESTART])
        middle = BESIDE_RESTART // 2
        if min(before.size, after.size) == BESIDE_RESTART and before[middle] - after[middle] > least:
            starts.append(k)
    return starts if len(starts) <= MOST_BOOTS else [0]


def mean_rate(time_s: FloatArray) -> float:
    """Return samples per second, without the gaps, and without odd steps where nearly all are alike."""
    step = np.diff(time_s)
    median = float(np.median(step))
    alike = step[np.abs(step - median) <= ALIKE * median]
    if alike.size >= NEARLY_ALL * step.size:
        return 1.0 / float(np.mean(alike))
    at_most = max(3, int(FEW * step.size))
    while True:
        period = float(np.mean(step))
        usual = step[step <= LONG * period]
        if usual.size == step.size or step.size - usual.size > at_most:
            return 1.0 / period
        step = usual


def in_order(track: Track) -> tuple[Track | None, str | None]:
    """Return a signal without samples that are no number or out of order, None where less than two are left.

    The second value is why a signal is left out, or how it is mended.
    """
    good = np.isfinite(track.values) & np.isfinite(track.time_s)
    time_s, values = track.time_s[good], track.values[good]
    if time_s.size < 2:
        return None, f"left out with {time_s.size} samples that are numbers"
    n_back = int(np.count_nonzero(np.diff(time_s) <= 0.0))
    if n_back > max(2.0, MENDED * time_s.size):
        return None, f"left out, as the clock runs backwards {n_back} times"
    if not n_back:
        return replace(track, time_s=time_s, values=values), None
    kept = _longest_in_order(time_s)
    if kept.size < 2:
        return None, "left out, as no two samples are in order of time"
    note = f"samples out of order of time are left out, {time_s.size - kept.size} of them"
    return replace(track, time_s=time_s[kept], values=values[kept]), note


def _longest_in_order(time_s: FloatArray) -> NDArray[np.intp]:
    """Return the most samples whose times increase: the longest increasing subsequence, by patience sorting."""
    tops: list[float] = []  # the least time with which so many samples can end
    at: list[int] = []
    before = np.empty(time_s.size, dtype=np.intp)
    for k, time in enumerate(time_s.tolist()):
        place = len(tops) if not tops or time > tops[-1] else bisect_left(tops, time)
        before[k] = at[place - 1] if place else -1
        if place == len(tops):
            tops.append(time)
            at.append(k)
        else:
            tops[place], at[place] = time, k
    kept = np.empty(len(tops), dtype=np.intp)
    k = at[-1]
    for place in range(len(tops) - 1, -1, -1):
        kept[place] = k
        k = int(before[k])
    return kept


def _patience(track: Track) -> float:
    """Return the longest step of a signal, s, that is no gap."""
    return GAP * max(1.0 / mean_rate(track.time_s), float(np.quantile(np.diff(track.time_s), TYPICAL)))


def _grid(path: str, base: Track, rate_hz: float) -> FloatArray:
    """Return the times of the base: a uniform grid through its samples, without those in its gaps."""
    time_s = base.time_s
    step = np.diff(time_s)
    ends = np.flatnonzero(step > _patience(base))
    starts, stops = np.r_[0, ends + 1], np.r_[ends, time_s.size - 1]
    longest = int(np.argmax(stops - starts))
    piece = time_s[starts[longest] : stops[longest] + 1]
    # The grid's phase is that of most samples: their median distance from it vanishes.
    period = 1.0 / rate_hz
    beside = (piece - piece[0]) / period
    start = piece[0] + period * float(np.median((beside + 0.5) % 1.0 - 0.5))
    rows = []
    for begin, end in zip(time_s[starts], time_s[stops], strict=True):
        k = np.arange(np.ceil((begin - start) / period - BESIDE), np.floor((end - start) / period + BESIDE) + 1)
        rows.append(start + k * period)
    grid = np.unique(np.concatenate(rows))
    if grid.size < 2:
        raise LogError(f"{path}: '{base.source}' has no two samples without a gap; give a longer log")
    return np.asarray(grid)


def _filtered(track: Track, grid: FloatArray, rate_hz: float) -> FloatArray:
    """Return a signal on the grid through the low-pass of a decimation to its rate, NaN in gaps.

    Between its samples the signal is interpolated linearly; at its ends and beside gaps the filter takes what it has.
    """
    turn = track.turn
    time_s, values = track.time_s, track.values if turn is None else np.unwrap(track.values, period=turn)
    factor = max(1, round(mean_rate(time_s) / rate_hz))
    taps = lowpass_taps(factor, WHITE)
    half = taps.size // 2
    offsets = np.arange(-half, half + 1) / (factor * rate_hz)
    is_gap, beside = np.diff(time_s) > _patience(track), BESIDE / rate_hz
    out = np.empty(grid.size)
    for begin in range(0, grid.size, max(1, BLOCK // taps.size)):
        rows = slice(begin, begin + max(1, BLOCK // taps.size))
        at = grid[rows, None] + offsets
        interval = (np.searchsorted(time_s, at, side="right") - 1).clip(0, time_s.size - 2)
        before, after = time_s[interval], time_s[interval + 1]
        # Times of the base lie a little beside its samples: at the edge of a gap they are those of the sample.
        at = np.where(is_gap[interval] & (at <= before + beside), before, at)
        at = np.where(is_gap[interval] & (at >= after - beside), after, at)
        inside = (at >= time_s[0] - beside) & (at <= time_s[-1] + beside)
        known = inside & (~is_gap[interval] | (at == before) | (at == after))
        for side in (slice(half, None), slice(half, None, -1)):  # what lies beyond a gap does not count
            known[:, side] = np.logical_and.accumulate(known[:, side], axis=1)
        weights = np.where(known, taps, 0.0)
        with np.errstate(invalid="ignore"):
            out[rows] = (weights * np.interp(at, time_s, values)).sum(axis=1) / weights.sum(axis=1)
        out[rows][~known[:, half]] = np.nan
    return out if turn is None else (out + 0.5 * turn) % turn - 0.5 * turn


def _about(base: Track, ranked: Sequence[Track], slow: Sequence[Track], grid: FloatArray) -> Iterator[str]:
    """Yield sentences on held signals, start offsets and jitter."""

    def named(tracks: Sequence[Track], what: Callable[[Track], str]) -> str:
        """List signals by the name that each will have in the log: its channel's where no better source claims it."""
        best = {next(one for one in ranked if one.channel == t.channel) for t in ranked if t.channel is not None}
        return ", ".join(f"{t.channel if t in best else t.source} ({what(t)})" for t in tracks)

    step = np.diff(base.time_s)
    usual = step[step <= _patience(base)]
    jitter = float(np.max(np.abs(usual * mean_rate(base.time_s) - 1.0), initial=0.0))
    if jitter > JITTER:
        yield f"the steps of '{base.source}' are off by up to {100.0 * jitter:.0f} % and were made uniform"
    if slow:
        yield f"held between their samples: {named(slow, lambda t: f'{mean_rate(t.time_s):.3g} Hz')}"
    if late := [t for t in ranked if t.time_s[0] > grid[0] + _patience(t)]:
        yield f"missing at the start of the log, until: {named(late, lambda t: f'{t.time_s[0]:.6g} s')}"
    if early := [t for t in ranked if t.time_s[-1] < grid[-1] - _patience(t)]:
        yield f"missing at the end of the log, from: {named(early, lambda t: f'{t.time_s[-1]:.6g} s')}"
    offset_s = float(grid[0] - min(t.time_s[0] for t in ranked))
    if offset_s > 2.0 / mean_rate(base.time_s):
        yield f"the log starts at {grid[0]:.6g} s, {offset_s:.3g} s after its first signal, when all are there"
