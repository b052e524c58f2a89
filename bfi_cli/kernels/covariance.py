"""The covariance of the magnitudes, with serially correlated errors admitted, from a fit evaluated row by row."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from . import TINY, FloatArray
from .atom_signals import some_of
from .compiled import einsum, lapack
from .lagged import BLOCK_ROWS, Compressed, EarlierRows, add_rows, compress, fill_lagged, with_earlier
from .progress import Report, silent
from .variable_projection import Fit

# An atom whose power the regressors absorb but for less than this share is not seen: the rest is round-off.
BLIND = 1e-10
# Smallest singular value of the scaled regressors, relative to the largest, that is not round-off.
RANK_TOLERANCE = 1e-12
# MOST_VALUES: values of the signatures evaluated at once, 8 MB: only windows of hours have more.
MOST_VALUES = 10**6
ROWS = 65_536  # that are rotated together: the speed only


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """A record, and the samples at which the rows of a regression begin.

    Attributes
    ----------
    u : (n_samples, n_inputs), y : (n_samples, n_outputs), theta : (n_samples, n_outputs, n_atoms), all scaled.
    first : sample of the first row, the largest of the orders that are compared.
    feedthrough : inputs act in the same sample too.
    weights : (n_samples,) of the rows, None for 1.
    earlier : of other records with the same model, at lag `first`; None where there are none.
    """

    u: FloatArray
    y: FloatArray
    theta: FloatArray
    first: int
    feedthrough: bool
    weights: FloatArray | None = None
    earlier: EarlierRows | None = None

    def with_signals(self, theta: FloatArray) -> Layout:
        """Return the record with other signals."""
        return replace(self, theta=theta)

    def with_weights(self, weights: FloatArray | None) -> Layout:
        """Return the record with other weights (n_samples,) of its rows."""
        return replace(self, weights=weights)

    def at_order(self, order: int) -> Layout:
        """Return the record for the same rows at a lower order, whose lags are fewer.

        It is itself where other records are factorised already.
        """
        if self.earlier is not None:
            return self
        rows = slice(self.first - order, None)
        return replace(
            self,
            u=self.u[rows],
            y=self.y[rows],
            theta=self.theta[rows],
            first=order,
            weights=None if self.weights is None else self.weights[rows],
        )

    def factor(self, report: Report = silent) -> Compressed:
        """Return the triangular factor at lag `first`, of the earlier records too."""
        data = compress(
            self.u,
            self.y,
            self.theta,
            order=self.first,
            feedthrough=self.feedthrough,
            weights=self.weights,
            report=report,
        )
        return with_earlier(data, self.earlier)


@dataclass(frozen=True, kw_only=True, eq=False)  # without slots, so that it keeps its unfolded support
class Regressors:
    """The regressors of a fit on the rows of its record, orthogonalised: they depend on its support alone.

    Attributes
    ----------
    layout : the record; fit : of it.
    Q : (n_all, rank), their orthogonal basis; weighted_error : (n_all, n_outputs) what they leave of the corrected
        outputs; those of the record, then those of earlier ones.
    coefficients : (n_regressors, n_outputs); condition_number : columns scaled.
    weights : (n_rows,).
    """

    layout: Layout
    fit: Fit
    Q: FloatArray
    weighted_error: FloatArray
    coefficients: FloatArray
    condition_number: float
    weights: FloatArray

    def with_signals(self, theta: FloatArray) -> Layout:
        """Return the record with others after its signals."""
        return self.layout.with_signals(np.concatenate([self.layout.theta, theta], axis=2))

    def each_of(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (n_signals,) magnitude and variance of each signal, scaled, added alone to those of the record.

        `single_additions` of these by inner products alone, so that a long record is gone through once.
        """
        fit, (others, small_sample) = self.fit, self._unfolded
        n_y, n_signals, n_rows = len(fit.sigma), theta.shape[2], len(self.weights)
        absorbed, inner = np.zeros((self.Q.shape[1], n_y * n_signals)), np.zeros((others.shape[1], n_signals))
        power = np.zeros(n_signals)
        for start in range(0, n_rows, ROWS):
            rows = slice(start, min(start + ROWS, n_rows))
            if theta[rows.start : rows.stop + self.layout.first].any():
                G = whiten(_filtered(theta, fit, self.layout.first, self.weights, rows), fit.sigma)
                absorbed += self.Q[rows].T @ G.reshape(-1, n_y * n_signals)
                inner += others[rows.start * n_y : rows.stop * n_y].T @ G
                power += einsum("kj,kj->j", G, G)
        left = power - np.sum(absorbed.reshape(-1, n_signals) ** 2, axis=0) - np.sum(inner[:-1] ** 2, axis=0)
        return _additions(inner[-1], left, power, small_sample)

    @cached_property
    def _unfolded(self) -> tuple[FloatArray, float]:
        """A basis of the whitened signatures of the support, last the errors off these, and the small-sample factor."""
        fit, unfolded = self.fit, unfold(self.layout, self.fit, self)
        basis = np.linalg.qr(whiten(unfolded.all_signatures, fit.sigma))[0]
        e = whiten(unfolded.all_errors[:, :, None], fit.sigma)
        return np.hstack([basis, e - basis @ (basis.T @ e)]), _small_sample_factor(fit, unfolded)


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
    n_rows : of all records.
    earlier_error : (n, n_outputs) and earlier_signatures : (n, n_outputs, n_atoms) on the rows of earlier records, in
        no order of time, as they are orthogonal to the same regressors; none of those that are in the factor.
    """

    error: FloatArray
    weighted_error: FloatArray
    signatures: FloatArray
    raw_norm: FloatArray
    coefficients: FloatArray
    condition_number: float
    n_regressors: int
    n_rows: int
    earlier_error: FloatArray
    earlier_signatures: FloatArray

    @property
    def all_errors(self) -> FloatArray:
        """(n_all, n_outputs) weighted, those of the record first."""
        return _above(self.weighted_error, self.earlier_error)

    @property
    def all_signatures(self) -> FloatArray:
        """(n_all, n_outputs, n_atoms), those of the record first."""
        return _above(self.signatures, self.earlier_signatures)


def regressors_of(layout: Layout, fit: Fit) -> Regressors:
    """Return the regressors of a fit on the rows of its record, for several `unfold` that differ in other atoms."""
    first, n = layout.first, len(layout.y)
    corrected = layout.y - layout.theta[:, :, list(fit.atoms)] @ fit.z
    input_lags, output_lags = range(0 if layout.feedthrough else 1, fit.order + 1), range(1, fit.order + 1)
    n_base = 1 + len(input_lags) * layout.u.shape[1]
    X = np.empty((n - first, n_base + fit.order * layout.y.shape[1]), order="F")
    X[:, 0] = 1.0
    fill_lagged(X.T[1:n_base], layout.u, input_lags)
    fill_lagged(X.T[n_base:], corrected, output_lags)
    weights = np.ones(n - first) if layout.weights is None else layout.weights[first:]
    X *= weights[:, None]
    now, others = corrected[first:] * weights[:, None], layout.earlier
    if others is not None:
        past = np.hstack([others.u[:, : n_base - 1], others.past[:, : X.shape[1] - n_base]])
        X, now = np.asfortranarray(_above(X, np.pad(past, ((0, 0), (1, 0))))), _above(now, others.y)
    scale = np.linalg.norm(X, axis=0) if X.size <= MOST_VALUES else np.array([np.linalg.norm(column) for column in X.T])
    scale[scale == 0.0] = 1.0
    X /= scale
    Q, s, inverse = _basis(X)
    shown = Q.T @ now
    return Regressors(
        layout=layout,
        fit=fit,
        Q=Q,
        weighted_error=now - Q @ shown,
        coefficients=(inverse @ shown) / scale[:, None],
        condition_number=float(s[0] / s[-1]) if s[-1] > 0 else float("inf"),
        weights=weights,
    )


def _above(rows: FloatArray, others: FloatArray) -> FloatArray:
    return np.concatenate([rows, others]) if len(others) else rows


def _basis(X: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return an orthogonal basis Q of a tall column-major matrix, all singular values, and M with pseudoinverse M Q'.

    Q takes the memory of a matrix of many values: of a long record each is 40 MB and more. There it is the matrix
    over its triangular factor, which blocks that stay in a processor's cache make in a third of the time.
    """
    if X.size <= MOST_VALUES:
        Q, s, Vt = np.linalg.svd(X, full_matrices=False)
        keep = s > RANK_TOLERANCE * s[0]
        return (Q if keep.all() else Q[:, keep]), s, Vt[keep].T / s[keep]
    _, s, Vt = np.linalg.svd(_triangle(X))
    keep = s > RANK_TOLERANCE * s[0]
    inverse, Q = Vt[keep].T / s[keep], X[:, : np.count_nonzero(keep)]
    _times(X, inverse, Q)
    # Rounding leaves directions that X hardly has somewhat oblique: Q'Q is 1 to its error, and its factor mends that.
    again = lapack.dtrtri(np.linalg.cholesky(Q.T @ Q).T)[0]
    _times(Q, again, Q)
    return Q, s, inverse @ again


