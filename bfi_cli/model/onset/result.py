"""The answer of the scan over all onsets, as a document has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...decision import Candidate, Conclusion, Proof
from ...decision.implausible import Implausible
from ...faults import Decision, Fault, FaultEstimate
from ...faults.shapes import Kind
from ...flightlog.record import frozen_array
from ...kernels import FloatArray
from ...kernels.whiteness import exceedances, robust_sd
from ...notes import Note
from ...report.presented import Presented
from ..result import LogSummary, ModelSummary
from .decision import Rule
from .estimate import subtract_faults
from .scan import Peak
from .scan_record import ScanRecord
from .search import OnsetSearch


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class OnsetResult(Presented):
    """The whole answer of `bfi start-time`.

    Attributes
    ----------
    verdicts : on each kind of fault; candidates : every shape on every output, see `bfi_cli.decision`.
    summary : what the log says of the kinds of which no fault is declared.
    covered_s : first and last onset for which the claims hold, None where the method makes no claim.
    statistic, threshold : 2 log of the likelihood ratio of the shape that stands out most, and what it must exceed.
    p_value : of the largest standardised statistic, a bound where it is 1 / (n + 1) of n windows; None where no
        calibration fits the settings.
    time_s : (n_samples,) of the series.
    truth : injected faults that the log states, times on its axis; None where it states none.
    proved : what the limits are worth on this log; empty where that was not asked for.
    """

    makers = ("model.onset.report", "onset_content", "onset_document")

    log: LogSummary
    decision: Decision
    verdicts: Mapping[Kind, Decision]
    candidates: tuple[Candidate, ...]
    summary: str
    covered_s: tuple[float, float] | None = None
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
    proved: tuple[Proof, ...] = ()

    @property
    def channel_units(self) -> dict[str, str]:
        """Units of the outputs."""
        return {series.channel: series.unit for series in self.series}

    @property
    def is_trusted(self) -> bool:
        """Whether the log could tell, and the p-value of the statistic is known."""
        return self.decision != "inconclusive" and self.p_value is not None


def onset_result(search: OnsetSearch, conclusion: Conclusion, false_alarm: float, notes: Sequence[Note]) -> OnsetResult:
    """Return the answer of a search and a conclusion from its evidence, in SI.

    Parameters
    ----------
    false_alarm : rate at which the sources decide; notes : those of all sources.
    """
    record, rule, highest = search.record, search.rule, search.highest
    log = record.window.log
    statistic = search.estimates[0].statistic if search.estimates else 0.0
    return OnsetResult(
        log=record.window.summary,
        decision=conclusion.decision,
        verdicts=conclusion.verdicts,
        candidates=conclusion.candidates,
        summary=conclusion.summary,
        covered_s=search.covered_s,
        false_alarm=false_alarm,
        p_value=search.p_value,
        statistic=highest.statistic if highest else statistic,
        threshold=rule.threshold(highest.form.shape) if rule and highest else None,
        calibration=None
        if rule is None
        else CalibrationUse(
            source=rule.source,
            matches=rule.matches,
            n_windows=rule.table.n_windows,
            length_s=rule.table.settings.duration_s,
        ),
        faults=conclusion.faults,
        model=search.model,
        method=search.method,
        profiles=tuple(_profile_of(record, peak, rule) for peak in search.peaks),
        time_s=frozen_array(record.time_s),
        series=_series_of(search),
        truth=None if log.truth is None else log.truth.faults,
        notes=tuple(notes),
        plausibility=conclusion.plausibility,
    )


def _series_of(search: OnsetSearch) -> tuple[OnsetSeries, ...]:
    """Return the outputs as measured and less the faults, with the alarms of the plain residual test."""
    record = search.record
    residual = record.without_fault(record.y, search.series_order).error * record.unit
    measured = record.window.signals.y
    corrected = measured - (record.y - subtract_faults(record.y, *search.estimates)) * record.unit
    return tuple(
        OnsetSeries(
            channel=name,
            unit=record.window.log.channel(name).unit,
            measured=frozen_array(measured[:, i]),
            corrected=frozen_array(corrected[:, i]),
            plain_alarms_s=tuple(float(record.time_s[search.series_order + k]) for k in exceedances(residual[:, i])),
            plain_sd=robust_sd(residual[:, i]),
        )
        for i, name in enumerate(record.settings.outputs)
    )


def _profile_of(record: ScanRecord, peak: Peak, rule: Rule | None) -> ShapeProfile:
    """Return the profile of a hypothesis in SI."""
    channel, scale, unit = record.magnitude(peak.form)
    return ShapeProfile(
        shape=peak.form.shape,
        channel=channel,
        unit=unit,
        frequency_hz=peak.form.frequency_hz,
        onset_s=frozen_array(record.onsets_s(peak.profile.onsets)),
        statistic=frozen_array(peak.profile.statistic),
        magnitude=frozen_array(scale * peak.profile.z),
        sd=frozen_array(scale * peak.profile.sd),
        threshold=None if rule is None else rule.threshold(peak.form.shape),
    )
