"""The audit of a dictionary on a log: what the predictor of the log leaves of each signal, and how large it must be."""

from __future__ import annotations

import numpy as np

from ..conditioning import SAMPLES_PER_CYCLE
from ..config import Config
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..kernels.coherence import whiten
from ..study import Intake, take_in
from ..study.predicted import Predicted, about_the_log, predicted, without_injected
from .comparison import advised, compare, own_channel, sentences
from .definition import Span, fastest_hz, unit_of
from .entries import Limits, Listing, entries, reasons_of, remarks_of
from .result import Audit, AuditModel

__all__ = ["audit_on_log"]


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
    intake = take_in(without_injected(log), dictionary, config)
    fitted = predicted(intake, config)
    listing = _listing(intake, fitted)
    limits = _limits(intake, fitted)
    seen = np.isfinite(limits.minimal_detectable)
    study, unfolded = fitted.study, fitted.unfolded
    time_s = study.conditioned.time_s[study.layout.first :]
    names = [listing.names[j] for j in listing.live]
    G = whiten(unfolded.signatures, fitted.fit.sigma) * seen
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
        model=_model(fitted, config),
        fastest_hz=fastest,
        rate_needed_hz=None if fastest is None else SAMPLES_PER_CYCLE * fastest,
        atoms=entries(listing, signatures, limits),
        signatures=signatures,
        notes=(
            *sentences(signatures, found),
            *about_the_log(log, intake, fitted),
        ),
    )


def _listing(intake: Intake, fitted: Predicted) -> Listing:
    conditioned, study = intake.conditioned, fitted.study
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


def _limits(intake: Intake, fitted: Predicted) -> Limits:
    theta = intake.conditioned.theta[:, :, list(intake.live)]
    peak = np.max(np.abs(theta), axis=(0, 1))
    return Limits(minimal_detectable=fitted.minimal_detectable, peak=peak, visible=fitted.visible)


def _model(fitted: Predicted, config: Config) -> AuditModel:
    spread = np.sqrt(np.mean(fitted.unfolded.error**2, axis=0)) * fitted.study.unit
    return AuditModel(
        inputs=config.inputs,
        outputs=config.outputs,
        order=fitted.fit.order,
        feedthrough=fitted.study.layout.feedthrough,
        noise_sd=dict(zip(config.outputs, spread.tolist(), strict=True)),
    )
