"""The JSON documents and the reports of the commands about logs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from ..decision.implausible import Implausible, in_words
from ..faults import Fault, fault_from_dict, fault_to_dict, magnitude_unit, physical
from ..faults.shapes import SHAPES
from ..flightlog.defects import Defect, sentence_of_defect
from ..flightlog.excitation import Excitation
from ..flightlog.inspection import ChannelReport, DerivableChannel, LogReport
from ..flightlog.quality import UNEVEN
from ..flightlog.record import FlightLog
from ..notes import unique
from ..quantities.channels import STANDARD, Conversion
from ..quantities.text import SI, Units, counted, instant, with_unit
from ..serialization import Provenance, document_of, from_plain, mapping, member, to_plain
from .clock import with_clock
from .content import Drawing, Lane, Panel, ReportContent, Table, notes_of, shown_notes
from .timeline import lanes_of, phase_columns, phase_table, window_table

Plain = Mapping[str, Any]

# Keys of a short defect in the document of `bfi info`.
DEFECT_KEYS = ("channel", "shape", "count", "times_s", "durations_s", "duration_s", "largest", "unit")
# Heights of a panel of lanes and of each of them, relative to that of a panel of curves.
LANES_HEIGHT, LANE_HEIGHT = 0.08, 0.085
MOST_GAPS = 5  # named in a report; the document has all


def explained(log: FlightLog) -> list[dict[str, str | None]]:
    """Return for every column of the file of a log what it was taken for, and why, as plain data.

    `column` is its name in the file, `channel` its name in the log, None where it is left out; `unit` is that in which
    its values were read and `unit_from` where it is stated, both None where none is.
    """
    names = {channel.source: name for name, channel in log.channels.items() if not channel.derived_from}
    rows = []
    for column in log.columns:
        name = names.get(column.source, column.channel)
        is_assumed = name in STANDARD and column.unit is None
        rows.append(
            {
                "column": column.source,
                "channel": name,
                "why": column.why if name == column.channel else f"{column.why} of {column.channel}, but see the notes",
                "unit": STANDARD[str(name)].unit if is_assumed else column.unit,
                "unit_from": "assumed" if is_assumed else column.unit_from or None,
            }
        )
    return rows


def info_document(
    report: LogReport,
    defects: Sequence[Defect],
    plausibility: Sequence[Implausible],
    provenance: Provenance,
    *,
    explain: Sequence[Plain] | None = None,
) -> dict[str, Any]:
    """Return the document of `bfi info --json`, with `explain`, see `explained`, where it is given."""
    span = ("path", "rate_hz", "n_samples", "start_s", "stop_s", "clock")
    same = ("rate_hz", "uniform", "jitter", "channels", "derived", "excitation", "phases", "windows", "segments")
    body = to_plain(
        {
            "log": {key: getattr(report, key) for key in span},
            "recorder": next((low_pass for low_pass in report.filters or () if low_pass.stage == "recorder"), None),
            "gaps": [{"start_s": start, "stop_s": stop} for start, stop in report.gaps],
            **{key: getattr(report, key) for key in same},
            "defects": [
                {key: getattr(defect, key) for key in DEFECT_KEYS} | {"sentence": sentence_of_defect(defect)}
                for defect in defects
            ],
            "plausibility": plausibility,
        }
    )
    if explain is not None:
        body["explain"] = list(explain)
    return document_of("info", body, report.notes, provenance)


def info_content(document: Plain, units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return the report of a document of `bfi info`, in `units`; in SI angles are in rad, as in a file.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    log = _report_of(document, where)
    findings = from_plain(tuple[Implausible, ...], document.get("plausibility", []), where=f"{where}: plausibility")
    gaps, phases, limits = log.gaps, log.phases, (log.start_s, log.stop_s)
    if log.uniform:
        step = "uniform"
    elif log.jitter <= UNEVEN:
        step = f"uniform but for {counted(len(gaps), 'gap')}"
    else:
        step = f"not uniform, off by up to {100 * log.jitter:.3g} %"
    size = f"{log.n_samples} samples at {log.rate_hz:.4g} Hz, {instant(log.start_s)} s to {instant(log.stop_s)} s"
    longest = sorted(sorted(gaps, key=lambda gap: gap[0] - gap[1])[:MOST_GAPS])
    facts = [("Gap", f"from {start:.10g} s to {stop:.10g} s ({stop - start:.3g} s)") for start, stop in longest]
    if len(gaps) > len(longest):
        facts.append(("Gaps", f"{len(gaps)} in all, of which the longest are named"))
    facts += [
        ("Recorder", f"{low_pass.kind} low-pass, gain one half at {low_pass.edge_hz:.3g} Hz, {low_pass.source}")
        for low_pass in log.filters or ()
    ]
    lanes = lanes_of(phases, log.windows, log.segments, (), limits=limits)
    timeline = Drawing(
        name="phases",
        caption=(
            "Phases of the flight, manoeuvres, windows to analyse (numbered by rank, 1 the best) and the segments that "
            "the file names."
        ),
        panels=(lane_panel(lanes, limits),),
    )
    contradicted = units.sentence(in_words(findings))
    content = ReportContent(
        category="Flight log",
        title=log.path,
        heading="What the log holds",
        verdict=f"{contradicted}. " * bool(contradicted) + f"{log.path}: {size}, time step {step}",
        facts=(*facts, *(("Defect", str(defect["sentence"])) for defect in document.get("defects", ()))),
        tables=(*_tables(log, units), *_explain_table(document.get("explain", ()))),
        drawings=(timeline,) if lanes else (),
        notes=shown_notes(log.notes, units),
        data={"phases.csv": phase_columns(phases)} if phases else {},
    )
    return with_clock(content, log.clock, start_s=log.start_s, stop_s=log.stop_s)


def _explain_table(rows: Sequence[Plain]) -> Iterator[Table]:
    heads = {"in the file": "column", "channel": "channel", "unit": "unit", "stated by": "unit_from", "why": "why"}
    cells = [{head: row[key] for head, key in heads.items()} for row in rows]
    yield from _table("explain", "Columns of the file", cells)


def _report_of(document: Plain, where: str) -> LogReport:
    """Return the report that a document of `bfi info` was made from; its filters are the recorder's alone."""
    recorder, gaps = document.get("recorder"), member(document, "gaps", where=where)
    flat = {
        "derived": [],
        **document,
        **mapping(member(document, "log", where=where), where=f"{where}: log"),
        "gaps": [[member(gap, key, where=f"{where}: gaps") for key in ("start_s", "stop_s")] for gap in gaps],
        "filters": recorder and [recorder],
    }
    return from_plain(LogReport, flat, where=where)


