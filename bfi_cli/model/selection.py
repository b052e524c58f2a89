"""The support and the order that a method of identification chose, all else that was visited, and what it returns.

The sparsity stage proposes supports: for method risro to choose from, for ml to begin with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..kernels import FloatArray
from ..kernels.covariance import FitRows
from ..kernels.model_selection import OrderSearch, Penalty, Proposal, ScoredFit, least_criterion
from ..kernels.progress import Report, parts, silent
from ..kernels.risro_varx import VarxSolution, risro_varx, sparse_varx
from ..kernels.sparsity import SparseSolution, SparseStage
from ..kernels.termination import StoppingRule, Termination
from ..kernels.variable_projection import fit_magnitudes
from ..notes import Note
from .preprocessing.magnitudes import MagnitudeEstimates
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow
from .result import SolverSummary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selection:
    """The selected support: its fit at every order, and everything else that was visited.

    Attributes
    ----------
    best : the fit at the best order.
    fits : of the same support at each order, with their criteria.
    searches : what was visited, by order.
    penalty : the criterion.
    unfolded : `best` over the rows, with the signatures of its support.
    """

    best: ScoredFit
    fits: tuple[ScoredFit, ...]
    searches: tuple[OrderSearch, ...]
    penalty: Penalty
    unfolded: FitRows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selected:
    """A window whose entries begin where they were found, its regression and the selection on it.

    Attributes
    ----------
    shifts_s : by live entry of the selection, how much later it begins than the dictionary states.
    prices : by live entry, what the choice of its onset costs, on the scale of the criterion.
    """

    window: PreparedWindow
    regression: RegressionData
    selection: Selection
    shifts_s: Mapping[int, float] = field(default_factory=dict)
    prices: Mapping[int, float] = field(default_factory=dict)


# The derived stage, which ml begins with. Its starts need no more digits than a tenth of a standard deviation.
DERIVED = SparseStage(kind="exp-l0")
COARSE = StoppingRule(max_iterations=25, tolerance=1e-4)
# Larger supports are way-marks of the stage's first steps: a fit of each would cost more than the stage.
LARGEST = 24


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageRun:
    """The stage at one order: RISRO's solution that it started from, if it did, and where it went from each start."""

    order: int
    whole: VarxSolution | None
    visits: tuple[SparseSolution, ...]


def stage_runs(
    regression: RegressionData,
    penalty: Penalty,
    *,
    orders: Sequence[int],
    stage: SparseStage = DERIVED,
    settings: StoppingRule = COARSE,
    report: Report = silent,
) -> tuple[StageRun, ...]:
    """Solve every order by RISRO and follow the stage from its starts."""
    runs = []
    for order, _ in parts(report, orders):
        whole, problem = risro_varx(regression.at_order(order), settings=settings), regression.problem(order)
        visits = sparse_varx(problem, whole, n_atoms=penalty.n_candidates, stage=stage, price=penalty.per_fault)
        runs.append(StageRun(order=order, whole=whole, visits=visits))
    return tuple(runs)


def propose_supports(regression: RegressionData, penalty: Penalty, report: Report = silent) -> tuple[Proposal, ...]:
    """Return the supports that the derived stage visits, for a search to begin with.

    At orders at which the rows do not determine RISRO's unconstrained start, one of them stands for all: that with the
    best criterion without a fault, and the stage begins there with the predictor of no fault alone.
    """
    n_atoms, n_base = penalty.n_candidates, regression.data.columns.n_base
    determined = [s for s in regression.orders if regression.n_rows >= n_base + (n_atoms + 1) * (s + 1) - 1]
    runs = list(stage_runs(regression, penalty, orders=determined, report=report))
    short = [regression.problem(order) for order in regression.orders if order not in determined]
    if short:
        problem = min(short, key=lambda problem: penalty.criterion(fit_magnitudes(problem, ())))
        visits = sparse_varx(problem, None, n_atoms=n_atoms, stage=DERIVED, price=penalty.per_fault)
        runs.append(StageRun(order=problem.order, whole=None, visits=visits))
    return proposals_of(runs)


