"""Several time axes in one table: which channel goes by which.

The one that is `time` is the log's. A further one is named after it (`time_adc`, `t_ins`); its channels have that name
too (`cas_adc`, `adc_cas`), or its number of samples where no other axis has it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from ..channels import match_name
from ..errors import LogError
from ..notes import Note
from ..units import si_unit, to_si
from .rates import one_base
from .raw import Asked, FloatArray, RawLog, Track, clocked, time_column

WORDS = frozenset({"t", "time", "timestamp", "times"})
# Of a step, by which two axes of one length are the same.
ALIKE = 0.01
# Of the shorter of two axes, which the other has to cover: clocks that count from elsewhere are no time of the log.
SHARED = 0.5


def on_one_clock(path: str, raw: RawLog, asked: Asked) -> RawLog:
    """Return a log with the channels of further time axes brought to one, as topics with clocks of their own are.

    Raises
    ------
    LogError : the name of none of several axes of one length tells which is a channel's.
    """
    main = time_column(raw.columns, asked)
    if main is None or any(one.read is not None or one.time_s.size for one in raw.columns):
        return raw
    seconds = _seconds(path, main.source, main)
    if seconds is None:
        return raw
    further = {
        one.source: times
        for one in raw.columns
        if one.source != main.source and _words(one.source) & WORDS and one.source not in asked.sources
        if (times := _seconds(path, one.source, one, main.unit)) is not None and _is_clock(times, seconds)
    }
    clocks = {main.source: seconds, **further}
    of = {one.source: _clock_of(path, one, clocks) for one in raw.columns if one.source not in clocks}
    if not set(of.values()) & further.keys():
        return raw
    tracks, strangers = [], []
    for one in raw.columns:
        clock = of.get(one.source)
        if clock is None:
            strangers += [one.source] if one.source in of else []
            continue
        name = re.sub(rf"^{re.escape(_tag(clock))}_|_{re.escape(_tag(clock))}$", "", one.source) if _tag(clock) else ""
        known = match_name(one.source) or (match_name(name) if name else None)
        tracks.append(clocked(one.source, one.values, clocks[clock], asked, unit=one.unit, known=known))
    said = [f"{', '.join(repr(s) for s, c in of.items() if c == clock)} by '{clock}'" for clock in further]
    notes = [*raw.notes, Note.method(f"several time axes: {'; '.join(said)}, the others by '{main.source}'")]
    notes += [Note.method(f"'{name}' has the samples of no time axis and is left out") for name in strangers]
    merged = one_base(path, tracks, output=asked.channel_map.get("tas"), notes=notes)
    return RawLog(columns=merged.columns, segments=raw.segments, filters=(), notes=merged.notes)


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
