"""The JSON document of `bfi plot`, and what its pictures hold: channels over time with phases, windows and events."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..display_units import SI, Units
from ..errors import ConfigError, LogError
from ..notes import Note
from ..provenance import Provenance
from ..report.content import Block, Curve, Drawing, Panel, ReportContent, Table, curve, notes_of, thinned
from ..report.text import change, instant
from ..serialization import check_schema, document_of, mapping, member, to_plain
from .derived import DERIVED, with_derived
from .difference import GAP, difference
from .phases import phases_of
from .quality import ranked_windows
from .record import Channel, FlightLog, FloatArray
from .report import lane_panel
from .timeline import (
    STATES,
    bands_of,
    event_table,
    happenings,
    lanes_of,
    phase_columns,
    phase_table,
    shows,
    window_table,
)

Plain = Mapping[str, Any]

# What is drawn where no channel is named: of each group the first that the log has. What an investigator looks at
# first, in the order of a page: speed, height, attitude, lift, and what the pilot did.
GROUPS = (
    *(("tas", "cas", "ias", "ground_speed"), ("altitude", "altitude_rate"), ("pitch",), ("roll",), ("aoa",)),
    *(("normal_acc",), ("elevator", "elevator_inner_left", "column_force"), ("throttle", "thrust", "n1_left")),
)
# Panels on a page of A4; more channels go on further figures.
MOST_PANELS = 8
# A page of panels is this high, in heights of a panel of curves; a panel is at least and at most so high.
PAGE, LEAST, MOST = 3.7, 0.44, 0.9
# Points of a curve on the page that can be zoomed, four screens wide, and on one of paper: a least and a greatest value
# for each pixel.
ZOOM_POINTS, PAGE_POINTS = 8000, 2000
DIFFERENCES = (
    "Channels of the second log less those of the first, at the times of the one with the lower rate; between samples "
    "of the other in straight lines, and nothing within its gaps."
)
GIVE = "give the result.json of bfi identify, start-time, detect or diagnose"
# Under which key a kind of document has its events, and under which it has what is suspected.
EVENTS = {
    "identify": ("faults", "candidates"),
    "start-time": ("faults", "candidates"),
    "detect": ("alarms", "candidates"),
    "diagnose": ("events", None),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A fault that an analysis declares or suspects.

    Attributes
    ----------
    analysis : the kind of document that names it.
    state : "declared" or "suspected".
    onset_s, offset_s : on the log's time axis; the offset is None where the fault lasts.
    """

    analysis: str
    name: str
    channels: tuple[str, ...]
    state: str
    onset_s: float
    offset_s: float | None


