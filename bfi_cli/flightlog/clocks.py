"""Several time axes in one table, and the axis on which each channel was sampled.

The axis named `time` is the log's. Further axes carry a tag (`time_adc`, `t_ins`), and so do their channels (`cas_adc`,
`adc_cas`); a channel without a tag belongs to the axis that alone has its number of samples.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..errors import LogError
from ..notes import Note
from ..quantities.channels import match_name
from ..quantities.units import si_unit, to_si
from .rates import one_base
from .raw import BY_RANK, Asked, FloatArray, RawLog, Track, claimed, time_column

WORDS = frozenset({"t", "time", "timestamp", "times"})
# Share of a step by which two axes of one length may differ and still be the same axis.
ALIKE = 0.01
# Share of the shorter of two axes that the longer must cover: a clock with another zero is no time axis of the log.
SHARED = 0.5


def on_one_clock(path: str, raw: RawLog, asked: Asked) -> RawLog:
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


def _by_axes(path: str, raw: RawLog, asked: Asked) -> RawLog | None:
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
    if times.size == main.size and np.nanmax(np.abs(times - main)) <= ALIKE * np.median(np.diff(known)):
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
