"""A sine of unknown frequency, phase 0 at its onset.

The statistic's peak over the frequency is about 1 / duration wide, so a grid of half of that over the record misses
none. The grid is screened at one magnitude and few onsets each (`screen_at`); its best few peaks are then refined by
halving the grid's step, more onsets at each frequency, so that frequency and onset are found jointly; the last few are
profiled exactly.

Sines of many frequencies and onsets are screened together. From s samples after its onset on, a lagged copy of a sine
of angle w is the imaginary part of a number times exp(i w k); before that it is few numbers, which the onset does not
change. So running sums of the record's rows times exp(i w k), from each sample on, give the inner products of a sine
with the record for all onsets. What tells an onset are the samples right after it, which may hold anything but are the
same for all frequencies, and the sine and cosine from there on, which change little with the onset. The share of the
residuals that both explain says at which onsets a sine is worth its screen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from .. import TINY, ComplexArray, FloatArray, IntArray
from ..compiled import einsum
from ..progress import Report, parts, shares, silent
from .profile import CACHE_DOUBLES, peaks, profile_polynomial, screen
from .scan import ENDING, STARTING, Scan, default_onsets, difference, largest_magnitude, scan_shape
from .waveform import sine

if TYPE_CHECKING:
    from .pairs import Pair, PairLimits, PairTables

# Numbers of the running sums that are made together, 1.6 MB: more leave the processor's cache, and take a third longer.
TOGETHER = 100_000
# Onsets at which a sine is screened, those that promise most.
MOST_ONSETS = 64
# Logarithm of the ratio of what is left of the record from one border to the next, at which sine and cosine are known.
CLOSER = 0.05
# A Gram matrix whose smallest eigenvalue is below this share of its trace is rounding.
ROUNDING = 1e-9


def screen_at(scan: Scan, frequencies: FloatArray, onsets: Sequence[IntArray], report: Report = silent) -> FloatArray:
    """Return the largest screened statistic (n_frequencies,) of each sine over its onsets, 0 where it has none.

    Of many onsets those that promise most are screened.

    Parameters
    ----------
    scan : from `prepare_scan`.
    frequencies : (n_frequencies,) cycles per sample; onsets : per frequency, samples.
    report : called with the fraction that is done.
    """
    lowest, several = np.zeros(len(frequencies)), max(1, TOGETHER // scan.Q.size)
    most = max(1, CACHE_DOUBLES // (scan.order + scan.n_outputs) ** 2)
    for first, _ in parts(report, range(0, len(frequencies), several)):
        angles, at = 2.0 * np.pi * frequencies[first : first + several], onsets[first : first + several]
        sines = Sines(scan, angles)
        at = [
            sines.most_promising(k, candidates) if len(candidates) > MOST_ONSETS else candidates
            for k, candidates in enumerate(at)
        ]
        k, onset = np.repeat(np.arange(len(at)), [len(candidates) for candidates in at]), np.concatenate(at)
        for some in (slice(i, i + most) for i in range(0, len(k), most)):
            F = screen(profile_polynomial(*sines.inner_products(k[some], onset[some]), scan.W), sines.bound[k[some]])
            np.minimum.at(lowest, first + k[some], F)
    return -scan.n_rows * lowest


class Sines:
    """Sines of some angles, (n_angles,) radians per sample, and their inner products with a record.

    `tables` has, per difference, (n_base + m, n_angles * n_samples) [Q0 Q1]' times the sine that starts at each sample,
    and `bound`, (n_angles,), the largest magnitude of each.
    """

    def __init__(self, scan: Scan, angles: FloatArray) -> None:
        n, s = scan.n_samples, scan.order
        self.scan = scan
        turning = np.exp(1j * np.outer(angles, np.arange(n)))
        self.bound = largest_magnitude(scan, np.abs(turning.imag).max(axis=1))
        sums = scan.Q[:, None] * turning
        np.cumsum(sums[..., ::-1], axis=-1, out=sums[..., ::-1])
        tables = [sums.imag * turning.real]
        tables[0] -= sums.real * turning.imag
        for _ in range(scan.degree):
            # A shape less the same one sample later.
            tables.append(tables[-1].copy())
            tables[-1][..., :-1] -= tables[-2][..., 1:]
        self.tables = [table.reshape(len(scan.Q), -1) for table in tables]
        squares = np.ones(n) if scan.weights is None else scan.weights**2
        self.squares, self.remaining = squares, np.cumsum(squares[::-1])[::-1]
        self.doubled = np.cumsum((squares * turning**2)[:, ::-1], axis=1)[:, ::-1]
        self.turning = turning
        borders = _borders(n)
        self.border = np.searchsorted(borders, np.arange(n), side="right") - 1
        at = self.doubled[:, borders]
        self.steady_share = _explained_by_both(scan, sums[..., borders], self.remaining[borders], at)
        # Copies at lags s .. 0, differenced: the difference of exp(i w k) is exp(i w k) (1 - exp(-i w)).
        lags, degrees = np.arange(s, -1, -1), np.array(scan.degrees)
        turned, half = angles[:, None], 0.5 * angles[:, None]
        self.steady = np.exp(-1j * turned * (lags + 0.5 * degrees)) * (2j * np.sin(half)) ** degrees
        # The copies in the samples 1 .. s - 1 after the onset, (n_angles, s - 1, s + 1).
        since = np.arange(1, s)[:, None] - lags
        copies = np.where(since < 0, 0.0, np.sin(turned[..., None] * since))
        self.early = difference(copies.transpose(2, 0, 1), scan.degree).transpose(1, 2, 0)

    def most_promising(self, k: int, onsets: IntArray) -> IntArray:
        """Return `MOST_ONSETS` of the onsets of a sine, or as many as there are."""
        if len(onsets) <= MOST_ONSETS:
            return onsets
        share = self.scan.impulses()[onsets] + self.steady_share[k, self.border[onsets]]
        return onsets[np.sort(np.argpartition(-share, MOST_ONSETS)[:MOST_ONSETS])]

    def inner_products(self, k: IntArray, onset: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return C and S of `profile_polynomial` for pairs (n_pairs,) of angle and onset."""
        scan, s = self.scan, self.scan.order
        begin = onset + s
        C = np.empty((len(scan.Q), s + 1, len(k)))
        for j, degree in enumerate(scan.degrees):
            C[:, j] = np.take(self.tables[degree], k * scan.n_samples + begin - j, axis=1)
        turned = (self.steady[k] * np.conj(self.turning[k, onset])[:, None]).T
        common, changing = self.remaining[begin], self.doubled[k, begin]
        early = self.early[k].transpose(1, 2, 0)
        weights = self.squares[onset + np.arange(1, s)[:, None]]
        S = np.empty((s + 1, s + 1, len(k)))
        for i in range(s + 1):
            steady = 0.5 * np.real(turned[i] * (np.conj(turned[i:]) * common - turned[i:] * changing))
            steady += einsum("ln,ljn->jn", weights * early[:, i], early[:, i:])
            steady -= einsum("qn,qjn->jn", C[: scan.n_base, i], C[: scan.n_base, i:])
            S[i, i:] = S[i:, i] = steady
        return C[scan.n_base :], S


