"""The covariance of the magnitudes, with serially correlated errors admitted, from a fit evaluated row by row."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from . import FloatArray
from .coherence import whiten
from .lagged import lagged
from .variable_projection import Fit

# An atom whose power the regressors absorb but for less than this share is not seen: the rest is round-off.
BLIND = 1e-10
# Smallest singular value of the scaled regressors, relative to the largest, that is not round-off.
RANK_TOLERANCE = 1e-12
# Of the signatures that are evaluated at once, 8 MB: less than any window has that is not a flight of hours.
MOST_VALUES = 10**6
# Columns that LAPACK treats together, and rows that are rotated together: the speed only.
PANEL, ROWS = 32, 65_536


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """A record, and the samples at which the rows of a regression begin.

    Attributes
    ----------
    u : (n_samples, n_inputs), y : (n_samples, n_outputs), theta : (n_samples, n_outputs, n_atoms), all scaled.
    first : sample of the first row, the largest of the orders that are compared.
    feedthrough : inputs act in the same sample too.
    weights : (n_samples,) of the rows, None for 1.
    """

    u: FloatArray
    y: FloatArray
    theta: FloatArray
    first: int
    feedthrough: bool
    weights: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regressors:
    """The regressors of a fit on the rows of its record, orthogonalised: they depend on its support alone.

    Attributes
    ----------
    Q : (n_rows, rank), their orthogonal basis; now : (n_rows, n_outputs) the corrected outputs, weighted.
    singular : all of their singular values, columns scaled; Vt : (rank, n_regressors); scale : of the columns.
    weights : (n_rows,).
    """

    Q: FloatArray
    now: FloatArray
    singular: FloatArray
    Vt: FloatArray
    scale: FloatArray
    weights: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitRows:
    """A fit row by row, over the rows first..n_samples - 1.

    Attributes
    ----------
    error : (n_rows, n_outputs) prediction error; weighted_error : times the weights of the rows.
    signatures : (n_rows, n_outputs, n_atoms) filtered and weighted signatures of all atoms, orthogonal to the
        regressors.
    raw_norm : (n_atoms,) their norms before the projection.
    coefficients : (n_regressors, n_outputs) of [1, u lags, corrected y lags].
    condition_number : of the regressors, columns scaled.
    n_regressors : per output.
    """

    error: FloatArray
    weighted_error: FloatArray
    signatures: FloatArray
    raw_norm: FloatArray
    coefficients: FloatArray
    condition_number: float
    n_regressors: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SingleAdditions:
    """Magnitude and variance of each atom if it alone joined the support, linearised at the fit; NaN where unseen."""

    magnitude: FloatArray
    variance: FloatArray


def regressors_of(layout: Layout, fit: Fit) -> Regressors:
    """Return the regressors of a fit on the rows of its record, for several `unfold` that differ in other atoms."""
    first, n = layout.first, len(layout.y)
    corrected = layout.y - layout.theta[:, :, list(fit.atoms)] @ fit.z
    input_lags, output_lags = range(0 if layout.feedthrough else 1, fit.order + 1), range(1, fit.order + 1)
    n_base = 1 + len(input_lags) * layout.u.shape[1]
    X = np.ones((n - first, n_base + fit.order * layout.y.shape[1]), order="F")
    X[:, 1:n_base] = lagged(layout.u, input_lags, first=first)
    X[:, n_base:] = lagged(corrected, output_lags, first=first)
    weights = np.ones(n - first) if layout.weights is None else layout.weights[first:]
    X *= weights[:, None]
    scale = np.linalg.norm(X, axis=0) if X.size <= MOST_VALUES else np.array([np.linalg.norm(one) for one in X.T])
    scale[scale == 0.0] = 1.0
    X /= scale
    U, s, Vt = np.linalg.svd(X, full_matrices=False) if X.size <= MOST_VALUES else _svd_in_place(X)
    keep = s > RANK_TOLERANCE * s[0]
    return Regressors(
        Q=U if keep.all() else U[:, keep],
        now=corrected[first:] * weights[:, None],
        singular=s,
        Vt=Vt[keep],
        scale=scale,
        weights=weights,
    )


def _svd_in_place(X: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return U, s, Vt of a tall column-major matrix, whose memory U takes; of a long record each is 40 MB and more."""
    n_columns = X.shape[1]
    X, tau = lapack.dgeqrf(X, lwork=PANEL * n_columns, overwrite_a=True)[:2]
    rotation, s, Vt = np.linalg.svd(np.triu(X[:n_columns]))
    X = lapack.dorgqr(X, tau, lwork=PANEL * n_columns, overwrite_a=True)[0]
    for start in range(0, len(X), ROWS):
        X[start : start + ROWS] = X[start : start + ROWS] @ rotation
    return X, s, Vt


