"""RSS as a function of the magnitude: H(z) = I - z H1 + z^2 H2 for many onsets at once (METHOD section 5, steps 3-4).

H(z) holds the inner products of [lags | lag 0] of the corrected outputs in coordinates where they are I at z = 0. The
Schur complement S(z) of its last block is the residuals' covariance relative to the one without a fault; what is
minimised is F(z) = log det S(z), for one output log(RSS / RSS0). Onsets lie along the last axis, so that an elimination
step is one array operation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Pencil", "log_ratio"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pencil:
    """H1 and H2 (m, m, n_onsets) of a stack of onsets; the last `n_outputs` rows are those of lag 0."""

    H1: FloatArray
    H2: FloatArray
    n_outputs: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Local:
    """F, its slope and its curvature, each (n_onsets,)."""

    F: FloatArray
    slope: FloatArray
    curvature: FloatArray


def log_ratio(pencil: Pencil, z: FloatArray) -> FloatArray:
    """Return F (n_onsets,) at the magnitudes z (n_onsets,)."""
    return _log_det(_eliminate(pencil, z)[0])


def _eliminate(pencil: Pencil, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """S and the whole of H after elimination of the lags: above the diagonal the rows of the factor."""
    H = z * pencil.H2
    H -= pencil.H1
    H *= z
    m = len(H)
    H[np.arange(m), np.arange(m)] += 1.0
    s = m - pencil.n_outputs
    for j in range(s):
        H[j + 1 :, j + 1 :] -= (H[j, j + 1 :] / H[j, j])[:, None] * H[j, None, j + 1 :]
    return H[s:, s:], H


def _log_det(S: FloatArray) -> FloatArray:
    if len(S) == 1:
        return np.log(np.maximum(S[0, 0], np.finfo(float).tiny))
    return np.linalg.slogdet(S.transpose(2, 0, 1))[1]
