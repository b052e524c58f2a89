"""The audit of a dictionary on a log: what the predictor of the log leaves of each signal, and how large it must be."""

from __future__ import annotations

import numpy as np

from ..config import Config
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..kernels.coherence import whiten
from ..preprocessing.fault_free_model import FaultFreeModel, about_the_log, fit_fault_free, without_injected_faults
from ..preprocessing.sampling_rate import SAMPLES_PER_CYCLE
from ..preprocessing.window import PreparedWindow, prepare_window
from .comparison import advised, compare, own_channel, sentences
from .definition import Span, fastest_hz, unit_of
from .entries import Limits, Listing, entries, reasons_of, remarks_of
from .result import Audit

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
    window = prepare_window(without_injected_faults(log), dictionary, config)
    fitted = fit_fault_free(window, config)
    listing = _listing(window, fitted)
    theta = window.signals.theta[:, :, list(window.live)]
    left = np.linalg.norm(fitted.unfolded.signatures, axis=(0, 1))
    raw_norm = fitted.unfolded.raw_norm
    limits = Limits(
        minimal_detectable=fitted.deviations * fitted.sd,
        peak=np.max(np.abs(theta), axis=(0, 1)),
        visible=left / np.where(raw_norm > 0.0, raw_norm, 1.0),
    )
    seen = np.isfinite(limits.minimal_detectable)
    signatures, alike = compare(
        [listing.names[j] for j in listing.live],
        fitted.regression.rows_s,
        own_channel(fitted.unfolded.signatures * fitted.regression.unit[:, None]) * seen,
        whiten(fitted.unfolded.signatures, fitted.fit.sigma) * seen,
    )
    fastest, summary = fastest_hz(window.faults), window.summary
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        start_s=summary.start_s,
        stop_s=summary.stop_s,
        rate_hz=summary.rate_hz,
        n_samples=summary.n_samples,
        why=window.rate.reason,
        log_path=summary.path,
        native_rate_hz=summary.native_rate_hz,
        model=fitted.model,
        fastest_hz=fastest,
        rate_needed_hz=None if fastest is None else SAMPLES_PER_CYCLE * fastest,
        atoms=entries(listing, signatures, limits),
        signatures=signatures,
        notes=(*sentences(signatures, alike), *about_the_log(log, window, fitted)),
    )


def _listing(window: PreparedWindow, fitted: FaultFreeModel) -> Listing:
    signals, first = window.signals, fitted.regression.layout.first
    log = window.log
    return Listing(
        faults=window.faults,
        names=window.names,
        units=tuple(
            log.channel(fault.channel).unit if fault.channel in log.channels else unit_of(fault.channel)
            for fault in window.faults
        ),
        reasons=reasons_of(window.faults, window.names, advised(window.reasons, own_channel(signals.theta))),
        remarks=remarks_of(
            {j: window.faults[j] for j in window.live},
            Span(
                start_s=window.window_start_s,
                stop_s=float(log.time_s[-1]) + 1.0 / log.rate_hz,
                rate_hz=signals.rate_hz,
                lags=first,
            ),
            own_channel(signals.theta[first:, :, list(window.live)]),
            largest_model=max(fitted.regression.orders),
            n_outputs=len(window.outputs),
        ),
    )
