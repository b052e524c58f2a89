"""The JSON document of `bfi start-time`, and what its report holds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...faults import FaultEstimate, fault_from_dict, fault_to_dict, physical
from ...faults.shapes import SHAPES
from ...quantities.text import SI, Units, instant, interval, noise_levels, number, quantity, with_unit
from ...report.claims import candidate_columns, candidate_tables, hidden_drawing
from ...report.clock import with_clock
from ...report.content import Drawing, Panel, ReportContent, Span, Table, curve, shown_notes
from ...report.first_screen import Screen, window_screen
from ...report.proof import proof_tables
from ...serialization import Provenance, document_of, from_plain, member, to_plain
from ..result import fault_columns, fault_entry, half, kind_in_words, meaning, plain_estimate, until
from .result import OnsetResult, ShapeProfile

Plain = Mapping[str, Any]

KEYS = ("shape", "channel", "onset_s", "offset_s", "frequency_hz", "phase_rad", "time_constant_s", "duration_s", "file")
DECISION_KEYS = (
    *("log", "decision", "verdicts", "summary", "plausibility"),
    *("false_alarm", "p_value", "statistic", "threshold", "calibration"),
)
PROFILE_KEYS = ("shape", "channel", "frequency_hz", "threshold", "unit")
FAULT_COLUMNS = (
    *("shape", "channel", "magnitude", "unit", "sd", "ci95_low", "ci95_high", "physical_value", "physical_unit"),
    *("onset_s", "onset_low_s", "onset_high_s", "offset_s", "frequency_hz", "statistic", "p_value"),
)
# A statistic below this is drawn at it: the axis is logarithmic.
LEAST = 0.1
# The axis of magnitudes reaches so far beyond the best one and nine tenths of the others; the rest is cut off.
INSIDE = 1.3
PROFILE_CAPTION = (
    "Left: likelihood-ratio statistic of every shape against its onset, with the threshold at the wanted rate of false "
    "alarms. Right: the magnitude that explains the record best at each onset, with two standard deviations. A stretch "
    "marks the 95 % interval of a declared onset."
)
SERIES_CAPTION = (
    "Measured output and the same less the declared faults. Dotted lines: alarms of the plain 5-sigma test on the "
    "residual of the fault-free model, for comparison."
)


def onset_document(result: OnsetResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi start-time --json`; numbers that are not finite are None.

    `profile` has one entry per shape, and channel where there are several, in each of its lists but `onset_s`.
    """
    profiles, onset_s = result.profiles, [profile.onset_s for profile in result.profiles]
    # Each shape has onsets of its own only where the search for ends made them differ.
    same = all(np.array_equal(times_s, onset_s[0]) for times_s in onset_s)
    body = to_plain(
        {
            **{key: getattr(result, key) for key in DECISION_KEYS},
            "headline": onset_screen(result).headline,
            "faults": [fault_entry(fault, KEYS) for fault in result.faults],
            "candidates": result.candidates,
            "model": result.model,
            "method": result.method,
            "profile": {
                **{key: [getattr(profile, key) for profile in profiles] for key in PROFILE_KEYS},
                "onset_s": onset_s[0] if same else onset_s,
                **{key: [getattr(profile, key) for profile in profiles] for key in ("statistic", "magnitude", "sd")},
            },
            "series": {"time_s": result.time_s, "outputs": result.series},
            "truth": result.truth and [fault_to_dict(fault) for fault in result.truth],
            **({"proved": result.proved} if result.proved else {}),
        }
    )
    return document_of("start-time", body, result.notes, provenance)


def onset_from_document(document: Plain, *, where: str = "result") -> OnsetResult:
    """Return the result a document was made from, the inverse of `onset_document` but for what is not stored.

    Raises
    ------
    ConfigError : it is damaged.
    """
    profile, faults = (member(document, key, where=where) for key in ("profile", "faults"))
    onsets = member(profile, "onset_s", where=f"{where}: profile")
    keys, n = (*PROFILE_KEYS, "statistic", "magnitude", "sd"), len(profile["shape"])
    result = from_plain(
        OnsetResult,
        {
            **document,
            "faults": [plain_estimate(fault, where=f"{where}: faults[{i}]") for i, fault in enumerate(faults)],
            "profiles": [
                {**{key: profile[key][i] for key in keys}, "onset_s": own_s}
                for i, own_s in enumerate(onsets if onsets and isinstance(onsets[0], list) else [onsets] * n)
            ],
            "time_s": member(document, "series.time_s", where=where),
            "series": member(document, "series.outputs", where=where),
            "truth": None,
        },
        where=where,
    )
    truth = member(document, "truth", where=where)
    return replace(result, truth=None if truth is None else tuple(map(fault_from_dict, truth)))


