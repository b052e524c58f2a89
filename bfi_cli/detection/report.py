"""The JSON document of `bfi detect`, and what a reader is shown of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..notes import Note
from ..printable import shortened
from ..quantities.channels import LARGEST_ERROR, channel_in_words
from ..quantities.text import SI, Units, change, instant, interval, number, with_unit
from ..report.claims import candidate_columns, candidate_tables, hidden_drawing
from ..report.clock import with_clock
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve, shown_notes
from ..report.first_screen import Screen, error_in_words, intervals, screen_of
from ..serialization import Provenance, document_of, from_plain, member, to_plain
from .result import Alarm, ChannelSeries, DetectResult

UNKNOWN = "size not determined"
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
    body = to_plain(result) | {"headline": detect_screen(result).headline}
    body["series"] = {"time_s": body.pop("time_s"), "channels": body["series"]}
    return document_of("detect", body, result.notes, provenance)


def detect_screen(result: DetectResult, units: Units = SI) -> Screen:
    """Return the first screen of a detection, in `units`."""
    failing = [_alarm_in_words(alarm, units) for alarm in result.alarms]
    channel = result.alarms[0].channel if result.alarms else ""
    return screen_of(result, failing, channel, units, commands=result.commands)


def _alarm_in_words(alarm: Alarm, units: Units) -> str:
    """Return what a channel does that fails, from when, and the interval of the step where it is determined."""
    low, high = alarm.ci95 or (np.nan, np.nan)
    known = alarm.size is not None and not low <= 0.0 <= high
    shown = units.of(alarm.unit, channel=alarm.channel)
    effect, size = error_in_words("bias", alarm.channel, alarm.size if known else None, alarm.ci95, shown)
    if not known:
        effect = f"{channel_in_words(alarm.channel)} fails, {UNKNOWN},"
    return f"{effect} from {instant(alarm.onset_s)} s{intervals(size, '')}"


def detect_content(document: Mapping[str, Any], units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi detect` holds, in `units`; its CSV files are in SI.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    time_s, channels = (member(document, f"series.{key}", where=where) for key in ("time_s", "channels"))
    result = from_plain(DetectResult, {**document, "time_s": time_s, "series": channels}, where=where)
    candidates, exact = result.candidates, result.method == "exact"
    screen = detect_screen(result, units)
    tables = [*_alarms(result, units), *candidate_tables(candidates, units), _channels(result, units)]
    hidden = hidden_drawing(candidates, units)
    spans = [] if result.train is None else [Span(label="healthy time", low=result.train[0], high=result.train[1])]
    for alarm in result.alarms:
        spans.append(Span(label=f"alarm of {shortened(alarm.channel, 20)}", low=alarm.time_s, high=alarm.time_s))
    panels = [
        Panel(
            title=series.channel,
            x_label="time [s]",
            y_label="criterion [-]" if exact else "deviate [sd]",
            curves=(curve("", result.time_s, np.maximum(series.statistic, LEAST) if exact else series.statistic),),
            log_y=exact,
            levels=(("threshold", series.threshold),),
            spans=tuple(spans),
        )
        for series in result.series
    ]
    content = ReportContent(
        category="Detection of a failing channel",
        title=result.log.path,
        tone=result.decision,
        lead=len(hidden),
        facts=_facts(result),
        tables=tuple(tables),
        drawings=(*hidden, Drawing(name="detection", caption=CAPTION, panels=tuple(panels), across=2)),
        notes=(*shown_notes(result.notes, units), *(Note.advice(f"next: {command}") for command in result.commands)),
        data={
            "candidates.csv": candidate_columns(candidates),
            **_files(result),
        },
    )
    return with_clock(content.headed(screen), result.log.clock, start_s=result.log.start_s, stop_s=result.log.stop_s)


def _facts(result: DetectResult) -> tuple[tuple[str, str], ...]:
    log, model, use = result.log, result.model, result.calibration
    facts = [
        ("Window", f"{instant(log.start_s)} to {instant(log.stop_s)} s"),
        ("Samples", f"{log.n_samples} at {number(log.rate_hz)} Hz"),
        ("Inputs", ", ".join(result.inputs) or "none"),
        ("False alarms", f"{number(100.0 * result.false_alarm)} % of healthy records wanted"),
        ("Method", METHODS[result.method]),
        ("Ready", "-" if result.ready_s is None else f"{instant(result.ready_s)} s"),
    ]
    if result.train is not None:
        facts.append(("Healthy time", f"{instant(result.train[0])} to {instant(result.train[1])} s"))
    if model is not None:
        past = f"{model.rank} of {model.n_stacked} components of {model.lags} lags"
        facts.append(("Predictor", f"{past}, forgetting {model.forgetting:g}"))
    if use is not None:
        held = f"{instant(use.held_back_s[0])} to {instant(use.held_back_s[1])} s, {use.n_blocks} stretches"
        facts.append(("Calibrated on", f"{held} held back"))
        facts.append(("Level", f"{number(use.level)} (white noise: {number(use.white_level)})"))
    return tuple(facts)


def _alarms(result: DetectResult, units: Units) -> tuple[Table, ...]:
    heads = ("channel", "fails from", "declared at", "statistic", "threshold", "step, 95 % interval")
    rows = tuple(
        (
            alarm.channel,
            f"{instant(alarm.onset_s)} s",
            f"{instant(alarm.time_s)} s",
            number(alarm.statistic),
            number(alarm.threshold),
            _step(alarm, units).removeprefix("size "),
        )
        for alarm in result.alarms
    )
    times_s = tuple((alarm.onset_s,) for alarm in result.alarms)
    table = Table(name="alarms", title="Alarms", heads=heads, rows=rows, times_s=times_s, last_time=1)
    return (table,) if rows else ()


def _channels(result: DetectResult, units: Units) -> Table:
    heads = ("channel", "prediction error", "largest statistic", "threshold")
    rows = tuple(
        (
            shortened(series.channel, 40),
            change(_noise_sd(result, series), units.of(series.unit, channel=series.channel)),
            number(_largest(series)),
            number(series.threshold),
        )
        for series in result.series
    )
    return Table(name="channels", title="Channels watched", heads=heads, rows=rows)


def _step(alarm: Alarm, units: Units) -> str:
    """Return the size of a step with its interval, "4.00 m/s (3.95 to 4.05)"; documents of before have no interval.

    A size that may as well be of the other sign is not determined.
    """
    shown, ends = units.of(alarm.unit, channel=alarm.channel), alarm.ci95
    if alarm.size is None:
        return UNKNOWN
    if ends is None:
        return change(alarm.size, shown)
    low, high = shown.change(ends[0]) or 0.0, shown.change(ends[1]) or 0.0
    if low <= 0.0 <= high:
        if max(-ends[0], ends[1]) > LARGEST_ERROR.get(alarm.channel, np.inf):
            return UNKNOWN
        return f"{UNKNOWN}, {with_unit(interval((low, high)), shown.unit)}"
    size = number(shown.change(alarm.size), spread=0.5 * (high - low), extra=1)
    return f"{with_unit(size, shown.unit)} ({interval((low, high), extra=1)})"


def _files(result: DetectResult) -> dict[str, dict[str, list[Any]]]:
    """Return the tables of alarms and channels at full precision, in SI."""
    alarms, channels = result.alarms, result.series
    keys = ("channel", "onset_s", "time_s", "statistic", "threshold", "size")
    ends = [alarm.ci95 or (None, None) for alarm in alarms]
    declared: dict[str, list[Any]] = {key: [getattr(alarm, key) for alarm in alarms] for key in keys}
    declared |= {"ci95_low": [low for low, _ in ends], "ci95_high": [high for _, high in ends]}
    declared["unit"] = [alarm.unit for alarm in alarms]
    listed: dict[str, list[Any]] = {
        "channel": [series.channel for series in channels],
        "unit": [series.unit for series in channels],
        "noise_sd": [_noise_sd(result, series) for series in channels],
        "largest_statistic": [_largest(series) for series in channels],
        "threshold": [series.threshold for series in channels],
    }
    return {**({"alarms.csv": declared} if alarms else {}), "channels.csv": listed}


def _noise_sd(result: DetectResult, series: ChannelSeries) -> float | None:
    return None if result.model is None else result.model.noise_sd.get(series.channel)


def _largest(series: ChannelSeries) -> float | None:
    known = series.statistic[np.isfinite(series.statistic)]
    return float(known.max()) if known.size else None
