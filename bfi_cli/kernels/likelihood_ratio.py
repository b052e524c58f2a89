"""Generalised likelihood ratio of faults in residuals whose noise is known up to its level (docs/theory.md, 15.7).

Every residual j has a covariance s_j^2 exp(-|dt| / 1 s) + slow part; its level s_j is found by maximum likelihood on a
grid, with and without a fault. That is what makes one threshold hold in calm and in rough air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from . import FloatArray

FAST_S = 1.0  # correlation time of the fast part: gusts and vibration that outlast one sample
# Of a nuisance column's largest, below which its part off the others is rounding.
RANK_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseModel:
    """The covariances that the noise of a residual may have.

    Attributes
    ----------
    levels : (n_levels,) s_j, in the unit of the residual.
    modes : (n, n) rows in which the fast and the slow part are both uncorrelated, so that one matrix whitens at every
        level; variances : (n_levels, n) of these.
    log_det : (n_levels,) logarithms of the determinants of the covariances.
    """

    levels: FloatArray
    modes: FloatArray
    variances: FloatArray
    log_det: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residual:
    """One residual, whitened at the level that a fault in it would leave, off its nuisances.

    Attributes
    ----------
    values : (n,) whitened.
    whitening : (n, n); nuisances : (n + n_prior, m) orthonormal, whitened, their priors below.
    cost : of two log-likelihoods without a fault: at the level taken less at the best level, 0 or negative.
    level : taken, in the residual's unit.
    """

    values: FloatArray
    whitening: FloatArray
    nuisances: FloatArray
    cost: float
    level: float

    def whitened(self, signatures: FloatArray) -> FloatArray:
        """Return (n + n_prior, ...) signatures, (n, ...) in the residual's unit, whitened and off the nuisances."""
        white = self.whitening @ signatures
        rows = np.concatenate([white, np.zeros((len(self.nuisances) - len(white), *white.shape[1:]))])
        return np.asarray(rows - self.nuisances @ (self.nuisances.T @ rows))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelihoodRatio:
    """Of one fault, by onset.

    Attributes
    ----------
    ratio : (n_onsets,) twice the log-likelihood ratio against no fault.
    magnitude, sd : (n_onsets,) estimates.
    parts : (n_residuals, n_onsets) of `ratio`, what each residual says at the joint magnitude.
    shown, power : (n_residuals, n_onsets) inner products of the signature with the residual, and with itself.
    """

    ratio: FloatArray
    magnitude: FloatArray
    sd: FloatArray
    parts: FloatArray
    shown: FloatArray
    power: FloatArray

    def weighted(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return magnitude and sd, (n_onsets,), where the noise of each residual is not what its model says.

        Parameters
        ----------
        weights : (n_residuals,) of log-likelihoods: the variance that the noise model says over the true one.
        """
        power = weights @ self.power
        seen = power > RANK_TOLERANCE * max(float(power.max(initial=0.0)), np.finfo(float).tiny)
        safe = np.where(seen, power, 1.0)
        return np.where(seen, weights @ self.shown / safe, 0.0), np.where(seen, 1.0 / np.sqrt(safe), np.inf)


def noise_model(time_s: FloatArray, levels: FloatArray, slow: FloatArray) -> NoiseModel:
    """Return the covariances of samples at times, (n,) s, for levels of the fast part and a slow part (n, n)."""
    fast = np.exp(-np.abs(time_s[:, None] - time_s[None, :]) / FAST_S)
    # modes fast modes' = 1 and modes slow modes' = diag(slow variances), of fast parts of level 1.
    slow_variances, vectors = eigh(slow, fast)
    variances = levels[:, None] ** 2 + np.maximum(slow_variances, 0.0)
    of_fast = 2.0 * float(np.sum(np.log(np.diag(np.linalg.cholesky(fast)))))
    log_det = np.log(variances).sum(axis=1) + of_fast
    return NoiseModel(levels=levels, modes=np.ascontiguousarray(vectors.T), variances=variances, log_det=log_det)


def settle(
    noise: NoiseModel, values: FloatArray, nuisances: FloatArray, prior_sd: FloatArray, own: FloatArray
) -> Residual:
    """Return a residual at the level that it has where the best of its own signatures is in it.

    A fault that stands out of the noise is not to raise the noise it is held against; the likelihood that a higher
    level costs without the fault is kept as `cost`.

    Parameters
    ----------
    values : (n,).
    nuisances : (n, m), added to the residual in unknown amounts; prior_sd : (m,) of these, inf for none.
    own : (n, n_own) signatures that a fault may have in this residual, in any amount.
    """
    priors = np.diag(1.0 / prior_sd)[np.isfinite(prior_sd)]
    n, weights = len(values), 1.0 / np.sqrt(noise.variances)[:, :, None]
    values, nuisances, own = noise.modes @ values, noise.modes @ nuisances, noise.modes @ own
    below = np.broadcast_to(priors, (len(weights), *priors.shape))
    bases = _orthonormal(np.concatenate([weights * nuisances, below], axis=1))
    rows = np.concatenate([weights * values[:, None], np.zeros((*below.shape[:2], 1))], axis=1)
    y = (rows - bases @ (bases.transpose(0, 2, 1) @ rows))[:, :, 0]
    columns = weights * own
    inside = bases[:, :n].transpose(0, 2, 1) @ columns
    power = np.einsum("kij,kij->kj", columns, columns) - np.einsum("kij,kij->kj", inside, inside)
    shown = np.einsum("kij,ki->kj", columns, y[:, :n])
    least = RANK_TOLERANCE * np.maximum(power.max(axis=1, initial=0.0), np.finfo(float).tiny)[:, None]
    gain = np.divide(shown**2, power, out=np.zeros_like(power), where=power > least).max(axis=1, initial=0.0)
    without = -noise.log_det - np.einsum("ki,ki->k", y, y)
    k = int(np.argmax(without + gain))
    return Residual(
        values=y[k],
        whitening=noise.modes * weights[k],
        nuisances=bases[k][:, bases[k].any(axis=0)],
        cost=float(without[k] - without.max()),
        level=float(noise.levels[k]),
    )


def likelihood_ratio(residuals: Sequence[Residual], signatures: Sequence[FloatArray | None]) -> LikelihoodRatio:
    """Return what residuals say of a fault.

    Parameters
    ----------
    signatures : of every residual (n, n_onsets), what the fault of magnitude 1 makes of it; None where it makes
        nothing. At least one is there.
    """
    n_onsets = next(one.shape[1] for one in signatures if one is not None)
    shown, power = np.zeros((len(residuals), n_onsets)), np.zeros((len(residuals), n_onsets))
    for j, (residual, signature) in enumerate(zip(residuals, signatures, strict=True)):
        if signature is not None:
            columns = residual.whitened(signature)
            shown[j], power[j] = columns.T @ residual.values, np.einsum("ij,ij->j", columns, columns)
    total = power.sum(axis=0)
    seen = total > RANK_TOLERANCE * max(float(total.max(initial=0.0)), np.finfo(float).tiny)
    safe = np.where(seen, total, 1.0)
    magnitude = np.where(seen, shown.sum(axis=0) / safe, 0.0)
    costs = np.array([residual.cost for residual in residuals])
    parts = costs[:, None] + 2.0 * magnitude * shown - magnitude**2 * power
    return LikelihoodRatio(
        ratio=costs.sum() + np.where(seen, shown.sum(axis=0) ** 2 / safe, 0.0),
        magnitude=magnitude,
        sd=np.where(seen, 1.0 / np.sqrt(safe), np.inf),
        parts=parts,
        shown=shown,
        power=power,
    )


def _orthonormal(columns: FloatArray) -> FloatArray:
    """Return orthonormal bases of what columns, (n_levels, n, m), span, zeros in place of what depends on others."""
    if not columns.shape[2]:
        return columns
    scale = np.linalg.norm(columns, axis=1, keepdims=True)
    u, s, _ = np.linalg.svd(columns / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
    return np.asarray(u * (s > RANK_TOLERANCE * s[:, :1])[:, None, :])
