"""From what a method found to the result: estimates, candidates, series, residuals, notes, decision."""

from __future__ import annotations

import numpy as np

from ..config import Config
from ..faults import magnitude_unit, physical
from ..kernels.covariance import FitRows, unfold
from ..result import Candidate, Decision, FaultEstimate, IdentifyResult, LogSummary, ModelSummary
from ..study import Intake, Study, lowpass_of
from .found import Found, interval_quantile
from .notes import abrupt_note, blind, edge_note, notes_of, slow_note
from .series import Reconstruction, against_truth, output_series, residuals, true_faults

__all__ = ["laid_out"]


def laid_out(intake: Intake, study: Study, config: Config, found: Found) -> IdentifyResult:
    """Return the result of an identification."""
    atoms = found.scored.fit.atoms
    unfolded = unfold(study.layout, found.scored.fit)
    reconstruction = Reconstruction(
        atoms=atoms,
        z=found.magnitudes.value[list(atoms)],
        covariance=found.magnitudes.covariance,
        unfolded=unfolded,
        plain=unfold(study.layout, found.plain.fit),
    )
    true = true_faults(intake, lowpass_of(config), config.outputs)
    series = output_series(intake, study, reconstruction, true, config.outputs)
    tests = residuals(study, series, found.scored.fit.order)
    decision, why = _decision(study, found)
    active = [study.live[j] for j in atoms]
    edge, slow = edge_note(intake, study, active), slow_note(intake, active)
    warnings = (edge, slow, *(abrupt_note(study, output) for output in series))
    general = notes_of(intake, study, found.magnitudes, tests, unfolded.condition_number)
    conditioned = study.conditioned
    return IdentifyResult(
        log=_log_summary(intake, study),
        decision=decision,
        faults=_estimates(intake, study, found),
        candidates=_candidates(intake, study, found),
        model=_model_summary(study, config, found, unfolded),
        vaf_output={
            name: float(100.0 * (1.0 - np.var(unfolded.error[:, i]) / np.var(study.layout.y[study.layout.first :, i])))
            for i, name in enumerate(config.outputs)
        },
        solver=found.solver,
        notes=(*why, *found.notes, *(note for note in warnings if note is not None), *general),
        time_s=conditioned.time_s,
        inputs={name: conditioned.u[:, i] for i, name in enumerate(config.inputs)},
        input_units={name: intake.log.channel(name).unit for name in config.inputs},
        outputs=series,
        residuals=tests,
        truth=against_truth(intake, study, reconstruction, series),
    )


def _log_summary(intake: Intake, study: Study) -> LogSummary:
    time_s = study.conditioned.time_s
    return LogSummary(
        path=intake.log.path,
        rate_hz=study.conditioned.rate_hz,
        n_samples=len(time_s),
        start_s=float(time_s[0]),
        stop_s=float(time_s[-1]),
        native_rate_hz=intake.native_rate_hz,
    )


def _model_summary(study: Study, config: Config, found: Found, unfolded: FitRows) -> ModelSummary:
    sd = np.sqrt(np.mean(unfolded.error**2, axis=0)) * study.unit
    return ModelSummary(
        order=found.scored.fit.order,
        rate_hz=study.conditioned.rate_hz,
        feedthrough=study.layout.feedthrough,
        inputs=config.inputs,
        outputs=config.outputs,
        noise_sd={name: float(sd[i]) for i, name in enumerate(config.outputs)},
        orders=found.orders,
        criterion_no_fault=found.criterion_no_fault,
        criterion_best=found.criterion_best,
    )


def _decision(study: Study, found: Found) -> tuple[Decision, list[str]]:
    if found.scored.fit.atoms:
        return "fault", []
    if all(blind(study, found.magnitudes)):
        return "not_identifiable", [
            "the data cannot answer: in this window no fault of the dictionary smaller than the output's movement "
            "leaves a trace that the dynamics do not explain; choose a window with the onset and a manoeuvre inside"
        ]
    return "no_fault", []


def _estimates(intake: Intake, study: Study, found: Found) -> tuple[FaultEstimate, ...]:
    quantile = interval_quantile(found.magnitudes)
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


def _candidates(intake: Intake, study: Study, found: Found) -> tuple[Candidate, ...]:
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
