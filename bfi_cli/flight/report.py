"""The JSON document of `bfi diagnose`, and what a reader is shown of it: a timeline of the flight, a page per event."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..files import EVENTS
from ..kernels import TWO_SIDED_95
from ..notes import Note
from ..quantities.text import SI, Units, capital, change, duration, instant, number, with_unit
from ..report.clock import with_clock
from ..report.content import Block, Curve, Drawing, Panel, ReportContent, Table, curve, shown_notes
from ..report.log import lane_panel
from ..report.proof import proof_tables
from ..report.timeline import Happening, bands_of, lanes_of, lines_at, phase_table
from ..serialization import Provenance, csv_lines, document_of, from_plain, mapping, member, to_plain
from .first_screen import cause_in_words, channel_of, diagnose_screen, error_of, event_in_words, second
from .result import Course, DiagnoseResult, Event, FlightLimit, LimitCourse, OrdinaryEvent

SERIES = ("time_s", "measured", "corrected", "units", "strips", "limit_courses", "courses")
# On either side of the window that describes an event.
AROUND_S = 60.0
MOST_PAGES = 12  # events with a page of their own; the table has all
EVENT_COLUMNS = (
    *("fault", "among", "channels", "state", "kind", "stages", "shape", "magnitude", "unit", "sd", "ci95", "effect"),
    "beyond_tolerance",
    *("onset_s", "onset_ci95", "offset_s", "seen_until_s", "statistic", "threshold", "p_value", "note", "repeat"),
    *("count", "times_s", "duration_s", "margin", "refuted_by"),
)
LIMIT_COLUMNS = tuple(field.name for field in fields(FlightLimit))
TIMELINE = (
    "The flight: its phases, channels as measured (blue) and without the declared faults (red), and how near each "
    "analysis came to its threshold (1). Dashed: onsets and ends of declared (red) and suspected (orange) faults. A "
    "fault without an end may last; its correction ends with the window that describes it."
)
LIMITS = (
    "Drifts of an airspeed, and losses of impact pressure by icing, that the flight excludes at 95 %: those steeper "
    "than the line, by their onset. Dashed: what 95 % of the watched time excludes, and the worst. No line: nothing "
    "bounds them."
)
# What could be there unseen: errors, and apart from them how far channels of one sensor may disagree.
LIMIT_TABLES = (
    ("error", "limits", "How large a fault could be there unseen, in the stretches that were watched"),
    (
        "disagreement",
        "agreement",
        "How far channels of one sensor could disagree unseen; it bounds no error that they share",
    ),
)


def diagnose_document(result: DiagnoseResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi diagnose --json`; numbers that are not finite are None."""
    body = to_plain(result) | {"headline": diagnose_screen(result).headline}
    if not result.proved:
        del body["proved"]
    series = {key: body.pop(key) for key in SERIES}
    return document_of("diagnose", {**body, "series": series}, result.notes, provenance)


def events_csv(events: Sequence[Event]) -> bytes:
    """Return the CSV file of events for other programs, of which the first line is the header.

    A row for each event in order of time: seconds of the log, SI and radians, empty where nothing is known.

    `time` is the onset, so that a program for time series shows each number as a point there. `low` and `high` are the
    ends of the 95 % interval of the magnitude.
    """
    rows = [
        (
            *(
                event.onset_s,
                event.offset_s,
                event.fault,
                " ".join(event.channels),
                event.state,
                event.kind,
                event.shape,
            ),
            *(event.magnitude, event.unit, *(event.ci95 or (None, None)), event.p_value),
        )
        for event in sorted(events, key=lambda event: event.onset_s)
    ]
    return f"{EVENTS}\n{csv_lines(rows)}".encode()


