"""The support and the order that a method of identification chose, all else that was visited, and what it returns.

The sparsity stage proposes supports: for method risro to choose from, for ml to begin with.

Entries of a dictionary begin up to a tolerance before or after the onset that it states: the signature of a step is a
few samples long, so an entry that begins a second beside the fault has little in common with it. Where onsets are known
to a tolerance only, each entry is tried at the onsets within it, half a sample apart, and moved to another one where
this lowers the criterion by more than the price of the choice (docs/theory.md, 5.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..config import Config
from ..kernels import FloatArray
from ..kernels.covariance import FitRows, Regressors, regressors_of_support
from ..kernels.model_selection import Penalty, Proposal, Visited, least_criterion
from ..kernels.progress import Report, StoppingRule, Termination, parts, silent
from ..kernels.risro_varx import SparseSolution, SparseStage, VarxSolution, risro_varx, sparse_varx
from ..kernels.variable_projection import Fit, fit_magnitudes, project_inputs
from ..notes import Note
from .preprocessing.magnitudes import MagnitudeEstimates, searched
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow, shifts_within, signals_of_faults, with_onsets
from .result import SolverSummary

if TYPE_CHECKING:
    from .course import FreeOutcome


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selection:
    """The selected support: its fit at every order, and everything else that was visited.

    Attributes
    ----------
    window, regression : on which it was selected; its entries begin where they were found.
    best : the fit at the best order.
    fits : of the same support at each order, with their criteria.
    searches : what was visited at each order.
    penalty : the criterion.
    unfolded : `best` over the rows, with the signatures of its support.
    shifts_s : by live entry, how much later it begins than the dictionary states.
    prices : by live entry, what the choice of its onset costs, on the scale of the criterion.
    """

    window: PreparedWindow
    regression: RegressionData
    best: Fit
    fits: tuple[Fit, ...]
    searches: tuple[Visited, ...]
    penalty: Penalty
    unfolded: FitRows
    shifts_s: Mapping[int, float] = field(default_factory=dict)
    prices: Mapping[int, float] = field(default_factory=dict)


Select = Callable[[PreparedWindow, RegressionData], Selection]

# The derived stage, which ml begins with. Its starts need no more digits than a tenth of a standard deviation.
DERIVED = SparseStage(kind="exp-l0")
COARSE = StoppingRule(max_iterations=25, tolerance=1e-4)
# Larger supports are way-marks of the stage's first steps: a fit of each would cost more than the stage.
LARGEST = 24
Visits = tuple[SparseSolution, ...]  # where the stage goes at one order, from each of its starts


def stage_runs(
    regression: RegressionData,
    penalty: Penalty,
    *,
    orders: Sequence[int],
    stage: SparseStage = DERIVED,
    settings: StoppingRule = COARSE,
    report: Report = silent,
) -> tuple[dict[int, VarxSolution], dict[int, Visits]]:
    """Return by order RISRO's solution, and where the stage goes from it and from the predictor of no fault."""
    solutions, visited = {}, {}
    for order, _ in parts(report, orders):
        whole, problem = risro_varx(regression.at_order(order), settings=settings), regression.problem(order)
        visits = sparse_varx(problem, whole, n_atoms=penalty.n_candidates, stage=stage, price=penalty.per_fault)
        solutions[order], visited[order] = whole, visits
    return solutions, visited


def propose_supports(regression: RegressionData, penalty: Penalty, report: Report = silent) -> tuple[Proposal, ...]:
    """Return the supports that the derived stage visits, for a search to begin with.

    At orders at which the rows do not determine RISRO's unconstrained start, one of them stands for all: that with the
    best criterion without a fault, and the stage begins there with the predictor of no fault alone.
    """
    n_atoms, n_base = penalty.n_candidates, regression.data.columns.n_base
    determined = [s for s in regression.orders if regression.n_rows >= n_base + (n_atoms + 1) * (s + 1) - 1]
    _, visited = stage_runs(regression, penalty, orders=determined, report=report)
    short = [regression.problem(order) for order in regression.orders if order not in determined]
    if short:
        problem = min(short, key=lambda problem: penalty.criterion(fit_magnitudes(problem, ())))
        visited[problem.order] = sparse_varx(problem, None, n_atoms=n_atoms, stage=DERIVED, price=penalty.per_fault)
    return proposals_of(visited)


