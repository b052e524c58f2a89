"""From what a method found to the result: estimates, candidates, series, residuals, notes, decision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..config import Config
from ..faults import FaultEstimate, magnitude_unit, physical
from ..preprocessing.summary import model_summary
from ..preprocessing.window import PreparedWindow
from .magnitudes import MethodResult
from .methods import METHODS
from .reconstruction import against_truth, output_series, residual_summaries, true_faults
from .result import Candidate, IdentifyResult
from .warnings import BLIND_NOTE, hidden_atoms, warnings_of

__all__ = ["assemble_result"]

UNANSWERABLE = (
    "the data cannot answer: in this window no fault of the dictionary smaller than the output's movement leaves a "
    "trace that the dynamics do not explain; choose a window with the onset and a manoeuvre inside"
)


NOT_CONVERGED = "the solver did not converge, so that there is no interval and no verdict"


def assemble_result(window: PreparedWindow, config: Config, found: MethodResult) -> IdentifyResult:
    """Return the result of an identification."""
    estimates_all = METHODS[config.method].candidates
    hidden = hidden_atoms(window, found.magnitudes) if estimates_all else (False,) * len(window.live)
    series = output_series(window, found, true_faults(window))
    residuals = residual_summaries(window, found)
    decision = found.decision or ("fault" if found.atoms else "not_identifiable" if all(hidden) else "no_fault")
    unanswered = UNANSWERABLE
    if not found.converged:
        decision, unanswered = "not_identifiable", f"{NOT_CONVERGED}: {found.solver.termination}"
    first = len(window.signals.y) - len(found.error)
    return IdentifyResult(
        log=window.summary,
        decision=decision,
        faults=_estimates(window, found),
        candidates=_candidates(window, found, hidden),
        model=model_summary(
            found.error,
            order=found.order,
            rate_hz=window.signals.rate_hz,
            feedthrough=found.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            orders=found.orders,
            criterion_no_fault=found.criterion_no_fault,
            criterion_best=found.criterion_best,
        ),
        vaf_output={
            name: float(100.0 * (1.0 - np.var(error) / np.var(y[first:])))
            for name, error, y in zip(config.outputs, found.error.T, window.signals.y.T, strict=True)
        },
        solver=found.solver,
        notes=(
            *((unanswered,) if decision == "not_identifiable" else ()),
            *found.notes,
            *warnings_of(window, found, series, residuals, hidden),
        ),
        time_s=window.signals.time_s,
        inputs={name: window.signals.u[:, i] for i, name in enumerate(config.inputs)},
        input_units={name: window.log.channel(name).unit for name in config.inputs},
        outputs=series,
        residuals=residuals,
        truth=against_truth(window, found, series),
    )


def _estimates(window: PreparedWindow, found: MethodResult) -> tuple[FaultEstimate, ...]:
    """Return the declared faults."""
    estimates, quantile = [], found.magnitudes.quantile
    for n in found.atoms:
        fault = window.faults[window.live[n]]
        z = float(found.magnitudes.value[n])
        sd = float(np.sqrt(found.magnitudes.variance[n])) if found.converged else np.nan
        unit = window.log.channel(fault.channel).unit
        value, physical_unit = physical(fault, z, unit)
        estimates.append(
            FaultEstimate(
                name=window.names[window.live[n]],
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


def _candidates(window: PreparedWindow, found: MethodResult, hidden: Sequence[bool]) -> tuple[Candidate, ...]:
    """Return every entry of the dictionary, in its order."""
    place = {entry: n for n, entry in enumerate(window.live)}
    magnitudes = found.magnitudes
    candidates = []
    for entry, fault in enumerate(window.faults):
        n = place.get(entry)
        known = fault.channel in window.log.channels
        candidates.append(
            Candidate(
                name=window.names[entry],
                channel=fault.channel,
                active=n in found.atoms,
                magnitude=None if n is None else _finite(magnitudes.value[n]),
                unit=magnitude_unit(fault, window.log.channel(fault.channel).unit if known else ""),
                sd=None if n is None or not found.converged else _finite(np.sqrt(magnitudes.variance[n])),
                minimal_detectable=None
                if n is None or not found.converged
                else _finite(magnitudes.minimal_detectable[n]),
                note=window.reasons.get(entry) if n is None else BLIND_NOTE if hidden[n] else None,
            )
        )
    return tuple(candidates)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
