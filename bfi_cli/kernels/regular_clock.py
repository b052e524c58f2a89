"""The times of a regular clock, of which a recorder wrote rounded ones.

Row k is event n_k of a clock of period T: its true time is a + n_k T, with whole n_k that rise by one from row to row
and by more where rows are missing. What is written lies within one quantum q of it. So t_k - n_k T stays within a band
of width q, and a missing row lifts it out of the band for good, while rounding does not. Counting n_k and a least
squares line give T far better than q, and the true times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Counts = NDArray[np.intp]

# Decimals of a written time, s.
DECIMALS = (1.0, 0.1, 0.01, 0.001, 1e-4, 1e-5, 1e-6)
# Fewest rows from which a period is estimated.
FEWEST = 20
# Least rounding, in periods, that is taken off: less leaves the rate within 1e-5.
LEAST = 1e-5
# Rounding, in periods, up to which each step alone tells how many periods it has: with missing rows a step of two
# periods, less a quantum, is then longer than a single period and a quantum.
BY_STEP = 0.45
# Rows in which the period is estimated at first, and how often the rows are counted with a better one.
BLOCK, ROUNDS = 64, 3
# Whole periods, some of them skipped, are those of a longer period only where that leaves up to this share of at least
# so many skipped ones unexplained: rows that are missing come at no regular times.
STILL_MISSING, FEWEST_LONGER = 0.1, 5
# Share of the steps: with more rows missing the others show no period.
MOST_MISSING = 0.1
# Width of the band in quanta. One, and what jitter and a drift of the clock add.
BAND = 1.15
# Share of a period that the band may wander in each row, for the error of the first estimate of the period.
WANDER = 2e-3
# Rows per band, at least: a band that breaks more often belongs to a clock that is not regular. A quartz drifts by
# 1e-6, so that rounding of a hundredth of a period lasts for 10 000 rows.
ROWS_PER_BAND = 500
# MISSING, BESIDE: price of a missing row, and of a row written a period early or late, of a clock of whole periods.
# Pairs of a repeated and a skipped second in a Garmin G1000 are up to 3 rows apart, its missing rows 20 and more.
MISSING, BESIDE = 1.0, 0.12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regular:
    """The times of a regular clock.

    Attributes
    ----------
    time_s : (n,) true times, increasing; steps are one period, or several where rows are missing.
    period_s : the period.
    n_moved : rows that were written at least half a period beside their time.
    """

    time_s: FloatArray
    period_s: float
    n_moved: int


def quantum_of(time_s: FloatArray) -> float | None:
    """Return the resolution, s, of written times (n,): a decimal, or that of single precision; None for neither."""
    spacing = float(np.spacing(np.float32(np.max(np.abs(time_s))))) if _is_single(time_s) else 0.0
    from_start = time_s - time_s[0]
    for quantum in DECIMALS:
        if spacing > 0.1 * quantum:
            break
        count = from_start / quantum
        if np.max(np.abs(count - np.round(count))) < 1e-3 + spacing / quantum:
            return quantum
    return spacing or None


def regular_times(time_s: FloatArray) -> Regular | None:
    """Return the times of the regular clock behind written times (n,), None where there is none or nothing to mend.

    The written times may repeat.
    """
    if time_s.size < FEWEST or (quantum := quantum_of(time_s)) is None:
        return None
    is_decimal = quantum in DECIMALS
    # A decimal stored in single precision is that decimal.
    written = time_s
    if is_decimal and _is_single(time_s):
        written = time_s[0] + np.round((time_s - time_s[0]) / quantum) * quantum
    step = np.diff(written)
    typical = float(np.median(step))
    periods = step / (typical or quantum)
    is_whole = bool(np.all(periods > 0.5) and np.all(np.abs(periods - np.round(periods)) <= LEAST))
    n_longer = int(np.count_nonzero(periods > 1.5))
    is_same = bool(np.max(np.abs(written - time_s)) <= LEAST * typical)
    as_written = None if is_same else Regular(time_s=written, period_s=typical, n_moved=0)
    if is_whole and (n_longer < FEWEST_LONGER or round(typical / quantum) != 1):
        return as_written
    counted = None
    if is_decimal and round(typical / quantum) == 1 and not is_whole:
        counted = _whole_periods(np.round((written - written[0]) / quantum).astype(np.intp))
    if counted is not None:
        times = written[0] + quantum * counted
        moved = int(np.count_nonzero(np.abs(times - written) > 0.5 * quantum))
        return Regular(time_s=times, period_s=quantum, n_moved=moved)
    period = _first_period(written, quantum)
    if not period > 0.0 or quantum < LEAST * period:
        return as_written
    count = _count(written, period, quantum)
    for _ in range(ROUNDS):
        period = _fitted_period(written, count)
        if not period > 0.0:
            return as_written
        count = _count(written, period, quantum)
    if np.count_nonzero(np.diff(count) > 1) > (STILL_MISSING * n_longer if is_whole else MOST_MISSING * step.size):
        return as_written
    times = _on_bands(written, count, period, quantum)
    if times is None or np.any(np.diff(times) <= 0.0):
        return as_written
    moved = int(np.count_nonzero(np.abs(times - written) > 0.5 * period))
    return Regular(time_s=times, period_s=period, n_moved=moved)


def _is_single(time_s: FloatArray) -> bool:
    return bool(np.array_equal(time_s.astype(np.float32), time_s))


def _whole_periods(written: Counts) -> Counts | None:
    """Return which period each row is of, from written whole periods (n,), None where no clock explains them.

    A written period is late by at most one, or early by at most one; only where neither explains all rows, both.
    """
    paths = [_cheapest(written, np.array(beside)) for beside in ((-1, 0), (0, 1))]
    paths = [path for path in paths if path is not None] or [_cheapest(written, np.array((-1, 0, 1)))]
    return min(filter(None, paths), key=lambda path: path[0], default=(0.0, None))[1]


def _cheapest(written: Counts, beside: Counts) -> tuple[float, Counts] | None:
    """Return the price and the true counts of the cheapest path, by dynamic programming; None where there is none.

    Parameters
    ----------
    beside : what a written count may differ by from the true one.
    """
    price = BESIDE * np.abs(beside)
    change = beside[None, :] - beside[:, None]  # from one row to the next
    cost, states = price.astype(np.float64), np.arange(beside.size)
    choices = np.zeros((written.size, beside.size), dtype=np.int8)
    for k, step in enumerate(np.diff(written).tolist(), start=1):
        rise = step - change
        total = np.where(rise < 1, np.inf, cost[:, None] + MISSING * (rise - 1))
        choices[k] = np.argmin(total, axis=0)
        cost = total[choices[k], states] + price
    state = int(np.argmin(cost))
    if not np.isfinite(cost[state]):
        return None
    cheapest, count = float(cost[state]), np.empty(written.size, dtype=np.intp)
    for k in range(written.size - 1, -1, -1):
        count[k] = written[k] - beside[state]
        state = int(choices[k, state])
    return cheapest, count


def _first_period(time_s: FloatArray, quantum: float) -> float:
    """Return the mean step over the blocks whose length is that of most: those without missing rows."""
    rows = max(2, min(BLOCK, time_s.size // 8))
    length = np.diff(time_s[::rows])
    median = float(np.median(length))
    alike = np.abs(length - median) <= quantum + 1e-9 * abs(median)
    return float(np.mean(length[alike])) / rows if alike.any() else 0.0


def _count(time_s: FloatArray, period: float, quantum: float) -> Counts:
    """Return which period each row is of, counted from the first."""
    step = np.diff(time_s)
    if quantum <= BY_STEP * period:
        return np.concatenate([[0], np.cumsum(np.maximum(np.round(step / period), 1.0))]).astype(np.intp)
    # The band of phases in which the clock can be, and how it narrows with every row.
    count, n = [0], 0
    low, high = float(time_s[0]), float(time_s[0]) + quantum
    wander = WANDER * period
    for time in time_s[1:].tolist():
        n += 1
        phase = time - n * period
        low, high = low - wander, high + wander
        if phase > high:  # rows are missing
            missing = int(np.ceil((phase - high) / period))
            n += missing
            phase -= missing * period
        if phase + quantum < low:  # no phase fits: the band begins again
            low, high = phase, phase + quantum
        else:
            low, high = max(low, phase), min(high, phase + quantum)
        count.append(n)
    return np.array(count, dtype=np.intp)


def _fitted_period(time_s: FloatArray, count: Counts) -> float:
    """Return the slope of lines through the stretches without missing rows, with a separate start for each.

    Of rows that share a written time the first is the nearest to it.
    """
    part = np.concatenate([[0], np.cumsum(np.diff(count) > 1)])
    is_first = np.concatenate([[False], np.diff(time_s) > 0.0])
    if np.count_nonzero(is_first) < is_first.size - 1:
        time_s, count, part = time_s[is_first], count[is_first], part[is_first]
    rows = np.maximum(np.bincount(part), 1)
    n = count - (np.bincount(part, count) / rows)[part]
    time = time_s - (np.bincount(part, time_s - time_s[0]) / rows)[part] - time_s[0]
    weight = float(n @ n)
    return float(n @ time) / weight if weight > 0.0 else 0.0


def _on_bands(time_s: FloatArray, count: Counts, period: float, quantum: float) -> FloatArray | None:
    """Return the true times, None where the written ones leave the band too often.

    Stretches that share a band lie on one line. Between two bands without a missing row between them the clock drifts,
    evenly from the middle of one to that of the other.
    """
    phase = time_s - period * count
    width = BAND * quantum + 4.0 * float(np.spacing(np.max(np.abs(time_s))))
    gaps = np.flatnonzero(np.diff(count) > 1) + 1
    starts, most = [0], gaps.size + time_s.size // ROWS_PER_BAND + 1
    while True:
        part = phase[starts[-1] :]
        bad = np.maximum.accumulate(part) - np.minimum.accumulate(part) > width
        if not bad.any():
            break
        if len(starts) == most:
            return None
        first_bad = starts[-1] + int(np.argmax(bad))
        before = gaps[(gaps > starts[-1]) & (gaps <= first_bad)]
        starts.append(int(before[-1]) if before.size and first_bad - before[-1] < ROWS_PER_BAND else first_bad)
    stops = [*starts[1:], time_s.size]
    # The first of the rows that share a written time is at that time, else written times are beside by either sign.
    low = 0.0 if quantum > period else 0.5
    level = [float(low * phase[a:b].min() + (1.0 - low) * phase[a:b].max()) for a, b in zip(starts, stops, strict=True)]
    at, of = list[float](), list[float]()
    is_gap = set(gaps.tolist()) | {0, time_s.size}
    for a, b, middle in zip(starts, stops, level, strict=True):
        ends = [float(count[a])] * (a in is_gap) + [float(count[b - 1])] * (b in is_gap)
        knots = ends or [0.5 * float(count[a] + count[b - 1])]
        at += knots
        of += [middle] * len(knots)
    return np.asarray(period * count + np.interp(count, at, of))
