"""The published method: RISRO on the whole dictionary, a fault being a magnitude above a share of the largest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..errors import ConfigError
from ..kernels.bilinear import fit_magnitudes
from ..kernels.lagged import Compressed, restrict
from ..kernels.progress import Report, parts
from ..kernels.risro_varx import VarxSolution, risro_varx
from ..kernels.selection import Penalty, Scored
from ..kernels.sparsity import SparseStage
from ..kernels.termination import Settings
from ..result import SolverSummary
from ..study import Study
from .estimation import Magnitudes, choose, magnitudes_of
from .found import Found

__all__ = ["by_published", "declared", "solve"]

FloatArray = NDArray[np.float64]

THRESHOLD = 1e-3
ZERO = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Published:
    """What RISRO found.

    Attributes
    ----------
    solution : of the best order.
    z : (n_live,) magnitudes in SI.
    active : live atoms with |z| / norm(z) above the threshold (section 5-1 of the thesis).
    whole : the likelihood's fit on all atoms at RISRO's solution, for variances.
    scored : fit on the active atoms at the same order.
    """

    solution: VarxSolution
    z: FloatArray
    active: tuple[int, ...]
    whole: Scored
    scored: Scored
    penalty: Penalty


def _run(study: Study, config: Config, report: Report) -> _Published:
    """Run RISRO at every order, keep the order with the best criterion.

    Raises
    ------
    ConfigError : several outputs; the published form has one.
    """
    if study.layout.y.shape[1] > 1:
        raise ConfigError(
            f"--method risro: works on one output, got {study.layout.y.shape[1]}; give one --output, or --method ml"
        )
    runs = {order: solve(restrict(study.data, order=order), config) for order, _ in parts(report, study.orders)}
    n_live = len(study.live)
    penalty = Penalty(
        n_rows=study.n_rows, n_effective=float(study.n_rows), n_candidates=n_live, evidence=config.selection.evidence
    )
    costs = {order: _criterion(study, order, runs[order], penalty) for order in study.orders}
    order = min(costs, key=lambda key: costs[key])
    solution = runs[order]
    z = solution.z * study.magnitude_unit
    active = tuple(int(j) for j in np.flatnonzero(declared(solution, z, config)))
    whole = fit_magnitudes(study.problem(order), range(n_live), solution.z, max_iterations=1)
    fit = fit_magnitudes(study.problem(order), active, solution.z[list(active)])
    return _Published(
        solution=solution,
        z=z,
        active=active,
        whole=Scored(criterion=costs[order], fit=whole),
        scored=Scored(criterion=penalty.criterion(fit), fit=fit),
        penalty=penalty,
    )


def solve(data: Compressed, config: Config) -> VarxSolution:
    """Run RISRO on compressed data as the configuration says."""
    rules = config.risro
    stage = None
    if rules.sparsity != "none":
        stage = SparseStage(kind=rules.sparsity, alpha=rules.alpha, r=rules.r, p0=rules.p0, updates=rules.updates)
    settings = Settings(max_iterations=rules.max_iterations, tolerance=rules.tolerance)
    return risro_varx(data, settings=settings, sparse=stage, as_published=rules.as_published)


def declared(solution: VarxSolution, z: FloatArray, config: Config) -> NDArray[np.bool_]:
    """Return (n_atoms,) whether the rule declares each fault: its share of the norm above the threshold, and not zero.

    Parameters
    ----------
    solution : magnitudes in scaled units, against which round-off is told.
    z : (n_atoms,) the same in SI.
    """
    threshold = THRESHOLD if config.selection.threshold is None else config.selection.threshold
    return (np.abs(z) > threshold * np.linalg.norm(z)) & (np.abs(solution.z) > ZERO)


def _criterion(study: Study, order: int, solution: VarxSolution, penalty: Penalty) -> float:
    variance = solution.misfit**2 / study.n_rows + study.floor**2
    n_parameters = study.problem(order).n_predictor + len(study.live)
    return penalty.n_effective * float(np.log(variance)) + n_parameters * penalty.per_parameter


def by_published(study: Study, config: Config, report: Report) -> Found:
    """Identify by RISRO and the thesis's rule; variances from the likelihood at its solution.

    Raises
    ------
    ConfigError : several outputs.
    """
    run = _run(study, config, report)
    whole = magnitudes_of(study, run.whole, run.penalty)
    active = list(run.active)
    value = whole.value.copy()
    value[:] = run.z
    estimates = Magnitudes(
        value=value,
        variance=whole.variance,
        minimal_detectable=whole.minimal_detectable,
        covariance=whole.covariance[np.ix_(active, active)],
        degrees=whole.degrees,
    )
    notes = ["the published rule declares every magnitude above a share of the largest; it has no false-alarm rate"]
    if config.risro.as_published and abs(run.solution.corner - 1.0) > 0.01:
        notes.append(
            f"the published algorithm leaves the corner of its matrix free; it ended at {run.solution.corner:.3g} "
            "instead of 1, so its magnitudes are not those of a faulty sensor"
        )
    plain = choose(study, evidence=0.0, extended=True, max_active=0).best
    return Found(
        scored=run.scored,
        plain=plain,
        magnitudes=estimates,
        orders=(),
        criterion_no_fault=(),
        criterion_best=(),
        solver=SolverSummary(
            method="risro",
            termination=run.solution.termination.value,
            iterations=run.solution.iterations,
            condition_number=run.solution.condition_number,
        ),
        notes=tuple(notes),
    )
