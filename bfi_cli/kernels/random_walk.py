"""The course of a fault of unknown shape: an integrated random walk, smoothed.

After its onset the fault is a level and a slope, both unknown, and the double integral of white noise (Kitagawa and
Gersch 1984; Wahba 1978: the smoothing spline is its mean). The noise is held over cells of equal length, so that the
course is linear in a level, a slope and one normal coefficient per cell: a mixed linear model. A singular value
decomposition makes the likelihood of the walk's intensity a sum over scalars (Demmler and Reinsch 1975), so that it
is maximised at no cost; the likelihood is that of the data off the fixed columns (REML: Patterson and Thompson 1971),
which is that of a Kalman filter with a diffuse start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from . import FloatArray
from .normal import TWO_SIDED_95

# Cells of the walk at most. In simulated residuals of 4 to 20 minutes the course then differs from that of a cell per
# sample by less than a tenth of its standard deviation, as long as it has fewer than 30 effective coefficients.
CELLS = 128
# Below this share of the largest, a direction of the fixed columns is round-off: 1e4 times the precision of a double.
RANK_TOLERANCE = 1e-12
# Ratios of walk to noise that are tried, times the inverse square of the largest singular value, before the best is
# refined: from a walk that shows nowhere to one that follows the record to round-off.
RATIOS = np.geomspace(1e-4, 1e14, 91)
# Halvings of the logarithm of the bracket that refine it: to 1e-6 of the ratio.
REFINEMENTS = 40
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MixedFit:
    """A mixed linear model y = X beta + Z b + e, b normal of variance ratio x noise_variance, e of noise_variance.

    Attributes
    ----------
    beta : (n_fixed,), b : (n_random,) estimates.
    ratio : of the variance of b to that of the noise, by maximum likelihood.
    noise_variance : as given, or by maximum likelihood.
    deviance : minus twice the log-likelihood of the data off the fixed columns, constants left out that depend on
        their number only; without : the same for b = 0.
    freedom : effective number of the random coefficients, the trace of their smoother.
    log_det : of the covariance of the data off the fixed columns over the noise's: what the random ones pay.
    """

    beta: FloatArray
    b: FloatArray
    ratio: float
    noise_variance: float
    deviance: float
    without: float
    freedom: float
    log_det: float
    _inverse: FloatArray
    _across: FloatArray
    _V: FloatArray
    _s: FloatArray

    def combine(self, fixed: FloatArray, random: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ``fixed @ beta + random @ b``, (n,), and its standard deviation; the ratio is taken as known."""
        value = fixed @ self.beta + random @ self.b
        left = fixed @ self._inverse
        rest = random - left @ self._across
        along = rest @ self._V.T
        hidden = rest - along @ self._V
        variance = np.sum(left**2, axis=1) + self.ratio * (
            np.sum(along**2 / (1.0 + self.ratio * self._s**2), axis=1) + np.sum(hidden**2, axis=1)
        )
        return np.asarray(value), np.asarray(np.sqrt(self.noise_variance * variance))


