"""The support and the order that an identification chose, with everything else that was visited.

The sparsity stage proposes supports: for method risro to choose from, for ml to begin with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..kernels.covariance import FitRows
from ..kernels.model_selection import OrderSearch, Penalty, Proposal, ScoredFit
from ..kernels.progress import Report, parts, silent
from ..kernels.risro_varx import VarxSolution, risro_varx, sparse_varx
from ..kernels.sparsity import SparseSolution, SparseStage
from ..kernels.termination import StoppingRule
from ..kernels.variable_projection import fit_magnitudes
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow


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
