"""A predictor of one output and a fault of unknown shape, estimated jointly: an integrated random walk after its onset.

For a given predictor K the filtered output is a mixed linear model: with ``w(k) = y(k) - sum K_i y(k-i)`` and the
columns of the course filtered alike, ``w = base c + line gamma + walk b + e``, b normal of `ratio` times the variance
of e. The marginal likelihood, b integrated out, is maximised over K and the ratio by a quasi-Newton method with its
exact gradient: joint with the course, K is not what the fault made of it. Its determinant is what the curvature of the
course pays; level, slope and ratio are parameters like any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import lapack

from . import FloatArray
from .covariance import Layout
from .lagged import lagged
from .random_walk import fit_mixed

# Below this share of the largest, a direction is round-off (as in `variable_projection`).
RANK_TOLERANCE = 1e-11
# Gradients per row at which the quasi-Newton steps end, and their number.
TOLERANCE, STEPS = 1e-7, 200
# Ratios of walk to noise, times the inverse square of the walk's largest singular value, that the steps start from:
# nearly a line, and a course that follows much.
START_RATIOS = (1e1, 1e5)
# Logarithms of that product between which the ratio is kept.
LEAST, MOST = np.log(1e-6), np.log(1e12)


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
    z, z_sd : (n_named,) magnitudes of the named atoms.
    deviance : minus twice the marginal log-likelihood; a model without a course has n_rows log(variance of its error).
    freedom : effective number of coefficients of the curvature.
    n_parameters : of predictor, base, named atoms, level, slope and ratio.
    n_rows : of the regression.
    converged : the steps ended at a maximum.
    """

    K: FloatArray
    value: FloatArray
    sd: FloatArray
    z: FloatArray
    z_sd: FloatArray
    deviance: float
    freedom: float
    n_parameters: int
    n_rows: int
    converged: bool


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
    fixed = np.column_stack([np.asarray(layout.theta)[:, 0, list(named)], line])
    every = np.column_stack([layout.y[:, 0], fixed, walk])
    lags = lagged(every, range(order + 1), first=first).reshape(n - first, order + 1, -1)
    if unit_root:
        lags = lags[:, :-1] - lags[:, 1:]
    inputs = lagged(np.asarray(layout.u), range(0 if layout.feedthrough else 1, order + 1), first=first)
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
    best: tuple[float, FloatArray, float, bool] | None = None
    for start in starts:
        w, _, Z = _filtered(problem, start)
        size, unit = float(np.linalg.norm(Z, 2)) ** 2, inverse * float(np.linalg.norm(w))

        def target(x: FloatArray, *, at: FloatArray, unit: FloatArray, size: float) -> tuple[float, FloatArray]:
            value, by_K, by_ratio = deviance(problem, at + unit @ x[:-1], float(np.exp(x[-1])) / size)
            return value / n, np.append(unit.T @ by_K, by_ratio) / n

        for ratio in START_RATIOS:
            found = minimize(
                partial(target, at=start, unit=unit, size=size),
                np.append(np.zeros(order), np.log(ratio)),
                jac=True,
                method="L-BFGS-B",
                bounds=[(None, None)] * order + [(LEAST, MOST)],
                options={"maxiter": STEPS, "gtol": TOLERANCE, "ftol": TOLERANCE**2},
            )
            if best is None or found.fun < best[0]:
                best = float(found.fun), start + unit @ found.x[:-1], float(np.exp(found.x[-1])) / size, found.success
    assert best is not None
    return _assembled(problem, best[1], best[2], deviance=n * best[0], converged=best[3])


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
    beside = np.asarray(layout.theta)[:, 0, list(named)] @ fit.z
    corrected = y - fit.value - beside
    inputs = lagged(
        np.asarray(layout.u), range(0 if layout.feedthrough else 1, len(fit.K) + unit_root + 1), first=first
    )
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


def _assembled(problem: CourseProblem, K: FloatArray, ratio: float, *, deviance: float, converged: bool) -> CourseFit:
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
    z, z_sd = mixed.combine(np.eye(m)[:named], np.zeros((named, Z.shape[1])))
    return CourseFit(
        K=K,
        value=value,
        sd=sd,
        z=z,
        z_sd=z_sd,
        deviance=deviance,
        freedom=mixed.freedom,
        n_parameters=problem.n_base + len(K) + m + 1,
        n_rows=len(w),
        converged=converged,
    )
