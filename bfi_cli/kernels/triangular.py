"""Least squares by a triangular factor, which is kept: the sketches of RISRO."""

from __future__ import annotations

import numpy as np

from . import EPS, FloatArray
from .compiled import einsum, lapack
from .lagged import PANEL

# Condition number, inverted, beyond which a least squares is taken to be rank deficient: its solution has four digits.
DEFICIENT = 1e-12
NO_SKETCH = np.zeros((1, 1))


def least_squares(S: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares solution of ``S x = y``, and S with columns of unit norm as a triangular factor.

    What lies below the factor's diagonal is not part of it. By QR; where S is rank deficient (condition number
    above 1e12), the solution of least norm in the scaled columns.
    """
    if not S.shape[1]:
        return np.zeros(0), np.zeros((0, 0))
    n = S.shape[1]
    norms = np.sqrt(einsum("ij,ij->j", S, S))
    norms[norms <= EPS * norms.max(initial=0.0)] = 1.0
    stacked = np.empty((max(len(S), n + 1), n + 1), order="F")
    stacked[: len(S), :n] = S / norms
    stacked[: len(S), n] = y
    stacked[len(S) :] = 0.0
    R = lapack.dgeqrt(min(PANEL, n + 1), stacked, overwrite_a=True)[0][:n]
    triangle, right = R[:, :n], R[:, n]
    if lapack.dtrcon(triangle)[0] > DEFICIENT:
        x = lapack.dtrtrs(triangle, right)[0]
    else:
        try:
            x = np.linalg.lstsq(np.triu(triangle), right, rcond=DEFICIENT)[0]
        except np.linalg.LinAlgError:
            # The SVD need not converge (seen with 40 noisy steps); a pivoted QR always ends.
            from scipy import linalg

            x = linalg.lstsq(np.triu(triangle), right, cond=DEFICIENT, lapack_driver="gelsy")[0]
    return x / norms, triangle
