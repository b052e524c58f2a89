"""The default method: support and order chosen together by maximum likelihood and an information criterion.

The support is selected by EBIC over all orders on common rows. Then atoms are dropped that fail the overdispersion test
(the same shape stands out nearly as much at other onsets) or the robustness test (the magnitude changes with order and
rate of the model by as much as its size).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..config import STRONG_EVIDENCE, Config
from ..config import Selection as Rules
from ..errors import DictionaryError, LogError
from ..faults.shapes import LINE_SHAPES, SHAPES
from ..kernels import TWO_SIDED_95, FloatArray
from ..kernels.model_selection import (
    BACKWARD_LIMIT,
    Penalty,
    Proposal,
    Visited,
    full_support,
    least_criterion,
    refine_supports,
    search_orders,
)
from ..kernels.progress import Progress, Report, parts, shares, silent, unseen
from ..kernels.variable_projection import Fit, fit_magnitudes
from ..notes import Note
from .preprocessing.magnitudes import (
    MagnitudeEstimates,
    at_half_rate,
    estimate_magnitudes,
    limits_within_tolerance,
    overdispersion,
    overdispersion_if_declared,
    profiled_limits,
    statistic_needed,
)
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow, regression_of, with_sizes
from .result import SolverSummary
from .selection import MethodResult, Select, Selection, move_entry, move_onsets, propose_supports, result_of_selection

# Steps to the magnitude at which the signal of a fault of a pressure line is taken, and the relative change of it that
# ends them: far below the standard deviation of any magnitude that is declared.
SECANTS, AT_REST = 8, 1e-4
# Such steps for entries that may not be in the log: each leaves a fifth of the error of the last, or less.
SECANTS_ALONE = 2
# A fault that is whole shows once; so many times more or less is what a time constant off by as much makes of it.
WHOLE = 1.5
# The regression at half the rate, (n_live,) overdispersions, and the magnitudes of a selection.
Estimated = tuple[RegressionData | None, FloatArray, MagnitudeEstimates]


def identify_by_likelihood(
    window: PreparedWindow,
    regression: RegressionData,
    config: Config,
    progress: Progress = unseen,
    *,
    given: bool = False,
    exclusive: bool = False,
) -> MethodResult:
    """Select order and support by EBIC, then drop atoms that fail the overdispersion or the robustness test.

    Where onsets are known to a tolerance only, entries are moved within it to where their fault begins.

    Parameters
    ----------
    given : every live entry is taken to be present, and only the order is selected.
    exclusive : entries of one output that begin within the onset tolerance of each other are rivals, of which one is
        declared: what an uncertain recorder makes of a fault looks like another that begins with it.

    Raises
    ------
    LogError : a threshold is asked for, and the window is too short to estimate all magnitudes at once.
    """
    names, declined = [window.names[j] for j in window.live], dict[int, str]()
    rules = config.selection
    is_stated, threshold = given or rules.threshold is not None, 0.0 if given else rules.threshold or 0.0
    # 1. The support, by EBIC at the onsets stated and about them, or by the rule.
    window, regression = _at_own_sizes(window, regression, config)
    choose = partial(select, rules=rules)
    at_stated = now = choose(window, regression, report=partial(progress, "search for the faults"))
    if is_stated:
        now = _by_threshold(window, regression, now, threshold)
    elif rules.max_active != 0:
        now = move_onsets(now, config, choose)
    # 2. What acts through a pressure line, as a whole and at its own size.
    while not is_stated and (failed := _not_whole(now)) is not None:
        now = _declining(now, failed, declined)
    about_signals: list[Note] = []
    if any(now.window.faults[now.window.live[n]].shape in LINE_SHAPES for n in now.best.atoms):
        refit = partial(_by_threshold, selection=now, threshold=threshold)
        now, about_signals = _with_secants(now, config, refit if is_stated else choose)
    # 3. Magnitudes, and the tests that an atom must pass.
    estimated = _estimated(now, config, progress)
    if not is_stated:
        now, estimated = _tested(
            now, estimated, at_stated, declined, config, choose=choose, exclusive=exclusive, progress=progress
        )
    # 4. Limits of the entries that are not declared.
    coarse, dispersion, estimates = estimated
    limits = _limits(now, config, coarse, dispersion, estimates, within=not is_stated, progress=progress)
    del coarse, estimated  # its memory is wanted for what follows
    fit = now.best
    notes = [*about_signals]
    notes += [
        Note.limit(f"'{names[n]}' begins {abs(s):.3g} s {'after' if s > 0 else 'before'} the onset stated")
        for n, s in now.shifts_s.items()
        if n in fit.atoms
    ]
    return result_of_selection(
        now,
        replace(estimates, minimal_detectable=limits),
        SolverSummary(
            method=config.method,
            termination=fit.termination.value,
            iterations=fit.iterations,
            condition_number=now.unfolded.condition_number,
        ),
        declined=declined,
        needed=statistic_needed(now.penalty, dispersion),
        analysed=(now.window, now.regression) if now.shifts_s or now.window.sizes else None,
        criterion=fit.bic(now.regression.n_rows),
        dispersion=float(np.max(dispersion[list(fit.atoms)], initial=1.0)),
        remarks={
            **_near_miss(names, now),
            **{n: Note.limit(f"'{names[n]}' is not declared: {reason}") for n, reason in declined.items()},
        },
        notes=(*notes, *_rival_note(names, now)),
    )


def _declining(now: Selection, failed: tuple[int, str], declined: dict[int, str]) -> Selection:
    """Return the best of the supports visited that leave out an atom which failed; the reason enters `declined`."""
    atom, declined[failed[0]] = failed
    searches = [{atoms: scored for atoms, scored in visited.items() if atom not in atoms} for visited in now.searches]
    left = best_of(now.window, now.regression, searches, now.penalty)
    return replace(left, shifts_s=now.shifts_s, prices=now.prices)


def _tested(
    now: Selection,
    estimated: Estimated,
    at_stated: Selection,
    declined: dict[int, str],
    config: Config,
    *,
    choose: Select,
    exclusive: bool,
    progress: Progress,
) -> tuple[Selection, Estimated]:
    """Return a selection of which every atom passes all tests, with its magnitudes; the others enter `declined`."""
    coarse, dispersion, estimates = estimated
    has_lines = any(now.window.faults[entry].shape in LINE_SHAPES for entry in now.window.live)
    while True:
        failed = _failed_test(now, estimates, dispersion) or _not_whole(now)
        failed = failed or (_rival(now, config) if exclusive else None)
        if failed is None:
            return now, (coarse, dispersion, estimates)
        if not (declined or has_lines or failed[0] in now.shifts_s):
            # The residue of a fault that begins beside its stated onset stands out at other onsets too.
            beside = move_entry(now, failed[0], at_stated, config, choose)
            if beside is not None:
                there = _estimated(beside, config, progress)
                if _failed_test(beside, there[2], there[1]) is None:
                    return beside, there
        now = _declining(now, failed, declined)
        sizing = partial(progress, f"magnitudes, {len(declined)} declined")
        estimates = estimate_magnitudes(now.regression, now.fits, now.penalty, dispersion, coarse, sizing)


def _limits(
    now: Selection,
    config: Config,
    coarse: RegressionData | None,
    dispersion: FloatArray,
    estimates: MagnitudeEstimates,
    *,
    within: bool,
    progress: Progress,
) -> FloatArray:
    """Return (n_live,) the minimal detectable magnitudes.

    Parameters
    ----------
    within : at every onset within the tolerance, not at the stated onset alone.
    """
    regression, penalty = now.regression, now.penalty
    likely, sized = overdispersion_if_declared(now.window, regression, now.best, dispersion), estimates
    if np.any(likely > dispersion):
        sizing = partial(progress, "magnitudes that would be declared")
        sized = estimate_magnitudes(regression, now.fits, penalty, likely, coarse, sizing)
    limits = profiled_limits(regression, now.best, sized, penalty, likely)
    if not within:
        return limits
    sizing = partial(progress, "magnitudes within the onset tolerance")
    others = limits_within_tolerance(now.window, regression, config, now.fits, penalty, likely, coarse, sizing)
    return np.asarray(np.fmax(limits, others))


def _rival(now: Selection, config: Config) -> tuple[int, str] | None:
    """Return a declared entry that begins with another of its output and explains less alone; None where none does."""
    window, fit = now.window, now.best
    near_s = 2.0 * config.onset_tolerance_s + 1.0 / window.signals.rate_hz
    declared = {n: window.faults[window.live[n]] for n in fit.atoms}
    problem = now.regression.problem(fit.order)
    for n, fault in declared.items():
        beside = [m for m, other in declared.items() if m != n and other.channel == fault.channel]
        for m in (m for m in beside if abs(declared[m].onset_s - fault.onset_s) <= near_s):
            without = {k: fit_magnitudes(problem, tuple(a for a in fit.atoms if a != k)).log_det for k in (n, m)}
            dropped = min(without, key=lambda k: without[k])
            kept = window.names[window.live[m if dropped == n else n]]
            return dropped, f"it begins with '{kept}', which alone explains the log better; the recorder is uncertain"
    return None


def _estimated(now: Selection, config: Config, progress: Progress) -> Estimated:
    coarse = at_half_rate(now.window, now.regression, config, partial(progress, "the record at half the rate"))
    elsewhere = partial(progress, "the same shapes elsewhere")
    dispersion = overdispersion(now.window, now.regression, now.best, elsewhere)
    estimates = estimate_magnitudes(
        now.regression,
        now.fits,
        now.penalty,
        dispersion,
        coarse,
        partial(progress, "magnitudes"),
    )
    return coarse, dispersion, estimates


def _is_sized(window: PreparedWindow, n: int) -> bool:
    """Say whether the n-th live entry is a fault of a pressure line whose course depends on its magnitude."""
    shape = window.faults[window.live[n]].shape
    return shape in LINE_SHAPES and SHAPES[shape].has_magnitude


def _at_own_sizes(
    window: PreparedWindow, regression: RegressionData, config: Config
) -> tuple[PreparedWindow, RegressionData]:
    """Return window and regression with the signal of each fault of a line at the size that it has as the only fault.

    Thus a large loss is compared with other faults by its course, and not by the first order of that.
    """
    sized = {n: entry for n, entry in enumerate(window.live) if _is_sized(window, n)}
    if not sized:
        return window, regression

    def alone(there: RegressionData, order: int) -> dict[int, float]:
        problem = there.problem(order)
        return {
            entry: float(fit_magnitudes(problem, (n,)).z[0] * there.magnitude_unit[n]) for n, entry in sized.items()
        }

    plain = [fit_magnitudes(regression.problem(order), ()) for order in regression.orders]
    order = min(plain, key=lambda fit: fit.bic(regression.n_rows)).order
    for _ in range(SECANTS_ALONE):
        sizes: dict[int, float] = {}
        for entry, size in alone(regression, order).items():
            # What the log cannot have lost tells nothing of its course: such an entry keeps its derivative.
            try:
                with_sizes(window, {entry: size})
            except (DictionaryError, LogError):
                continue
            sizes[entry] = size
        window = with_sizes(window, sizes)
        regression = regression_of(window, config)
    return window, regression


def _with_secants(now: Selection, config: Config, choose: Select) -> tuple[Selection, list[Note]]:
    """Return what is selected with the signals of chosen faults of a line taken at their magnitudes.

    A channel is not proportional to a loss of pressure: at a fifth of it the derivative is off by a fifth. Each step
    takes the signals as the secants to the magnitudes of the last; where they rest, the channel less magnitude x signal
    is what it would have been without the fault. Where the log cannot tell so large a loss, the note says so.

    Parameters
    ----------
    choose : returns the selection on another regression.
    """
    fit, z = now.best, now.best.z
    sized = [k for k, n in enumerate(fit.atoms) if _is_sized(now.window, n)]
    if not sized:
        return now, []
    window, regression = now.window, now.regression
    for _ in range(SECANTS):
        magnitude = z * regression.magnitude_unit[list(fit.atoms)]
        sizes = {window.live[fit.atoms[k]]: float(magnitude[k]) for k in sized}
        if all(abs(window.sizes.get(entry, 0.0) - size) <= AT_REST * abs(size) for entry, size in sizes.items()):
            break
        try:
            window = with_sizes(now.window, sizes)
        except (DictionaryError, LogError) as problem:
            words = str(problem).removeprefix(f"{window.log.path}: ")
            return now, [Note.method(f"its signal is the derivative at no fault: {words}")]
        regression = regression_of(window, config)
        start = magnitude / regression.magnitude_unit[list(fit.atoms)]
        z = fit_magnitudes(regression.problem(fit.order), fit.atoms, start).z
    return replace(choose(window, regression), shifts_s=now.shifts_s, prices=now.prices), []


def none_of(rules: Rules) -> Rules:
    """Return the rules by which no fault is declared, and only the order selected."""
    return rules.model_copy(update={"evidence": 0.0, "max_active": 0})


def select(window: PreparedWindow, regression: RegressionData, rules: Rules, report: Report = silent) -> Selection:
    """Search supports at every order on common rows and take the best."""
    n_atoms, max_active = len(regression.atoms), rules.max_active
    penalty = regression.penalty(rules, n_atoms)
    preparing, proposing, searching = shares(report, 1, 2, 4)
    problems = [regression.problem(order) for order, _ in parts(preparing, regression.orders)]
    atoms, proposals = range(n_atoms), tuple[Proposal, ...]()
    if regression.layout.y.shape[1] == 1 and max_active != 0:
        proposals = propose_supports(regression, penalty, proposing)
    searches, agreed = refine_supports(problems, atoms, penalty, proposals=proposals, max_active=max_active)
    # A fit of every addition to every support takes the square of a large dictionary; the best to first order do.
    if n_atoms <= BACKWARD_LIMIT and not (proposals and agreed):
        searches = search_orders(problems, atoms, penalty, max_active=max_active, known=searches, report=searching)
    searching(1.0)
    selection = best_of(window, regression, searches, penalty)
    per_output = selection.best.n_parameters / regression.layout.y.shape[1]
    effective = regression.effective_rows(selection.unfolded.weighted_error, per_output)
    if effective >= regression.n_rows:
        return selection
    penalty = replace(penalty, n_effective=effective)
    searches, _ = refine_supports(problems, atoms, penalty, known=searches, max_active=max_active, dropping_only=True)
    return best_of(window, regression, searches, penalty, known=selection)


def _by_threshold(
    window: PreparedWindow, regression: RegressionData, selection: Selection, threshold: float
) -> Selection:
    """Return the selection by the thesis's rule on all magnitudes at once: |z| / norm(z) > threshold."""
    everything = tuple(range(len(regression.atoms)))
    whole = [full_support(regression.problem(order), everything, selection.penalty) for order in regression.orders]
    scored = [scored_fit for scored_fit in whole if scored_fit is not None]
    if len(scored) < len(whole):
        raise LogError(
            f"{regression.signals.path}: too few samples to estimate all magnitudes at once; choose a longer window or "
            "a smaller dictionary"
        )
    fit = least_criterion(scored)
    z = fit.z * regression.magnitude_unit
    atoms = tuple(int(j) for j in np.flatnonzero(np.abs(z) >= threshold * np.linalg.norm(z)))
    start = replace(fit, atoms=atoms, z=fit.z[list(atoms)])
    fits = tuple(_refit(regression, order, {}, start, selection.penalty) for order in regression.orders)
    searches = tuple(
        {at: scored for at, scored in visited.items() if at == ()} | {atoms: fitted}
        for visited, fitted in zip(selection.searches, fits, strict=True)
    )
    best = least_criterion(fits)
    unfolded = regression.unfold(best)
    return replace(
        selection, window=window, regression=regression, best=best, fits=fits, searches=searches, unfolded=unfolded
    )