def promised(scan: Scan, frequencies: FloatArray) -> FloatArray:
    """Return about the largest statistic (n_frequencies,) that each sine may have, at any onset and of any size.

    It is that of impulses in the samples after the onset, and of a sine and a cosine from there on, together: what a
    sine and its lagged copies consist of. The two are taken for uncorrelated off the regressors.

    Parameters
    ----------
    frequencies : (n_frequencies,) cycles per sample.
    """
    n, borders, onsets = scan.n_samples, _borders(scan.n_samples), default_onsets(scan)
    squares = np.ones(n) if scan.weights is None else scan.weights**2
    # Sums from each border to the next, then from each border on.
    steps = list(pairwise([*borders.tolist(), n]))
    sums, doubled = (
        np.stack([(rows[..., first:end] @ turns[first:end]).view(np.complex128) for first, end in steps], axis=-1)
        for rows, turns in zip((scan.Q, squares), _turning(n, frequencies.tobytes()), strict=True)
    )
    sums, doubled = (np.cumsum(x[..., ::-1], axis=-1)[..., ::-1] for x in (sums, doubled))
    steady = _explained_by_both(scan, sums, np.cumsum(squares[::-1])[::-1][borders], doubled)
    steady = np.maximum(steady, np.concatenate([steady[:, 1:], steady[:, -1:]], axis=1))
    share = scan.impulses()[onsets] + steady[:, np.searchsorted(borders, onsets, side="right") - 1]
    early = onsets <= n - MIN_CYCLES / frequencies[:, None]
    left = np.maximum(1.0 - np.max(share, axis=1, initial=0.0, where=early), TINY)
    return np.asarray(-scan.n_rows * np.log(left))


