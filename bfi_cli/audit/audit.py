"""The audit of a dictionary, by its raw signals or by their signatures in the prediction errors of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..config import Config
from ..dictionary import Dictionary, dead_reason, no_signal, signals
from ..errors import ConfigError, DictionaryError
from ..faults.shapes import ADDITIVE
from ..flightlog import FlightLog
from ..kernels.covariance import whiten
from ..model.preprocessing.fault_free_model import about_the_log, fit_fault_free, without_injected_faults
from ..model.preprocessing.magnitudes import fault_free_limits
from ..model.preprocessing.window import prepare_window, unusable_atoms, with_inputs_of
from ..model.result import LogSummary
from ..notes import Note
from ..quantities.channels import unit_of
from .comparison import advised, compare, own_channel, sentences
from .entries import (
    Audit,
    AuditWindow,
    entries,
    fastest_hz,
    reasons_of,
    remarks_of,
    searched_on_log,
    span_of,
    unknown_channels,
    with_kinds,
    without_signals,
)

# Rate of an audit without a log: 2000 samples, two per pixel of a figure, and eight per cycle of the fastest fault draw
# every shape; or 100 Hz, that of a common recorder, if all signals together then have at most two million values.
SAMPLES, DRAWN_PER_CYCLE = 2000, 8.0
FINE_HZ, FINE_VALUES = 100.0, 2_000_000
# With more faults or values nothing is compared: coherence or signals would take many seconds and hundreds of MB.
MOST_ATOMS, MOST_VALUES = 1000, 20_000_000


def audit_dictionary(dictionary: Dictionary, config: Config, *, duration_s: float | None = None) -> Audit:
    """Audit a dictionary by its definitions and the signals of the entries with stated onsets.

    Parameters
    ----------
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : its window, its orders and, if it is a number, its rate are used.
    duration_s : length of the window; None for a window that shows every fault.

    Raises
    ------
    DictionaryError : no fault shows in the window, or a sample file cannot be used.
    ConfigError : the window is empty, or its end is given twice.
    """
    stated = dictionary.exact
    audit = _audit_signals(stated, config, duration_s) if stated.atoms else without_signals(dictionary, config)
    if stated.atoms == dictionary.atoms:
        return audit
    kinds = dictionary.searched.atoms
    audit = replace(audit, notes=(*map(Note.limit, unknown_channels(kinds)), *audit.notes))
    return with_kinds(audit, dictionary, {fault.channel: unit_of(fault.channel) for fault in kinds})


def _audit_signals(dictionary: Dictionary, config: Config, duration_s: float | None) -> Audit:
    span, why = _window(dictionary, config, duration_s)
    faults = dictionary.resolved(span.start_s)
    names = tuple(fault.called for fault in faults)
    length_s = span.stop_s - span.start_s
    affordable_hz = min(FINE_HZ, FINE_VALUES / (length_s * len(faults)))
    rate_hz = span.rate_hz or max(SAMPLES / length_s, DRAWN_PER_CYCLE * (fastest_hz(faults) or 0.0), affordable_hz)
    n_samples = max(2, round(length_s * rate_hz))
    few = len(faults) <= MOST_ATOMS and n_samples * len(faults) <= MOST_VALUES
    time_s = span.start_s + np.arange(n_samples if few else 0) / rate_hz
    channels = list(dict.fromkeys(fault.channel for fault in faults))
    theta = signals(faults, time_s, channels, window_start_s=span.start_s) if few else None
    values = None if theta is None else own_channel(theta)
    dead = ((j, dead_reason(fault, span.start_s, span.stop_s)) for j, fault in enumerate(faults))
    reasons = {j: reason for j, reason in dead if reason is not None}
    reasons |= {j: no_signal(fault) for j, fault in enumerate(faults) if fault.shape not in ADDITIVE}
    if theta is not None and values is not None:
        rest = [j for j in range(len(faults)) if j not in reasons]
        reasons |= advised(unusable_atoms(theta, names, rest), values)
    reasons = reasons_of(faults, names, reasons)
    live = {j: fault for j, fault in enumerate(faults) if j not in reasons}
    if not live:
        raise DictionaryError(f"{dictionary.path}: no live atom: {reasons[min(reasons)]}")
    seen = None if values is None else values[:, list(live)]
    order = config.model.order if isinstance(config.model.order, int) else max(config.model.orders)
    remarks = remarks_of(live, span, seen, largest_model=order, n_outputs=len(channels))
    signatures = None
    warnings = [
        f"{len(faults)} faults over this window are too many signals to compare; "
        "give a shorter --duration, a lower --rate, or larger steps in the grids"
    ]
    if theta is not None and seen is not None:
        signatures = compare([names[j] for j in live], time_s, seen, theta[:, :, list(live)].reshape(-1, len(live)))
        warnings = sentences(signatures)
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        window=LogSummary(
            path="",
            rate_hz=rate_hz,
            native_rate_hz=rate_hz,
            n_samples=n_samples,
            start_s=span.start_s,
            stop_s=span.stop_s,
        ),
        why=why,
        atoms=entries(faults, [unit_of(fault.channel) for fault in faults], reasons, remarks, signatures),
        signatures=signatures,
        notes=tuple(map(Note.limit, (*unknown_channels(faults), *warnings))),
    )


def _window(dictionary: Dictionary, config: Config, duration_s: float | None) -> tuple[AuditWindow, str]:
    """Return the window, with the rate if that is stated, and the reason for its length."""
    from_s, to_s, asked = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    if duration_s is not None and to_s is not None:
        raise ConfigError(f"--duration: the window ends at {to_s:g} s already; keep --duration or --to")
    if duration_s is not None and not 0.0 < duration_s < np.inf:
        raise ConfigError(f"--duration: must be more than 0 s, got {duration_s:g}; give the length of a window")
    shown = span_of(dictionary.resolved(from_s or 0.0), from_s, from_zero=dictionary.relative_to == "window")
    start_s, stop_s = shown.start_s, shown.stop_s
    why = "until every fault has shown its shape; another length is --duration S"
    if duration_s is not None:
        to_s = start_s + duration_s
    if to_s is not None:
        stop_s, why = to_s, "as asked for"
    if stop_s <= start_s:
        raise ConfigError(f"--to: the window starts at {start_s:g} s, got {stop_s:g}; give a later --to, or --from")
    return AuditWindow(start_s=start_s, stop_s=stop_s, rate_hz=None if isinstance(asked, str) else float(asked)), why


def audit_on_log(log: FlightLog, dictionary: Dictionary, config: Config) -> Audit:
    """Audit a dictionary on a log.

    The predictor is estimated without fault terms, at the order with the best criterion. The minimal detectable
    magnitudes are those of `identify` if it declares nothing; for kinds of fault those of its search over all onsets.

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
    config, clean = with_inputs_of(log, config), without_injected_faults(log)
    stated = dictionary.exact
    if stated.atoms == dictionary.atoms:
        return _audit_entries(log, clean, stated, config)
    searched, reasons = searched_on_log(clean, dictionary, config)
    if stated.atoms:
        audit = _audit_entries(log, clean, stated, config)
    elif searched is not None:
        audit = without_signals(dictionary, config, searched)
    else:
        raise DictionaryError(f"{dictionary.path}: no live atom: {reasons[0]}")
    units = {fault.channel: clean.unit_of(fault.channel) for fault in dictionary.searched.atoms}
    return with_kinds(audit, dictionary, units, reasons, searched)


