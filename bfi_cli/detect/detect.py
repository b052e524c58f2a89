"""Detection from end to end: prepare the record, declare the channels that fail, make the result."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..preprocessing.summary import log_summary
from ..report.text import instant
from .nullspace import LEVEL, NullSpaceCriteria, null_space_criteria
from .parity import DetectionThreshold, Failure, MonitoringPass, detect_sequentially
from .preparation import DecimatedRecord, DetectSettings, PreparedRecord, decimate_record, prepare_record
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel

__all__ = ["detect_faults"]

FloatArray = NDArray[np.float64]

# Seconds on either side of the onset that the next command analyses: about two of the records of T, 31.7 s each.
AROUND_S = 60.0
SLOW = "a failure that grows slowly is learnt as normal; bfi start-time looks for drifts"


def detect_faults(
    log: FlightLog,
    settings: DetectSettings,
    *,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> DetectResult:
    """Say which channel of a log fails, and when, without a model and without a dictionary.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    settings : what to watch, and how.
    report : told how many channels have been declared, of how many.

    Raises
    ------
    LogError : the log cannot be used.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    with threadpool_limits(1):
        prepared = prepare_record(log, settings)
        if settings.method == "exact" or (settings.method == "auto" and prepared.exact):
            exact = null_space_criteria(prepared)
            if exact.explained or settings.method == "exact":
                return _exact_result(log, prepared, settings, exact)
        samples = decimate_record(prepared, prepared.choice.factor)
        failures, passes = detect_sequentially(log.path, samples, false_alarm=settings.false_alarm, report=report)
        return _parity_result(log, prepared, settings, samples, failures, passes)


