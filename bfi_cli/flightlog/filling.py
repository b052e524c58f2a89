"""Missing samples interpolated, where the user asks for it: nothing else fills a hole of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .record import FlightLog, FloatArray, frozen_array
from .topics import ANGLES

__all__ = ["with_filled"]

# Signals that have no values between theirs: they keep the last.
FLAGS = frozenset({"valid_airspeed", "gear"})
# Of a step, by which a clock may wander: a stretch of just the length that is asked for is filled.
BESIDE = 0.02


def with_filled(log: FlightLog, longest_s: float) -> FlightLog:
    """Return the log with stretches of NaN of up to `longest_s` interpolated linearly, and a note on each channel.

    A stretch at an end of the log is left as it is, for there is nothing beyond. Angles take the shorter way round;
    flags keep their last value. The clean signal of a channel with an injected fault is filled alike.
    """
    channels, notes = {}, list(log.notes)
    for name, channel in log.channels.items():
        values, lengths_s = _filled(name, channel.values, log, longest_s)
        channels[name] = replace(channel, values=values) if lengths_s.size else channel
        if lengths_s.size:
            count = f"{lengths_s.size} stretch{'es' * (lengths_s.size > 1)}"
            notes.append(f"'{name}': {count} of up to {lengths_s.max():.3g} s without samples interpolated (--fill)")
    truth = log.truth
    if truth is not None:
        truth = replace(truth, clean={n: _filled(n, x, log, longest_s)[0] for n, x in truth.clean.items()})
    return replace(log, channels=channels, truth=truth, notes=tuple(notes))


def _filled(name: str, values: FloatArray, log: FlightLog, longest_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the filled values, and the lengths, s, of the stretches that were filled."""
    missing = np.isnan(values)
    edges = np.diff(missing.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    inside = (starts > 0) & (stops < values.size)
    starts, stops = starts[inside], stops[inside]
    # From the last sample before to the first after, less the step that is no stretch: a gap of the clock counts too.
    lengths_s = log.time_s[stops] - log.time_s[starts - 1] - 1.0 / log.rate_hz
    short = lengths_s <= longest_s + BESIDE / log.rate_hz
    starts, stops, lengths_s = starts[short], stops[short], lengths_s[short]
    if not starts.size:
        return values, lengths_s
    out = values.copy()
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        before, after = values[start - 1], values[stop]
        if name in FLAGS:
            out[start:stop] = before
            continue
        at = log.time_s[start - 1 : stop + 1]
        part, turns = (at[1:-1] - at[0]) / (at[-1] - at[0]), 0.0
        if name in ANGLES:
            turns = 2.0 * np.pi * float(np.round((after - before) / (2.0 * np.pi)))
        between = before + (after - turns - before) * part
        # Back into the turn of the value before or of that after, whichever is nearer in time.
        out[start:stop] = np.where(part < 0.5, between, between + turns)
    return frozen_array(out), lengths_s
