"""The JSON document of `bfi plot`, and what its pictures hold: channels over time with phases, windows and events."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..display_units import SI, Units
from ..provenance import Provenance
from ..report.content import Block, Curve, Drawing, Lane, Panel, ReportContent, curve, thinned
from ..report.text import instant
from ..serialization import to_plain
from .derived import DERIVED, with_derived
from .events import Event
from .phases import Phase, phases_of
from .quality import ExcitedWindow, ranked_windows
from .record import FlightLog
from .report import lane_panel
from .timeline import bands_of, event_table, lanes_of, phase_columns, phase_table, window_table

Plain = Mapping[str, Any]

PLOT_SCHEMA = 1
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
# Points of a curve on the page that can be zoomed: four screens wide, a least and a greatest value for each pixel.
ZOOM_POINTS = 8000
# Time steps, above which samples are missing for longer than a reader would take for jitter.
GAP = 5.0


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
    from_s: float | None,
    to_s: float | None,
    notes: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the document of `bfi plot --json`: phases and windows of the first log, and the curves as `series`.

    Parameters
    ----------
    logs : whole, so that phases and derived channels are those of the flight, also in a part of it.
    names : channels to draw; () for the usual ones.
    events : of analyses of these logs.
    from_s, to_s : the part to draw, None for the whole.
    notes : put before those of the logs.

    Raises
    ------
    LogError : a log lacks a channel that is named, or has no samples in the part.
    """
    first = logs[0]
    chosen = channels_to_plot(first, names, events)
    whole = [with_derived(log, chosen, from_s=from_s, to_s=to_s) for log in logs]
    if names:
        for log in whole:
            log.signals(chosen)
    parts = [log.window(from_s, to_s) for log in whole]
    low = min(float(part.time_s[0]) for part in parts) if from_s is None else from_s
    high = max(float(part.time_s[-1]) for part in parts) if to_s is None else to_s
    phases = phases_of(first)
    said = list(dict.fromkeys([*notes, *(note for log in whole for note in log.notes)]))
    if len(logs) > 1:
        said.append(f"phases and windows are those of {first.path}")
    outside = [event for event in events if event.onset_s > high or (event.offset_s or high) < low]
    if outside:
        said.append(f"{len(outside)} of {len(events)} events lie outside {instant(low)} to {instant(high)} s")
    document: dict[str, Any] = to_plain(
        {
            "kind": "plot",
            "schema": PLOT_SCHEMA,
            "logs": [
                {
                    "path": part.path,
                    "rate_hz": part.rate_hz,
                    "n_samples": part.n_samples,
                    "start_s": float(part.time_s[0]),
                    "stop_s": float(part.time_s[-1]),
                    "sha256": part.sha256,
                }
                for part in parts
            ],
            "from_s": low,
            "to_s": high,
            "channels": [{"name": name, "unit": whole[0].channels[name].unit} for name in chosen],
            "phases": [one for one in phases if _overlaps(one, low, high)],
            "windows": [one for one in ranked_windows(first, phases) if _overlaps(one, low, high)],
            "events": events,
            "series": [
                _series(part, i, name) for name in chosen for i, part in enumerate(parts) if name in part.channels
            ],
            "notes": said,
            "provenance": provenance,
        }
    )
    return document


def _overlaps(one: Phase | ExcitedWindow, low: float, high: float) -> bool:
    ends = (one.from_s, one.to_s) if isinstance(one, Phase) else (one.start_s, one.stop_s)
    return ends[0] < high and ends[1] > low


def _series(log: FlightLog, i: int, name: str) -> dict[str, Any]:
    """Return the curve of a channel, of a long one the least and the greatest value of each stretch."""
    channel = log.channels[name]
    kept = thinned(channel.values, max_points=ZOOM_POINTS)
    time_s, values = log.time_s[kept], channel.values[kept]
    # No line is drawn over a gap: a point without a value stands in its middle.
    before = np.flatnonzero(np.diff(log.time_s) > GAP / log.rate_hz)
    at = np.searchsorted(kept, before, side="right")
    return {
        "log": i,
        "channel": name,
        "unit": channel.unit,
        "time_s": np.insert(time_s, at, 0.5 * (log.time_s[before] + log.time_s[before + 1])),
        "values": np.insert(values, at, np.nan),
    }


