"""From what records say of a dictionary to bits at given magnitudes, averaged over the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.distinguishability import sample_bits, window_bits
from .measured import Measured

__all__ = ["Judged", "apart", "in_samples", "judge", "limits_of"]

FloatArray = NDArray[np.float64]

MOST_IN_SAMPLES = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judged:
    """Bits of every entry, NaN for those left out.

    Attributes
    ----------
    divergence : (n_atoms,) fault against no fault, in the whole window.
    between : (n_atoms, n_atoms) fault against fault, symmetric.
    apart : (n_atoms,) the fault against that other one, of any size, which is most like it.
    most_like : (n_atoms,) index of that one, -1 where there is none.
    """

    divergence: FloatArray
    between: FloatArray
    apart: FloatArray
    most_like: tuple[int, ...]


def limits_of(records: Sequence[Measured]) -> FloatArray:
    """Return (n_atoms,) minimal detectable magnitudes, the geometric mean over the records."""
    return np.asarray(np.exp(np.mean([np.log(record.limits) for record in records], axis=0)))


def judge(records: Sequence[Measured], magnitudes: FloatArray) -> Judged:
    """Return the bits of faults of these magnitudes, the mean over the records.

    Two faults differ in the prediction error along the signature of one of them off that of the other, which does not
    depend on the other's magnitude: nobody knows that. The one of the two directions that shows more counts.

    Parameters
    ----------
    records : with the same entries.
    magnitudes : (n_atoms,) root mean squares.
    """
    out = [j for j in range(len(magnitudes)) if j in records[0].reasons or not np.isfinite(magnitudes[j])]
    divergence = np.mean(
        [window_bits(record.separation, _deviations(record, magnitudes)) for record in records], axis=0
    )
    between = np.mean([_between(record, magnitudes) for record in records], axis=0)
    most_like = _most_like(records)
    kept = np.mean([apart(record, magnitudes) for record in records], axis=0)
    for values in (divergence, kept, between, between.T):
        values[out] = np.nan
    return Judged(divergence=divergence, between=between, apart=kept, most_like=most_like)


def apart(record: Measured, magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of each fault against the other one most like it, of any size; alone, against none."""
    rivals = np.where(np.eye(len(magnitudes), dtype=bool), np.nan, record.coherence)
    closest = np.max(np.nan_to_num(rivals), axis=1, initial=0.0)
    return window_bits(record.separation, _deviations(record, magnitudes) * np.sqrt(1.0 - closest**2))


def in_samples(records: Sequence[Measured], magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of fault against no fault in single prediction errors, the mean over the records.

    NaN where there are more than `MOST_IN_SAMPLES` faults: each has a density of its own to be estimated.
    """
    n_live = len(magnitudes) - len(records[0].reasons)
    if n_live > MOST_IN_SAMPLES:
        return np.full(len(magnitudes), np.nan)
    sizes = np.where(np.isfinite(magnitudes), magnitudes, np.nan)
    found = np.empty((len(records), len(magnitudes)))
    for n, record in enumerate(records):
        for place in set(record.places):
            own = np.flatnonzero(np.array(record.places) == place)
            found[n, own] = sample_bits(record.errors[:, place], sizes[own] * record.traces[:, own])
    return np.asarray(np.mean(found, axis=0))


def _deviations(record: Measured, magnitudes: FloatArray) -> FloatArray:
    """Magnitudes in units of their standard deviations, 0 where nothing shows."""
    return np.where(np.isfinite(magnitudes), magnitudes, 0.0) / record.sd


def _between(record: Measured, magnitudes: FloatArray) -> FloatArray:
    deviations = _deviations(record, magnitudes)
    larger = np.maximum(deviations[:, None], deviations)
    bits = window_bits(record.separation, larger * np.sqrt(1.0 - np.nan_to_num(record.coherence) ** 2))
    np.fill_diagonal(bits, 0.0)
    return bits


def _most_like(records: Sequence[Measured]) -> tuple[int, ...]:
    coherence = np.mean([np.nan_to_num(record.coherence) for record in records], axis=0)
    np.fill_diagonal(coherence, 0.0)
    return tuple(int(np.argmax(row)) if np.any(row > 0.0) else -1 for row in coherence)
