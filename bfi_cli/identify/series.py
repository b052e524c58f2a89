"""The answer along time: signals, residuals, the plain 5-sigma test, and the comparison with an injected truth."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..faults import active_samples, unit_signal
from ..flightlog.record import Truth, frozen_array
from ..kernels.covariance import Unfolded
from ..kernels.decimation import Lowpass, decimate
from ..kernels.whiteness import autocorrelation, exceedances, ljung_box, robust_sd
from ..result import AgainstTruth, OutputSeries, ResidualSummary
from ..study import Intake, Study

__all__ = ["Reconstruction", "against_truth", "output_series", "residuals", "true_faults"]

FloatArray = NDArray[np.float64]

SAME_SIGNAL = 1e-6
MAX_LAGS = 40


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reconstruction:
    """Magnitudes of the active faults in SI and their covariance.

    Attributes
    ----------
    atoms : indices in the study; z : (n_active,); covariance : (n_active, n_active).
    unfolded : the fit over its rows; plain : the fault-free model over its rows.
    """

    atoms: tuple[int, ...]
    z: FloatArray
    covariance: FloatArray
    unfolded: Unfolded
    plain: Unfolded


def output_series(
    intake: Intake, study: Study, found: Reconstruction, true: Mapping[str, FloatArray], outputs: Sequence[str]
) -> tuple[OutputSeries, ...]:
    """Return measured, corrected and predicted signals of every output, in SI."""
    conditioned = study.conditioned
    theta = conditioned.theta[:, :, [study.live[j] for j in found.atoms]]
    fault = theta @ found.z
    spread = np.sqrt(np.maximum(np.einsum("koi,ij,koj->ko", theta, found.covariance, theta), 0.0))
    error = _padded(found.unfolded.error * study.unit, study)
    plain = _padded(found.plain.error * study.unit, study)
    return tuple(
        OutputSeries(
            channel=name,
            unit=intake.log.channel(name).unit,
            measured=frozen_array(conditioned.y[:, i]),
            corrected=frozen_array(conditioned.y[:, i] - fault[:, i]),
            predicted=frozen_array(conditioned.y[:, i] - error[:, i]),
            fault=frozen_array(fault[:, i]),
            fault_sd=frozen_array(spread[:, i]),
            prediction_error=frozen_array(error[:, i]),
            plain_residual=frozen_array(plain[:, i]),
            true_fault=frozen_array(true[name]) if name in true else None,
        )
        for i, name in enumerate(outputs)
    )


def _padded(error: FloatArray, study: Study) -> FloatArray:
    head = np.full((study.layout.first, error.shape[1]), np.nan)
    return np.vstack([head, error])


def residuals(study: Study, series: Sequence[OutputSeries], n_fitted: int) -> tuple[ResidualSummary, ...]:
    """Return whiteness of the prediction error and the alarms of the plain 5-sigma test, per output."""
    first = study.layout.first
    time_s = study.conditioned.time_s[first:]
    summaries = []
    for output in series:
        error, plain = output.prediction_error[first:], output.plain_residual[first:]
        n_lags = max(1, min(MAX_LAGS, len(error) // 4))
        summaries.append(
            ResidualSummary(
                channel=output.channel,
                lags=tuple(range(1, n_lags + 1)),
                autocorrelation=tuple(float(r) for r in autocorrelation(error, n_lags)),
                band=1.96 / float(np.sqrt(len(error))),
                ljung_box_p=ljung_box(error, n_lags, n_fitted),
                plain_alarms_s=tuple(float(time_s[k]) for k in exceedances(plain)),
                plain_sd=robust_sd(plain),
            )
        )
    return tuple(summaries)


def true_faults(intake: Intake, lowpass: Lowpass, outputs: Sequence[str]) -> dict[str, FloatArray]:
    """Return the injected fault signal of every output, conditioned as the log is; empty where the log has no truth."""
    truth = intake.log.truth
    if truth is None:
        return {}
    found = {}
    for name in outputs:
        measured = intake.log.channel(name).values
        clean = truth.clean.get(name, measured)
        found[name] = decimate(measured - clean, intake.choice.factor, lowpass)
    return found


def against_truth(
    intake: Intake, study: Study, found: Reconstruction, series: Sequence[OutputSeries]
) -> AgainstTruth | None:
    """Compare with the injected faults; None where the log has no truth."""
    truth = intake.log.truth
    if truth is None:
        return None
    matched = _matched(intake, truth)
    active = {study.live[j]: float(z) for j, z in zip(found.atoms, found.z, strict=True)}
    wanted: dict[int, float] = {}
    for j, z, _ in matched:
        if j is not None:
            wanted[j] = wanted.get(j, 0.0) + z
    wanted = {j: z for j, z in wanted.items() if z != 0.0}
    missed = [intake.names[j] for j in wanted if j not in active]
    missed += [name for j, _, name in matched if j is None]
    extra = tuple(intake.names[j] for j in active if j not in wanted)
    error = None
    if wanted and all(j is not None for j, _, _ in matched):
        everywhere = sorted(set(wanted) | set(active))
        difference = [active.get(j, 0.0) - wanted.get(j, 0.0) for j in everywhere]
        error = float(np.linalg.norm(difference) / np.linalg.norm(list(wanted.values())))
    return AgainstTruth(
        isolated=not missed and not extra,
        false_alarms=extra,
        missed=tuple(missed),
        magnitude_error=error,
        vaf_fault={output.channel: _vaf(output) for output in series},
    )


def _vaf(output: OutputSeries) -> float | None:
    """Variance accounted for of the fault (thesis eq. 5-2), %; None where there is no fault in the window."""
    if output.true_fault is None or not np.any(output.true_fault):
        return None
    missing = np.sum((output.true_fault - output.fault) ** 2) / np.sum(output.true_fault**2)
    return float(max(0.0, 100.0 * (1.0 - missing)))


def _matched(intake: Intake, truth: Truth) -> list[tuple[int | None, float, str]]:
    """Return (dictionary entry of the same signal or None, magnitude in its terms, name) of each injected fault."""
    time_s = intake.record.time_s
    found: list[tuple[int | None, float, str]] = []
    # No file is opened because a log names it.
    named = {os.path.abspath(fault.file) for fault in intake.faults if fault.file is not None}
    for fault in truth.faults:
        channel = intake.log.channel(fault.channel).name
        name = fault.name or f"{fault.shape}, channel={fault.channel}, onset_s={fault.onset_s:g}"
        if fault.file is not None and os.path.abspath(fault.file) not in named:
            found += [(None, 0.0, name)] if active_samples(fault, time_s).any() else []
            continue
        signal = fault.magnitude * unit_signal(fault, time_s, window_start_s=intake.window_start_s)
        if not np.any(signal):
            continue
        found.append((*_closest(intake, channel, signal), name))
    return found


def _closest(intake: Intake, channel: str, signal: FloatArray) -> tuple[int | None, float]:
    for j, fault in enumerate(intake.faults):
        if fault.channel != channel or j in intake.reasons:
            continue
        atom = unit_signal(fault, intake.record.time_s, window_start_s=intake.window_start_s)
        if not np.any(atom):
            continue
        z = float(atom @ signal) / float(atom @ atom)
        if np.linalg.norm(signal - z * atom) <= SAME_SIGNAL * np.linalg.norm(signal):
            return j, z
    return None, 0.0
