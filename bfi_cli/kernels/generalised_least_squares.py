"""Courses of unknown size beside nuisance terms, by generalised least squares under each of several covariances.

With data, courses and nuisances whitened, an orthonormal basis takes out what the nuisances explain. A course of size x
then leaves S - 2 x shown + x^2 power of the squares S, which is least at x = shown / power, and shown^2 / power is what
its log-likelihood gains twice: the generalised likelihood ratio of a change where the courses are its onsets (Willsky
and Jones 1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import EPS, BoolArray, FloatArray

# RANK_TOLERANCE: share of the nuisances' largest singular value, columns of length 1, below which one is rounding.
RANK_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regressions:
    """Data off the nuisances, under each of n_noises covariances.

    Attributes
    ----------
    y : (n_noises, n + n_priors) whitened.
    basis : (n_noises, n + n_priors, n_nuisances) orthonormal, the priors below, 0 for what depends on others.
    squares : (n_noises,) of y.
    """

    y: FloatArray
    basis: FloatArray
    squares: FloatArray


def regressions(y: FloatArray, nuisances: FloatArray, prior_sd: FloatArray) -> Regressions:
    """Return what nuisances leave of data.

    Parameters
    ----------
    y : (n_noises, n) whitened; nuisances : (n_noises, n, n_nuisances) of any scale and rank.
    prior_sd : (n_nuisances,) of their amounts, infinite for free ones.
    """
    # A prior is a row more, in which an amount of its size is measured to be 0.
    priors = np.diag(1.0 / prior_sd)[np.isfinite(prior_sd)]
    columns = np.concatenate([nuisances, np.broadcast_to(priors, (len(y), *priors.shape))], axis=1)
    scale = np.linalg.norm(columns, axis=1, keepdims=True)
    basis, singular, _ = np.linalg.svd(columns / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
    basis *= (singular > RANK_TOLERANCE * singular[:, :1])[:, None, :]
    y = np.concatenate([y, np.zeros((len(y), len(priors)))], axis=1)
    y -= (basis @ (basis.transpose(0, 2, 1) @ y[:, :, None]))[:, :, 0]
    return Regressions(y=y, basis=basis, squares=np.einsum("ki,ki->k", y, y))


def least_squares(columns: FloatArray, y: FloatArray, rows: BoolArray) -> FloatArray:
    """Return the smallest least-squares solutions (n_problems, n_columns) of many problems of few columns.

    Parameters
    ----------
    columns : (n_problems, n, n_columns); y : (n_problems, n), finite, n > n_columns.
    rows : (n_problems, n) that count in each problem.
    """
    augmented = np.concatenate([columns, y[:, :, None]], axis=2) * rows[:, :, None]
    factor: FloatArray = np.asarray(np.linalg.qr(augmented, mode="r"))
    left, singular, right = np.linalg.svd(factor[:, :-1, :-1])
    # A direction that rounding leaves takes no part, as in LAPACK's gelsd.
    least = EPS * rows.sum(axis=1, keepdims=True) * singular[:, :1]
    along = (factor[:, None, :-1, -1] @ left)[:, 0]
    along = np.divide(along, singular, out=np.zeros_like(along), where=singular > least)
    return np.asarray((along[:, None] @ right)[:, 0])