def best_of(
    window: PreparedWindow,
    regression: RegressionData,
    searches: Sequence[Visited],
    penalty: Penalty,
    *,
    known: Selection | None = None,
) -> Selection:
    """Return the best of what was visited at the orders of a regression, its support fitted at every order.

    Parameters
    ----------
    known : by another criterion, whose best fit, if it is the same, is not unfolded again.
    """
    best = least_criterion(scored for visited in searches for scored in visited.values())
    by_order = zip(regression.orders, searches, strict=True)
    return Selection(
        window=window,
        regression=regression,
        best=best,
        fits=tuple(_refit(regression, order, visited, best, penalty) for order, visited in by_order),
        searches=tuple(searches),
        penalty=penalty,
        unfolded=known.unfolded if known is not None and best.is_as(known.best) else regression.unfold(best),
    )


def _refit(regression: RegressionData, order: int, visited: Visited, fit: Fit, penalty: Penalty) -> Fit:
    """Return the support of a fit at an order, fitted from the magnitudes of `fit` if not visited there yet."""
    if fit.atoms in visited:
        return visited[fit.atoms]
    fitted = fit_magnitudes(regression.problem(order), fit.atoms, fit.z)
    return penalty.scored(fitted)


def _failed_test(now: Selection, estimates: MagnitudeEstimates, dispersion: FloatArray) -> tuple[int, str] | None:
    """Return the least certain active atom that fails a test, and which; None where none does."""
    best, penalty = now.best, now.penalty
    atoms = list(best.atoms)
    if not atoms:
        return None
    visited = now.searches[now.regression.orders.index(best.order)]
    margins = []
    for atom in atoms:
        kept = [n for n, other in enumerate(atoms) if other != atom]
        smaller = replace(best, atoms=tuple(atoms[n] for n in kept), z=best.z[kept])
        fall = _refit(now.regression, best.order, visited, smaller, penalty).log_det - best.log_det
        margins.append(
            penalty.n_effective * fall / ((penalty.per_fault + now.prices.get(atom, 0.0)) * dispersion[atom])
        )
    if min(margins) < 1.0:
        atom = atoms[int(np.argmin(margins))]
        return atom, (
            "the same shape stands out nearly as much at other onsets of this window "
            f"({np.sqrt(dispersion[atom]):.1f} times what white noise would do)"
        )
    ratio = np.abs(estimates.value[atoms]) / np.sqrt(estimates.variance[atoms])
    if np.min(ratio) < estimates.quantile:
        atom = atoms[int(np.argmin(ratio))]
        return atom, "its magnitude changes with order and rate of the model by as much as its size"
    return None


