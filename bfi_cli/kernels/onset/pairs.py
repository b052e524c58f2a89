"""Start and end of a fault of known shape: exact for every pair of them, and the search for the best pair.

A fault on [start, end) is the shape from its start minus its tail from the end, so that every pair needs nothing but
rows of a few tables. The search begins at the best pairs of a coarse grid and of the scans with start or end at the
edge of the record. From each, sweeps over all starts and over all ends alternate. A sweep evaluates every pair at one
magnitude and only the best pairs exactly; the last sweeps, around the pair returned, are exact everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from .. import FloatArray, IntArray
from ..progress import Report, parts, shares, silent
from .profile import ProfilePolynomial, minimise, peaks, profile_polynomial, screen
from .scan import (
    ENDING,
    FINALISTS,
    STARTING,
    Profile,
    Scan,
    correlations,
    difference,
    in_blocks,
    in_units,
    magnitude_bound,
)
from .waveform import Waveform

Pair = tuple[int, int]

# With these the search finds the best of all pairs in at least 94 of 100 random records, as a slow test asserts:
# points of the coarse grid, peaks of each one-sided scan that join it, pairs that sweeps start from, steps of the grid
# that these lie apart, and sweeps from each at most.
GRID = 160
PEAKS = 3
CLIMBS = 6
APART = 4
ROUNDS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairTables:
    """Tables from which the inner products of any pair of start and end are assembled.

    Attributes
    ----------
    waveform : the shape.
    starts : per difference, (n_base + m, n_samples + s + 1): [Q0 Q1]' times the shape, by start sample.
    tails : the same of each tail, by end sample.
    energy : (s + 1, n_samples + 1) cumulative sums of h(l) h(l + d), by d and number of terms.
    """

    waveform: Waveform
    starts: tuple[FloatArray, ...]
    tails: tuple[tuple[FloatArray, ...], ...]
    energy: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PairLimits:
    """Pairs to consider: starts from `first` on, ends up to `last`, at least `shortest` samples between them."""

    first: int
    last: int
    shortest: int

    def starts(self, end: int) -> IntArray:
        """Return the pairs (2, n) of all starts with one end."""
        starts = np.arange(self.first, end - self.shortest + 1)
        return np.stack([starts, np.full_like(starts, end)])

    def ends(self, start: int) -> IntArray:
        """Return the pairs (2, n) of all ends with one start."""
        ends = np.arange(start + self.shortest, self.last + 1)
        return np.stack([np.full_like(ends, start), ends])

    def pairs(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return all pairs (2, n) of these starts and ends that are far enough apart."""
        every = np.stack(np.meshgrid(np.unique(starts), np.unique(ends), indexing="ij")).reshape(2, -1)
        return every[:, every[1] - every[0] >= self.shortest]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairScan:
    """The best start and end: the fault acts on [start, `end`), the best start of the profile over all at this end."""

    end: int
    over_starts: Profile

    @property
    def start(self) -> int:
        """Sample of the best start."""
        return int(self.over_starts.onsets[self.over_starts.best])

    @property
    def statistic(self) -> float:
        """The statistic of the best start and end."""
        return float(self.over_starts.statistic.max())


def tabulate_pairs(scan: Scan, waveform: Waveform) -> PairTables:
    """Return the tables of a shape for all starts and ends."""
    h, n, s = waveform.samples, scan.n_samples, scan.order
    energy = np.zeros((s + 1, n + 1))
    for d in range(s + 1):
        energy[d, 1 : n - d + 1] = np.cumsum(h[: n - d] * h[d:])
    starts, *tails = (
        tuple(np.pad(P, ((0, 0), (0, s + 1))) for P in correlations(scan, signal)) for signal in (h, *waveform.tails)
    )
    return PairTables(waveform=waveform, starts=starts, tails=tuple(tails), energy=energy)


def scan_pairs(scan: Scan, tables: PairTables, pairs: IntArray, report: Report = silent) -> Profile:
    """Return the exact profile over the magnitude of pairs (2, n_pairs); its `onsets` are the starts."""
    bound = magnitude_bound(scan, tables.waveform, pairs[1] - pairs[0])
    stack = partial(_stack_pairs, scan, tables)
    minimum = in_blocks(scan, len(bound), lambda b: minimise(stack(pairs[:, b]), bound[b]), report)
    return in_units(scan, tables.waveform, pairs[0], minimum)


def screen_pairs(scan: Scan, tables: PairTables, pairs: IntArray, report: Report = silent) -> FloatArray:
    """Return a lower bound (n_pairs,) of the statistic of pairs (2, n_pairs), usually close."""
    bound = magnitude_bound(scan, tables.waveform, pairs[1] - pairs[0])
    stack = partial(_stack_pairs, scan, tables)
    return -scan.n_rows * in_blocks(scan, len(bound), lambda b: screen(stack(pairs[:, b]), bound[b]), report)


