"""The result over time: signals, residuals, the plain 5-sigma test, and the comparison with injected faults."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..faults import Fault, active_samples, unit_signal
from ..faults.shapes import ADDITIVE
from ..faults.truth import Comparison, compare_faults, is_same_fault, name_of
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.low_pass import decimate
from ..kernels.whiteness import autocorrelation, exceedances, ljung_box, robust_sd
from .preprocessing.window import PreparedWindow
from .result import OutputSeries, ResidualSummary
from .selection import MethodResult

# An injected fault is an entry of the dictionary if it differs from a multiple of it by less than resampling does.
SAME_SIGNAL = 1e-6
AT_ONCE = 100_000  # samples of which the faults are made at once, for memory
MAX_LAGS = 40  # of the autocorrelation: over more the Ljung-Box test loses power; chosen without tuning record


def output_series(
    window: PreparedWindow, outcome: MethodResult, true: Mapping[str, FloatArray]
) -> tuple[OutputSeries, ...]:
    """Return measured, corrected and predicted signals of every output, in SI.

    Parameters
    ----------
    true : injected fault by output, see `true_faults`.
    """
    y = window.signals.y
    atoms = list(outcome.atoms)
    entries, every = [window.live[n] for n in atoms], window.signals.theta
    fault, variance = np.zeros(y.shape), np.zeros(y.shape)
    for start in range(0, len(y) if atoms else 0, AT_ONCE):
        rows = slice(start, min(start + AT_ONCE, len(y)))
        theta = every.array[rows, :, entries]
        fault[rows] = theta @ outcome.magnitudes.value[atoms]
        variance[rows] = np.einsum("koi,ij,koj->ko", theta, outcome.magnitudes.covariance, theta)
    for course in outcome.free:
        if course.declared:
            fault[:, course.output] += course.value
            variance[:, course.output] += course.sd**2
    spread = np.sqrt(np.maximum(variance, 0.0, out=variance), out=variance)
    error, plain = (_with_head(rows, len(y)) for rows in (outcome.error, outcome.plain_error))
    return tuple(
        OutputSeries(
            channel=name,
            unit=window.log.channel(name).unit,
            measured=_read_only(y[:, i]),
            fault=_read_only(fault[:, i]),
            fault_sd=_read_only(spread[:, i]),
            prediction_error=_read_only(error[:, i]),
            plain_residual=_read_only(plain[:, i]),
            true_fault=frozen_array(true[name]) if name in true else None,
        )
        for i, name in enumerate(window.outputs)
    )


def with_heads(outcome: MethodResult, n_samples: int) -> MethodResult:
    """Return the result with errors that are the end of arrays (n_samples, n_outputs), NaN before the first row."""
    first = n_samples - len(outcome.error)
    error, plain = (_with_head(rows, n_samples)[first:] for rows in (outcome.error, outcome.plain_error))
    return replace(outcome, error=error, plain_error=plain)


def _with_head(rows: FloatArray, n_samples: int) -> FloatArray:
    """Return (n_samples, n_outputs) rows behind samples of NaN; the same array where they are the end of one."""
    known, first = rows.base, n_samples - len(rows)
    if isinstance(known, np.ndarray) and known.shape == (n_samples, *rows.shape[1:]) and np.isnan(known[:first]).all():
        return known
    whole = np.full((n_samples, *rows.shape[1:]), np.nan)
    whole[first:] = rows
    return whole


def _read_only(values: FloatArray) -> FloatArray:
    """Return values that nobody else writes to, read-only without a copy: of a day at 100 Hz each is 70 MB."""
    view = values.view()
    view.setflags(write=False)
    return view


def residual_summaries(window: PreparedWindow, outcome: MethodResult) -> tuple[ResidualSummary, ...]:
    """Return whiteness of the prediction error and the alarms of the plain 5-sigma test, per output."""
    time_s = window.signals.time_s[len(window.signals.time_s) - len(outcome.error) :]
    n_lags = max(1, min(MAX_LAGS, len(outcome.error) // 4))
    return tuple(
        ResidualSummary(
            channel=name,
            lags=tuple(range(1, n_lags + 1)),
            autocorrelation=tuple(float(r) for r in autocorrelation(error, n_lags)),
            band=1.96 / float(np.sqrt(len(error))),
            ljung_box_p=ljung_box(error, n_lags, outcome.order),
            plain_alarms_s=tuple(float(time_s[k]) for k in exceedances(plain)),
            plain_sd=robust_sd(plain),
        )
        for name, error, plain in zip(window.outputs, outcome.error.T, outcome.plain_error.T, strict=True)
    )


def true_faults(window: PreparedWindow) -> dict[str, FloatArray]:
    """Return the injected fault signal of every output, filtered as the log is; empty where the log has no truth."""
    truth = window.log.truth
    if truth is None:
        return {}
    signals = {}
    for name in window.outputs:
        measured = window.log.channel(name).values
        signals[name] = decimate(measured - truth.clean.get(name, measured), window.signals.factor, window.lowpass)
    return signals


def against_truth(window: PreparedWindow, outcome: MethodResult, series: Sequence[OutputSeries]) -> Comparison | None:
    """Compare with the injected faults; None where the log has no truth."""
    truth = window.log.truth
    if truth is None:
        return None
    declared = {window.names[window.live[n]]: float(outcome.magnitudes.value[n]) for n in outcome.atoms}
    courses = [course for course in outcome.free if course.declared]
    declared |= {window.names[course.entry]: float(course.value[course.peak]) for course in courses}
    wanted: dict[int, float] = {}
    unknown: list[str] = []
    time_s, start_s = window.native.time_s, window.window_start_s
    # No file is opened because a log names it.
    named = {os.path.abspath(fault.file) for fault in window.faults if fault.file is not None}
    for fault in truth.faults:
        entry = None if fault.shape in ADDITIVE else _same_entry(window, fault)
        if entry is not None:
            wanted[entry] = wanted.get(entry, 0.0) + fault.magnitude
            continue
        if fault.shape not in ADDITIVE or (fault.file is not None and os.path.abspath(fault.file) not in named):
            unknown += [name_of(fault)] if active_samples(fault, time_s).any() else []
            continue
        channel = window.log.channel(fault.channel).name
        signal = fault.magnitude * unit_signal(fault, time_s, window_start_s=start_s)
        if not np.any(signal):
            continue
        entry, z = _entry_of(window, channel, signal)
        beginning = (course for course in courses if _begins_as(window, course.entry, channel, fault.onset_s))
        course = next(beginning, None)
        if entry is None and course is not None:
            wanted[course.entry] = float(signal[np.argmax(np.abs(signal))])
        elif entry is None:
            unknown.append(name_of(fault))
        else:
            wanted[entry] = wanted.get(entry, 0.0) + z
    # Variance accounted for of the fault (thesis eq. 5-2), %; None where there is no fault in the window.
    vaf_fault: dict[str, float | None] = {}
    for output in series:
        true, vaf = output.true_fault, None
        if true is not None and np.any(true):
            vaf = float(max(0.0, 100.0 * (1.0 - np.sum((true - output.fault) ** 2) / np.sum(true**2))))
        vaf_fault[output.channel] = vaf
    injected = {window.names[j]: z for j, z in wanted.items() if z != 0.0}
    return replace(compare_faults(declared, injected, unknown=unknown), vaf_fault=vaf_fault)


def _same_entry(window: PreparedWindow, fault: Fault) -> int | None:
    """Return the live entry that is a fault, None where there is none."""
    for j in window.live:
        entry = window.faults[j]
        if is_same_fault(replace(entry, channel=window.log.channel(entry.channel).name), fault):
            return j
    return None


def _begins_as(window: PreparedWindow, entry: int, channel: str, onset_s: float) -> bool:
    """Say whether an entry is of a channel and begins at an onset, to a sample of the analysis."""
    fault = window.faults[entry]
    near = abs(fault.onset_s - onset_s) * window.signals.rate_hz <= 1.0
    return near and window.log.channel(fault.channel).name == channel


def _entry_of(window: PreparedWindow, channel: str, signal: FloatArray) -> tuple[int | None, float]:
    """Return the live dictionary entry whose multiple a fault signal is, None where there is none, and the multiple."""
    for j in window.live:
        fault = window.faults[j]
        if fault.channel != channel:
            continue
        atom = unit_signal(fault, window.native.time_s, window_start_s=window.window_start_s)
        if not np.any(atom):
            continue
        z = float(atom @ signal) / float(atom @ atom)
        if np.linalg.norm(signal - z * atom) <= SAME_SIGNAL * np.linalg.norm(signal):
            return j, z
    return None, 0.0