def _not_whole(now: Selection) -> tuple[int, str] | None:
    """Return an active atom without a magnitude that the log shows more or less than whole, and the reason; or None.

    Its signal is that of all of the fault, so that its magnitude is 1 where it is in the log.
    """
    fit, window = now.best, now.window
    sd = np.sqrt(np.maximum(np.diag(np.linalg.pinv(fit.information, hermitian=True)), 0.0))
    for n, z, spread in zip(fit.atoms, fit.z, sd, strict=True):
        fault, unit = window.faults[window.live[n]], float(now.regression.magnitude_unit[n])
        if SHAPES[fault.shape].has_magnitude:
            continue
        share, reach = float(z) * unit, TWO_SIDED_95 * float(spread) * unit
        if share + reach < 1.0 / WHOLE or share - reach > WHOLE:
            return (
                n,
                f"the log shows {share:.2g} times what all of it would be: another time constant, or another fault",
            )
    return None


def _rival_note(names: Sequence[str], selection: Selection) -> list[Note]:
    """Name the best other support of the same size, if it explains the log nearly as well."""
    best, size = selection.best, len(selection.best.atoms)
    others = [
        scored
        for visited in selection.searches
        for scored in visited.values()
        if scored.atoms != best.atoms and len(scored.atoms) == size
    ]
    rival = min(others, key=lambda scored: scored.criterion, default=None)
    if rival is None or rival.criterion - best.criterion >= STRONG_EVIDENCE:
        return []
    there, here = (" and ".join(f"'{names[j]}'" for j in scored.atoms) or "no fault" for scored in (rival, best))
    return [
        Note.limit(
            f"{there} would explain the log nearly as well as {here} (criterion {rival.criterion - best.criterion:.1f} "
            f"worse, {STRONG_EVIDENCE:.1f} would be strong evidence)"
        )
    ]


def _near_miss(names: Sequence[str], selection: Selection) -> dict[int, Note]:
    """Name the best support of one atom more that was turned down only because its evidence was not strong."""
    best, evidence = selection.best, selection.penalty.evidence
    above = [
        scored
        for visited in selection.searches
        for scored in visited.values()
        if set(scored.atoms) > set(best.atoms) and len(scored.atoms) == len(best.atoms) + 1
    ]
    nearest = min(above, key=lambda scored: scored.criterion, default=None)
    if nearest is None or evidence <= 0.0:
        return {}
    shown = evidence - (nearest.criterion - best.criterion)
    if shown <= evidence / 2.0:
        return {}
    (atom,) = set(nearest.atoms) - set(best.atoms)
    words = (
        f"'{names[atom]}' has some support but not enough to be declared (evidence {shown:.1f}, {evidence:.1f} needed)"
    )
    return {atom: Note.limit(words)}
