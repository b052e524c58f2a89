"""Detection from end to end: by the right null space for data without noise (paper H), else by parity residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from ..config import Config
from ..decision import KINDS, decide, summarise, verdicts_of
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.nullspace import criteria, past_rank
from ..preprocessing.sampling_rate import SAMPLES_PER_EDGE
from ..preprocessing.summary import log_summary
from ..preprocessing.tolerance import tolerances_of
from ..report.text import instant
from .claims import ABSORBED, SMEARED, StepLimits, candidates_of, exact_limits, parity_limits
from .parity import LASTING_IN_GUSTS, PATCH_S, DetectionThreshold, detect_sequentially
from .preparation import FELT, UNSTATED_HZ, PreparedRecord, decimate_record, prepare_record
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel

# Seconds on either side of the onset that the next command analyses: about two of the records of T, 31.7 s each.
AROUND_S = 60.0
# Threshold of the criterion, relative to a channel's own size. Boeing 747 without noise: healthy channels stay 3e10
# times below a failing one (docs/validation.md). The healthy time must stay below a tenth of it.
LEVEL, MARGIN = 1e-7, 0.1
# One lag where the outputs hold all states (H 15); two or four where they do not.
LAGS = (1, 2, 4)
# Columns of a window at least, and how many more than the rank, so that the null space is not empty.
NARROWEST, SPARE = 10, 5
# Share of the largest criterion below which a channel is not declared: what a failure inside the window leaves in the
# other channels is smaller by orders of magnitude (H, after eq. 29).
SELECTIVE = 1e-2
# Samples per second and Hz of a recorder's edge above which its low-pass spreads a step over so many of them that no
# count bounds what passes unseen. Of steps through the recorder of two flights (edge 0.75 Hz), 2 % above what is
# excluded, 95 of 96 raise an alarm at 2 Hz, 94 of 95 at 2.5 Hz, 111 of 127 at 3.3 Hz, and at 10 Hz steps of 80 times it
# raise none (tests/measurements/test_detect_recorded).
RATE_PER_EDGE = SAMPLES_PER_EDGE["detect"]
UNSTATED = "neither the file nor its channels tell whether the recorder low-passed the log"
SLOW = "a failure that grows slowly is learnt as normal; bfi start-time looks for drifts"


def detect_faults(
    log: FlightLog, config: Config, *, report: Callable[[int, int], None] = lambda _done, _total: None
) -> DetectResult:
    """Say which channel of a log fails, and when, without a model and without a dictionary.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `detect` holds what is special to the detection. Where inputs and outputs are
        not given, they are the controls and accelerations, and the flight data, that the log has.
    report : called with the number of channels declared so far, and that of all.

    Raises
    ------
    LogError : the log cannot be used.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    with threadpool_limits(1):
        prepared = prepare_record(log, config)
        tolerances = tolerances_of(log, prepared.part, prepared.outputs, config)
        if config.detect.method == "exact" or (config.detect.method == "auto" and prepared.exact):
            result, limits = _exact_result(prepared, config)
            if result.is_calibrated or config.detect.method == "exact":
                return _with_verdicts(result, prepared, config, limits, tolerances)
        result, limits = _parity_result(prepared, config, report)
        return _with_verdicts(result, prepared, config, limits, tolerances)


def _with_verdicts(
    result: DetectResult,
    prepared: PreparedRecord,
    config: Config,
    limits: StepLimits | None,
    tolerances: Mapping[str, float],
) -> DetectResult:
    """Return a result with what it says of every channel.

    Parameters
    ----------
    limits : None where nothing can be said of a channel that was not declared.
    """
    declared = {alarm.channel: alarm.size for alarm in reversed(result.alarms)}
    candidates = candidates_of(prepared, limits, declared, tolerances)
    verdicts = verdicts_of(candidates)
    notes = []
    if limits is not None and len(limits.onset_s):
        first_s, last_s = (instant(float(limits.onset_s[k])) for k in (0, -1))
        notes.append(
            f"claims hold for steps that begin from {first_s} to {last_s} s; what began before is learnt as normal"
        )
    unseen = [one.channel for one in candidates if one.state == "not_seen"]
    if unseen:
        notes.append(
            f"what would help with steps of {', '.join(unseen)}: {'; '.join(_helps(prepared, config, limits))}"
        )
    others = [kind for kind in config.require if kind != "abrupt"]
    if others:
        notes.append(
            f"{' and '.join(others)} faults are not looked for here, so that there is no decision "
            "without them (--require abrupt is about steps alone): bfi start-time looks for them, one channel at a time"
        )
    return replace(
        result,
        decision=decide(verdicts, config.require),
        verdicts=verdicts,
        candidates=candidates,
        summary=summarise(verdicts, candidates),
        notes=(*result.notes, *notes),
    )


