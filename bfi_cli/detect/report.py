"""The JSON document of `bfi detect`, and what a reader is shown of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..channels import LARGEST_ERROR
from ..decision import Candidate
from ..display_units import SI, Units
from ..printable import shortened
from ..provenance import Provenance
from ..report.claims import CANDIDATE_COLUMNS, candidate_tables, hidden_drawing, shown_summary, verdict_sentence
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve
from ..report.text import change, instant, interval, number, with_unit
from ..serialization import from_plain, to_plain
from .result import DetectResult

__all__ = ["SCHEMA", "detect_content", "detect_document"]

SCHEMA = 2
Plain = Mapping[str, Any]
UNKNOWN = "size not determined"
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
        size = _step(alarm, units)
        what = f"a failure ({size})" if size.startswith(UNKNOWN) else f"a step of {size}"
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
    spans += [
        Span(label=f"alarm of {shortened(alarm['channel'], 20)}", low=alarm["time_s"], high=alarm["time_s"])
        for alarm in alarms
    ]
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
        alarm_heads = ("channel", "fails from", "declared at", "statistic", "threshold", "step, 95 % interval")
        declared = tuple(
            (
                str(alarm["channel"]),
                f"{instant(alarm['onset_s'])} s",
                f"{instant(alarm['time_s'])} s",
                number(alarm["statistic"]),
                number(alarm["threshold"]),
                _step(alarm, units).removeprefix("size "),
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
        data={"candidates.csv": listed, **_files(alarms, series["channels"], model)},
    )


def _step(alarm: Plain, units: Units) -> str:
    """Return the size of a step with its interval, "4.00 m/s (3.95 to 4.05)"; documents of before have no interval.

    A size that may as well be of the other sign is not determined.
    """
    shown = units.of(alarm["unit"], channel=alarm["channel"])
    ends = alarm.get("ci95")
    if alarm["size"] is None:
        return UNKNOWN
    if ends is None:
        return change(alarm["size"], shown)
    low, high = shown.change(ends[0]) or 0.0, shown.change(ends[1]) or 0.0
    if low <= 0.0 <= high:
        if max(-ends[0], ends[1]) > LARGEST_ERROR.get(alarm["channel"], np.inf):
            return UNKNOWN
        return f"{UNKNOWN}, {with_unit(interval((low, high)), shown.unit)}"
    size = number(shown.change(alarm["size"]), spread=0.5 * (high - low), extra=1)
    return f"{with_unit(size, shown.unit)} ({interval((low, high), extra=1)})"


def _files(alarms: Sequence[Plain], channels: Sequence[Plain], model: Plain | None) -> dict[str, dict[str, list[Any]]]:
    """Return the tables of alarms and channels at full precision, in SI."""
    ends = [alarm.get("ci95") or (None, None) for alarm in alarms]
    alarm_keys = ("channel", "onset_s", "time_s", "statistic", "threshold", "size")
    names = [one["channel"] for one in channels]
    listed = {
        "channel": names,
        "unit": [one["unit"] for one in channels],
        "noise_sd": [None if model is None else model["noise_sd"].get(name) for name in names],
        "largest_statistic": [_largest(one["statistic"]) for one in channels],
        "threshold": [one["threshold"] for one in channels],
    }
    declared = {key: [alarm[key] for alarm in alarms] for key in alarm_keys}
    declared |= {"ci95_low": [low for low, _ in ends], "ci95_high": [high for _, high in ends]}
    declared["unit"] = [alarm["unit"] for alarm in alarms]
    return {**({"alarms.csv": declared} if alarms else {}), "channels.csv": listed}


def _largest(statistic: Sequence[float | None]) -> float | None:
    known = [value for value in statistic if value is not None]
    return max(known, default=None)
