"""The time axis of a log: increasing times, even where they are those of a regular clock.

What a recorder's clock does is undone, with a note: rounded, repeated and skipped times are those of a regular clock, a
clock that is set jumps, and single times are wrong.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

import numpy as np

from ..epoch import DAY_S
from ..errors import LogError
from ..kernels import BoolArray, IntArray
from ..kernels.regular_clock import quantum_of, regular_times
from ..kernels.runs import runs
from ..notes import Note
from ..quantities.text import instant
from .record import FloatArray, frozen_array

# Largest time, s. Times since 1904 or 1970 are up to 4e9 s; in ms or us without a stated unit they are beyond this.
LATEST = 1e12
# A clock is set so often in a flight, at most, and has so many rows at least.
MOST_SET, FEWEST_TIMES = 5, 20
# [typical steps]: how far a row of a regular clock is written before the row that precedes it, at most: a second early
# after one that is late.
BACK = 1.5
# [rows]: single wrong times, which the medians of five rows that confirm a restart do not show.
MOST_SINGLE, BESIDE_MIDNIGHT = 2, 5
# Zones of time differ by whole quarters of an hour, s, and by 26 hours at most.
ZONE_S, FARTHEST_ZONE_S = 900.0, 26 * 3600.0
# Share of backward steps up to which single samples are left out; with more the clock is broken.
MENDED = 0.01
# A clock has restarted where it jumps back by more than so many seconds and typical steps, and the medians of so many
# samples before and after confirm it (single wrong times do not). A clock set by a satellite jumps back by less. With
# more restarts than so many the times are in no order at all.
RESTART_S, RESTART_STEPS, BESIDE_RESTART, MOST_BOOTS = 2.0, 10.0, 5, 100


class Axis(NamedTuple):
    """A time axis.

    Attributes
    ----------
    time_s : (n_rows,) increasing times, read-only.
    rows : which rows of the file have one, None for all.
    """

    time_s: FloatArray
    rows: BoolArray | None
    notes: tuple[Note, ...]


def axis_of(path: str, source: str, written_s: FloatArray) -> Axis:
    """Return the time axis that a file states, of the name `source`.

    Raises
    ------
    LogError : many times are no numbers or out of order, too few, or so large that none is a time of a flight.
    """
    notes, rows = list[Note](), np.isfinite(written_s)
    n, n_bad = written_s.size, int(np.count_nonzero(~rows))
    if n_bad > MENDED * n:
        first = int(np.argmin(rows))
        raise LogError(f"{path}: '{source}' is not a number at sample {first} ({n_bad} in all); mend the time axis")
    if n - n_bad < 2:
        raise LogError(f"{path}: {n} samples, at least 2 are needed; give a longer log")
    late = np.flatnonzero(np.abs(written_s) > LATEST)
    if late.size:
        raise LogError(
            f"{path}: '{source}' is no time of a flight at sample {late[0]}, got {written_s[late[0]]:.6g} s; state its "
            f"unit with --unit {source}=us, or mend the time axis"
        )
    if n_bad:
        notes.append(Note.limit(f"rows without a time are left out: {n_bad}"))
    time_s, more = without_jumps(source, written_s[rows])
    notes += more
    if (single := out_of_order(time_s)).any():
        rows[rows] = ~single
        time_s = time_s[~single]
        notes.append(note_on_order(int(np.count_nonzero(single))))
    time_s, more = made_regular(source, time_s)
    notes += more
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if back.size:
        kept = longest_in_order(time_s)
        if time_s.size - kept.size > MENDED * time_s.size:
            k = int(back[0]) + 1
            mend = "reverse its samples" if 2 < time_s.size == back.size + 1 else "sort or mend the time axis"
            raise LogError(
                f"{path}: '{source}' does not increase at sample {k} ({instant(time_s[k])} s after "
                f"{instant(time_s[k - 1])} s, {back.size} such steps); {mend}"
            )
        notes.append(note_on_order(time_s.size - kept.size))
        rows = np.isin(np.arange(n), np.flatnonzero(rows)[kept])
        time_s = time_s[kept]
    return Axis(time_s=frozen_array(time_s), rows=None if rows.all() else rows, notes=tuple(notes))


def note_on_order(n: int) -> Note:
    """Return the note on rows that are left out."""
    return Note.limit(f"rows whose time is out of order are left out: {n}")


def out_of_order(time_s: FloatArray) -> BoolArray:
    """Return which times (n,) are single wrong ones, without which the others are in order; none where many are.

    A time that repeats another, or is a step early, is none: it may be that of a regular clock.
    """
    single, step = np.zeros(time_s.size, dtype=bool), np.diff(time_s)
    if time_s.size < FEWEST_TIMES or step.min() >= 0.0:
        return single
    forward = step[step > 0.0]
    typical = float(np.median(forward)) if forward.size else 0.0
    if not np.any(step < -BACK * typical):
        return single
    out = np.ones(time_s.size, dtype=bool)
    out[longest_in_order(time_s + BACK * typical * np.arange(time_s.size))] = False
    for first, end in runs(out):
        single[first:end] = end - first <= MOST_SINGLE
    return single if np.count_nonzero(single) <= MENDED * time_s.size else np.zeros_like(single)


def with_midnights(time_s: FloatArray) -> FloatArray:
    """Return times of day (n,), s, that go on through later days.

    Midnight has passed where the clock falls by more than half a day, in the median of some rows as well: a single
    wrong time is no midnight.
    """
    midnights = np.zeros(time_s.size)
    for k in (np.flatnonzero(np.diff(time_s) < -0.5 * DAY_S) + 1).tolist():
        before = np.median(time_s[max(0, k - BESIDE_MIDNIGHT) : k])
        midnights[k] = np.median(time_s[k : k + BESIDE_MIDNIGHT]) - before < -0.5 * DAY_S
    return np.asarray(time_s + DAY_S * np.cumsum(midnights))


def made_regular(source: str, time_s: FloatArray) -> tuple[FloatArray, list[Note]]:
    """Return the times of the regular clock behind written ones, with a note; as they are where there is none."""
    regular = regular_times(time_s)
    if regular is None:
        return time_s, []
    rate = f"a regular clock of {1.0 / regular.period_s:.6g} Hz"
    if regular.n_moved:
        note = f"the times of '{source}' are those of {rate}: {regular.n_moved} of its rows, which repeat or skip one, "
        return regular.time_s, [Note.method(f"{note}are re-timed, and none is left out")]
    quantum = quantum_of(time_s) or 0.0
    return regular.time_s, [
        Note.method(
            f"the times of '{source}' are rounded to {quantum:.3g} s; their even steps of {regular.period_s:.6g} s are "
            "taken"
        )
    ]


def without_jumps(source: str, time_s: FloatArray, *, zones: bool = False) -> tuple[FloatArray, list[Note]]:
    """Return times (n,) without the jumps of a clock that was set, and notes.

    The row of a jump follows the row before by one typical step. A clock jumps back, or by more than a day; it does not
    where leaving out single rows puts the others in order.

    Parameters
    ----------
    zones : the times are those of a day, so that whole quarters of an hour are another zone of time.
    """
    step = np.diff(time_s)
    if time_s.size < FEWEST_TIMES or (not zones and step.min() >= 0.0 and step.max() <= DAY_S):
        return time_s, []
    forward = step[step > 0.0]
    if not forward.size:
        return time_s, []
    typical = float(np.median(forward))
    jump, notes = step - typical, list[Note]()
    quarters = np.round(jump / ZONE_S)
    is_zone = zones & (quarters != 0.0) & (np.abs(jump) <= FARTHEST_ZONE_S)
    is_zone &= np.abs(jump - ZONE_S * quarters) <= typical
    is_set = ~is_zone & ((step < 0.0) | (step > DAY_S))
    if 0 < is_zone.sum() <= MOST_SET:
        time_s = time_s - np.concatenate([[0.0], np.cumsum(np.where(is_zone, ZONE_S * quarters, 0.0))])
        k = int(np.argmax(is_zone))
        hours = ZONE_S * float(quarters[k]) / 3600.0
        notes.append(
            Note.method(
                f"the clock '{source}' changes its zone by {hours:+g} h after row {k + 1}; the zone before is kept"
            )
        )
    n_set = int(is_set.sum())
    if 0 < n_set <= MOST_SET:
        is_back = step < 0.0
        n_out = time_s.size - longest_in_order(time_s).size if is_back.any() else time_s.size
        if n_out > 2 * n_set:
            shift = np.where(is_set, jump, 0.0)
            # Rows before a jump go with it: the clock is right once it was set.
            time_s = time_s + np.concatenate([np.cumsum(shift[::-1])[::-1], [0.0]])
            k = int(np.flatnonzero(is_set)[-1])
            notes.append(
                Note.method(
                    f"the clock '{source}' was set by {float(jump[k]):+.6g} s after row {k + 1}; the rows before are "
                    "counted back from there"
                )
            )
    return time_s, notes


def boot_starts(time_s: FloatArray) -> list[int]:
    """Return the first sample of each part between restarts of the clock, 0 first."""
    step = np.diff(time_s)
    if not (step < -RESTART_S).any():
        return [0]
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


def longest_in_order(time_s: FloatArray) -> IntArray:
    """Return the samples of the longest increasing subsequence of times, by patience sorting."""
    tops: list[float] = []  # entry n - 1: the least time with which an increasing run of n samples can end
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