@lru_cache(maxsize=2)  # windows of a flight ask for the same
def _turning(n: int, frequencies: bytes) -> tuple[FloatArray, FloatArray]:
    """Return exp(i w k) of cycles per sample, and its square, (n, 2 n_frequencies): real and imaginary parts."""
    turning = np.exp(2j * np.pi * np.outer(np.arange(n), np.frombuffer(frequencies)))
    return turning.view(np.float64), (turning**2).view(np.float64)


def _borders(n: int) -> IntArray:
    """Return the samples of a record of n from which on sines and cosines are compared with it."""
    left = n * np.exp(-CLOSER * np.arange(1 + int(np.log(n) / CLOSER)))
    return np.unique((n - left).astype(np.intp))


def _explained_by_both(scan: Scan, sums: ComplexArray, total: FloatArray, doubled: ComplexArray) -> FloatArray:
    """Return the share (n_angles, n_borders) of the residuals that sine and cosine from a border on explain.

    Parameters
    ----------
    sums : (n_rows, n_angles, n_borders) of the rows of the record times exp(i w k) from each border on.
    total, doubled : (n_borders,) and (n_angles, n_borders) of the squared weights, alike, and times exp(2i w k).
    """
    n_regressors = len(scan.Q) - scan.n_outputs
    known, errors = sums[:n_regressors], sums[n_regressors:]
    cosine = 0.5 * (total + doubled.real) - einsum("rkb,rkb->kb", known.real, known.real)
    sine = 0.5 * (total - doubled.real) - einsum("rkb,rkb->kb", known.imag, known.imag)
    both = 0.5 * doubled.imag - einsum("rkb,rkb->kb", known.real, known.imag)
    determinant = cosine * sine - both**2
    sound = determinant > ROUNDING * (cosine + sine) ** 2
    explained = errors.real**2 * sine + errors.imag**2 * cosine - 2.0 * errors.real * errors.imag * both
    return np.where(sound, explained.sum(axis=0) / np.where(sound, determinant, 1.0), 1.0)


# A frequency, cycles per sample, and a pair of start and end to begin with.
Trial = tuple[float, tuple[int, int]]

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
# Pairs per frequency of the grid: ends tried, pairs ranked, and branches that sweeps start from.
ENDS = 10
RANKED = 64
BRANCHES = 3
# Trials of frequencies around the peaks (8 + 2 x 2 x 8 + 2 x 9 x 3), at twice the onsets of the grid: for the progress.
REFINEMENTS = 190