def plot_content(document: Plain, units: Units = SI) -> ReportContent:
    """Return what the report of a document of `bfi plot` holds, in `units`."""
    logs, limits = document["logs"], (document["from_s"], document["to_s"])
    names = [one["name"] for one in document["channels"]]
    events = document["events"]
    lanes = lanes_of(document["phases"], document["windows"], (), events, limits=limits)
    bands = [*bands_of(document["phases"]), *_onsets(events)]
    labels = _labels([log["path"] for log in logs]) if len(logs) > 1 else [""]
    pages = [names[i : i + MOST_PANELS] for i in range(0, len(names), MOST_PANELS)]
    drawings = [
        Drawing(
            name="channels" if i == 0 else f"channels_{i + 1}",
            caption=_caption(document),
            panels=tuple(_panels(document, page, lanes, bands, labels, units, points=2000)),
            shared_x=True,
        )
        for i, page in enumerate(pages)
    ]
    whole = Drawing(
        name="channels",
        caption=_caption(document),
        panels=tuple(_panels(document, names, lanes, bands, labels, units, points=ZOOM_POINTS)),
        shared_x=True,
    )
    paths = ", ".join(str(log["path"]) for log in logs)
    n_samples = sum(log["n_samples"] for log in logs)
    return ReportContent(
        category="Flight log" if len(logs) == 1 else "Flight logs",
        title=paths,
        heading="Channels over time",
        verdict=(
            f"{paths}: {', '.join(names)} from {instant(limits[0])} s to {instant(limits[1])} s, {n_samples} samples"
        ),
        tables=(*event_table(events), *window_table(document["windows"]), *phase_table(document["phases"])),
        drawings=tuple(drawings),
        notes=tuple(map(units.sentence, document["notes"])),
        zoom=(whole,),
        data={"phases.csv": phase_columns(document["phases"])} if document["phases"] else {},
    )


def _caption(document: Plain) -> str:
    said = ["Channels over time"]
    if document["phases"]:
        said.append("shaded by the phases of the flight, whose names and whose manoeuvres stand in the rows above")
    if document["windows"]:
        said.append("frames are windows to analyse, numbered by rank, 1 the best")
    if document["events"]:
        said.append("dashed lines are onsets of declared (red) and suspected (orange) faults")
    return "; ".join(said) + ". Long records are drawn as the least and the greatest value of each stretch of time."


def _labels(paths: Sequence[str]) -> list[str]:
    """Return the name of each file, where two have the same name the paths."""
    names = [Path(path).name for path in paths]
    return names if len(set(names)) == len(names) else [f"{i}: {path}" for i, path in enumerate(paths, start=1)]


def _onsets(events: Sequence[Plain]) -> list[Block]:
    return [
        Block(label="", low=time_s, high=time_s, shade="fault" if one["state"] == "declared" else "suspect")
        for one in events
        for time_s in (one["onset_s"], one["offset_s"])
        if time_s is not None
    ]


def _panels(
    document: Plain,
    names: Sequence[str],
    lanes: Sequence[Lane],
    bands: Sequence[Block],
    labels: Sequence[str],
    units: Units,
    *,
    points: int,
) -> Iterator[Panel]:
    """Yield a panel of lanes and one for each channel; the names of several logs stand over the first of them."""
    low, high = document["from_s"], document["to_s"]
    inside = tuple(one for one in bands if one.high >= low and one.low <= high)
    if lanes:
        yield lane_panel(lanes, (low, high))
    height = float(np.clip(PAGE / max(len(names), 1), LEAST, MOST))
    for i, name in enumerate(names):
        series = [one for one in document["series"] if one["channel"] == name]
        unit = units.of(series[0]["unit"] if series else "", channel=name).unit
        yield Panel(
            x_label="time [s]",
            y_label=f"{name}\n[{unit or 'no unit'}]",
            curves=tuple(_curve(one, "" if i else labels[one["log"]], units, points) for one in series),
            bands=inside,
            x_limits=(low, high),
            height=height,
            clock=not lanes and i == 0,
        )


def _curve(series: Plain, label: str, units: Units, points: int) -> Curve:
    values = units.of(series["unit"], channel=series["channel"]).readings(series["values"])
    time_s = np.array(series["time_s"], dtype=np.float64)
    missing = np.isnan(values)
    breaks = np.flatnonzero(missing & ~np.concatenate([[False], missing[:-1]]))  # no line is drawn over them
    kept = np.union1d(thinned(values, max_points=points), breaks)
    return curve(label, time_s[kept], values[kept])
