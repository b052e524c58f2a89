"""Signals of many rates on one time base.

The base is a uniform grid at the mean rate of the airspeed, so that the sensor under test is not filtered. Faster
signals are low-passed to that rate, slower signals are held. Gaps stay: a gap of the airspeed is one of the log, and
any other signal is NaN in its gaps.

Of several time axes in one table the one named `time` is the log's. Further axes carry a tag (`time_adc`, `t_ins`), and
so do their channels (`cas_adc`, `adc_cas`); a channel without a tag belongs to the axis that alone has its number of
samples.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..errors import LogError
from ..kernels.low_pass import WHITE, lowpass_taps
from ..kernels.quantisation import find_quantum
from ..kernels.regular_clock import regular_times
from ..notes import Note
from ..quantities.channels import match_name, si_unit, to_si
from ..quantities.text import instant
from .axis import MENDED, longest_in_order
from .raw import BY_RANK, FLAGS, FloatArray, RawLog, ReadRequest, claimed, require_memory, time_column
from .record import Track

# The first of these channels in the log gives the time base.
BASES = ("tas", "cas", "ias", "pitch", "pitch_rate", "longitudinal_acc")
# A step of more than so many typical steps is a gap: one missing sample makes it two.
GAP = 1.75
# A clock is regular if this share of its steps lies within this share of their median; the mean of those steps gives
# the rate, free of gaps and of half steps.
NEARLY_ALL, ALIKE = 0.9, 0.1
# Steps of an irregular clock beyond so many means are gaps if they are at most this share of all steps; messages that
# arrive in bursts have more of them.
LONG, FEW = 4.0, 0.02
# The typical step of a clock that jitters is the larger of the mean and this quantile, so that its longest steps are no
# gaps.
TYPICAL = 0.95
# A signal with this share of the base's rate or more is as fast as the base: clocks of one nominal rate differ by less.
AS_FAST = 0.9
# A signal that starts late or ends early by up to so many seconds, and this share of the base's length, shortens the
# log; beyond that it is NaN there. Topics of a recorder start within a second or two.
EDGE_S, EDGE_PART = 5.0, 0.05
# Shares of a step: jitter of the clock that a note reports, and distance of a sample from a point of the grid that
# counts as its time.
JITTER, BESIDE = 0.02, 0.05
# Rows filtered at once, for memory.
BLOCK = 50_000


def one_base(path: str, tracks: Sequence[Track], *, output: str | None = None, notes: Sequence[Note] = ()) -> RawLog:
    """Return the log of signals of different rates, on one uniform time base.

    Parameters
    ----------
    tracks : signals; of several sources of a channel the preferred comes first.
    output : the source of the airspeed that gives the base; by default the fastest airspeed.
    notes : on the file, put before those on the time base.

    Raises
    ------
    LogError : no signal has two samples in order of time, or the base has none without a gap.
    """
    mended = [in_order(track) for track in tracks]
    usable = [track for track, _ in mended if track is not None]
    if not usable:
        raise LogError(f"{path}: no channels, got no signal of two samples; give a log that was recorded in flight")
    rates = {track: mean_rate(track.time_s) for track in usable}
    base = next((track for track in usable if track.source == output), None)
    for name in BASES if base is None else ():
        if candidates := [track for track in usable if track.channel == name]:
            fastest = max(rates[track] for track in candidates)
            base = next(track for track in candidates if rates[track] >= AS_FAST * fastest)
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
    time = Track(source="time", values=grid, unit="s", channel="time", epoch=base.epoch)
    columns = [replace(time, why=f"at the mean rate of '{base.source}'")]
    slow = [t for t in ranked if t.channel in FLAGS or rates[t] < AS_FAST * rate_hz]
    for t in ranked:
        step = None
        if t in slow:  # the last value at or before each time, NaN before the first and in gaps
            before = np.searchsorted(t.time_s, grid, side="right") - 1
            late = grid - t.time_s[before.clip(0)] > _patience(t)
            values = np.where((before < 0) | late, np.nan, t.values[before.clip(0)])
        else:
            values, step = _filtered(t, grid, rate_hz), find_quantum(t.values)
        columns.append(replace(t, values=values, time_s=np.empty(0), rate_hz=rates[t], step=step))
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
    # `filters=()`, not None: jumps of one quantum between interpolated samples would be taken for those of a low-pass.
    return RawLog(columns=columns, filters=(), notes=(*notes, *map(Note.method, sentences)))


def mean_rate(time_s: FloatArray) -> float:
    """Return samples per second, gaps left out, and of a regular clock all odd steps too."""
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
    """Return a signal without samples that are no number or out of order of time, None where fewer than two are left.

    The second value says why the signal is left out or how it was mended, None where nothing was.
    """
    good = np.isfinite(track.values) & np.isfinite(track.time_s)
    time_s, values = track.time_s[good], track.values[good]
    if time_s.size < 2:
        return None, f"left out with {time_s.size} samples that are numbers"
    n_back = int(np.count_nonzero(np.diff(time_s) <= 0.0))
    if n_back > max(2.0, MENDED * time_s.size) and (regular := regular_times(time_s)) is not None:
        time_s, n_back = regular.time_s, 0
    if n_back > max(2.0, MENDED * time_s.size):
        return None, f"left out, as the clock runs backwards {n_back} times"
    if not n_back:
        return replace(track, time_s=time_s, values=values), None
    kept = longest_in_order(time_s)
    if kept.size < 2:
        return None, "left out, as no two samples are in order of time"
    note = f"samples out of order of time are left out, {time_s.size - kept.size} of them"
    return replace(track, time_s=time_s[kept], values=values[kept]), note


def _patience(track: Track) -> float:
    """Return the longest step, s, that is not yet a gap of a signal."""
    return GAP * max(1.0 / mean_rate(track.time_s), float(np.quantile(np.diff(track.time_s), TYPICAL)))


def _grid(path: str, base: Track, rate_hz: float) -> FloatArray:
    """Return a uniform grid through the samples of the base, without the points in its gaps."""
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
    """Return a signal on the grid, through the low-pass of a decimation to the rate of the grid; NaN in gaps.

    The signal is interpolated linearly. At its ends and beside gaps the weights of the known samples are scaled to 1.
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
        for side in (slice(half, None), slice(half, None, -1)):  # samples beyond a gap have no weight
            known[:, side] = np.logical_and.accumulate(known[:, side], axis=1)
        weights = np.where(known, taps, 0.0)
        with np.errstate(invalid="ignore"):
            out[rows] = (weights * np.interp(at, time_s, values)).sum(axis=1) / weights.sum(axis=1)
        out[rows][~known[:, half]] = np.nan
    return out if turn is None else (out + 0.5 * turn) % turn - 0.5 * turn