def diagnose_content(document: Mapping[str, Any], units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi diagnose` holds, in `units`; its CSV files are in SI.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    series = mapping(member(document, "series", where=where), where=f"{where}: series")
    result = from_plain(DiagnoseResult, {**document, **series}, where=where)
    log, events, angle = result.log, result.events, result.zero_lift_rad
    facts = [
        ("Flight", f"{instant(log.start_s)} to {instant(log.stop_s)} s"),
        ("Samples", f"{log.n_samples} at {number(log.rate_hz)} Hz"),
        ("False alarms", f"{number(100.0 * result.false_alarm)} % of whole healthy flights wanted"),
        ("Windows", f"{len(result.windows)} of the parity scan"),
    ]
    if angle is not None:
        facts.append(("Zero lift", f"{np.degrees(angle):.2f} deg, from {result.zero_lift_from}"))
    screen = diagnose_screen(result, units)
    drawings = [_timeline(result, units)] if result.time_s.size else []
    drawings += [_limits_figure(result, units)] if result.limit_courses else []
    pages = (_page(result, k, units) for k in range(min(len(events), MOST_PAGES)))
    drawings += [page for page in pages if page.panels]  # none of what is neither drawn nor has evidence by residual
    content = ReportContent(
        category="Diagnosis of a flight",
        title=log.path,
        tone=result.decision,
        lead=1 if drawings else 0,
        facts=tuple(facts),
        tables=tuple(table for table in _tables(result, units) if table.rows),
        drawings=tuple(drawings),
        notes=(
            *(Note.limit(f"missing: {units.sentence(sentence)}") for sentence in result.missing),
            *(_note(event, units) for event in events if event.note),
            *(Note.advice(f"{_name(event)}: next time, {event.repeat}") for event in events if event.repeat),
            *shown_notes(result.notes, units),
        ),
        zoom=_zoom(result, drawings, units),
        data={
            "events.csv": _columns(events, EVENT_COLUMNS),
            **({"deviations.csv": _columns(result.deviations, EVENT_COLUMNS)} if result.deviations else {}),
            **({"limits.csv": _columns(result.limits, LIMIT_COLUMNS)} if result.limits else {}),
        },
    )
    return with_clock(content.headed(screen), log.clock, start_s=log.start_s, stop_s=log.stop_s)


def _tables(result: DiagnoseResult, units: Units) -> Iterator[Table]:
    """Yield the tables of a diagnosis, those that are empty too."""
    yield _event_table("events", "Events", result.events, units)
    yield _event_table("deviations", "Small deviations, within the tolerances", result.deviations, units)
    yield _ordinary_table(result.ordinary, units)
    for bounds, name, title in LIMIT_TABLES:
        yield _limit_table(name, title, [limit for limit in result.limits if limit.bounds == bounds], units)
    yield from proof_tables(result.proved, units)
    yield Table(
        name="unwatched",
        title="Flight that was not watched",
        heads=("stretch [s]", "why"),
        rows=tuple(
            (f"{instant(round(first))} to {instant(round(last))}", why) for first, last, why in result.unwatched
        ),
        times_s=tuple((first, last) for first, last, _ in result.unwatched),
    )
    yield from phase_table(result.phases)


def _note(event: Event, units: Units) -> Note:
    return Note("method" if event.state == "declared" else "limit", f"{_name(event)}: {units.sentence(event.note)}")


def _zoom(result: DiagnoseResult, drawings: Sequence[Drawing], units: Units) -> tuple[Drawing, ...]:
    """Return the timeline with the limits and the courses of the events below it; () where no course is stored."""
    if not result.time_s.size:
        return ()
    span = (result.log.start_s, result.log.stop_s)
    bands = (*bands_of(result.phases), *_lines(result.events))
    panels = {drawing.name: drawing.panels for drawing in drawings}
    limits = (replace(panel, y_label=f"limit of {panel.y_label}", bands=bands) for panel in panels.get("limits", ()))
    courses = (_course_panel(result, course, span, bands, units) for course in result.courses)
    return (replace(drawings[0], panels=(*panels["timeline"], *limits, *courses)),)


def _columns(rows: Sequence[Event | FlightLimit], keys: Iterable[str]) -> dict[str, list[Any]]:
    """Return columns of rows."""
    return {key: [_cell(getattr(row, key)) for row in rows] for key in keys}


def _cell(value: Any) -> Any:
    if isinstance(value, Mapping):
        return " ".join(f"{name}={size:.6g}" for name, size in value.items())
    if isinstance(value, tuple):
        return " ".join(str(entry) for entry in value)
    return value


def _name(event: Event | FlightLimit | LimitCourse) -> str:
    return event.fault.replace("_", " ")


def _course_in_words(event: Event, units: Units) -> str:
    """Return the shape of an event and, where it has one, its magnitude with the 95 % interval of that."""
    if event.magnitude is None:
        held = "held" if event.shape.endswith("blocked") else event.shape
        return f"{event.shape}, {event.count} in all" if event.count else held
    shown = units.of(event.unit, channel=channel_of(event.fault))
    spread = None if event.sd is None else TWO_SIDED_95 * (event.sd / shown.factor)
    values = (event.magnitude, *(event.ci95 or ()))
    size, *ends = (number(shown.change(value), spread=spread, extra=1) for value in values)
    between = f" ({' to '.join(ends)})" if ends else ""
    lasts = "" if event.constant_s is None else f" over {duration(event.constant_s)}"
    return f"{event.shape} {with_unit(size, shown.unit)}{between}{lasts}"


def _event_table(name: str, title: str, events: Sequence[Event], units: Units) -> Table:
    rows = []
    for event in events:
        low, high = event.onset_ci95
        evidence = ", ".join(f"{name} {value:.3g}" for name, value in event.evidence.items())
        effect = ", ".join(f"{name} {error_of(name, value, units)}" for name, value in list(event.effect.items())[:3])
        rows.append(
            (
                ", ".join(event.among),
                event.state,
                f"{second(event.onset_s)} ({second(low)} to {second(high)})",
                "may last" if event.offset_s is None else second(event.offset_s),
                _course_in_words(event, units),
                f"{effect} by {instant(round(event.window_s[1]))} s" if effect else "-",
                "-" if event.p_value is None else f"{event.p_value:.2g}",
                evidence or "-",
            )
        )
    heads = ("fault (or)", "state", "from [s]", "to [s]", "course (95 %)", "largest error", "p at most", "evidence")
    times_s = tuple((event.onset_s, event.offset_s) for event in events)
    return Table(name=name, title=title, heads=heads, rows=tuple(rows), times_s=times_s, last_time=3)


def _ordinary_table(ordinary: Sequence[OrdinaryEvent], units: Units) -> Table:
    """Return what looked like a fault and is explained by what happens in any flight."""
    rows = []
    for event in ordinary:
        shown = units.of(event.unit, channel=channel_of(event.looks_like))
        size = "-" if event.magnitude is None else with_unit(number(shown.change(event.magnitude)), shown.unit)
        evidence = ", ".join(f"{name} {value:+.3g}" for name, value in event.evidence.items())
        rows.append(
            (
                cause_in_words(event.cause),
                second(event.from_s),
                second(event.to_s),
                event.looks_like.replace("_", " ") or "-",
                size,
                evidence or ("stated" if event.stated else "-"),
            )
        )
    heads = ("what happens", "from [s]", "to [s]", "looks like", "of", "log density")
    title, times_s = "Ordinary events, no faults", tuple((event.from_s, event.to_s) for event in ordinary)
    return Table(name="ordinary", title=title, heads=heads, rows=tuple(rows), times_s=times_s, last_time=2)


def _limit_table(name: str, title: str, limits: Sequence[FlightLimit], units: Units) -> Table:
    """Return what could be there unseen, a row for each fault and shape."""
    by_fault: dict[tuple[str, str], list[FlightLimit]] = {}
    for limit in limits:
        by_fault.setdefault((limit.fault, limit.shape), []).append(limit)
    worst = map(_worst, by_fault.values())
    heads = ("fault", "shape", "excluded above", "could hide", "stretch [s]", "in 95 %", "growing on", "tolerance")
    return Table(
        name=name,
        title=title,
        heads=(*heads, "within"),
        rows=tuple(_limit_row(fault_limits, units) for fault_limits in by_fault.values()),
        times_s=tuple((limit.from_s, limit.to_s) for limit in worst),
        last_time=len(heads),
    )


def _worst(limits: Sequence[FlightLimit]) -> FlightLimit:
    """Return the limit of the worst stretch."""
    return next(limit for limit in limits if limit.holds_in == 1.0 and not limit.grows_on)


def _limit_row(limits: Sequence[FlightLimit], units: Units) -> tuple[str, ...]:
    """Return the limits of one fault and shape: the worst stretch, what holds mostly, and what grows on."""
    worst = _worst(limits)
    mostly = next((limit for limit in limits if limit.holds_in < 1.0), None)
    grown = next((limit for limit in limits if limit.grows_on), None)
    shown = units.of(worst.effect_unit, channel=worst.channel)

    def hidden(limit: FlightLimit | None) -> str:
        return "-" if limit is None else "any" if limit.effect is None else change(limit.effect, shown)

    within = all(limit.within_tolerance for limit in limits)
    return (
        worst.fault,
        worst.shape,
        change(worst.excluded_above, units.of(worst.unit, channel=channel_of(worst.fault))),
        hidden(worst),
        f"{instant(round(worst.from_s))} to {instant(round(worst.to_s))}",
        hidden(mostly),
        hidden(grown),
        change(worst.tolerance, shown),
        "-" if worst.tolerance is None else "yes" if within else "no",
    )


def _lines(events: Sequence[Event]) -> list[Block]:
    return [
        line for event in events for line in lines_at(event.state, event.times_s or (event.onset_s, event.offset_s))
    ]


def _timeline(result: DiagnoseResult, units: Units) -> Drawing:
    events, limits = result.events, (result.log.start_s, result.log.stop_s)
    happenings = [
        Happening(
            label=_name(event),
            state=event.state,
            onset_s=event.onset_s,
            offset_s=event.shown_s[1],
            times_s=event.times_s or (),
        )
        for event in events
    ]
    lanes = lanes_of(result.phases, (), (), happenings, limits=limits)
    bands = (*bands_of(result.phases), *_lines(events))
    panels = [lane_panel(lanes, limits)] if lanes else []
    measured = result.measured.keys()
    shown = [*[name for name in ("tas", "cas", "ias") if name in measured][:1], *({"altitude"} & measured)]
    wrong = dict.fromkeys(name for event in events for name in event.channels)
    shown += [name for name in wrong if name in measured and name not in shown][:3]
    panels += [_channel_panel(result, name, limits, bands, units) for name in shown]
    groups: dict[str, list[Curve]] = {"parity": [], "relations": []}
    for strip in result.strips:
        group = "parity" if strip.name.startswith("parity") else "relations"
        groups[group].append(curve(strip.name, strip.time_s, strip.share))
    for group, curves in groups.items():
        if curves:
            panels.append(
                Panel(
                    x_label="time [s]",
                    y_label=f"{group}\n[of threshold]",
                    curves=tuple(curves),
                    levels=(("threshold", 1.0),),
                    bands=bands,
                    x_limits=limits,
                    height=0.6,
                )
            )
    return Drawing(name="timeline", caption=TIMELINE, panels=tuple(panels), shared_x=True)


def _limits_figure(result: DiagnoseResult, units: Units) -> Drawing:
    """Return the limits of drifts over the flight, what 95 % of it exclude, and the worst."""
    limits = (result.log.start_s, result.log.stop_s)
    panels = []
    for course in result.limit_courses:
        shown = units.of(course.unit, channel=channel_of(course.fault))
        panels.append(
            Panel(
                x_label="onset [s]",
                y_label=f"{_name(course)}\n[{shown.unit}]",
                curves=(curve("", course.time_s, shown.changes(course.excluded_above)),),
                levels=(("95 %", course.mostly / shown.factor), ("worst", course.worst / shown.factor)),
                log_y=True,
                bands=tuple(bands_of(result.phases)),
                x_limits=limits,
                height=0.7,
            )
        )
    return Drawing(name="limits", caption=LIMITS, panels=tuple(panels), shared_x=True)


def _channel_panel(
    result: DiagnoseResult,
    name: str,
    limits: tuple[float, float],
    bands: tuple[Block, ...],
    units: Units,
) -> Panel:
    time_s, shown = result.time_s, units.of(result.units[name], channel=name)
    inside = (time_s >= limits[0]) & (time_s <= limits[1])
    curves = [curve("measured", time_s[inside], shown.readings(result.measured[name][inside]))]
    if name in result.corrected:
        values = shown.readings(result.corrected[name][inside])
        if np.isfinite(values).any():
            curves.append(curve("without the fault", time_s[inside], values))
    return Panel(
        x_label="time [s]",
        y_label=f"{name}\n[{shown.unit}]",
        curves=tuple(curves),
        bands=bands,
        x_limits=limits,
        height=0.8,
    )


def _course_panel(
    result: DiagnoseResult, course: Course, limits: tuple[float, float], bands: tuple[Block, ...], units: Units
) -> Panel:
    """Return the course of an event beside its named shape."""
    shown = units.of(course.unit, channel=channel_of(course.channel))
    what = "loss of\nq_impact [1]" if course.channel == "pitot_icing" else f"error of\n{course.channel} [{shown.unit}]"
    free, low, high, named = map(shown.changes, (course.free, course.low, course.high, course.named))
    return Panel(
        x_label="time [s]",
        y_label=what,
        curves=(
            curve("of any shape, 95 % band", course.time_s, free, low=low, high=high),
            curve(f"as a {result.events[course.event].shape}", course.time_s, named, style="dashed"),
        ),
        bands=bands,
        x_limits=limits,
    )


def _page(result: DiagnoseResult, k: int, units: Units) -> Drawing:
    """Return the figure of an event: its channels, its course beside the named shape, its evidence by residual."""
    event = result.events[k]
    low = max(result.log.start_s, event.window_s[0] - AROUND_S)
    high = min(result.log.stop_s, event.window_s[1] + AROUND_S)
    bands = (*bands_of(result.phases), *_lines([event]))
    inside = tuple(band for band in bands if band.high >= low and band.low <= high)
    names = [name for name in event.channels if name in result.measured][:3]
    panels = [_channel_panel(result, name, (low, high), inside, units) for name in names]
    courses = (course for course in result.courses if course.event == k)
    panels += [_course_panel(result, course, (low, high), inside, units) for course in courses]
    # The panels above each other have one time axis; its name stands below the last.
    panels[:-1] = [replace(panel, x_label="") for panel in panels[:-1]]
    # A line is held where its pressure scatters least: no bar shows that.
    has_evidence = bool(event.evidence) and event.stages[0] != "holds"
    if has_evidence:
        sizes = list(event.evidence.items())
        panels.append(
            Panel(
                x_label="evidence [as in the caption]",
                y_label="",
                curves=(curve("", [float(value) for _, value in sizes], range(len(sizes)), style="rows_red"),),
                y_ticks=tuple((name, float(i)) for i, (name, _) in enumerate(sizes)),
                height=0.25 + 0.15 * len(sizes),
            )
        )
    caption = f"{capital(event_in_words(event, units))}; {event.state}."
    if has_evidence:
        caption += (
            " Evidence for the fault by residual: twice its log-likelihood ratio; of other analyses their statistic."
        )
    return Drawing(name=f"event_{k + 1}", caption=caption, panels=tuple(panels))
