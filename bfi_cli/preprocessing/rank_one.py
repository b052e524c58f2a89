"""RISRO and its sparsity stage as a configuration asks for them."""

from __future__ import annotations

from ..config import Config
from ..kernels.lagged import Compressed
from ..kernels.risro_varx import VarxSolution, risro_varx
from ..kernels.sparsity import SparseStage
from ..kernels.termination import StoppingRule


def solve(data: Compressed, config: Config) -> VarxSolution:
    """Solve the regression of one order, with the published stage where the thesis is followed to the letter."""
    return risro_varx(data, settings=stopping_of(config), as_published=as_published(config), sparse=stage_of(config))


def stage_of(config: Config) -> SparseStage:
    """Return the settings of the sparsity stage."""
    rules = config.risro
    alpha, r, p0 = (None if size == "auto" else size for size in (rules.alpha, rules.r, rules.p0))
    return SparseStage(kind=rules.sparsity, alpha=alpha, r=r, p0=p0, updates=rules.updates)


def stopping_of(config: Config) -> StoppingRule:
    """Return when RISRO stops."""
    return StoppingRule(max_iterations=config.risro.max_iterations, tolerance=config.risro.tolerance)


def as_published(config: Config) -> bool:
    """Say whether the thesis is followed to the letter."""
    return config.risro.as_published or config.method == "risro-as-published"


def decides_by_rule(config: Config) -> bool:
    """Say whether the thesis's rule declares the faults, instead of the stage and the criterion."""
    return as_published(config) or config.risro.sparsity == "none" or config.selection.threshold is not None
