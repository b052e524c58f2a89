"""Gaussian elimination of many small symmetric matrices at once, stacked along the last axis.

One step of it is one array operation over the whole stack, which for matrices of ten rows is several times faster than
a call of a factorisation per matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["eliminate", "solve_last", "solved_norm"]

FloatArray = NDArray[np.float64]

SINGULAR = 1e-14


def eliminate(H: FloatArray, n_pivots: int) -> FloatArray:
    """Eliminate the first pivots of symmetric H (m, m, n) in place; return the Schur complement (m - n_pivots, ..., n).

    Rows above it then hold the factor: pivots on the diagonal, pivot rows right of it, multipliers below. A pivot that
    rounding leaves below 1e-14 of its diagonal entry is raised to that.
    """
    diagonal = np.einsum("iin->in", H)
    smallest = SINGULAR * diagonal + np.finfo(float).tiny
    for j in range(len(H)):
        if k := min(j, n_pivots):
            H[j, j:] -= np.einsum("kn,kin->in", H[j, :k], H[:k, j:])
        np.maximum(H[j, j], smallest[j], out=H[j, j])
        if j < n_pivots:
            np.divide(H[j, j + 1 :], H[j, j], out=H[j + 1 :, j])
    rest = H[n_pivots:, n_pivots:]
    for j in range(1, len(rest)):
        rest[j, :j] = rest[:j, j]
    return rest


def solve_last(H: FloatArray, n_pivots: int) -> FloatArray:
    """Return V (m, m - n_pivots, n), [-Haa^-1 Hab; I] of the H that `eliminate` went through."""
    m, n = len(H), H.shape[2]
    V = np.empty((m, m - n_pivots, n))
    V[n_pivots:] = np.eye(m - n_pivots)[:, :, None]
    for j in range(n_pivots - 1, -1, -1):
        np.einsum("in,irn->rn", H[j, j + 1 :], V[j + 1 :], out=V[j])
        V[j] /= -H[j, j]
    return V


def solved_norm(H: FloatArray, G: FloatArray) -> FloatArray:
    """Return G' Haa^-1 G (r, r, n) for G (n_pivots, r, n)."""
    G = G.copy()
    for j in range(len(G)):
        G[j + 1 :] -= H[j + 1 : len(G), j, None] * G[j]
    pivots = np.einsum("iin->in", H)[: len(G)]
    return np.asarray(np.einsum("irn,iqn->rqn", G / pivots[:, None], G))
