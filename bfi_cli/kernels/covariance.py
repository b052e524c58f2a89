"""How sure the magnitudes are: a fit laid out over its rows, and a covariance that admits serial correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from .lagged import lagged
from .variable_projection import Fit

__all__ = ["FitRows", "Layout", "SingleAdditions", "covariance", "single_additions", "unfold"]

FloatArray = NDArray[np.float64]

BLIND = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """A record as a fit sees it.

    Attributes
    ----------
    u : (n_samples, n_inputs), y : (n_samples, n_outputs), theta : (n_samples, n_outputs, n_atoms), all scaled.
    first : sample of the first row (the largest order of the study).
    feedthrough : inputs act in the same sample too.
    """

    u: FloatArray
    y: FloatArray
    theta: FloatArray
    first: int
    feedthrough: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitRows:
    """A fit over the rows first..n_samples - 1.

    Attributes
    ----------
    error : (n_rows, n_outputs) prediction error.
    signatures : (n_rows, n_outputs, n_atoms) filtered signatures of all atoms off the regressors.
    raw_norm : (n_atoms,) their norms before the projection.
    coefficients : (n_regressors, n_outputs) of [1, u lags, corrected y lags].
    condition_number : of the regressors, columns scaled.
    n_regressors : per output.
    """

    error: FloatArray
    signatures: FloatArray
    raw_norm: FloatArray
    coefficients: FloatArray
    condition_number: float
    n_regressors: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SingleAdditions:
    """What adding one atom to the support would give, linearised at the fit: NaN where the data cannot see it."""

    magnitude: FloatArray
    variance: FloatArray


def unfold(layout: Layout, fit: Fit) -> FitRows:
    """Lay a fit out over the rows of its record."""
    n_y, p = layout.y.shape[1], fit.order
    corrected = layout.y - layout.theta[:, :, list(fit.atoms)] @ fit.z
    input_lags = range(0 if layout.feedthrough else 1, p + 1)
    rows = layout.y.shape[0] - layout.first
    parts = [np.ones((rows, 1)), lagged(layout.u, input_lags, first=layout.first)]
    X = np.hstack([*parts, lagged(corrected, range(1, p + 1), first=layout.first)])
    scale = np.linalg.norm(X, axis=0)
    scale[scale == 0.0] = 1.0
    U, s, Vt = np.linalg.svd(X / scale, full_matrices=False)
    keep = s > 1e-12 * s[0]
    Q, now = U[:, keep], corrected[layout.first :]
    coefficients = (Vt[keep].T @ ((Q.T @ now) / s[keep, None])) / scale[:, None]
    g = _filtered(layout, fit)
    flat = g.reshape(rows, -1)
    off = (flat - Q @ (Q.T @ flat)).reshape(rows, n_y, -1)
    return FitRows(
        error=now - Q @ (Q.T @ now),
        signatures=off,
        raw_norm=np.sqrt(np.einsum("koj,koj->j", g, g)),
        coefficients=coefficients,
        condition_number=float(s[0] / s[-1]) if s[-1] > 0 else float("inf"),
        n_regressors=X.shape[1],
    )


def _filtered(layout: Layout, fit: Fit) -> FloatArray:
    """Signatures theta(k) - sum K_i theta(k - i) of every atom."""
    first, n = layout.first, layout.theta.shape[0]
    g = layout.theta[first:].copy()
    for i, K in enumerate(fit.K, start=1):
        g -= np.einsum("io,koj->kij", K, layout.theta[first - i : n - i])
    return g


def _whiten(fit: Fit, signals: FloatArray) -> FloatArray:
    """Divide (n_rows, n_outputs, ...) by the root of the residual covariance."""
    rows, n_y = signals.shape[:2]
    stacked = np.moveaxis(signals, 1, 0).reshape(n_y, -1)
    root = np.linalg.cholesky(fit.sigma).T
    white = lapack.dtrtrs(root, stacked, trans=1)[0]
    return np.moveaxis(np.asarray(white).reshape(n_y, rows, *signals.shape[2:]), 0, 1)


def covariance(fit: Fit, unfolded: FitRows) -> FloatArray:
    """Covariance of the magnitudes of the support: the information matrix's, widened where the scores are correlated.

    The sandwich uses a Bartlett window of n^(1/3) lags (Newey and West 1987). An atom seen by few samples makes the
    sandwich too small, so it may widen the classical covariance but never narrow it.

    Returns
    -------
    (n_active, n_active).
    """
    if not fit.atoms:
        return np.zeros((0, 0))
    g = _whiten(fit, unfolded.signatures[:, :, list(fit.atoms)])
    e = _whiten(fit, unfolded.error)
    rows = len(e)
    scale = np.sqrt(np.einsum("koj,koj->j", g, g))
    scale[scale == 0.0] = 1.0
    bread = np.linalg.pinv(np.einsum("koi,koj->ij", g / scale, g / scale), rcond=1e-12, hermitian=True)
    scores = np.einsum("koj,ko->kj", g / scale, e)
    lags = int(np.ceil(rows ** (1.0 / 3.0)))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    degrees = rows / max(rows - unfolded.n_regressors - len(fit.atoms) / e.shape[1], 1.0)
    ratio = np.diag(bread @ meat @ bread) / np.maximum(np.diag(bread), np.finfo(float).tiny)
    wider = np.sqrt(np.maximum(ratio, 1.0)) / scale
    return np.asarray(bread * np.outer(wider, wider) * degrees)


def single_additions(fit: Fit, unfolded: FitRows) -> SingleAdditions:
    """Return magnitude and variance that each atom would have if it were added alone to the support."""
    g, e = _whiten(fit, unfolded.signatures), _whiten(fit, unfolded.error)
    rows, n_y, n_z = g.shape
    flat = g.reshape(rows * n_y, n_z)
    active = flat[:, list(fit.atoms)]
    Q = np.linalg.qr(active)[0] if fit.atoms else np.zeros((rows * n_y, 0))
    others = flat - Q @ (Q.T @ flat)
    power = np.einsum("kj,kj->j", others, others)
    white_raw = unfolded.raw_norm**2 / np.linalg.eigvalsh(fit.sigma)[-1]
    seen = power > (BLIND * white_raw + np.finfo(float).tiny)
    safe = np.where(seen, power, 1.0)
    degrees = rows / max(rows - unfolded.n_regressors - len(fit.atoms) / n_y, 1.0)
    magnitude = np.where(seen, others.T @ e.reshape(-1) / safe, np.nan)
    return SingleAdditions(magnitude=magnitude, variance=np.where(seen, degrees / safe, np.nan))
