"""Divergences in bits of the faults of a dictionary at given magnitudes, averaged over records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..kernels import FloatArray
from ..kernels.distinguishability import sample_bits, window_bits
from .signatures import Signatures

# Faults. Each needs the estimate of a density and its integral; more than these take minutes.
MOST_IN_SAMPLES = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Divergences:
    """Bits of every entry, NaN for those left out.

    Attributes
    ----------
    whole : (n_atoms,) fault against no fault, in the whole window.
    between : (n_atoms, n_atoms) fault against fault, symmetric.
    apart : (n_atoms,) the fault against that other one, of any size, which is most like it.
    most_like : (n_atoms,) index of that one, -1 where there is none.
    """

    whole: FloatArray
    between: FloatArray
    apart: FloatArray
    most_like: tuple[int, ...]


def minimal_detectable(records: Sequence[Signatures]) -> FloatArray:
    """Return (n_atoms,) minimal detectable magnitudes, the geometric mean over the records."""
    return np.asarray(np.exp(np.mean([np.log(record.limits) for record in records], axis=0)))


def divergences(records: Sequence[Signatures], magnitudes: FloatArray) -> Divergences:
    """Return the bits of faults of these magnitudes, the mean over the records.

    Two faults differ in the prediction error along the signature of one of them off that of the other, which does not
    depend on the other's magnitude: nobody knows that. The one of the two directions that shows more counts.

    Parameters
    ----------
    records : with the same entries.
    magnitudes : (n_atoms,) root mean squares.
    """
    coherence = np.mean([np.nan_to_num(record.coherence) for record in records], axis=0)
    np.fill_diagonal(coherence, 0.0)
    whole, between, apart = [], [], []
    for record in records:
        deviations = _deviations(record, magnitudes)
        larger = np.maximum(deviations[:, None], deviations)
        bits = window_bits(record.separation, larger * np.sqrt(1.0 - np.nan_to_num(record.coherence) ** 2))
        np.fill_diagonal(bits, 0.0)
        between.append(bits)
        whole.append(window_bits(record.separation, deviations))
        apart.append(apart_bits(record, magnitudes))
    means = np.mean(whole, axis=0), np.mean(between, axis=0), np.mean(apart, axis=0)
    out = [j for j in range(len(magnitudes)) if j in records[0].reasons or not np.isfinite(magnitudes[j])]
    for values in (*means, means[1].T):
        values[out] = np.nan
    return Divergences(
        whole=means[0],
        between=means[1],
        apart=means[2],
        most_like=tuple(int(np.argmax(row)) if np.any(row > 0.0) else -1 for row in coherence),
    )


def apart_bits(record: Signatures, magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of each fault against the other one most like it, of any size; alone, against none."""
    rivals = np.where(np.eye(len(magnitudes), dtype=bool), np.nan, record.coherence)
    closest = np.max(np.nan_to_num(rivals), axis=1, initial=0.0)
    return window_bits(record.separation, _deviations(record, magnitudes) * np.sqrt(1.0 - closest**2))


def single_sample_bits(records: Sequence[Signatures], magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of fault against no fault in single prediction errors, the mean over the records.

    NaN where there are more than `MOST_IN_SAMPLES` faults: each has a density of its own to be estimated.
    """
    if len(magnitudes) - len(records[0].reasons) > MOST_IN_SAMPLES:
        return np.full(len(magnitudes), np.nan)
    finite = np.where(np.isfinite(magnitudes), magnitudes, np.nan)
    bits = np.empty((len(records), len(magnitudes)))
    for n, record in enumerate(records):
        for output in set(record.outputs):
            own = np.flatnonzero(np.array(record.outputs) == output)
            bits[n, own] = sample_bits(record.errors[:, output], finite[own] * record.traces[:, own])
    return np.asarray(np.mean(bits, axis=0))


def _deviations(record: Signatures, magnitudes: FloatArray) -> FloatArray:
    """Return the magnitudes in units of their standard deviations, 0 where nothing shows."""
    return np.where(np.isfinite(magnitudes), magnitudes, 0.0) / record.sd
