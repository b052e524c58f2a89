"""The JSON document of `bfi detect`, and what a reader is shown of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..provenance import Provenance
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve
from ..report.text import instant, number, quantity, shortened
from ..serialization import to_plain
from .result import DetectResult

__all__ = ["SCHEMA", "detect_content", "detect_document"]

SCHEMA = 1
Plain = Mapping[str, Any]
HEADINGS = {"fault": "A channel fails", "no_fault": "No channel fails", "not_identifiable": "Not identifiable"}
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


def detect_content(document: Plain) -> ReportContent:
    """Return the exhibit of a document of `bfi detect`."""
    return ReportContent(
        category="Detection of a failing channel",
        title=str(document["log"]["path"]),
        heading=HEADINGS[document["decision"]],
        verdict=_verdict(document),
        tone=document["decision"],
        facts=tuple(_facts(document)),
        tables=(*_alarms(document["alarms"]), _channels(document)),
        drawings=(_drawing(document),),
        notes=(*document["notes"], *(f"next: {command}" for command in document["commands"])),
    )


def _verdict(document: Plain) -> str:
    alarms = document["alarms"]
    if not alarms:
        share = number(100.0 * document["false_alarm"])
        return f"No channel of {', '.join(document['outputs'])} fails at a false-alarm rate of {share} %."
    sentences = []
    for alarm in alarms:
        step = "" if alarm["size"] is None else f" (a step of {quantity(alarm['size'], alarm['unit'])})"
        sentences.append(f"{alarm['channel']} from {instant(alarm['onset_s'])} s{step}")
    return f"Failing: {'; '.join(sentences)}."


def _facts(document: Plain) -> list[tuple[str, str]]:
    log, model, use = document["log"], document["model"], document["calibration"]
    rows = [
        ("Window", f"{number(log['start_s'], digits=6)} to {number(log['stop_s'], digits=6)} s"),
        ("Samples", f"{log['n_samples']} at {number(log['rate_hz'])} Hz"),
        ("Inputs", ", ".join(document["inputs"]) or "none"),
        ("Method", METHODS[document["method"]]),
        ("Ready", f"{number(document['ready_s'], digits=6)} s"),
    ]
    if document["train"] is not None:
        rows.append(("Healthy time", f"{instant(document['train'][0])} to {instant(document['train'][1])} s"))
    if model is not None:
        past = f"{model['rank']} of {model['n_stacked']} components of {model['lags']} lags"
        rows.append(("Predictor", f"{past}, forgetting {model['forgetting']:g}"))
    if use is not None:
        held = f"{instant(use['held_back_s'][0])} to {instant(use['held_back_s'][1])} s, {use['n_blocks']} stretches"
        rows.append(("Calibrated on", f"{held} held back"))
        rows.append(("Level", f"{number(use['level'])} (white noise: {number(use['white_level'])})"))
    return rows


def _alarms(alarms: Sequence[Plain]) -> tuple[Table, ...]:
    if not alarms:
        return ()
    rows = tuple(
        (
            str(alarm["channel"]),
            f"{instant(alarm['onset_s'])} s",
            f"{instant(alarm['time_s'])} s",
            number(alarm["statistic"]),
            number(alarm["threshold"]),
            quantity(alarm["size"], alarm["unit"]),
        )
        for alarm in alarms
    )
    heads = ("channel", "fails from", "declared at", "statistic", "threshold", "step")
    return (Table(name="alarms", title="Alarms", heads=heads, rows=rows),)


def _channels(document: Plain) -> Table:
    noise = {} if document["model"] is None else document["model"]["noise_sd"]
    rows = []
    for one in document["series"]["channels"]:
        values = np.array(one["statistic"], dtype=np.float64)
        most = float(np.nanmax(values)) if np.isfinite(values).any() else None
        sd = quantity(noise.get(one["channel"]), one["unit"])
        rows.append((shortened(one["channel"], 40), sd, number(most), number(one["threshold"])))
    heads = ("channel", "prediction error", "largest statistic", "threshold")
    return Table(name="channels", title="Channels watched", heads=heads, rows=tuple(rows))


def _drawing(document: Plain) -> Drawing:
    time_s = document["series"]["time_s"]
    exact = document["method"] == "exact"
    spans = []
    if document["train"] is not None:
        spans.append(Span(label="healthy time", low=document["train"][0], high=document["train"][1]))
    spans += [Span(label="alarm", low=alarm["time_s"], high=alarm["time_s"]) for alarm in document["alarms"]]
    panels = []
    for one in document["series"]["channels"]:
        values = np.array(one["statistic"], dtype=np.float64)
        panels.append(
            Panel(
                title=str(one["channel"]),
                x_label="time [s]",
                y_label="criterion [-]" if exact else "deviate [sd]",
                curves=(curve("", time_s, np.maximum(values, LEAST) if exact else values),),
                log_y=exact,
                levels=(("threshold", one["threshold"]),),
                spans=tuple(spans),
            )
        )
    return Drawing(name="detection", caption=CAPTION, panels=tuple(panels), across=2)
