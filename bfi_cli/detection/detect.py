"""Detection from end to end: by the right null space for data without noise (paper H), else by parity residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..config import Config
from ..decision import Candidate, Evidence, candidate_of, conclude, shown_limit
from ..decision.implausible import Implausible
from ..faults import Fault
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.progress import Report, silent
from ..model.preprocessing.defaults import tolerances_of
from ..model.result import log_summary
from ..notes import Note
from ..quantities.text import instant
from ..threads import one_thread
from .exact import detect_exactly
from .parity import detect_by_parity, slower
from .preparation import FELT, PreparedRecord, prepare_detection
from .result import ChannelSeries, Detection, DetectResult

# Seconds on either side of the onset that the next command analyses: about two of the records of T, 31.7 s each.
AROUND_S = 60.0
# Share of the onsets whose limit a note gives where the worst one is beyond the tolerance: while the inputs move as
# never before, the predictor knows nothing for a few seconds.
USUAL = 0.95


def detect_faults(
    log: FlightLog, config: Config, *, findings: Sequence[Implausible] = (), report: Report = silent
) -> DetectResult:
    """Say which channel of a log fails, and when, without a model and without a dictionary.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `detect` holds what is special to the detection. Where inputs and outputs are
        not given, they are the controls and accelerations, and the flight data, that the log has.
    findings : on channels that are wrong throughout the flight.
    report : called with the share of the channels that have failed so far.

    Raises
    ------
    LogError : the log cannot be used.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    method, false_alarm = config.detect.method, config.detect.false_alarm
    with one_thread():
        prepared = prepare_detection(log, config)
        tolerances = tolerances_of(log, prepared.record.log, prepared.record.outputs, config)
        detection = detect_exactly(prepared) if method == "exact" or (method == "auto" and prepared.exact) else None
        if detection is None or (method == "auto" and not detection.is_calibrated):
            detection = detect_by_parity(prepared, config, report)
    candidates = _candidates(prepared, detection, tolerances)
    unseen = [candidate.channel for candidate in candidates if candidate.state == "not_seen"]
    notes = _notes(prepared, config, detection, unseen)
    sources = [
        Evidence(source="detector", candidates=candidates, notes=notes),
        Evidence(source="arithmetic", findings=tuple(findings)),
    ]
    conclusion = conclude(sources, config.require)
    failed_s = {alarm.channel: alarm.time_s - detection.reach_s for alarm in reversed(detection.alarms)}
    return DetectResult(
        log=log_summary(
            prepared.record.log.path,
            detection.time_s,
            rate_hz=detection.rate_hz,
            native_rate_hz=log.rate_hz,
            epoch=log.epoch,
        ),
        decision=conclusion.decision,
        verdicts=conclusion.verdicts,
        candidates=conclusion.candidates,
        summary=conclusion.summary,
        method=detection.method,
        inputs=prepared.inputs,
        outputs=prepared.record.outputs,
        false_alarm=false_alarm,
        alarms=() if conclusion.is_withheld else detection.alarms,
        is_calibrated=detection.is_calibrated,
        ready_s=detection.ready_s,
        train=prepared.train,
        watched=prepared.watched,
        calibration=detection.calibration,
        model=detection.model,
        width=detection.width,
        time_s=frozen_array(detection.time_s),
        series=tuple(
            ChannelSeries(
                channel=name,
                unit=prepared.units[k],
                measured=frozen_array(detection.y[:, k]),
                statistic=frozen_array(detection.statistic[:, k]),
                threshold=float(detection.threshold[k]),
                watched_until_s=failed_s.get(name),
            )
            for k, name in enumerate(prepared.record.outputs)
        ),
        commands=_commands(prepared, detection),
        notes=(*detection.notes, *notes, *conclusion.notes),
        plausibility=conclusion.plausibility,
    )