def lane_panel(lanes: Sequence[Lane], limits: tuple[float, float]) -> Panel:
    """Return the panel of lanes over the time between `limits`, s."""
    height = LANES_HEIGHT + LANE_HEIGHT * len(lanes)
    return Panel(
        x_label="time [s]", y_label="", curves=(), lanes=tuple(lanes), x_limits=limits, height=height, clock=True
    )


def _tables(log: LogReport, units: Units) -> Iterator[Table]:
    def shown(entry: ChannelReport | DerivableChannel | Excitation) -> Conversion:
        return units.in_file(entry.unit, channel=entry.channel if isinstance(entry, Excitation) else entry.name)

    channels = [
        {
            "name": channel.name,
            "in the file": None if channel.source == channel.name else channel.source,
            "unit": shown(channel).unit,
            "own rate [Hz]": channel.own_rate_hz,
            "min": shown(channel).reading(channel.min),
            "max": shown(channel).reading(channel.max),
            "quantum": shown(channel).change(channel.quantum),
            "NaN": channel.n_nan or None,
            "follows from": ", ".join(channel.pressures),
            "held": channel.hold_period_s
            and f"{100 * channel.held_fraction:.0f} %, {1 / channel.hold_period_s:.3g} Hz",
        }
        for channel in log.channels
    ]
    derived = [
        {
            "name": channel.name,
            "unit": shown(channel).unit,
            "what it is": channel.description,
            "lacks": ", ".join(channel.lacks) or "nothing",
        }
        for channel in log.derived
    ]
    moving = [
        {
            "channel": excitation.channel,
            "unit": shown(excitation).unit,
            "range": shown(excitation).change(excitation.range),
            "moves": excitation.moves,
            "bandwidth [Hz]": excitation.bandwidth_hz,
        }
        for excitation in log.excitation
    ]
    segments = {"label": "label", "from [s]": "start_s", "to [s]": "stop_s", "note": "note"}
    named = [{head: getattr(segment, key) for head, key in segments.items()} for segment in log.segments]
    yield from _table("channels", "Channels", channels)
    if any(row["lacks"] == "nothing" for row in derived):
        yield from _table("derived", "Channels that can be derived, for --input and --output", derived)
    yield from phase_table(log.phases)
    yield from _table("excitation", "Inputs, in flight", moving)
    yield from window_table(log.windows)
    for table in _table("segments", "Segments named in the file", named):
        times_s = tuple((segment.start_s, segment.stop_s) for segment in log.segments)
        yield replace(table, times_s=times_s, last_time=table.heads.index("to [s]"))


