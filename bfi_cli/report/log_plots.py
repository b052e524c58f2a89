"""The JSON document and the figures of `bfi plot`: channels over time with phases, windows and events."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigError, LogError
from ..flightlog.derived import DERIVED, with_derived
from ..flightlog.excitation import ExcitedWindow, ranked_windows
from ..flightlog.phases import Phase, phases_of
from ..flightlog.record import LARGEST_VALUE, Channel, FlightLog, FloatArray
from ..kernels import IntArray
from ..notes import Note
from ..quantities.text import SI, Units, change, instant
from ..serialization import (
    DECLARED,
    Provenance,
    document_of,
    document_of_kind,
    from_plain,
    mapping,
    member,
    read_json,
    to_plain,
)
from .clock import with_clock
from .content import Block, Curve, Drawing, Panel, ReportContent, Table, curve, shown_notes, thinned
from .difference import GAP, difference
from .log import lane_panel
from .timeline import Happening, bands_of, lanes_of, lines_at, phase_columns, phase_table, shows, window_table

Plain = Mapping[str, Any]

# Channels drawn by default, of each group the first that the log has, in the order in which an investigator looks at a
# flight: speed, height, attitude, lift, and the pilot's inputs.
GROUPS = (
    *(("tas", "cas", "ias", "ground_speed"), ("altitude", "altitude_rate"), ("pitch",), ("roll",), ("aoa",)),
    *(("normal_acc",), ("elevator", "elevator_inner_left", "column_force"), ("throttle", "thrust", "n1_left")),
)
# Panels on a page of A4; more channels go on further figures.
MOST_PANELS = 8
# Height of a page of panels, and least and greatest height of a panel, in heights of a panel of curves.
PAGE, LEAST, MOST = 3.7, 0.44, 0.9
# Points of a curve, a least and a greatest value per pixel, on the page that can be zoomed, four screens wide, and on
# paper.
ZOOM_POINTS, PAGE_POINTS = 8000, 2000
DIFFERENCES = (
    "Channels of the second log less those of the first, at the times of the one with the lower rate; between samples "
    "of the other in straight lines, and nothing within its gaps."
)
GIVE = "give the result.json of bfi identify, start-time, detect or diagnose"
STANDING_OUT = ("declared", "suspected")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnEvent:
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

    @property
    def happening(self) -> Happening:
        """Its lane of a timeline."""
        channels = ", ".join(self.channels)
        label = self.name if not channels or channels in self.name else f"{self.name} ({channels})"
        return Happening(label=label, state=self.state, onset_s=self.onset_s, offset_s=self.offset_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnLog:
    """The part of a log that is drawn."""

    path: str
    rate_hz: float
    n_samples: int
    start_s: float
    stop_s: float
    sha256: str
    clock: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnChannel:
    """A channel that is drawn, and its unit in the first log."""

    name: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Statistics of a channel of the second log less that of the first; None where the two share no samples."""

    channel: str
    unit: str
    mean: float | None = None
    sd: float | None = None
    largest: float | None = None
    at_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """Curve of a channel, (n,) points: of the log number `log`, or of the second log less the first if that is None."""

    log: int | None
    channel: str
    unit: str
    time_s: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlotResult:
    """Logs over time: curves, phases and windows of the first log, and events of analyses, from `from_s` to `to_s`."""

    logs: tuple[DrawnLog, ...]
    from_s: float
    to_s: float
    channels: tuple[DrawnChannel, ...]
    phases: tuple[Phase, ...]
    windows: tuple[ExcitedWindow, ...]
    events: tuple[DrawnEvent, ...]
    differences: tuple[Difference, ...] = ()
    series: tuple[Series, ...]
    notes: tuple[Note, ...]

    @property
    def limits(self) -> tuple[float, float]:
        """The first and the last time."""
        return self.from_s, self.to_s


