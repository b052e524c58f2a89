"""Faults of unknown shape: whether one is in the log, and its course, estimated jointly with the model.

After its onset the course is an integrated random walk (`kernels.free_course`). It is in the log where it lowers the
criterion of the selection by more than the price of an atom, with level, slope and intensity of the walk counted as
parameters and the rest of its freedom paid in the marginal likelihood. The named entries that are declared without it
act beside it, or give way to it.

A model that nearly integrates can follow a slow fault, and would be given a course that nobody flew. So the record is
drawn anew from the fitted model, a few times, and the course estimated again: where it is not found again, it is not
identifiable, and no course is declared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..config import Config
from ..faults import Fault, active_samples
from ..kernels import TINY, BoolArray, FloatArray
from ..kernels.free_course import CourseFit, course_problem, fit_course, redrawn, walk_columns
from ..kernels.low_pass import decimate
from ..kernels.model_selection import Penalty
from ..kernels.progress import Progress, unseen
from ..kernels.variable_projection import fit_magnitudes
from .course import FreeOutcome
from .preprocessing.regression import RegressionData
from .preprocessing.window import DEPENDENT, PreparedWindow, regression_of
from .selection import MethodResult

# CELL_S [s], MOST_CELLS: shortest cell of the walk, in which an aircraft changes its motion, and their largest number.
# With half a second courses on the nonlinear simulation were found as well, with two seconds less of a bump.
CELL_S, MOST_CELLS = 1.0, 64
# Samples per cell at least: with as many cells as samples a walk is the noise.
SAMPLES_PER_CELL = 8
# Records that are drawn anew for each of two courses, and the share of the course's mean square that its error in them
# may be: what is drawn accounts for 90 % of the fault.
DRAWS, LARGEST_ERROR = 6, 0.1
# Models whose risk is worse by more weigh less than exp(-10).
CLOSE = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Model:
    """A course at one order beside named atoms: the criterion by which it is there, and the risk of its estimate."""

    criterion: float
    risk: float
    order: int
    unit_root: bool
    named: tuple[int, ...]
    fit: CourseFit


def identify_with_courses(
    window: PreparedWindow,
    regression: RegressionData,
    config: Config,
    progress: Progress = unseen,
    *,
    identify: Callable[..., MethodResult],
) -> MethodResult:
    """Identify the named faults, then look whether an entry of unknown course is in the log beside or instead of them.

    1. Identify without.
    2. Estimate the course of each such entry, beside all declared entries, all but one, and none; the best is kept.
    3. One that lowers the criterion enough, and is found again in records drawn from its model, is declared, one at
       most; the named entries are then identified in the record less its course.

    Parameters
    ----------
    identify : the method for named entries.
    """
    plain = identify(window, regression, config, progress)
    effective = regression.effective_rows(plain.error, regression.data.columns.n_base)
    penalty = regression.penalty(config.selection, len(window.live) + len(window.free), effective)
    without = min(
        penalty.criterion(fit_magnitudes(regression.problem(order), plain.atoms)) for order in regression.orders
    )
    report = partial(progress, "courses of unknown shape")
    outcomes, gains, beside = list[FreeOutcome](), list[float](), list[tuple[int, ...]]()
    for n, entry in enumerate(window.free):
        outcome, gain, named = _course_of(window, regression, config, penalty, plain.atoms, entry, without)
        outcomes.append(outcome)
        gains.append(gain)
        beside.append(named)
        report((n + 1.0) / len(window.free))
    declared = [n for n, outcome in enumerate(outcomes) if outcome.declared]
    if not declared:
        return replace(plain, free=tuple(outcomes))
    best = max(declared, key=lambda n: gains[n])
    for n in declared:
        if n != best:
            other = window.names[outcomes[best].entry]
            note = f"'{other}' explains the log better; one fault of unknown shape is declared at a time"
            outcomes[n] = replace(outcomes[n], declared=False, note=note)
    corrected = _without_course(window, outcomes[best])
    if not beside[best]:
        config = config.model_copy(update={"selection": config.selection.model_copy(update={"max_active": 0})})
    rest = identify(corrected, regression_of(corrected, config), config, progress)
    if rest.analysed is not None:  # with onsets moved; what was measured has the course in it
        moved, data = rest.analysed
        moved = replace(
            moved,
            signals=replace(moved.signals, y=window.signals.y),
            native=replace(moved.native, log=window.native.log),
        )
        rest = replace(rest, analysed=(moved, data))
    return replace(rest, free=tuple(outcomes), plain_error=plain.plain_error)


def _course_of(
    window: PreparedWindow,
    regression: RegressionData,
    config: Config,
    penalty: Penalty,
    atoms: tuple[int, ...],
    entry: int,
    without: float,
) -> tuple[FreeOutcome, float, tuple[int, ...]]:
    """Return the outcome of an entry of unknown course, how far it lowers the criterion, and the atoms beside it."""
    fault = window.faults[entry]
    nothing = np.zeros(len(window.signals.time_s))
    say = partial(FreeOutcome, entry=entry, output=0, declared=False, suspected=False, value=nothing, sd=nothing)
    rows_s, name = regression.rows_s, window.names[entry]
    before, after = int(np.sum(rows_s < fault.onset_s)), int(np.sum(active_samples(fault, rows_s)))
    needed = regression.data.columns.n_base + max(regression.orders)
    if before < needed or after < needed + 3 * SAMPLES_PER_CELL:
        return (
            say(
                note=(
                    f"not identifiable: {before} samples before its onset and {after} after it, of which the model and "
                    f"a course need {needed} and {needed + 3 * SAMPLES_PER_CELL}; choose a longer window around it"
                )
            ),
            -np.inf,
            (),
        )
    columns = partial(_columns, window, fault, min(MOST_CELLS, after // SAMPLES_PER_CELL))
    line, walk = (
        decimate(each, window.signals.factor, window.lowpass) / regression.unit[0]
        for each in columns(window.native.time_s)
    )
    supports = dict.fromkeys([atoms, *(tuple(a for a in atoms if a != left) for left in atoms), ()])
    models = sorted(
        (
            model
            for support in supports
            if _independent(regression.layout.theta[:, 0, list(support)], line)
            for model in _models(regression, penalty, line, walk, support)
        ),
        key=lambda model: model.criterion,
    )
    gain, named, unit = without - models[0].criterion, models[0].named, float(regression.unit[0])
    # Whether a course is there is the criterion's question; which order draws it with the least error is another. The
    # criterion pays for few lags, and a predictor of too few bends the course (docs/theory.md, 3.4).
    models = sorted((model for model in models if model.named == named), key=lambda model: model.risk)
    best = models[0]
    models = [model for model in models if model.risk < best.risk + CLOSE]
    weight = np.exp(-0.5 * (np.array([model.risk for model in models]) - best.risk))
    weight /= weight.sum()
    values, spreads = (np.array([getattr(model.fit, key) for model in models]) for key in ("value", "sd"))
    value = weight @ values
    variance = weight @ (spreads**2 + (values - value) ** 2)
    if gain <= 0.0:
        note = f"no evidence for it: the criterion is {-gain:.1f} better without"
        return say(value=value * unit, sd=np.sqrt(variance) * unit, note=note), gain, named
    on = active_samples(fault, regression.signals.time_s)
    errors, share = _errors_when_redrawn(regression, best, line, walk, on, seed=config.seed)
    answer = partial(say, value=value * unit, sd=np.sqrt(np.maximum(variance, errors)) * unit)
    moved = float(np.ptp(regression.layout.y[:, 0]))
    if share > LARGEST_ERROR or np.ptp(value) > moved:
        known = f"its course is known to {100.0 * np.sqrt(share):.0f} % only"
        if np.ptp(value) > moved:
            known = "its course would be larger than all that the output moved"
        note = (
            f"not identifiable: '{name}' lowers the criterion by {gain:.1f}, but the aircraft's own motion can pass "
            f"for it: {known}; add inputs that move with the output, as pitch and longitudinal_acc"
        )
        return answer(suspected=True, note=note), gain, named
    return answer(declared=True), gain, named


def _columns(window: PreparedWindow, fault: Fault, cells: int, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return level and slope, and the walk, at the log's own samples as the log shows them."""
    response, step = window.response, 1.0 / window.native.rate_hz
    before, after = step * np.arange(response.after, 0, -1), step * np.arange(1, response.before + 1)
    wider = np.concatenate([time_s[0] - before, time_s, time_s[-1] + after])
    stop_s = float(time_s[-1]) if fault.offset_s is None else min(float(time_s[-1]), fault.offset_s)
    cells = max(1, min(cells, int((stop_s - fault.onset_s) / CELL_S)))
    made = walk_columns(wider, onset_s=fault.onset_s, stop_s=stop_s, cells=cells)
    active = active_samples(fault, wider)[:, None]
    line, walk = (response.filtered(each * active) for each in made)
    return line, walk