def read_events(path: str) -> tuple[tuple[Event, ...], str]:
    """Return the declared and suspected events of a stored document in order of time, and the sha256 of its log.

    Raises
    ------
    ConfigError : the file cannot be read, is not JSON, or is no document with events.
    """
    try:
        document = json.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {(error.strerror or str(error)).lower()}; {GIVE}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; {GIVE}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not JSON ({error}); {GIVE}") from None
    if not isinstance(document, Mapping) or "kind" not in document:
        raise ConfigError(f"{path}: not a result of this program, it has no 'kind'; {GIVE}")
    kind = document["kind"]
    if not isinstance(kind, str) or kind not in EVENTS:
        raise ConfigError(f"{path}: kind is '{kind}', which has no events; {GIVE}")
    check_schema(document, where=path)
    sha256 = mapping(member(document, "provenance", where=path), where=f"{path}: provenance").get("log_sha256")
    try:
        declared, others = EVENTS[kind]
        found = []
        for entry in member(document, declared, where=path):
            onset_s = entry.get("onset_s") if entry.get("onset_s") is not None else entry.get("time_s")
            state = entry.get("state", "declared")
            if onset_s is not None and state in ("declared", "suspected"):
                found.append(_event(entry, kind, state, onset_s))
        for entry in document.get(others, ()) if others else ():
            if entry.get("state") == "suspected" and entry.get("onset_s") is not None:
                found.append(_event(entry, kind, "suspected", entry["onset_s"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: damaged, {error!r}; run bfi {kind} again") from None
    return tuple(sorted(found, key=lambda one: one.onset_s)), sha256 if isinstance(sha256, str) else ""


def _event(entry: Plain, kind: str, state: str, onset_s: float) -> Event:
    """Return an entry as an event; a fault is called by its name, else by its shape, an alarm by what it is."""
    channels = entry.get("channels") or ([entry["channel"]] if entry.get("channel") else [])
    times = [float(one) for one in (onset_s, entry.get("offset_s")) if one is not None]
    if not isinstance(channels, list) or not all(map(math.isfinite, times)):
        raise ValueError(f"no channels and times, {channels!r:.40}, {times}")
    name = str(entry.get("fault") or entry.get("name") or entry.get("shape") or "alarm")
    places, offset_s = tuple(map(str, channels)), times[1] if len(times) > 1 else None
    return Event(analysis=kind, name=name, channels=places, state=state, onset_s=times[0], offset_s=offset_s)


def moved(event: Event, shift_s: float) -> Event:
    """Return an event on an axis of time that is moved."""
    offset_s = None if event.offset_s is None else event.offset_s + shift_s
    return replace(event, onset_s=event.onset_s + shift_s, offset_s=offset_s)


def channels_to_plot(log: FlightLog, names: Sequence[str], events: Sequence[Event]) -> tuple[str, ...]:
    """Return the channels to draw: those named, else the usual ones and those of the events.

    Raises
    ------
    LogError : the log lacks a channel that is named, and it follows from no others.
    """
    if names:
        found = [name if name in DERIVED and name not in log.channels else log.channel(name).name for name in names]
        return tuple(dict.fromkeys(found))
    usual = [next((name for name in group if name in log.channels), None) for group in GROUPS]
    told = [name for event in events for name in event.channels if name in log.channels]
    chosen = tuple(dict.fromkeys(name for name in (*told, *usual) if name is not None))
    return chosen or tuple(log.channels)[:MOST_PANELS]


def plot_document(
    logs: Sequence[FlightLog],
    names: Sequence[str],
    events: Sequence[Event],
    provenance: Provenance,
    *,
    part_s: tuple[float | None, float | None],
    diff: bool = False,
    shift_s: float = 0.0,
    notes: Sequence[Note] = (),
) -> dict[str, Any]:
    """Return the document of `bfi plot --json`: phases and windows of the first log, and the curves as `series`.

    Parameters
    ----------
    logs : whole, so that phases and derived channels are those of the flight, also in a part of it.
    names : channels to draw; () for the usual ones.
    events : of analyses of these logs.
    part_s : first and last time to draw, None for that of the whole.
    diff : subtract the channels of the first of two logs from those of the second.
    shift_s : that the times of the second have been moved by.
    notes : put before those of the logs.

    Raises
    ------
    LogError : a log lacks a channel that is named, or has no samples in the part.
    """
    first, (from_s, to_s) = logs[0], part_s
    chosen = channels_to_plot(first, names, events)
    if diff and not names:
        chosen = shared_channels(logs[0], logs[1], chosen)
    whole = [with_derived(log, chosen, from_s=from_s, to_s=to_s) for log in logs]
    if names:
        for log in whole:
            log.signals(chosen)
    parts = [log.window(from_s, to_s) for log in whole]
    low = min(float(part.time_s[0]) for part in parts) if from_s is None else from_s
    high = max(float(part.time_s[-1]) for part in parts) if to_s is None else to_s
    phases = phases_of(first)
    said = [*notes, *(note for log in whole for note in log.notes)]
    if len(logs) > 1:
        said.append(Note.method(f"phases and windows are those of {first.path}"))
    outside = [event for event in events if event.onset_s > high or (event.offset_s or high) < low]
    if outside:
        said.append(
            Note.method(f"{len(outside)} of {len(events)} events lie outside {instant(low)} to {instant(high)} s")
        )
    if shift_s:
        said.append(Note.method(f"times of {logs[1].path} are moved by {shift_s:.4g} s, to those of {first.path}"))
    changes = [(name, *difference(parts[0], parts[1], name)) for name in chosen] if diff else []
    body = to_plain(
        {
            "logs": [
                {
                    **{key: getattr(part, key) for key in ("path", "rate_hz", "n_samples")},
                    "start_s": float(part.time_s[0]),
                    "stop_s": float(part.time_s[-1]),
                    "sha256": part.sha256,
                }
                for part in parts
            ],
            "from_s": low,
            "to_s": high,
            "channels": [{"name": name, "unit": whole[0].channels[name].unit} for name in chosen],
            "phases": [one for one in phases if shows(one, (low, high))],
            "windows": [one for one in ranked_windows(first, phases) if shows(one, (low, high))],
            "events": events,
            "differences": [
                _difference(name, whole[0].channels[name].unit, time_s, values) for name, time_s, values in changes
            ],
            "series": [
                *(
                    _series(i, part.channels[name], part.time_s, part.channels[name].values)
                    for name in chosen
                    for i, part in enumerate(parts)
                    if name in part.channels
                ),
                *(_series(None, whole[0].channels[name], time_s, values) for name, time_s, values in changes),
            ],
        }
    )
    return document_of("plot", body, said, provenance)


def shared_channels(first: FlightLog, second: FlightLog, chosen: Sequence[str]) -> tuple[str, ...]:
    """Return those of the chosen channels of the first log that the second has.

    Raises
    ------
    LogError : there are none.
    """
    shared = tuple(name for name in chosen if name in second.channels)
    if not shared:
        raise LogError(
            f"{second.path}: shares none of {', '.join(chosen)} with {first.path}; name others with --channel NAME"
        )
    return shared


def _difference(name: str, unit: str, time_s: FloatArray, values: FloatArray) -> dict[str, Any]:
    """Return what a difference is in numbers; None where it is known nowhere."""
    known = np.isfinite(values)
    if not known.any():
        return {"channel": name, "unit": unit, **dict.fromkeys(("mean", "sd", "largest", "at_s"))}
    at = int(np.argmax(np.where(known, np.abs(values), -1.0)))
    spread = {"mean": float(values[known].mean()), "sd": float(values[known].std())}
    return {"channel": name, "unit": unit, **spread, "largest": float(values[at]), "at_s": float(time_s[at])}


def _series(log: int | None, channel: Channel, time_s: FloatArray, values: FloatArray) -> dict[str, Any]:
    """Return the curve of a channel, of a long one the least and the greatest value of each stretch."""
    kept = thinned(values, max_points=ZOOM_POINTS)
    # No line is drawn over a gap: a point without a value stands in its middle.
    before = np.flatnonzero(np.diff(time_s) > GAP * float(np.median(np.diff(time_s))))
    at = np.searchsorted(kept, before, side="right")
    return {
        "log": log,
        "channel": channel.name,
        "unit": channel.unit,
        "time_s": np.insert(time_s[kept], at, 0.5 * (time_s[before] + time_s[before + 1])),
        "values": np.insert(values[kept], at, np.nan),
    }


def plot_content(document: Plain, units: Units = SI) -> ReportContent:
    """Return what the report of a document of `bfi plot` holds, in `units`."""
    document = {**document, **happenings(document)}
    logs, names, events = document["logs"], [one["name"] for one in document["channels"]], document["events"]
    limits = (document["from_s"], document["to_s"])
    paths = ", ".join(str(log["path"]) for log in logs)
    n_samples = sum(log["n_samples"] for log in logs)
    said = ["Channels over time"]
    if document["phases"]:
        said.append("shaded by the phases of the flight, whose names and whose manoeuvres stand in the rows above")
    if document["windows"]:
        said.append("frames are windows to analyse, numbered by rank, 1 the best")
    if events:
        said.append("dashed lines are onsets of declared (red) and suspected (orange) faults")
    caption = f"{'; '.join(said)}. Long records are drawn as the least and the greatest value of each stretch of time."

    pages = [names[i : i + MOST_PANELS] for i in range(0, len(names), MOST_PANELS)]
    differs = bool(document.get("differences"))

    def drawing(name: str, channels: Sequence[str]) -> Drawing:
        panels = _panels(document, channels, units, PAGE_POINTS)
        return Drawing(name=name, caption=caption, panels=panels, shared_x=True)

    def differing(name: str, channels: Sequence[str]) -> Drawing:
        panels = _changes(document, channels, units, PAGE_POINTS)
        return Drawing(name=name, caption=DIFFERENCES, panels=panels, shared_x=True)

    every = _panels(document, names, units, ZOOM_POINTS, named=True)
    if differs:
        every += _changes(document, names, units, ZOOM_POINTS)

    return ReportContent(
        category="Flight log" if len(logs) == 1 else "Flight logs",
        title=paths,
        heading="Channels over time",
        verdict=(
            f"{paths}: {', '.join(names)} from {instant(limits[0])} s to {instant(limits[1])} s, {n_samples} samples"
        ),
        tables=(
            *_difference_table(document, units),
            *event_table(events),
            *window_table(document["windows"]),
            *phase_table(document["phases"]),
        ),
        drawings=tuple(
            make(f"{name}_{i}" if i > 1 else name, page)
            for name, make in (("channels", drawing), ("differences", differing))[: 2 if differs else 1]
            for i, page in enumerate(pages, start=1)
        ),
        notes=notes_of(document, units),
        zoom=(Drawing(name="channels", caption=caption, panels=every, shared_x=True),),
        data={"phases.csv": phase_columns(document["phases"])} if document["phases"] else {},
    )


def _panels(
    document: Plain, names: Sequence[str], units: Units, points: int, *, named: bool = False
) -> tuple[Panel, ...]:
    """Return a panel of lanes and one for each channel; the names of several logs stand over the first of them.

    Where the curves are `named` they have the names of their logs in every panel.
    """
    logs, events, limits = document["logs"], document["events"], (document["from_s"], document["to_s"])
    labels = [Path(log["path"]).name for log in logs]
    if len(set(labels)) < len(labels):
        labels = [f"{i}: {log['path']}" for i, log in enumerate(logs, start=1)]
    bands = _bands(document)
    lanes = lanes_of(document["phases"], document["windows"], (), events, limits=limits)
    panels = [lane_panel(lanes, limits)] if lanes else []
    for i, name in enumerate(names):
        curves: list[Curve] = []
        unit = units.of("", channel=name).unit
        for one in (one for one in document["series"] if one["channel"] == name and one["log"] is not None):
            shown = units.of(one["unit"], channel=name)
            label = labels[one["log"]] if (named or i == 0) and len(logs) > 1 else ""
            unit = unit if curves else shown.unit
            curves.append(_curve(label, one["time_s"], shown.readings(one["values"]), points))
        panels.append(
            _channel_panel(f"{name}\n[{unit or 'no unit'}]", curves, bands, limits, len(names), clock=not panels)
        )
    return tuple(panels)


def _changes(document: Plain, names: Sequence[str], units: Units, points: int) -> tuple[Panel, ...]:
    """Return a panel for the difference of each channel."""
    limits, bands, panels = (document["from_s"], document["to_s"]), _bands(document), list[Panel]()
    for one in (one for one in document["series"] if one["log"] is None and one["channel"] in names):
        shown = units.of(one["unit"], channel=one["channel"])
        label = f"Δ {one['channel']}\n[{shown.unit or 'no unit'}]"
        drawn = _curve("", one["time_s"], shown.changes(one["values"]), points)
        panels.append(_channel_panel(label, [drawn], bands, limits, len(names), clock=not panels))
    return tuple(panels)


def _bands(document: Plain) -> tuple[Block, ...]:
    """Return the parts of the flight and the onsets and ends of events, as far as they are drawn."""
    onsets = [
        Block(label="", low=time_s, high=time_s, shade=STATES.get(one["state"], "suspect"))
        for one in document["events"]
        for time_s in (one["onset_s"], one["offset_s"])
        if time_s is not None
    ]
    every = (*bands_of(document["phases"]), *onsets)
    return tuple(one for one in every if one.high >= document["from_s"] and one.low <= document["to_s"])


def _curve(label: str, time_s: Sequence[float], values: FloatArray, points: int) -> Curve:
    """Return a curve of so many points, and of the places where the line breaks."""
    missing = np.isnan(values)
    breaks = np.flatnonzero(missing & ~np.append(False, missing[:-1]))
    kept = np.union1d(thinned(values, max_points=points), breaks)
    return curve(label, np.array(time_s, dtype=np.float64)[kept], values[kept])


def _channel_panel(
    label: str, curves: Sequence[Curve], bands: tuple[Block, ...], limits: tuple[float, float], n: int, *, clock: bool
) -> Panel:
    """Return one of the `n` panels of a page."""
    return Panel(
        x_label="time [s]",
        y_label=label,
        curves=tuple(curves),
        bands=bands,
        x_limits=limits,
        height=float(np.clip(PAGE / max(n, 1), LEAST, MOST)),
        clock=clock,
    )


def _difference_table(document: Plain, units: Units) -> list[Table]:
    """Return the differences of two logs in numbers; [] where none are asked for."""
    rows = []
    for one in document.get("differences", ()):
        shown = units.of(one["unit"], channel=one["channel"])
        sizes = (change(one[key], shown) if one[key] is not None else "-" for key in ("mean", "sd", "largest"))
        rows.append((one["channel"], *sizes, "-" if one["at_s"] is None else instant(one["at_s"])))
    heads = ("channel", "mean", "sd", "largest", "at [s]")
    title = "Second log less the first"
    return [Table(name="differences", title=title, heads=heads, rows=tuple(rows))] if rows else []
