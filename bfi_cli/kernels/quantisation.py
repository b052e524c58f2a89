"""The levels of a recorded signal and the clock of its values: the quantisation step, and samples that are held.

A signal that was low-passed after its quantisation shows its step where it rests: these levels lie on a grid. Repeated
values alone say little of a hold (a slower sensor recorded at the log's rate): a control at rest and a coarsely
quantised slow signal repeat too. A held sensor changes on a clock: nearly every tick brings a new value, the steps
differ in size, and all changes share one phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .runs import runs, travel

# s; a signal that rests this long has left a recorder's low-pass of 0.4 Hz and more behind it.
PLATEAU_S = 0.9
# Rest is a travel below this share of the median step between samples, and within the rounding of float32.
REST, ROUNDING = 0.05, 4.0 * float(np.finfo(np.float32).eps)
# FEWEST_JUMPS, MANY_JUMPS: jumps between neighbouring plateaus. Two recorded altitudes have 240 to 330, a calibrated
# airspeed in cruise 40 to 75, a temperature about ten in two minutes. A few jumps tell a grid only where all lie on it.
FEWEST_JUMPS, MANY_JUMPS = 6, 20
# Jumps larger than this many median jumps say more of the rounding than of the grid.
LARGEST_JUMP = 12.0
# Mean cosine of the jumps' phases on the grid from which it is one: 1 on the grid, 0 for jumps of any size. The quanta
# of the two flights have 0.87 and above.
GRID_COHERENCE, LEAST_OF_FEW = 0.8, 0.97
GRID_POINTS = 3000  # quanta that are tried, mostly less than a part in 1000 apart
# Jumps from which the grid is told, for time: the mean cosine of so many at any phase is known to 0.04.
MOST_JUMPS = 300

# With fewer changes or values a clock cannot be told from the strokes of a control.
FEWEST_CHANGES, FEWEST_VALUES = 10, 8
# Periods without a change after which the signal rests; elsewhere half of the ticks have to bring a new value.
QUIET_PERIODS, LEAST_COVERAGE = 20.0, 0.5
# Length of the mean of the phases of all changes: 1 on a clock, about 0 for changes at any time.
LEAST_COHERENCE = 0.6
# Share of single quanta among the steps: nearly all of those of a coarsely quantised slow signal are.
MOST_UNIT_STEPS = 0.9
# Samples of a long signal that are looked at for its levels, for time: its steps are multiples of the quantum too.
MOST_LEVELS = 10**6


def quantum_of_plateaus(x: FloatArray, rate_hz: float) -> float | None:
    """Return the step of the grid on which the levels of a signal lie where it rests, None where none is seen.

    Parameters
    ----------
    x : (n_samples,), samples that are not finite are left out.
    rate_hz : of the samples.
    """
    x = x[np.isfinite(x)]
    size = max(2, round(PLATEAU_S * rate_hz))
    moves = np.abs(np.diff(x))
    moves = moves[moves > 0.0]
    if x.size < 4 * size or not moves.size:
        return None
    rest = max(REST * float(np.median(moves)), ROUNDING * float(np.abs(x).max()))
    # About every sample, the record mirrored at its ends.
    rests = travel(np.pad(x, (size // 2, (size - 1) // 2), mode="symmetric"), size) <= rest
    levels = x[[(first + end) // 2 for first, end in runs(rests)]]
    jumps = np.abs(np.diff(levels))
    jumps = jumps[jumps > 4.0 * rest]
    if jumps.size < FEWEST_JUMPS:
        return None
    middle = float(np.median(jumps))
    jumps = jumps[jumps <= LARGEST_JUMP * middle]
    low = max(5.0 * rest, 0.3 * float(np.quantile(jumps, 0.02)))
    if low >= middle:
        return None
    steps = np.geomspace(low, 1.05 * middle, GRID_POINTS)
    some = jumps[:: max(1, -(-jumps.size // MOST_JUMPS))]
    coherence = np.cos(2.0 * np.pi * some / steps[:, None]).mean(axis=1)
    # A half of the quantum is a grid of all jumps as well: the largest step that is nearly as good is the quantum.
    best = float(coherence.max())
    if best < (GRID_COHERENCE if jumps.size >= MANY_JUMPS else LEAST_OF_FEW):
        return None
    last = int(np.flatnonzero(coherence > 0.9 * best)[-1])
    first = last
    while first and coherence[first - 1] > 0.9 * best:
        first -= 1
    rough = float(steps[first + int(np.argmax(coherence[first : last + 1]))])
    count = np.round(jumps / rough)
    near = (count > 0.0) & (np.abs(jumps - count * rough) < 0.2 * rough)
    return float(count[near] @ jumps[near] / (count[near] @ count[near]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """A value is renewed at position `phase + m * period`, both in samples of the log's own rate."""

    period: float
    phase: float


