"""The filtered signature of every fault in a fault-free record, and the divergences in bits of the signatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..config import Config
from ..dictionary import Dictionary
from ..errors import DictionaryError
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels import FloatArray
from ..kernels.coherence import mutual_coherence
from ..kernels.covariance import whiten
from ..kernels.divergence import Distinguishability, distinguishability, sample_bits, window_bits
from ..model.preprocessing.fault_free_model import about_the_log, fit_fault_free, without_injected_faults
from ..model.preprocessing.magnitudes import fault_free_limits
from ..model.preprocessing.window import prepare_window, with_inputs_of
from ..model.result import LogSummary, ModelSummary
from ..notes import Note

# Largest number of faults compared in single samples. Each needs the estimate of a density and its integral; more
# faults take minutes.
MOST_IN_SAMPLES = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaultSignatures:
    """A fault-free record, and the signature of each fault of the dictionary in its prediction errors.

    Attributes
    ----------
    log, model : the analysed window, and the predictor without fault terms.
    faults, names, units : (n_atoms,) entries, times on the log's axis, with the unit of each magnitude.
    channel_units : (n_atoms,) of their channels, "" where not known.
    reasons : why an entry is left out, by index.
    limits : (n_atoms,) minimal detectable magnitudes as `identify` states them, infinite where nothing shows.
    sd : (n_atoms,) standard deviation of each magnitude, the limit at its exact onset over `deviations`; infinite for a
        fault without a signature in the prediction errors.
    coherence : (n_atoms, n_atoms) of the filtered signatures, NaN where a fault has none.
    separation : bits against the magnitude in standard deviations, from the prediction errors.
    errors : (n_rows, n_outputs) prediction errors, SI.
    traces : (n_rows, n_atoms) change of the errors of the entry's channel by magnitude 1, NaN outside the fault.
    outputs : (n_atoms,) index of the entry's channel among the outputs.
    notes : on the log.
    """

    log: LogSummary
    model: ModelSummary
    faults: tuple[Fault, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    channel_units: tuple[str, ...]
    reasons: Mapping[int, str]
    limits: FloatArray
    sd: FloatArray
    deviations: float
    coherence: FloatArray
    separation: Distinguishability
    errors: FloatArray
    traces: FloatArray
    outputs: tuple[int, ...]
    notes: tuple[Note, ...]


def signatures(log: FlightLog, dictionary: Dictionary, config: Config, *, tolerant: bool = True) -> FaultSignatures:
    """Fit the record without fault terms and filter each fault through that fit.

    Parameters
    ----------
    tolerant : limits hold for the worst onset within the tolerance, as in `identify`; else for exact onsets.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    stated, n_kinds = dictionary.exact, len(dictionary.searched.atoms)
    if n_kinds and not stated.atoms:
        raise DictionaryError(
            f"{dictionary.path}: no entry states its onset, and a signature is that of a fault at an onset; add onset_s"
        )
    config, clean = with_inputs_of(log, config), without_injected_faults(log)
    window = prepare_window(clean, stated, config)
    fitted = fit_fault_free(window, config)
    fit, regression = fitted.fit, fitted.regression
    n, live = len(window.faults), list(window.live)
    sd, limits, coherence = np.full(n, np.inf), np.full(n, np.inf), np.full((n, n), np.nan)
    visible = np.isfinite(fitted.sd)
    detectable, exactly = fault_free_limits(window, config)
    if not tolerant:
        detectable = exactly
    sd[live] = np.where(visible & np.isfinite(exactly), exactly / fitted.deviations, np.inf)
    limits[live] = np.where(visible & np.isfinite(detectable), detectable, np.inf)
    coherence[np.ix_(live, live)] = mutual_coherence(whiten(fitted.unfolded.signatures, fit.sigma) * visible)
    channel_units = tuple(window.log.unit_of(fault.channel) for fault in window.faults)
    # An entry whose channel is no output is assigned to the first output.
    outputs = tuple(config.outputs.index(f.channel) if f.channel in config.outputs else 0 for f in window.faults)
    # A trace runs from the onset until the lags have forgotten the end.
    traces = np.full((len(regression.rows_s), n), np.nan)
    for column, j in enumerate(live):
        fault, k = window.faults[j], outputs[j]
        stop_s = np.inf if fault.offset_s is None else fault.offset_s + fit.order / window.signals.rate_hz
        inside = (regression.rows_s >= fault.onset_s) & (regression.rows_s <= stop_s)
        traces[inside, j] = (fitted.unfolded.signatures[:, k, column] * regression.unit[k])[inside]
    return FaultSignatures(
        log=window.summary,
        model=fitted.model,
        faults=window.faults,
        names=window.names,
        units=tuple(map(magnitude_unit, window.faults, channel_units)),
        channel_units=channel_units,
        reasons=window.reasons,
        limits=limits,
        sd=sd,
        deviations=fitted.deviations,
        coherence=coherence,
        separation=distinguishability(whiten(fitted.unfolded.weighted_error[:, :, None], fit.sigma)),
        errors=fitted.error,
        traces=traces,
        outputs=outputs,
        notes=(
            *about_the_log(log, window, fitted),
            *(
                [Note.limit(f"left out, as they state no onset: {n_kinds} entries of the dictionary")]
                if n_kinds
                else []
            ),
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Divergences:
    """Bits of every entry, NaN for those left out.

    Attributes
    ----------
    whole : (n_atoms,) fault against no fault, in the whole window.
    between : (n_atoms, n_atoms) fault against fault, symmetric.
    apart : (n_atoms,) the fault against the most similar other fault, whatever the size of that.
    most_like : (n_atoms,) index of the most similar other fault, -1 where there is none.
    """

    whole: FloatArray
    between: FloatArray
    apart: FloatArray
    most_like: tuple[int, ...]


def minimal_detectable(records: Sequence[FaultSignatures]) -> FloatArray:
    """Return (n_atoms,) minimal detectable magnitudes, the geometric mean over the records."""
    return np.asarray(np.exp(np.mean([np.log(record.limits) for record in records], axis=0)))


def divergences(records: Sequence[FaultSignatures], magnitudes: FloatArray) -> Divergences:
    """Return the bits of faults of these magnitudes, the mean over the records.

    Two faults are told apart by the prediction error along the part of one signature that is orthogonal to the other,
    which does not depend on the unknown magnitude of the other fault. Of the two choices the one with more bits counts.

    Parameters
    ----------
    records : with the same entries.
    magnitudes : (n_atoms,) root mean squares.
    """
    coherence = np.mean([np.nan_to_num(record.coherence) for record in records], axis=0)
    np.fill_diagonal(coherence, 0.0)
    whole, between, apart = [], [], []
    for record in records:
        deviations = _deviations(record, magnitudes)
        larger = np.maximum(deviations[:, None], deviations)
        bits = window_bits(record.separation, larger * np.sqrt(1.0 - np.nan_to_num(record.coherence) ** 2))
        np.fill_diagonal(bits, 0.0)
        between.append(bits)
        whole.append(window_bits(record.separation, deviations))
        apart.append(apart_bits(record, magnitudes))
    means = np.mean(whole, axis=0), np.mean(between, axis=0), np.mean(apart, axis=0)
    out = [j for j in range(len(magnitudes)) if j in records[0].reasons or not np.isfinite(magnitudes[j])]
    for values in (*means, means[1].T):
        values[out] = np.nan
    return Divergences(
        whole=means[0],
        between=means[1],
        apart=means[2],
        most_like=tuple(int(np.argmax(row)) if np.any(row > 0.0) else -1 for row in coherence),
    )


def apart_bits(record: FaultSignatures, magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of each fault against the most similar other fault, or no fault if there is no other."""
    rivals = np.where(np.eye(len(magnitudes), dtype=bool), np.nan, record.coherence)
    closest = np.max(np.nan_to_num(rivals), axis=1, initial=0.0)
    return window_bits(record.separation, _deviations(record, magnitudes) * np.sqrt(1.0 - closest**2))


def single_sample_bits(records: Sequence[FaultSignatures], magnitudes: FloatArray) -> FloatArray:
    """Return (n_atoms,) bits of fault against no fault in single prediction errors, the mean over the records.

    NaN where there are more than `MOST_IN_SAMPLES` faults: each has a density of its own to be estimated.
    """
    if len(magnitudes) - len(records[0].reasons) > MOST_IN_SAMPLES:
        return np.full(len(magnitudes), np.nan)
    finite = np.where(np.isfinite(magnitudes), magnitudes, np.nan)
    bits = np.empty((len(records), len(magnitudes)))
    for n, record in enumerate(records):
        for output in set(record.outputs):
            atoms = np.flatnonzero(np.array(record.outputs) == output)
            bits[n, atoms] = sample_bits(record.errors[:, output], finite[atoms] * record.traces[:, atoms])
    return np.asarray(np.mean(bits, axis=0))


def _deviations(record: FaultSignatures, magnitudes: FloatArray) -> FloatArray:
    """Return the magnitudes over their standard deviations, 0 for a fault without a signature."""
    return np.where(np.isfinite(magnitudes), magnitudes, 0.0) / record.sd
