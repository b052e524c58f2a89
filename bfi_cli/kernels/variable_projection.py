"""Structured maximum likelihood of magnitudes and predictor, by variable projection on compressed data.

With ``yf = y - theta z`` the predictor ``yf(k) = c + sum B_i u(k-i) + sum K_i yf(k-i) + e(k)`` is linear in (c, B, K)
for given z. For the current z these are solved for; the derivative of the prediction error with respect to z_j is minus
the filtered signature ``g_j(k) = theta_j(k) - sum K_i theta_j(k-i)`` off the regressors, whitened by the residual
covariance. Golub and Pereyra (1973) for variable projection.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from . import TINY, BoolArray, FloatArray
from .compiled import einsum, lapack
from .lagged import Compressed, restrict
from .progress import Termination

# Below this share of the largest, a direction of the regressors is round-off: 1e5 times the precision of a double.
RANK_TOLERANCE = 1e-11
# A step is halved so often before the search along it is given up: the last trial is 1/2000 of the step.
HALVINGS = 12
# A step that raises the likelihood nowhere is round-off at a maximum where it promised less than this squared norm per
# row, in units of the prediction error; where it promised more, the fit is stuck.
ROUND_OFF_GAIN = 1e-4
# Numbers of outputs that are fitted together: 16 MB, and a few times that of what is made of them.
TOGETHER = 2 * 10**6
# Of a fit, beyond which its steps have ceased to matter.
MAX_ITERATIONS = 50
# Of a profile, whose statistic is compared with 10 and more: by row, 1e-3 of that statistic in a record of 1000 rows.
PROFILE_TOLERANCE = 1e-6
# Where its columns are so much fewer than the rows, a support is factorised once before the many passes of a fit. It
# changes the speed only.
COMPRESSED = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProjectedRegression:
    """The regression of one order with constant and inputs projected out.

    Attributes
    ----------
    theta : (m, order + 1, n_signals) dictionary signals at lags 0..order; rows are next to each other in memory.
    y : (m, order + 1, n_outputs) measured outputs at lags 0..order.
    signals : (output, atom) of each signal, ascending.
    n_rows : rows the compressed data stand for; n_base : constant and input regressors per output.
    floor : smallest standard deviation a prediction error can have, in the units of y.
    scaling : by atom whose signal is the output itself from some row on: how many rows that are, and the share of the
        output that a magnitude of 1 is. The density of the output is that of the corrected one times ``|1 - share z|``
        a row; without that factor an output that is scaled down to nothing would be the likeliest.
    slopes : the same where signals change with the output in another way: by atom, (n,), how much a signal of magnitude
        1 changes with the output, and how many rows that is, (n,). The factor is then ``|1 - sum_j slopes_j z_j|`` a
        row; None where `scaling` tells it.
    """

    theta: FloatArray
    y: FloatArray
    signals: tuple[tuple[int, int], ...]
    n_rows: int
    n_base: int
    floor: float
    scaling: Mapping[int, tuple[int, float]] = field(default_factory=dict)
    slopes: tuple[Mapping[int, FloatArray], FloatArray] | None = None

    @property
    def order(self) -> int:
        return int(self.y.shape[1]) - 1

    @property
    def n_outputs(self) -> int:
        return int(self.y.shape[2])

    def columns_of(self, atom: int) -> list[int]:
        """Return the columns of `theta` that hold an atom's signals, one for each output that it acts on."""
        wanted = [(output, atom) for output in range(self.n_outputs)]
        columns = [bisect_left(self.signals, signal) for signal in wanted]
        return [n for n, signal in zip(columns, wanted, strict=True) if self.signals[n : n + 1] == (signal,)]

    @property
    def n_predictor(self) -> int:
        """Free coefficients of c, B and K."""
        return self.n_outputs * (self.n_base + self.order * self.n_outputs)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A maximum of the likelihood on one support and order.

    Attributes
    ----------
    order : of the predictor.
    atoms : the support, ascending.
    z : (n_active,) magnitudes.
    K : (order, n_outputs, n_outputs), K[i - 1] multiplies yf(k - i).
    log_det : log det of the floored residual covariance; sigma : (n_outputs, n_outputs) that covariance.
    information : (n_active, n_active) of z with the predictor eliminated: its inverse is the covariance of z.
    n_parameters : predictor and magnitudes.
    iterations, termination : steps made, and why no more were.
    criterion : of the penalty under which supports are compared, NaN of a fit that is compared with none.
    """

    order: int
    atoms: tuple[int, ...]
    z: FloatArray
    K: FloatArray
    log_det: float
    sigma: FloatArray
    information: FloatArray
    n_parameters: int
    iterations: int
    termination: Termination
    criterion: float = math.nan

    def is_as(self, other: Fit) -> bool:
        """Say whether it is the other fit, the criterion apart."""
        return self.z is other.z and self.K is other.K

    @property
    def covariance(self) -> FloatArray:
        """(n_active, n_active) of the magnitudes, the covariance of the prediction error being `sigma`."""
        scale = np.sqrt(np.diag(self.information))
        scale[scale == 0.0] = 1.0
        units = np.outer(scale, scale)
        return np.asarray(np.linalg.pinv(self.information / units, rcond=RANK_TOLERANCE, hermitian=True) / units)

    def bic(self, n_rows: int) -> float:
        """Return the Bayesian information criterion over so many rows."""
        return n_rows * self.log_det + self.n_parameters * float(np.log(n_rows))


def project_inputs(data: Compressed, order: int, *, floor: float = 0.0) -> ProjectedRegression:
    """Return the regression of `order` on the rows of `data`, constant and inputs projected out."""
    lower = restrict(data, order=order)
    columns, rest = lower.columns, lower.R[lower.columns.n_base :]
    theta, y = (
        np.concatenate([rest.T[now], rest.T[lags]]).reshape(order + 1, -1, len(rest)).transpose(2, 0, 1)
        for now, lags in ((columns.theta, columns.theta_lags), (columns.y, columns.y_lags))
    )
    return ProjectedRegression(
        theta=theta, y=y, signals=columns.signals, n_rows=data.n_rows, n_base=columns.n_base, floor=floor
    )


def log_dets_beside(problem: ProjectedRegression, atoms: Sequence[int], z: FloatArray, fit: Fit) -> FloatArray:
    """Return (n, 2) log det of a support's fit to the outputs less each atom's signals, and to those plus as much.

    All fits are made together, step by step; one whose regressors or signatures are dependent is made by itself.

    Parameters
    ----------
    atoms : whose signals are taken off, one at a time, (n,) z times.
    fit : of the support to the outputs, from which all begin.
    """
    support = _Support(problem, fit.atoms, compress=False)
    log_dets = np.empty((len(atoms), 2))
    n_together = max(1, TOGETHER // (2 * support.y.size))
    for start in range(0, len(atoms), n_together):
        part = slice(start, start + n_together)
        shared, signals = support.on_fewer_rows(atoms[part])
        change = z[part, None, None, None] * signals
        outputs = np.stack([shared.y - change, shared.y + change], axis=1).reshape(-1, *shared.y.shape)
        fitted, is_plain = _log_dets_of_outputs(shared, outputs, fit.z)
        for n in np.flatnonzero(~is_plain).tolist():
            alone = without_signal(problem, atoms[start + n // 2], float(z[start + n // 2]) * (-1.0) ** n)
            fitted[n] = fit_magnitudes(alone, fit.atoms, fit.z, tolerance=PROFILE_TOLERANCE).log_det
        log_dets[part] = fitted.reshape(-1, 2)
    return log_dets


def _log_dets_of_outputs(support: _Support, y: FloatArray, start: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (n,) log det of the support's fit to each of some outputs, as `fit_magnitudes` does, and where that holds.

    Parameters
    ----------
    y : (n, m, order + 1, n_outputs); start : (n_active,) magnitudes to start from.
    """
    n_rows, n = support.problem.n_rows, len(y)
    z = np.tile(start, (n, 1))
    log_det, G, e, is_plain = support.linearised(y, z)
    moving = np.flatnonzero(is_plain) if support.atoms else np.zeros(0, dtype=np.intp)
    for _ in range(MAX_ITERATIONS):
        if not moving.size:
            break
        scale = np.linalg.norm(G[moving], axis=1, keepdims=True)
        scale[scale == 0.0] = 1.0
        Q, R = np.linalg.qr(G[moving] / scale)
        full = _is_full_rank(R)
        is_plain[moving[~full]] = False
        moving, Q, R, scale = moving[full], Q[full], R[full], scale[full]
        if not moving.size:
            break
        along = einsum("nij,ni->nj", Q, e[moving])
        step = np.linalg.solve(R, along[:, :, None])[:, :, 0] / scale[:, 0]
        gain, before = np.sum(along**2, axis=1), log_det[moving]
        trying = np.arange(len(moving))
        for length in 0.5 ** np.arange(HALVINGS):
            k = moving[trying]
            trial = support.linearised(y[k], z[k] + length * step[trying])
            better = trial[0] < log_det[k]
            to = k[better]
            z[to] += length * step[trying[better]]
            log_det[to], G[to], e[to] = (values[better] for values in trial[:3])
            is_plain[to] &= trial[3][better]
            trying = trying[~better]
            if not trying.size:
                break
        tolerance = PROFILE_TOLERANCE
        rests = (before - log_det[moving] < tolerance) & (gain < tolerance * n_rows)
        rests[trying] = True
        moving = moving[~rests & is_plain[moving]]
    return log_det, is_plain


