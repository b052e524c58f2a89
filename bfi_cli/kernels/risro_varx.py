"""The faulty VARX as a rank-one least squares, on compressed data (thesis eq. 4-24 and algorithm 3).

For one output, with corrected output yf = y - theta z and yf(k) = c + B u lags + K yf lags + e, the measured output is
<A_k, X> beside the base regressors, where X = [z; 1] [K', 1] and A_k = [[-theta lags, theta(k)], [y lags, 0]]: past
signals carry a minus sign. All of it happens on the triangular factor of `lagged.compress`, whose trailing block is A
and y with the base regressors projected out; a step costs the same for any record length.

The corner of A_k is zero, so only the rank condition ties the corner of X to 1. `corner="free"` is the published
algorithm: z and K are X's last column and row as they stand. They are not divided by the corner, which the rest of X
determines poorly or, without a fault, not at all, while the data fix the scale of that column and row.
`corner="imposed"` keeps X = [z; 1] [K', 1], which makes the step the Gauss-Newton step in (z, K).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .lagged import Compressed
from .risro import NO_SKETCH, Factors, least_squares, risro
from .sparsity import SparseStage, apply_sparsity
from .termination import StoppingRule, Termination, iterate

__all__ = ["Corner", "VarxSolution", "risro_varx"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Corner = Literal["free", "imposed"]

PUBLISHED = StoppingRule(max_iterations=50, fixed=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VarxSolution:
    """A VARX and the fault magnitudes that go with it.

    Attributes
    ----------
    z : (n_atoms,) magnitudes, 0 for an atom that is zero in the whole record.
    K : (order,) coefficients of the past corrected outputs, lag 1 first.
    B : (n_lags, n_inputs) coefficients of the inputs, from lag 0 with feedthrough, else from lag 1.
    constant : 0 without one.
    misfit : 2-norm of the prediction error of this model.
    corner : X's corner; 1 where it is imposed.
    iterations, termination : steps made, and why no more were.
    condition_number : of the last sketched regressor, columns scaled to unit norm.
    updates : pseudo-measurement updates really made.
    """

    z: FloatArray
    K: FloatArray
    B: FloatArray
    constant: float
    misfit: float
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
    sparse: SparseStage | None = None,
    as_published: bool = False,
) -> VarxSolution:
    """Fit a VARX of one output together with the magnitudes of the faults in its record.

    Parameters
    ----------
    data : from `lagged.compress`.
    initial : (z, K) to start from; by default z and K as the unconstrained least squares has them in the last column
        and row of X: the rest of X, far less certain, would spoil the rank-one part of the whole.
    corner : see the module.
    settings : when to stop.
    sparse : pseudo-measurement stage after every step but the last, on magnitudes times the signals' rms.
    as_published : 50 steps with a free corner and no stopping, whatever `corner` and `settings` say, and the stage on
        magnitudes as they are.

    Raises
    ------
    ValueError : several outputs, or fewer rows than unknowns.
    """
    _check(data)
    problem = _problem(data)
    corner, settings = ("free", PUBLISHED) if as_published else (corner, settings or StoppingRule())
    start = _start(problem) if initial is None else _pair(initial[0][problem.live], initial[1])
    stage = _Stage(sparse or SparseStage(), None if as_published else problem.scales)
    solve = _free if corner == "free" else _imposed
    found = solve(problem, start, settings=settings, stage=stage)
    return _solution(data, problem, found, updates=stage.made)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """The trailing block of R as covariates: A (n, n_live + 1, order + 1), y (n,)."""

    A: FloatArray
    y: FloatArray
    live: IntArray
    scales: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    pair: Factors
    corner: float
    misfit: float
    iterations: int
    termination: Termination
    condition_number: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """An iterate with corner 1, A applied to its right factor, and the triangular factor of the sketch behind it."""

    pair: Factors
    X: FloatArray
    AV: FloatArray
    residual: FloatArray
    misfit: float
    sketch: FloatArray


class _Stage:
    """The sparsity stage as a map of factors, counting the updates it makes."""

    def __init__(self, stage: SparseStage, scales: FloatArray | None) -> None:
        self.stage, self.scales, self.made = stage, scales, 0

    def __call__(self, factors: Factors) -> Factors:
        z, K = _read(factors)
        z, made = apply_sparsity(z, self.stage, scales=self.scales)
        self.made += made
        return _pair(z, K)

    @property
    def active(self) -> bool:
        """Whether there is anything to do."""
        return self.stage.kind != "none" and self.stage.updates > 0


def _check(data: Compressed) -> None:
    columns = data.columns
    if columns.n_outputs != 1:
        raise ValueError(f"the rank-one form has one output, got {columns.n_outputs}; use the likelihood kernel")
    unknowns = columns.n_base + columns.order + len(columns.signals) + 1
    if data.n_rows < unknowns:
        raise ValueError(f"{data.n_rows} rows are fewer than the {unknowns} unknowns; lower the order")


def _problem(data: Compressed) -> _Problem:
    columns = data.columns
    R, n, s = data.R[columns.n_base :], len(columns.signals), columns.order
    A = np.zeros((len(R), n + 1, s + 1))
    A[:, :n, :s] = -R[:, columns.theta_lags].reshape(len(R), s, n).transpose(0, 2, 1)
    A[:, :n, s] = R[:, columns.theta]
    A[:, n, :s] = R[:, columns.y_lags]
    live = np.array([atom for _, atom in columns.signals], dtype=np.intp)
    scales = data.scales[columns.theta] / np.sqrt(data.n_rows)
    return _Problem(A=A, y=R[:, columns.y.start], live=live, scales=scales)


def _pair(z: FloatArray, K: FloatArray) -> Factors:
    return Factors(left=np.append(z, 1.0)[:, None], right=np.append(K, 1.0)[:, None])


def _read(factors: Factors) -> tuple[FloatArray, FloatArray]:
    """Return z and K, X's last column and row."""
    left, right = factors.left[:, 0], factors.right[:, 0]
    return left[:-1] * right[-1], left[-1] * right[:-1]