def _helps(prepared: PreparedRecord, config: Config, limits: StepLimits | None) -> list[str]:
    """Return what lowers the limits, or lets them pass."""
    if limits is None and config.detect.method != "exact":
        return _slower(prepared, config)
    if limits is None:
        return ["--method parity"]
    if not len(limits.onset_s):
        return ["a longer time to watch (an earlier end of --train, a later --to)"]
    said = ["a longer healthy time (--train A:B)"]
    idle = [
        name for name in FELT if name in prepared.part.channels and name not in (*prepared.inputs, *prepared.outputs)
    ]
    said += ["more inputs (" + " ".join(f"--input {name}" for name in (*prepared.inputs, *idle)) + ")"] if idle else []
    return [*said, "calmer air", "a --tolerance that you accept"]


def _slower(prepared: PreparedRecord, config: Config) -> list[str]:
    """Return what gives limits where the rate is too high for the recorder."""
    if prepared.stated and config.conditioning.rate_hz == "auto":
        # The healthy time has too few samples at a lower rate.
        return ["a longer healthy time (--train A:B)"]
    assert prepared.recorder_hz is not None
    said = [f"--rate {SAMPLES_PER_EDGE['scan'] * prepared.recorder_hz:.2g}"]
    return said if prepared.stated else [*said, "--recorder HZ, or none where there is none"]


