"""The course of a fault of unknown shape: an integrated random walk, smoothed.

After its onset the fault is a level and a slope, both unknown, and the double integral of white noise (Kitagawa and
Gersch 1984; Wahba 1978: the smoothing spline is its mean). The noise is held over cells of equal length, so that the
course is linear in a level, a slope and one normal coefficient per cell: a mixed linear model. A singular value
decomposition makes the likelihood of the walk's intensity a sum over scalars (Demmler and Reinsch 1975), so that it
is maximised at no cost; the likelihood is that of the data off the fixed columns (REML: Patterson and Thompson 1971),
which is that of a Kalman filter with a diffuse start.

Beside a predictor of one output the two are estimated jointly (`fit_course`). For a given predictor K the filtered
output is a mixed linear model: with ``w(k) = y(k) - sum K_i y(k-i)`` and the columns of the course filtered alike,
``w = base c + line gamma + walk b + e``, b normal of `ratio` times the variance of e. The marginal likelihood, b
integrated out, is maximised over K and the ratio by a quasi-Newton method with its exact gradient: joint with the
course, K is not what the fault made of it. Its determinant is what the curvature of the course pays; level, slope and
ratio are parameters like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from . import TINY, TWO_SIDED_95, FloatArray
from .compiled import lapack
from .covariance import Layout
from .lagged import lagged
from .variable_projection import RANK_TOLERANCE

# Cells of the walk at most. In simulated residuals of 4 to 20 minutes the course then differs from that of a cell per
# sample by less than a tenth of its standard deviation, as long as it has fewer than 30 effective coefficients.
CELLS = 128
# Below this share of the largest, a direction of the fixed columns is round-off: 1e4 times the precision of a double.
DEPENDENT = 1e-12
# Ratios of walk to noise that are tried, times the inverse square of the largest singular value, before the best is
# refined: from a walk that shows nowhere to one that follows the record to round-off.
RATIOS = np.geomspace(1e-4, 1e14, 91)
# Halvings of the logarithm of the bracket that refine it: to 1e-6 of the ratio.
REFINEMENTS = 40
GOLDEN = 0.6180339887498949
# Gradients per row at which the quasi-Newton steps end, and their number.
TOLERANCE, STEPS = 1e-7, 200
# Ratios of walk to noise, times the inverse square of the walk's largest singular value, that the steps start from:
# nearly a line, and a course that follows much.
START_RATIOS = (1e1, 1e5)
# Logarithms of that product between which the ratio is kept.
LEAST, MOST = np.log(1e-6), np.log(1e12)


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
    """

    beta: FloatArray
    b: FloatArray
    ratio: float
    noise_variance: float
    deviance: float
    without: float
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
    if m and np.linalg.svd(R, compute_uv=False)[-1] < DEPENDENT * np.sqrt(m):
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
        # The noise of data that the model explains to round-off is that round-off.
        variance = max(misfit / degrees, TINY) if noise_variance is None else noise_variance
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
    """

    time_s: FloatArray
    value: FloatArray
    sd: FloatArray
    intensity: float

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
    return Course(time_s=at, value=value, sd=sd, intensity=fit.ratio)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CourseProblem:
    """Output and columns of the course at lags 0..order, constant and inputs projected out, rows weighted.

    Attributes
    ----------
    y : (n_rows, order + 1), line : (n_rows, order + 1, n_fixed), walk : (n_rows, order + 1, n_cells); the first of the
        fixed columns are named atoms, the last two level and slope.
    n_base : columns projected out.
    floor : smallest standard deviation a prediction error can have.
    raw_line, raw_walk : (n_samples, ...) the columns over the whole record.
    """

    y: FloatArray
    line: FloatArray
    walk: FloatArray
    n_base: int
    floor: float
    raw_line: FloatArray
    raw_walk: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CourseFit:
    """The course of a fault beside a predictor and named atoms.

    Attributes
    ----------
    K : (order,) coefficients of the lagged corrected output.
    value, sd : (n_samples,) of the course, predictor and named magnitudes being uncertain too.
    z : (n_named,) magnitudes of the named atoms.
    deviance : minus twice the marginal log-likelihood; a model without a course has n_rows log(variance of its error).
    n_parameters : of predictor, base, named atoms, level, slope and ratio.
    """

    K: FloatArray
    value: FloatArray
    sd: FloatArray
    z: FloatArray
    deviance: float
    n_parameters: int


def course_problem(
    layout: Layout,
    *,
    order: int,
    line: FloatArray,
    walk: FloatArray,
    named: Sequence[int] = (),
    unit_root: bool = False,
    floor: float = 0.0,
) -> CourseProblem:
    """Return the regression of one order of a record with one output.

    Parameters
    ----------
    layout : the record; its rows begin at `layout.first` for every order.
    line : (n_samples, 2) level and slope, walk : (n_samples, n_cells), filtered as the record is, see `walk_columns`.
    named : atoms of the layout that act beside the course.
    unit_root : hold a root of the predictor at 1: it acts on the increments of the output, and so do the columns.
    floor : smallest standard deviation a prediction error can have.
    """
    first, n = layout.first, len(layout.y)
    weights = np.ones(n - first) if layout.weights is None else layout.weights[first:]
    fixed = np.column_stack([layout.theta[:, 0, list(named)], line])
    every = np.column_stack([layout.y[:, 0], fixed, walk])
    lags = lagged(every, range(order + 1), first=first).reshape(n - first, order + 1, -1)
    if unit_root:
        lags = lags[:, :-1] - lags[:, 1:]
    inputs = lagged(layout.u, range(0 if layout.feedthrough else 1, order + 1), first=first)
    base = np.hstack([np.ones((n - first, 1)), inputs]) * weights[:, None]
    norms = np.linalg.norm(base, axis=0)
    U, s, _ = np.linalg.svd(base / np.where(norms > 0.0, norms, 1.0), full_matrices=False)
    Q = U[:, s > RANK_TOLERANCE * s[0]]
    flat = lags.reshape(n - first, -1) * weights[:, None]
    lags = (flat - Q @ (Q.T @ flat)).reshape(lags.shape)
    m = 1 + fixed.shape[1]
    return CourseProblem(
        y=lags[:, :, 0],
        line=lags[:, :, 1:m],
        walk=lags[:, :, m:],
        n_base=Q.shape[1],
        floor=floor,
        raw_line=fixed,
        raw_walk=walk,
    )


def fit_course(problem: CourseProblem, starts: Sequence[FloatArray] = ()) -> CourseFit:
    """Maximise the marginal likelihood of predictor and course.

    Parameters
    ----------
    starts : (order,) each, predictors to begin at; default that of the record without a course.
    """
    from scipy.optimize import minimize

    n, order = len(problem.y), problem.y.shape[1] - 1
    starts = starts or [np.asarray(np.linalg.lstsq(problem.y[:, 1:], problem.y[:, 0], rcond=RANK_TOLERANCE)[0])]
    # A step of unit length changes the prediction by about one prediction error, whatever the lags look like.
    inverse = np.linalg.pinv(np.linalg.qr(problem.y[:, 1:], mode="r"), rcond=RANK_TOLERANCE)
    best: tuple[float, FloatArray, float] | None = None
    for start in starts:
        w, _, Z = _filtered(problem, start)
        size, unit = float(np.linalg.norm(Z, 2)) ** 2, inverse * float(np.linalg.norm(w))

        def target(x: FloatArray, *, at: FloatArray, unit: FloatArray, size: float) -> tuple[float, FloatArray]:
            value, by_K, by_ratio = deviance(problem, at + unit @ x[:-1], float(np.exp(x[-1])) / size)
            return value / n, np.append(unit.T @ by_K, by_ratio) / n

        for ratio in START_RATIOS:
            result = minimize(
                partial(target, at=start, unit=unit, size=size),
                np.append(np.zeros(order), np.log(ratio)),
                jac=True,
                method="L-BFGS-B",
                bounds=[(None, None)] * order + [(LEAST, MOST)],
                options={"maxiter": STEPS, "gtol": TOLERANCE, "ftol": TOLERANCE**2},
            )
            if best is None or result.fun < best[0]:
                best = float(result.fun), start + unit @ result.x[:-1], float(np.exp(result.x[-1])) / size
    assert best is not None
    return _assembled(problem, best[1], best[2], deviance=n * best[0])


def redrawn(
    layout: Layout,
    fit: CourseFit,
    course: FloatArray,
    *,
    named: Sequence[int],
    unit_root: bool,
    rng: np.random.Generator,
) -> Layout:
    """Return the record with an output drawn anew from a fitted model: the same inputs and size of errors, any course.

    What the course is estimated to be in such records tells its error, that of a predictor which absorbs it included.

    Parameters
    ----------
    course : (n_samples,) of the fault of unknown shape; the named ones keep their magnitudes.
    named, unit_root : of the fit.
    """
    from scipy.signal import lfilter, lfiltic

    first, y = layout.first, layout.y[:, 0]
    weights = np.ones(len(y)) if layout.weights is None else layout.weights
    beside = layout.theta[:, 0, list(named)] @ fit.z
    corrected = y - fit.value - beside
    inputs = lagged(layout.u, range(0 if layout.feedthrough else 1, len(fit.K) + unit_root + 1), first=first)
    base = np.hstack([np.ones((len(y) - first, 1)), inputs])
    # Increments obey K where a root is held at 1: the predictor of the output itself has one lag more.
    taps = np.convolve([1.0, -1.0], np.concatenate([[1.0], -fit.K])) if unit_root else np.concatenate([[1.0], -fit.K])
    filtered = lagged(corrected[:, None], range(len(taps)), first=first) @ taps
    coefficients = np.linalg.lstsq(base * weights[first:, None], filtered * weights[first:], rcond=RANK_TOLERANCE)[0]
    error = (filtered - base @ coefficients) * weights[first:]
    sd = np.sqrt(error @ error / max(len(error) - fit.n_parameters, 1)) / weights[first:]
    driven = base @ coefficients + sd * rng.standard_normal(len(error))
    made = corrected.copy()
    made[first:] = lfilter([1.0], taps, driven, zi=lfiltic([1.0], taps, made[:first][::-1]))[0]
    return replace(layout, y=(made + course + beside)[:, None])


def _filtered(problem: CourseProblem, K: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return output, fixed columns and walk less their predictions."""
    taps = np.concatenate([[1.0], -K])
    return problem.y @ taps, np.einsum("kij,i->kj", problem.line, taps), np.einsum("kij,i->kj", problem.walk, taps)


