"""From what the scan found to the result: faults in SI, profiles, the model, notes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..faults import Fault, FaultEstimate, magnitude_unit, physical
from ..flightlog.record import frozen_array
from ..kernels.lagged import lagged
from ..kernels.onset.scan import STARTING
from ..kernels.whiteness import exceedances, robust_sd
from ..preprocessing.summary import ModelSummary, model_summary
from ..wording import instant
from .decision import Rule, Verdict
from .estimate import NORMAL, Estimate
from .record import ScanRecord
from .result import OnsetFault, OnsetResult, OnsetSeries, ShapeProfile
from .shapes import fault_of
from .sweep import Peak, Sweep

__all__ = [
    "Scanned",
    "laid_out",
    "model_of",
    "onset_fault",
    "series_of",
    "shape_profile",
    "truth_of",
]

FloatArray = NDArray[np.float64]

MOST, RARE, BESIDE_S = 0.5, 0.05, 1.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scanned:
    """What the scan found.

    Attributes
    ----------
    first, last : sweeps of the outputs as measured and with all faults taken off.
    opening : the verdict on the first; verdicts, estimates : of each fault.
    y : (n_samples, n_outputs) scaled outputs without the faults.
    """

    first: Sweep
    last: Sweep
    opening: Verdict
    verdicts: tuple[Verdict, ...]
    estimates: tuple[Estimate, ...]
    y: FloatArray


def laid_out(record: ScanRecord, rule: Rule, found: Scanned) -> OnsetResult:
    """Return the result of a scan."""
    opening, matches = found.opening, rule.use.matches
    faults = tuple(
        onset_fault(record, estimate, p_value=verdict.p_value if matches else None)
        for verdict, estimate in zip(found.verdicts, found.estimates, strict=True)
    )
    profiles = tuple(
        shape_profile(record, found.first.of(shape), rule.threshold(shape)) for shape in record.settings.shapes
    )
    suspect = () if faults or matches else (_suspect(next(one for one in profiles if one.shape == opening.shape)),)
    return OnsetResult(
        log=record.window.summary,
        decision="fault" if faults else "no_fault",
        false_alarm=rule.false_alarm,
        p_value=opening.p_value if matches else None,
        statistic=opening.statistic,
        threshold=opening.threshold,
        calibration=rule.use,
        faults=faults,
        model=model_of(record, found.first, found.y, order=found.last.plain_order),
        method="scan",
        profiles=profiles,
        time_s=frozen_array(record.time_s),
        series=series_of(record, found.y, order=found.first.plain_order),
        truth=truth_of(record),
        notes=(*suspect, *rule.notes, *_notes(record, faults, found.first.order)),
    )


def onset_fault(record: ScanRecord, found: Estimate, *, p_value: float | None) -> OnsetFault:
    """Return a fault in SI units."""
    output = found.form.output
    channel = record.settings.outputs[output]
    unit, scale = record.window.log.channel(channel).unit, float(record.unit[output])
    magnitude, sd = scale * found.z, scale * found.sd
    fault = fault_of(found.form, channel, magnitude=magnitude, onset_s=found.onset_s, offset_s=found.offset_s)
    value, physical_unit = physical(fault, magnitude, unit)
    return OnsetFault(
        estimate=FaultEstimate(
            name=fault.name or fault.shape,
            fault=fault,
            magnitude=magnitude,
            unit=magnitude_unit(fault, unit),
            physical_value=value,
            physical_unit=physical_unit,
            sd=sd,
            ci95=(magnitude - NORMAL * sd, magnitude + NORMAL * sd),
        ),
        onset_ci95=found.onset_ci95,
        statistic=found.statistic,
        p_value=p_value,
    )


def shape_profile(record: ScanRecord, peak: Peak, threshold: float | None) -> ShapeProfile:
    """Return a shape over the onsets, in SI units."""
    form, profile = peak.form, peak.profile
    channel = record.settings.outputs[form.output]
    scale = float(record.unit[form.output])
    fault = fault_of(form, channel, magnitude=1.0, onset_s=0.0)
    return ShapeProfile(
        shape=form.shape,
        channel=channel,
        unit=magnitude_unit(fault, record.window.log.channel(channel).unit),
        frequency_hz=fault.frequency_hz,
        onset_s=frozen_array([record.onset_s(int(k)) for k in profile.onsets]),
        statistic=frozen_array(profile.statistic),
        magnitude=frozen_array(scale * profile.z),
        sd=frozen_array(scale * profile.sd),
        threshold=threshold,
    )


def model_of(record: ScanRecord, curve: Sweep, y: FloatArray, *, order: int) -> ModelSummary:
    """Return the model that explains the outputs y (n_samples, n_outputs), scaled, without the faults found.

    Parameters
    ----------
    curve : whose criteria over the order are shown.
    """
    settings = record.settings
    several = len(curve.orders) > 1
    return model_summary(
        _prediction_error(record, y, order) * record.unit,
        order=order,
        rate_hz=settings.rate_hz,
        feedthrough=record.feedthrough,
        inputs=settings.inputs,
        outputs=settings.outputs,
        orders=curve.orders if several else (),
        criterion_no_fault=curve.plain if several else (),
        criterion_best=curve.with_fault if several else (),
    )


def _prediction_error(record: ScanRecord, y: FloatArray, order: int) -> FloatArray:
    first = 0 if record.feedthrough else 1
    ones = np.ones((len(y) - order, 1))
    X = np.hstack([ones, lagged(record.u, range(first, order + 1), first=order), lagged(y, range(1, order + 1))])
    error: FloatArray = y[order:] - X @ np.linalg.lstsq(X, y[order:], rcond=None)[0]
    return error


def series_of(record: ScanRecord, y: FloatArray, *, order: int) -> tuple[OnsetSeries, ...]:
    """Return every output as measured and less the faults, and where the plain 5-sigma test fires.

    Parameters
    ----------
    y : (n_samples, n_outputs) scaled outputs without the faults found.
    order : of the fault-free model.
    """
    plain = _prediction_error(record, record.y, order) * record.unit
    measured = record.window.signals.y
    corrected = measured - (record.y - y) * record.unit
    return tuple(
        OnsetSeries(
            channel=name,
            unit=record.window.log.channel(name).unit,
            measured=frozen_array(measured[:, i]),
            corrected=frozen_array(corrected[:, i]),
            plain_alarms_s=tuple(float(record.time_s[order + k]) for k in exceedances(plain[:, i])),
            plain_sd=robust_sd(plain[:, i]),
        )
        for i, name in enumerate(record.settings.outputs)
    )


def truth_of(record: ScanRecord) -> tuple[Fault, ...] | None:
    """Return the injected faults of the log, None where it states none."""
    truth = record.window.log.truth
    return None if truth is None else truth.faults


def _suspect(profile: ShapeProfile) -> str:
    best = int(profile.statistic.argmax())
    size = f"{profile.magnitude[best]:.3g} {profile.unit}".rstrip()
    return (
        f"the strongest suspect is a {profile.shape} of {size} on {profile.channel} from "
        f"{instant(profile.onset_s[best])} s, statistic {profile.statistic[best]:.3g} against "
        f"{profile.threshold:.3g}; a table for these settings "
        "(bfi calibrate), or --calibration gaussian, may decide otherwise"
    )


def _moves_most_s(record: ScanRecord) -> FloatArray:
    """Return the times at which an input changes by at least half of the most it ever does, where that is rare."""
    steps = np.abs(np.diff(record.u, axis=0))
    large = steps >= MOST * steps.max(axis=0, initial=0.0)
    times: FloatArray = record.time_s[1:][large[:, large.mean(axis=0) <= RARE].any(axis=1)]
    return times


def _notes(record: ScanRecord, faults: Sequence[OnsetFault], order: int) -> list[str]:
    notes = [
        f"rate {record.settings.rate_hz:.4g} Hz: {record.window.rate.reason}",
        f"onsets are sought from {instant(record.onset_s(STARTING * order))} s on; a fault from before is absorbed by "
        "the model",
    ]
    moves_s = _moves_most_s(record)
    for one in faults:
        low, high = one.onset_ci95
        if ((moves_s >= low - BESIDE_S) & (moves_s <= high + BESIDE_S)).any():
            notes.append(
                f"'{one.estimate.name}' begins while the inputs move most, where an error of the model looks like a "
                "fault; see whether another --rate or more --input confirm it"
            )
        if high - low > 0.25 * record.settings.duration_s:
            notes.append(f"the onset of '{one.estimate.name}' is hardly known: {instant(low)} to {instant(high)} s")
    return notes