def _exact_result(prepared: PreparedRecord, config: Config) -> tuple[DetectResult, StepLimits | None]:
    """Return what the right null space of the last samples says of each output, at the log's own rate (paper H).

    The past data have the fewest lags that explain the healthy time. A constant counts as an input, so that values need
    not be deviations from a trim. For as long as a failure is inside the window, other channels may leave round-off too
    (paper H, after eq. 29), by orders of magnitude less: they are not declared.
    """
    record = prepared.record
    y, healthy = record.y, record.time_s < prepared.train[1]
    u = np.column_stack([record.u, np.ones(len(record.u))])
    both = np.hstack([y, u])
    for lags in LAGS:
        # Inputs bring the samples before the last one with them: z(i) then reaches `lags` samples back.
        past = (np.vstack([np.zeros((lag, both.shape[1])), both[:-lag]]) for lag in range(1, lags))
        inputs = np.hstack([u, *past])
        width = max(NARROWEST, past_rank(y[healthy], inputs[healthy]) + SPARE)
        criterion = criteria(y, inputs, width=width)
        explained = not bool((np.nan_to_num(criterion.channel[healthy]) > MARGIN * LEVEL).any())
        if explained:
            break
    channel = np.nan_to_num(criterion.channel)
    levels = np.maximum(LEVEL, SELECTIVE * channel.max(axis=1))
    last = np.full(channel.shape[1], -width - 1)
    alarms = []
    for i in np.flatnonzero((channel > LEVEL).any(axis=1)):
        above = channel[i] > levels[i]
        time_s = float(record.time_s[i])
        alarms += [
            Alarm(
                channel=prepared.outputs[k],
                time_s=time_s,
                onset_s=time_s,
                statistic=float(channel[i, k]),
                threshold=LEVEL,
                size=None,
                ci95=None,
                unit=prepared.units[k],
            )
            for k in np.flatnonzero(above & (last < i - width))
        ]
        last[above] = i
    failed_s = {alarm.channel: alarm.time_s for alarm in reversed(alarms)}
    if explained:
        note = (
            f"a linear model of order {lags} explains the healthy time to round-off, so the criterion is that of "
            f"data without noise: a channel fails where the model leaves more than {LEVEL:g} of its size unexplained "
            f"in a window of {width} samples"
        )
    else:
        note = (
            "the healthy time is not explained to round-off: this log has noise, or needs more channels, and the "
            "alarms mean nothing; give --method parity"
        )
    notes, limits = [note], None
    if criterion.ready is not None:
        notes.append(f"ready after {criterion.ready} samples")
    if explained:
        limits, left_out = exact_limits(record, criterion, width=width, level=levels)
        if left_out:
            notes.append(
                f"{left_out} samples move in a direction in which their window does not, as the first ones after an "
                "input begins to move: what fails at one of them may show in another channel or not at all"
            )
    result = DetectResult(
        log=log_summary(record.path, record.time_s, rate_hz=record.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="inconclusive",
        verdicts=dict.fromkeys(KINDS, "inconclusive"),
        candidates=(),
        summary="",
        method="exact",
        inputs=prepared.inputs,
        outputs=prepared.outputs,
        false_alarm=config.detect.false_alarm,
        alarms=tuple(alarms),
        is_calibrated=explained,
        ready_s=None if criterion.ready is None else float(record.time_s[criterion.ready - 1]),
        train=prepared.train,
        watched=prepared.watched,
        calibration=None,
        model=None,
        width=width,
        time_s=frozen_array(record.time_s),
        series=tuple(
            _series(prepared, k, y, criterion.channel[:, k], LEVEL, failed_s.get(name))
            for k, name in enumerate(prepared.outputs)
        ),
        commands=_identify_command(prepared, alarms),
        notes=tuple(notes),
    )
    return result, limits


def _parity_result(
    prepared: PreparedRecord, config: Config, report: Callable[[int, int], None]
) -> tuple[DetectResult, StepLimits | None]:
    """Return what the parity residuals say at the rate of the analysis, and its limits, None where it has none.

    The calibration is that of the first pass.
    """
    samples, outputs = decimate_record(prepared, prepared.choice.factor), prepared.outputs
    path, false_alarm = prepared.record.path, config.detect.false_alarm
    failures, passes = detect_sequentially(path, samples, false_alarm=false_alarm, report=report)
    alarms = [
        Alarm(
            channel=outputs[failure.output],
            time_s=float(samples.time_s[failure.sample] + samples.reach_s),
            onset_s=float(samples.time_s[failure.onset]),
            statistic=failure.deviate,
            threshold=failure.level,
            size=failure.size,
            ci95=failure.ci95,
            unit=prepared.units[failure.output],
        )
        for failure in failures
    ]
    failed_s = {failure.output: float(samples.time_s[failure.sample]) for failure in failures}
    series = []
    for i in range(len(outputs)):
        last = next(monitoring for monitoring in reversed(passes) if i in monitoring.channels)
        k, own = last.channels.index(i), last.model
        statistic = np.full(len(samples.time_s), np.nan)
        statistic[own.samples[own.errors.start :]] = last.drops.deviate[:, k]
        level = float(last.threshold.level[k])
        series.append(_series(prepared, i, samples.y, statistic, level, failed_s.get(i)))
    model, threshold = passes[0].model, passes[0].threshold
    heavy = threshold.tail is not None and threshold.tail > threshold.white
    first_held, last_held = model.samples[model.errors.start], model.samples[model.n_healthy - 1]
    result = DetectResult(
        log=log_summary(path, samples.time_s, rate_hz=samples.rate_hz, native_rate_hz=prepared.native_rate_hz),
        decision="inconclusive",
        verdicts=dict.fromkeys(KINDS, "inconclusive"),
        candidates=(),
        summary="",
        method="parity",
        inputs=prepared.inputs,
        outputs=outputs,
        false_alarm=false_alarm,
        alarms=tuple(alarms),
        is_calibrated=threshold.tail is not None,
        ready_s=prepared.watch_s,
        train=prepared.train,
        watched=prepared.watched,
        calibration=Calibration(
            held_back_s=(float(samples.time_s[first_held]), float(samples.time_s[last_held])),
            n_blocks=len(threshold.maxima),
            white_level=threshold.white,
            level=threshold.common,
            heavy=heavy,
            scale=dict(zip(outputs, threshold.scale.tolist(), strict=True)),
            block_maxima=frozen_array(threshold.maxima),
        ),
        model=ParityModel(
            lags=model.lags,
            rank=model.rank,
            n_stacked=model.lags * len(outputs),
            forgetting=model.forgetting,
            n_fitted=model.n_healthy,
            noise_sd=dict(zip(outputs, model.unit.tolist(), strict=True)),
        ),
        width=None,
        time_s=frozen_array(samples.time_s),
        series=tuple(series),
        commands=_identify_command(prepared, alarms),
        notes=(*prepared.notes, f"rate: {prepared.choice.reason}", SLOW, *_threshold_notes(prepared, threshold)),
    )
    edge_hz = prepared.recorder_hz
    if edge_hz is not None and samples.rate_hz > RATE_PER_EDGE * edge_hz:
        edge = f"(gain one half at {edge_hz:.3g} Hz)"
        which = f"the recorder's low-pass {edge}" if prepared.stated else f"{UNSTATED}, and a low-pass {edge}"
        note = (
            f"{which} spreads a step over several samples at {samples.rate_hz:.3g} Hz, and what a sharp one would show "
            f"does not bound it: no step is excluded; what gives limits: {'; '.join(_slower(prepared, config))}"
        )
        return replace(result, notes=(*result.notes, note)), None
    if not prepared.stated:
        note = (
            f"{UNSTATED}: limits are of steps through any low-pass that keeps half of {UNSTATED_HZ:g} Hz; --recorder "
            "HZ states a slower one"
        )
        result = replace(result, notes=(*result.notes, note))
    return result, parity_limits(samples, passes, factor=SMEARED if prepared.filtered else ABSORBED)


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
    """Say what gusts and the held-back healthy time mean for the threshold."""
    notes = []
    if threshold.gusts > 1.0:
        notes.append(
            "the prediction errors change in size as gusts come and go: they are measured by their size in the last "
            f"{PATCH_S:g} s, a deviate has to last for {LASTING_IN_GUSTS} samples, and the threshold is "
            f"{threshold.gusts:g} times that of the healthy time, which keeps the wanted rate on recorded flights; a "
            "failure that is seen only in calm air may be missed"
        )
    if threshold.tail is not None:
        if threshold.tail > threshold.white:
            notes.append(
                f"held-back healthy data are heavier-tailed than white noise ({threshold.tail:.3g} instead of "
                f"{threshold.white:.3g} standard deviations): the threshold follows their tail, taken to be exponential"
            )
        return notes
    notes.append(
        f"the healthy time has {len(threshold.maxima)} independent stretches to calibrate on, too few to see heavy "
        "tails: the threshold assumes white noise; give a longer --train"
    )
    higher = [name for name, scale in zip(prepared.outputs, threshold.scale, strict=True) if scale > 1.0]
    if higher:
        notes.append(
            f"{', '.join(higher)}: the threshold is raised, since held-back healthy data came close to that of white "
            "noise or exceeded it; the model predicts the healthy time badly"
        )
    return notes


def _identify_command(prepared: PreparedRecord, alarms: list[Alarm]) -> tuple[str, ...]:
    """Return the command that identifies the failure of the first channel."""
    if not alarms:
        return ()
    record, first = prepared.record, alarms[0]
    from_s = max(float(record.time_s[0]), first.onset_s - AROUND_S)
    to_s = min(float(record.time_s[-1]), first.onset_s + AROUND_S)
    inputs = "".join(f" --input {name}" for name in prepared.inputs)
    window = f"--from {instant(from_s)} --to {instant(to_s)}"
    return (f"bfi identify {record.path}{inputs} --output {first.channel} {window}",)