def repeat_fraction(x: FloatArray) -> float:
    """Return the fraction of samples that repeat the one before."""
    return float(np.mean(x[1:] == x[:-1])) if x.size > 1 else 0.0


def may_be_held(x: FloatArray) -> bool:
    """Say whether a signal changes often enough to show a clock, and seldom enough to be held."""
    n_changes = int(np.count_nonzero(x[1:] != x[:-1]))
    return n_changes >= FEWEST_CHANGES and 3 * n_changes <= 2 * x.size


def find_hold(x: FloatArray, position: FloatArray) -> Hold | None:
    """Return the clock of a held signal, None where it is not held.

    Parameters
    ----------
    x : (n_samples,) values.
    position : (n_samples,) time in samples, (t - t[0]) * rate.
    """
    if not may_be_held(x):
        return None
    change = np.flatnonzero(x[1:] != x[:-1]) + 1
    # Values and steps must differ as a sensor's do, unlike the strokes of a control or single quanta.
    at, values, size = position[change], x[change], np.abs(np.diff(x)[change - 1])
    smallest = float(np.quantile(size, 0.05))
    single = np.mean(np.abs(size - smallest) <= 0.01 * smallest + ROUNDING * float(np.max(np.abs(values))))
    if np.unique(values).size < FEWEST_VALUES or not single < MOST_UNIT_STEPS:
        return None
    interval = np.diff(at)
    rough = float(np.quantile(interval, 0.1))
    if rough < 1.5:
        return None
    # The short intervals refined to the period at which the phases of the changes are most coherent. Ticks of a period
    # between two whole numbers come after either of them; the shorter one may be the rough one.
    ticks = np.bincount(np.round(at).astype(np.intp))
    padded = 4 << int(ticks.size).bit_length()
    low, high = int(min(0.75 / rough, 1.0 / (rough + 1.0)) * padded), min(int(1.35 / rough * padded), padded // 2)
    coherence = np.abs(np.fft.rfft(ticks, padded)[low : high + 1]) / at.size
    best = int(np.argmax(coherence))
    if coherence[best] < LEAST_COHERENCE:
        return None
    period = padded / (low + best)
    active = interval[interval <= QUIET_PERIODS * period]
    if active.size < FEWEST_CHANGES - 1 or active.size * period < LEAST_COVERAGE * active.sum():
        return None
    # Period and phase of the line through all changes over their ticks.
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * at / period)))) / (2.0 * np.pi) * period
    tick = np.round((at - phase) / period)
    slope, start = np.polyfit(tick, at, 1) if np.ptp(tick) > 0 else (period, phase)
    phase = float(start % slope)
    return Hold(period=float(slope), phase=0.0 if slope - phase < 1e-6 * slope else phase)


def find_quantum(x: FloatArray) -> float | None:
    """Return the step of which all differences of the signal are multiples, None where there is none.

    A step below float32 rounding, or of a signal with fewer than four levels, is none; up to 1 % of the levels may
    lie off the grid (interpolated samples).

    Parameters
    ----------
    x : (n_samples,) finite values.
    """
    tolerance = ROUNDING * float(np.max(np.abs(x), initial=0.0))
    levels = np.unique(x[:: max(1, x.size // MOST_LEVELS)])
    levels = levels[np.diff(levels, prepend=-np.inf) > tolerance]
    if levels.size < 4:
        return None
    # Euclid's algorithm on noisy numbers: the smallest remainder replaces the divisor until hardly one is left.
    steps = np.diff(levels)
    step = float(np.quantile(steps, 0.01))
    while step > 8.0 * tolerance:
        remainder = np.abs(steps - step * np.round(steps / step))
        left = remainder > np.maximum(2.0 * tolerance, 0.02 * step)
        if np.mean(left) <= 0.01:
            break
        step = float(np.quantile(remainder[left], 0.01))
    else:
        return None
    # The step fitted over all levels, which must lie on its grid.
    count = np.concatenate([[0.0], np.cumsum(np.round(steps / step))])
    fitted = float(np.polyfit(count, levels, 1)[0])
    offset = (levels - levels[0]) / fitted
    off_grid = np.abs(offset - np.round(offset)) * fitted > np.maximum(4.0 * tolerance, 0.1 * fitted)
    return fitted if np.mean(off_grid) <= 0.01 else None