def read_events(path: str) -> tuple[tuple[DrawnEvent, ...], str]:
    """Return the declared and suspected events of a stored document in order of time, and the sha256 of its log.

    Raises
    ------
    ConfigError : the file cannot be read, is not JSON, or is no document with events.
    """
    wanted = "which has no events"
    document = document_of_kind(read_json(path, give=GIVE), DECLARED, where=path, give=GIVE, wanted=wanted)
    kind = document["kind"]
    sha256 = mapping(member(document, "provenance", where=path), where=f"{path}: provenance").get("log_sha256")
    try:
        suspected = (candidate for candidate in document.get("candidates", ()) if candidate.get("state") == "suspected")
        entries = (*member(document, DECLARED[kind], where=path), *suspected)
        events = [_event(entry, kind) for entry in entries if entry.get("state", "declared") in STANDING_OUT]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: damaged, {error!r}; run bfi {kind} again") from None
    timed = sorted((event for event in events if event is not None), key=lambda event: event.onset_s)
    return tuple(timed), sha256 if isinstance(sha256, str) else ""


def _event(entry: Plain, kind: str) -> DrawnEvent | None:
    """Return an entry as an event, named by its fault, its name or its shape; None where it has no onset."""
    onset_s = entry.get("time_s") if entry.get("onset_s") is None else entry["onset_s"]
    if onset_s is None:
        return None
    channels = entry.get("channels") or ([entry["channel"]] if entry.get("channel") else [])
    times = [float(time_s) for time_s in (onset_s, entry.get("offset_s")) if time_s is not None]
    if not isinstance(channels, list) or not all(map(math.isfinite, times)):
        raise ValueError(f"no channels and times, {channels!r:.40}, {times}")
    return DrawnEvent(
        analysis=kind,
        name=str(entry.get("fault") or entry.get("name") or entry.get("shape") or "alarm"),
        channels=tuple(map(str, channels)),
        state=entry.get("state", "declared"),
        onset_s=times[0],
        offset_s=times[1] if len(times) > 1 else None,
    )


def moved(event: DrawnEvent, shift_s: float) -> DrawnEvent:
    """Return an event whose times are later by `shift_s`."""
    offset_s = None if event.offset_s is None else event.offset_s + shift_s
    return replace(event, onset_s=event.onset_s + shift_s, offset_s=offset_s)


def channels_to_plot(log: FlightLog, names: Sequence[str], events: Sequence[DrawnEvent]) -> tuple[str, ...]:
    """Return the channels to draw: those in `names`, by default those of the events and the first of each of `GROUPS`.

    Raises
    ------
    LogError : the log lacks a channel in `names` that cannot be derived either.
    """
    if names:
        named = [name if name in DERIVED and name not in log.channels else log.channel(name).name for name in names]
        return tuple(dict.fromkeys(named))
    usual = [next((name for name in group if name in log.channels), None) for group in GROUPS]
    event_channels = [name for event in events for name in event.channels if name in log.channels]
    chosen = tuple(dict.fromkeys(name for name in (*event_channels, *usual) if name is not None))
    return chosen or tuple(log.channels)[:MOST_PANELS]


