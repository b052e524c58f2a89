"""What one fault-free record says of every entry of a dictionary, whatever its size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import STANDARD
from ..config import Config
from ..dictionary import Dictionary
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels.coherence import mutual_coherence, whiten
from ..kernels.distinguishability import Distinguishability, distinguishability
from ..preprocessing.fault_free_model import FaultFreeModel, about_the_log, fit_fault_free, without_injected_faults
from ..preprocessing.overdispersion import overdispersion
from ..preprocessing.summary import LogSummary, ModelSummary
from ..preprocessing.window import PreparedWindow, prepare_window

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
    window = prepare_window(without_injected_faults(log), dictionary, config)
    fitted = fit_fault_free(window, config)
    n, live = len(window.faults), list(window.live)
    sd, coherence = np.full(n, np.inf), np.full((n, n), np.nan)
    seen = np.isfinite(fitted.sd)
    excess = overdispersion(window, fitted.regression, fitted.fit)
    sd[live] = np.where(seen, fitted.sd * np.sqrt(excess), np.inf)
    G = whiten(fitted.unfolded.signatures, fitted.fit.sigma) * seen
    coherence[np.ix_(live, live)] = mutual_coherence(G)
    places = tuple(max(0, _place(config, fault)) for fault in window.faults)
    return Measured(
        log=window.summary,
        model=fitted.model,
        faults=window.faults,
        names=window.names,
        units=tuple(magnitude_unit(fault, _unit(window.log, fault.channel)) for fault in window.faults),
        reasons=window.reasons,
        sd=sd,
        deviations=fitted.deviations,
        coherence=coherence,
        separation=distinguishability(whiten(fitted.unfolded.error[:, :, None], fitted.fit.sigma)),
        errors=fitted.error,
        traces=_traces(window, fitted, places),
        places=places,
        notes=tuple(about_the_log(log, window, fitted)),
    )


def _place(config: Config, fault: Fault) -> int:
    return config.outputs.index(fault.channel) if fault.channel in config.outputs else -1


def _traces(window: PreparedWindow, fitted: FaultFreeModel, places: tuple[int, ...]) -> FloatArray:
    """Filtered signatures off the regressors, from the onset until the lags have forgotten the end."""
    time_s = fitted.regression.rows_s
    memory_s = fitted.fit.order / window.signals.rate_hz
    traces = np.full((len(time_s), len(window.faults)), np.nan)
    for n, j in enumerate(window.live):
        fault = window.faults[j]
        stop_s = np.inf if fault.offset_s is None else fault.offset_s + memory_s
        inside = (time_s >= fault.onset_s) & (time_s <= stop_s)
        trace = fitted.unfolded.signatures[:, places[j], n] * fitted.regression.unit[places[j]]
        traces[inside, j] = trace[inside]
    return traces


def _unit(log: FlightLog, channel: str) -> str:
    if channel in log.channels:
        return log.channel(channel).unit
    return STANDARD[channel].unit if channel in STANDARD else ""
