"""Detection from end to end: prepare, watch, lay out what was found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..preprocessing.summary import log_summary
from ..wording import instant
from .exact import LEVEL, Exact, exactly
from .record import Prepared, Sampled, prepare, sampled
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel
from .settings import DetectSettings
from .watch import Failure, Watched, watch

__all__ = ["detect_faults"]

FloatArray = NDArray[np.float64]

AFTER_S = 30.0
SLOW = "a failure that grows slowly is learnt as normal; bfi start-time looks for drifts"


def _silent(_done: int, _total: int) -> None:
    pass


def detect_faults(
    log: FlightLog, settings: DetectSettings, *, report: Callable[[int, int], None] = _silent
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
        prepared = prepare(log, settings)
        if settings.method == "exact" or (settings.method == "auto" and prepared.exact):
            exact = exactly(prepared)
            if exact.explained or settings.method == "exact":
                return _exact(log, prepared, settings, exact)
        return _by_parity(log, prepared, settings, report)


def _exact(log: FlightLog, prepared: Prepared, settings: DetectSettings, exact: Exact) -> DetectResult:
    """Lay out what the right null space of the last samples says of each output, at the log's own rate (paper H)."""
    record, found = prepared.record, exact.found
    alarms = [
        Alarm(
            channel=prepared.outputs[k],
            time_s=float(record.time_s[i]),
            onset_s=float(record.time_s[i]),
            statistic=float(found.channel[i, k]),
            threshold=LEVEL,
            size=None,
            unit=prepared.units[k],
        )
        for i, k in exact.failures
    ]
    first = {alarm.channel: alarm.time_s for alarm in reversed(alarms)}
    return DetectResult(
        log=log_summary(log.path, record.time_s, rate_hz=record.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="fault" if alarms else "no_fault",
        method="exact",
        inputs=prepared.inputs,
        outputs=prepared.outputs,
        false_alarm=settings.false_alarm,
        alarms=tuple(alarms),
        is_calibrated=exact.explained,
        ready_s=None if found.ready is None else float(record.time_s[found.ready - 1]),
        train=prepared.train,
        calibration=None,
        model=None,
        width=exact.width,
        time_s=frozen_array(record.time_s),
        series=tuple(
            _series(prepared, k, record.y, found.channel[:, k], LEVEL, first.get(name))
            for k, name in enumerate(prepared.outputs)
        ),
        commands=_next(prepared, alarms),
        notes=_exact_notes(exact),
    )


def _exact_notes(exact: Exact) -> tuple[str, ...]:
    ready = () if exact.found.ready is None else (f"ready after {exact.found.ready} samples",)
    if not exact.explained:
        return (
            "the healthy time is not explained to round-off: this log has noise, or needs more channels, and the "
            "alarms mean nothing; give --method parity",
            *ready,
        )
    return (
        f"a linear model of order {exact.lags} explains the healthy time to round-off, so the criterion is that of "
        f"data without noise: a channel fails where more than {LEVEL:g} of its own size is left in a window of "
        f"{exact.width} samples",
        *ready,
    )


def _by_parity(
    log: FlightLog, prepared: Prepared, settings: DetectSettings, report: Callable[[int, int], None]
) -> DetectResult:
    """Watch the parity residuals of the record at the rate of the analysis."""
    samples = sampled(prepared, prepared.choice.factor)
    failures, passes = watch(log.path, samples, false_alarm=settings.false_alarm, report=report)
    alarms = [_alarm(prepared, samples, failure) for failure in failures]
    return DetectResult(
        log=log_summary(log.path, samples.time_s, rate_hz=samples.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="fault" if alarms else "no_fault",
        method="parity",
        inputs=prepared.inputs,
        outputs=prepared.outputs,
        false_alarm=settings.false_alarm,
        alarms=tuple(alarms),
        is_calibrated=passes[0].threshold.tail is not None,
        ready_s=prepared.watch_s,
        train=prepared.train,
        calibration=_calibration(prepared, samples, passes[0]),
        model=_model(prepared, passes[0]),
        width=None,
        time_s=frozen_array(samples.time_s),
        series=tuple(_watched(prepared, samples, i, failures, passes) for i in range(len(prepared.outputs))),
        commands=_next(prepared, alarms),
        notes=(*prepared.notes, *_notes(prepared, passes[0])),
    )


def _alarm(prepared: Prepared, samples: Sampled, failure: Failure) -> Alarm:
    return Alarm(
        channel=prepared.outputs[failure.output],
        time_s=float(samples.time_s[failure.sample] + samples.reach_s),
        onset_s=float(samples.time_s[failure.onset]),
        statistic=failure.deviate,
        threshold=failure.level,
        size=failure.size,
        unit=prepared.units[failure.output],
    )


def _watched(
    prepared: Prepared, samples: Sampled, i: int, failures: list[Failure], passes: list[Watched]
) -> ChannelSeries:
    """Return a channel as the last pass that watched it saw it."""
    seen = [one for one in passes if i in one.channels][-1]
    k = seen.channels.index(i)
    statistic = np.full(len(samples.time_s), np.nan)
    statistic[seen.model.samples[seen.model.errors.start :]] = seen.drops.deviate[:, k]
    failed = next((one for one in failures if one.output == i), None)
    until_s = None if failed is None else float(samples.time_s[failed.sample])
    return _series(prepared, i, samples.y, statistic, float(seen.threshold.level[k]), until_s)


def _series(
    prepared: Prepared, i: int, y: FloatArray, statistic: FloatArray, threshold: float, until_s: float | None
) -> ChannelSeries:
    return ChannelSeries(
        channel=prepared.outputs[i],
        unit=prepared.units[i],
        measured=frozen_array(y[:, i]),
        statistic=frozen_array(statistic),
        threshold=threshold,
        watched_until_s=until_s,
    )


def _calibration(prepared: Prepared, samples: Sampled, seen: Watched) -> Calibration:
    model, threshold = seen.model, seen.threshold
    first, last = model.samples[model.errors.start], model.samples[model.n_healthy - 1]
    return Calibration(
        held_back_s=(float(samples.time_s[first]), float(samples.time_s[last])),
        n_blocks=len(threshold.maxima),
        white_level=threshold.white,
        level=threshold.white if threshold.tail is None else max(threshold.tail, threshold.white),
        heavy=threshold.tail is not None and threshold.tail > threshold.white,
        scale={prepared.outputs[i]: float(s) for i, s in zip(seen.channels, threshold.scale, strict=True)},
        block_maxima=frozen_array(threshold.maxima),
    )


def _model(prepared: Prepared, seen: Watched) -> ParityModel:
    model = seen.model
    return ParityModel(
        lags=model.lags,
        rank=model.rank,
        n_stacked=model.lags * len(seen.channels),
        forgetting=model.forgetting,
        n_fitted=model.n_healthy,
        noise_sd={prepared.outputs[i]: float(sd) for i, sd in zip(seen.channels, model.unit, strict=True)},
    )


def _notes(prepared: Prepared, seen: Watched) -> tuple[str, ...]:
    threshold = seen.threshold
    notes = [f"rate: {prepared.choice.reason}", SLOW]
    if threshold.tail is None:
        notes.append(
            f"the healthy time has {len(threshold.maxima)} independent stretches to calibrate on, too few to see heavy "
            "tails: the threshold assumes white noise; give a longer --train"
        )
        higher = [prepared.outputs[i] for i, s in zip(seen.channels, threshold.scale, strict=True) if s > 1.0]
        if higher:
            notes.append(
                f"{', '.join(higher)}: held-back healthy data came close to the threshold of white noise or passed it, "
                "so it is higher there: the model predicts the healthy time badly"
            )
    elif threshold.tail > threshold.white:
        notes.append(
            f"held-back healthy data are heavier-tailed than white noise ({threshold.tail:.3g} instead of "
            f"{threshold.white:.3g} standard deviations): the threshold is that of their tail, taken to be exponential"
        )
    return tuple(notes)


def _next(prepared: Prepared, alarms: list[Alarm]) -> tuple[str, ...]:
    """Return the command that identifies the failure of the first channel."""
    if not alarms:
        return ()
    first, start_s, stop_s = alarms[0], float(prepared.record.time_s[0]), float(prepared.record.time_s[-1])
    from_s, to_s = max(start_s, first.onset_s - 2.0 * AFTER_S), min(stop_s, first.onset_s + 2.0 * AFTER_S)
    inputs = "".join(f" --input {name}" for name in prepared.inputs)
    window = f"--from {instant(from_s)} --to {instant(to_s)}"
    command = f"bfi identify {prepared.record.path}{inputs} --output {first.channel} {window}"
    return (command,)
