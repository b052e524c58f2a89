"""The audit of a dictionary on a log: what the predictor of the log leaves of each signal, and how large it must be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..conditioning import SAMPLES_PER_CYCLE, is_exact
from ..config import Config
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..kernels.bilinear import Fit, fit_magnitudes
from ..kernels.coherence import detectable_deviations, whitened
from ..kernels.covariance import Unfolded, single_additions, unfold
from ..kernels.selection import Penalty
from ..kernels.whiteness import effective_rows, exceedances
from ..study import Intake, Study, study_of, take_in
from .comparison import advised, compare, own_channel, sentences
from .definition import Span, fastest_hz, unit_of
from .entries import Limits, Listing, entries, reasons_of, remarks_of
from .result import Audit, AuditModel

__all__ = ["audit_on_log"]

FALSE_ALARM = 0.01
POWER = 0.9
CLEANED = "the faults injected into the log are taken out of it: this is an audit of the log before they were injected"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Predicted:
    """The fit without fault terms, laid over its rows with the signatures of the live atoms, magnitudes in SI."""

    study: Study
    fit: Fit
    penalty: Penalty
    unfolded: Unfolded


def audit_on_log(log: FlightLog, dictionary: Dictionary, config: Config) -> Audit:
    """Audit a dictionary on a log.

    The predictor is estimated without fault terms, of the order with the best criterion. The minimal detectable
    magnitude is for each fault alone at that order: `identify` also admits the spread between orders and rates.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`; faults injected into it are taken out, others are in the way.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    intake = take_in(_clean(log), dictionary, config)
    predicted = _predicted(intake, config)
    listing = _listing(intake, predicted)
    limits = _limits(intake, predicted)
    seen = np.isfinite(limits.minimal_detectable)
    study, unfolded = predicted.study, predicted.unfolded
    time_s = study.conditioned.time_s[study.layout.first :]
    names = [listing.names[j] for j in listing.live]
    G = whitened(unfolded.signatures, predicted.fit.sigma) * seen
    signatures, found = compare(names, time_s, own_channel(unfolded.signatures * study.unit[:, None]) * seen, G)
    fastest = fastest_hz(intake.faults)
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        start_s=float(intake.conditioned.time_s[0]),
        stop_s=float(intake.conditioned.time_s[-1]),
        rate_hz=intake.conditioned.rate_hz,
        n_samples=len(intake.conditioned.time_s),
        why=intake.choice.reason,
        log_path=intake.log.path,
        native_rate_hz=intake.native_rate_hz,
        model=_model(predicted, config),
        fastest_hz=fastest,
        rate_needed_hz=None if fastest is None else SAMPLES_PER_CYCLE * fastest,
        atoms=entries(listing, signatures, limits),
        signatures=signatures,
        notes=(
            *_unseen([name for name, visible in zip(names, seen, strict=True) if not visible]),
            *sentences(signatures, found),
            *_about_the_log(intake, predicted, config.outputs),
            *([CLEANED] if log.truth is not None and log.truth.clean else []),
        ),
    )


def _clean(log: FlightLog) -> FlightLog:
    """Return the log with the clean signals it carries in place of those with injected faults."""
    clean = {} if log.truth is None else log.truth.clean
    restored = [replace(log.channel(name), values=values) for name, values in clean.items()]
    return replace(log, channels={**log.channels, **{channel.name: channel for channel in restored}}, truth=None)


def _predicted(intake: Intake, config: Config) -> _Predicted:
    conditioned = intake.conditioned
    study = study_of(intake.log.path, conditioned, (), config)
    penalty = Penalty(
        n_rows=study.n_rows,
        n_effective=float(study.n_rows),
        n_candidates=len(intake.live),
        evidence=config.selection.evidence,
        extended=config.selection.criterion == "ebic",
    )
    fits = [fit_magnitudes(study.problem(order), ()) for order in study.orders]
    best = min(fits, key=penalty.criterion)
    effective = effective_rows(unfold(study.layout, best).error)
    penalty = replace(penalty, n_effective=min(penalty.n_effective, max(effective, 2.0 * best.n_parameters)))
    best = min(fits, key=penalty.criterion)
    layout = replace(study.layout, theta=conditioned.theta[:, :, list(intake.live)] / study.unit[:, None])
    return _Predicted(study=study, fit=best, penalty=penalty, unfolded=unfold(layout, best))


def _listing(intake: Intake, predicted: _Predicted) -> Listing:
    conditioned, study = intake.conditioned, predicted.study
    reasons = reasons_of(intake.faults, intake.names, advised(intake.reasons, own_channel(conditioned.theta)))
    live = {j: intake.faults[j] for j in intake.live}
    span = Span(
        start_s=intake.window_start_s,
        stop_s=float(intake.log.time_s[-1]) + 1.0 / intake.log.rate_hz,
        rate_hz=conditioned.rate_hz,
        lags=study.layout.first,
    )
    values = own_channel(conditioned.theta[study.layout.first :, :, list(intake.live)])
    n_outputs = conditioned.y.shape[1]
    remarks = remarks_of(live, span, values, largest_model=max(study.orders), n_outputs=n_outputs)
    units = tuple(_unit(intake.log, fault.channel) for fault in intake.faults)
    return Listing(faults=intake.faults, names=intake.names, units=units, reasons=reasons, remarks=remarks)


def _unit(log: FlightLog, channel: str) -> str:
    return log.channel(channel).unit if channel in log.channels else unit_of(channel)


def _limits(intake: Intake, predicted: _Predicted) -> Limits:
    penalty, unfolded = predicted.penalty, predicted.unfolded
    needed = detectable_deviations(
        penalty.n_candidates,
        charge=penalty.per_parameter + penalty.per_atom,
        false_alarm=FALSE_ALARM,
        power=POWER,
    )
    theta = intake.conditioned.theta[:, :, list(intake.live)]
    left = np.sqrt(np.einsum("koj,koj->j", unfolded.signatures, unfolded.signatures))
    return Limits(
        minimal_detectable=needed * np.sqrt(single_additions(predicted.fit, unfolded).variance),
        peak=np.max(np.abs(theta), axis=(0, 1)),
        visible=left / np.where(unfolded.raw_norm > 0.0, unfolded.raw_norm, 1.0),
    )


def _model(predicted: _Predicted, config: Config) -> AuditModel:
    spread = np.sqrt(np.mean(predicted.unfolded.error**2, axis=0)) * predicted.study.unit
    return AuditModel(
        inputs=config.inputs,
        outputs=config.outputs,
        order=predicted.fit.order,
        feedthrough=predicted.study.layout.feedthrough,
        noise_sd=dict(zip(config.outputs, spread.tolist(), strict=True)),
    )


def _unseen(names: Sequence[str]) -> list[str]:
    return [
        f"'{name}' leaves nothing that the model's own inputs and lags do not explain; move its onset into the window"
        for name in names
    ]


def _about_the_log(intake: Intake, predicted: _Predicted, outputs: Sequence[str]) -> list[str]:
    """Say where the log makes the limits too large (a fault in it) or too small (no noise in it)."""
    if is_exact(intake.record):
        return ["the log has no noise: the minimal detectable magnitudes are those of round-off"]
    time_s = predicted.study.conditioned.time_s[predicted.study.layout.first :]
    said = []
    for i, name in enumerate(outputs):
        beyond = exceedances(predicted.unfolded.error[:, i])
        if beyond.size:
            where = f"at {time_s[beyond[0]]:.6g} s" + (
                f" and {beyond.size - 1} more samples" if beyond.size > 1 else ""
            )
            said.append(
                f"'{name}' jumps away from its prediction {where}: if that is a fault, the minimal detectable "
                "magnitudes are too large; audit on a log or window without one"
            )
    return said