def proposals_of(visited: Mapping[int, Visits]) -> tuple[Proposal, ...]:
    """Return every support that was visited and is not too large, and the last of each start in any case."""
    return tuple(
        (order, support, went.z[list(support)])
        for order, visits in visited.items()
        for went in visits
        for support in went.supports
        if len(support) <= LARGEST or support == went.supports[-1]
    )


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
    selection: Selection, magnitudes: MagnitudeEstimates, solver: SolverSummary, **more: Any
) -> MethodResult:
    """Return the result of a method that selects a support at every order and fits it.

    Parameters
    ----------
    more : further attributes of the result.
    """
    regression, fit, searches = selection.regression, selection.best, selection.searches
    plain = [visited.get(()) for visited in searches]
    lowest = least_criterion(scored for scored in plain if scored is not None)
    several, error = len(searches) > 1, selection.unfolded.error * regression.unit
    return MethodResult(
        atoms=fit.atoms,
        magnitudes=magnitudes,
        error=error,
        plain_error=error if lowest.is_as(fit) else regression.unfold(lowest).error * regression.unit,
        order=fit.order,
        feedthrough=regression.layout.feedthrough,
        condition_number=selection.unfolded.condition_number,
        solver=solver,
        orders=regression.orders if several else (),
        criterion_no_fault=tuple(np.nan if scored is None else scored.criterion for scored in plain) if several else (),
        criterion_best=tuple(least_criterion(visited.values()).criterion for visited in searches) if several else (),
        **{"converged": fit.termination is Termination.CONVERGED, **more},
    )


# Onsets of an entry that are fitted: the best to first order, which may rank neighbours wrongly.
FITTED = 3
# They are not where the best gains less than this share of what it needs: first order sees less of a large fault.
HOPEFUL = 0.3
# Entries that are moved at most; more faults than that near their onsets, none at it, have not been met.
MOST_MOVED = 4
# Moves beside each support that are fitted, the best to first order: a bound on the time. First order compares no
# supports, for it sees less of a large fault.
MOST_MOVES = 12
# Numbers of the signals that are kept at once: 80 MB.
MOST_VALUES = 10**7


def move_onsets(stated: Selection, config: Config, select: Select) -> Selection:
    """Move the entries whose fault begins beside their onset, the one that gains most first, until none gains.

    Parameters
    ----------
    stated : with the onsets of the dictionary.
    select : returns the selection on another window and its regression.
    """
    now = stated
    for _ in range(MOST_MOVED):
        move = _best_move(now, stated.window, config)
        if move is None:
            break
        n, shift_s, price = move
        shifts_s, prices = {**now.shifts_s, n: shift_s}, {**now.prices, n: price}
        moved = _at(stated, shifts_s, prices, select)
        chosen = moved.best.atoms
        left = {entry: shift for entry, shift in shifts_s.items() if entry in chosen}
        if len(left) < len(shifts_s):  # one that is not declared stays where the dictionary states it
            moved = _at(stated, left, {entry: prices[entry] for entry in left}, select)
        penalty = now.penalty
        if n not in moved.best.atoms or _cost(moved, penalty) >= _cost(now, penalty):
            break
        now = moved
    return now


def move_entry(now: Selection, entry: int, stated: Selection, config: Config, select: Select) -> Selection | None:
    """Move one entry to its best onset besides the stated one, None where it has none or is not chosen there.

    For an entry that is not declared at the stated onset: it is then held against no fault, and not against itself.

    Parameters
    ----------
    now : what was found so far; entry : live entry that has not moved.
    stated : with the onsets of the dictionary.
    select : returns the selection on another window and its regression.
    """
    move = _best_move(now, stated.window, config, entry)
    if move is None:
        return None
    _, shift_s, price = move
    there = _at(stated, {**now.shifts_s, entry: shift_s}, {**now.prices, entry: price}, select)
    return there if set(there.shifts_s) <= set(there.best.atoms) else None


def _at(
    stated: Selection,
    shifts_s: Mapping[int, float],
    prices: Mapping[int, float],
    select: Select,
) -> Selection:
    window = with_onsets(stated.window, {stated.window.live[n]: shift for n, shift in shifts_s.items()})
    regression = stated.regression.with_dictionary(window.signals.theta, window.live, slopes=window.signals.slopes)
    return replace(select(window, regression), shifts_s=shifts_s, prices=prices)


def _cost(moved: Selection, penalty: Penalty) -> float:
    """Return the criterion with the prices, by one penalty: the effective rows of two selections may differ."""
    return penalty.criterion(moved.best) + sum(moved.prices.values())


