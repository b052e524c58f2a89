"""From the estimates of a search to the part of the result that every method has: faults in SI, profiles, the model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..faults import FaultEstimate, magnitude_unit, physical
from ..flightlog.record import frozen_array
from ..kernels.whiteness import exceedances, robust_sd
from ..preprocessing.summary import model_summary
from .estimate import NORMAL, Estimate, subtract_faults
from .result import OnsetFault, OnsetResult, OnsetSeries, ShapeProfile
from .scan_record import ScanRecord
from .shapes import fault_of
from .sweep import Peak, Sweep

__all__ = ["assemble_result"]

FloatArray = NDArray[np.float64]


def assemble_result(
    record: ScanRecord,
    sweep: Sweep,
    estimates: Sequence[Estimate],
    p_values: Sequence[float | None],
    *,
    order: int,
    series_order: int,
) -> OnsetResult:
    """Return the result of a search that declares a fault, without a threshold, a null distribution and notes.

    Parameters
    ----------
    sweep : of the outputs as measured; its criteria over the order are shown.
    estimates, p_values : of each fault.
    order : of the model without the faults; series_order : of that of the outputs as measured, which may hold faults.
    """
    settings, unit = record.settings, record.unit
    y = subtract_faults(record.y, *estimates)
    several = len(sweep.orders) > 1
    plain = record.without_fault(record.y, series_order).error * unit
    measured = record.window.signals.y
    corrected = measured - (record.y - y) * unit
    truth = record.window.log.truth
    return OnsetResult(
        log=record.window.summary,
        decision="fault",
        false_alarm=0.0,
        p_value=None,
        statistic=estimates[0].statistic if estimates else 0.0,
        threshold=None,
        calibration=None,
        faults=tuple(_fault(record, one, p_value) for one, p_value in zip(estimates, p_values, strict=True)),
        model=model_summary(
            record.without_fault(y, order).error * unit,
            order=order,
            rate_hz=settings.rate_hz,
            feedthrough=record.feedthrough,
            inputs=settings.inputs,
            outputs=settings.outputs,
            orders=sweep.orders if several else (),
            criterion_no_fault=sweep.plain if several else (),
            criterion_best=sweep.with_fault if several else (),
        ),
        method="scan",
        profiles=tuple(
            _shape_profile(record, sweep.of(shape)) for shape in dict.fromkeys(one.form.shape for one in sweep.peaks)
        ),
        time_s=frozen_array(record.time_s),
        series=tuple(
            OnsetSeries(
                channel=name,
                unit=record.window.log.channel(name).unit,
                measured=frozen_array(measured[:, i]),
                corrected=frozen_array(corrected[:, i]),
                plain_alarms_s=tuple(float(record.time_s[series_order + k]) for k in exceedances(plain[:, i])),
                plain_sd=robust_sd(plain[:, i]),
            )
            for i, name in enumerate(settings.outputs)
        ),
        truth=None if truth is None else truth.faults,
        notes=(),
    )


def _fault(record: ScanRecord, estimate: Estimate, p_value: float | None) -> OnsetFault:
    """Return a fault in SI units."""
    output = estimate.form.output
    channel = record.settings.outputs[output]
    unit, scale = record.window.log.channel(channel).unit, float(record.unit[output])
    magnitude, sd = scale * estimate.z, scale * estimate.sd
    fault = fault_of(estimate.form, channel, magnitude=magnitude, onset_s=estimate.onset_s, offset_s=estimate.offset_s)
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
        onset_ci95=estimate.onset_ci95,
        statistic=estimate.statistic,
        p_value=p_value,
    )


def _shape_profile(record: ScanRecord, peak: Peak) -> ShapeProfile:
    """Return a shape over the onsets, in SI units."""
    form, profile = peak.form, peak.profile
    channel, scale = record.settings.outputs[form.output], float(record.unit[form.output])
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
        threshold=None,
    )
