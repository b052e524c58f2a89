"""Generalised likelihood ratio of faults in residuals whose noise is known up to its level (docs/theory.md, 15.7).

Every residual j has a covariance s_j^2 exp(-|dt| / 1 s) + slow part; its level s_j is found by maximum likelihood on a
grid, with and without a fault. That is what makes one threshold hold in calm and in rough air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from . import TINY, BoolArray, FloatArray, IntArray
from .compiled import lapack
from .generalised_least_squares import RANK_TOLERANCE, regressions

FAST_S = 1.0  # correlation time of the fast part: gusts and vibration that outlast one sample


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

    @classmethod
    def of(
        cls, noise: NoiseModel, values: FloatArray, nuisances: FloatArray, prior_sd: FloatArray, signatures: FloatArray
    ) -> Residual:
        """Return a residual at the level that it has where the best of these signatures is in it.

        A fault that stands out of the noise is not to raise the noise it is held against; the likelihood that a higher
        level costs without the fault is kept as `cost`.

        Parameters
        ----------
        values : (n,).
        nuisances : (n, m), added to the residual in unknown amounts; prior_sd : (m,) of these, inf for none.
        signatures : (n, n_signatures) that a fault may have in this residual, in any amount.
        """
        weights, n = 1.0 / np.sqrt(noise.variances), len(values)
        y, columns = weights * (noise.modes @ values), weights[:, :, None] * (noise.modes @ nuisances)
        left = regressions(y, columns, prior_sd)
        courses, basis = noise.modes @ signatures, left.basis[:, :n].transpose(0, 2, 1) * weights[:, None, :]
        shown, along = (
            (weights * left.y[:, :n]) @ courses,
            (basis.reshape(-1, n) @ courses).reshape(*basis.shape[:2], -1),
        )
        power = weights**2 @ courses**2 - np.sum(along**2, axis=1)
        least = RANK_TOLERANCE * np.maximum(power.max(axis=1, initial=0.0), TINY)[:, None]
        gain = np.divide(shown**2, power, out=np.zeros_like(power), where=power > least)
        without = -noise.log_det - left.squares
        k = int(np.argmax(without + gain.max(axis=1, initial=0.0)))
        return cls(
            values=left.y[k].copy(),  # those of the other levels are not kept
            whitening=noise.modes * weights[k][:, None],
            nuisances=left.basis[k][:, left.basis[k].any(axis=0)],
            cost=float(without[k] - without.max()),
            level=float(noise.levels[k]),
        )

    def whitened(self, signatures: FloatArray) -> FloatArray:
        """Return (n + n_prior, ...) signatures, (n, ...) in the residual's unit, whitened and off the nuisances."""
        white, n = self.whitening @ signatures, len(signatures)
        rows: FloatArray = self.nuisances @ -(self.nuisances[:n].T @ white)
        rows[:n] += white
        return rows


@dataclass(frozen=True, kw_only=True, eq=False)  # without slots, so that it keeps its ratio
class LikelihoodRatio:
    """The likelihood ratio of a fault, by onset; of several faults each array has another axis in front.

    Attributes
    ----------
    shown, power : (n_residuals, n_onsets) inner products of the signature with the residual, and with itself.
    costs : (n_residuals,) of the residuals, 0 or negative.
    """

    shown: FloatArray
    power: FloatArray
    costs: FloatArray

    def weighted(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return magnitude and sd, (n_onsets,), where the noise of each residual is not what its model says.

        Parameters
        ----------
        weights : (n_residuals,) of log-likelihoods: the variance that the noise model says over the true one.
        """
        power = weights @ self.power
        seen = _is_seen(power)
        safe = np.where(seen, power, 1.0)
        return np.where(seen, weights @ self.shown / safe, 0.0), np.where(seen, 1.0 / np.sqrt(safe), np.inf)

    @property
    def magnitude(self) -> FloatArray:
        """(n_onsets,) the likeliest one of all residuals."""
        return self.weighted(np.ones(len(self.costs)))[0]

    @cached_property
    def ratio(self) -> FloatArray:
        """(n_onsets,) twice the log-likelihood ratio against no fault."""
        return np.asarray(self.parts(self.magnitude).sum(axis=-2))

    def needed(self, ratio: float) -> FloatArray:
        """Return (n_onsets,) the magnitude that a ratio is expected of, infinite where none is."""
        power = self.power.sum(axis=-2)
        seen = _is_seen(power)
        return np.where(seen, np.sqrt((ratio - self.costs.sum()) / np.where(seen, power, 1.0)), np.inf)

    def parts(self, magnitude: FloatArray) -> FloatArray:
        """Return (n_residuals, n_onsets) what each residual says of magnitudes, (n_onsets,)."""
        magnitude = magnitude[..., None, :]
        return np.asarray(self.costs[:, None] + 2.0 * magnitude * self.shown - magnitude**2 * self.power)


def _is_seen(power: FloatArray) -> BoolArray:
    """Return (..., n_onsets) where the residuals show anything of a fault."""
    largest = power.max(axis=-1, initial=TINY, keepdims=True)
    return np.asarray(power > RANK_TOLERANCE * largest)


def noise_model(time_s: FloatArray, levels: FloatArray, slow: FloatArray) -> NoiseModel:
    """Return the covariances of samples at times, (n,) s, for levels of the fast part and a slow part (n, n)."""
    fast = np.exp(-np.abs(time_s[:, None] - time_s[None, :]) / FAST_S)
    # modes fast modes' = 1 and modes slow modes' = diag(slow variances), of fast parts of level 1.
    slow_variances, vectors = lapack.dsygvd(slow, fast)[:2]
    variances = levels[:, None] ** 2 + np.maximum(slow_variances, 0.0)
    fast_log_det = 2.0 * float(np.sum(np.log(np.diag(np.linalg.cholesky(fast)))))
    log_det = np.log(variances).sum(axis=1) + fast_log_det
    return NoiseModel(levels=levels, modes=np.ascontiguousarray(vectors.T), variances=variances, log_det=log_det)


def likelihood_ratio(residuals: Sequence[Residual], signatures: Sequence[FloatArray]) -> LikelihoodRatio:
    """Return what residuals say of a fault.

    Parameters
    ----------
    signatures : of every residual (n, n_onsets), what the fault of magnitude 1 makes of it.
    """
    every = np.zeros(1, dtype=np.intp)
    ratios = likelihood_ratios(residuals, [(every, signature[:, None]) for signature in signatures], 1)
    return replace(ratios, shown=ratios.shown[0], power=ratios.power[0])


def likelihood_ratios(
    residuals: Sequence[Residual], signatures: Sequence[tuple[IntArray, FloatArray]], n_faults: int
) -> LikelihoodRatio:
    """Return what residuals say of each of several faults, see `likelihood_ratio`.

    Parameters
    ----------
    signatures : of every residual the indices of the faults that act on it, and what these make of it,
        (n, n_acting, n_onsets).
    """
    shown, power = np.zeros((2, n_faults, len(residuals), signatures[0][1].shape[2]))
    for j, (residual, (acting, by_fault)) in enumerate(zip(residuals, signatures, strict=True)):
        columns = residual.whitened(by_fault.reshape(len(by_fault), -1))
        shown[acting, j] = (residual.values @ columns).reshape(len(acting), -1)
        power[acting, j] = np.einsum("ij,ij->j", columns, columns).reshape(len(acting), -1)
    costs = np.array([residual.cost for residual in residuals])
    return LikelihoodRatio(shown=shown, power=power, costs=costs)
