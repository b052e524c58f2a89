"""One shape at every onset (METHOD section 5): the exact profile over the magnitude, and the statistic it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .onset_profile import Minimum, Pencil, log_ratio, minimise, pencil
from .onset_shapes import Waveform
from .onset_tables import Scan, Tables, tabulate
from .progress import Report, parts, silent

__all__ = [
    "Profile",
    "default_onsets",
    "in_blocks",
    "magnitude_bound",
    "profile",
    "rss_at",
    "scan_shape",
    "stack_onsets",
]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

STARTING, ENDING = 3, 2
GENEROUS = 10.0
CACHE_DOUBLES = 120_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """The best magnitude of one shape at each onset.

    Attributes
    ----------
    onsets : (n_onsets,) samples.
    z : (n_onsets,) magnitudes; sd : (n_onsets,) from the curvature, NaN where there is none.
    rss : (n_onsets,) and rss0 without a fault: residual sums of squares, for several outputs the determinant of the
        residuals' products.
    statistic : (n_onsets,) n_rows log(rss0 / rss), never negative.
    """

    onsets: IntArray
    z: FloatArray
    sd: FloatArray
    rss: FloatArray
    rss0: float
    statistic: FloatArray

    @property
    def best(self) -> int:
        """Index of the largest statistic."""
        return int(np.argmax(self.statistic))


def default_onsets(scan: Scan) -> IntArray:
    """Return the onsets at which the minimum over z is well defined: 3 s from the start, 2 s before the end."""
    return np.arange(STARTING * scan.order, scan.n_samples - ENDING * scan.order + 1)


def magnitude_bound(scan: Scan, waveform: Waveform, lengths: IntArray) -> FloatArray:
    """Return the largest |z|, in samples of the waveform, of a fault that acts for `lengths` samples.

    A fault ten times as large as all that the output does, beyond the base, is too large.
    """
    reach = np.maximum.accumulate(np.abs(waveform.samples))[lengths - 1]
    return GENEROUS * scan.span / np.maximum(reach, np.finfo(float).tiny ** 0.25)


def scan_shape(
    scan: Scan,
    waveform: Waveform,
    onsets: IntArray | None = None,
    *,
    max_magnitude: float | None = None,
    report: Report = silent,
) -> Profile:
    """Return the exact profile over the magnitude of a fault that lasts to the end of the record.

    Parameters
    ----------
    scan : from `prepare_scan`.
    waveform : of the same number of samples, see `onset_shapes`.
    onsets : samples, each in s..n_samples - s - 1; `default_onsets` if None.
    max_magnitude : bound of |z|; `magnitude_bound` if None.
    report : told how far it is.
    """
    onsets = default_onsets(scan) if onsets is None else np.asarray(onsets, dtype=np.intp)
    _check(scan, waveform, onsets)
    tables = tabulate(scan, waveform.samples)
    if max_magnitude is None:
        bound = magnitude_bound(scan, waveform, scan.n_samples - onsets)
    else:
        bound = np.full(len(onsets), max_magnitude * waveform.unit)
    found = in_blocks(scan, bound, lambda b: minimise(stack_onsets(scan, tables, onsets[b]), bound[b]), report)
    return profile(scan, waveform, onsets=onsets, found=found)


def rss_at(scan: Scan, waveform: Waveform, onsets: IntArray, *, z: FloatArray) -> FloatArray:
    """Return rss (n_onsets,) at given magnitudes (n_onsets,)."""
    _check(scan, waveform, onsets)
    stack = stack_onsets(scan, tabulate(scan, waveform.samples), onsets)
    return scan.rss0 * np.exp(log_ratio(stack, z * waveform.unit))


def stack_onsets(scan: Scan, tables: Tables, onsets: IntArray) -> Pencil:
    """Gather the inner products of some onsets from the tables of a shape."""
    s, degrees = scan.order, scan.degrees
    C = np.stack([tables.P[a][scan.n_base :, onsets + s - j] for j, a in enumerate(degrees)], axis=1)
    S = np.empty((s + 1, s + 1, len(onsets)))
    for i, a in enumerate(degrees):
        for j in range(i, s + 1):
            S[i, j] = S[j, i] = tables.G[a, degrees[j], j - i][onsets + s - i]
    return pencil(C, S, scan.W)


def in_blocks(scan: Scan, bound: FloatArray, minimised: Callable[[slice], Minimum], report: Report = silent) -> Minimum:
    """Return the minima of a long stack, made in blocks that stay in the processor's cache."""
    size = max(1, CACHE_DOUBLES // (scan.order + scan.n_outputs) ** 2)
    blocks = [minimised(slice(i, i + size)) for i, _ in parts(report, range(0, len(bound), size))]
    z, F, curvature = (np.concatenate([getattr(x, name) for x in blocks]) for name in ("z", "F", "curvature"))
    return Minimum(z=z, F=F, curvature=curvature)


def profile(scan: Scan, waveform: Waveform, *, onsets: IntArray, found: Minimum) -> Profile:
    """Return minima in the units of a caller."""
    bent = np.where(found.curvature > 0.0, found.curvature, np.nan)
    return Profile(
        onsets=onsets,
        z=found.z / waveform.unit,
        sd=np.sqrt(2.0 / (bent * scan.n_rows)) / waveform.unit,
        rss=scan.rss0 * np.exp(found.F),
        rss0=scan.rss0,
        statistic=np.maximum(-scan.n_rows * found.F, 0.0),
    )


def _check(scan: Scan, waveform: Waveform, onsets: IntArray) -> None:
    if waveform.samples.shape != (scan.n_samples,):
        raise ValueError(f"the shape has {len(waveform.samples)} samples, the record {scan.n_samples}")
    first, last = scan.order, scan.n_samples - scan.order - 1
    if onsets.size and not (first <= onsets.min() and onsets.max() <= last):
        raise ValueError(f"onsets must lie in {first}..{last}, got {onsets.min()}..{onsets.max()}")
