"""RISRO on the whole dictionary, a fault being a magnitude above a share of the largest (T section 5-1).

T is N. S. Ramesh, Blind Fault Identification of Air Data Sensors, thesis, TU Delft 2023. The method `risro` imposes the
corner of the rank-one matrix, which T leaves free; `risro-as-published` follows T to the letter.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..kernels.covariance import unfold
from ..kernels.lagged import Compressed, restrict
from ..kernels.model_selection import Penalty, ScoredFit
from ..kernels.progress import Progress, parts, unseen
from ..kernels.risro_varx import VarxSolution, risro_varx
from ..kernels.sparsity import SparseStage
from ..kernels.termination import StoppingRule
from ..kernels.variable_projection import fit_magnitudes
from ..preprocessing.regression import RegressionData
from ..preprocessing.window import PreparedWindow
from .magnitudes import MethodResult, magnitudes_of_fit
from .maximum_likelihood import select
from .result import SolverSummary

__all__ = ["THRESHOLD", "declared", "identify_by_risro", "solve"]

FloatArray = NDArray[np.float64]

# T section 5-1: a fault is a magnitude whose share of the norm is larger.
THRESHOLD = 1e-3
# Scaled magnitudes below this are round-off: of a record without a fault the largest has a share of 1 too.
ZERO = 1e-7
# A free corner this far from 1 scales the magnitudes by more than their own error.
CORNER_ERROR = 0.01


def identify_by_risro(
    _window: PreparedWindow, regression: RegressionData, config: Config, progress: Progress = unseen
) -> MethodResult:
    """Run RISRO at every order and keep that with the best criterion; variances are the likelihood's at its result."""
    n_atoms, n_rows = len(regression.atoms), regression.n_rows
    penalty = Penalty(
        n_rows=n_rows, n_effective=float(n_rows), n_candidates=n_atoms, evidence=config.selection.evidence
    )
    solutions, criteria = {}, {}
    for order, _ in parts(partial(progress, "every order"), regression.orders):
        solutions[order] = solution = solve(restrict(regression.data, order=order), config)
        variance = solution.misfit**2 / n_rows + regression.floor**2
        n_parameters = regression.problem(order).n_predictor + n_atoms
        criteria[order] = n_rows * float(np.log(variance)) + n_parameters * penalty.per_parameter
    order = min(criteria, key=lambda key: criteria[key])
    solution, problem = solutions[order], regression.problem(order)
    z = solution.z * regression.magnitude_unit
    active = [int(j) for j in np.flatnonzero(declared(solution, z, config))]
    whole = fit_magnitudes(problem, range(n_atoms), solution.z, max_iterations=1)
    estimates = magnitudes_of_fit(regression, ScoredFit(criterion=criteria[order], fit=whole), penalty)
    fit = fit_magnitudes(problem, active, solution.z[active])
    unfolded = unfold(regression.layout, fit)
    plain = select(regression, evidence=0.0, extended=True, max_active=0)
    notes = ["the published rule declares every magnitude above a share of the largest; it has no false-alarm rate"]
    if _as_published(config) and abs(solution.corner - 1.0) > CORNER_ERROR:
        notes.append(
            f"the published algorithm leaves the corner of its matrix free; it ended at {solution.corner:.3g} "
            "instead of 1, so its magnitudes are not those of a faulty sensor"
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
        ),
        notes=tuple(notes),
    )


def solve(data: Compressed, config: Config) -> VarxSolution:
    """Solve the regression of one order as the configuration says."""
    rules = config.risro
    stage = None
    if rules.sparsity != "none":
        stage = SparseStage(kind=rules.sparsity, alpha=rules.alpha, r=rules.r, p0=rules.p0, updates=rules.updates)
    settings = StoppingRule(max_iterations=rules.max_iterations, tolerance=rules.tolerance)
    return risro_varx(data, settings=settings, sparse=stage, as_published=_as_published(config))


def _as_published(config: Config) -> bool:
    return config.risro.as_published or config.method == "risro-as-published"


def declared(solution: VarxSolution, z: FloatArray, config: Config) -> NDArray[np.bool_]:
    """Return (n_atoms,) whether the rule declares each fault: its share of the norm above the threshold, and not zero.

    Parameters
    ----------
    solution : magnitudes in scaled units, against which round-off is told.
    z : (n_atoms,) the same in SI.
    """
    threshold = THRESHOLD if config.selection.threshold is None else config.selection.threshold
    return (np.abs(z) > threshold * np.linalg.norm(z)) & (np.abs(solution.z) > ZERO)
