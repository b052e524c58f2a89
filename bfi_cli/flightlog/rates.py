"""Signals of many rates on one time base.

The base is the clock of the airspeed, made uniform: its own mean rate, for it is the sensor in question and must not be
filtered. Faster signals are low-passed to it, slower ones are held, and nothing is bridged: where the base has a gap
there are no samples, where another signal has one it is NaN.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..kernels.decimation import WHITE, lowpass_taps
from .raw import LARGEST, RawColumn, RawLog
from .topics import Recorder, Topic, Track, tracks_of

FloatArray = NDArray[np.float64]

# Whose rate is that of the log, and what takes its place in a log without an airspeed.
BASES = ("tas", "cas", "ias", "pitch", "pitch_rate", "longitudinal_acc")
# Of a signal's typical step: a sample is missing from here on, as in `quality.GAP`.
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OneBase:
    """Columns of one length, the time axis first, and sentences on how they were made."""

    columns: tuple[RawColumn, ...]
    notes: tuple[str, ...]


def log_of_topics(
    path: str,
    recorder: Recorder,
    topics: Sequence[Topic],
    channel_map: Mapping[str, str],
    *,
    more: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> RawLog:
    """Return the log of a recorder whose messages have clocks of their own.

    Parameters
    ----------
    channel_map : of `read_log`; the source of its airspeed gives the time base.
    more : fields that are no channels, as `topic.field`, which are to be signals too.
    notes : sentences on the topics.

    Raises
    ------
    LogError : no signals, see `one_base`.
    """
    boots = sorted({int(k) for topic in topics if topic.boot is not None for k in np.unique(topic.boot)})
    if len(boots) > 1:
        parts = []
        for boot in boots:
            own = [one for topic in topics if (one := topic.of_boot(boot)).time_s.size > 1]
            # A boot of too few messages is no log; that it was there the numbers of the others tell.
            with contextlib.suppress(LogError):
                parts.append(log_of_topics(path, recorder, own, channel_map, more=more, notes=notes))
        if not parts:
            raise LogError(
                f"{path}: none of its {len(boots)} boots has channels; give a log that was recorded in flight"
            )
        return replace(parts[0], boots=tuple(parts))
    tracks = tracks_of(recorder, topics, more)
    if not tracks:
        has = ", ".join(topic.label for topic in topics) or "none"
        raise LogError(f"{path}: no channels in its messages ({has}); give a log that was recorded in flight")
    base = one_base(path, tracks, output=channel_map.get("tas"))
    # Stated as none, since one-quantum jumps between interpolated samples would look like those of a low-pass.
    return RawLog(columns=base.columns, filters=(), notes=(*notes, *base.notes))


def one_base(path: str, tracks: Sequence[Track], *, output: str | None = None) -> OneBase:
    """Return signals of different rates on one uniform time base.

    Parameters
    ----------
    tracks : of several for one channel the earlier ones are the better source.
    output : the source of the airspeed that gives the base; by default that of the fastest.

    Raises
    ------
    LogError : no signal has two samples in order of time, or none of the base's.
    """
    notes: list[str] = []
    usable = []
    for track in tracks:
        kept, why = in_order(track)
        if why:
            notes.append(why)
        if kept is not None:
            usable.append(kept)
    if not usable:
        raise LogError(f"{path}: no channels, got no signal of two samples; give a log that was recorded in flight")
    base = _base(usable, output)
    rate_hz = mean_rate(base.time_s)
    grid = _grid(path, base, rate_hz)
    span_s = float(grid[-1] - grid[0])
    edge_s = min(EDGE_S, EDGE_PART * span_s)
    first = max([grid[0], *(t.time_s[0] for t in usable if t.time_s[0] - grid[0] <= edge_s)])
    last = min([grid[-1], *(t.time_s[-1] + _patience(t) for t in usable if grid[-1] - t.time_s[-1] <= edge_s)])
    beside = BESIDE / rate_hz
    cut = grid[(grid >= first - beside) & (grid <= last + beside)]
    grid = cut if cut.size > 1 else grid
    ranked = sorted(usable, key=lambda t: (t is not base, mean_rate(t.time_s) < AS_FAST * rate_hz))
    if 8 * len(ranked) * grid.size > LARGEST:
        raise LogError(
            f"{path}: {len(ranked)} channels of {grid.size} samples need more than {LARGEST / 1e9:.0f} GB of memory; "
            "cut the log"
        )
    slow = [t for t in ranked if _is_held(t, rate_hz)]
    columns = [RawColumn(source="time", values=grid, unit="s", channel="time")]
    for track in ranked:
        columns.append(
            RawColumn(
                source=track.source,
                values=_held(track, grid) if track in slow else _filtered(track, grid, rate_hz),
                unit=track.unit,
                channel=track.channel,
                rate_hz=mean_rate(track.time_s),
            )
        )
    notes.append(
        f"the signals have clocks of their own; all are brought to {rate_hz:.4g} Hz, the mean rate of '{base.source}', "
        "faster ones through a low-pass"
    )
    notes += _about(base, ranked, slow, grid)
    return OneBase(columns=tuple(columns), notes=tuple(notes))


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

    The second value is a sentence where a signal is left out or mended.
    """
    good = np.isfinite(track.values) & np.isfinite(track.time_s)
    time_s, values = track.time_s[good], track.values[good]
    if time_s.size < 2:
        return None, f"'{track.source}' has {time_s.size} samples that are numbers and is left out"
    n_back = int(np.count_nonzero(np.diff(time_s) <= 0.0))
    if n_back > max(2.0, MENDED * time_s.size):
        return None, f"'{track.source}' has a clock that runs backwards {n_back} times and is left out"
    kept = _longest_in_order(time_s) if n_back else np.arange(time_s.size)
    dropped = time_s.size - kept.size
    time_s, values = time_s[kept], values[kept]
    if time_s.size < 2:
        return None, f"'{track.source}' has no two samples in order of time and is left out"
    note = f"'{track.source}' has {dropped} samples out of order of time, which are left out" if dropped else None
    return replace(track, time_s=time_s, values=values), note


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


