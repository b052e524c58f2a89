"""A sine of unknown frequency, phase 0 at its onset (METHOD section 5, step 8).

The statistic's peak over the frequency is about 1 / duration wide, so a grid of half of that over the record misses
none. The grid is screened at one magnitude per onset; its best few peaks are then refined by halving the grid's step,
many onsets at each frequency, so that frequency and onset are found jointly; the last few are profiled exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .onset_ends import Limits, Pair, Span, climb, pair_limits, peaks, span_at, spread
from .onset_pairs import EndTables, screen_pairs, tabulate_ends
from .onset_profile import screen
from .onset_scan import ENDING, STARTING, Profile, default_onsets, in_blocks, magnitude_bound, scan_shape, stack_onsets
from .onset_shapes import sine
from .onset_tables import Scan, tabulate
from .progress import Report, parts, shares, silent

__all__ = ["MIN_CYCLES", "Tuned", "TunedSpan", "scan_frequency", "scan_frequency_ends"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Top = tuple[float, Pair, float]
Climbed = Callable[[float, Pair, Report], tuple[float, Pair]]

STEP = 0.5
MIN_CYCLES = 2.0
PEAKS = 8
FINAL_PEAKS = 3
HALVINGS = (2, 9)
ONSETS_PER_PERIOD = 6
ENDS = 10
RANKED = 64
BRANCHES = 3
FINALISTS = 48
# Trials of frequencies around the peaks (8 + 2 x 2 x 8 + 2 x 9 x 3), at twice the onsets of the grid's.
REFINEMENTS = 190


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned:
    """A scan at the best frequency.

    Attributes
    ----------
    frequency : cycles per sample.
    profile : over the onset at that frequency.
    frequencies, statistic : (n_frequencies,) the coarse grid and the screened statistic on it, a lower bound.
    """

    frequency: float
    profile: Profile
    frequencies: FloatArray
    statistic: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TunedSpan:
    """A start and an end at the best frequency; fields as in `Tuned`."""

    frequency: float
    span: Span
    frequencies: FloatArray
    statistic: FloatArray


def scan_frequency(
    scan: Scan,
    band: tuple[float, float],
    *,
    onsets: IntArray | None = None,
    min_cycles: float = MIN_CYCLES,
    report: Report = silent,
) -> Tuned:
    """Return the scan of a sine that lasts to the end of the record, at the frequency where its statistic is largest.

    A sine of less than two periods cannot be told from a drift or a step, so the statistic of later onsets is zero.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5.
    onsets : samples to consider; the default of `scan_shape` if None.
    min_cycles : periods between onset and end of the record, at least.
    report : told how far it is.
    """
    onsets = default_onsets(scan) if onsets is None else onsets
    grid = _grid(scan, band)

    def screened(frequency: float, stride: int, own: Report) -> float:
        among = early(frequency, onsets[::stride])
        if not among.size:
            return 0.0
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - among)
        found = in_blocks(scan, bound, lambda b: screen(stack_onsets(scan, tables, among[b]), bound[b]), own)
        return float(-scan.n_rows * found.F.min())

    def profiled(frequency: float, own: Report) -> Profile:
        profile = scan_shape(scan, sine(scan.n_samples, angle=2.0 * np.pi * frequency), onsets, report=own)
        late = ~np.isin(onsets, early(frequency, onsets))
        return replace(profile, statistic=np.where(late, 0.0, profile.statistic), z=np.where(late, 0.0, profile.z))

    def early(frequency: float, among: IntArray) -> IntArray:
        return among[among <= scan.n_samples - min_cycles / frequency]

    def best(frequency: float, begin: Pair, own: Report) -> tuple[float, Pair]:
        return screened(frequency, max(1, _stride(frequency) // 2), own), begin

    searching, refining, last = shares(report, len(grid), REFINEMENTS, 3 * FINAL_PEAKS)
    statistic = np.array([screened(f, _stride(f), own) for f, own in parts(searching, list(grid))])
    everywhere = int(onsets[0]), scan.n_samples
    tops = _refined(best, [(grid[k], everywhere) for k in peaks(statistic, PEAKS)], grid, refining)
    exact = [(profiled(frequency, own), frequency) for (_, _, frequency), own in parts(last, tops)]
    profile, frequency = max(exact, key=lambda one: float(one[0].statistic.max()))
    return Tuned(frequency=float(frequency), profile=profile, frequencies=grid, statistic=statistic)


def scan_frequency_ends(
    scan: Scan, band: tuple[float, float], *, min_cycles: float = MIN_CYCLES, report: Report = silent
) -> TunedSpan:
    """Return the best frequency, start and end of a sine.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5; frequencies too low for the record are cut.
    min_cycles : periods between start and end, at least.
    report : told how far it is.

    Raises
    ------
    ValueError : the band is empty, or the record too short for that many periods of its highest frequency.
    """
    room = scan.n_samples - (STARTING + ENDING) * scan.order - 1
    grid = _grid(scan, (max(band[0], min_cycles / room) if band[0] > 0.0 < room else band[0], band[1]))

    def prepared(frequency: float) -> tuple[EndTables, Limits]:
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        shortest = max(int(np.ceil(min_cycles / frequency)), ENDING * scan.order)
        return tabulate_ends(scan, waveform), pair_limits(scan, waveform, shortest)

    def coarse(frequency: float, own: Report) -> tuple[float, Pair]:
        tables, limits = prepared(frequency)
        starts = np.arange(limits.first, limits.last - limits.shortest + 1, _stride(frequency))
        ends = np.linspace(limits.first + limits.shortest, limits.last, ENDS).astype(np.intp)
        pairs = limits.pairs(starts, ends)
        ranking, climbing = shares(own, 1, 1)
        ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs, ranking))[:RANKED]]
        begin = spread(ranked, count=BRANCHES, reach=limits.shortest // 2)
        return climb(scan, tables, limits=limits, begin=begin, finalists=0, rounds=2, report=climbing)

    def climbed(frequency: float, begin: Pair, own: Report) -> tuple[float, Pair]:
        tables, limits = prepared(frequency)
        return climb(scan, tables, limits=limits, begin=[begin], report=own)

    searching, refining, last = shares(report, len(grid), REFINEMENTS, 1)
    rough = [coarse(f, own) for f, own in parts(searching, list(grid))]
    statistic = np.array([value for value, _ in rough])
    _, pair, frequency = _refined(climbed, [(grid[k], rough[k][1]) for k in peaks(statistic, PEAKS)], grid, refining)[0]
    tables, limits = prepared(frequency)
    span = span_at(scan, tables, limits=limits, pair=pair, report=last)
    return TunedSpan(frequency=frequency, span=span, frequencies=grid, statistic=statistic)


def _grid(scan: Scan, band: tuple[float, float]) -> FloatArray:
    low, high = band
    if not 0.0 < low <= high <= 0.5:
        raise ValueError(f"the band must lie within 0..0.5 cycles per sample, got {low:g}..{high:g}")
    return np.linspace(low, high, 1 + int(np.ceil((high - low) * scan.n_samples / STEP)))


def _stride(frequency: float) -> int:
    return max(1, int(1.0 / (ONSETS_PER_PERIOD * frequency)))


def _refined(climbed: Climbed, begin: list[tuple[float, Pair]], grid: FloatArray, report: Report) -> list[Top]:
    """Return the best few frequencies with their pairs: some halvings of the grid's step at each, more at the best."""
    step = float(grid[-1] - grid[0]) / max(len(grid) - 1, 1)
    first, *later = shares(report, PEAKS, *(2 * n * k for n, k in zip(HALVINGS, (PEAKS, FINAL_PEAKS), strict=True)))
    tops = [(*climbed(frequency, pair, own), frequency) for (frequency, pair), own in parts(first, begin)]
    for halvings, among in zip(HALVINGS, later, strict=True):
        tops = [
            _halved(climbed, top, [step * 0.5**k for k in range(1, halvings + 1)], grid, own)
            for top, own in parts(among, tops)
        ]
        tops = sorted(tops, reverse=True)[:FINAL_PEAKS]
        step *= 0.5**halvings
    return tops


def _halved(climbed: Climbed, top: Top, steps: Sequence[float], grid: FloatArray, report: Report) -> Top:
    value, pair, frequency = top
    for step, of_step in parts(report, steps):
        for beside, own in parts(of_step, (frequency - step, frequency + step)):
            if grid[0] <= beside <= grid[-1] and (found := climbed(beside, pair, own))[0] > value:
                (value, pair), frequency = found, beside
    return value, pair, frequency
