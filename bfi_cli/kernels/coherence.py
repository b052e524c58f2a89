"""Coherence, linear dependence and detectability of the signatures of a dictionary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import FloatArray
from .compiled import special
from .lagged import lagged

# Singular values of unit signatures below this share of the largest are round-off; chosen, not tuned.
RANK_TOLERANCE = 1e-10
# Lagged copies are dependent where their smallest singular value is below this share of the largest; chosen likewise.
HOMOGENEITY_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dependence:
    """How far signals are from being linearly dependent, each scaled to norm 1.

    Attributes
    ----------
    rank : of the signals, to 1e-10 of the largest singular value.
    condition_number : largest over smallest singular value; infinite where the rank is short.
    weakest : (n_signals,) of norm 1: the combination of the scaled signals that leaves the least.
    """

    rank: int
    condition_number: float
    weakest: FloatArray


def mutual_coherence(G: FloatArray) -> FloatArray:
    """Return (n_signals, n_signals) |g_i . g_j| / (|g_i| |g_j|); NaN in the row and column of a signal that is zero.

    Parameters
    ----------
    G : (n_rows, n_signals).
    """
    unit, zero = _unit_columns(G)
    coherence = np.minimum(np.abs(unit.T @ unit), 1.0)
    np.fill_diagonal(coherence, 1.0)
    coherence[zero, :] = coherence[:, zero] = np.nan
    return np.maximum(coherence, coherence.T)


def dependence(G: FloatArray) -> Dependence:
    """Return rank, condition number and weakest combination of the columns of (n_rows, n_signals) `G`."""
    if G.shape[1] == 0:
        return Dependence(rank=0, condition_number=1.0, weakest=np.zeros(0))
    R = np.linalg.qr(_unit_columns(G)[0], mode="r")
    _, s, Vt = np.linalg.svd(R, full_matrices=True)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[0]))
    condition_number = float(s[0] / s[-1]) if rank == G.shape[1] else float("inf")
    return Dependence(rank=rank, condition_number=condition_number, weakest=Vt[-1])


def _unit_columns(G: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    peak = np.max(np.abs(G), axis=0, initial=0.0)
    zero = peak == 0.0
    scaled = G / np.where(zero, 1.0, peak)
    norms = np.linalg.norm(scaled, axis=0)
    return scaled / np.where(zero, 1.0, norms), zero


def homogeneous_order(x: FloatArray, max_order: int) -> int | None:
    """Return the order of the linear difference equation that `x` obeys without input over all its samples.

    0 for zero, 1 for a constant, 2 for a ramp and for a sinusoid; orders of independent signals add. It is one less
    than the number of lagged copies of `x` that are the first to be linearly dependent. Initial values are free: a
    signal that starts m samples late obeys an equation of order m more.

    Parameters
    ----------
    x : (n_samples,).
    max_order : the largest order to try.

    Returns
    -------
    None where there is no such equation up to `max_order`, or too few samples to tell.
    """
    peak = float(np.max(np.abs(x), initial=0.0))
    if peak == 0.0:
        return 0
    for order in range(1, min(max_order, (len(x) - 1) // 3) + 1):
        s = np.linalg.svd(lagged(x[:, None] / peak, range(order + 1)), compute_uv=False)
        if s[-1] <= HOMOGENEITY_TOLERANCE * s[0]:
            return order
    return None


def detectable_deviations(n_candidates: int, *, charge: float, false_alarm: float, power: float) -> float:
    """Return how many of its standard deviations a magnitude must have to be declared with probability `power`.

    Parameters
    ----------
    n_candidates : signals that share the false-alarm rate, two-sided.
    charge : penalty of the selection criterion for one more signal, on the scale of twice the log-likelihood; 0 for
        none.
    """
    tail = -float(special.ndtri(false_alarm / (2.0 * max(n_candidates, 1))))
    return max(tail, float(np.sqrt(max(charge, 0.0)))) + float(special.ndtri(power))
