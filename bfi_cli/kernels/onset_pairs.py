"""Pairs of start and end of a fault of known shape (METHOD section 5, step 7).

A fault on [start, end) is the shape from its start minus its tail from the end, so that every pair needs nothing but
rows of a few tables.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .onset_profile import Pencil, minimise, pencil, screen
from .onset_scan import Profile, in_blocks, magnitude_bound, profile
from .onset_shapes import Waveform
from .onset_tables import Scan, correlations, differenced
from .progress import Report, silent

__all__ = ["EndTables", "scan_pairs", "screen_pairs", "tabulate_ends"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EndTables:
    """What pairs of start and end are assembled from.

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


def tabulate_ends(scan: Scan, waveform: Waveform) -> EndTables:
    """Return the tables of a shape for all starts and ends."""
    h, n, s = waveform.samples, scan.n_samples, scan.order
    energy = np.zeros((s + 1, n + 1))
    for d in range(s + 1):
        energy[d, 1 : n - d + 1] = np.cumsum(h[: n - d] * h[d:])
    return EndTables(
        waveform=waveform,
        starts=_padded(correlations(scan, h), s),
        tails=tuple(_padded(correlations(scan, tail), s) for tail in waveform.tails),
        energy=energy,
    )


def _padded(tables: tuple[FloatArray, ...], order: int) -> tuple[FloatArray, ...]:
    return tuple(np.pad(P, ((0, 0), (0, order + 1))) for P in tables)


def stack_pairs(scan: Scan, tables: EndTables, pairs: IntArray) -> Pencil:
    """Gather the inner products of pairs (2, n_pairs) of start and end."""
    s, n_base, (start, end) = scan.order, scan.n_base, pairs
    weights = tables.waveform.weights[:, end - start]
    C = np.empty((len(scan.Q), s + 1, len(start)))
    for j, a in enumerate(scan.degrees):
        C[:, j] = tables.starts[a][:, start + s - j]
        for weight, tail in zip(weights, tables.tails, strict=True):
            C[:, j] -= weight * tail[a][:, end + s - j]
    S = _energies(scan, tables, pairs)
    for i in range(s + 1):
        S[i, i:] -= np.einsum("qn,qjn->jn", C[:n_base, i], C[:n_base, i:])
        S[i + 1 :, i] = S[i, i + 1 :]
    return pencil(C[n_base:], S, scan.W)


def _energies(scan: Scan, tables: EndTables, pairs: IntArray) -> FloatArray:
    """T' T (s + 1, s + 1, n_pairs) of lags s .. 0, differenced only at the end: these sums of a drift are exact."""
    s, (start, end) = scan.order, pairs
    S = np.empty((s + 1, s + 1, len(start)))
    for i in range(s + 1):
        for j in range(i, s + 1):
            terms = np.minimum(end - start - (j - i), scan.n_samples - start - (s - i))
            S[i, j] = S[j, i] = tables.energy[j - i, np.maximum(terms, 0)]
    return differenced(differenced(S, scan.degree).transpose(1, 0, 2), scan.degree)


def scan_pairs(scan: Scan, tables: EndTables, pairs: IntArray, report: Report = silent) -> Profile:
    """Return the exact profile over the magnitude of pairs (2, n_pairs); its `onsets` are the starts."""
    bound = magnitude_bound(scan, tables.waveform, pairs[1] - pairs[0])
    found = in_blocks(scan, bound, lambda b: minimise(stack_pairs(scan, tables, pairs[:, b]), bound[b]), report)
    return profile(scan, tables.waveform, onsets=pairs[0], found=found)


def screen_pairs(scan: Scan, tables: EndTables, pairs: IntArray, report: Report = silent) -> FloatArray:
    """Return a lower bound (n_pairs,) of the statistic of pairs (2, n_pairs), usually close."""
    bound = magnitude_bound(scan, tables.waveform, pairs[1] - pairs[0])
    found = in_blocks(scan, bound, lambda b: screen(stack_pairs(scan, tables, pairs[:, b]), bound[b]), report)
    return -scan.n_rows * found.F
