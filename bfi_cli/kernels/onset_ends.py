"""Start and end of a fault of known shape: the search over pairs (METHOD section 5, step 7).

From the best pairs of a coarse grid and of the scans with one of the two at the edge of the record, sweeps over all
starts and over all ends alternate. On the way a sweep looks at one magnitude per pair, and exactly only at the best;
the sweeps around the pair returned are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .onset_pairs import EndTables, scan_pairs, screen_pairs, tabulate_ends
from .onset_scan import ENDING, STARTING, Profile
from .onset_shapes import Waveform
from .onset_tables import Scan
from .progress import Report, parts, shares, silent

__all__ = ["Limits", "Pair", "Span", "climb", "pair_limits", "peaks", "scan_ends", "span_at", "spread"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Pair = tuple[int, int]

GRID = 160
PEAKS = 3
CLIMBS = 6
APART = 4
ROUNDS = 8
FINALISTS = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Pairs to consider: starts from `first`, ends to `last`, at least `shortest` samples between them."""

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
class Span:
    """The best start and end.

    Attributes
    ----------
    start, end : samples; the fault acts on [start, end).
    z, sd, rss, statistic : there, as in `Profile`.
    over_starts : all starts at this end; over_ends : all ends at this start, its `onsets` being the ends.
    """

    start: int
    end: int
    z: float
    sd: float
    rss: float
    statistic: float
    over_starts: Profile
    over_ends: Profile


def pair_limits(scan: Scan, waveform: Waveform, min_duration: int | None = None) -> Limits:
    """Return the pairs for which the minimum over z is well defined.

    Raises
    ------
    ValueError : there is none.
    """
    shortest = max(waveform.shortest, ENDING * scan.order if min_duration is None else min_duration, 1)
    first, last = STARTING * scan.order, scan.n_samples - ENDING * scan.order
    if last - first < shortest:
        raise ValueError(f"a fault of {shortest} samples does not fit between samples {first} and {last}")
    return Limits(first=first, last=last, shortest=shortest)


def scan_ends(scan: Scan, waveform: Waveform, *, min_duration: int | None = None, report: Report = silent) -> Span:
    """Return the best start and end of a fault.

    Parameters
    ----------
    scan : from `prepare_scan`.
    waveform : of the same number of samples.
    min_duration : samples between start and end, at least; 2 s if None.
    report : told how far it is.

    Raises
    ------
    ValueError : the record is too short for any pair.
    """
    tables, limits = tabulate_ends(scan, waveform), pair_limits(scan, waveform, min_duration)
    looking, climbing, last = shares(report, 1, 2, 1)
    begin = _candidates(scan, tables, limits, looking)
    _, pair = climb(scan, tables, limits=limits, begin=begin, report=climbing)
    return span_at(scan, tables, limits=limits, pair=pair, report=last)


def climb(
    scan: Scan,
    tables: EndTables,
    *,
    limits: Limits,
    begin: list[Pair],
    finalists: int = FINALISTS,
    rounds: int = ROUNDS,
    report: Report = silent,
) -> tuple[float, Pair]:
    """Return the best statistic, and its pair, that alternate sweeps reach from any of the pairs to begin with.

    Each sweep is screened and then exact for some finalists; without finalists the statistic is a lower bound.
    """
    sweeps: dict[tuple[str, int], tuple[float, Pair]] = {}

    def sweep(kind: str, at: int, own: Report) -> tuple[float, Pair]:
        if (kind, at) not in sweeps:
            pairs = limits.ends(at) if kind == "ends" else limits.starts(at)
            sweeps[kind, at] = _best(scan, tables, pairs, finalists=finalists, report=own)
        return sweeps[kind, at]

    tops = []
    for pair, of_begin in parts(report, begin):
        reached = -np.inf
        for _, of_round in parts(of_begin, range(rounds)):
            over_ends, over_starts = shares(of_round, 1, 1)
            _, pair = sweep("ends", min(pair[0], limits.last - limits.shortest), over_ends)
            statistic, pair = sweep("starts", pair[1], over_starts)
            if statistic <= reached:
                break
            reached = statistic
        tops.append((reached, pair))
    return max(tops)


def span_at(scan: Scan, tables: EndTables, *, limits: Limits, pair: Pair, report: Report = silent) -> Span:
    """Return the result at a pair, moved where the exact sweeps over starts and ends find better."""
    start, end = pair
    for _, of_round in parts(report, range(ROUNDS)):
        first, second = shares(of_round, 1, 1)
        ends = limits.ends(start)
        over_ends = scan_pairs(scan, tables, ends, first)
        end = int(ends[1, over_ends.best])
        over_starts = scan_pairs(scan, tables, limits.starts(end), second)
        best = over_starts.best
        if start == over_starts.onsets[best]:
            break
        start = int(over_starts.onsets[best])
    return Span(
        start=start,
        end=end,
        z=float(over_starts.z[best]),
        sd=float(over_starts.sd[best]),
        rss=float(over_starts.rss[best]),
        statistic=float(over_starts.statistic[best]),
        over_starts=over_starts,
        over_ends=replace(over_ends, onsets=ends[1]),
    )


def _best(scan: Scan, tables: EndTables, pairs: IntArray, *, finalists: int, report: Report) -> tuple[float, Pair]:
    """Return statistic and pair of the best of pairs (2, n)."""
    statistic = screen_pairs(scan, tables, pairs, report)
    if finalists:
        pairs = pairs[:, np.argsort(-statistic)[:finalists]]
        statistic = scan_pairs(scan, tables, pairs).statistic
    best = int(np.argmax(statistic))
    return float(statistic[best]), (int(pairs[0, best]), int(pairs[1, best]))


def _candidates(scan: Scan, tables: EndTables, limits: Limits, report: Report) -> list[Pair]:
    one_sided = limits.starts(limits.last), limits.ends(limits.first)
    high = [pairs[:, peaks(screen_pairs(scan, tables, pairs), PEAKS)] for pairs in one_sided]
    grid = np.linspace(limits.first, limits.last, GRID).astype(np.intp)
    pairs = limits.pairs(np.append(grid, high[0][0]), np.append(grid, high[1][1]))
    ranked = pairs[:, np.argsort(-screen_pairs(scan, tables, pairs, report))[: CLIMBS * FINALISTS]]
    ranked = ranked[:, np.argsort(-scan_pairs(scan, tables, ranked).statistic)]
    return spread(ranked, count=CLIMBS, reach=APART * max(1, (limits.last - limits.first) // GRID))


def spread(ranked: IntArray, *, count: int, reach: int) -> list[Pair]:
    """Return the first `count` of the pairs (2, n) that are more than `reach` samples from each one before."""
    kept: list[Pair] = []
    for start, end in ranked.T.tolist():
        if len(kept) < count and all(max(abs(start - a), abs(end - b)) > reach for a, b in kept):
            kept.append((start, end))
    return kept


def peaks(statistic: FloatArray, count: int) -> IntArray:
    """Return the indices of the highest local maxima, highest first."""
    padded = np.pad(statistic, 1, constant_values=-np.inf)
    maxima = np.flatnonzero((statistic >= padded[:-2]) & (statistic >= padded[2:]))
    return maxima[np.argsort(-statistic[maxima])[:count]]
