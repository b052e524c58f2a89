"""Method mfddfd: which time courses of the dictionary are in the log, wherever and through whatever they act."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..config import Config
from ..kernels import FloatArray
from ..kernels.atom_signals import some_of
from ..kernels.lagged import lagged
from ..kernels.mfddfd import (
    BlockFit,
    as_sensor_faults,
    best_within,
    block_regression,
    largest_weight,
    solve_blocks,
    solve_on_support,
    standardised,
    time_courses,
)
from ..kernels.progress import Progress, parts, unseen
from ..kernels.variable_projection import fit_magnitudes
from ..model.preprocessing.magnitudes import MagnitudeEstimates
from ..model.preprocessing.regression import RegressionData
from ..model.preprocessing.window import DEPENDENT, PreparedWindow
from ..model.result import SolverSummary
from ..model.selection import MethodResult
from ..notes import Note
from ..quantities.text import quantity

# Weights relative to that which leaves no block, and digits that a support needs. Chosen on the records of
# tests/kernels/test_mfddfd.py and tests/measurements/test_mfddfd.py, as is the end of the path.
PATH, TOLERANCE = np.geomspace(0.7, 0.005, 12), 1e-5
# Supports of the path in a row that are worse than the best one, after which it ends.
PATIENCE = 2
# Share of a block's part that an error of one sensor must explain to be named as its fault. Chosen without a tuning
# record.
SENSOR_SHARE = 0.95
# Time courses in a note.
SHOWN = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Choice:
    """The best support of one order: `courses` are the atoms by time course."""

    order: int
    courses: tuple[tuple[int, ...], ...]
    fit: BlockFit
    none: BlockFit
    iterations: int
    converged: bool


def identify_by_mfddfd(
    window: PreparedWindow, regression: RegressionData, config: Config, progress: Progress = unseen
) -> MethodResult:
    """Solve a path of weights at every order, and choose order and blocks by the criterion after re-solving.

    Of the entries with a declared time course the one is named whose sensor's error explains most of it.
    """
    choices = [
        _chosen(regression, order, config) for order, _ in parts(partial(progress, "every order"), regression.orders)
    ]
    best = min(choices, key=lambda choice: choice.fit.criterion)
    best = _with_those_worth_it(regression, best, config)
    lowest = min(choices, key=lambda choice: choice.none.criterion)
    problem = regression.problem(best.order)
    sensor_faults = as_sensor_faults(problem, best.courses, best.fit)
    named = {j: max(best.courses[j], key=lambda atom: sensor_faults[atom][1]) for j in best.fit.support}
    value = np.full(len(regression.atoms), np.nan)
    for atom in named.values():
        value[atom] = sensor_faults[atom][0] * regression.magnitude_unit[atom]
    atoms = tuple(sorted(named.values()))
    plain = fit_magnitudes(regression.problem(lowest.order), ())
    return MethodResult(
        atoms=atoms,
        magnitudes=MagnitudeEstimates.without_variances(value, len(atoms)),
        error=_errors(regression, best) * regression.unit,
        plain_error=regression.unfold(plain).error * regression.unit,
        order=best.order,
        feedthrough=regression.layout.feedthrough,
        condition_number=np.nan,
        solver=SolverSummary(
            method=config.method,
            termination="converged" if best.converged else "iterations",
            iterations=sum(choice.iterations for choice in choices),
            condition_number=np.nan,
        ),
        orders=regression.orders if len(choices) > 1 else (),
        criterion_no_fault=tuple(choice.none.criterion for choice in choices) if len(choices) > 1 else (),
        criterion_best=tuple(choice.fit.criterion for choice in choices) if len(choices) > 1 else (),
        converged=best.converged,
        notes=_where(window, regression, best, named, sensor_faults),
    )


def _with_those_worth_it(regression: RegressionData, best: _Choice, config: Config) -> _Choice:
    """Return a choice without the blocks that are not worth it where rows of correlated errors count for less."""
    weights = regression.layout.weights
    error = _errors(regression, best)
    error = error if weights is None else error * weights[regression.layout.first :, None]
    problem = regression.problem(best.order)
    blocks = block_regression(problem, best.courses)
    effective = regression.effective_rows(error, blocks.n_free)
    if effective >= regression.n_rows:
        return best
    penalty = regression.penalty(config.selection, len(best.courses), effective)
    return replace(best, fit=best_within(blocks, best.fit.support, penalty))


def _chosen(regression: RegressionData, order: int, config: Config) -> _Choice:
    """Return the best support of one order: the best of the path, with the blocks dropped that are not worth it."""
    problem = regression.problem(order)
    courses = time_courses(problem, 1.0 - DEPENDENT)
    penalty = regression.penalty(config.selection, len(courses))
    blocks = block_regression(problem, courses)
    none = path = solve_on_support(blocks, (), penalty)
    standard = standardised(blocks)
    top, W, iterations, converged, worse = largest_weight(standard), None, 0, True, 0
    for share in PATH if top > 0.0 else ():
        solved = solve_blocks(standard, share * top, W, tolerance=TOLERANCE)
        W, iterations, converged = solved.W, iterations + solved.iterations, converged and solved.converged
        if 2 * (blocks.n_free + int(np.isin(blocks.block_of, solved.support).sum())) > blocks.n_rows:
            break
        block_fit = solve_on_support(blocks, solved.support, penalty)
        worse = 0 if block_fit.criterion <= path.criterion else worse + (block_fit.support != path.support)
        path = min(path, block_fit, key=lambda fit: fit.criterion)
        if worse == PATIENCE:
            break
    best = best_within(blocks, path.support, penalty, most=config.selection.max_active)
    return _Choice(order=order, courses=courses, fit=best, none=none, iterations=iterations, converged=converged)


def _errors(regression: RegressionData, best: _Choice) -> FloatArray:
    """Return (n_rows, n_outputs) the prediction error with the declared blocks, row by row of the record, scaled."""
    layout, order, first = regression.layout, best.order, regression.layout.first
    atoms = [best.courses[j][0] for j in best.fit.support]
    u, y = np.asarray(layout.u), np.asarray(layout.y)
    lags = lagged(some_of(layout.theta, atoms).reshape(len(y), -1), range(order + 1), first=first)
    inputs = lagged(u, range(0 if layout.feedthrough else 1, order + 1), first=first)
    X = np.hstack([np.ones((len(y) - first, 1)), inputs, lagged(y, range(1, order + 1), first=first), lags])
    weights = np.ones(len(X)) if layout.weights is None else layout.weights[first:]
    coefficients = np.linalg.lstsq(X * weights[:, None], y[first:] * weights[:, None], rcond=None)[0]
    return np.asarray(y[first:] - X @ coefficients)


def _where(
    window: PreparedWindow,
    regression: RegressionData,
    best: _Choice,
    named: dict[int, int],
    sensor_faults: dict[int, tuple[float, float]],
) -> tuple[Note, ...]:
    """Return a note on where each declared time course shows, and one on those that no error of a sensor explains."""
    if not named:
        return ()
    words, through = [], []
    for j, effects in zip(best.fit.support, best.fit.effects * regression.unit, strict=True):
        name = window.names[window.live[named[j]]]
        shown = [
            quantity(float(effect), window.log.channel(output).unit) + f" on {output}"
            for output, effect in zip(window.outputs, effects, strict=True)
        ]
        words.append(f"'{name}' {', '.join(shown)}")
        if sensor_faults[named[j]][1] < SENSOR_SHARE:
            through.append(f"'{name}'")
    more = f", and {len(words) - SHOWN} more" if len(words) > SHOWN else ""
    notes = [Note.method(f"rms of the declared courses in the prediction errors: {'; '.join(words[:SHOWN])}{more}")]
    if through:
        notes.append(
            Note.limit(
                f"no error of one sensor explains {', '.join(through[:SHOWN])}: it acts inside the plant or on several "
                "sensors, and its magnitude is only what it would be as an error of the channel named"
            )
        )
    return tuple(notes)
