"""The result of the scan over all onsets, how it is assembled, and the dictionary it proposes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..decision import KINDS, Candidate, Evidence, ScanLimit, estimate_of
from ..faults import Decision, Fault, FaultEstimate, magnitude_unit
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.whiteness import exceedances, robust_sd
from ..notes import Note
from ..plausibility.finding import Implausible
from ..preprocessing.summary import LogSummary, ModelSummary, noise_of
from ..shapes import Kind
from .estimate import Estimate, subtract_faults
from .scan import HypothesisScan, Peak
from .scan_record import ScanRecord
from .shapes import fault_of


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationUse:
    """Which null distribution the decision rests on.

    Attributes
    ----------
    source : "shipped", "self" (windows of the log itself), "gaussian", or the path of a table.
    matches : whether the table was made for the settings in use.
    n_windows : number of fault-free windows, or of simulated records, behind it.
    length_s : of each, after conditioning.
    """

    source: str
    matches: bool
    n_windows: int
    length_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeProfile:
    """One shape at every onset of the record as measured; arrays are (n_onsets,).

    Attributes
    ----------
    frequency_hz : the likeliest frequency, None for a shape that has none.
    threshold : of the statistic, None where the method has none.
    """

    shape: str
    channel: str
    unit: str
    frequency_hz: float | None
    onset_s: FloatArray
    statistic: FloatArray
    magnitude: FloatArray
    sd: FloatArray
    threshold: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnsetSeries:
    """One output along time; arrays are (n_samples,), in `unit`.

    Attributes
    ----------
    measured, corrected : the filtered output, and the same less the declared faults.
    plain_alarms_s : times at which the 5-sigma test on the residual of the fault-free model raises an alarm.
    plain_sd : the sigma of that test.
    """

    channel: str
    unit: str
    measured: FloatArray
    corrected: FloatArray
    plain_alarms_s: tuple[float, ...]
    plain_sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnsetResult:
    """The whole answer of `bfi start-time`.

    Attributes
    ----------
    verdicts : on each kind of fault; candidates : every shape on every output, see `bfi_cli.decision`.
    summary : what the log says of the kinds of which no fault is declared.
    covered_s : first and last onset for which the claims hold, None where none is made.
    of_dictionary : limits of the faults that were asked for, in their order.
    statistic, threshold : 2 log of the likelihood ratio of the shape that stands out most, and what it must exceed.
    p_value : of the largest standardised statistic, a bound where it is 1 / (n + 1) of n windows; None where no
        calibration fits the settings.
    time_s : (n_samples,) of the series.
    truth : injected faults that the log states, times on its axis; None where it states none.
    """

    log: LogSummary
    decision: Decision
    verdicts: Mapping[Kind, Decision]
    candidates: tuple[Candidate, ...]
    summary: str
    covered_s: tuple[float, float] | None = None
    of_dictionary: tuple[ScanLimit | None, ...] = ()
    false_alarm: float
    p_value: float | None
    statistic: float
    threshold: float | None
    calibration: CalibrationUse | None
    faults: tuple[FaultEstimate, ...]
    model: ModelSummary
    method: str
    profiles: tuple[ShapeProfile, ...]
    time_s: FloatArray
    series: tuple[OnsetSeries, ...]
    truth: tuple[Fault, ...] | None
    notes: tuple[Note, ...]
    plausibility: tuple[Implausible, ...] = ()

    @property
    def evidence(self) -> Evidence:
        """What the search says, before any conclusion."""
        return Evidence(source="scan", faults=self.faults, candidates=self.candidates)

    @property
    def is_trusted(self) -> bool:
        """Whether the log could tell, and how rare such a statistic is without a fault is known."""
        return self.decision != "inconclusive" and self.p_value is not None


def assemble_result(
    record: ScanRecord,
    scan: HypothesisScan,
    estimates: Sequence[Estimate],
    p_values: Sequence[float | None],
    tolerances: Mapping[str, float],
    *,
    order: int,
    series_order: int,
) -> OnsetResult:
    """Return the result of a search that declares a fault, in SI, without threshold, null distribution and notes.

    Parameters
    ----------
    scan : of the outputs as measured; its criteria over the order are shown.
    estimates, p_values : of each fault; tolerances : by output.
    order : of the model without the faults; series_order : of that of the outputs as measured, which may hold faults.
    """
    settings, log = record.settings, record.window.log
    y = subtract_faults(record.y, *estimates)
    several = len(scan.orders) > 1
    residual = record.without_fault(record.y, series_order).error * record.unit
    measured = record.window.signals.y
    corrected = measured - (record.y - y) * record.unit
    return OnsetResult(
        log=record.window.summary,
        decision="inconclusive",
        verdicts=dict.fromkeys(KINDS, "inconclusive"),
        candidates=(),
        summary="",
        false_alarm=0.0,
        p_value=None,
        statistic=estimates[0].statistic if estimates else 0.0,
        threshold=None,
        calibration=None,
        faults=tuple(
            _declared(record, estimate, p_value, tolerances)
            for estimate, p_value in zip(estimates, p_values, strict=True)
        ),
        model=ModelSummary(
            order=order,
            rate_hz=settings.rate_hz,
            feedthrough=record.layout.feedthrough,
            inputs=settings.inputs,
            outputs=settings.outputs,
            noise_sd=noise_of(record.without_fault(y, order).error * record.unit, settings.outputs),
            orders=tuple(scan.orders) if several else (),
            criterion_no_fault=tuple(scan.without_fault) if several else (),
            criterion_best=tuple(scan.with_fault) if several else (),
        ),
        method="scan",
        profiles=tuple(
            _profile_of(record, scan.of(shape)) for shape in dict.fromkeys(peak.form.shape for peak in scan.peaks)
        ),
        time_s=frozen_array(record.time_s),
        series=tuple(
            OnsetSeries(
                channel=name,
                unit=log.channel(name).unit,
                measured=frozen_array(measured[:, i]),
                corrected=frozen_array(corrected[:, i]),
                plain_alarms_s=tuple(float(record.time_s[series_order + k]) for k in exceedances(residual[:, i])),
                plain_sd=robust_sd(residual[:, i]),
            )
            for i, name in enumerate(settings.outputs)
        ),
        truth=None if log.truth is None else log.truth.faults,
        notes=(),
    )


def _declared(
    record: ScanRecord, estimate: Estimate, p_value: float | None, tolerances: Mapping[str, float]
) -> FaultEstimate:
    """Return a declared fault in SI."""
    channel, scale, unit = record.output(estimate.form.output)
    magnitude, onset_s, offset_s = scale * estimate.z, estimate.onset_s, estimate.offset_s
    return estimate_of(
        fault_of(estimate.form, channel, magnitude=magnitude, onset_s=onset_s, offset_s=offset_s),
        magnitude,
        scale * estimate.sd,
        unit,
        effect=scale * float(np.abs(estimate.signal).max()),
        tolerance=tolerances[channel],
        onset_ci95=estimate.onset_ci95,
        statistic=estimate.statistic,
        p_value=p_value,
        among=estimate.among,
    )


def _profile_of(record: ScanRecord, peak: Peak) -> ShapeProfile:
    """Return the profile of a hypothesis in SI, without a threshold."""
    channel, scale, unit = record.output(peak.form.output)
    fault = fault_of(peak.form, channel)
    return ShapeProfile(
        shape=peak.form.shape,
        channel=channel,
        unit=magnitude_unit(fault, unit),
        frequency_hz=fault.frequency_hz,
        onset_s=frozen_array(record.onsets_s(peak.profile.onsets)),
        statistic=frozen_array(peak.profile.statistic),
        magnitude=frozen_array(scale * peak.profile.z),
        sd=frozen_array(scale * peak.profile.sd),
        threshold=None,
    )
