"""The faulty VARX as a rank-one least squares, on compressed data (thesis eq. 4-24 and algorithm 3).

For one output, with corrected output yf = y - theta z and yf(k) = c + B u lags + K yf lags + e, the measured output is
<A_k, X> beside the base regressors, where X = [z; 1] [K', 1] and A_k = [[-theta lags, theta(k)], [y lags, 0]]: past
signals carry a minus sign. All of it happens on the triangular factor of `lagged.compress`, whose trailing block is A
and y with the base regressors projected out; a step costs the same for any record length.

The corner of A_k is zero, so only the rank condition ties the corner of X to 1. `corner="free"` is the published
algorithm: z and K are X's last column and row as they stand. They are not divided by the corner, which the rest of X
determines poorly or, without a fault, not at all, while the data fix the scale of that column and row.
`corner="imposed"` keeps X = [z; 1] [K', 1], which makes the step the Gauss-Newton step in (z, K).

With several outputs every block of X that belongs to an atom is z_j times the block [K_1 .. K_s, 1] of the outputs
(rank n_outputs overall), which only the imposed form keeps: its step is again the Gauss-Newton step in (z, K). What it
minimises is the prediction error whitened by that of the predictor without a fault, so that neither the units of the
outputs nor their order matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from . import FloatArray
from .lagged import Compressed
from .risro import NO_SKETCH, Factors, WhitenedOutputs, least_squares, risro, whitened_outputs
from .sparsity import SparseSolution, SparseStage, published_updates, sparse_supports
from .termination import Iterate, StoppingRule, Termination, iterate
from .variable_projection import ProjectedRegression, project_inputs

Corner = Literal["free", "imposed"]

# The thesis makes 50 steps and does not test for convergence.
PUBLISHED = StoppingRule(max_iterations=50, fixed=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VarxSolution:
    """A VARX and the fault magnitudes that go with it.

    Attributes
    ----------
    z : (n_atoms,) magnitudes, 0 for an atom that is zero in the whole record.
    K : (order,) coefficients of the past corrected outputs, lag 1 first; of several outputs (order, n_outputs,
        n_outputs), where K[i - 1] multiplies yf(k - i).
    misfit : 2-norm of the prediction error of this model; of several outputs whitened, so that the predictor without a
        fault has the root of their number.
    squares : (n_outputs, n_outputs) sums of squares and products of the prediction error, not whitened.
    corner : X's corner; 1 where it is imposed.
    iterations, termination : steps made, and why no more were.
    condition_number : of the last sketched regressor, columns scaled to unit norm.
    updates : pseudo-measurement updates really made.
    """

    z: FloatArray
    K: FloatArray
    misfit: float
    squares: FloatArray
    corner: float
    iterations: int
    termination: Termination
    condition_number: float
    updates: int


def risro_varx(
    data: Compressed,
    *,
    initial: tuple[FloatArray, FloatArray] | None = None,
    corner: Corner = "imposed",
    settings: StoppingRule | None = None,
    as_published: bool = False,
    sparse: SparseStage | None = None,
) -> VarxSolution:
    """Fit a VARX together with the magnitudes of the faults in its record.

    Parameters
    ----------
    data : from `lagged.compress`.
    initial : (z, K) to start from; by default z and K as the unconstrained least squares has them in the last column
        and row of X: the rest of X, far less certain, would spoil the rank-one part of the whole.
    corner : see the module.
    settings : when to stop.
    as_published : 50 steps with a free corner and no stopping, whatever `corner` and `settings` say.
    sparse : the published pseudo-measurement stage, after every step but the last; only `as_published` has it.

    Raises
    ------
    ValueError : a free corner with several outputs, or fewer rows than unknowns.
    """
    columns, rule = data.columns, settings or StoppingRule()
    _check_size(data, one_output=as_published or corner == "free")
    if columns.n_outputs != 1:
        return _several_outputs(project_inputs(data, columns.order), columns.n_atoms, initial, rule)
    corner, rule = ("free", PUBLISHED) if as_published else (corner, rule)

    A, y = _covariates(data)
    live = np.array([atom for _, atom in columns.signals], dtype=np.intp)
    start = _start(A, y) if initial is None else _pair(initial[0][live], initial[1])

    stage, updates = sparse if as_published and sparse else SparseStage(), 0

    def sparsify(factors: Factors) -> Factors:
        nonlocal updates
        z, K = _read(factors)
        z, made = published_updates(z, stage)
        updates += made
        return _pair(z, K)

    if corner == "free":
        free = risro(
            A,
            y,
            rank=1,
            initial=start,
            max_iterations=rule.max_iterations,
            tolerance=rule.tolerance,
            fixed=rule.fixed,
            between=sparsify if stage.kind != "none" and stage.updates > 0 else None,
        )
        z, K = _read(free.factors)
        misfit, corner_value = _state(A, y, _pair(z, K), NO_SKETCH).misfit, float(free.factors.X[-1, -1])
        iterations, termination, condition_number = free.iterations, free.termination, free.condition_number
    else:
        last, iterations, termination = iterate(
            lambda state: _gauss_newton(A, y, state),
            _state(A, y, start, NO_SKETCH),
            scale=float(np.linalg.norm(y)),
            settings=rule,
        )
        z, K = _read(last.pair)
        misfit, corner_value = last.misfit, 1.0
        condition_number = float(np.linalg.cond(np.triu(last.sketch)))

    whole = np.zeros(columns.n_atoms)
    whole[live] = z
    return VarxSolution(
        z=whole,
        K=K,
        misfit=misfit,
        squares=np.array([[misfit**2]]),
        corner=corner_value,
        iterations=iterations,
        termination=termination,
        condition_number=condition_number,
        updates=updates,
    )


def _check_size(data: Compressed, *, one_output: bool) -> None:
    columns = data.columns
    if columns.n_outputs != 1 and one_output:
        raise ValueError(f"the published form has one output, got {columns.n_outputs}; impose the corner")
    unknowns = columns.n_base + columns.order * columns.n_outputs + len(columns.signals) + 1
    if data.n_rows < unknowns:
        raise ValueError(f"{data.n_rows} rows are fewer than the {unknowns} unknowns; lower the order")


def _covariates(data: Compressed) -> tuple[FloatArray, FloatArray]:
    """Return the covariates A (n, n_live + 1, s + 1) and y (n,): the trailing block of R."""
    columns, s = data.columns, data.columns.order
    R, n = data.R[columns.n_base :], len(columns.signals)
    A = np.zeros((len(R), n + 1, s + 1))
    A[:, :n, :s] = -R[:, columns.theta_lags].reshape(len(R), s, n).transpose(0, 2, 1)
    A[:, :n, s] = R[:, columns.theta]
    A[:, n, :s] = R[:, columns.y_lags]
    return A, R[:, columns.y.start]


def _several_outputs(
    problem: ProjectedRegression,
    n_atoms: int,
    initial: tuple[FloatArray, FloatArray] | None,
    settings: StoppingRule,
) -> VarxSolution:
    """Return the minimum over (z, K) of the whitened prediction error; see `risro_varx`."""
    y, now, n_y = problem.y.reshape(len(problem.y), -1), problem.y[:, 0], problem.n_outputs
    past, n_past = y[:, n_y:], y.shape[1] - n_y
    z, K = np.zeros(n_atoms), _predictors(past, now).reshape(-1, n_y, n_y).transpose(0, 2, 1)
    outputs = whitened_outputs(problem, z, K)
    atoms = outputs.atoms
    if initial is not None:
        z, K = initial
    elif len(y) >= n_past + problem.theta[0].size:
        # As of one output: z and K where the unconstrained least squares has them by themselves.
        free = _predictors(np.hstack([past, problem.theta.reshape(len(y), -1)]), now)
        K = free[:n_past].reshape(-1, n_y, n_y).transpose(0, 2, 1)
        shares = np.zeros(n_atoms)
        for column, (output, atom) in enumerate(problem.signals, start=n_past):
            z[atom] += free[column, output]
            shares[atom] += 1.0
        z /= np.maximum(shares, 1.0)
    last, iterations, termination = iterate(
        lambda state: _joint_step(outputs, state),
        _joint_state(outputs, z[atoms], outputs.coefficients(K), NO_SKETCH),
        scale=float(np.linalg.norm(outputs.y[0])),
        settings=settings,
    )
    whole = np.zeros(n_atoms)
    whole[atoms] = last.z
    K = outputs.predictor(last.H)
    error = last.error.T @ np.linalg.inv(outputs.whiten)
    return VarxSolution(
        z=whole,
        K=K,
        misfit=last.misfit,
        squares=error.T @ error,
        corner=1.0,
        iterations=iterations,
        termination=termination,
        condition_number=float(np.linalg.cond(np.triu(last.sketch))),
        updates=0,
    )


def _predictors(regressors: FloatArray, outputs: FloatArray) -> FloatArray:
    """Return the least squares of every output, (n_regressors, n_outputs)."""
    return np.column_stack([least_squares(regressors, output)[0] for output in outputs.T])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _JointState(Iterate):
    """An iterate of several outputs: ``error = corrected[0] - H.T @ past`` with the corrected outputs at every lag."""

    z: FloatArray
    H: FloatArray
    X: FloatArray
    past: FloatArray
    error: FloatArray
    misfit: float
    sketch: FloatArray


def _joint_state(outputs: WhitenedOutputs, z: FloatArray, H: FloatArray, sketch: FloatArray) -> _JointState:
    corrected = outputs.y - z @ outputs.theta
    past = corrected[1:].reshape(len(H), -1)
    error = corrected[0] - H.T @ past
    X = np.outer(np.append(z, 1.0), np.append(H, 1.0))
    return _JointState(z=z, H=H, X=X, past=past, error=error, misfit=float(np.linalg.norm(error)), sketch=sketch)


def _joint_step(outputs: WhitenedOutputs, state: _JointState) -> _JointState:
    """Return the iterate after a step in (z, K)."""
    theta, H, n_y = outputs.theta, state.H, len(outputs.whiten)
    signatures = theta[0] - np.tensordot(H.T, theta[1:].reshape(len(H), *theta.shape[2:]), axes=1)
    S = np.hstack([np.kron(np.eye(n_y), state.past.T), signatures.transpose(0, 2, 1).reshape(-1, len(state.z))])
    x, sketch = least_squares(S, state.error.ravel())
    return _joint_state(outputs, state.z + x[H.size :], H + x[: H.size].reshape(n_y, -1).T, sketch)


def sparse_varx(
    problem: ProjectedRegression, whole: VarxSolution | None, *, n_atoms: int, stage: SparseStage, price: float
) -> tuple[SparseSolution, ...]:
    """Follow the sparsity stage from its two starts: converged RISRO, and no fault with the predictor of that.

    Alone either misses a third of the true supports: RISRO fits all atoms at once, and the predictor without a fault
    has absorbed a part of the faults. None where the atoms are too many for the rows.

    Parameters
    ----------
    problem, n_atoms : of the dictionary.
    whole : RISRO's solution; None leaves its start out, and guards the first step of the other.
    stage, price : see `sparse_supports`.
    """
    n_y, past = problem.n_outputs, problem.y[:, 1:].reshape(len(problem.y), -1)
    if len(past) <= past.shape[1] + len(problem.signals):
        return ()
    K = _predictors(past, problem.y[:, 0])
    plain = np.zeros(n_atoms), K[:, 0] if n_y == 1 else K.reshape(-1, n_y, n_y).transpose(0, 2, 1)
    if whole is None:
        return (sparse_supports(problem, *plain, stage=stage, price=price, guarded=True),)
    starts = (whole.z, whole.K), plain
    return tuple(sparse_supports(problem, z, K, stage=stage, price=price) for z, K in starts)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """An iterate with corner 1, A applied to its right factor, and the triangular factor of the sketch behind it."""

    pair: Factors
    X: FloatArray
    AV: FloatArray
    residual: FloatArray
    misfit: float
    sketch: FloatArray


def _state(A: FloatArray, y: FloatArray, pair: Factors, sketch: FloatArray) -> _State:
    AV = A @ pair.right[:, 0]
    residual = y - AV @ pair.left[:, 0]
    misfit = float(np.linalg.norm(residual))
    return _State(pair=pair, X=pair.X, AV=AV, residual=residual, misfit=misfit, sketch=sketch)


def _gauss_newton(A: FloatArray, y: FloatArray, state: _State) -> _State:
    """Return the iterate after a step in (z, K), the corner of X held at 1."""
    left, right = state.pair.left[:, 0], state.pair.right[:, 0]
    S = np.hstack([state.AV[:, :-1], (left @ A)[:, :-1]])
    x, sketch = least_squares(S, state.residual)
    n = len(left) - 1
    return _state(A, y, _pair(left[:-1] + x[:n], right[:-1] + x[n:]), sketch)


def _start(A: FloatArray, y: FloatArray) -> Factors:
    """Return z and K of the unconstrained least squares, X's corner being 1; no fault where the rows are too few."""
    if len(A) < A[0].size - 1:
        return _pair(np.zeros(A.shape[1] - 1), least_squares(A[:, -1, :-1], y)[0])
    X = np.append(least_squares(A.reshape(len(A), -1)[:, :-1], y)[0], 1.0).reshape(A.shape[1:])
    return _pair(X[:-1, -1], X[-1, :-1])


def _pair(z: FloatArray, K: FloatArray) -> Factors:
    return Factors(left=np.append(z, 1.0)[:, None], right=np.append(K, 1.0)[:, None])


def _read(factors: Factors) -> tuple[FloatArray, FloatArray]:
    """Return z and K, X's last column and row."""
    left, right = factors.left[:, 0], factors.right[:, 0]
    return left[:-1] * right[-1], left[-1] * right[:-1]