def scan_frequency(
    scan: Scan, band: tuple[float, float], report: Report = silent, *, begin: Sequence[float] | None = None
) -> float:
    """Return the frequency, cycles per sample, of the sine that explains most, lasting to the end of the record.

    Parameters
    ----------
    scan : from `prepare_scan`.
    band : lowest and highest frequency, cycles per sample, within 0..0.5.
    report : called with the fraction that is done.
    begin : frequencies of the grid that stand out, where they are known; None for those that `screen_grid` shows.
    """
    grid, onsets = frequency_grid(scan, band), default_onsets(scan)

    def evaluate(trials: Sequence[Trial], trials_report: Report) -> list[tuple[float, Pair]]:
        frequencies = np.array([frequency for frequency, _ in trials])
        statistic = screen_sines(scan, frequencies, trials_report, per_period=2 * ONSETS_PER_PERIOD).tolist()
        return [(value, pair) for value, (_, pair) in zip(statistic, trials, strict=True)]

    searching, refining, last = shares(report, len(grid), REFINEMENTS, 3 * FINAL_PEAKS)
    if begin is None:
        begin = standing_out(scan, grid, searching)
    trials = [(frequency, (int(onsets[0]), scan.n_samples)) for frequency in begin[:PEAKS]]
    exact = []
    for (_, _, frequency), part_report in parts(last, _refine(evaluate, trials, grid, refining)):
        profile = scan_shape(scan, sine(scan.n_samples, angle=2.0 * np.pi * frequency), onsets, report=part_report)
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
    from .pairs import climb, pair_limits, screen_pairs, spread, tabulate_pairs

    room = scan.n_samples - (STARTING + ENDING) * scan.order - 1
    grid = frequency_grid(scan, (max(band[0], MIN_CYCLES / room) if band[0] > 0.0 < room else band[0], band[1]))

    def prepare(frequency: float) -> tuple[PairTables, PairLimits]:
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        shortest = max(int(np.ceil(MIN_CYCLES / frequency)), ENDING * scan.order)
        return tabulate_pairs(scan, waveform), pair_limits(scan, waveform, shortest)

    def evaluate(trials: Sequence[Trial], trials_report: Report) -> list[tuple[float, Pair]]:
        tops = []
        for (frequency, pair), trial_report in parts(trials_report, trials):
            tables, limits = prepare(frequency)
            tops.append(climb(scan, tables, limits=limits, begin=[pair], report=trial_report))
        return tops

    searching, refining = shares(report, len(grid), REFINEMENTS)
    rough = []
    for frequency, part_report in parts(searching, list(grid)):
        tables, limits = prepare(frequency)
        starts = np.arange(limits.first, limits.last - limits.shortest + 1, stride(frequency, ONSETS_PER_PERIOD))
        ends = np.linspace(limits.first + limits.shortest, limits.last, ENDS).astype(np.intp)
        pairs = limits.pairs(starts, ends)
        ranking, climbing = shares(part_report, 1, 1)
        ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs, ranking))[:RANKED]]
        begin = spread(ranked, count=BRANCHES, reach=limits.shortest // 2)
        rough.append(climb(scan, tables, limits=limits, begin=begin, finalists=0, rounds=2, report=climbing))
    statistic = np.array([value for value, _ in rough])
    begun = [(float(grid[k]), rough[k][1]) for k in peaks(statistic, PEAKS)]
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


def screen_sines(
    scan: Scan, frequencies: FloatArray, report: Report = silent, *, per_period: int = ONSETS_PER_PERIOD
) -> FloatArray:
    """Return the largest screened statistic (n_frequencies,) of sines over few onsets, 0 where all are too late."""
    return screen_at(scan, frequencies, [sine_onsets(scan, f, per_period) for f in frequencies.tolist()], report)


def screen_grid(scan: Scan, grid: FloatArray, report: Report = silent) -> FloatArray:
    """Return `screen_sines` of a grid (n_frequencies,), made once for each record."""
    key = grid.tobytes()
    if key not in scan.screened:
        scan.screened[key] = screen_sines(scan, grid, report)
    report(1.0)
    return scan.screened[key]


def standing_out(scan: Scan, grid: FloatArray, report: Report = silent) -> list[float]:
    """Return the few frequencies of a grid (n_frequencies,) that stand out most, the highest peak first."""
    return [float(grid[k]) for k in peaks(screen_grid(scan, grid, report), PEAKS)]


def _refine(
    evaluate: Callable[[Sequence[Trial], Report], list[tuple[float, Pair]]],
    begin: list[Trial],
    grid: FloatArray,
    report: Report,
) -> list[tuple[float, Pair, float]]:
    """Return the best few statistics, pairs and frequencies: the grid's step is halved around each, the best are kept.

    `evaluate` gives the best statistic at each of some frequencies, and its pair, from the pair of a frequency nearby.
    """
    step = float(grid[-1] - grid[0]) / max(len(grid) - 1, 1)
    first, *later = shares(report, 1, *(2 * n for n in HALVINGS))
    tops = [(*top, frequency) for top, (frequency, _) in zip(evaluate(begin, first), begin, strict=True)]
    for halvings, halving_report in zip(HALVINGS, later, strict=True):
        for half, part_report in parts(halving_report, [step * 0.5**k for k in range(1, halvings + 1)]):
            beside = [
                (n, (frequency + sign * half, pair))
                for n, (_, pair, frequency) in enumerate(tops)
                for sign in (-1.0, 1.0)
                if grid[0] <= frequency + sign * half <= grid[-1]
            ]
            for (n, (frequency, _)), top in zip(
                beside, evaluate([trial for _, trial in beside], part_report), strict=True
            ):
                if top[0] > tops[n][0]:
                    tops[n] = (*top, frequency)
        tops = sorted(tops, reverse=True)[:FINAL_PEAKS]
        step *= 0.5**halvings
    return tops