def plot_logs(
    logs: Sequence[FlightLog],
    names: Sequence[str],
    events: Sequence[DrawnEvent],
    *,
    part_s: tuple[float | None, float | None],
    diff: bool = False,
    shift_s: float = 0.0,
    notes: Sequence[Note] = (),
) -> PlotResult:
    """Return the curves of logs, with the phases and windows of the first.

    Parameters
    ----------
    logs : whole, since phases and derived channels follow from the whole flight.
    names : channels to draw; () for the default, see `channels_to_plot`.
    events : of analyses of these logs.
    part_s : first and last time to draw, None for an end of the logs.
    diff : subtract the channels of the first of two logs from those of the second.
    shift_s : seconds that have been added to the times of the second log.
    notes : put before those of the logs.

    Raises
    ------
    LogError : a log lacks a channel in `names`, or has no samples in the part.
    """
    first, (from_s, to_s) = logs[0], part_s
    chosen = channels_to_plot(first, names, events)
    if diff and not names:
        chosen = shared_channels(logs[0], logs[1], chosen)
    whole = [with_derived(log, chosen, from_s=from_s, to_s=to_s) for log in logs]
    if names:
        for log in whole:
            log.signals(chosen)
    parts, absurd = zip(*(_measured(log.window(from_s, to_s), chosen) for log in whole), strict=True)
    starts, stops = zip(*(part.ends() for part in parts), strict=True)
    low, high = min(starts) if from_s is None else from_s, max(stops) if to_s is None else to_s
    phases = phases_of(first)
    notes = [*notes, *(note for log in whole for note in log.notes), *chain.from_iterable(absurd)]
    if len(logs) > 1:
        notes.append(Note.method(f"phases and windows are those of {first.path}"))
    outside = [event for event in events if event.onset_s > high or (event.offset_s or high) < low]
    if outside:
        notes.append(
            Note.method(f"{len(outside)} of {len(events)} events lie outside {instant(low)} to {instant(high)} s")
        )
    if shift_s:
        notes.append(Note.method(f"times of {logs[1].path} are moved by {shift_s:.4g} s, to those of {first.path}"))
    changes = [(name, *difference(parts[0], parts[1], name)) for name in chosen] if diff else []
    gaps = [_gaps(part.time_s) for part in parts]
    units = {name: whole[0].channels[name].unit for name in chosen}
    return PlotResult(
        logs=tuple(
            DrawnLog(
                path=part.path,
                rate_hz=part.rate_hz,
                n_samples=part.n_samples,
                start_s=start_s,
                stop_s=stop_s,
                sha256=part.sha256,
                clock=None if part.epoch is None else part.epoch.iso,
            )
            for part, start_s, stop_s in zip(parts, starts, stops, strict=True)
        ),
        from_s=low,
        to_s=high,
        channels=tuple(DrawnChannel(name=name, unit=unit) for name, unit in units.items()),
        phases=tuple(phase for phase in phases if shows(phase, (low, high))),
        windows=tuple(window for window in ranked_windows(first, phases) if shows(window, (low, high))),
        events=tuple(events),
        differences=tuple(_difference(name, units[name], time_s, values) for name, time_s, values in changes),
        series=(
            *(
                _series(i, part.channels[name], part.time_s, part.channels[name].values, gaps[i])
                for name in chosen
                for i, part in enumerate(parts)
                if name in part.channels
            ),
            *(
                _series(None, whole[0].channels[name], time_s, values, _gaps(time_s))
                for name, time_s, values in changes
            ),
        ),
        notes=tuple(notes),
    )


def _measured(log: FlightLog, names: Sequence[str]) -> tuple[FlightLog, list[Note]]:
    """Return the log with NaN for values of the named channels that are no measurement, and notes on these.

    One of them would make a line of the rest, and near the largest float no axis can be numbered.
    """
    measured, notes = dict[str, FloatArray](), []
    for name in (name for name in names if name in log.channels):
        values = log.channels[name].values
        absurd = np.abs(values) > LARGEST_VALUE
        if absurd.any():
            measured[name] = np.where(absurd, np.nan, values)
            first = int(np.argmax(absurd))
            notes.append(
                Note.limit(
                    f"{log.path}: '{name}' is no measurement in {np.count_nonzero(absurd)} samples, the first at "
                    f"{instant(log.time_s[first])} s ({values[first]:.3g}): these are not drawn"
                )
            )
    return log.with_values(measured), notes