def _independent(theta: FloatArray, line: FloatArray) -> bool:
    """Say whether named faults are told from level and slope: a step and a drift of the same onset are both."""
    columns = np.column_stack([theta, line])
    norms = np.linalg.norm(columns, axis=0)
    return bool(norms.all() and np.linalg.svd(columns / norms, compute_uv=False)[-1] > DEPENDENT)


def _models(
    regression: RegressionData, penalty: Penalty, line: FloatArray, walk: FloatArray, named: tuple[int, ...]
) -> Iterator[_Model]:
    """Yield the course at every order, the roots of the predictor free and one of them held at 1."""
    for order in regression.orders:
        plain = fit_magnitudes(regression.problem(order), named).K[:, 0, 0]
        for unit_root in (False, True) if order > 1 else (False,):
            problem = course_problem(
                regression.layout,
                order=order,
                line=line,
                walk=walk,
                named=named,
                unit_root=unit_root,
                floor=regression.floor,
            )
            # With a root at 1 the increments obey what is left of the predictor when 1 - z^-1 is divided out.
            fit = fit_course(problem, [-np.cumsum(plain[::-1])[::-1][1:] if unit_root else plain])
            price = fit.n_parameters * penalty.per_parameter + (len(named) + 1) * penalty.per_atom
            evidence, n, p = penalty.n_effective / penalty.n_rows * fit.deviance, penalty.n_effective, fit.n_parameters
            yield _Model(
                criterion=evidence + price,
                # Akaike's, as corrected by Hurvich and Tsai (1989).
                risk=evidence + 2.0 * p * n / max(n - p - 1.0, 1.0),
                order=order,
                unit_root=unit_root,
                named=named,
                fit=fit,
            )


