"""What one fault-free record says of every entry of a dictionary, whatever its size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..channels import STANDARD
from ..config import Config
from ..dictionary import Dictionary
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels.coherence import mutual_coherence, whiten
from ..kernels.distinguishability import Distinguishability, distinguishability
from ..result import LogSummary, ModelSummary
from ..study import Intake, lowpass_of, take_in
from ..study.elsewhere import overdispersion
from ..study.predicted import Predicted, about_the_log, predicted, without_injected

__all__ = ["Measured", "measure"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """A record, and each entry of the dictionary in it.

    Attributes
    ----------
    log, model : what was analysed, and the predictor without fault terms.
    faults, names, units : (n_atoms,) entries, times on the log's axis, with the unit of each magnitude.
    reasons : why an entry is left out, by index.
    sd : (n_atoms,) standard deviation of each magnitude if that fault alone is estimated, infinite where nothing shows;
        multiplied as in `identify` by how much the shape stands out at other onsets of the fault-free record.
    deviations : how many of these are the minimal detectable magnitude.
    coherence : (n_atoms, n_atoms) of the filtered signatures, NaN where there is none.
    separation : bits against deviations, from the prediction errors.
    errors : (n_rows, n_outputs) prediction errors, SI.
    traces : (n_rows, n_atoms) what magnitude 1 adds to those of the entry's own channel, NaN outside the fault.
    places : (n_atoms,) index of the own channel among the outputs.
    notes : on the log.
    """

    log: LogSummary
    model: ModelSummary
    faults: tuple[Fault, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    reasons: Mapping[int, str]
    sd: FloatArray
    deviations: float
    coherence: FloatArray
    separation: Distinguishability
    errors: FloatArray
    traces: FloatArray
    places: tuple[int, ...]
    notes: tuple[str, ...]

    @property
    def limits(self) -> FloatArray:
        """(n_atoms,) minimal detectable magnitudes, infinite where nothing shows."""
        return self.deviations * self.sd


def measure(log: FlightLog, dictionary: Dictionary, config: Config) -> Measured:
    """Fit the record without fault terms and see what each fault would leave in its prediction errors.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    intake = take_in(without_injected(log), dictionary, config)
    found = predicted(intake, config)
    n, live = len(intake.faults), list(intake.live)
    sd, coherence = np.full(n, np.inf), np.full((n, n), np.nan)
    seen = np.isfinite(found.sd)
    excess = overdispersion(intake, replace(found.study, live=intake.live), found.fit, lowpass_of(config))
    sd[live] = np.where(seen, found.sd * np.sqrt(excess), np.inf)
    G = whiten(found.unfolded.signatures, found.fit.sigma) * seen
    coherence[np.ix_(live, live)] = mutual_coherence(G)
    places = tuple(max(0, _place(config, fault)) for fault in intake.faults)
    return Measured(
        log=_summary(intake),
        model=_model(found, config),
        faults=intake.faults,
        names=intake.names,
        units=tuple(magnitude_unit(fault, _unit(intake.log, fault.channel)) for fault in intake.faults),
        reasons=intake.reasons,
        sd=sd,
        deviations=found.deviations,
        coherence=coherence,
        separation=distinguishability(whiten(found.unfolded.error[:, :, None], found.fit.sigma)),
        errors=found.unfolded.error * found.study.unit,
        traces=_traces(intake, found, places),
        places=places,
        notes=tuple(about_the_log(log, intake, found)),
    )


def _place(config: Config, fault: Fault) -> int:
    return config.outputs.index(fault.channel) if fault.channel in config.outputs else -1


def _traces(intake: Intake, found: Predicted, places: tuple[int, ...]) -> FloatArray:
    """Filtered signatures off the regressors, from the onset until the lags have forgotten the end."""
    study = found.study
    time_s = study.conditioned.time_s[study.layout.first :]
    memory_s = found.fit.order / study.conditioned.rate_hz
    traces = np.full((len(time_s), len(intake.faults)), np.nan)
    for n, j in enumerate(intake.live):
        fault = intake.faults[j]
        stop_s = np.inf if fault.offset_s is None else fault.offset_s + memory_s
        inside = (time_s >= fault.onset_s) & (time_s <= stop_s)
        trace = found.unfolded.signatures[:, places[j], n] * study.unit[places[j]]
        traces[inside, j] = trace[inside]
    return traces


def _unit(log: FlightLog, channel: str) -> str:
    if channel in log.channels:
        return log.channel(channel).unit
    return STANDARD[channel].unit if channel in STANDARD else ""


def _summary(intake: Intake) -> LogSummary:
    conditioned = intake.conditioned
    return LogSummary(
        path=intake.log.path,
        rate_hz=conditioned.rate_hz,
        n_samples=len(conditioned.time_s),
        start_s=float(conditioned.time_s[0]),
        stop_s=float(conditioned.time_s[-1]),
        native_rate_hz=intake.native_rate_hz,
    )


def _model(found: Predicted, config: Config) -> ModelSummary:
    spread = np.sqrt(np.mean(found.unfolded.error**2, axis=0)) * found.study.unit
    return ModelSummary(
        order=found.fit.order,
        rate_hz=found.study.conditioned.rate_hz,
        feedthrough=found.study.layout.feedthrough,
        inputs=config.inputs,
        outputs=config.outputs,
        noise_sd=dict(zip(config.outputs, spread.tolist(), strict=True)),
        orders=(),
        criterion_no_fault=(),
        criterion_best=(),
    )