def plot_document(result: PlotResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi plot --json`."""
    return document_of("plot", to_plain(result), result.notes, provenance)


def shared_channels(first: FlightLog, second: FlightLog, chosen: Sequence[str]) -> tuple[str, ...]:
    """Return the chosen channels of the first log that the second has too.

    Raises
    ------
    LogError : the second log has none of them.
    """
    shared = tuple(name for name in chosen if name in second.channels)
    if not shared:
        raise LogError(
            f"{second.path}: shares none of {', '.join(chosen)} with {first.path}; name others with --channel NAME"
        )
    return shared


def _difference(name: str, unit: str, time_s: FloatArray, values: FloatArray) -> Difference:
    """Return the statistics of a difference, (n,) at the times `time_s`."""
    known = np.isfinite(values)
    if not known.any():
        return Difference(channel=name, unit=unit)
    at = int(np.argmax(np.where(known, np.abs(values), -1.0)))
    return Difference(
        channel=name,
        unit=unit,
        mean=float(values[known].mean()),
        sd=float(values[known].std()),
        largest=float(values[at]),
        at_s=float(time_s[at]),
    )


def _gaps(time_s: FloatArray) -> IntArray:
    """Return the samples after which a line is broken."""
    steps = np.diff(time_s)
    return np.flatnonzero(steps > GAP * float(np.median(steps)))


def _series(log: int | None, channel: Channel, time_s: FloatArray, values: FloatArray, before: IntArray) -> Series:
    """Return the curve of a channel; a long curve is the least and the greatest value of each stretch.

    Parameters
    ----------
    before : the last samples before gaps: a NaN in the middle of each breaks the line there.
    """
    kept = thinned(values, max_points=ZOOM_POINTS)
    at = np.searchsorted(kept, before, side="right")
    return Series(
        log=log,
        channel=channel.name,
        unit=channel.unit,
        time_s=np.insert(time_s[kept], at, 0.5 * (time_s[before] + time_s[before + 1])),
        values=np.insert(values[kept], at, np.nan),
    )


def plot_content(document: Plain, units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi plot` holds, in `units`.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    result = from_plain(PlotResult, document, where=where)
    logs, names, limits = result.logs, [channel.name for channel in result.channels], result.limits
    paths = ", ".join(log.path for log in logs)
    n_samples = sum(log.n_samples for log in logs)
    parts = ["Channels over time"]
    if result.phases:
        parts.append("shaded by the phases of the flight, whose names and whose manoeuvres stand in the rows above")
    if result.windows:
        parts.append("frames are windows to analyse, numbered by rank, 1 the best")
    if result.events:
        parts.append("dashed lines are onsets of declared (red) and suspected (orange) faults")
    caption = f"{'; '.join(parts)}. Long records are drawn as the least and the greatest value of each stretch of time."

    pages = [names[i : i + MOST_PANELS] for i in range(0, len(names), MOST_PANELS)]
    figures = (("channels", caption, _panels), ("differences", DIFFERENCES, _changes))
    every = (*_panels(result, names, units, ZOOM_POINTS, named=True), *_changes(result, names, units, ZOOM_POINTS))
    content = ReportContent(
        category="Flight log" if len(logs) == 1 else "Flight logs",
        title=paths,
        heading="Channels over time",
        verdict=(
            f"{paths}: {', '.join(names)} from {instant(limits[0])} s to {instant(limits[1])} s, {n_samples} samples"
        ),
        tables=(
            *_difference_table(result.differences, units),
            *_event_table(result.events),
            *window_table(result.windows),
            *phase_table(result.phases),
        ),
        drawings=tuple(
            Drawing(
                name=f"{name}_{i}" if i > 1 else name,
                caption=text,
                panels=panels(result, page, units, PAGE_POINTS),
                shared_x=True,
            )
            for name, text, panels in figures[: 2 if result.differences else 1]
            for i, page in enumerate(pages, start=1)
        ),
        notes=shown_notes(result.notes, units),
        zoom=(Drawing(name="channels", caption=caption, panels=every, shared_x=True),),
        data={"phases.csv": phase_columns(result.phases)} if result.phases else {},
    )
    return with_clock(content, logs[0].clock, start_s=result.from_s, stop_s=result.to_s)


def _panels(
    result: PlotResult, names: Sequence[str], units: Units, points: int, *, named: bool = False
) -> tuple[Panel, ...]:
    """Return a panel of lanes and a panel for each channel.

    The curves of several logs are labelled by their log in the first panel, or in every panel if `named`.
    """
    logs, limits = result.logs, result.limits
    labels = [Path(log.path).name for log in logs]
    if len(set(labels)) < len(labels):
        labels = [f"{i}: {log.path}" for i, log in enumerate(logs, start=1)]
    bands = _bands(result)
    lanes = lanes_of(result.phases, result.windows, (), [event.happening for event in result.events], limits=limits)
    panels = [lane_panel(lanes, limits)] if lanes else []
    for i, name in enumerate(names):
        curves: list[Curve] = []
        unit = units.of("", channel=name).unit
        for series in result.series:
            if series.channel != name or series.log is None:
                continue
            shown = units.of(series.unit, channel=name)
            label = labels[series.log] if (named or i == 0) and len(logs) > 1 else ""
            unit = unit if curves else shown.unit
            curves.append(_curve(label, series.time_s, shown.readings(series.values), points))
        panels.append(
            _channel_panel(f"{name}\n[{unit or 'no unit'}]", curves, bands, limits, len(names), clock=not panels)
        )
    return tuple(panels)


def _changes(result: PlotResult, names: Sequence[str], units: Units, points: int) -> tuple[Panel, ...]:
    """Return a panel for the difference of each channel."""
    bands, panels = _bands(result), list[Panel]()
    for series in result.series:
        if series.log is not None or series.channel not in names:
            continue
        shown = units.of(series.unit, channel=series.channel)
        label = f"Δ {series.channel}\n[{shown.unit or 'no unit'}]"
        drawn = _curve("", series.time_s, shown.changes(series.values), points)
        panels.append(_channel_panel(label, [drawn], bands, result.limits, len(names), clock=not panels))
    return tuple(panels)


def _bands(result: PlotResult) -> tuple[Block, ...]:
    """Return the parts of the flight and the onsets and ends of events within the time that is drawn."""
    onsets = [line for event in result.events for line in lines_at(event.state, (event.onset_s, event.offset_s))]
    every = (*bands_of(result.phases), *onsets)
    return tuple(band for band in every if band.high >= result.from_s and band.low <= result.to_s)


def _curve(label: str, time_s: FloatArray, values: FloatArray, points: int) -> Curve:
    """Return a curve thinned to `points` points, and those at which the line breaks."""
    missing = np.isnan(values)
    breaks = np.flatnonzero(missing & ~np.append(False, missing[:-1]))
    kept = np.union1d(thinned(values, max_points=points), breaks)
    return curve(label, time_s[kept], values[kept])


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


def _difference_table(differences: Sequence[Difference], units: Units) -> list[Table]:
    """Return the table of the differences of two logs; [] without differences."""
    rows = []
    for entry in differences:
        shown = units.of(entry.unit, channel=entry.channel)
        sizes = (change(value, shown) for value in (entry.mean, entry.sd, entry.largest))
        rows.append((entry.channel, *sizes, "-" if entry.at_s is None else instant(entry.at_s)))
    heads = ("channel", "mean", "sd", "largest", "at [s]")
    title = "Second log less the first"
    times_s = tuple((entry.at_s,) for entry in differences)
    table = Table(name="differences", title=title, heads=heads, rows=tuple(rows), times_s=times_s, last_time=4)
    return [table] if rows else []


def _event_table(events: Sequence[DrawnEvent]) -> list[Table]:
    """Return the table of the events; [] without events."""
    rows = tuple(
        (
            event.name,
            ", ".join(event.channels),
            event.state,
            instant(event.onset_s),
            "" if event.offset_s is None else instant(event.offset_s),
            event.analysis,
        )
        for event in events
    )
    heads = ("event", "channels", "state", "from [s]", "to [s]", "analysis")
    times_s = tuple((event.onset_s, event.offset_s) for event in events)
    return [Table(name="events", title="Events", heads=heads, rows=rows, times_s=times_s, last_time=4)] if rows else []
