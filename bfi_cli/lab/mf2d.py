"""MF2D: a path of convex problems proposes supports, and the criterion chooses among them once each is re-solved.

The weights of the nuclear norm and of the l1 norm fall together from where no magnitude is left. The magnitudes as
solved are shrunk by both; those that are reported are the likelihood's on the support, as for every other method.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from ..config import Config
from ..kernels.mf2d import largest_weight, solve_mf2d
from ..kernels.model_selection import Proposal, refine_supports
from ..kernels.progress import Progress, parts, unseen
from ..kernels.variable_projection import Fit, ProjectedRegression
from ..model.maximum_likelihood import best_of
from ..model.preprocessing.magnitudes import MagnitudeEstimates, magnitudes_of_fit
from ..model.preprocessing.regression import RegressionData
from ..model.preprocessing.window import PreparedWindow
from ..model.result import SolverSummary
from ..model.selection import MethodResult, result_of_selection
from ..notes import Note

# Weights relative to that which leaves no magnitude, two a decade, and those of the nuclear norm relative to those of
# the l1 norm. Chosen on the made records of tests/kernels/test_mf2d.py.
PATH, NUCLEAR = np.geomspace(0.5, 0.001, 7), 0.3
# A support needs no more digits, and far from the answer no more steps.
TOLERANCE, MOST_ITERATIONS = 1e-4, 500
# Entries of a note.
SHOWN = 5


def identify_by_mf2d(
    window: PreparedWindow, regression: RegressionData, config: Config, progress: Progress = unseen
) -> MethodResult:
    """Solve a path of weights at every order, and choose order and support by the criterion after re-solving."""
    n_atoms = len(regression.atoms)
    penalty = regression.penalty(config.selection, n_atoms)
    problems = [regression.problem(order) for order in regression.orders]
    proposals, iterations = _path(problems, n_atoms, progress)
    searches, _ = refine_supports(
        problems,
        range(n_atoms),
        penalty,
        proposals=proposals,
        max_active=config.selection.max_active,
        dropping_only=True,
    )
    selection = best_of(window, regression, searches, penalty)
    fit = selection.best
    estimates = magnitudes_of_fit(regression, selection.best, penalty)
    return result_of_selection(
        selection,
        estimates,
        SolverSummary(
            method=config.method,
            termination=fit.termination.value,
            iterations=iterations,
            condition_number=selection.unfolded.condition_number,
        ),
        notes=_shrinkage(window, regression, proposals, fit, estimates),
    )


def _path(problems: Sequence[ProjectedRegression], n_atoms: int, progress: Progress) -> tuple[list[Proposal], int]:
    """Return the supports of all weights and orders with the magnitudes as solved, and how many iterations it took."""
    proposals, iterations = [], 0
    for problem, _ in parts(partial(progress, "every order"), problems):
        top = largest_weight(problem)
        atoms_of = np.array([atom for _, atom in problem.signals], dtype=int)
        for share in PATH:
            solved = solve_mf2d(
                problem,
                nuclear=NUCLEAR * share * top,
                sparse=share * top,
                max_iterations=MOST_ITERATIONS,
                tolerance=TOLERANCE,
            )
            iterations += solved.iterations
            z = np.zeros(n_atoms)
            z[atoms_of] = solved.z
            atoms = tuple(int(j) for j in np.flatnonzero(z))
            proposals.append((problem.order, atoms, z[list(atoms)]))
    return proposals, iterations


def _shrinkage(
    window: PreparedWindow,
    regression: RegressionData,
    proposals: Sequence[Proposal],
    fit: Fit,
    estimates: MagnitudeEstimates,
) -> tuple[Note, ...]:
    """Return the note on the magnitudes as solved, by the largest weights that keep every fault that is declared."""
    kept = next(
        ((atoms, z) for order, atoms, z in proposals if order == fit.order and set(atoms) >= set(fit.atoms)),
        None,
    )
    if not fit.atoms or kept is None:
        return ()
    solved_z = dict(zip(*kept, strict=True))
    shrunk = [
        f"{window.names[window.live[j]]} {solved_z[j] * regression.magnitude_unit[j]:.4g} "
        f"(re-solved {estimates.value[j]:.4g})"
        for j in fit.atoms[:SHOWN]
    ]
    return (Note.method(f"the convex problem shrinks magnitudes; as solved: {', '.join(shrunk)}"),)
