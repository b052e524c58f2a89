"""Identification from end to end: take in, estimate by one of the two methods, decide, lay out the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..conditioning import condition, is_exact
from ..config import Config
from ..dictionary import Dictionary
from ..errors import LogError
from ..faults import magnitude_unit, physical
from ..flightlog import FlightLog
from ..kernels.covariance import unfold
from ..kernels.selection import Scored
from ..result import (
    Candidate,
    Decision,
    FaultEstimate,
    IdentifyResult,
    LogSummary,
    ModelSummary,
    SolverSummary,
)
from .elsewhere import overdispersion
from .estimation import Answer, Magnitudes, choose, deviance, magnitudes, magnitudes_of, without
from .intake import Intake, lowpass_of, take_in
from .notes import STRONG, blind, near_miss_note, notes_of, rivals
from .published import published
from .series import Reconstruction, against_truth, output_series, residuals, true_faults
from .study import Study, feasible_orders, floor_of, prepare

__all__ = ["identify"]

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """What either method hands on: the support, its fit, magnitudes of all live atoms, and how it was computed."""

    scored: Scored
    plain: Scored
    magnitudes: Magnitudes
    orders: tuple[int, ...]
    criterion_no_fault: tuple[float, ...]
    criterion_best: tuple[float, ...]
    solver: SolverSummary
    notes: tuple[str, ...]


def identify(log: FlightLog, dictionary: Dictionary, config: Config) -> IdentifyResult:
    """Identify the faults of a dictionary in a log.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : the method does not do what is asked.
    """
    intake = take_in(log, dictionary, config)
    study = _study(intake, config)
    found = _published(intake, study, config) if config.method == "risro" else _likelihood(intake, study, config)
    return _laid_out(intake, study, config, found)


def _study(intake: Intake, config: Config) -> Study:
    model = config.model
    wanted = model.order if isinstance(model.order, int) else model.orders
    widths = (len(config.inputs), len(config.outputs))
    orders = feasible_orders(intake.log.path, len(intake.conditioned.time_s), wanted, widths)
    feedthrough = config.method == "ml" if model.feedthrough is None else model.feedthrough
    return prepare(
        intake.conditioned,
        intake.live,
        orders=orders,
        feedthrough=feedthrough,
        floor=floor_of(intake.conditioned),
        centred=config.conditioning.detrend == "constant",
    )


def _coarse(intake: Intake, study: Study, config: Config) -> Study | None:
    """The same study at half the rate, None where it is exact there is nothing to learn, or it is too short."""
    if intake.choice.factor == 1 and is_exact(intake.record):
        return None
    try:
        conditioned = condition(intake.record, 2 * intake.choice.factor, lowpass_of(config))
        widths = (len(config.inputs), len(config.outputs))
        orders = feasible_orders(intake.log.path, len(conditioned.time_s), study.orders, widths)
    except LogError:
        return None
    return prepare(
        conditioned,
        study.live,
        orders=orders,
        feedthrough=study.layout.feedthrough,
        floor=study.floor,
        centred=config.conditioning.detrend == "constant",
    )


def _likelihood(intake: Intake, study: Study, config: Config) -> _Found:
    """Choose support and order; decline what does not stand out, and what another order or rate would not confirm."""
    coarse = _coarse(intake, study, config)
    names = [intake.names[j] for j in study.live]
    answer = choose(
        study,
        evidence=config.selection.evidence,
        extended=config.selection.criterion == "ebic",
        max_active=config.selection.max_active,
    )
    dispersion = overdispersion(intake, study, answer.best.fit, lowpass_of(config))
    estimates = magnitudes(study, answer, coarse, dispersion)
    notes: list[str] = []
    while (declined := _declined(study, answer, estimates, dispersion)) is not None:
        atom, reason = declined
        notes.append(f"'{names[atom]}' is not declared: {reason}")
        answer = without(study, answer, atom)
        estimates = magnitudes(study, answer, coarse, dispersion)
    for rival in rivals(answer)[:1]:
        here = _names(names, answer.best.fit.atoms)
        notes.append(
            f"{_names(names, rival.fit.atoms)} would explain the log nearly as well as {here} "
            f"(criterion {rival.criterion - answer.best.criterion:.1f} worse, {STRONG:.1f} would be strong evidence)"
        )
    near = near_miss_note(names, answer)
    fit = answer.best.fit
    return _Found(
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
    if np.min(ratio) < _quantile(estimates):
        return atoms[
            int(np.argmin(ratio))
        ], "its magnitude changes with order and rate of the model by as much as its size"
    return None


def _quantile(estimates: Magnitudes) -> float:
    return float(special.stdtrit(estimates.degrees, 0.5 + CONFIDENCE / 2.0))


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


def _published(intake: Intake, study: Study, config: Config) -> _Found:
    run = published(study, config)
    best = min(run.scored, key=lambda scored: scored.criterion)
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
    return _Found(
        scored=best,
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


def _laid_out(intake: Intake, study: Study, config: Config, found: _Found) -> IdentifyResult:
    outputs = config.outputs
    atoms = found.scored.fit.atoms
    unfolded = unfold(study.layout, found.scored.fit)
    reconstruction = Reconstruction(
        atoms=atoms,
        z=found.magnitudes.value[list(atoms)],
        covariance=found.magnitudes.covariance,
        unfolded=unfolded,
        plain=unfold(study.layout, found.plain.fit),
    )
    true = true_faults(intake, lowpass_of(config), outputs)
    series = output_series(intake, study, reconstruction, true, outputs)
    tests = residuals(study, series, found.scored.fit.order)
    decision, why = _decision(study, found)
    conditioned = study.conditioned
    return IdentifyResult(
        log=LogSummary(
            path=intake.log.path,
            rate_hz=conditioned.rate_hz,
            n_samples=len(conditioned.time_s),
            start_s=float(conditioned.time_s[0]),
            stop_s=float(conditioned.time_s[-1]),
            native_rate_hz=intake.native_rate_hz,
        ),
        decision=decision,
        faults=_estimates(intake, study, found),
        candidates=_candidates(intake, study, found),
        model=ModelSummary(
            order=found.scored.fit.order,
            rate_hz=conditioned.rate_hz,
            feedthrough=study.layout.feedthrough,
            inputs=config.inputs,
            outputs=outputs,
            noise_sd={
                name: float(np.sqrt(np.mean(unfolded.error[:, i] ** 2)) * study.unit[i])
                for i, name in enumerate(outputs)
            },
            orders=found.orders,
            criterion_no_fault=found.criterion_no_fault,
            criterion_best=found.criterion_best,
        ),
        vaf_output={
            name: float(100.0 * (1.0 - np.var(unfolded.error[:, i]) / np.var(study.layout.y[study.layout.first :, i])))
            for i, name in enumerate(outputs)
        },
        solver=found.solver,
        notes=(*why, *found.notes, *notes_of(intake, study, found.magnitudes, tests, unfolded.condition_number)),
        time_s=conditioned.time_s,
        inputs={name: conditioned.u[:, i] for i, name in enumerate(config.inputs)},
        input_units={name: intake.log.channel(name).unit for name in config.inputs},
        outputs=series,
        residuals=tests,
        truth=against_truth(intake, study, reconstruction, series),
    )


def _decision(study: Study, found: _Found) -> tuple[Decision, list[str]]:
    if found.scored.fit.atoms:
        return "fault", []
    if all(blind(study, found.magnitudes)):
        return "not_identifiable", [
            "the data cannot answer: in this window no fault of the dictionary smaller than the output's movement "
            "leaves a trace that the dynamics do not explain; choose a window with the onset and a manoeuvre inside"
        ]
    return "no_fault", []


def _estimates(intake: Intake, study: Study, found: _Found) -> tuple[FaultEstimate, ...]:
    quantile = _quantile(found.magnitudes)
    estimates = []
    for j in found.scored.fit.atoms:
        fault = intake.faults[study.live[j]]
        z, sd = float(found.magnitudes.value[j]), float(np.sqrt(found.magnitudes.variance[j]))
        unit = intake.log.channel(fault.channel).unit
        value, physical_unit = physical(fault, z, unit)
        estimates.append(
            FaultEstimate(
                name=intake.names[study.live[j]],
                fault=fault,
                magnitude=z,
                unit=magnitude_unit(fault, unit),
                physical_value=value,
                physical_unit=physical_unit,
                sd=sd,
                ci95=(z - quantile * sd, z + quantile * sd),
            )
        )
    return tuple(estimates)


def _candidates(intake: Intake, study: Study, found: _Found) -> tuple[Candidate, ...]:
    place = {entry: j for j, entry in enumerate(study.live)}
    hidden = blind(study, found.magnitudes)
    candidates = []
    for entry, fault in enumerate(intake.faults):
        j = place.get(entry)
        known = fault.channel in intake.log.channels
        note = intake.reasons.get(entry)
        if j is not None and hidden[j]:
            note = "only a fault larger than the output's whole movement would be seen in this window"
        candidates.append(
            Candidate(
                name=intake.names[entry],
                channel=fault.channel,
                active=j in found.scored.fit.atoms if j is not None else False,
                magnitude=None if j is None else _finite(found.magnitudes.value[j]),
                unit=magnitude_unit(fault, intake.log.channel(fault.channel).unit if known else ""),
                sd=None if j is None else _finite(np.sqrt(found.magnitudes.variance[j])),
                minimal_detectable=None if j is None else _finite(found.magnitudes.minimal_detectable[j]),
                note=note,
            )
        )
    return tuple(candidates)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