def fit_mixed(
    y: FloatArray,
    fixed: FloatArray,
    random: FloatArray,
    *,
    noise_variance: float | None = None,
    ratio: float | None = None,
    spent: int = 0,
) -> MixedFit:
    """Fit a mixed linear model to white data by maximum likelihood off the fixed columns.

    Parameters
    ----------
    y : (n,), fixed : (n, n_fixed), random : (n, n_random).
    noise_variance : where it is known; None to estimate it.
    ratio : of the variances where it is known; None to estimate it.
    spent : dimensions that were projected out of all of it before.

    Raises
    ------
    ValueError : the fixed columns are dependent, or there are no more rows than they.
    """
    n, m = fixed.shape
    degrees = n - m - spent
    if degrees < 1:
        raise ValueError(f"{n} samples do not determine {m + spent} fixed coefficients")
    scale = np.linalg.norm(fixed, axis=0)
    Q, R = np.linalg.qr(fixed / np.where(scale > 0.0, scale, 1.0))
    if m and np.linalg.svd(R, compute_uv=False)[-1] < RANK_TOLERANCE * np.sqrt(m):
        raise ValueError("the fixed columns are dependent")
    across = Q.T @ random
    off = random - Q @ across
    U, s, V = np.linalg.svd(off, full_matrices=False)
    e = y - Q @ (Q.T @ y)
    a = U.T @ e
    rest = max(float(e @ e - a @ a), 0.0)

    def deviance(ratio: float) -> tuple[float, float]:
        gains = 1.0 + ratio * s**2
        misfit = float(np.sum(a**2 / gains)) + rest
        # Of data that the model explains to round-off the noise is that round-off.
        variance = max(misfit / degrees, np.finfo(float).tiny) if noise_variance is None else noise_variance
        return float(np.sum(np.log(gains)) + degrees * np.log(variance) + misfit / variance), variance

    if ratio is None:
        ratio = _best_ratio(lambda x: deviance(x)[0], float(s[0]) if s.size else 0.0)
    least, variance = deviance(ratio)
    b = V.T @ (ratio * s / (1.0 + ratio * s**2) * a)
    inverse = np.linalg.solve(R, np.eye(m)) / np.where(scale > 0.0, scale, 1.0)[:, None]
    return MixedFit(
        beta=inverse @ (Q.T @ y - across @ b),
        b=b,
        ratio=ratio,
        noise_variance=variance,
        deviance=least,
        without=deviance(0.0)[0],
        freedom=float(np.sum(ratio * s**2 / (1.0 + ratio * s**2))),
        log_det=float(np.sum(np.log1p(ratio * s**2))),
        _inverse=inverse,
        _across=across,
        _V=V,
        _s=s,
    )