def without_signal(problem: ProjectedRegression, atom: int, z: float) -> ProjectedRegression:
    """Return the regression of the outputs less z times an atom's signals."""
    y = problem.y.copy()
    for column in problem.columns_of(atom):
        y[:, :, problem.signals[column][0]] -= z * problem.theta[:, :, column]
    return replace(problem, y=y)


def with_unit_root(problem: ProjectedRegression) -> ProjectedRegression:
    """Return the regression of the same rows whose predictor holds a root at 1: that of the differenced outputs.

    With ``K_1 + ... + K_s = I`` the predictor acts on ``yf(k) - yf(k-1)`` and its s - 1 lags, and so do the signals.
    What it predicts drifts away from any level, so that a slow fault is told by its start alone.

    Parameters
    ----------
    problem : of order 2 or more.
    """
    theta, y = (x[:, :-1] - x[:, 1:] for x in (problem.theta, problem.y))
    return replace(problem, theta=theta, y=y)


def fit_magnitudes(
    problem: ProjectedRegression,
    atoms: Sequence[int],
    start: FloatArray | None = None,
    *,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-9,
) -> Fit:
    """Maximise the likelihood over (c, B, K, z) with z supported on `atoms`, from `start` (zero by default).

    Parameters
    ----------
    problem : from `project_inputs`.
    atoms : the support, ascending.
    start : (len(atoms),) magnitudes to start from.
    tolerance : on the fall of the log-likelihood per row, and on the step relative to the magnitudes' own deviations.
    """
    support = _Support(problem, atoms)
    z = np.zeros(len(atoms)) if start is None else np.array(start, dtype=np.float64)
    at = support.predict(z)
    G, e = support.linearise(at)
    termination, iterations = Termination.CONVERGED, 0
    while support.atoms:
        if iterations == max_iterations:
            termination = Termination.MAX_ITERATIONS
            break
        iterations += 1
        scale = np.linalg.norm(G, axis=0)
        scale[scale == 0.0] = 1.0
        step = np.linalg.lstsq(G / scale, e, rcond=RANK_TOLERANCE)[0] / scale
        gain = float(np.sum((G @ step) ** 2))
        for length in 0.5 ** np.arange(HALVINGS):
            trial = support.predict(z + length * step)
            if trial.log_det < at.log_det:
                break
        else:
            small = gain < ROUND_OFF_GAIN * problem.n_rows
            termination = Termination.CONVERGED if small else Termination.STAGNATED
            break
        fall = at.log_det - trial.log_det
        z, at = z + length * step, trial
        G, e = support.linearise(at)
        if fall < tolerance and gain < tolerance * problem.n_rows:
            break
    return Fit(
        order=problem.order,
        atoms=support.atoms,
        z=z,
        K=at.K,
        log_det=at.log_det,
        sigma=at.root.T @ at.root,
        information=G.T @ G,
        n_parameters=problem.n_predictor + len(support.atoms),
        iterations=iterations,
        termination=termination,
    )


