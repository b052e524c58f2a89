"""The default method: maximum likelihood, support and order by a criterion, and what must not be declared."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..conditioning import condition
from ..config import Config
from ..errors import LogError
from ..kernels.progress import Progress, Report
from ..kernels.selection import Scored
from ..result import SolverSummary
from ..study import Intake, Study, lowpass_of, study_of
from ..study.elsewhere import overdispersion
from .estimation import Answer, Magnitudes, by_threshold, choose, deviance, magnitudes, without
from .found import Found, interval_quantile
from .notes import STRONG, near_miss_note, rivals

__all__ = ["by_likelihood"]

FloatArray = NDArray[np.float64]


def by_likelihood(intake: Intake, study: Study, config: Config, progress: Progress) -> Found:
    """Choose support and order; decline what does not stand out, and what another order or rate would not confirm."""
    coarse = _coarse(intake, study, config, partial(progress, "the record at half the rate"))
    names = [intake.names[j] for j in study.live]
    answer = choose(
        study,
        evidence=config.selection.evidence,
        extended=config.selection.criterion == "ebic",
        max_active=config.selection.max_active,
        report=partial(progress, "search for the faults"),
    )
    threshold = config.selection.threshold
    if threshold is not None:
        answer = _by_rule(intake, study, answer, threshold)
    elsewhere = partial(progress, "the same shapes elsewhere")
    dispersion = overdispersion(intake, study, answer.best.fit, lowpass_of(config), elsewhere)
    estimates = magnitudes(study, answer, coarse, dispersion, partial(progress, "magnitudes"))
    notes: list[str] = []
    while threshold is None and (declined := _declined(study, answer, estimates, dispersion)) is not None:
        atom, reason = declined
        notes.append(f"'{names[atom]}' is not declared: {reason}")
        answer = without(study, answer, atom)
        sizing = partial(progress, f"magnitudes, {len(notes)} declined")
        estimates = magnitudes(study, answer, coarse, dispersion, sizing)
    for rival in rivals(answer)[:1]:
        here = _names(names, answer.best.fit.atoms)
        notes.append(
            f"{_names(names, rival.fit.atoms)} would explain the log nearly as well as {here} "
            f"(criterion {rival.criterion - answer.best.criterion:.1f} worse, {STRONG:.1f} would be strong evidence)"
        )
    near = near_miss_note(names, answer)
    fit = answer.best.fit
    return Found(
        scored=answer.best,
        plain=_plain(answer),
        magnitudes=estimates,
        orders=study.orders if len(study.orders) > 1 else (),
        criterion_no_fault=_curve(answer, support=()),
        criterion_best=_curve(answer, support=None),
        solver=SolverSummary(
            method="ml",
            termination=fit.termination.value,
            iterations=fit.iterations,
            condition_number=answer.unfolded.condition_number,
        ),
        notes=(*notes, near) if near else tuple(notes),
    )


def _by_rule(intake: Intake, study: Study, answer: Answer, threshold: float) -> Answer:
    try:
        return by_threshold(study, answer, threshold)
    except ValueError as problem:
        raise LogError(f"{intake.log.path}: {problem}; choose a longer window or a smaller dictionary") from None


def _declined(study: Study, answer: Answer, estimates: Magnitudes, dispersion: FloatArray) -> tuple[int, str] | None:
    """Return the least certain active atom that must not be declared and why, None where all may be."""
    atoms = list(answer.best.fit.atoms)
    if not atoms:
        return None
    needed = answer.penalty.per_parameter + answer.penalty.per_atom
    margins = [deviance(study, answer, atom) / (needed * dispersion[atom]) for atom in atoms]
    if min(margins) < 1.0:
        atom = atoms[int(np.argmin(margins))]
        return (
            atom,
            "the same shape stands out nearly as much at other onsets of this window "
            f"({np.sqrt(dispersion[atom]):.1f} times what white noise would do)",
        )
    ratio = np.abs(estimates.value[atoms]) / np.sqrt(estimates.variance[atoms])
    if np.min(ratio) < interval_quantile(estimates):
        return atoms[
            int(np.argmin(ratio))
        ], "its magnitude changes with order and rate of the model by as much as its size"
    return None


def _plain(answer: Answer) -> Scored:
    none = [scored for search in answer.searches if (scored := search.of(())) is not None]
    return min(none, key=lambda scored: scored.criterion)


def _curve(answer: Answer, *, support: tuple[int, ...] | None) -> tuple[float, ...]:
    if len(answer.searches) == 1:
        return ()
    picked = (search.best if support is None else search.of(support) for search in answer.searches)
    return tuple(float("nan") if scored is None else scored.criterion for scored in picked)


def _names(names: Sequence[str], atoms: Sequence[int]) -> str:
    return " and ".join(f"'{names[j]}'" for j in atoms) if atoms else "no fault"


def _coarse(intake: Intake, study: Study, config: Config, report: Report) -> Study | None:
    """The same study at half the rate; None where the record is exact, so nothing is to be learnt, or too short."""
    if intake.exact and intake.choice.factor == 1:
        return None
    try:
        conditioned = condition(intake.record, 2 * intake.choice.factor, lowpass_of(config))
        return study_of(intake.log.path, conditioned, study.live, config, orders=study.orders, report=report)
    except LogError:
        return None