def _errors_when_redrawn(
    regression: RegressionData, best: _Model, line: FloatArray, walk: FloatArray, on: BoolArray, *, seed: int
) -> tuple[FloatArray, float]:
    """Estimate known courses in records drawn from a model.

    Two courses of the same mean square are drawn: the one that was found, and half a sine. Where a curved course is
    lost in the motion of the model, the likeliest is a straight line, which finds itself again.

    Parameters
    ----------
    on : (n_samples,) true from the onset on.

    Returns
    -------
    (n_samples,) the larger of the mean square errors of the two, scaled, and the larger of their means over that of the
    course.
    """
    rng, size = np.random.default_rng(seed), float(np.mean(best.fit.value[on] ** 2))
    half_sine = np.zeros(len(on))
    half_sine[on] = np.sqrt(2.0 * size) * np.sin(np.linspace(0.0, np.pi, int(on.sum())))
    errors, share = np.zeros(len(on)), 0.0
    for course in (best.fit.value, half_sine):
        squares = np.zeros(len(on))
        for _ in range(DRAWS):
            drawn = redrawn(regression.layout, best.fit, course, named=best.named, unit_root=best.unit_root, rng=rng)
            problem = course_problem(
                drawn,
                order=best.order,
                line=line,
                walk=walk,
                named=best.named,
                unit_root=best.unit_root,
                floor=regression.floor,
            )
            squares += (fit_course(problem).value - course) ** 2 / DRAWS
        errors = np.maximum(errors, squares)
        share = max(share, float(np.mean(squares[on])) / max(size, TINY))
    return errors, share


def _without_course(window: PreparedWindow, course: FreeOutcome) -> PreparedWindow:
    """Return the window less a course, which between the samples of the analysis is a straight line."""
    signals, log = window.signals, window.native.log
    between, channel = np.interp(log.time_s, signals.time_s, course.value), log.channel(window.outputs[0])
    return replace(
        window,
        signals=replace(signals, y=signals.y - course.value[:, None]),
        native=replace(window.native, log=log.plus({channel.name: -between})),
    )