def proposals_of(runs: Sequence[StageRun]) -> tuple[Proposal, ...]:
    """Return every support that was visited and is not too large, and the last of each start in any case."""
    return tuple(
        Proposal(order=run.order, atoms=support, z=went.z[list(support)])
        for run in runs
        for went in run.visits
        for support in went.supports
        if len(support) <= LARGEST or support == went.supports[-1]
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeOutcome:
    """What is said of an entry of unknown course.

    Attributes
    ----------
    entry : of the dictionary; output : the index of the output it acts on.
    declared : it is in the log, and its course can be told; suspected : it is, and its course cannot.
    value, sd : (n_samples,) of the course at the samples of the window, SI; of one that is not declared as well.
    note : why it is not declared.
    """

    entry: int
    output: int
    declared: bool
    suspected: bool
    value: FloatArray
    sd: FloatArray
    note: str | None = None

    @property
    def peak(self) -> int:
        """The sample at which it is largest."""
        return int(np.argmax(np.abs(self.value)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MethodResult:
    """The result of a method of identification, whatever its model is.

    Attributes
    ----------
    atoms : the declared ones, ascending indices into the live entries of the window.
    magnitudes : of all live entries.
    error : (n_rows, n_outputs) prediction error with the declared faults, SI, of the last rows of the window;
        plain_error : of the model without faults.
    order, feedthrough : of the model; condition_number : of its regressors, NaN where it has none.
    orders, criterion_no_fault, criterion_best : the order selection curve, empty for one order.
    converged : the solver of the answer did; else there is no interval and no verdict.
    fires : the method says that there is a fault, whatever is declared.
    declined : of live entries that were favoured and then declined, why.
    remarks : of live entries, what is said of one that nothing declares in the end.
    needed : (n_live,) statistic, n_rows log of the ratio of determinants, from which on an entry is declared; None
        where the method has no such rule.
    criterion : of the answer, twice the negative log-likelihood and its price, by which recorders are compared;
        dispersion : the largest ratio of a declared entry's statistic at other onsets to that of white errors.
    free : what is said of the entries of unknown course, in the order of `PreparedWindow.free`.
    analysed : window and regression with the entries that begin otherwise than the dictionary states moved to where
        they were found; None where there are none.
    """

    atoms: tuple[int, ...]
    magnitudes: MagnitudeEstimates
    error: FloatArray
    plain_error: FloatArray
    order: int
    feedthrough: bool
    condition_number: float
    solver: SolverSummary
    orders: tuple[int, ...] = ()
    criterion_no_fault: tuple[float, ...] = ()
    criterion_best: tuple[float, ...] = ()
    converged: bool = True
    fires: bool = False
    declined: Mapping[int, str] = field(default_factory=dict)
    remarks: Mapping[int, Note] = field(default_factory=dict)
    needed: FloatArray | None = None
    analysed: tuple[PreparedWindow, RegressionData] | None = None
    criterion: float = np.nan
    dispersion: float = 1.0
    notes: tuple[Note, ...] = ()
    free: tuple[FreeOutcome, ...] = ()


def result_of_selection(
    regression: RegressionData, selection: Selection, magnitudes: MagnitudeEstimates, solver: SolverSummary, **more: Any
) -> MethodResult:
    """Return the result of a method that selects a support at every order and fits it.

    Parameters
    ----------
    more : further attributes of the result.
    """
    fit, searches = selection.best.fit, selection.searches
    plain = [search.of(()) for search in searches]
    lowest = least_criterion(scored for scored in plain if scored is not None)
    several = len(searches) > 1
    return MethodResult(
        atoms=fit.atoms,
        magnitudes=magnitudes,
        error=regression.unfold(fit).error * regression.unit,
        plain_error=regression.unfold(lowest.fit).error * regression.unit,
        order=fit.order,
        feedthrough=regression.layout.feedthrough,
        condition_number=selection.unfolded.condition_number,
        solver=solver,
        orders=regression.orders if several else (),
        criterion_no_fault=tuple(np.nan if scored is None else scored.criterion for scored in plain) if several else (),
        criterion_best=tuple(search.best.criterion for search in searches) if several else (),
        **{"converged": fit.termination is Termination.CONVERGED, **more},
    )