def _exact_result(
    log: FlightLog, prepared: PreparedRecord, settings: DetectSettings, exact: NullSpaceCriteria
) -> DetectResult:
    """Return what the right null space of the last samples says of each output, at the log's own rate (paper H)."""
    record, channel, ready = prepared.record, exact.criteria.channel, exact.criteria.ready
    alarms = [
        Alarm(
            channel=prepared.outputs[k],
            time_s=float(record.time_s[i]),
            onset_s=float(record.time_s[i]),
            statistic=float(channel[i, k]),
            threshold=LEVEL,
            size=None,
            unit=prepared.units[k],
        )
        for i, k in exact.failures
    ]
    first = {alarm.channel: alarm.time_s for alarm in reversed(alarms)}
    if exact.explained:
        note = (
            f"a linear model of order {exact.lags} explains the healthy time to round-off, so the criterion is that of "
            f"data without noise: a channel fails where more than {LEVEL:g} of its own size is left in a window of "
            f"{exact.width} samples"
        )
    else:
        note = (
            "the healthy time is not explained to round-off: this log has noise, or needs more channels, and the "
            "alarms mean nothing; give --method parity"
        )
    return DetectResult(
        log=log_summary(log.path, record.time_s, rate_hz=record.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="fault" if alarms else "no_fault",
        method="exact",
        inputs=prepared.inputs,
        outputs=prepared.outputs,
        false_alarm=settings.false_alarm,
        alarms=tuple(alarms),
        is_calibrated=exact.explained,
        ready_s=None if ready is None else float(record.time_s[ready - 1]),
        train=prepared.train,
        calibration=None,
        model=None,
        width=exact.width,
        time_s=frozen_array(record.time_s),
        series=tuple(
            _series(prepared, k, record.y, channel[:, k], LEVEL, first.get(name))
            for k, name in enumerate(prepared.outputs)
        ),
        commands=_next(prepared, alarms),
        notes=(note, *(() if ready is None else (f"ready after {ready} samples",))),
    )


def _parity_result(
    log: FlightLog,
    prepared: PreparedRecord,
    settings: DetectSettings,
    samples: DecimatedRecord,
    failures: list[Failure],
    passes: list[MonitoringPass],
) -> DetectResult:
    """Return what the parity residuals of the record say at the rate of the analysis; the first pass is calibrated."""
    alarms = [
        Alarm(
            channel=prepared.outputs[failure.output],
            time_s=float(samples.time_s[failure.sample] + samples.reach_s),
            onset_s=float(samples.time_s[failure.onset]),
            statistic=failure.deviate,
            threshold=failure.level,
            size=failure.size,
            unit=prepared.units[failure.output],
        )
        for failure in failures
    ]
    failed_s = {failure.output: float(samples.time_s[failure.sample]) for failure in failures}
    series = []
    for i in range(len(prepared.outputs)):
        last = next(monitoring for monitoring in reversed(passes) if i in monitoring.channels)
        k, own = last.channels.index(i), last.model
        statistic = np.full(len(samples.time_s), np.nan)
        statistic[own.samples[own.errors.start :]] = last.drops.deviate[:, k]
        level = float(last.threshold.level[k])
        series.append(_series(prepared, i, samples.y, statistic, level, failed_s.get(i)))
    model, threshold = passes[0].model, passes[0].threshold
    held_back = model.samples[model.errors.start], model.samples[model.n_healthy - 1]
    return DetectResult(
        log=log_summary(log.path, samples.time_s, rate_hz=samples.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="fault" if alarms else "no_fault",
        method="parity",
        inputs=prepared.inputs,
        outputs=prepared.outputs,
        false_alarm=settings.false_alarm,
        alarms=tuple(alarms),
        is_calibrated=threshold.tail is not None,
        ready_s=prepared.watch_s,
        train=prepared.train,
        calibration=Calibration(
            held_back_s=(float(samples.time_s[held_back[0]]), float(samples.time_s[held_back[1]])),
            n_blocks=len(threshold.maxima),
            white_level=threshold.white,
            level=threshold.white if threshold.tail is None else max(threshold.tail, threshold.white),
            heavy=threshold.tail is not None and threshold.tail > threshold.white,
            scale=dict(zip(prepared.outputs, threshold.scale.tolist(), strict=True)),
            block_maxima=frozen_array(threshold.maxima),
        ),
        model=ParityModel(
            lags=model.lags,
            rank=model.rank,
            n_stacked=model.lags * len(prepared.outputs),
            forgetting=model.forgetting,
            n_fitted=model.n_healthy,
            noise_sd=dict(zip(prepared.outputs, model.unit.tolist(), strict=True)),
        ),
        width=None,
        time_s=frozen_array(samples.time_s),
        series=tuple(series),
        commands=_next(prepared, alarms),
        notes=(*prepared.notes, f"rate: {prepared.choice.reason}", SLOW, *_threshold_notes(prepared, threshold)),
    )


def _series(
    prepared: PreparedRecord, i: int, y: FloatArray, statistic: FloatArray, threshold: float, until_s: float | None
) -> ChannelSeries:
    return ChannelSeries(
        channel=prepared.outputs[i],
        unit=prepared.units[i],
        measured=frozen_array(y[:, i]),
        statistic=frozen_array(statistic),
        threshold=threshold,
        watched_until_s=until_s,
    )


def _threshold_notes(prepared: PreparedRecord, threshold: DetectionThreshold) -> list[str]:
    """Say what the held-back healthy time means for the threshold."""
    if threshold.tail is not None:
        if threshold.tail <= threshold.white:
            return []
        return [
            f"held-back healthy data are heavier-tailed than white noise ({threshold.tail:.3g} instead of "
            f"{threshold.white:.3g} standard deviations): the threshold is that of their tail, taken to be exponential"
        ]
    notes = [
        f"the healthy time has {len(threshold.maxima)} independent stretches to calibrate on, too few to see heavy "
        "tails: the threshold assumes white noise; give a longer --train"
    ]
    higher = [name for name, scale in zip(prepared.outputs, threshold.scale, strict=True) if scale > 1.0]
    if higher:
        notes.append(
            f"{', '.join(higher)}: held-back healthy data came close to the threshold of white noise or passed it, "
            "so it is higher there: the model predicts the healthy time badly"
        )
    return notes


def _next(prepared: PreparedRecord, alarms: list[Alarm]) -> tuple[str, ...]:
    """Return the command that identifies the failure of the first channel."""
    if not alarms:
        return ()
    first, start_s, stop_s = alarms[0], float(prepared.record.time_s[0]), float(prepared.record.time_s[-1])
    from_s, to_s = max(start_s, first.onset_s - AROUND_S), min(stop_s, first.onset_s + AROUND_S)
    inputs = "".join(f" --input {name}" for name in prepared.inputs)
    window = f"--from {instant(from_s)} --to {instant(to_s)}"
    command = f"bfi identify {prepared.record.path}{inputs} --output {first.channel} {window}"
    return (command,)
