"""What the flight would have shown without its faults, and the course of each fault beside its named shape.

`corrected_channels` and `course_of` are of a diagnosis, once a second; `corrected_log` is a whole log at its own rate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import ConfigError
from ..flightlog import Channel, FlightLog
from ..flightlog.record import frozen_array
from ..kernels import BoolArray, FloatArray
from ..kernels.free_course import Course as SmoothedCourse
from ..kernels.free_course import correlated_noise, smoothed_course
from ..kernels.likelihood_ratio import FAST_S
from ..notes import Note
from ..serialization import check_schema, from_plain, member, read_json
from .flight import Flight
from .naming import hypothesis_of
from .parity import Record, WindowScan
from .parity.explain import course_for
from .parity.record import LINES, USED, Hypothesis, hypotheses, with_fault, without_fault
from .parity.scan import residual_values
from .result import Course, Event

# Drawn over the flight, where recorded.
SHOWN = ("tas", "cas", "ias", "mach", "altitude", "aoa", "pitch")
FEWEST_S = 10.0  # of a course after its onset
MEASURED = "_measured"  # ends the name of what was recorded, beside a channel that is corrected
GIVE = "give the result.json of bfi diagnose"


def corrected_channels(record: Record, events: Sequence[Event]) -> dict[str, FloatArray]:
    """Return by channel, (n,), the record without its declared faults, NaN outside of them.

    From the onset to the last window that shows it a fault has the course that its window tells. A line that is held
    tells nothing of the pressure, and its channels have no correction.
    """
    corrected: dict[str, FloatArray] = {}
    for event in events:
        if event.state != "declared" or event.magnitude is None or "parity" not in event.stages[:1]:
            continue
        fault, amount = _amount(event, record.time_s)
        until_s = event.window_s[1] if event.offset_s is None else min(event.offset_s, event.window_s[1])
        inside = (record.time_s >= event.onset_s) & (record.time_s < until_s)
        clean = without_fault(record, fault, np.where(inside, amount, 0.0))
        for name in SHOWN:
            if name in record.channels and name in {*event.channels}:
                values = corrected.setdefault(name, np.full(record.time_s.shape, np.nan))
                values[inside] = clean.channels[name][inside]
    return corrected


def _amount(event: Event, time_s: FloatArray) -> tuple[str, FloatArray]:
    """Return the hypothesis of an event and its error over time."""
    assert event.magnitude is not None
    fault, sign = hypothesis_of(event.fault)
    course = course_for(event.shape, event.constant_s)
    assert course is not None
    return fault, sign * event.magnitude * course(time_s - event.onset_s)


def course_of(flight: Flight, event: Event, index: int) -> Course | None:
    """Return the course of an event as an integrated random walk, smoothed, None where the residuals do not tell it.

    Residuals that integrate the fault are left out: a course of any shape is told by those that show it at once. It is
    told about the record without the named shape, since a loss of a tenth of the impact pressure is no small change.
    """
    if event.stages[0] != "parity" or event.magnitude is None:
        return None
    part = flight.record.between(*event.window_s)
    fault, named = _amount(event, part.time_s)
    hypothesis = next((hypothesis for hypothesis in hypotheses(part) if hypothesis.fault == fault), None)
    scan = flight.scan(event.window_s)
    if hypothesis is None or scan is None or event.window_s[1] - event.onset_s < FEWEST_S:
        return None
    try:
        course = _smoothed(without_fault(part, fault, named), scan, hypothesis, event.onset_s)
    except ValueError:  # the residuals do not tell it, or the fault leaves the air that their equations hold for
        return None
    if course is None:
        return None
    _, sign = hypothesis_of(event.fault)
    sides = np.sort(np.stack([sign * (named + course.low), sign * (named + course.high)]), axis=0)
    return Course(
        event=index,
        channel=event.fault,
        unit=hypothesis.unit,
        time_s=part.time_s,
        free=sign * (named + course.value),
        low=sides[0],
        high=sides[1],
        named=sign * named,
    )


def _smoothed(part: Record, scan: WindowScan, hypothesis: Hypothesis, onset_s: float) -> SmoothedCourse | None:
    """Return the course of a fault in a window by the residuals that show it at once, None where none does."""
    faulty = with_fault(part, hypothesis.fault, np.full(part.time_s.shape, hypothesis.size))
    times, values, gains, columns, blocks = [], [], [], [], []
    for kind, residual, known, nuisances in zip(scan.kinds, scan.residuals, scan.known, scan.columns, strict=True):
        if kind.rate is not None and np.any(np.nan_to_num(kind.rate(faulty) - kind.rate(part))):
            continue
        gain = (kind.values(faulty, scan.constants) - kind.values(part, scan.constants))[known] / hypothesis.size
        if not np.any(gain):
            continue
        t = part.time_s[known]
        times.append(t)
        values.append(residual_values(part, part, scan.constants, kind)[known])
        gains.append(gain)
        # Independent ones: a straight flight shows the wind along its track only.
        u, s, _ = np.linalg.svd(nuisances / np.linalg.norm(nuisances, axis=0).clip(min=1e-300), full_matrices=False)
        columns.append(u[:, s > 1e-3 * s[0]])
        blocks.append(correlated_noise(t, sd=residual.level, time_constant_s=FAST_S) + kind.slow(t - t[0]))
    if not times:
        return None
    return smoothed_course(
        np.concatenate(times),
        np.concatenate(values),
        gain=np.concatenate(gains),
        nuisances=_block_diagonal(columns),
        covariance=_block_diagonal(blocks),
        onset_s=onset_s,
        at_s=part.time_s,
    )


def _block_diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    whole = np.zeros(np.sum([block.shape for block in blocks], axis=0))
    i = j = 0
    for block in blocks:
        n, m = block.shape
        whole[i : i + n, j : j + m] = block
        i, j = i + n, j + m
    return whole


def events_to_correct(path: Path, log: FlightLog) -> tuple[Event, ...]:
    """Return the events of a stored diagnosis of a log.

    Raises
    ------
    ConfigError : the file is no diagnosis, or one of another log, or of channels in other units or with other signs.
    """
    document = read_json(path, give=GIVE)
    if not isinstance(document, Mapping) or document.get("kind") != "diagnose":
        raise ConfigError(f"{path}: not a diagnosis; {GIVE}")
    check_schema(document, where=str(path))
    origin = member(document, "provenance", where=str(path))
    if not isinstance(origin, Mapping) or origin.get("log_sha256") != log.sha256:
        raise ConfigError(f"{path}: the diagnosis of another log than {log.path}; run bfi diagnose {log.path} first")
    try:
        changed = [
            entry for entry in document.get("plausibility", ()) if entry["fixed"] and entry["what"] in ("unit", "sign")
        ]
        events = from_plain(tuple[Event, ...], document["events"], where=str(path))
    except (KeyError, TypeError) as error:
        raise ConfigError(f"{path}: damaged, {error!r}; run bfi diagnose again") from None
    if changed:
        names = ", ".join(name for entry in changed for name in entry["channels"])
        raise ConfigError(
            f"{path}: --fix-units changed {names}; state their units with --unit in both commands, and run bfi "
            "diagnose again"
        )
    return events


def corrected_log(log: FlightLog, events: Sequence[Event]) -> FlightLog:
    """Return the log without its declared faults, with what was measured and a flag for each event beside.

    A fault has the course of its named shape from its onset to its end, or to the last window that shows it. Where it
    may still be there and nothing tells its size, as of a line that is held, its channels are NaN. `tas_measured` is
    what was recorded of a channel `tas` that is corrected; `event_1_tas` is 1 while the first event is there.
    """
    t, flags, notes = log.time_s, dict[str, Channel](), []
    values = {name: channel.values for name, channel in log.channels.items()}
    record = Record(
        time_s=t,
        channels={name: values[name] for name in USED if name in values},
        gained=None,
        airspeed="tas" if "tas" in values else "",
    )
    for k, event in enumerate(sorted(events, key=lambda event: event.onset_s), start=1):
        inside = (t >= event.onset_s) & (t < event.until_s)
        name = f"event_{k}_{event.fault}"
        flags[name] = Channel(name=name, values=frozen_array(inside), unit="1", source=name)
        if event.state != "declared":
            continue
        known = inside & (t < event.seen_until_s) if event.offset_s is None else inside
        clean = _clean(record, event, known)
        if clean is None:
            known, clean = np.zeros_like(inside), record
        for channel in event.channels:
            if channel in values:
                correctable = known & (channel in clean.channels)
                right = clean.channels.get(channel, values[channel])
                values[channel] = np.where(correctable, right, np.where(inside, np.nan, values[channel]))
        if "baro_altitude" in event.channels and {"altitude", "baro_altitude"} <= values.keys():
            # Apart by what the setting makes, a constant.
            change = values["altitude"] - log.channels["altitude"].values
            values["baro_altitude"] = log.channels["baro_altitude"].values + change
        record = replace(record, channels={channel: values[channel] for channel in record.channels})
        lost = ", ".join(channel for channel in event.channels if channel in values)
        size = "corrected" if known.any() else "left empty, nothing tells the size"
        notes.append(Note.method(f"{event.fault} from {event.onset_s:.1f} s: {lost} {size}"))
    wrong = [name for name, channel in log.channels.items() if values[name] is not channel.values]
    new = {name: replace(log.channels[name], values=frozen_array(values[name]), derived_from=()) for name in wrong}
    kept = {f"{name}{MEASURED}": log.channels[name] for name in wrong}
    kept = {name: replace(channel, name=name, source=name) for name, channel in kept.items()}
    # What was injected is no longer in the channels.
    return replace(log, channels={**log.channels, **new, **kept, **flags}, truth=None, notes=(*log.notes, *notes))


def _clean(record: Record, event: Event, known: BoolArray) -> Record | None:
    """Return a record without an event where it is known; None where its course cannot be subtracted."""
    if event.magnitude is None:
        return None
    if event.shape == "offset":
        fault, amount = event.fault, np.full(record.time_s.shape, event.magnitude)
    elif course_for(event.shape, event.constant_s) is not None:
        fault, amount = _amount(event, record.time_s)
    else:
        return None
    if fault not in LINES and fault not in record.channels:
        return None
    return without_fault(record, fault, np.where(known, amount, 0.0))
