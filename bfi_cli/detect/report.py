"""The JSON document of `bfi detect`, and what a reader is shown of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..display_units import SI, Units
from ..provenance import Provenance
from ..report.claims import CANDIDATE_COLUMNS, candidate_tables, hidden_drawing, shown_summary, verdict_sentence
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve
from ..report.text import change, instant, number, shortened
from ..serialization import from_plain, to_plain
from ..verdicts import Candidate
from .result import DetectResult

__all__ = ["SCHEMA", "detect_content", "detect_document"]

SCHEMA = 2
Plain = Mapping[str, Any]
HEADINGS = {"fault": "A channel fails", "no_fault": "No channel fails", "inconclusive": "Inconclusive"}
METHODS = {"exact": "right null space of the last samples", "parity": "parity residuals (left null space)"}
# Round-off: what is drawn of a criterion of 0 on a logarithmic axis.
LEAST = 1e-16
CAPTION = (
    "Detection statistic of every channel with its threshold: by how many standard deviations a step in the channel "
    "lowers the chi-square of the parity residuals, or, for noise-free data, the criterion relative to the channel's "
    "own size. Grey: the healthy time. Dotted: alarms. A channel that has failed is watched no longer."
)


def detect_document(result: DetectResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi detect --json`; numbers that are not finite are None."""
    body = to_plain(result)
    series = {"time_s": body.pop("time_s"), "channels": body.pop("series")}
    notes = body.pop("notes")
    return {
        "kind": "detect",
        "schema": SCHEMA,
        **body,
        "series": series,
        "notes": notes,
        "provenance": to_plain(provenance),
    }


def detect_content(document: Plain, units: Units = SI) -> ReportContent:
    """Return what the report of a document of `bfi detect` holds, in `units`; its CSV files are in SI."""
    log, model, use, alarms = (document[key] for key in ("log", "model", "calibration", "alarms"))
    train, series, exact = document["train"], document["series"], document["method"] == "exact"
    candidates = from_plain(tuple[Candidate, ...], document["candidates"], where="candidates")
    summary = shown_summary(document["summary"], document["verdicts"], candidates, units)
    failing = []
    for alarm in alarms:
        step = change(alarm["size"], units.of(alarm["unit"], channel=alarm["channel"]))
        what = "a failure" if alarm["size"] is None else f"a step of {step}"
        failing.append(f"{what} on {shortened(alarm['channel'], 40)} from {instant(alarm['onset_s'])} s")

    facts = [
        ("Window", f"{number(log['start_s'], digits=6)} to {number(log['stop_s'], digits=6)} s"),
        ("Samples", f"{log['n_samples']} at {number(log['rate_hz'])} Hz"),
        ("Inputs", ", ".join(document["inputs"]) or "none"),
        ("False alarms", f"{number(100.0 * document['false_alarm'])} % of healthy records wanted"),
        ("Method", METHODS[document["method"]]),
        ("Ready", f"{number(document['ready_s'], digits=6)} s"),
    ]
    if train is not None:
        facts.append(("Healthy time", f"{instant(train[0])} to {instant(train[1])} s"))
    if model is not None:
        past = f"{model['rank']} of {model['n_stacked']} components of {model['lags']} lags"
        facts.append(("Predictor", f"{past}, forgetting {model['forgetting']:g}"))
    if use is not None:
        held = f"{instant(use['held_back_s'][0])} to {instant(use['held_back_s'][1])} s, {use['n_blocks']} stretches"
        facts.append(("Calibrated on", f"{held} held back"))
        facts.append(("Level", f"{number(use['level'])} (white noise: {number(use['white_level'])})"))

    spans = [] if train is None else [Span(label="healthy time", low=train[0], high=train[1])]
    spans += [Span(label="alarm", low=alarm["time_s"], high=alarm["time_s"]) for alarm in alarms]
    rows, panels = [], []
    for channel in series["channels"]:
        values = np.array(channel["statistic"], dtype=np.float64)
        most = float(np.nanmax(values)) if np.isfinite(values).any() else None
        shown = units.of(channel["unit"], channel=channel["channel"])
        sd = change(None if model is None else model["noise_sd"].get(channel["channel"]), shown)
        rows.append((shortened(channel["channel"], 40), sd, number(most), number(channel["threshold"])))
        panels.append(
            Panel(
                title=str(channel["channel"]),
                x_label="time [s]",
                y_label="criterion [-]" if exact else "deviate [sd]",
                curves=(curve("", series["time_s"], np.maximum(values, LEAST) if exact else values),),
                log_y=exact,
                levels=(("threshold", channel["threshold"]),),
                spans=tuple(spans),
            )
        )
    heads = ("channel", "prediction error", "largest statistic", "threshold")
    tables = list(candidate_tables(candidates, units))
    if alarms:
        alarm_heads = ("channel", "fails from", "declared at", "statistic", "threshold", "step")
        declared = tuple(
            (
                str(alarm["channel"]),
                f"{instant(alarm['onset_s'])} s",
                f"{instant(alarm['time_s'])} s",
                number(alarm["statistic"]),
                number(alarm["threshold"]),
                change(alarm["size"], units.of(alarm["unit"], channel=alarm["channel"])),
            )
            for alarm in alarms
        )
        tables.insert(0, Table(name="alarms", title="Alarms", heads=alarm_heads, rows=declared))
    tables.append(Table(name="channels", title="Channels watched", heads=heads, rows=tuple(rows)))
    hidden = hidden_drawing(candidates, units)
    listed = {key: [getattr(one, key) for one in candidates] for key in CANDIDATE_COLUMNS}
    return ReportContent(
        category="Detection of a failing channel",
        title=str(log["path"]),
        heading=HEADINGS[document["decision"]],
        verdict=verdict_sentence(document["decision"], failing, summary),
        tone=document["decision"],
        lead=len(hidden),
        facts=tuple(facts),
        tables=tuple(tables),
        drawings=(*hidden, Drawing(name="detection", caption=CAPTION, panels=tuple(panels), across=2)),
        notes=(*map(units.sentence, document["notes"]), *(f"next: {command}" for command in document["commands"])),
        data={"candidates.csv": listed},
    )