def _triangle(X: FloatArray) -> FloatArray:
    """Return the triangular factor of a tall matrix, block by block."""
    R = np.zeros((X.shape[1], X.shape[1]), order="F")
    for start in range(0, len(X), BLOCK_ROWS):
        R = add_rows(R, X[start : start + BLOCK_ROWS].copy(order="F"), overwrite=True)
    return R


def _times(X: FloatArray, factors: FloatArray, product: FloatArray) -> None:
    """Write the product of a tall matrix and a small one, of no more columns, which may be the same memory."""
    for start in range(0, len(X), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        product[rows] = X[rows] @ factors


def unfold(layout: Layout, fit: Fit, regressors: Regressors | None = None) -> FitRows:
    """Evaluate a fit on the rows of its record.

    Parameters
    ----------
    regressors : of the fit on this record where they are known, see `regressors_of`.
    """
    made = regressors_of(layout, fit) if regressors is None else regressors
    n = len(made.weights)
    g = _filtered(layout.theta, fit, layout.first, made.weights, slice(0, n))
    if layout.earlier is None:
        return _projected(made, g, n)
    none = np.zeros((len(made.Q) - n, *g.shape[1:]))
    return _projected(made, np.concatenate([g, none]), n + layout.earlier.n_rows)


def _filtered(theta: FloatArray, fit: Fit, first: int, weights: FloatArray, rows: slice) -> FloatArray:
    """Return (n, n_outputs, n_atoms) what the predictor of a fit makes of signals, weighted, on some rows."""
    start, stop = first + rows.start, first + rows.stop
    g = theta[start:stop].copy()
    for i, K in enumerate(fit.K, start=1):
        lag = theta[start - i : stop - i]
        g -= K[0, 0] * lag if K.size == 1 else einsum("io,koj->kij", K, lag)
    g *= weights[rows, None, None]
    return g


def _projected(made: Regressors, g: FloatArray, n_rows: int) -> FitRows:
    """Return the rows of a fit with weighted signatures g (n_all, n_outputs, n_atoms), which are overwritten."""
    Q, weighted_error, n = made.Q, made.weighted_error, len(made.weights)
    flat = g.reshape(len(g), -1)
    raw_norm = np.sqrt(einsum("koj,koj->j", g, g))
    flat -= Q @ (Q.T @ flat)
    signatures = flat.reshape(g.shape)
    return FitRows(
        error=weighted_error[:n] / made.weights[:, None],
        weighted_error=weighted_error[:n],
        signatures=signatures[:n],
        raw_norm=raw_norm,
        coefficients=made.coefficients,
        condition_number=made.condition_number,
        n_regressors=len(made.coefficients),
        n_rows=n_rows,
        earlier_error=weighted_error[n:],
        earlier_signatures=signatures[n:],
    )


def unfold_own(layout: Layout, fit: Fit) -> FitRows:
    """Evaluate a fit on the rows of its record, with the signatures of its own support alone."""
    return unfold(*_support_alone(layout, fit))


def _support_alone(layout: Layout, fit: Fit) -> tuple[Layout, Fit]:
    return layout.with_signals(some_of(layout.theta, fit.atoms)), replace(fit, atoms=tuple(range(len(fit.atoms))))


def whiten(signatures: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return signatures as columns whose inner products are those of the information matrix.

    Parameters
    ----------
    signatures : (n_rows, n_outputs, n_signals).
    sigma : (n_outputs, n_outputs) residual covariance, positive definite.

    Returns
    -------
    (n_rows * n_outputs, n_signals), rows ordered by sample, then output.
    """
    rows, n_y, n = signatures.shape
    if n_y == 1:
        return np.asarray(signatures[:, 0] / np.linalg.cholesky(sigma))
    by_output = np.moveaxis(signatures, 1, 0).reshape(n_y, rows * n)
    white = np.asarray(lapack.dtrtrs(np.linalg.cholesky(sigma), by_output, lower=True)[0])
    return np.moveaxis(white.reshape(n_y, rows, n), 0, 1).reshape(rows * n_y, n)


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
    G, scale = _unit_signatures(fit, unfolded)
    e = whiten(unfolded.weighted_error[:, :, None], fit.sigma)
    others, G = G[rows * n_y :], G[: rows * n_y]
    scores = (G * e).reshape(rows, n_y, -1).sum(axis=1)
    lags = int(np.ceil(rows ** (1.0 / 3.0)))
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    # The rows of other records have no known order in time: their scores count as uncorrelated.
    apart = others.T @ others
    return _sandwich(fit, unfolded, G.T @ G + apart, meat + apart, scale)


def _unit_signatures(fit: Fit, unfolded: FitRows) -> tuple[FloatArray, FloatArray]:
    """Return the whitened signatures of the support, of norm 1, and (n_active,) what they were divided by."""
    G = whiten(unfolded.all_signatures[:, :, list(fit.atoms)], fit.sigma)
    scale = np.linalg.norm(G, axis=0)
    scale[scale == 0.0] = 1.0
    return G / scale, scale


def _sandwich(fit: Fit, unfolded: FitRows, information: FloatArray, meat: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the covariance from information and scores of signatures that were divided by (n_active,) `scale`."""
    bread = np.linalg.pinv(information, rcond=RANK_TOLERANCE, hermitian=True)
    ratio = np.diag(bread @ meat @ bread) / np.maximum(np.diag(bread), TINY)
    wider = np.sqrt(np.maximum(ratio, 1.0)) / scale
    return np.asarray(bread * np.outer(wider, wider) * _small_sample_factor(fit, unfolded))


def single_additions(fit: Fit, unfolded: FitRows) -> tuple[FloatArray, FloatArray]:
    """Return (n_atoms,) magnitude and variance that each would have if it alone joined the support; NaN where unseen.

    They are linearised at the fit.
    """
    G, e = whiten(unfolded.all_signatures, fit.sigma), whiten(unfolded.all_errors[:, :, None], fit.sigma)[:, 0]
    Q = np.linalg.qr(G[:, list(fit.atoms)])[0]
    others = G - Q @ (Q.T @ G)
    power = einsum("kj,kj->j", others, others)
    white_raw = unfolded.raw_norm**2 / np.linalg.eigvalsh(fit.sigma)[-1]
    return _additions(others.T @ e, power, white_raw, _small_sample_factor(fit, unfolded))


def _additions(
    shown: FloatArray, power: FloatArray, whole: FloatArray, small_sample: float
) -> tuple[FloatArray, FloatArray]:
    """Return magnitudes and variances of signals by what the errors show of them, NaN of those that are not seen.

    Parameters
    ----------
    shown, power, whole : (n_atoms,) inner products with the errors, and squared norms, with and without what else
        absorbs them.
    """
    seen = power > (BLIND * whole + TINY)
    safe = np.where(seen, power, 1.0)
    return np.where(seen, shown / safe, np.nan), np.where(seen, small_sample / safe, np.nan)


def regressors_of_support(layout: Layout, fit: Fit) -> Regressors:
    """Return the regressors of a fit on its record with the signals of its support alone, to which others are added."""
    return regressors_of(*_support_alone(layout, fit))


def _small_sample_factor(fit: Fit, unfolded: FitRows) -> float:
    """Return the number of rows over the degrees of freedom; the covariance of the fit divides by the rows alone."""
    rows, n_y = unfolded.n_rows, unfolded.error.shape[1]
    return float(rows / max(rows - unfolded.n_regressors - len(fit.atoms) / n_y, 1.0))
