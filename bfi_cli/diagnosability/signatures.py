"""The filtered signature of every fault of a dictionary in one fault-free record, whatever its magnitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..channels import STANDARD
from ..config import Config
from ..dictionary import Dictionary
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels import FloatArray
from ..kernels.coherence import mutual_coherence, whiten
from ..kernels.distinguishability import Distinguishability, distinguishability
from ..preprocessing.fault_free_model import about_the_log, fit_fault_free, without_injected_faults
from ..preprocessing.overdispersion import overdispersion
from ..preprocessing.summary import LogSummary, ModelSummary
from ..preprocessing.window import prepare_window


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signatures:
    """A fault-free record, and what each fault of the dictionary leaves in its prediction errors.

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
    outputs : (n_atoms,) index of the own channel among the outputs.
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
    outputs: tuple[int, ...]
    notes: tuple[str, ...]

    @property
    def limits(self) -> FloatArray:
        """(n_atoms,) minimal detectable magnitudes, infinite where nothing shows."""
        return self.deviations * self.sd


def signatures(log: FlightLog, dictionary: Dictionary, config: Config) -> Signatures:
    """Fit the record without fault terms and filter each fault through that fit.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    window = prepare_window(without_injected_faults(log), dictionary, config)
    fitted = fit_fault_free(window, config)
    fit, regression = fitted.fit, fitted.regression
    n, live = len(window.faults), list(window.live)
    sd, coherence = np.full(n, np.inf), np.full((n, n), np.nan)
    visible = np.isfinite(fitted.sd)
    sd[live] = np.where(visible, fitted.sd * np.sqrt(overdispersion(window, regression, fit)), np.inf)
    coherence[np.ix_(live, live)] = mutual_coherence(whiten(fitted.unfolded.signatures, fit.sigma) * visible)
    # An entry whose channel is no output counts in the first one.
    outputs = tuple(config.outputs.index(f.channel) if f.channel in config.outputs else 0 for f in window.faults)
    # A trace runs from the onset until the lags have forgotten the end.
    traces = np.full((len(regression.rows_s), n), np.nan)
    for column, j in enumerate(live):
        fault, k = window.faults[j], outputs[j]
        stop_s = np.inf if fault.offset_s is None else fault.offset_s + fit.order / window.signals.rate_hz
        inside = (regression.rows_s >= fault.onset_s) & (regression.rows_s <= stop_s)
        traces[inside, j] = (fitted.unfolded.signatures[:, k, column] * regression.unit[k])[inside]
    return Signatures(
        log=window.summary,
        model=fitted.model,
        faults=window.faults,
        names=window.names,
        units=tuple(magnitude_unit(fault, _unit(window.log, fault.channel)) for fault in window.faults),
        reasons=window.reasons,
        sd=sd,
        deviations=fitted.deviations,
        coherence=coherence,
        separation=distinguishability(whiten(fitted.unfolded.error[:, :, None], fit.sigma)),
        errors=fitted.error,
        traces=traces,
        outputs=outputs,
        notes=tuple(about_the_log(log, window, fitted)),
    )


def _unit(log: FlightLog, channel: str) -> str:
    if channel in log.channels:
        return log.channel(channel).unit
    return STANDARD[channel].unit if channel in STANDARD else ""