def unfold(layout: Layout, fit: Fit, regressors: Regressors | None = None) -> FitRows:
    """Evaluate a fit on the rows of its record.

    Parameters
    ----------
    regressors : of the fit on this record where they are known, see `regressors_of`.
    """
    made = regressors_of(layout, fit) if regressors is None else regressors
    first, n, n_y = layout.first, len(layout.y), layout.y.shape[1]
    Q, now, s, weights = made.Q, made.now, made.singular, made.weights
    g = layout.theta[first:].copy()
    for i, K in enumerate(fit.K, start=1):
        g -= np.einsum("io,koj->kij", K, layout.theta[first - i : n - i])
    g *= weights[:, None, None]
    flat = g.reshape(n - first, -1)
    weighted_error = now - Q @ (Q.T @ now)
    raw_norm = np.sqrt(np.einsum("koj,koj->j", g, g))
    flat -= Q @ (Q.T @ flat)
    return FitRows(
        error=weighted_error / weights[:, None],
        weighted_error=weighted_error,
        signatures=flat.reshape(n - first, n_y, -1),
        raw_norm=raw_norm,
        coefficients=(made.Vt.T @ ((Q.T @ now) / s[: Q.shape[1], None])) / made.scale[:, None],
        condition_number=float(s[0] / s[-1]) if s[-1] > 0 else float("inf"),
        n_regressors=made.scale.size,
    )


def unfold_support(layout: Layout, fit: Fit) -> FitRows:
    """Evaluate a fit on the rows of its record, with the signatures of its own support alone."""
    atoms = list(fit.atoms)
    return unfold(replace(layout, theta=layout.theta[:, :, atoms]), replace(fit, atoms=tuple(range(len(atoms)))))


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
    rows, n_y = unfolded.error.shape
    G = whiten(unfolded.signatures[:, :, list(fit.atoms)], fit.sigma)
    e = whiten(unfolded.weighted_error[:, :, None], fit.sigma)
    scale = np.linalg.norm(G, axis=0)
    scale[scale == 0.0] = 1.0
    G = G / scale
    bread = np.linalg.pinv(G.T @ G, rcond=RANK_TOLERANCE, hermitian=True)
    scores = (G * e).reshape(rows, n_y, -1).sum(axis=1)
    lags = int(np.ceil(rows ** (1.0 / 3.0)))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    ratio = np.diag(bread @ meat @ bread) / np.maximum(np.diag(bread), np.finfo(float).tiny)
    wider = np.sqrt(np.maximum(ratio, 1.0)) / scale
    return np.asarray(bread * np.outer(wider, wider) * _small_sample_factor(fit, unfolded))


def single_additions(fit: Fit, unfolded: FitRows) -> SingleAdditions:
    """Return magnitude and variance that each atom would have if it were added alone to the support."""
    G, e = whiten(unfolded.signatures, fit.sigma), whiten(unfolded.weighted_error[:, :, None], fit.sigma)[:, 0]
    Q = np.linalg.qr(G[:, list(fit.atoms)])[0]
    others = G - Q @ (Q.T @ G)
    power = np.einsum("kj,kj->j", others, others)
    white_raw = unfolded.raw_norm**2 / np.linalg.eigvalsh(fit.sigma)[-1]
    seen = power > (BLIND * white_raw + np.finfo(float).tiny)
    safe = np.where(seen, power, 1.0)
    return SingleAdditions(
        magnitude=np.where(seen, others.T @ e / safe, np.nan),
        variance=np.where(seen, _small_sample_factor(fit, unfolded) / safe, np.nan),
    )


def additions_and_covariance(layout: Layout, fit: Fit) -> tuple[SingleAdditions, FloatArray]:
    """Return `single_additions` of all atoms and `covariance`; of a long record some atoms at a time, for memory."""
    rows, n_y, n_atoms = len(layout.y) - layout.first, *layout.theta.shape[1:]
    n_parts = -(-rows * n_y * n_atoms // MOST_VALUES)
    if n_parts <= 1:
        unfolded = unfold(layout, fit)
        return single_additions(fit, unfolded), covariance(fit, unfolded)
    regressors, active = regressors_of(layout, fit), list(fit.atoms)
    same = replace(fit, atoms=tuple(range(len(active))))
    magnitude, variance = np.empty(n_atoms), np.empty(n_atoms)
    scaled = covariance(same, unfold(replace(layout, theta=layout.theta[:, :, active]), same, regressors))
    for some in np.array_split(np.arange(n_atoms), n_parts):
        part = replace(layout, theta=layout.theta[:, :, [*active, *some.tolist()]])
        added = single_additions(same, unfold(part, same, regressors))
        magnitude[some], variance[some] = added.magnitude[len(active) :], added.variance[len(active) :]
    return SingleAdditions(magnitude=magnitude, variance=variance), scaled


def _small_sample_factor(fit: Fit, unfolded: FitRows) -> float:
    """Return the number of rows over the degrees of freedom; the covariance of the fit divides by the rows alone."""
    rows, n_y = unfolded.error.shape
    return float(rows / max(rows - unfolded.n_regressors - len(fit.atoms) / n_y, 1.0))