def _audit_entries(log: FlightLog, clean: FlightLog, dictionary: Dictionary, config: Config) -> Audit:
    """Return the audit of entries that state their onsets; `clean` is the log without faults."""
    window = prepare_window(clean, dictionary, config)
    fitted = fit_fault_free(window, config)
    given, faults, names, live = window.signals, window.faults, window.names, list(window.live)
    theta = np.asarray(given.theta)
    first = fitted.regression.layout.first
    span = AuditWindow(
        start_s=window.window_start_s,
        stop_s=window.log.span_s[1],
        rate_hz=given.rate_hz,
        lags=first,
    )
    reasons = reasons_of(faults, names, advised(window.reasons, own_channel(theta)))
    remarks = remarks_of(
        {j: faults[j] for j in live},
        span,
        own_channel(theta[first:, :, live]),
        largest_model=max(fitted.regression.orders),
        n_outputs=len(window.outputs),
    )
    units = [window.log.unit_of(fault.channel) for fault in faults]
    left, before = np.linalg.norm(fitted.unfolded.signatures, axis=(0, 1)), fitted.unfolded.raw_norm
    visible = left / np.where(before > 0.0, before, 1.0)
    detectable, exactly = fault_free_limits(window, config)
    peak = np.max(np.abs(theta[:, :, live]), axis=(0, 1))
    limits = list(zip(detectable.tolist(), peak.tolist(), visible.tolist(), strict=True))
    seen = np.isfinite(exactly)
    signatures = compare(
        [names[j] for j in live],
        fitted.regression.rows_s,
        own_channel(fitted.unfolded.signatures * fitted.regression.unit[:, None]) * seen,
        whiten(fitted.unfolded.signatures, fitted.fit.sigma) * seen,
    )
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        window=window.summary,
        why=window.rate_reason,
        model=fitted.model,
        atoms=entries(faults, units, reasons, remarks, signatures, limits),
        signatures=signatures,
        notes=(*map(Note.limit, sentences(signatures)), *about_the_log(log, window, fitted)),
    )
