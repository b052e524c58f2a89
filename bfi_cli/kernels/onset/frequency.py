"""A sine of unknown frequency, phase 0 at its onset.

The statistic's peak over the frequency is about 1 / duration wide, so a grid of half of that over the record misses
none. The grid is screened at one magnitude per onset; its best few peaks are then refined by halving the grid's step,
many onsets at each frequency, so that frequency and onset are found jointly; the last few are profiled exactly. In a
long record only those sines are screened whose bound exceeds what the best peaks have (`frequency_bound`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .. import FloatArray, IntArray
from ..progress import Report, parts, shares, silent, steps
from .frequency_bound import TOGETHER, SineScreen, prepare_screen, screen_tabulated
from .pairs import Pair, PairLimits, PairTables, climb, pair_limits, peaks, screen_pairs, spread, tabulate_pairs
from .scan import ENDING, STARTING, Scan, default_onsets, scan_shape
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
# Trials of frequencies around the peaks (8 + 2 x 2 x 8 + 2 x 9 x 3), at twice the onsets of the grid: for the progress.
REFINEMENTS = 190
# Samples times frequencies of a grid up to which every sine is screened: bounds would hardly save time.
FEW = 400_000
# Frequencies, spread over a longer grid, that are screened first: they tell what its peaks have at least.
PILOT = 16
# The statistic that sines must exceed to be screened is that of so many times as many peaks as are wanted, so that the
# grid need not be gone through again.
SPARE = 1.5
# Peaks below this are not told apart: it is the median of the statistic of a single sine without a fault.
LEAST = 0.455


def scan_frequency(scan: Scan, band: tuple[float, float], report: Report = silent) -> float:
    """Return the frequency, cycles per sample, of the sine that explains most, lasting to the end of the record.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5.
    report : called with the fraction that is done.
    """
    grid, onsets = frequency_grid(scan, band), default_onsets(scan)
    bounds = None if len(grid) * scan.n_samples <= FEW else prepare_screen(scan)

    def evaluate(frequency: float, pair: Pair, above: float, own: Report) -> tuple[float, Pair]:
        if bounds is None or above <= LEAST:
            return screen_sine(scan, frequency, own, per_period=2 * ONSETS_PER_PERIOD), pair
        at = sine_onsets(scan, frequency, 2 * ONSETS_PER_PERIOD) - onsets[0]
        return float(bounds.statistics(np.array([frequency]), [at], above, own)[0]), pair

    searching, refining, last = shares(report, len(grid), REFINEMENTS, 3 * FINAL_PEAKS)
    statistic = screen_grid(scan, grid, searching, bounds)
    everywhere = int(onsets[0]), scan.n_samples
    exact = []
    tops = _refine(evaluate, [(grid[k], everywhere) for k in peaks(statistic, PEAKS)], grid, refining)
    for (_, _, frequency), own in parts(last, tops):
        profile = scan_shape(scan, sine(scan.n_samples, angle=2.0 * np.pi * frequency), onsets, report=own)
        early = onsets <= scan.n_samples - MIN_CYCLES / frequency
        exact.append((profile.statistic.max(initial=0.0, where=early), frequency))
    return float(max(exact, key=lambda top: top[0])[1])


def scan_frequency_ends(scan: Scan, band: tuple[float, float], report: Report = silent) -> float:
    """Return the frequency, cycles per sample, of the sine that explains most between the best start and end.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5; frequencies too low for the record are cut.
    report : called with the fraction that is done.

    Raises
    ------
    ValueError : the band is empty, or the record too short for two periods of its highest frequency.
    """
    room = scan.n_samples - (STARTING + ENDING) * scan.order - 1
    grid = frequency_grid(scan, (max(band[0], MIN_CYCLES / room) if band[0] > 0.0 < room else band[0], band[1]))

    def prepare(frequency: float) -> tuple[PairTables, PairLimits]:
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        shortest = max(int(np.ceil(MIN_CYCLES / frequency)), ENDING * scan.order)
        return tabulate_pairs(scan, waveform), pair_limits(scan, waveform, shortest)

    def evaluate(frequency: float, pair: Pair, _above: float, own: Report) -> tuple[float, Pair]:
        tables, limits = prepare(frequency)
        return climb(scan, tables, limits=limits, begin=[pair], report=own)

    searching, refining = shares(report, len(grid), REFINEMENTS)
    rough = []
    for frequency, own in parts(searching, list(grid)):
        tables, limits = prepare(frequency)
        starts = np.arange(limits.first, limits.last - limits.shortest + 1, stride(frequency, ONSETS_PER_PERIOD))
        ends = np.linspace(limits.first + limits.shortest, limits.last, ENDS).astype(np.intp)
        pairs = limits.pairs(starts, ends)
        ranking, climbing = shares(own, 1, 1)
        ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs, ranking))[:RANKED]]
        begin = spread(ranked, count=BRANCHES, reach=limits.shortest // 2)
        rough.append(climb(scan, tables, limits=limits, begin=begin, finalists=0, rounds=2, report=climbing))
    statistic = np.array([value for value, _ in rough])
    begun = [(grid[k], rough[k][1]) for k in peaks(statistic, PEAKS)]
    return float(_refine(evaluate, begun, grid, refining)[0][2])


def frequency_grid(scan: Scan, band: tuple[float, float]) -> FloatArray:
    """Return frequencies half of a peak's width apart, cycles per sample.

    Raises
    ------
    ValueError : the band is empty or not within 0..0.5.
    """
    low, high = band
    if not 0.0 < low <= high <= 0.5:
        raise ValueError(f"the band must lie within 0..0.5 cycles per sample, got {low:g}..{high:g}")
    return np.linspace(low, high, 1 + int(np.ceil((high - low) * scan.n_samples / STEP)))


def stride(frequency: float, per_period: int) -> int:
    """Return the samples between onsets of which there are `per_period` or more in a period."""
    return max(1, int(1.0 / (per_period * frequency)))


def sine_onsets(scan: Scan, frequency: float, per_period: int) -> IntArray:
    """Return onsets of which there are `per_period` or more in a period, each early enough for a sine."""
    onsets = default_onsets(scan)[:: stride(frequency, per_period)]
    return onsets[onsets <= scan.n_samples - MIN_CYCLES / frequency]


def screen_sine(scan: Scan, frequency: float, report: Report, *, per_period: int = ONSETS_PER_PERIOD) -> float:
    """Return the largest screened statistic of a sine over a few onsets per period, 0 where all are too late."""
    return float(screen_sines(scan, [frequency], report, per_period=per_period)[0])


def screen_sines(
    scan: Scan, frequencies: Sequence[float], report: Report = silent, *, per_period: int = ONSETS_PER_PERIOD
) -> FloatArray:
    """Return `screen_sine` of several frequencies."""
    onsets = [sine_onsets(scan, frequency, per_period) for frequency in frequencies]
    some = [k for k, of_sine in enumerate(onsets) if of_sine.size]
    statistic = np.zeros(len(frequencies))
    statistic[some] = screen_tabulated(scan, [frequencies[k] for k in some], [onsets[k] for k in some], report)
    return statistic


def screen_grid(scan: Scan, grid: FloatArray, report: Report = silent, bounds: SineScreen | None = None) -> FloatArray:
    """Return the screened statistic of sines whose `PEAKS` highest peaks are those of `screen_sine` on the whole grid.

    In a long record the statistic of a sine that is no such peak may be lower than that of `screen_sine`.

    Parameters
    ----------
    grid : (n_frequencies,) ascending, cycles per sample.
    report : called with the fraction that is done.
    bounds : from `prepare_screen`, where they are known already.
    """
    key = grid.tobytes()
    if key not in scan.screened:
        short = len(grid) * scan.n_samples <= FEW
        scan.screened[key] = (
            screen_sines(scan, grid.tolist(), report)
            if short
            else _screen_bounded(scan, grid, report, bounds or prepare_screen(scan))
        )
    report(1.0)
    return scan.screened[key]


def _screen_bounded(scan: Scan, grid: FloatArray, report: Report, bounds: SineScreen) -> FloatArray:
    """Return `screen_grid` of a long record: only sines whose bound exceeds what the best peaks have are screened."""
    n = len(grid)
    piloting, screening, again = shares(report, 5, 90, 5)
    first, passes = bounds.onsets[0], -(-n // TOGETHER)
    statistic, above = np.zeros(n), np.full(n, np.inf)

    def screen_some(some: IntArray, needed: float, own: Report) -> None:
        at = [sine_onsets(scan, f, ONSETS_PER_PERIOD) - first for f in grid[some].tolist()]
        statistic[some] = bounds.statistics(grid[some], at, needed, own)
        above[some] = np.where(statistic[some] > needed, 0.0, needed)

    def lowest(count: int) -> float:
        return max(float(statistic[peaks(statistic, count)][-1]), LEAST)

    pilot = np.unique(np.linspace(0, n - 1, PILOT).astype(np.intp))
    statistic[pilot], above[pilot] = screen_sines(scan, grid[pilot].tolist(), piloting), 0.0
    for k, own in parts(screening, range(passes)):
        rank = int(np.ceil(SPARE * PEAKS * np.isfinite(above).mean()))
        some = np.arange(k, n, passes)
        screen_some(some[above[some] > 0.0], lowest(rank), own)
    redone = steps(again, 1)
    # A peak is known once every sine that may exceed it has been screened.
    while (late := np.flatnonzero(above > (needed := lowest(PEAKS)))).size:
        screen_some(late, needed, silent)
        redone()
    report(1.0)
    return statistic


def _refine(
    evaluate: Callable[[float, Pair, float, Report], tuple[float, Pair]],
    begin: list[tuple[float, Pair]],
    grid: FloatArray,
    report: Report,
) -> list[tuple[float, Pair, float]]:
    """Return the best few statistics, pairs and frequencies: the grid's step is halved around each, the best are kept.

    `evaluate` gives the best statistic at a frequency, and its pair, from the pair of a frequency nearby; where it does
    not exceed the statistic of the third argument, it may be lower.
    """
    step = float(grid[-1] - grid[0]) / max(len(grid) - 1, 1)
    first, *later = shares(report, PEAKS, *(2 * n * k for n, k in zip(HALVINGS, (PEAKS, FINAL_PEAKS), strict=True)))
    tops = [(*evaluate(frequency, pair, 0.0, own), frequency) for (frequency, pair), own in parts(first, begin)]
    for halvings, among in zip(HALVINGS, later, strict=True):
        for (n, (value, pair, frequency)), of_top in parts(among, list(enumerate(tops))):
            for half, of_half in parts(of_top, [step * 0.5**k for k in range(1, halvings + 1)]):
                for beside, own in parts(of_half, (frequency - half, frequency + half)):
                    if grid[0] <= beside <= grid[-1] and (trial := evaluate(beside, pair, value, own))[0] > value:
                        (value, pair), frequency = trial, beside
            tops[n] = value, pair, frequency
        tops = sorted(tops, reverse=True)[:FINAL_PEAKS]
        step *= 0.5**halvings
    return tops