def onset_content(document: Plain, units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi start-time` holds, in `units`; its CSV files are in SI.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    result = onset_from_document(document, where=where)
    candidates, channel_units = result.candidates, result.channel_units
    screen, hidden = onset_screen(result, units), hidden_drawing(candidates, units)
    drawn = []
    for profile in result.profiles:
        shown = units.of(profile.unit, channel=profile.channel, channel_unit=channel_units.get(profile.channel, ""))
        size, sd = shown.changes(profile.magnitude), shown.changes(profile.sd)
        drawn.append(replace(profile, unit=shown.unit, magnitude=size, sd=sd))
    content = ReportContent(
        category="Onset of a fault",
        title=result.log.path,
        tone=result.decision,
        lead=len(hidden),
        facts=tuple(_facts(result, units, channel_units)),
        tables=(
            *_fault_tables(result, units, channel_units),
            *candidate_tables(candidates, units),
            *proof_tables(result.proved, units),
            _shape_table(drawn),
        ),
        drawings=(*hidden, _profile_drawing(drawn, result.faults), _series_drawing(result, units)),
        notes=shown_notes(result.notes, units),
        data=_data(result),
    )
    return with_clock(content.headed(screen), result.log.clock, start_s=result.log.start_s, stop_s=result.log.stop_s)


def onset_screen(result: OnsetResult, units: Units = SI) -> Screen:
    """Return the first screen of a scan over all onsets, in `units`."""
    return window_screen(result, units, channel_units=result.channel_units)


def _data(result: OnsetResult) -> dict[str, dict[str, Any]]:
    """Return the CSV files of faults, candidates and profiles at full precision."""
    profiles = result.profiles
    lengths = [profile.onset_s.size for profile in profiles]
    points: dict[str, Any] = {
        key: np.repeat([getattr(profile, key) for profile in profiles], lengths) for key in ("shape", "channel", "unit")
    }
    shapes: dict[str, Any] = {key: [getattr(profile, key) for profile in profiles] for key in PROFILE_KEYS}
    best = [int(profile.statistic.argmax()) for profile in profiles]
    for key in ("onset_s", "magnitude", "sd", "statistic"):
        shapes[key] = [float(getattr(profile, key)[k]) for profile, k in zip(profiles, best, strict=True)]
    for key in ("onset_s", "statistic", "magnitude", "sd"):
        points[key] = np.concatenate([getattr(profile, key) for profile in profiles])
    return {
        "faults.csv": fault_columns(result.faults, FAULT_COLUMNS),
        "candidates.csv": candidate_columns(result.candidates),
        "shapes.csv": shapes,
        "profile.csv": points,
    }


def _facts(result: OnsetResult, units: Units, channel_units: Mapping[str, str]) -> list[tuple[str, str]]:
    log, model, use = result.log, result.model, result.calibration
    rows = [
        (
            "Window",
            f"{instant(log.start_s)} to {instant(log.stop_s)} s, {log.n_samples} samples at {number(log.rate_hz)} Hz",
        ),
        ("Model", f"VARX of order {model.order}, inputs {', '.join(model.inputs)}"),
        ("Noise", noise_levels(model.noise_sd, units, channel_units)),
    ]
    if use is not None:
        fits = "made for these settings" if use.matches else "made for other settings"
        rows.append(("Calibration", f"{use.source}, {use.n_windows} windows of {number(use.length_s)} s, {fits}"))
        bound = "at most " if result.p_value is not None and result.p_value * (use.n_windows + 1) <= 1.0 else ""
        rows.append(("p-value", bound + number(result.p_value, digits=2)))
    for series in result.series:
        alarms = series.plain_alarms_s
        text = f"{len(alarms)}, first at {instant(min(alarms))} s" if alarms else "none"
        rows.append((f"Plain 5-sigma test, {series.channel}", text))
    for fault in result.truth or ():
        where = f"on {fault.channel} " if fault.channel else ""  # a pressure line is no channel
        size = ""
        if SHAPES[fault.shape].has_magnitude:
            unit_of = channel_units.get(fault.channel, "")
            value, unit = physical(fault, fault.magnitude, unit_of)
            known = units.of(unit, channel=fault.channel, channel_unit=unit_of)
            size = f", magnitude {with_unit(number(value / known.factor), known.unit)}"
        kind = kind_in_words(fault.shape, fault.frequency_hz)
        rows.append(("Injected", f"{kind}{size}, {where}from {instant(fault.onset_s)} s{until(fault)}"))
    return rows


def _fault_tables(result: OnsetResult, units: Units, channel_units: Mapping[str, str]) -> tuple[Table, ...]:
    rows = []
    for estimate in result.faults:
        fault, when = estimate.fault, estimate.onset_ci95 or (math.nan, math.nan)
        scale, shown = meaning(estimate, units, channel_units.get(fault.channel, ""))
        size = (scale * estimate.ci95[0], scale * estimate.ci95[1])
        rows.append(
            (
                kind_in_words(fault.shape, fault.frequency_hz),
                fault.channel,
                f"{number(fault.onset_s, spread=half(when))} s",
                with_unit(interval(when), "s"),
                "-" if fault.offset_s is None else f"{instant(fault.offset_s)} s",
                with_unit(number(scale * estimate.magnitude, spread=half(size), extra=1), shown.unit),
                with_unit(interval(size), shown.unit),
                number(estimate.statistic),
                number(estimate.p_value, digits=2),
            )
        )
    within = "95 % interval"
    heads = ("shape", "channel", "onset", within, "until", "magnitude", within, "statistic", "p-value")
    times_s = tuple((estimate.fault.onset_s, estimate.fault.offset_s) for estimate in result.faults)
    table = Table(name="faults", title="Faults", heads=heads, rows=tuple(rows), times_s=times_s, last_time=4)
    return (table,) if rows else ()


def _shape_table(profiles: Sequence[ShapeProfile]) -> Table:
    rows, times_s = [], []
    for profile in profiles:
        best = int(profile.statistic.argmax())
        onset, size = instant(profile.onset_s[best]), quantity(float(profile.magnitude[best]), profile.unit)
        statistic, threshold = number(float(profile.statistic[best])), number(profile.threshold)
        rows.append(
            (
                kind_in_words(profile.shape, profile.frequency_hz),
                profile.channel,
                f"{onset} s",
                size,
                statistic,
                threshold,
            )
        )
        times_s.append((float(profile.onset_s[best]),))
    heads = ("shape", "channel", "best onset", "magnitude", "statistic", "threshold")
    title = "Every shape at its best onset"
    return Table(name="shapes", title=title, heads=heads, rows=tuple(rows), times_s=tuple(times_s), last_time=2)


def _profile_drawing(profiles: Sequence[ShapeProfile], faults: Sequence[FaultEstimate]) -> Drawing:
    panels: list[Panel] = []
    for profile in profiles:
        spans: list[Span] = []
        for fault in faults:
            if fault.fault.shape == profile.shape:
                low, high = fault.onset_span_s
                spans.append(Span(label="onset", low=low, high=high))
                if fault.fault.offset_s is not None:
                    spans.append(Span(label="end", low=fault.fault.offset_s, high=fault.fault.offset_s))
        onset_s, statistic, z, sd = profile.onset_s, profile.statistic, profile.magnitude, np.nan_to_num(profile.sd)
        reach = INSIDE * max(abs(float(z[statistic.argmax()])), float(np.quantile(np.abs(z), 0.9)))
        panels += [
            Panel(
                title=f"{kind_in_words(profile.shape, profile.frequency_hz)} on {profile.channel}",
                x_label="onset [s]",
                y_label="statistic [-]",
                curves=(curve("", onset_s, np.maximum(statistic, LEAST)),),
                log_y=True,
                levels=() if profile.threshold is None else (("threshold", max(profile.threshold, LEAST)),),
                spans=tuple(spans),
            ),
            Panel(
                x_label="onset [s]",
                y_label=f"magnitude [{profile.unit or '-'}]",
                curves=(curve("", onset_s, z, low=z - 2.0 * sd, high=z + 2.0 * sd),),
                spans=tuple(spans),
                y_limits=(-reach, reach) if reach > 0.0 else None,
            ),
        ]
    return Drawing(name="profile", caption=PROFILE_CAPTION, panels=tuple(panels), across=2)


def _series_drawing(result: OnsetResult, units: Units) -> Drawing:
    panels = []
    for series in result.series:
        shown = units.of(series.unit, channel=series.channel)
        curves = [curve("measured", result.time_s, shown.readings(series.measured))]
        if any(fault.fault.channel == series.channel for fault in result.faults):
            curves.append(curve("corrected", result.time_s, shown.readings(series.corrected), style="dashed"))
        panels.append(
            Panel(
                x_label="time [s]",
                y_label=f"{series.channel} [{shown.unit or '-'}]",
                curves=tuple(curves),
                spans=tuple(Span(label="plain 5-sigma test", low=t, high=t) for t in series.plain_alarms_s),
            )
        )
    return Drawing(name="outputs", caption=SERIES_CAPTION, panels=tuple(panels))
