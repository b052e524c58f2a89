"""Several time axes in one table: which channel goes by which.

The one that is `time` is the log's. A further one is named after it (`time_adc`, `t_ins`); its channels have that name
too (`cas_adc`, `adc_cas`), or its number of samples where no other axis has it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..channels import match_name
from ..errors import LogError
from ..notes import Note
from ..units import si_unit, to_si
from .rates import one_base
from .raw import Asked, FloatArray, RawLog, Track, claimed, time_column

WORDS = frozenset({"t", "time", "timestamp", "times"})
# Of a step, by which two axes of one length are the same.
ALIKE = 0.01
# Of the shorter of two axes, which the other has to cover: clocks that count from elsewhere are no time of the log.
SHARED = 0.5


def on_one_clock(path: str, raw: RawLog, asked: Asked) -> RawLog:
    """Return a log whose signals have clocks of their own, or go by several time axes, on one time base.

    Raises
    ------
    LogError : the name of none of several axes of one length tells which is a channel's; see `one_base`.
    """
    if not any(one.time_s.size for one in raw.columns):
        by_axes = _by_axes(path, raw, asked)
        if by_axes is None:
            return raw
        raw = by_axes
    merged = one_base(path, claimed(raw.columns, asked), output=asked.channel_map.get("tas"), notes=raw.notes)
    return replace(raw, columns=merged.columns, filters=(), notes=merged.notes)


def _by_axes(path: str, raw: RawLog, asked: Asked) -> RawLog | None:
    """Return the log with each channel on the time axis that it goes by, None where all go by one."""
    main = time_column(raw.columns, asked)
    seconds = None if main is None or main.read is not None else _seconds(path, main.source, main)
    if main is None or seconds is None:
        return None
    further = {
        one.source: times
        for one in raw.columns
        if one.source != main.source and _words(one.source) & WORDS and one.source not in asked.sources
        if (times := _seconds(path, one.source, one, main.unit)) is not None and _is_clock(times, seconds)
    }
    clocks = {main.source: seconds, **further}
    clock_of = {one.source: _clock_of(path, one, clocks) for one in raw.columns if one.source not in clocks}
    if not set(clock_of.values()) & further.keys():
        return None
    tracks = []
    for one in raw.columns:
        if (clock := clock_of.get(one.source)) is not None:
            tag = re.escape(_tag(clock))
            known = match_name(one.source) or match_name(re.sub(rf"^{tag}_|_{tag}$", "", one.source))
            unit = one.unit or (known.unit if known else None)
            channel = known.name if known else one.channel
            tracks.append(replace(one, time_s=clocks[clock], unit=unit, channel=channel))
    said = [f"{', '.join(repr(s) for s, c in clock_of.items() if c == clock)} by '{clock}'" for clock in further]
    note = Note.method(f"several time axes: {'; '.join(said)}, the others by '{main.source}'")
    strangers = {name: "has the samples of no time axis" for name, clock in clock_of.items() if clock is None}
    return replace(raw, columns=tracks, notes=(*raw.notes, note), left_out={**raw.left_out, **strangers})


def _words(name: str) -> set[str]:
    return set(re.split(r"[\W_]+", name.lower()))


def _tag(clock: str) -> str:
    """Return what the name of a time axis has beside the word for time: "adc" of `time_adc`."""
    return "_".join(word for word in re.split(r"[\W_]+", clock) if word and word.lower() not in WORDS)


def _seconds(path: str, name: str, track: Track, unit: str | None = None) -> FloatArray | None:
    stated = track.unit or unit or "s"
    return to_si(track.values, stated, where=f"{path}: '{name}'")[0] if si_unit(stated) == "s" else None


def _is_clock(times: FloatArray, main: FloatArray) -> bool:
    """Say whether an axis runs forwards beside the main one and is not that one again."""
    known = times[np.isfinite(times)]
    if known.size < 2 or np.any(np.diff(known) <= 0.0):
        return False
    if times.size == main.size and np.nanmax(np.abs(times - main)) <= ALIKE * np.median(np.diff(known)):
        return False
    shared = min(known[-1], np.nanmax(main)) - max(known[0], np.nanmin(main))
    return bool(shared > SHARED * min(known[-1] - known[0], np.nanmax(main) - np.nanmin(main)))


def _clock_of(path: str, one: Track, clocks: Mapping[str, FloatArray]) -> str | None:
    """Return the time axis of a channel, None where none has its number of samples.

    The main axis is the first of them.
    """
    alike = [name for name, times in clocks.items() if times.size == one.values.size]
    tagged = [name for name in alike if (tag := _tag(name).lower()) and tag in _words(one.source)]
    if len(tagged) == 1 or len(alike) <= 1:
        return next(iter(tagged or alike), None)
    main = next(iter(clocks))
    if main in alike:
        return main
    raise LogError(
        f"{path}: '{one.source}' has as many samples as {' and '.join(map(repr, alike))}, and its name tells neither; "
        f"name it {one.source}_{_tag(alike[0])} or {one.source}_{_tag(alike[1])}, or make one of them the log's with "
        f"--channel time={alike[0]}"
    )
