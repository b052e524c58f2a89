"""A sine of unknown frequency, phase 0 at its onset.

The statistic's peak over the frequency is about 1 / duration wide, so a grid of half of that over the record misses
none. The grid is screened at one magnitude per onset; its best few peaks are then refined by halving the grid's step,
many onsets at each frequency, so that frequency and onset are found jointly; the last few are profiled exactly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import FloatArray, IntArray
from .correlations import Scan, tabulate
from .pairs import (
    Pair,
    PairLimits,
    PairTables,
    climb,
    pair_limits,
    peaks,
    screen_pairs,
    spread,
    tabulate_pairs,
)
from .profile import screen
from .scan import ENDING, STARTING, default_onsets, in_blocks, magnitude_bound, scan_shape, stack_onsets
from .waveform import sine

# Step of the grid over 1 / duration: half of the peak's width.
STEP = 0.5
# A sine of less than two periods cannot be told from a drift or a step.
MIN_CYCLES = 2.0
# Peaks of the grid that are refined, and how many of them are left for the further halvings and the exact profile.
PEAKS = 8
FINAL_PEAKS = 3
# Halvings of the grid's step at all peaks, then at the last few: 1/2000 of the step in the end.
HALVINGS = (2, 9)
# Onsets screened per period, so that the nearest is at most a twelfth of a period away.
ONSETS_PER_PERIOD = 6
# Of pairs, per frequency of the grid: ends tried, pairs ranked, and branches that sweeps start from.
ENDS = 10
RANKED = 64
BRANCHES = 3


def scan_frequency(scan: Scan, band: tuple[float, float]) -> float:
    """Return the frequency, cycles per sample, of the sine that explains most, lasting to the end of the record.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5.
    """
    grid, onsets = _grid(scan, band), default_onsets(scan)

    def evaluate(frequency: float, pair: Pair) -> tuple[float, Pair]:
        return _screened(scan, frequency, onsets[:: max(1, _stride(frequency) // 2)]), pair

    statistic = np.array([_screened(scan, f, onsets[:: _stride(f)]) for f in grid])
    everywhere = int(onsets[0]), scan.n_samples
    exact = []
    for _, _, frequency in _refine(evaluate, [(grid[k], everywhere) for k in peaks(statistic, PEAKS)], grid):
        profile = scan_shape(scan, sine(scan.n_samples, angle=2.0 * np.pi * frequency), onsets)
        early = onsets <= scan.n_samples - MIN_CYCLES / frequency
        exact.append((profile.statistic.max(initial=0.0, where=early), frequency))
    return float(max(exact, key=lambda top: top[0])[1])


def scan_frequency_ends(scan: Scan, band: tuple[float, float]) -> float:
    """Return the frequency, cycles per sample, of the sine that explains most between the best start and end.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5; frequencies too low for the record are cut.

    Raises
    ------
    ValueError : the band is empty, or the record too short for two periods of its highest frequency.
    """
    room = scan.n_samples - (STARTING + ENDING) * scan.order - 1
    grid = _grid(scan, (max(band[0], MIN_CYCLES / room) if band[0] > 0.0 < room else band[0], band[1]))

    def prepare(frequency: float) -> tuple[PairTables, PairLimits]:
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        shortest = max(int(np.ceil(MIN_CYCLES / frequency)), ENDING * scan.order)
        return tabulate_pairs(scan, waveform), pair_limits(scan, waveform, shortest)

    def evaluate(frequency: float, pair: Pair) -> tuple[float, Pair]:
        tables, limits = prepare(frequency)
        return climb(scan, tables, limits=limits, begin=[pair])

    rough = []
    for frequency in grid:
        tables, limits = prepare(frequency)
        starts = np.arange(limits.first, limits.last - limits.shortest + 1, _stride(frequency))
        ends = np.linspace(limits.first + limits.shortest, limits.last, ENDS).astype(np.intp)
        pairs = limits.pairs(starts, ends)
        ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs))[:RANKED]]
        begin = spread(ranked, count=BRANCHES, reach=limits.shortest // 2)
        rough.append(climb(scan, tables, limits=limits, begin=begin, finalists=0, rounds=2))
    statistic = np.array([value for value, _ in rough])
    return float(_refine(evaluate, [(grid[k], rough[k][1]) for k in peaks(statistic, PEAKS)], grid)[0][2])


def _grid(scan: Scan, band: tuple[float, float]) -> FloatArray:
    low, high = band
    if not 0.0 < low <= high <= 0.5:
        raise ValueError(f"the band must lie within 0..0.5 cycles per sample, got {low:g}..{high:g}")
    return np.linspace(low, high, 1 + int(np.ceil((high - low) * scan.n_samples / STEP)))


def _stride(frequency: float) -> int:
    return max(1, int(1.0 / (ONSETS_PER_PERIOD * frequency)))


def _screened(scan: Scan, frequency: float, onsets: IntArray) -> float:
    """Return the largest screened statistic of a sine over some onsets, 0 where all are too late."""
    onsets = onsets[onsets <= scan.n_samples - MIN_CYCLES / frequency]
    if not onsets.size:
        return 0.0
    waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
    tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - onsets)
    minimum = in_blocks(scan, bound, lambda b: screen(stack_onsets(scan, tables, onsets[b]), bound[b]))
    return float(-scan.n_rows * minimum.F.min())


def _refine(
    evaluate: Callable[[float, Pair], tuple[float, Pair]], begin: list[tuple[float, Pair]], grid: FloatArray
) -> list[tuple[float, Pair, float]]:
    """Return the best few statistics, pairs and frequencies: the grid's step is halved around each, the best are kept.

    `evaluate` gives the best statistic at a frequency, and its pair, from the pair of a frequency nearby.
    """
    step = float(grid[-1] - grid[0]) / max(len(grid) - 1, 1)
    tops = [(*evaluate(frequency, pair), frequency) for frequency, pair in begin]
    for halvings in HALVINGS:
        for n, (value, pair, frequency) in enumerate(tops):
            for half in (step * 0.5**k for k in range(1, halvings + 1)):
                for beside in (frequency - half, frequency + half):
                    if grid[0] <= beside <= grid[-1] and (trial := evaluate(beside, pair))[0] > value:
                        (value, pair), frequency = trial, beside
            tops[n] = value, pair, frequency
        tops = sorted(tops, reverse=True)[:FINAL_PEAKS]
        step *= 0.5**halvings
    return tops
