"""The result of a detection: frozen data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ..decision import Candidate
from ..decision.implausible import Implausible
from ..faults import Decision
from ..faults.shapes import Kind
from ..kernels import FloatArray
from ..model.result import LogSummary
from ..notes import Note
from ..report.presented import Presented


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """A channel declared to have failed.

    Attributes
    ----------
    time_s : of the last sample the decision needed, the filter's reach included.
    onset_s : estimated beginning of the failure.
    statistic, threshold : at that time; the deviate of the parity residuals, or the criterion relative to the
        channel's own size.
    size, ci95 : estimated step in the channel's unit and its 95 % interval; None where they are not determined: the
        method gives none, or too little of the step was seen.
    """

    channel: str
    time_s: float
    onset_s: float
    statistic: float
    threshold: float
    size: float | None
    unit: str
    ci95: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """Where the threshold comes from.

    Attributes
    ----------
    held_back_s : the part of the healthy time that was predicted, not fitted.
    n_blocks : number of independent stretches in it.
    white_level : deviate that white noise exceeds with the wanted probability.
    level : the threshold before it is scaled for a channel.
    heavy : whether the held-back deviates have a heavier tail than white noise, which then sets the threshold.
    scale : by channel, how much larger its deviates are than those of white noise.
    block_maxima : (n_blocks,) largest deviate of each stretch.
    """

    held_back_s: tuple[float, float]
    n_blocks: int
    white_level: float
    level: float
    heavy: bool
    scale: Mapping[str, float]
    block_maxima: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ParityModel:
    """The regression that predicts the outputs.

    Attributes
    ----------
    lags : of the stacked past, which has `n_stacked` components; rank : number of those that are used.
    forgetting : weight of a row relative to the next; n_fitted : number of healthy rows.
    noise_sd : by output, one-step prediction error on the held-back rows.
    """

    lags: int
    rank: int
    n_stacked: int
    forgetting: float
    n_fitted: int
    noise_sd: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepLimits:
    """Steps that could have stayed unseen, (n_onsets, n_outputs) each, in the units of the outputs.

    Attributes
    ----------
    onset_s : (n_onsets,) those that the claim covers.
    size, sd : of the step that would explain the record best.
    detectable : step that would be declared with 90 % power.
    hidden : step beyond which the record excludes one.
    """

    onset_s: FloatArray
    size: FloatArray
    sd: FloatArray
    detectable: FloatArray
    hidden: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """The outcome of a method on a record.

    Attributes
    ----------
    time_s : (n_samples,), y : (n_samples, n_outputs) of the analysis.
    statistic : (n_samples, n_outputs), NaN where there is none; threshold : (n_outputs,).
    reach_s : from a statistic to the last sample of the log that it was made of.
    limits : None where nothing can be said of what was not declared.

    The others are those of `DetectResult`.
    """

    method: Literal["exact", "parity"]
    rate_hz: float
    time_s: FloatArray
    y: FloatArray
    statistic: FloatArray
    threshold: FloatArray
    alarms: tuple[Alarm, ...]
    limits: StepLimits | None
    is_calibrated: bool
    ready_s: float | None
    notes: tuple[Note, ...]
    reach_s: float = 0.0
    calibration: Calibration | None = None
    model: ParityModel | None = None
    width: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelSeries:
    """One output over the analysed window, (n_samples,) each; NaN where there is no statistic.

    `watched_until_s` is when the channel failed and was left out of what is watched, None where it never did.
    """

    channel: str
    unit: str
    measured: FloatArray
    statistic: FloatArray
    threshold: float
    watched_until_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class DetectResult(Presented):
    """The result of `detect_faults`.

    Attributes
    ----------
    verdicts : on each kind of fault; oscillations and slow faults are not looked for.
    candidates : a step in every channel watched, see `bfi_cli.decision`.
    summary : what the log says of the kinds of which no fault is declared.
    method : "exact", the right null space of the paper, or "parity", its form for noisy records.
    inputs, outputs : those used.
    is_calibrated : whether the rate of false alarms can be relied on: noise-free data are explained to round-off, or
        the healthy time was long enough to estimate the tails of its errors.
    ready_s : when the detector began to watch.
    train : healthy time, None where none was needed.
    watched : (from_s, to_s) of the stretches of flight that were watched.
    width : columns of a window of the exact method, None for parity residuals.
    time_s : (n_samples,) of the series.
    commands : what to run next to identify the first failure.
    """

    makers = ("detection.report", "detect_content", "detect_document")

    log: LogSummary
    decision: Decision
    verdicts: Mapping[Kind, Decision]
    candidates: tuple[Candidate, ...]
    summary: str
    method: Literal["exact", "parity"]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    false_alarm: float
    alarms: tuple[Alarm, ...]
    is_calibrated: bool
    ready_s: float | None
    train: tuple[float, float] | None
    watched: tuple[tuple[float, float], ...]
    calibration: Calibration | None
    model: ParityModel | None
    width: int | None
    time_s: FloatArray
    series: tuple[ChannelSeries, ...]
    commands: tuple[str, ...]
    notes: tuple[Note, ...]
    plausibility: tuple[Implausible, ...] = ()

    @property
    def is_trusted(self) -> bool:
        """Whether the log could tell, and the threshold is known to hold."""
        return self.decision != "inconclusive" and self.is_calibrated