def linear_additions(problem: ProjectedRegression, fit: Fit, atoms: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Add each atom alone to a fit, linearised there.

    Parameters
    ----------
    problem, fit : of one order.
    atoms : to add, ascending.

    Returns
    -------
    gain : (len(atoms),) by how much n_rows times log det falls, to first order; 0 for an atom that is not seen.
    magnitude : (len(atoms),) of the addition.
    """
    magnitude, power = _additions(problem, fit, atoms)
    share = np.minimum(magnitude**2 * power / problem.n_rows, 1.0 - ROUND_OFF_GAIN)
    return -problem.n_rows * np.log1p(-share), magnitude


def single_magnitudes(problem: ProjectedRegression, fit: Fit, n_atoms: int) -> tuple[FloatArray, FloatArray]:
    """Return magnitudes and variances of all atoms: those of a fit, and of another if it alone joined the support.

    Parameters
    ----------
    problem, fit : of one order.

    Returns
    -------
    magnitude, variance : (n_atoms,), NaN where an atom is not seen.
    """
    magnitude, power = _additions(problem, fit, range(n_atoms))
    seen, active = power > 0.0, list(fit.atoms)
    magnitude, variance = np.where(seen, magnitude, np.nan), 1.0 / np.where(seen, power, np.nan)
    magnitude[active], variance[active] = fit.z, np.diag(fit.covariance)
    free = problem.n_predictor + len(active)
    return magnitude, variance * problem.n_rows / max(problem.n_rows - free / problem.n_outputs, 1.0)


def _additions(problem: ProjectedRegression, fit: Fit, atoms: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return magnitude and power, the inverse of its variance, of each atom added alone to a fit; 0 where not seen."""
    support, together = _Support(problem, fit.atoms, compress=False), sorted({*fit.atoms, *atoms})
    at = support.predict(fit.z)
    regressors, e = support.linearise(at)
    others = support.whiten(at, _Support(problem, together, compress=False).filter(at.K))[:, np.isin(together, atoms)]
    raw = einsum("ij,ij->j", others, others)
    Q = np.linalg.qr(regressors)[0]
    others = others - Q @ (Q.T @ others)
    power = einsum("ij,ij->j", others, others)
    seen = power > RANK_TOLERANCE * raw
    magnitude = np.where(seen, others.T @ (e - Q @ (Q.T @ e)), 0.0) / np.where(seen, power, 1.0)
    return magnitude, np.where(seen, power, 0.0)


def relaxed_bound(problem: ProjectedRegression, base: Fit | None, extra: int) -> tuple[float, float]:
    """Free the lagged coefficients of atom `extra`: the bilinear constraint dropped.

    The atoms of `base` may move along their filtered signatures, so with a support the value is a guide rather than a
    strict bound; without one it bounds every magnitude of `extra`.

    Returns
    -------
    log_det : what the freed problem reaches.
    magnitude : the coefficient of `extra` at lag 0, a start for `fit_magnitudes`.
    """
    support = _Support(problem, base.atoms if base else (), compress=False)
    freed = _Support(problem, (extra,), compress=False)
    corrected = support.correct(base.z if base else np.zeros(0))
    n = len(corrected)
    moves = support.filter(base.K).reshape(n, -1) if base and base.atoms else np.zeros((n, 0))
    regressors = np.hstack([corrected[:, 1:].reshape(n, -1), freed.theta.reshape(n, -1), moves])
    Q, coefficients = _regress(regressors, corrected[:, 0])
    _, log_det = _covariance_root(corrected[:, 0] - Q @ (Q.T @ corrected[:, 0]), problem)
    now = coefficients[problem.order * problem.n_outputs :][: freed.theta.shape[2]]
    outputs = np.argmax(freed.acts, axis=1)
    return log_det, float(np.mean(now[np.arange(len(outputs)), outputs])) if len(outputs) else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Predictor:
    """The predictor for given z: Q spans the lagged corrected outputs, root is that of the error's covariance."""

    Q: FloatArray
    K: FloatArray
    error: FloatArray
    root: FloatArray
    log_det: float


class _Support:
    """The regression with the magnitudes of some atoms free; all others are zero.

    `theta`, (m, order + 1, n_kept), holds the signals of these atoms, `y` the outputs on the same rows. `acts`,
    (n_kept, n_outputs), is 1 for the output on which each acts, and `owner`, (n_kept,), the place of its atom.
    """

    def __init__(self, problem: ProjectedRegression, atoms: Sequence[int], *, compress: bool = True) -> None:
        self.problem, self.atoms = problem, tuple(atoms)
        place = {atom: j for j, atom in enumerate(self.atoms)}
        kept = [column for column, (_, atom) in enumerate(problem.signals) if atom in place]
        self.acts = np.zeros((len(kept), problem.n_outputs))
        self.acts[np.arange(len(kept)), [problem.signals[column][0] for column in kept]] = 1.0
        self.owner = np.array([place[problem.signals[column][1]] for column in kept], dtype=np.intp)
        every = len(kept) == len(problem.signals)
        self.theta, self.y = problem.theta if every else problem.theta[:, :, kept], problem.y
        if compress and len(self.y) > COMPRESSED * (columns := self.theta[0].size + self.y[0].size):
            stacked = np.concatenate([self.theta, self.y], axis=2).reshape(len(self.y), columns)
            R = np.asarray(np.linalg.qr(stacked, mode="r")).reshape(columns, problem.order + 1, -1)
            self.theta, self.y = R[:, :, : len(kept)], R[:, :, len(kept) :]

    def on_fewer_rows(self, others: Sequence[int]) -> tuple[_Support, FloatArray]:
        """Return the same regression, and other atoms' signals, on the few rows that hold it and any one of these.

        These are coordinates in a basis of the support's own columns and, for each other atom, of what its signals add.

        Returns
        -------
        support : with new `theta` and `y`.
        signals : (n_others, m, order + 1, n_outputs) of the other atoms, on these rows.
        """
        signals = np.zeros((len(others), *self.y.shape))
        for n, atom in enumerate(others):
            for column in self.problem.columns_of(atom):
                signals[n, :, :, self.problem.signals[column][0]] = self.problem.theta[:, :, column]
        stacked, added = np.concatenate([self.theta, self.y], axis=2), self.y[0].size
        if len(stacked) <= COMPRESSED * (stacked[0].size + added):
            return self, signals
        Q, R = np.linalg.qr(stacked.reshape(len(stacked), -1))
        rest, within = signals.reshape(len(others), -1, added), np.zeros((len(others), len(R), added))
        for _ in range(2):  # once loses digits where the support explains nearly all
            along = Q.T @ rest
            rest, within = rest - Q @ along, within + along
        signals = np.concatenate([within, np.linalg.qr(rest, mode="r")], axis=1)
        shared = copy(self)
        rows = np.concatenate([R, np.zeros((added, R.shape[1]))]).reshape(-1, *stacked.shape[1:])
        shared.theta, shared.y = rows[:, :, : self.theta.shape[2]], rows[:, :, self.theta.shape[2] :]
        return shared, signals.reshape(len(others), *shared.y.shape)

    def correct(self, z: FloatArray) -> FloatArray:
        """Return the outputs at lags 0..order without the faults of magnitudes z."""
        return np.asarray(self.y - self.theta @ (self.acts * z[self.owner, None]))

    def predict(self, z: FloatArray) -> _Predictor:
        """Return the predictor that fits best for given magnitudes."""
        corrected, n_y = self.correct(z), self.problem.n_outputs
        Q, coefficients = _regress(corrected[:, 1:].reshape(len(corrected), -1), corrected[:, 0])
        error = corrected[:, 0] - Q @ (Q.T @ corrected[:, 0])
        root, log_det = _covariance_root(error, self.problem)
        log_det -= self.log_jacobian(z)
        K = coefficients.reshape(self.problem.order, n_y, n_y).transpose(0, 2, 1)
        return _Predictor(Q=Q, K=K, error=error, root=root, log_det=log_det)

    def log_jacobian(self, z: FloatArray) -> float:
        """Return twice the logarithm of the density's factor per row, see `ProjectedRegression.scaling`."""
        if self.problem.slopes is not None:
            slopes, rows = self.problem.slopes
            kept = [rows * 0.0] + [slopes[atom] * z[j] for j, atom in enumerate(self.atoms) if atom in slopes]
            factor = np.maximum(np.abs(1.0 - sum(kept[1:], kept[0])), TINY)
            return 2.0 * float(rows @ np.log(factor)) / self.problem.n_rows
        if not self.problem.scaling:
            return 0.0
        shares = [
            (self.problem.scaling[atom], z[j]) for j, atom in enumerate(self.atoms) if atom in self.problem.scaling
        ]
        logs = [rows * np.log(max(abs(1.0 - share * size), TINY)) for (rows, share), size in shares]
        return 2.0 * float(sum(logs)) / self.problem.n_rows

    def filter(self, K: FloatArray) -> FloatArray:
        """Return (m, n_outputs, n_active) signals filtered by the predictor: theta(k) - sum K_i theta(k - i)."""
        filtered = self.theta[:, 0, None, :] * self.acts.T
        filtered -= einsum("nls,los->nos", self.theta[:, 1:], K @ self.acts.T)
        alike = self.problem.n_outputs == 1 and len(self.owner) == len(self.atoms)
        return np.asarray(filtered if alike else filtered @ self._owned())

    def _owned(self) -> FloatArray:
        """Return (n_kept, n_active) 1 where a signal is an atom's."""
        return np.equal.outer(self.owner, np.arange(len(self.atoms))).astype(float)

    def linearise(self, at: _Predictor) -> tuple[FloatArray, FloatArray]:
        """Return filtered signatures off the regressors and the prediction error, both whitened, outputs stacked."""
        return self.whiten(at, self.filter(at.K)), _white(at.root, at.error[:, :, None])[:, 0]

    def linearised(self, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return what `predict` and `linearise` do, for n outputs and magnitudes at once.

        Parameters
        ----------
        y : (n, m, order + 1, n_outputs); z : (n, n_active).

        Returns
        -------
        log_det : (n,).
        G, e : (n, n_outputs * m, n_active) and (n, n_outputs * m), see `linearise`.
        is_plain : (n,) whether the regressors are independent; the rest is void where they are not.
        """
        n, m, n_y, order = len(y), y.shape[1], self.problem.n_outputs, self.problem.order
        sizes = self.acts[:, :, None] * z.T[self.owner, None]
        corrected = y - np.moveaxis(np.tensordot(self.theta, sizes, axes=1), -1, 0)
        Q, R = np.linalg.qr(corrected[:, :, 1:].reshape(n, m, order * n_y))
        is_plain = _is_full_rank(R)
        R[~is_plain] = np.eye(R.shape[1])
        along = Q.transpose(0, 2, 1) @ corrected[:, :, 0]
        K = np.linalg.solve(R, along).reshape(n, order, n_y, n_y).transpose(0, 1, 3, 2)
        error = corrected[:, :, 0] - Q @ along
        floor = np.broadcast_to(_floor(self.problem) * np.eye(n_y), (n, n_y, n_y))
        stacked = np.concatenate([error / np.sqrt(self.problem.n_rows), floor], axis=1)
        root = np.asarray(np.linalg.qr(stacked, mode="r"))
        log_det = 2.0 * np.log(np.abs(np.diagonal(root, axis1=1, axis2=2))).sum(axis=1)
        log_det -= [self.log_jacobian(magnitudes) for magnitudes in z]
        filtered = self.theta[:, 0, None, :] * self.acts.T
        filtered = filtered - einsum("mls,nlos->nmos", self.theta[:, 1:], K @ self.acts.T)
        G = (filtered @ self._owned()).reshape(n, m, -1)
        G = (G - Q @ (Q.transpose(0, 2, 1) @ G)).reshape(n, m, n_y, -1)
        both = np.concatenate([G, error[:, :, :, None]], axis=3).transpose(0, 2, 1, 3).reshape(n, n_y, -1)
        white = (np.linalg.solve(root.transpose(0, 2, 1), np.eye(n_y)) @ both).reshape(n, n_y * m, -1)
        return log_det, white[:, :, :-1], white[:, :, -1], is_plain

    def whiten(self, at: _Predictor, G: FloatArray) -> FloatArray:
        """Return (n_outputs * m, n) filtered signatures G (m, n_outputs, n) off the regressors, whitened."""
        flat = G.reshape(len(G), -1)
        return _white(at.root, (flat - at.Q @ (at.Q.T @ flat)).reshape(G.shape))


def _white(root: FloatArray, x: FloatArray) -> FloatArray:
    """Return (n_outputs * m, n) columns of unit covariance from (m, n_outputs, n), root being that of theirs."""
    stacked = x.transpose(1, 0, 2).reshape(len(root), -1)
    return np.asarray(lapack.dtrtrs(root, stacked, trans=1)[0]).reshape(len(root) * len(x), x.shape[2])


def _regress(X: FloatArray, Y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an orthonormal basis of X, of lower rank where X is deficient, and the coefficients of Y."""
    m, n = X.shape
    if m >= n > 0:
        # In every step of a fit: numpy's wrapper of the same routines takes twice as long for a few columns.
        factor, reflectors, _, _ = lapack.dgeqrf(X)
        diagonal = np.abs(np.diag(factor))
        if diagonal.min() > RANK_TOLERANCE * diagonal.max():
            Q = np.asarray(lapack.dorgqr(factor, reflectors)[0])
            return Q, np.asarray(lapack.dtrtrs(factor[:n], Q.T @ Y)[0])
    U, s, Vt = np.linalg.svd(X, full_matrices=False)
    rank = int(np.count_nonzero(s > RANK_TOLERANCE * s[0])) if s.size else 0
    return U[:, :rank], Vt[:rank].T @ ((U[:, :rank].T @ Y) / s[:rank, None])


def _is_full_rank(R: FloatArray) -> BoolArray:
    """Return (n,) whether triangular factors (n, k, k) are those of independent columns."""
    diagonal = np.abs(np.diagonal(R, axis1=1, axis2=2))
    return np.asarray((R.shape[1] == R.shape[2]) & (diagonal.min(axis=1) > RANK_TOLERANCE * diagonal.max(axis=1)))


def _floor(problem: ProjectedRegression) -> float:
    """Return the standard deviation that is added to prediction errors, whose logarithm is taken."""
    return float(max(problem.floor, TINY**0.25))


def _covariance_root(error: FloatArray, problem: ProjectedRegression) -> tuple[FloatArray, float]:
    """Return the triangular root of the floored residual covariance, and log det of that covariance."""
    floor = _floor(problem)
    if problem.n_outputs == 1:
        size = np.hypot(np.sqrt(error[:, 0] @ error[:, 0]) / np.sqrt(problem.n_rows), floor)
        return size[None, None], 2.0 * float(np.log(size))
    stacked = np.vstack([error / np.sqrt(problem.n_rows), floor * np.eye(problem.n_outputs)])
    root = np.triu(lapack.dgeqrf(stacked)[0][: problem.n_outputs])
    return root, 2.0 * float(np.log(np.abs(np.diag(root))).sum())
