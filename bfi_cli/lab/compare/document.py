"""The JSON document and the report of `bfi compare`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...faults import fault_from_dict, fault_to_dict
from ...kernels.runs import union
from ...printable import shortened
from ...quantities.text import SI, Units, counted, instant, number
from ...report.clock import with_clock
from ...report.content import Block, Drawing, Lane, Panel, ReportContent, Span, Table, curve, shown_notes
from ...serialization import Provenance, document_of, from_plain, mapping, member, to_plain
from .result import ComparisonResult, Outcome, Suspect

DECISIONS = {"fault": "yes", "no_fault": "no", "inconclusive": "cannot tell"}
CAPTION = (
    "Above: what was measured; upright lines: onsets of injected faults. Below: when each method says that a fault "
    "acts, from its onset on; an empty lane has none."
)
# Letters of a table cell with names, and with a reason.
NAME, REASON = 40, 100


def compare_document(result: ComparisonResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi compare --json`; what is not known or not finite is None."""
    body = to_plain(result)
    body["truth"] = None if result.truth is None else [fault_to_dict(fault) for fault in result.truth]
    body["series"] = {"time_s": body.pop("time_s"), "measured": body.pop("measured")}
    return document_of("compare", body, result.notes, provenance)


def compare_content(document: Mapping[str, Any], units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return the report of a document of `bfi compare`, in `units`.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    series, truth = (member(document, key, where=where) for key in ("series", "truth"))
    result = from_plain(ComparisonResult, {**document, **mapping(series, where=where), "truth": None}, where=where)
    injected = None if truth is None else [fault_from_dict(entry, where=f"{where}: truth") for entry in truth]
    outcomes = result.outcomes
    ran = [(outcome.method, outcome.statement) for outcome in outcomes if outcome.statement is not None]
    alarmed = [method for method, statement in ran if statement.decision == "fault"]
    verdict = f"{counted(len(ran), 'method')} of {len(outcomes)} ran; {len(alarmed)} declare a fault"
    verdict += f": {', '.join(alarmed)}." if alarmed else "."
    start_s, stop_s = result.log.start_s, result.log.stop_s
    lanes = [
        Lane(
            label=method,
            blocks=tuple(
                Block(label="", low=low, high=high, shade="fault")
                for low, high in union([_extent(each, start_s, stop_s) for each in statement.suspects])
            ),
        )
        for method, statement in ran
    ]
    spans: tuple[Span, ...] = ()
    words = "not known"
    if injected is not None:
        faults = (f"{fault.shape} {fault.channel} from {instant(fault.onset_s)} s" for fault in injected)
        words = "; ".join(faults) or "nothing"
        at = [(max(fault.onset_s, start_s), min(fault.offset_s or stop_s, stop_s)) for fault in injected]
        blocks = tuple(Block(label="", low=low, high=high, shade="grey") for low, high in union(at))
        lanes.insert(0, Lane(label="injected", blocks=blocks))
        spans = tuple(Span(label="onset", low=low, high=low) for low, _ in at)
    panels = [
        Panel(
            x_label="time [s]",
            y_label=f"{name} [{units.of(unit, channel=name).unit}]",
            curves=(curve("", result.time_s, units.of(unit, channel=name).readings(values)),),
            spans=spans,
        )
        for name, unit, values in zip(result.outputs, result.units, result.measured, strict=True)
    ]
    panels.append(
        Panel(x_label="time [s]", y_label="", curves=(), lanes=tuple(lanes), x_limits=(start_s, stop_s), height=1.2)
    )
    refused = [outcome for outcome in outcomes if outcome.statement is None]
    tables = [_methods(outcomes, scored=injected is not None)]
    if refused:
        rows = tuple((outcome.method, shortened(outcome.reason or "", REASON)) for outcome in refused)
        tables.append(Table(name="refused", title="Did not run", heads=("method", "reason"), rows=rows))
    content = ReportContent(
        category="Comparison of methods",
        title=result.log.path,
        heading="Methods on one log",
        verdict=verdict,
        facts=(
            ("Window", f"{instant(start_s)} to {instant(stop_s)} s"),
            ("Outputs", ", ".join(result.outputs)),
            ("Injected", words),
        ),
        tables=tuple(tables),
        drawings=(Drawing(name="comparison", caption=CAPTION, panels=tuple(panels), shared_x=True),),
        notes=shown_notes(result.notes, units),
    )
    return with_clock(content, result.log.clock, start_s=start_s, stop_s=stop_s)


def _methods(outcomes: tuple[Outcome, ...], *, scored: bool) -> Table:
    """Return a line per method: its score, or without injected faults its onsets and the methods that agree."""
    columns: tuple[str, ...] = ("onset", "agrees with")
    if scored:
        columns = ("isolated", "onset error", "magnitude error", "false alarms", "delay")
    rows = []
    for outcome in outcomes:
        statement = outcome.statement
        if statement is None:
            rows.append((outcome.method, "did not run", "-", *("-" for _ in columns), f"{outcome.seconds:.1f} s"))
            continue
        if outcome.score is not None:
            relative = outcome.score.magnitude_error
            cells: tuple[str, ...] = (
                outcome.score.isolated or "-",
                _seconds(outcome.score.onset_error_s),
                "-" if relative is None else f"{number(100.0 * relative, digits=2)} %",
                str(outcome.score.false_alarms),
                _seconds(outcome.score.delay_s),
            )
        else:
            onsets = [instant(each.onset_s) for each in statement.suspects if each.onset_s is not None]
            cells = (f"{', '.join(onsets[:3])} s" if onsets else "-", ", ".join(outcome.agrees) or "nobody")
        names = shortened(", ".join(map(_name, statement.suspects)) or "-", NAME)
        rows.append((outcome.method, DECISIONS[statement.decision], names, *cells, f"{outcome.seconds:.1f} s"))
    heads = ("method", "detected", "names", *columns, "takes")
    return Table(name="methods", title="Methods", heads=heads, rows=tuple(rows))


def _name(suspect: Suspect) -> str:
    if suspect.shape:
        return suspect.name or f"{suspect.shape} {suspect.channel}"
    return f"{suspect.channel}: {suspect.name}" if suspect.name else suspect.channel


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{number(value, digits=3)} s"


def _extent(suspect: Suspect, start_s: float, stop_s: float) -> tuple[float, float]:
    first_s = suspect.onset_s if suspect.onset_s is not None else suspect.declared_s
    low = start_s if first_s is None else min(max(first_s, start_s), stop_s)
    return low, stop_s if suspect.offset_s is None else min(max(suspect.offset_s, low), stop_s)