def _base(tracks: Sequence[Track], output: str | None) -> Track:
    chosen = next((track for track in tracks if track.source == output), None)
    if chosen is not None:
        return chosen
    for name in BASES:
        of_name = [track for track in tracks if track.channel == name]
        if of_name:
            fastest = max(mean_rate(track.time_s) for track in of_name)
            return next(track for track in of_name if mean_rate(track.time_s) >= AS_FAST * fastest)
    return max(tracks, key=lambda track: mean_rate(track.time_s))


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


def _is_held(track: Track, rate_hz: float) -> bool:
    return track.is_state or mean_rate(track.time_s) < AS_FAST * rate_hz


def _held(track: Track, grid: FloatArray) -> FloatArray:
    """Return the last value at or before each time, NaN before the first and in gaps."""
    before = np.searchsorted(track.time_s, grid, side="right") - 1
    late = grid - track.time_s[before.clip(0)] > _patience(track)
    return np.where((before < 0) | late, np.nan, track.values[before.clip(0)])


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
    step = np.diff(base.time_s)
    usual = step[step <= _patience(base)]
    jitter = float(np.max(np.abs(usual * mean_rate(base.time_s) - 1.0), initial=0.0))
    if jitter > JITTER:
        yield f"the steps of '{base.source}' are off by up to {100.0 * jitter:.0f} % and were made uniform"
    if slow:
        named = ", ".join(f"{_name(t, ranked)} ({mean_rate(t.time_s):.3g} Hz)" for t in slow)
        yield f"held between values of their own: {named}"
    late = [t for t in ranked if t.time_s[0] > grid[0] + _patience(t)]
    early = [t for t in ranked if t.time_s[-1] < grid[-1] - _patience(t)]
    for words, tracks, which in (("starts later than the log", late, 0), ("ends before the log", early, -1)):
        if tracks:
            named = ", ".join(f"{_name(t, ranked)} ({t.time_s[which]:.6g} s)" for t in tracks)
            yield f"what {words} is missing there: {named}"
    offset_s = float(grid[0] - min(t.time_s[0] for t in ranked))
    if offset_s > 2.0 / mean_rate(base.time_s):
        yield f"the log starts at {grid[0]:.6g} s, {offset_s:.3g} s after its first signal, when all are there"


def _name(track: Track, ranked: Sequence[Track]) -> str:
    """Return the name that a signal will have in the log: that of its channel where no better source claims it."""
    first = next(one for one in ranked if one.channel == track.channel)
    return track.channel if track.channel is not None and first is track else track.source