def deviance(problem: CourseProblem, K: FloatArray, ratio: float) -> tuple[float, FloatArray, float]:
    """Return the deviance, its gradient with respect to K, (order,), and to the logarithm of the ratio.

    With V = I + ratio Z Z' the covariance of the filtered output over that of the noise, it is
    ``n log(min (w - L gamma)' V^-1 (w - L gamma) / n) + log det V``, evaluated by a QR of [sqrt(ratio) Z; I].
    """
    w, L, Z = _filtered(problem, K)
    n, cells = Z.shape
    Q, T = np.linalg.qr(np.vstack([np.sqrt(ratio) * Z, np.eye(cells)]))
    rest = np.vstack([np.column_stack([L, w]), np.zeros((cells, L.shape[1] + 1))])
    rest -= Q @ (Q.T @ rest)
    gamma = np.linalg.lstsq(rest[:, :-1], rest[:, -1], rcond=RANK_TOLERANCE)[0]
    left = rest[:, -1] - rest[:, :-1] @ gamma
    r, b, misfit = left[:n], -np.sqrt(ratio) * left[n:], float(left @ left) + n * problem.floor**2
    corrected = problem.y[:, 1:] - problem.line[:, 1:] @ gamma - problem.walk[:, 1:] @ b
    # ratio (I + ratio Z'Z)^-1 Z'
    inner = np.sqrt(ratio) * lapack.dtrtrs(T, np.ascontiguousarray(Q[:n].T))[0]
    value = n * np.log(misfit / n) + 2.0 * float(np.sum(np.log(np.abs(np.diag(T)))))
    by_K = -2.0 * n / misfit * (r @ corrected) - 2.0 * np.einsum("jk,kij->i", inner, problem.walk[:, 1:])
    by_ratio = -n / misfit * float(left[n:] @ left[n:]) + float(np.sum(inner.T * Z))
    return value, by_K, by_ratio


def _assembled(problem: CourseProblem, K: FloatArray, ratio: float, *, deviance: float) -> CourseFit:
    """Return the course at the maximum; the lagged corrected outputs are projected out, for K is uncertain too."""
    w, L, Z = _filtered(problem, K)
    m = L.shape[1]
    plain = fit_mixed(w, L, Z, ratio=ratio)
    corrected = problem.y[:, 1:] - problem.line[:, 1:] @ plain.beta - problem.walk[:, 1:] @ plain.b
    U, s, _ = np.linalg.svd(corrected, full_matrices=False)
    U = U[:, s > RANK_TOLERANCE * s[0]]
    w, L, Z = (x - U @ (U.T @ x) for x in (w, L, Z))
    mixed = fit_mixed(w, L, Z, ratio=ratio, spent=problem.n_base + U.shape[1])
    named = m - 2
    line = np.column_stack([np.zeros((len(problem.raw_line), named)), problem.raw_line[:, named:]])
    value, sd = mixed.combine(line, problem.raw_walk)
    return CourseFit(
        K=K,
        value=value,
        sd=sd,
        z=mixed.beta[:named],
        deviance=deviance,
        n_parameters=problem.n_base + len(K) + m + 1,
    )
