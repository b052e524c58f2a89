"""The maximum-likelihood answer: support and order chosen together, magnitudes with honest variances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.bilinear import Fit, fit_magnitudes
from ..kernels.coherence import detectable_deviations
from ..kernels.covariance import Unfolded, covariance, single_additions, unfold
from ..kernels.progress import Report, parts, shares, silent
from ..kernels.selection import Penalty, Scored, Search, full_support, search_orders
from ..kernels.whiteness import effective_rows
from ..study import Study

__all__ = ["Answer", "Magnitudes", "by_threshold", "choose", "deviance", "magnitudes", "magnitudes_of", "without"]

FloatArray = NDArray[np.float64]

FALSE_ALARM = 0.01
POWER = 0.9
CLOSE = 20.0
RATE_WEIGHT = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """The chosen support: its fit at every order, and everything else that was visited.

    Attributes
    ----------
    best : the fit at the best order.
    fits : of the same support at each order, with their criteria.
    searches : what was visited, by order.
    penalty : the criterion.
    unfolded : `best` over the rows.
    """

    best: Scored
    fits: tuple[Scored, ...]
    searches: tuple[Search, ...]
    penalty: Penalty
    unfolded: Unfolded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Magnitudes:
    """Of every live atom in SI: the estimate if active, else what adding it alone would give (NaN where unseen).

    Attributes
    ----------
    value, variance : (n_live,).
    minimal_detectable : (n_live,) found with 90 % power at 1 % false alarms shared by the dictionary.
    covariance : (n_active, n_active) of the support.
    degrees : of freedom of the intervals.
    """

    value: FloatArray
    variance: FloatArray
    minimal_detectable: FloatArray
    covariance: FloatArray
    degrees: float


def choose(study: Study, *, evidence: float, extended: bool, max_active: int | None, report: Report = silent) -> Answer:
    """Search supports at every order on common rows and take the best.

    Parameters
    ----------
    study : the scaled record.
    evidence, extended : see `Penalty`.
    max_active : largest support; None for no limit.
    report : told how far it is.
    """
    candidates = range(len(study.live))
    penalty = Penalty(
        n_rows=study.n_rows,
        n_effective=float(study.n_rows),
        n_candidates=len(study.live),
        evidence=evidence,
        extended=extended,
    )
    preparing, searching = shares(report, 1, 4)
    problems = [study.problem(order) for order, _ in parts(preparing, study.orders)]
    searches = search_orders(problems, candidates, penalty, max_active=max_active, report=searching)
    answer = _answer(study, searches, penalty)
    per_output = answer.best.fit.n_parameters / study.layout.y.shape[1]
    effective = max(effective_rows(answer.unfolded.error), 2.0 * per_output)
    if effective >= study.n_rows:
        return answer
    penalty = replace(penalty, n_effective=effective)
    return _answer(study, tuple(_rescored(search, penalty) for search in searches), penalty)


def by_threshold(study: Study, answer: Answer, threshold: float) -> Answer:
    """Return the answer whose support is the thesis's rule on all magnitudes at once: |z| / norm(z) > threshold.

    Raises
    ------
    ValueError : the window has too few rows to estimate all magnitudes at once.
    """
    everything = tuple(range(len(study.live)))
    problems = [study.problem(order) for order in study.orders]
    whole = [full_support(problem, everything, answer.penalty) for problem in problems]
    if not all(whole):
        raise ValueError("too few samples to estimate all magnitudes at once")
    scored = min((one for one in whole if one is not None), key=lambda one: one.criterion)
    z = scored.fit.z * study.magnitude_unit
    atoms = tuple(int(j) for j in np.flatnonzero(np.abs(z) > threshold * np.linalg.norm(z)))
    start = replace(scored.fit, atoms=atoms, z=scored.fit.z[list(atoms)])
    searches = []
    for search in answer.searches:
        found = _at(study, replace(search, visited=()), start, answer.penalty)
        none = search.of(())
        searches.append(replace(search, visited=(found,) if none is None or not atoms else (none, found)))
    fits = tuple(search.visited[-1] for search in searches)
    best = min(fits, key=lambda one: one.criterion)
    return replace(answer, best=best, fits=fits, searches=tuple(searches), unfolded=unfold(study.layout, best.fit))


def without(study: Study, answer: Answer, atom: int) -> Answer:
    """Return the best answer among the supports visited that leave an atom out."""
    searches = tuple(
        replace(search, visited=tuple(scored for scored in search.visited if atom not in scored.fit.atoms))
        for search in answer.searches
    )
    return _answer(study, searches, answer.penalty)


def deviance(study: Study, answer: Answer, atom: int) -> float:
    """Return twice the log likelihood ratio of the log with an active atom and without, at the chosen order."""
    best = answer.best.fit
    kept = [n for n, other in enumerate(best.atoms) if other != atom]
    smaller = replace(best, atoms=tuple(best.atoms[n] for n in kept), z=best.z[kept])
    (search,) = (search for search in answer.searches if search.order == best.order)
    return answer.penalty.n_effective * (_at(study, search, smaller, answer.penalty).fit.log_det - best.log_det)


def _answer(study: Study, searches: tuple[Search, ...], penalty: Penalty) -> Answer:
    best = min((search.best for search in searches), key=lambda scored: scored.criterion)
    return Answer(
        best=best,
        fits=tuple(_at(study, search, best.fit, penalty) for search in searches),
        searches=searches,
        penalty=penalty,
        unfolded=unfold(study.layout, best.fit),
    )


def _rescored(search: Search, penalty: Penalty) -> Search:
    visited = tuple(replace(scored, criterion=penalty.criterion(scored.fit)) for scored in search.visited)
    return replace(search, visited=visited)


def _at(study: Study, search: Search, fit: Fit, penalty: Penalty) -> Scored:
    known = search.of(fit.atoms)
    if known is not None:
        return known
    found = fit_magnitudes(study.problem(search.order), fit.atoms, fit.z)
    return Scored(criterion=penalty.criterion(found), fit=found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Averaged:
    value: FloatArray
    variance: FloatArray
    covariance: FloatArray


def magnitudes(
    study: Study, answer: Answer, coarse: Study | None, overdispersion: FloatArray, report: Report = silent
) -> Magnitudes:
    """Return the magnitudes with variances that admit what a single model does not know about itself.

    The covariance at the best order is multiplied by the overdispersion; added are the spread between orders, weighted
    by their criteria, and that between this rate and half of it, as far as sampling does not explain it.

    Parameters
    ----------
    coarse : the study at half the rate, None where that is not feasible.
    overdispersion : (n_live,) see `elsewhere`.
    report : told how far it is.
    """
    here, fitting, there = shares(report, 1, 1, 1)
    at = _averaged(study, answer.fits, overdispersion, here)
    variance = at.variance.copy()
    if coarse is not None:
        active = list(answer.best.fit.atoms)
        start = at.value[active] / coarse.magnitude_unit[active]
        fits = [fit_magnitudes(coarse.problem(order), active, start) for order, _ in parts(fitting, coarse.orders)]
        penalty = replace(answer.penalty, n_rows=coarse.n_rows, n_effective=float(coarse.n_rows))
        scored = [Scored(criterion=penalty.criterion(fit), fit=fit) for fit in fits]
        other = _averaged(coarse, scored, overdispersion, there)
        excess = (other.value - at.value) ** 2 - np.maximum(at.variance, other.variance)
        variance += RATE_WEIGHT * np.nan_to_num(np.maximum(excess, 0.0))
    degrees = max(answer.penalty.n_effective - answer.best.fit.n_parameters / study.layout.y.shape[1], 2.0)
    wider = np.sqrt(variance / np.where(at.variance > 0, at.variance, 1.0))[list(answer.best.fit.atoms)]
    return Magnitudes(
        value=at.value,
        variance=variance,
        minimal_detectable=_deviations(answer.penalty) * np.sqrt(variance),
        covariance=at.covariance * np.outer(wider, wider),
        degrees=degrees,
    )


def magnitudes_of(study: Study, scored: Scored, penalty: Penalty) -> Magnitudes:
    """Return the magnitudes of one fit, nothing averaged."""
    at = _averaged(study, [scored], np.ones(len(study.live)))
    return Magnitudes(
        value=at.value,
        variance=at.variance,
        minimal_detectable=_deviations(penalty) * np.sqrt(at.variance),
        covariance=at.covariance,
        degrees=max(study.n_rows - scored.fit.n_parameters / study.layout.y.shape[1], 2.0),
    )


def _deviations(penalty: Penalty) -> float:
    charge = penalty.per_parameter + penalty.per_atom
    return detectable_deviations(penalty.n_candidates, charge=charge, false_alarm=FALSE_ALARM, power=POWER)


def _averaged(study: Study, fits: Sequence[Scored], overdispersion: FloatArray, report: Report = silent) -> _Averaged:
    """The best order's magnitudes with the spread of the others around them."""
    criteria = np.array([scored.criterion for scored in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    best = int(np.argmin(criteria))
    keep = [n for n in range(len(fits)) if criteria[n] - criteria[best] < CLOSE]
    layers = {n: _one(study, fits[n].fit, overdispersion) for n, _ in parts(report, keep)}
    value, _, cov = layers[best]
    spread = np.array([layers[n][1] + (layers[n][0] - value) ** 2 for n in keep])
    weight = weights[keep, None] * np.isfinite(spread)
    total = weight.sum(axis=0)
    variance = np.where(total > 0.0, np.nansum(weight * np.nan_to_num(spread), axis=0), np.nan)
    variance /= np.where(total > 0.0, total, 1.0)
    active = list(fits[best].fit.atoms)
    own = np.diag(cov)
    wider = np.sqrt(variance[active] / np.where(own > 0.0, own, 1.0))
    return _Averaged(value=value, variance=variance, covariance=cov * np.outer(wider, wider))


def _one(study: Study, fit: Fit, overdispersion: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Magnitudes and variances of all live atoms at one fit, and the covariance of the support, in SI."""
    unfolded = unfold(study.layout, fit)
    single = single_additions(fit, unfolded)
    scaled = covariance(fit, unfolded)
    value, variance = single.magnitude.copy(), single.variance.copy()
    active = list(fit.atoms)
    value[active], variance[active] = fit.z, np.diag(scaled)
    unit = study.magnitude_unit
    wider = np.sqrt(overdispersion[active]) * unit[active]
    return value * unit, variance * overdispersion * unit**2, scaled * np.outer(wider, wider)
