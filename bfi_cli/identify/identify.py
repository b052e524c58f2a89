"""Identification from end to end: prepare the window, run the method, assemble the result."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from operator import attrgetter

import numpy as np
from threadpoolctl import threadpool_limits

from ..config import Config
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..faults import FaultEstimate, magnitude_unit, physical
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..preprocessing.summary import model_summary
from ..preprocessing.window import PreparedWindow, prepare_window, regression_of, with_inputs_of
from .magnitudes import MethodResult
from .methods import METHODS
from .reconstruction import against_truth, output_series, residual_summaries, true_faults
from .result import Candidate, IdentifyResult
from .warnings import BLIND_NOTE, hidden_atoms, warnings_of

__all__ = ["assemble_result", "identify_faults"]

UNANSWERABLE = (
    "the data cannot answer: in this window every fault of the dictionary that is smaller than the output's whole "
    "movement can pass for the aircraft's motion; choose a window with the onset and a manoeuvre inside"
)

NOT_CONVERGED = "the solver did not converge, so that there is no interval and no verdict"


def identify_faults(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen
) -> IdentifyResult:
    """Identify the faults of a dictionary in a log, on one BLAS thread: more are slower here and change the bits.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`; its `method` is one of `bfi_cli.identify.methods.METHODS`.
    progress : receives the name of every stage and its progress.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or the method lacks a channel or a model.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : the method does not do what is asked.
    """
    method = METHODS[config.method]
    module, _, function = method.function.partition(":")
    config = with_inputs_of(log, config)
    with threadpool_limits(1):
        window = prepare_window(log, dictionary, config, partial(progress, "the window and the dictionary"))
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
        identify = getattr(import_module(f".{module}", __package__), function)
        return assemble_result(window, config, identify(window, regression, config, progress))


def assemble_result(window: PreparedWindow, config: Config, outcome: MethodResult) -> IdentifyResult:
    """Return the result of an identification: estimates, candidates, series, residuals, notes and decision."""
    estimates_all, place = METHODS[config.method].candidates, {entry: n for n, entry in enumerate(window.live)}
    hidden = hidden_atoms(window, outcome.magnitudes) if estimates_all else (False,) * len(window.live)
    magnitudes, seen = outcome.magnitudes, 1.0 if outcome.converged else np.nan
    sd, detectable = seen * np.sqrt(magnitudes.variance), seen * magnitudes.minimal_detectable
    faults, candidates = [], []
    for n in outcome.atoms:
        fault, z, reach = window.faults[window.live[n]], float(magnitudes.value[n]), magnitudes.quantile * float(sd[n])
        unit = window.log.channel(fault.channel).unit
        value, physical_unit = physical(fault, z, unit)
        estimate = FaultEstimate(
            name=window.names[window.live[n]],
            fault=fault,
            magnitude=z,
            unit=magnitude_unit(fault, unit),
            physical_value=value,
            physical_unit=physical_unit,
            sd=float(sd[n]),
            ci95=(z - reach, z + reach),
        )
        faults.append(estimate)
    for entry, fault in enumerate(window.faults):
        live = place.get(entry)
        known = fault.channel in window.log.channels
        candidate = Candidate(
            name=window.names[entry],
            channel=fault.channel,
            active=live in outcome.atoms,
            magnitude=None if live is None else _finite(magnitudes.value[live]),
            unit=magnitude_unit(fault, window.log.channel(fault.channel).unit if known else ""),
            sd=None if live is None else _finite(sd[live]),
            minimal_detectable=None if live is None else _finite(detectable[live]),
            note=window.reasons.get(entry) if live is None else BLIND_NOTE if hidden[live] else None,
        )
        candidates.append(candidate)
    series = output_series(window, outcome, true_faults(window))
    residuals = residual_summaries(window, outcome)
    decision = outcome.decision or ("fault" if outcome.atoms else "not_identifiable" if all(hidden) else "no_fault")
    unanswered = UNANSWERABLE
    if not outcome.converged:
        decision, unanswered = "not_identifiable", f"{NOT_CONVERGED}: {outcome.solver.termination}"
    explained = window.signals.y[len(window.signals.y) - len(outcome.error) :]
    return IdentifyResult(
        log=window.summary,
        decision=decision,
        faults=tuple(faults),
        candidates=tuple(candidates),
        model=model_summary(
            outcome.error,
            order=outcome.order,
            rate_hz=window.signals.rate_hz,
            feedthrough=outcome.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            orders=outcome.orders,
            criterion_no_fault=outcome.criterion_no_fault,
            criterion_best=outcome.criterion_best,
        ),
        vaf_output={
            name: float(100.0 * (1.0 - np.var(error) / np.var(y)))
            for name, error, y in zip(config.outputs, outcome.error.T, explained.T, strict=True)
        },
        solver=outcome.solver,
        notes=(
            *((unanswered,) if decision == "not_identifiable" else ()),
            *outcome.notes,
            *warnings_of(window, outcome, series, residuals, hidden),
            *((window.recorder,) if window.recorder else ()),
        ),
        time_s=window.signals.time_s,
        inputs={name: window.signals.u[:, i] for i, name in enumerate(config.inputs)},
        input_units={name: window.log.channel(name).unit for name in config.inputs},
        outputs=series,
        residuals=residuals,
        truth=against_truth(window, outcome, series),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