def _candidates(
    prepared: PreparedRecord, detection: Detection, tolerances: Mapping[str, float]
) -> tuple[Candidate, ...]:
    """Return a candidate per channel watched: the step that is declared, or how large a step could stay unseen."""
    limits, declared = detection.limits, {alarm.channel: alarm.size for alarm in reversed(detection.alarms)}
    candidates = []
    for i, (channel, unit) in enumerate(zip(prepared.record.outputs, prepared.units, strict=True)):
        bounded = limits is not None and len(limits.onset_s) > 0 and channel not in declared
        size, sd, detectable, hidden, checked = declared.get(channel), None, None, None, None
        if limits is not None and bounded:
            checked = ((float(limits.onset_s[0]), float(limits.onset_s[-1])),)
            detectable, hidden = float(np.median(limits.detectable[:, i])), float(limits.hidden[:, i].max())
            clearest = int(np.argmax(np.abs(limits.size[:, i]) / np.maximum(limits.sd[:, i], np.finfo(float).tiny)))
            if limits.sd[clearest, i] > 0.0:
                size, sd = float(limits.size[clearest, i]), float(limits.sd[clearest, i])
        candidate = candidate_of(
            Fault(shape="bias", channel=channel),
            unit,
            name="bias" if len(prepared.record.outputs) == 1 else f"bias on {channel}",
            declared=channel in declared,
            magnitude=size,
            sd=sd,
            minimal_detectable=detectable,
            excluded_above=hidden,
            effect=hidden,
            tolerance=tolerances[channel],
            onsets_checked=checked,
        )
        if limits is not None and candidate.state == "not_seen" and candidate.effect is not None:
            worst = instant(limits.onset_s[limits.hidden[:, i].argmax()])
            usual = shown_limit(replace(candidate, effect=float(np.quantile(limits.hidden[:, i], USUAL))))
            note = f"worst for a step at {worst} s; {usual} at most for {100.0 * USUAL:g} % of the onsets"
            candidate = replace(candidate, note=note)
        candidates.append(candidate)
    return tuple(candidates)


def _notes(prepared: PreparedRecord, config: Config, detection: Detection, unseen: list[str]) -> tuple[Note, ...]:
    """Return what would help where steps are not seen, and what is not looked for."""
    limits, notes = detection.limits, list[Note]()
    if unseen:
        used = (*prepared.inputs, *prepared.record.outputs)
        idle = [name for name in FELT if name in prepared.record.log.channels and name not in used]
        if limits is None:
            helps = ["--method parity"] if config.detect.method == "exact" else slower(prepared, config)
        elif not len(limits.onset_s):
            helps = ["a longer time to watch (an earlier end of --train, a later --to)"]
        else:
            helps = ["a longer healthy time (--train A:B)", "calmer air", "a --tolerance that you accept"]
            if idle:
                more = " ".join(f"--input {name}" for name in (*prepared.inputs, *idle))
                helps.insert(1, f"more inputs ({more})")
        notes.append(Note.advice(f"for steps of {', '.join(unseen)}: {'; '.join(helps)}"))
    others = [kind for kind in config.require if kind != "abrupt"]
    if others:
        notes.append(
            Note.limit(
                f"only steps are looked for, so that {' and '.join(others)} faults stay open (--require abrupt asks "
                "about steps alone); bfi start-time looks for them, one channel at a time"
            )
        )
    return tuple(notes)


def _commands(prepared: PreparedRecord, detection: Detection) -> tuple[str, ...]:
    """Return the command that identifies the failure of the first channel."""
    if not detection.alarms:
        return ()
    record, first = prepared.record, detection.alarms[0]
    from_s = max(float(record.time_s[0]), first.onset_s - AROUND_S)
    to_s = min(float(record.time_s[-1]), first.onset_s + AROUND_S)
    inputs = "".join(f" --input {name}" for name in prepared.inputs)
    window = f"--from {instant(from_s)} --to {instant(to_s)}"
    return (f"bfi identify {record.log.path}{inputs} --output {first.channel} {window}",)