def _best_ratio(deviance: Callable[[float], float], largest: float) -> float:
    """Return the ratio of least deviance: the best of a grid, refined by golden sections of its logarithm."""
    if largest == 0.0:
        return 0.0
    grid = RATIOS / largest**2
    values = np.array([deviance(x) for x in grid])
    k = int(np.argmin(values))
    if deviance(0.0) <= values[k]:
        return 0.0
    low, high = np.log(grid[max(k - 1, 0)]), np.log(grid[min(k + 1, len(grid) - 1)])
    for _ in range(REFINEMENTS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if deviance(float(np.exp(left))) <= deviance(float(np.exp(right))):
            high = right
        else:
            low = left
    return float(np.exp(0.5 * (low + high)))


def walk_columns(time_s: FloatArray, *, onset_s: float, stop_s: float, cells: int) -> tuple[FloatArray, FloatArray]:
    """Return what an integrated random walk that starts at an onset is made of, zero before it.

    Parameters
    ----------
    time_s : (n,) seconds.
    onset_s, stop_s : between which the cells lie; after the last the walk keeps its slope.
    cells : over which the noise is held.

    Returns
    -------
    (n, 2) level and slope, and (n, cells) the doubly integrated noise of each cell, scaled so that the variance of a
    coefficient is the intensity of the walk (of its second derivative's white noise, unit^2/s^3).
    """
    since = np.maximum(np.asarray(time_s, dtype=np.float64) - onset_s, 0.0)
    active = (np.asarray(time_s) >= onset_s).astype(np.float64)
    edges = np.linspace(0.0, stop_s - onset_s, cells + 1)
    after = np.maximum(since[:, None] - edges, 0.0) ** 2 / 2.0
    return np.column_stack([active, since]), (after[:, :-1] - after[:, 1:]) / np.sqrt(edges[1])


def correlated_noise(time_s: FloatArray, *, sd: float, time_constant_s: float) -> FloatArray:
    """Return (n, n) the covariance ``sd^2 exp(-|dt| / time_constant_s)``; of a random walk where that is infinite.

    A walk starts at the first time, and `sd` is then that of its growth in one second.
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    if np.isinf(time_constant_s):
        since = time_s - time_s.min()
        return np.asarray(sd**2 * np.minimum(since[:, None], since))
    return np.asarray(sd**2 * np.exp(-np.abs(time_s[:, None] - time_s) / time_constant_s))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """The course of a fault, zero before its onset.

    Attributes
    ----------
    time_s, value, sd : (n,) of each point; sd is that of the value, the onset and the walk's intensity taken as known.
    low, high : (n,) the pointwise 95 % band.
    intensity : of the white noise that the fault's second derivative is, unit^2/s^3; 0 for a straight line.
    freedom : how many coefficients the course really has beside its level and slope.
    evidence : twice the log-likelihood that the curvature brings over a straight line.
    """

    time_s: FloatArray
    value: FloatArray
    sd: FloatArray
    intensity: float
    freedom: float
    evidence: float

    @property
    def low(self) -> FloatArray:
        return np.asarray(self.value - TWO_SIDED_95 * self.sd)

    @property
    def high(self) -> FloatArray:
        return np.asarray(self.value + TWO_SIDED_95 * self.sd)


def smoothed_course(
    time_s: FloatArray,
    r: FloatArray,
    *,
    onset_s: float,
    covariance: FloatArray,
    gain: FloatArray | None = None,
    nuisances: FloatArray | None = None,
    at_s: FloatArray | None = None,
    cells: int = CELLS,
) -> Course:
    """Return the course after its onset of a fault of which residuals show a multiple.

    The model is ``r = nuisances @ c + gain * fault(time_s) + noise``. Several residuals of one fault are stacked: rows
    may share a time, and the covariance then has a block for each. Missing samples are left out by the caller.

    Parameters
    ----------
    time_s : (n,) seconds, r : (n,) residuals.
    covariance : (n, n) of the noise, see `correlated_noise`; parts are added.
    gain : (n,) derivative of the residual with respect to the fault; default 1.
    nuisances : (n, m) columns with free coefficients; default a constant.
    at_s : (k,) times of the answer; default the ascending times of the residuals.
    cells : of the walk at most, see `walk_columns`.

    Raises
    ------
    ValueError : the covariance is not positive definite, or nuisances and samples before and after the onset do not
        determine the level and the slope of the fault.
    """
    time_s, r = np.asarray(time_s, dtype=np.float64), np.asarray(r, dtype=np.float64)
    at = np.unique(time_s) if at_s is None else np.asarray(at_s, dtype=np.float64)
    n_after = np.unique(time_s[time_s >= onset_s]).size
    if n_after < 3:
        raise ValueError(f"a course needs 3 samples after its onset, got {n_after}")
    gain = np.ones_like(r) if gain is None else np.asarray(gain, dtype=np.float64)
    nuisances = np.ones((r.size, 1)) if nuisances is None else nuisances
    stop_s, cells = float(time_s.max()), min(cells, n_after - 1)
    root, failed = lapack.dpotrf(covariance, lower=True)
    if failed:
        raise ValueError("the covariance of the residuals is not positive definite")
    line, curved = walk_columns(time_s, onset_s=onset_s, stop_s=stop_s, cells=cells)
    stacked = np.column_stack([nuisances, gain[:, None] * line, gain[:, None] * curved, r])
    white = np.asarray(lapack.dtrtrs(root, stacked, lower=True)[0])
    m = nuisances.shape[1] + 2
    fit = fit_mixed(white[:, -1], white[:, :m], white[:, m:-1], noise_variance=1.0)
    line, curved = walk_columns(at, onset_s=onset_s, stop_s=stop_s, cells=cells)
    value, sd = fit.combine(np.column_stack([np.zeros((at.size, m - 2)), line]), curved)
    return Course(
        time_s=at,
        value=value,
        sd=sd,
        intensity=fit.ratio,
        freedom=fit.freedom,
        evidence=max(fit.without - fit.deviance, 0.0),
    )