def _about(base: Track, ranked: Sequence[Track], slow: Sequence[Track], grid: FloatArray) -> Iterator[str]:
    """Yield sentences on held signals, start offsets and jitter."""

    def named(tracks: Sequence[Track], what: Callable[[Track], str]) -> str:
        """List signals by their names in the log: the channel's, or the file's where another source is the channel."""
        best = {next(track for track in ranked if track.channel == t.channel) for t in ranked if t.channel is not None}
        return ", ".join(f"{t.channel if t in best else t.source} ({what(t)})" for t in tracks)

    step = np.diff(base.time_s)
    usual = step[step <= _patience(base)]
    jitter = float(np.max(np.abs(usual * mean_rate(base.time_s) - 1.0), initial=0.0))
    if jitter > JITTER:
        yield f"the steps of '{base.source}' are off by up to {100.0 * jitter:.0f} % and were made uniform"
    if slow:
        yield f"held between their samples: {named(slow, lambda t: f'{mean_rate(t.time_s):.3g} Hz')}"
    if late := [t for t in ranked if t.time_s[0] > grid[0] + _patience(t)]:
        yield f"missing at the start of the log, until: {named(late, lambda t: f'{instant(t.time_s[0])} s')}"
    if early := [t for t in ranked if t.time_s[-1] < grid[-1] - _patience(t)]:
        yield f"missing at the end of the log, from: {named(early, lambda t: f'{instant(t.time_s[-1])} s')}"
    offset_s = float(grid[0] - min(t.time_s[0] for t in ranked))
    if offset_s > 2.0 / mean_rate(base.time_s):
        yield f"the log starts at {instant(grid[0])} s, {offset_s:.3g} s after its first signal, when all are there"


WORDS = frozenset({"t", "time", "timestamp", "times"})
# Share of a step by which two axes of one length may differ and still be the same axis.
SAME_NUMBER = 0.01
# Share of the shorter of two axes that the longer must cover: a clock with another zero is no time axis of the log.
SHARED = 0.5