def _start(problem: _Problem) -> Factors:
    n, p1, p2 = problem.A.shape
    flat = problem.A.reshape(n, p1 * p2)[:, :-1]
    X = np.append(least_squares(flat, problem.y)[0], 1.0).reshape(p1, p2)
    return _pair(X[:-1, -1], X[-1, :-1])


def _free(problem: _Problem, start: Factors, *, settings: StoppingRule, stage: _Stage) -> _Found:
    found = risro(
        problem.A,
        problem.y,
        rank=1,
        initial=start,
        max_iterations=settings.max_iterations,
        tolerance=settings.tolerance,
        fixed=settings.fixed,
        between=stage if stage.active else None,
    )
    pair = _pair(*_read(found.factors))
    return _Found(
        pair=pair,
        corner=float(found.factors.left[-1, 0] * found.factors.right[-1, 0]),
        misfit=_state(problem, pair, NO_SKETCH).misfit,
        iterations=found.iterations,
        termination=found.termination,
        condition_number=found.condition_number,
    )


def _imposed(problem: _Problem, start: Factors, *, settings: StoppingRule, stage: _Stage) -> _Found:
    ending = iterate(
        lambda state: _step(problem, state),
        _state(problem, start, NO_SKETCH),
        scale=float(np.linalg.norm(problem.y)),
        settings=settings,
        between=(lambda state: _state(problem, stage(state.pair), state.sketch)) if stage.active else None,
    )
    return _Found(
        pair=ending.last.pair,
        corner=1.0,
        misfit=ending.last.misfit,
        iterations=ending.iterations,
        termination=ending.termination,
        condition_number=float(np.linalg.cond(np.triu(ending.last.sketch))),
    )


def _step(problem: _Problem, state: _State) -> _State:
    left, right = state.pair.left[:, 0], state.pair.right[:, 0]
    n = len(left) - 1
    S = np.hstack([state.AV[:, :-1], (left @ problem.A)[:, :-1]])
    x, sketch = least_squares(S, state.residual)
    return _state(problem, _pair(left[:-1] + x[:n], right[:-1] + x[n:]), sketch)


def _state(problem: _Problem, pair: Factors, sketch: FloatArray) -> _State:
    AV = problem.A @ pair.right[:, 0]
    residual = problem.y - AV @ pair.left[:, 0]
    misfit = float(np.linalg.norm(residual))
    return _State(pair=pair, X=pair.X, AV=AV, residual=residual, misfit=misfit, sketch=sketch)


def _solution(data: Compressed, problem: _Problem, found: _Found, *, updates: int) -> VarxSolution:
    columns, n_base = data.columns, data.columns.n_base
    z, K = _read(found.pair)
    whole = np.zeros(columns.n_atoms)
    whole[problem.live] = z
    R = data.R[:n_base]
    corrected = R[:, columns.y.start] - R[:, columns.theta] @ z
    past = R[:, columns.y_lags] - R[:, columns.theta_lags].reshape(n_base, columns.order, len(z)) @ z
    base = least_squares(R[:, :n_base], corrected - past @ K)[0]
    return VarxSolution(
        z=whole,
        K=K,
        B=base[columns.inputs].reshape(len(columns.input_lags), -1),
        constant=float(base[columns.ones].sum()),
        misfit=found.misfit,
        corner=found.corner,
        iterations=found.iterations,
        termination=found.termination,
        condition_number=found.condition_number,
        updates=updates,
    )
