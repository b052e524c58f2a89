"""Identification from end to end: prepare the window, run the method, assemble the result over time, beside the truth.

Where the recorder's low-pass is uncertain it is a nuisance parameter, which the fault itself tells best: a step shows
the response of the recorder, which the spectra of an excerpt tell to a few tens of per cent only; without a fault
nothing depends on it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from operator import attrgetter

import numpy as np

from ..config import Config, merge
from ..decision import Conclusion, Evidence, conclude, estimate_of
from ..dictionary import Dictionary
from ..errors import ConfigError, DictionaryError, LogError
from ..faults import Fault, FaultEstimate, active_samples, unit_signal, unit_signals
from ..faults.fault import Comparison, compare_faults, is_same_fault, name_of, time_tolerance_s
from ..faults.filters import BETWEEN_RECORDERS, Filter, alternatives, recorder_low_passes
from ..faults.shapes import ADDITIVE
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.low_pass import decimate
from ..kernels.progress import Progress, unseen
from ..kernels.whiteness import autocorrelation, exceedances, ljung_box, robust_sd
from ..methods import METHODS
from ..notes import Note
from ..threads import one_thread
from .claims import claims_of_entries, hidden_atoms, warnings_of
from .maximum_likelihood import identify_by_likelihood
from .preprocessing.defaults import manoeuvres_of, tolerances_of, what_would_help
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow, prepare_window, regression_of, selects_support, with_inputs_of
from .result import IdentifyResult, ModelSummary, OutputSeries, ResidualSummary, ScanSummary, noise_of
from .selection import MethodResult


def with_likeliest_recorder(
    log: FlightLog,
    dictionary: Dictionary,
    config: Config,
    window: PreparedWindow,
    regression: RegressionData,
    outcome: MethodResult,
    progress: Progress = unseen,
) -> tuple[PreparedWindow, RegressionData, MethodResult]:
    """Return window, regression and outcome with the recorder of least criterion, where the log's is uncertain.

    The variance of every magnitude gains its spread over the recorders, each weighted by its likelihood, and what lies
    between them. What is declared depends on the recorder, so that the faults are selected anew for each, at the rate
    and orders of the first.

    Parameters
    ----------
    window, regression, outcome : with the recorder that the spectra of the log suggest.
    """
    chains = alternatives(window.filters)
    if not chains or not outcome.atoms:
        return window, regression, outcome
    alike = merge(config, {"conditioning.rate_hz": window.same_rate, "model.orders": regression.orders})
    trials = [(window, regression, outcome)]
    for k, chain in enumerate(chains):
        progress("the recorder", k / len(chains))
        recorder = recorder_low_passes(chain)[0]
        stated = merge(alike, {"recorder.edge_hz": recorder.edge_hz, "recorder.kind": recorder.kind})
        try:
            other = prepare_window(log, dictionary, stated, selects=selects_support(stated))
            factorised = regression_of(other, stated)
            identified = identify_by_likelihood(other, factorised, stated, exclusive=True)
        except (DictionaryError, LogError):
            continue
        if other.live == window.live and factorised.n_rows == regression.n_rows:
            trials.append((other, factorised, identified))
    outcomes = [result for _, _, result in trials]
    likeliest, likeliest_regression, best = min(trials, key=lambda trial: trial[2].criterion)
    value = best.magnitudes.value
    weight = np.exp(-0.5 * np.array([result.criterion - best.criterion for result in outcomes]) / best.dispersion)
    same = np.array([result.atoms == best.atoms for result in outcomes])
    others = np.array([result.magnitudes.value for result in outcomes])[same]
    spread = (weight[same, None] * (others - value) ** 2).sum(axis=0) / weight[same].sum()
    variance = best.magnitudes.variance + spread + (BETWEEN_RECORDERS * value) ** 2
    recorder = recorder_low_passes(likeliest.filters)[0]
    note = Note.method(
        f"the recorder's low-pass is uncertain; the fault suits {recorder.kind} with gain one half at "
        f"{recorder.edge_hz:.3g} Hz best of {len(trials)}, and the intervals hold their spread"
    )
    chosen = replace(best, magnitudes=replace(best.magnitudes, variance=variance), notes=(*best.notes, note))
    return replace(likeliest, recorder=window.recorder), likeliest_regression, chosen


# An injected fault is an entry of the dictionary if it differs from a multiple of it by less than resampling does.
SAME_SIGNAL = 1e-6
# Of the cosine squared of the angle between a signal and an entry: 1 less the square of the above, and rounding.
ALIKE = 1.0 - 1e-9
AT_ONCE = 100_000  # samples of which the faults are made at once, for memory
MAX_LAGS = 40  # of the autocorrelation: over more the Ljung-Box test loses power; chosen without tuning record
UNANSWERABLE = (
    "this window cannot tell: every fault of the dictionary that is smaller than the output's whole movement can pass "
    "for the aircraft's motion; choose a window with the onset and a manoeuvre inside"
)

NOT_CONVERGED = "the solver did not converge, so that there is no interval and no verdict"
NOT_SCANNED = "only the dictionary's onsets were looked at; bfi start-time scans all of them"


def identify_faults(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen, *, given: bool = False
) -> IdentifyResult:
    """Identify the faults of a dictionary in a log, on one BLAS thread: more are slower here and change the bits.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`; its `method` is one of `bfi_cli.methods.METHODS`.
    progress : receives the name of every stage and its progress.
    given : every live entry is in the log, and only its magnitude is asked for; method ml.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or the method lacks a channel or a model.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : the method does not do what is asked.
    """
    config = with_inputs_of(log, config)
    identified = identification(log, dictionary, config, progress, given=given)
    conclusion = conclusion_of(log, config, [identified.evidence], identified.outcome)
    return result_of(log, config, identified, conclusion, ScanSummary.not_made(NOT_SCANNED))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification:
    """The outcome of a method on a window, before any conclusion.

    Attributes
    ----------
    window : the analysed one; outcome : of the method on it.
    evidence : the faults that the method declares, and every entry of the dictionary.
    hides_all : every fault of the dictionary can pass for the aircraft's motion.
    dictionary : path of its entries.
    recorder : likeliest low-pass where the recorder is uncertain; None for that which the log or the user states.
    notes : what limits the identification, and how it was computed.
    """

    window: PreparedWindow
    outcome: MethodResult
    evidence: Evidence
    model: ModelSummary
    vaf_output: Mapping[str, float]
    outputs: tuple[OutputSeries, ...]
    residuals: tuple[ResidualSummary, ...]
    truth: Comparison | None
    hides_all: bool
    notes: tuple[Note, ...]
    dictionary: str = ""
    recorder: Filter | None = None


def conclusion_of(
    log: FlightLog, config: Config, sources: Sequence[Evidence], outcome: MethodResult | None = None
) -> Conclusion:
    """Return the conclusion from all sources and from the manoeuvres of the flight.

    Parameters
    ----------
    config : with the names of the inputs.
    outcome : of the method that decides; None where that is the search over all onsets, whatever becomes of a solver.
    """
    flown = (manoeuvres_of(log, config.outputs),) if METHODS[config.method].intervals else ()
    fires, failed = (False, "") if outcome is None else (outcome.fires, "" if outcome.converged else NOT_CONVERGED)
    return conclude([*sources, *flown], config.require, fires=fires, failed=failed)


def result_of(
    log: FlightLog,
    config: Config,
    identified: Identification,
    conclusion: Conclusion,
    scan: ScanSummary,
    *,
    shown: Identification | None = None,
    first: Sequence[Note] = (),
    notes: Sequence[Note] = (),
) -> IdentifyResult:
    """Return the result of an identification and of the conclusion from it.

    Parameters
    ----------
    shown : whose model, series and residuals are shown; default those of the identification.
    first, notes : before and after those of the identification.
    """
    window, outcome, shown = identified.window, identified.outcome, shown or identified
    unanswered = list[Note]()
    if conclusion.has_failed:
        unanswered.append(Note.limit(f"{NOT_CONVERGED}: {outcome.solver.termination}"))
    elif conclusion.decision == "inconclusive" and identified.hides_all:
        unanswered.append(Note.limit(UNANSWERABLE))
    declared = {fault.name for fault in conclusion.faults}
    remarks = [note for n, note in outcome.remarks.items() if window.names[window.live[n]] not in declared]
    helps = None
    if METHODS[config.method].intervals:
        helps = what_would_help(log, config, conclusion.verdicts, dictionary=identified.dictionary)
    return IdentifyResult(
        log=window.summary,
        decision=conclusion.decision,
        verdicts=conclusion.verdicts,
        summary=conclusion.summary,
        scan=scan,
        faults=conclusion.faults,
        candidates=conclusion.candidates,
        model=shown.model,
        vaf_output=shown.vaf_output,
        solver=outcome.solver,
        notes=(*first, *unanswered, *conclusion.notes, *identified.notes, *remarks, *filter(None, [helps]), *notes),
        time_s=window.signals.time_s,
        inputs={name: window.signals.u[:, i] for i, name in enumerate(config.inputs)},
        input_units={name: window.log.channel(name).unit for name in config.inputs},
        outputs=shown.outputs,
        residuals=shown.residuals,
        truth=identified.truth,
        plausibility=conclusion.plausibility,
    )


def identification(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen, *, given: bool = False
) -> Identification:
    """Identify the faults of a dictionary without a conclusion; see `identify_faults`."""
    method = METHODS[config.method]
    module, _, function = method.function.partition(":")
    config = with_inputs_of(log, config)
    with one_thread():
        window = prepare_window(
            log,
            dictionary,
            config,
            partial(progress, "the window and the dictionary"),
            courses=True,
            selects=not given and selects_support(config),
        )
        if len(config.outputs) > 1 and not method.several_outputs:
            raise ConfigError(
                f"--method {config.method}: works on one output, got {len(config.outputs)}; give one --output, or "
                "--method ml"
            )
        for key in method.needs:
            if attrgetter(key)(config) is None:
                section, _, name = key.partition(".")
                raise LogError(
                    f"{log.path}: method {config.method} needs a {name}, which no log holds; give --{name} NAME, or "
                    f"{section}: {{{name}: NAME}} in the configuration"
                )
        regression = regression_of(window, config, partial(progress, "the record factorised"))
        identify = getattr(import_module(f"bfi_cli.{module}"), function)
        if given:
            identify = partial(identify, given=True)
        elif config.method == "ml" and alternatives(window.filters):
            identify = partial(identify, exclusive=True)
        if window.free:
            if config.method != "ml" or len(config.outputs) > 1:
                raise DictionaryError(
                    f"{dictionary.path}: a fault of unknown shape is estimated by --method ml on one output, got "
                    f"{config.method} on {', '.join(config.outputs)}; leave out shape free"
                )
            if log.earlier:
                raise DictionaryError(
                    f"{dictionary.path}: a fault of unknown shape is estimated from one log, got --together with "
                    f"{len(log.earlier)} more; leave out shape free, or the other logs"
                )
            from .free_shape import identify_with_courses

            identify = partial(identify_with_courses, identify=identify)
        outcome = identify(window, regression, config, progress)
        suggested = window
        if config.method == "ml" and not given and not window.free:
            window, regression, outcome = with_likeliest_recorder(
                log, dictionary, config, window, regression, outcome, progress
            )
        # What follows needs the memory that a long record takes.
        regression = regression.without_record()
        if outcome.analysed is not None:
            outcome = replace(outcome, analysed=(outcome.analysed[0], outcome.analysed[1].without_record()))
        outcome = with_heads(outcome, len(regression.signals.time_s))
        identified = replace(_assembled(log, window, regression, config, outcome), dictionary=dictionary.path)
        return (
            identified if window is suggested else replace(identified, recorder=recorder_low_passes(window.filters)[0])
        )


def _assembled(
    log: FlightLog, window: PreparedWindow, regression: RegressionData, config: Config, outcome: MethodResult
) -> Identification:
    """Return the outcome of a method as estimates, candidates, series, residuals and notes.

    Parameters
    ----------
    log : as it was read; window, regression : of it, with the onsets of the dictionary; outcome : of the method on
        them.
    """
    stated = window
    window, regression = outcome.analysed or (window, regression)
    magnitudes, estimates_all = outcome.magnitudes, METHODS[config.method].candidates
    hidden = hidden_atoms(window, magnitudes) if estimates_all else (False,) * len(window.live)
    tolerances = tolerances_of(log, window.log, config.outputs, config)
    faults = [_atom_estimate(window, outcome, n, tolerances) for n in outcome.atoms]
    faults += [course.estimate(window, magnitudes.quantile) for course in outcome.free if course.declared]
    candidates = claims_of_entries(window, regression, outcome, config.method, tolerances)
    residuals = residual_summaries(window, outcome)
    explained = window.signals.y[len(window.signals.y) - len(outcome.error) :]
    vaf = [
        float(100.0 * (1.0 - np.var(error) / np.var(y))) for error, y in zip(outcome.error.T, explained.T, strict=True)
    ]
    series = output_series(window, outcome, true_faults(window))
    return Identification(
        window=window,
        outcome=outcome,
        evidence=Evidence(source="dictionary", faults=tuple(faults), candidates=candidates),
        model=ModelSummary(
            order=outcome.order,
            rate_hz=window.signals.rate_hz,
            feedthrough=outcome.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            noise_sd=noise_of(outcome.error, config.outputs),
            orders=outcome.orders,
            criterion_no_fault=outcome.criterion_no_fault,
            criterion_best=outcome.criterion_best,
        ),
        vaf_output=dict(zip(config.outputs, vaf, strict=True)),
        outputs=series,
        residuals=residuals,
        truth=against_truth(stated, outcome, series),
        hides_all=bool(hidden) and all(hidden),
        notes=(
            *outcome.notes,
            *warnings_of(window, outcome, series, residuals, hidden),
            *((Note.method(window.recorder),) if window.recorder else ()),
        ),
    )


def _atom_estimate(
    window: PreparedWindow, outcome: MethodResult, n: int, tolerances: Mapping[str, float]
) -> FaultEstimate:
    """Return the estimate of the n-th live entry, which is declared."""
    entry, magnitudes = window.live[n], outcome.magnitudes
    fault, z = window.faults[entry], float(magnitudes.value[n])
    return estimate_of(
        fault,
        z,
        float(np.sqrt(magnitudes.variance[n])) if outcome.converged else np.nan,
        window.log.channel(fault.channel).unit,
        effect=abs(z) * float(window.largest[entry]),
        tolerance=tolerances[fault.channel],
        quantile=magnitudes.quantile,
        among=(fault.shape,),
    )


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
        theta = every[rows, :, entries]
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
    time_s, entries = window.native.time_s, [j for j in window.live if window.faults[j].channel == channel]
    tolerance_s, several = time_tolerance_s(time_s), max(1, AT_ONCE // len(time_s))
    for start in range(0, len(entries), several):
        group = entries[start : start + several]
        faults = [window.faults[j] for j in group]
        atoms = unit_signals(faults, time_s, window_start_s=window.window_start_s, tolerance_s=tolerance_s)
        # Most are far from being a multiple of the signal; one that may be is looked at closely.
        power, along = np.einsum("ij,ij->i", atoms, atoms), atoms @ signal
        for k in np.flatnonzero((power > 0.0) & (along**2 >= ALIKE * power * (signal @ signal))).tolist():
            z = float(atoms[k] @ signal) / float(atoms[k] @ atoms[k])
            if np.linalg.norm(signal - z * atoms[k]) <= SAME_SIGNAL * np.linalg.norm(signal):
                return group[k], z
    return None, 0.0