def on_one_clock(path: str, raw: RawLog, asked: ReadRequest) -> RawLog:
    """Return a log whose signals have separate clocks, or lie on several time axes, on one time base.

    Raises
    ------
    LogError : several axes have the length of a channel, and its name tells none of them; see `one_base`.
    """
    if not any(track.time_s.size for track in raw.columns):
        by_axes = _by_axes(path, raw, asked)
        if by_axes is None:
            return raw
        raw = by_axes
    merged = one_base(path, claimed(raw.columns, asked), output=asked.channel_map.get("tas"), notes=raw.notes)
    return replace(raw, columns=merged.columns, filters=(), notes=merged.notes)


def _by_axes(path: str, raw: RawLog, asked: ReadRequest) -> RawLog | None:
    """Return the log with the times of its axis in each channel, None where all channels lie on one axis."""
    main = time_column(raw.columns, asked)
    seconds = None if main is None or main.read is not None else _seconds(path, main.source, main)
    if main is None or seconds is None:
        return None
    further = {
        track.source: times
        for track in raw.columns
        if track.source != main.source and _words(track.source) & WORDS and track.source not in asked.sources
        if (times := _seconds(path, track.source, track, main.unit)) is not None and _is_clock(times, seconds)
    }
    clocks = {main.source: seconds, **further}
    clock_of = {track.source: _clock_of(path, track, clocks) for track in raw.columns if track.source not in clocks}
    if not set(clock_of.values()) & further.keys():
        return None
    tracks = []
    for track in raw.columns:
        if (clock := clock_of.get(track.source)) is not None:
            tag = re.escape(_tag(clock))
            known = match_name(track.source) or match_name(re.sub(rf"^{tag}_|_{tag}$", "", track.source))
            unit = track.unit or (known.unit if known else None)
            channel = known.name if known else track.channel
            why = BY_RANK[known.rank] if known else track.why
            here = replace(track, time_s=clocks[clock], epoch=main.epoch)
            tracks.append(replace(here, unit=unit, channel=channel, why=why))
    by_clock = [f"{', '.join(repr(s) for s, c in clock_of.items() if c == clock)} by '{clock}'" for clock in further]
    note = Note.method(f"several time axes: {'; '.join(by_clock)}, the others by '{main.source}'")
    left_out = {name: "has the samples of no time axis" for name, clock in clock_of.items() if clock is None}
    return replace(raw, columns=tracks, notes=(*raw.notes, note), left_out={**raw.left_out, **left_out})


def _words(name: str) -> set[str]:
    return set(re.split(r"[\W_]+", name.lower()))


def _tag(clock: str) -> str:
    """Return the name of a time axis without the word for time: "adc" of `time_adc`."""
    return "_".join(word for word in re.split(r"[\W_]+", clock) if word and word.lower() not in WORDS)


def _seconds(path: str, name: str, track: Track, unit: str | None = None) -> FloatArray | None:
    stated = track.unit or unit or "s"
    return to_si(track.values, stated, where=f"{path}: '{name}'")[0] if si_unit(stated) == "s" else None


def _is_clock(times: FloatArray, main: FloatArray) -> bool:
    """Say whether an axis increases, overlaps the main axis and differs from it."""
    known = times[np.isfinite(times)]
    if known.size < 2 or np.any(np.diff(known) <= 0.0):
        return False
    if times.size == main.size and np.nanmax(np.abs(times - main)) <= SAME_NUMBER * np.median(np.diff(known)):
        return False
    shared = min(known[-1], np.nanmax(main)) - max(known[0], np.nanmin(main))
    return bool(shared > SHARED * min(known[-1] - known[0], np.nanmax(main) - np.nanmin(main)))


def _clock_of(path: str, track: Track, clocks: Mapping[str, FloatArray]) -> str | None:
    """Return the name of a channel's time axis, None where none of `clocks`, main axis first, has its length."""
    alike = [name for name, times in clocks.items() if times.size == track.values.size]
    tagged = [name for name in alike if (tag := _tag(name).lower()) and tag in _words(track.source)]
    if len(tagged) == 1 or len(alike) <= 1:
        return next(iter(tagged or alike), None)
    main = next(iter(clocks))
    if main in alike:
        return main
    name = track.source
    raise LogError(
        f"{path}: '{name}' has as many samples as {' and '.join(map(repr, alike))}, and its name tells neither; "
        f"name it {name}_{_tag(alike[0])} or {name}_{_tag(alike[1])}, or make one of them the log's with "
        f"--channel time={alike[0]}"
    )