def _best_move(
    now: Selection, window: PreparedWindow, config: Config, only: int | None = None
) -> tuple[int, float, float] | None:
    """Return the entry, the shift and the price of the move that lowers the criterion most; None where none does.

    Every onset of every entry is added to first order, all entries at once; the moves that promise most are fitted.

    Parameters
    ----------
    only : an entry that moves to the best of its other onsets, whether that lowers the criterion or not.
    """
    best, penalty = now.best, now.penalty
    lowest, chosen = best.criterion if only is None else np.inf, None
    shifts = {
        n: shifts_within(window, entry, config.onset_tolerance_s)
        for n, entry in enumerate(window.live)
        if n not in now.shifts_s and only in (None, n)
    }
    shifts = {n: entry_shifts for n, entry_shifts in shifts.items() if entry_shifts.size}
    prices = {n: searched(penalty, entry_shifts.size).evidence - penalty.evidence for n, entry_shifts in shifts.items()}
    supports: dict[tuple[int, ...], Regressors] = {}
    moves: dict[tuple[int, ...], list[tuple[float, int, FloatArray]]] = {}
    kept: dict[int, FloatArray] = {}  # signals of the last group's moves: those of all are too many numbers
    for together in _groups(shifts, len(now.regression.signals.time_s)):
        signals = _signals(now.regression, window, {n: shifts[n] for n in together})
        owners = np.repeat(together, [shifts[n].size for n in together])
        kept = {}
        for base, entries in _bases(best.atoms, together).items():
            if (support := supports.get(base)) is None:
                support = supports[base] = _support(now.regression, best, base)
            z, variance = support.each_of(signals[:, :, np.flatnonzero(np.isin(owners, entries))])
            gains = np.nan_to_num(z**2 / variance)
            ends = np.cumsum([shifts[n].size for n in entries])
            for n, entry_gains in zip(entries, np.split(gains, ends[:-1]), strict=True):
                gain = float(entry_gains.max(initial=0.0)) * penalty.n_effective / penalty.n_rows
                if gain >= HOPEFUL * (penalty.per_fault + prices[n]):
                    kept[n] = signals[:, :, np.flatnonzero(owners == n)]
                    moves.setdefault(base, []).append((prices[n] - gain, n, entry_gains))
    promising = [
        (base, n, gains)
        for base, base_moves in moves.items()
        for _, n, gains in sorted(base_moves, key=lambda move: move[0])[:MOST_MOVES]
    ]
    for base, n, gains in promising:
        theta = kept[n] if n in kept else _signals(now.regression, window, {n: shifts[n]})
        for k, fit in _fits(now.regression, supports[base], theta, gains):
            if (criterion := penalty.criterion(fit) + prices[n]) < lowest:
                lowest, chosen = criterion, (n, float(shifts[n][k]), prices[n])
    return chosen


def _groups(shifts: Mapping[int, FloatArray], n_samples: int) -> Iterator[list[int]]:
    """Give entries in groups whose signals are kept at once."""
    group, kept = list[int](), 0
    for n, entry_shifts in shifts.items():
        if group and kept + entry_shifts.size * n_samples > MOST_VALUES:
            yield group
            group, kept = [], 0
        group.append(n)
        kept += entry_shifts.size * n_samples
    if group:
        yield group


def _bases(atoms: Sequence[int], entries: Sequence[int]) -> dict[tuple[int, ...], list[int]]:
    """Return, for each support to which entries may be added, these entries.

    An entry that is declared moves; another is added, or takes the place of a declared one.
    """
    bases: dict[tuple[int, ...], list[int]] = {}
    for n in entries:
        without = [n] if n in atoms else [None, *atoms]
        for left_out in without:
            bases.setdefault(tuple(atom for atom in atoms if atom != left_out), []).append(n)
    return bases


def _signals(regression: RegressionData, window: PreparedWindow, shifts: Mapping[int, FloatArray]) -> FloatArray:
    """Return the signals of entries at their onsets, (n_samples, n_outputs, n_signals), scaled."""
    later = [
        (window.faults[window.live[n]].later(shift_s), window.sizes.get(window.live[n], 0.0))
        for n, entry_shifts in shifts.items()
        for shift_s in entry_shifts.tolist()
    ]
    faults, sizes = zip(*later, strict=True)
    units = np.repeat(
        [float(regression.magnitude_unit[n]) for n in shifts], [entry_shifts.size for entry_shifts in shifts.values()]
    )
    return np.asarray(signals_of_faults(window, faults, sizes) / regression.unit[:, None] * units)


def _support(regression: RegressionData, fit: Fit, base: tuple[int, ...]) -> Regressors:
    """Return the fit of a support at the order of another fit, to which signals are added."""
    known = dict(zip(fit.atoms, fit.z, strict=True))
    without = fit_magnitudes(regression.problem(fit.order), base, np.array([known.get(atom, 0.0) for atom in base]))
    return regressors_of_support(regression.layout, without)


def _fits(
    regression: RegressionData, support: Regressors, theta: FloatArray, gains: FloatArray
) -> list[tuple[int, Fit]]:
    """Return those of some signals that promise most when they are added to a support, and the fit with each.

    Parameters
    ----------
    theta : (n_samples, n_outputs, n_signals), scaled, in the order of their onsets.
    gains : (n_signals,) to first order.
    """
    without = support.fit

    def fit_of(k: int) -> Fit:
        data = support.with_signals(theta[:, :, [k]]).at_order(without.order).factor()
        problem = project_inputs(data, without.order, floor=regression.floor)
        return fit_magnitudes(problem, range(len(without.atoms) + 1), np.append(without.z, 0.0))

    fits = {k: fit_of(k) for k in np.argsort(-gains)[:FITTED].tolist()}
    # From the best of them to the next onset, as long as that fits better.
    while True:
        best = min(fits, key=lambda k: fits[k].log_det)
        beside = [k for k in (best - 1, best + 1) if 0 <= k < len(gains) and k not in fits]
        if not beside:
            return list(fits.items())
        fits |= {k: fit_of(k) for k in beside}
