"""Missing samples interpolated: single ones of an even clock, and longer stretches where the user asks for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..kernels.runs import runs
from ..notes import Note
from .record import FlightLog, FloatArray, frozen_array
from .topics import ANGLES

# Signals that have no values between theirs: they keep the last.
FLAGS = frozenset({"valid_airspeed", "gear"})
# Of a step, by which a clock may wander: a stretch of just the length that is asked for is filled.
BESIDE = 0.02
# Of all steps: with more double ones a clock is not even. A Garmin G1000 at 1 Hz leaves out one second in 45.
MOST_DOUBLE = 0.05
# With more double steps in a row the clock goes at half its rate.
MOST_IN_A_ROW = 3


def with_filled(log: FlightLog, longest_s: float) -> FlightLog:
    """Return the log with stretches of NaN of up to `longest_s` interpolated linearly, and a note on each channel.

    A stretch at an end of the log is left as it is, for there is nothing beyond. Angles take the shorter way round;
    flags keep their last value. The clean signal of a channel with an injected fault is filled alike.
    """
    stretches: dict[str, list[float]] = {}

    def filled(name: str, values: FloatArray) -> FloatArray:
        out, lengths_s = _filled(name, values, log, longest_s)
        stretches.setdefault(name, lengths_s)
        return out

    changed, notes = log.changed(filled), list(log.notes)
    for name, lengths_s in stretches.items():
        if lengths_s:
            count = f"{len(lengths_s)} stretch{'es' * (len(lengths_s) > 1)}"
            notes.append(
                Note.method(f"'{name}': {count} of up to {max(lengths_s):.3g} s without samples interpolated (--fill)")
            )
    return replace(changed, notes=tuple(notes))


def with_single_samples(log: FlightLog) -> FlightLog:
    """Return the log with the samples that an even clock left out one at a time interpolated, and a note.

    A sample is missing alone where the step is twice the median one.
    Longer gaps, and clocks that are not even otherwise, are left as they are.
    """
    if log.n_samples < 4:
        return log
    step = np.diff(log.time_s) * log.rate_hz
    double, single = np.abs(step - 2.0) <= 2.0 * BESIDE, np.abs(step - 1.0) <= BESIDE
    even = double.sum() <= MOST_DOUBLE * step.size and double.sum() + single.sum() >= (1.0 - MOST_DOUBLE) * step.size
    for first, stop in runs(double):
        double[first:stop] = stop - first <= MOST_IN_A_ROW
    at = np.flatnonzero(double) + 1
    if not at.size or not even:
        return log
    time_s = np.insert(log.time_s, at, 0.5 * (log.time_s[at - 1] + log.time_s[at]))
    missing = np.insert(np.zeros(log.n_samples, dtype=bool), at, True)
    longer = replace(log, time_s=frozen_array(time_s), channels={}, truth=None)

    def with_holes(name: str, values: FloatArray) -> FloatArray:
        inserted = np.insert(values, at, np.nan)
        filled, _ = _filled(name, inserted, longer, 1.0 / log.rate_hz)
        # What is missing in the file beside them stays so.
        return frozen_array(np.where(missing, filled, inserted))

    first_s = log.time_s[at[0] - 1]
    note = Note.method(
        f"{at.size} samples that the clock left out one at a time, the first after {first_s:.6g} s, are interpolated"
    )
    return log.changed(with_holes, time_s=longer.time_s, notes=(*log.notes, note))


def _filled(name: str, values: FloatArray, log: FlightLog, longest_s: float) -> tuple[FloatArray, list[float]]:
    """Return the filled values, and the lengths, s, of the stretches that were filled."""
    out, lengths_s = values.copy(), []
    for start, stop in runs(np.isnan(values)):
        if start == 0 or stop == values.size:
            continue
        # From the last sample before to the first after, less the step that is no stretch: a gap of the clock counts.
        at = log.time_s[start - 1 : stop + 1]
        length_s = float(at[-1] - at[0]) - 1.0 / log.rate_hz
        if not length_s <= longest_s + BESIDE / log.rate_hz:
            continue
        lengths_s.append(length_s)
        before, after = values[start - 1], values[stop]
        if name in FLAGS:
            out[start:stop] = before
            continue
        turns = 2.0 * np.pi * float(np.round((after - before) / (2.0 * np.pi))) if name in ANGLES else 0.0
        part = (at[1:-1] - at[0]) / (at[-1] - at[0])
        between = before + (after - turns - before) * part
        # Back into the turn of the value before or of that after, whichever is nearer in time.
        out[start:stop] = np.where(part < 0.5, between, between + turns)
    return (frozen_array(out) if lengths_s else values), lengths_s