def _table(name: str, title: str, rows: Sequence[Plain]) -> Iterator[Table]:
    """Yield a table of rows by column title, without its empty columns; nothing without rows."""

    def cell(value: str | float | None) -> str:
        return value or "" if value is None or isinstance(value, str) else f"{value:.5g}"

    heads = [head for head in (rows[0] if rows else ()) if any(row[head] not in (None, "") for row in rows)]
    if heads:
        cells = (tuple(cell(row[head]) for head in heads) for row in rows)
        yield Table(name=name, title=title, heads=tuple(heads), rows=tuple(cells))


def log_document(log: FlightLog, provenance: Provenance, *, kind: str) -> dict[str, Any]:
    """Return the JSON document of a command that makes a log; `truth` is None where the log carries none."""
    body = to_plain(
        {
            "path": log.path,
            "n_samples": log.n_samples,
            "rate_hz": log.rate_hz,
            "channels": [{"name": channel.name, "unit": channel.unit} for channel in log.channels.values()],
            "truth": None
            if log.truth is None
            else {
                "faults": [fault_to_dict(fault) for fault in log.truth.faults],
                "ordinary": [asdict(occurrence) for occurrence in log.truth.ordinary],
            },
        }
    )
    return document_of(kind, body, log.notes, provenance)


def log_content(document: Plain, units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return the report of a document of `bfi convert`, `bfi simulate` or `bfi inject`.

    The units of channels are those of the file that was written, whatever `units` are.
    """
    written = {channel["name"]: channel["unit"] for channel in document["channels"]}
    truth = member(document, "truth", where=where) or {"faults": ()}
    faults = [fault_from_dict(fault, where=f"{where}: truth") for fault in truth["faults"]]
    rows = tuple((name, unit or "not stated") for name, unit in written.items())
    return ReportContent(
        category="Flight log",
        title=str(document["path"]),
        heading="A log was written",
        verdict=f"{document['path']}: {document['n_samples']} samples at {document['rate_hz']:.6g} Hz",
        facts=(
            *(("Ordinary", _made_in_words(entry["cause"], entry["at_s"])) for entry in truth.get("ordinary", ())),
            *(("Injected", describe_injected(fault, written.get(fault.channel, ""), units)) for fault in faults),
        ),
        tables=(Table(name="channels", title="Channels", heads=("name", "unit"), rows=rows),),
        notes=notes_of(document),
    )


def log_lines(log: FlightLog, units: Units = SI) -> list[str]:
    """Return the lines that a command prints about a log: a summary, a line per fault, in `units`, and per note."""
    names = ", ".join(f"{channel.name} [{channel.unit or '?'}]" for channel in log.channels.values())
    faults, unit_of = (
        log.truth.faults if log.truth else (),
        {channel.name: channel.unit for channel in log.channels.values()},
    )
    return [
        f"{log.path}: {log.n_samples} samples at {log.rate_hz:.6g} Hz: {names}",
        *(f"ordinary: {_made_in_words(made.cause, made.at_s)}" for made in (log.truth.ordinary if log.truth else ())),
        *(f"fault: {describe_injected(fault, unit_of.get(fault.channel, ''), units)}" for fault in faults),
        *(f"note: {units.sentence(note.text)}" for note in unique(log.notes)),
    ]


def _made_in_words(cause: str, at_s: float) -> str:
    """Return an ordinary cause that was made: "altimeter set at 400 s"."""
    return f"{cause.replace('_', ' ')} at {instant(at_s)} s"


def describe_injected(fault: Fault, unit: str, units: Units = SI) -> str:
    """Return an injected fault in words: "bias on tas, magnitude 4 m/s, from 13.8 s".

    In SI the numbers are those that were typed. A magnitude that multiplies a slope is followed by its meaning.

    Parameters
    ----------
    unit : of its channel, "" for a fault of a pressure line.
    """

    def typed(value: float, of: str) -> str:
        """Return a size as it was typed, in another unit to four digits."""
        shown = units.in_file(of, channel=fault.channel, channel_unit=unit)
        return with_unit(f"{value:g}" if shown.factor == 1.0 else f"{value / shown.factor:.4g}", shown.unit)

    until = "" if fault.offset_s is None else f" until {instant(fault.offset_s)} s"
    label = fault.shape if fault.name is None else f"{fault.name} ({fault.shape})"
    size = f", magnitude {typed(fault.magnitude, magnitude_unit(fault, unit))}"
    if fault.slope is not None:
        size += f" ({typed(*physical(fault, fault.magnitude, unit))})"
    where = f" on {fault.channel}" if fault.channel else ""
    return f"{label}{where}{size if SHAPES[fault.shape].has_magnitude else ''}, from {instant(fault.onset_s)} s{until}"
