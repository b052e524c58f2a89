"""Identification from end to end: prepare the window, run the method, assemble the result.

Where the recorder's low-pass is uncertain it is a nuisance parameter, which the fault itself tells best: a step shows
the response of the recorder, which the spectra of an excerpt tell to a few tens of per cent only; without a fault
nothing depends on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from operator import attrgetter

import numpy as np

from ..config import Config, merge
from ..decision import KINDS, Conclusion, Evidence, conclude, estimate_of
from ..dictionary import Dictionary
from ..errors import ConfigError, DictionaryError, LogError
from ..faults import FaultEstimate
from ..faults.filters import BETWEEN_RECORDERS, Filter, alternatives, recorder_low_passes
from ..faults.truth import Comparison
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..methods import METHODS
from ..notes import Note
from ..threads import one_thread
from .claims import claims_of_entries, hidden_atoms, warnings_of
from .maximum_likelihood import identify_by_likelihood
from .preprocessing.defaults import manoeuvres_of, tolerances_of, what_would_help
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow, prepare_window, regression_of, selects_support, with_inputs_of
from .reconstruction import against_truth, output_series, residual_summaries, true_faults, with_heads
from .result import IdentifyResult, ModelSummary, OutputSeries, ResidualSummary, ScanSummary, noise_of
from .selection import FreeOutcome, MethodResult


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
    scan = ScanSummary(decision=None, verdicts=dict.fromkeys(KINDS, "inconclusive"), faults=(), note=NOT_SCANNED)
    conclusion = conclusion_of(log, config, [identified.evidence], identified.outcome)
    return result_of(log, config, identified, conclusion, scan)


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
    faults += [_course_estimate(window, course, magnitudes.quantile) for course in outcome.free if course.declared]
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


def _course_estimate(window: PreparedWindow, course: FreeOutcome, quantile: float) -> FaultEstimate:
    """Return the estimate of a fault of unknown course: its magnitude is its largest value."""
    fault, z, sd = window.faults[course.entry], float(course.value[course.peak]), float(course.sd[course.peak])
    return estimate_of(fault, z, sd, window.log.channel(fault.channel).unit, quantile=quantile)