def _stack_pairs(scan: Scan, tables: PairTables, pairs: IntArray) -> ProfilePolynomial:
    """Gather the inner products of pairs (2, n_pairs) of start and end."""
    s, n_base, (start, end) = scan.order, scan.n_base, pairs
    weights = tables.waveform.weights[:, end - start]
    C = np.empty((len(scan.Q), s + 1, len(start)))
    for j, a in enumerate(scan.degrees):
        C[:, j] = tables.starts[a][:, start + s - j]
        for weight, tail in zip(weights, tables.tails, strict=True):
            C[:, j] -= weight * tail[a][:, end + s - j]
    # T' T of lags s .. 0, differenced only at the end: these sums of a drift are exact.
    S = np.empty((s + 1, s + 1, len(start)))
    for i in range(s + 1):
        for j in range(i, s + 1):
            terms = np.minimum(end - start - (j - i), scan.n_samples - start - (s - i))
            S[i, j] = S[j, i] = tables.energy[j - i, np.maximum(terms, 0)]
    S = difference(difference(S, scan.degree).transpose(1, 0, 2), scan.degree)
    for i in range(s + 1):
        S[i, i:] -= np.einsum("qn,qjn->jn", C[:n_base, i], C[:n_base, i:])
        S[i + 1 :, i] = S[i, i + 1 :]
    return profile_polynomial(C[n_base:], S, scan.W)


def pair_limits(scan: Scan, waveform: Waveform, min_duration: int | None = None) -> PairLimits:
    """Return the pairs for which the minimum over z is well defined.

    Raises
    ------
    ValueError : there is none.
    """
    shortest = max(waveform.shortest, ENDING * scan.order if min_duration is None else min_duration, 1)
    first, last = STARTING * scan.order, scan.n_samples - ENDING * scan.order
    if last - first < shortest:
        raise ValueError(f"a fault of {shortest} samples does not fit between samples {first} and {last}")
    return PairLimits(first=first, last=last, shortest=shortest)


def scan_ends(scan: Scan, waveform: Waveform, report: Report = silent) -> PairScan:
    """Return the best start and end of a fault.

    Parameters
    ----------
    scan : from `prepare_scan`.
    waveform : of the same number of samples.
    report : called with the fraction that is done.

    Raises
    ------
    ValueError : the record is too short for any pair.
    """
    tables, limits = tabulate_pairs(scan, waveform), pair_limits(scan, waveform)
    looking, climbing, last = shares(report, 1, 2, 1)
    lasting, early = (
        pairs[:, peaks(screen_pairs(scan, tables, pairs), PEAKS)]
        for pairs in (limits.starts(limits.last), limits.ends(limits.first))
    )
    grid = np.linspace(limits.first, limits.last, GRID).astype(np.intp)
    pairs = limits.pairs(np.append(grid, lasting[0]), np.append(grid, early[1]))
    ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs, looking))[: CLIMBS * FINALISTS]]
    ranked = ranked[:, np.argsort(-scan_pairs(scan, tables, ranked).statistic)]
    begin = spread(ranked, count=CLIMBS, reach=APART * max(1, (limits.last - limits.first) // GRID))
    _, pair = climb(scan, tables, limits=limits, begin=begin, report=climbing)
    # Exact sweeps over starts and ends, as long as they find better.
    start, _ = pair
    for _, round_report in parts(last, range(ROUNDS)):
        over_ends, over_starts = shares(round_report, 1, 1)
        ends = limits.ends(start)
        end = int(ends[1, scan_pairs(scan, tables, ends, over_ends).best])
        result = PairScan(end=end, over_starts=scan_pairs(scan, tables, limits.starts(end), over_starts))
        if start == result.start:
            break
        start = result.start
    report(1.0)
    return result


def climb(
    scan: Scan,
    tables: PairTables,
    *,
    limits: PairLimits,
    begin: list[Pair],
    finalists: int = FINALISTS,
    rounds: int = ROUNDS,
    report: Report = silent,
) -> tuple[float, Pair]:
    """Return the best statistic, and its pair, that alternate sweeps reach from any of the pairs to begin with.

    Each sweep is screened and then exact for some finalists; without finalists the statistic is a lower bound.
    """
    sweeps: dict[tuple[str, int], tuple[float, Pair]] = {}

    def sweep(kind: str, at: int, sweep_report: Report) -> tuple[float, Pair]:
        if (kind, at) not in sweeps:
            pairs = limits.ends(at) if kind == "ends" else limits.starts(at)
            statistic = screen_pairs(scan, tables, pairs, sweep_report)
            if finalists:
                pairs = pairs[:, np.argsort(-statistic)[:finalists]]
                statistic = scan_pairs(scan, tables, pairs).statistic
            best = int(np.argmax(statistic))
            sweeps[kind, at] = float(statistic[best]), (int(pairs[0, best]), int(pairs[1, best]))
        return sweeps[kind, at]

    tops = []
    for pair, begin_report in parts(report, begin):
        reached = -np.inf
        for _, round_report in parts(begin_report, range(rounds)):
            over_ends, over_starts = shares(round_report, 1, 1)
            _, pair = sweep("ends", min(pair[0], limits.last - limits.shortest), over_ends)
            statistic, pair = sweep("starts", pair[1], over_starts)
            if statistic <= reached:
                break
            reached = statistic
        tops.append((reached, pair))
    return max(tops)


def spread(ranked: IntArray, *, count: int, reach: int) -> list[Pair]:
    """Return the first `count` of the pairs (2, n) that are more than `reach` samples from each one before."""
    kept: list[Pair] = []
    for start, end in ranked.T.tolist():
        if len(kept) < count and all(max(abs(start - a), abs(end - b)) > reach for a, b in kept):
            kept.append((start, end))
    return kept
