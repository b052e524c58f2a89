"""RISRO on the whole dictionary with the sparsity stage; and as it stands in T, with T's rule of what is a fault.

T is N. S. Ramesh, Blind Fault Identification of Air Data Sensors, thesis, TU Delft 2023. The method `risro` imposes the
corner of the rank-one matrix, which T leaves free; the stage proposes supports, and the criterion chooses among them
and among the orders. `risro-as-published` follows T to the letter (section 5-1): a fault is a magnitude above a share
of the largest. That rule also decides where a threshold is asked for or the stage is off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..errors import ConfigError, LogError
from ..kernels import FloatArray
from ..kernels.model_selection import Penalty, refine_supports
from ..kernels.progress import Progress, Termination, parts, unseen
from ..kernels.risro_varx import PUBLISHED, SparseStage, VarxSolution, penalty_constants
from ..kernels.variable_projection import fit_magnitudes
from ..notes import Note
from .maximum_likelihood import best_of, none_of, select
from .preprocessing.magnitudes import magnitudes_of_fit
from .preprocessing.regression import RegressionData, as_published, decides_by_rule, solve, stage_of, stopping_of
from .preprocessing.window import PreparedWindow
from .result import SolverSummary, SparsityRun, SparsitySummary
from .selection import MethodResult, Visits, proposals_of, result_of_selection, stage_runs

# T section 5-1: a fault is a magnitude whose share of the norm is larger.
THRESHOLD = 1e-3
# Scaled magnitudes below this are round-off: of a record without a fault the largest has a share of 1 too.
ZERO = 1e-7
# A free corner this far from 1 scales the magnitudes by more than their own error.
CORNER_ERROR = 0.01
STARTS = ("risro", "no fault")


def identify_by_risro(
    window: PreparedWindow, regression: RegressionData, config: Config, progress: Progress = unseen
) -> MethodResult:
    """Solve every order by RISRO, then choose order and support by the stage and the criterion, or by T's rule.

    Raises
    ------
    ConfigError : several outputs, to the letter of the thesis.
    LogError : the window has too few rows to estimate all magnitudes at once.
    """
    if as_published(config) and len(config.outputs) > 1:
        raise ConfigError(
            f"risro.as_published: the published algorithm works on one output, got {len(config.outputs)}; give one "
            "--output, or leave the key out"
        )
    n_atoms = len(regression.atoms)
    regression = replace(regression, orders=tuple(s for s in regression.orders if _has_rows(regression, s)))
    if not regression.orders:
        raise LogError(
            f"{regression.signals.path}: too few samples to estimate all {n_atoms} magnitudes at once; choose a longer "
            "window, a smaller dictionary or a lower --order"
        )
    penalty = regression.penalty(config.selection, n_atoms)
    if decides_by_rule(config):
        return _by_rule(window, regression, config, penalty, progress)
    return _by_stage(window, regression, config, penalty, progress)


def _by_stage(
    window: PreparedWindow, regression: RegressionData, config: Config, penalty: Penalty, progress: Progress
) -> MethodResult:
    """Score the supports that the stage visits at every order by the criterion, and drop atoms while it falls."""
    names, stage = [window.names[j] for j in window.live], stage_of(config)
    solutions, visited = stage_runs(
        regression,
        penalty,
        orders=regression.orders,
        stage=stage,
        settings=stopping_of(config),
        report=partial(progress, "every order"),
    )
    searches, _ = refine_supports(
        [regression.problem(order) for order in regression.orders],
        range(len(names)),
        penalty,
        proposals=proposals_of(visited),
        max_active=config.selection.max_active,
        dropping_only=True,
    )
    selection = best_of(window, regression, searches, penalty)
    fit = selection.best
    whole = solutions[fit.order]
    before = np.flatnonzero(declared(whole, whole.z * regression.magnitude_unit, config))
    left_out = tuple(names[j] for j in before if j not in fit.atoms)
    notes = []
    if left_out:
        steps = " and ".join(str(went.iterations) for went in visited[fit.order])
        notes.append(
            Note.method(
                f"the sparsity stage ({stage.kind}, {steps} steps from its two starts) sets {len(left_out)} of "
                f"{before.size} magnitudes to zero that the published rule would declare"
            )
        )
    return result_of_selection(
        selection,
        magnitudes_of_fit(regression, selection.best, penalty),
        SolverSummary(
            method=config.method,
            termination=fit.termination.value,
            iterations=whole.iterations,
            condition_number=whole.condition_number,
            sparsity=_summary_of(stage, penalty, visited, names, left_out),
        ),
        notes=tuple(notes),
    )


def _summary_of(
    stage: SparseStage, penalty: Penalty, visited: Mapping[int, Visits], names: Sequence[str], left_out: tuple[str, ...]
) -> SparsitySummary:
    """Return what the stage did at every order, and which entries it set to zero."""
    alpha, r, _ = penalty_constants(stage, penalty.per_fault)
    return SparsitySummary(
        kind=stage.kind,
        alpha=alpha if stage.kind == "exp-l0" else None,
        r=r,
        updates=None,
        runs=tuple(
            SparsityRun(
                order=order,
                start=start,
                iterations=went.iterations,
                converged=went.converged,
                supports=tuple(tuple(names[j] for j in support) for support in went.supports),
            )
            for order, visits in visited.items()
            for start, went in zip(STARTS, visits, strict=False)
        ),
        set_to_zero=left_out,
    )


def _by_rule(
    window: PreparedWindow, regression: RegressionData, config: Config, penalty: Penalty, progress: Progress
) -> MethodResult:
    """Keep the order with the best criterion and declare by T's rule; variances are the likelihood's at its result."""
    n_atoms, n_rows, stage = len(regression.atoms), regression.n_rows, stage_of(config)
    solutions, criteria = {}, {}
    for order, _ in parts(partial(progress, "every order"), regression.orders):
        solutions[order] = solution = solve(regression.at_order(order), config)
        covariance = solution.squares / n_rows + regression.floor**2 * np.eye(len(solution.squares))
        n_parameters = regression.problem(order).n_predictor + n_atoms
        criteria[order] = n_rows * float(np.linalg.slogdet(covariance)[1]) + n_parameters * penalty.per_parameter
    order = min(criteria, key=lambda key: criteria[key])
    solution, problem = solutions[order], regression.problem(order)
    z = solution.z * regression.magnitude_unit
    active = [int(j) for j in np.flatnonzero(declared(solution, z, config))]
    whole = fit_magnitudes(problem, range(n_atoms), solution.z, max_iterations=1)
    estimates = magnitudes_of_fit(regression, whole, penalty)
    fit = fit_magnitudes(problem, active, solution.z[active])
    unfolded = regression.unfold(fit)
    plain = select(window, regression, none_of(config.selection))
    notes = [
        Note.limit(
            "the published rule declares every magnitude above a share of the largest; it has no false-alarm rate"
        )
    ]
    published = as_published(config)
    if published and abs(solution.corner - 1.0) > CORNER_ERROR:
        notes.append(
            Note.limit(
                f"the published algorithm leaves the corner of its matrix free; it ended at {solution.corner:.3g} "
                "instead of 1, so its magnitudes are not those of a faulty sensor"
            )
        )
    sparsity = None
    if published and stage.kind != "none":
        alpha, r, _ = (PUBLISHED[name] if (value := getattr(stage, name)) is None else value for name in PUBLISHED)
        notes.append(Note.method(f"the published sparsity stage changed the magnitudes {solution.updates} times"))
        sparsity = SparsitySummary(
            kind=stage.kind,
            alpha=alpha if stage.kind == "exp-l0" else None,
            r=r,
            updates=solution.updates,
            runs=(),
            set_to_zero=(),
        )
    return MethodResult(
        atoms=tuple(active),
        magnitudes=replace(estimates, value=z, covariance=estimates.covariance[np.ix_(active, active)]),
        error=unfolded.error * regression.unit,
        plain_error=plain.unfolded.error * regression.unit,
        order=order,
        feedthrough=regression.layout.feedthrough,
        condition_number=unfolded.condition_number,
        solver=SolverSummary(
            method=config.method,
            termination=solution.termination.value,
            iterations=solution.iterations,
            condition_number=solution.condition_number,
            sparsity=sparsity,
        ),
        converged=solution.termination in (Termination.CONVERGED, Termination.FIXED),
        notes=tuple(notes),
    )


def declared(solution: VarxSolution, z: FloatArray, config: Config) -> NDArray[np.bool_]:
    """Return (n_atoms,) whether the rule declares each fault: its share of the norm above the threshold, and not zero.

    Parameters
    ----------
    solution : magnitudes in scaled units, against which round-off is told.
    z : (n_atoms,) the same in SI.
    """
    threshold = THRESHOLD if config.selection.threshold is None else config.selection.threshold
    return (np.abs(z) > threshold * np.linalg.norm(z)) & (np.abs(solution.z) > ZERO)


def _has_rows(regression: RegressionData, order: int) -> bool:
    """Say whether the rows outnumber the unknowns of all magnitudes and the predictor of an order."""
    columns = replace(regression.data.columns, order=order)
    return regression.n_rows > columns.n_base + order * columns.n_outputs + len(columns.signals)
