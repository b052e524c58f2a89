"""The JSON document of `bfi start-time`, and what its report holds, made from the document alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..decision import Candidate
from ..display_units import SI, Units
from ..faults import fault_from_dict, fault_to_dict, physical
from ..notes import unique
from ..printable import shortened
from ..provenance import Provenance
from ..report.claims import (
    CANDIDATE_COLUMNS,
    candidate_tables,
    hidden_drawing,
    screen_of,
    shown_summary,
    verdict_sentence,
)
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve, notes_of
from ..report.text import HEADINGS, change, instant, interval, number, quantity, with_unit
from ..serialization import SCHEMA, from_plain, to_plain
from ..shapes import SHAPES
from .result import OnsetResult

__all__ = ["onset_content", "onset_document"]

FloatArray = NDArray[np.float64]
Plain = Mapping[str, Any]

KEYS = ("shape", "channel", "onset_s", "offset_s", "frequency_hz", "phase_rad", "time_constant_s", "duration_s", "file")
ESTIMATE_KEYS = ("statistic", "p_value", "effect", "beyond_tolerance", "among", "source", "evidence")
DECISION_KEYS = (
    "log",
    "decision",
    "verdicts",
    "summary",
    "plausibility",
    "false_alarm",
    "p_value",
    "statistic",
    "threshold",
    "calibration",
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
    same = all(np.array_equal(own, onset_s[0]) for own in onset_s)
    document: dict[str, Any] = to_plain(
        {
            "kind": "start-time",
            "schema": SCHEMA,
            **{key: getattr(result, key) for key in DECISION_KEYS},
            "faults": [
                {
                    **{key: getattr(fault.fault, key) for key in KEYS},
                    "phase_rad": fault.fault.phase_rad if fault.fault.shape == "sine" else None,
                    **{key: getattr(fault, key) for key in ("name", "magnitude", "unit")},
                    "physical": {"value": fault.physical_value, "unit": fault.physical_unit},
                    "sd": fault.sd,
                    "ci95": _known(fault.ci95),
                    "onset_ci95": None if fault.onset_ci95 is None else _known(fault.onset_ci95),
                    **{key: getattr(fault, key) for key in ESTIMATE_KEYS},
                }
                for fault in result.faults
            ],
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
            "notes": unique(result.notes),
            "provenance": provenance,
        }
    )
    return document


def _known(ends: tuple[float, float]) -> tuple[float, float] | None:
    """Return an interval, None where its ends are not numbers."""
    return ends if math.isfinite(ends[0] + ends[1]) else None


def onset_content(document: Plain, units: Units = SI) -> ReportContent:
    """Return what the report of a document of `bfi start-time` holds, in `units`; its CSV files are in SI."""
    faults, series = document["faults"], document["series"]
    candidates = from_plain(tuple[Candidate, ...], document["candidates"], where="candidates")
    own = {one["channel"]: one["unit"] for one in series["outputs"]}
    shown = [_in_units(fault, units, own) for fault in faults]
    said = list(map(_sentence, shown))
    summary = shown_summary(document["summary"], document["verdicts"], candidates, units)
    shapes, hidden = _profiles(document["profile"]), hidden_drawing(candidates, units)
    drawn = [_profile_in_units(one, units, own) for one in shapes]
    return ReportContent(
        category="Onset of a fault",
        title=str(document["log"]["path"]),
        heading=HEADINGS[document["decision"]],
        verdict=verdict_sentence(document["decision"], said, summary),
        tone=document["decision"],
        screen=screen_of(document["decision"], said, summary, candidates, units),
        lead=len(hidden),
        facts=tuple(_facts(document, units, own)),
        tables=(*_fault_tables(shown), *candidate_tables(candidates, units), _shape_table(drawn)),
        drawings=(
            *hidden,
            _profile_drawing(drawn, faults),
            _series_drawing(series, faults, units),
        ),
        notes=notes_of(document, units),
        data=_data(faults, candidates, shapes),
    )


def _in_units(fault: Plain, units: Units, own: Mapping[str, str]) -> dict[str, Any]:
    """Return a fault with its magnitude and interval in the unit that is shown."""
    shown = units.of(fault["unit"], channel=fault["channel"], own=own.get(fault["channel"], ""))
    ends = None if fault["ci95"] is None else [shown.change(end) for end in fault["ci95"]]
    return {**fault, "magnitude": shown.change(fault["magnitude"]), "ci95": ends, "unit": shown.unit}


def _profile_in_units(profile: Plain, units: Units, own: Mapping[str, str]) -> dict[str, Any]:
    """Return a profile with its magnitudes in the unit that is shown."""
    shown = units.of(profile["unit"], channel=profile["channel"], own=own.get(profile["channel"], ""))
    changed = {key: shown.changes(profile[key]) for key in ("magnitude", "sd")}
    return {**profile, **changed, "unit": shown.unit}


def _data(
    faults: Sequence[Plain], candidates: Sequence[Candidate], profiles: Sequence[Plain]
) -> dict[str, dict[str, Any]]:
    """Return the CSV files of faults, candidates and profiles at full precision."""
    flat = []
    for fault in faults:
        ends = dict(zip(("ci95_low", "ci95_high"), fault["ci95"] or (None, None), strict=True))
        ends |= dict(zip(("onset_low_s", "onset_high_s"), fault["onset_ci95"] or (None, None), strict=True))
        physical = {f"physical_{key}": value for key, value in fault["physical"].items()}
        flat.append({**fault, **ends, **physical})
    columns = {key: [fault[key] for fault in flat] for key in FAULT_COLUMNS}
    lengths = [one["onset_s"].size for one in profiles]
    points = {key: np.repeat([one[key] for one in profiles], lengths) for key in ("shape", "channel", "unit")}
    values = {
        key: np.concatenate([one[key] for one in profiles]) for key in ("onset_s", "statistic", "magnitude", "sd")
    }
    listed = {key: [getattr(one, key) for one in candidates] for key in CANDIDATE_COLUMNS}
    best = [int(one["statistic"].argmax()) for one in profiles]
    shapes: dict[str, list[Any]] = {
        key: [one[key] for one in profiles] for key in ("shape", "channel", "frequency_hz", "threshold", "unit")
    }
    for key in ("onset_s", "magnitude", "sd", "statistic"):
        shapes[key] = [float(one[key][k]) for one, k in zip(profiles, best, strict=True)]
    return {
        "faults.csv": columns,
        "candidates.csv": listed,
        "shapes.csv": shapes,
        "profile.csv": {**points, **values},
    }


def _sentence(fault: Plain) -> str:
    """Return "a bias of 4.00 m/s (95 % interval 3.99 to 4.01) on tas from 13.80 s (13.79 to 13.81 s)"."""
    size, when = _ends(fault["ci95"]), _ends(fault["onset_ci95"])
    magnitude = with_unit(number(fault["magnitude"], spread=_half(size)), fault["unit"])
    within = interval(size)
    if within != "-":
        magnitude += f" (95 % interval {within})"
    between = "" if interval(when) == "-" else f" ({interval(when)} s)"
    onset = f"from {number(fault['onset_s'], spread=_half(when))} s{between}{_until(fault)}"
    return f"a {_shape(fault)} of {magnitude} on {shortened(fault['channel'], 40)} {onset}"


def _ends(ends: Sequence[float | None] | None) -> tuple[float, float]:
    low, high = (math.nan if end is None else float(end) for end in ends or (None, None))
    return low, high


def _half(ends: tuple[float, float]) -> float:
    return 0.5 * (ends[1] - ends[0])


def _until(fault: Plain) -> str:
    return "" if fault["offset_s"] is None else f" to {instant(fault['offset_s'])} s"


def _shape(fault: Plain) -> str:
    frequency_hz, word = fault.get("frequency_hz"), SHAPES[fault["shape"]].label
    return word if frequency_hz is None else f"{number(frequency_hz)} Hz {word}"


def _facts(document: Plain, units: Units, own: Mapping[str, str]) -> list[tuple[str, str]]:
    log, model, use = document["log"], document["model"], document["calibration"]
    window = f"{number(log['start_s'])} to {number(log['stop_s'])} s"
    noise = (
        f"{name} {change(sd, units.of(own.get(name, ''), channel=name))}" for name, sd in model["noise_sd"].items()
    )
    rows = [
        ("Window", f"{window}, {log['n_samples']} samples at {number(log['rate_hz'])} Hz"),
        ("Model", f"VARX of order {model['order']}, inputs {', '.join(model['inputs'])}"),
        ("Noise", ", ".join(noise)),
    ]
    if use is not None:
        fits = "made for these settings" if use["matches"] else "made for other settings"
        windows = f"{use['n_windows']} windows of {number(use['length_s'])} s"
        rows.append(("Calibration", f"{use['source']}, {windows}, {fits}"))
        p_value = document["p_value"]
        bound = "at most " if p_value is not None and p_value * (use["n_windows"] + 1) <= 1.0 else ""
        rows.append(("p-value", bound + number(p_value, digits=2)))
    for series in document["series"]["outputs"]:
        alarms = series["plain_alarms_s"]
        told = f"{len(alarms)}, first at {number(min(alarms), digits=6)} s" if alarms else "none"
        rows.append((f"Plain 5-sigma test, {series['channel']}", told))
    for fault in document["truth"] or ():
        where = f"on {fault['channel']} " if fault["channel"] else ""  # a pressure line is no channel
        size = ""
        if fault["magnitude"] is not None:
            channel = fault["channel"] or ""
            value, unit = physical(fault_from_dict(fault), fault["magnitude"], own.get(channel, ""))
            known = units.of(unit, channel=channel, own=own.get(channel, ""))
            size = f", magnitude {with_unit(number(value / known.factor), known.unit)}"
        when = f"from {instant(fault['onset_s'])} s{_until(fault)}"
        rows.append(("Injected", f"{_shape(fault)}{size}, {where}{when}"))
    return rows


def _fault_tables(faults: Sequence[Plain]) -> tuple[Table, ...]:
    rows = []
    for fault in faults:
        when, size = _ends(fault["onset_ci95"]), _ends(fault["ci95"])
        rows.append(
            (
                _shape(fault),
                fault["channel"],
                f"{number(fault['onset_s'], spread=_half(when))} s",
                with_unit(interval(when), "s"),
                "-" if fault["offset_s"] is None else f"{instant(fault['offset_s'])} s",
                with_unit(number(fault["magnitude"], spread=_half(size), extra=1), fault["unit"]),
                with_unit(interval(size), fault["unit"]),
                number(fault["statistic"]),
                number(fault["p_value"], digits=2),
            )
        )
    within = "95 % interval"
    heads = ("shape", "channel", "onset", within, "until", "magnitude", within, "statistic", "p-value")
    return (Table(name="faults", title="Faults", heads=heads, rows=tuple(rows)),) if rows else ()


def _profiles(profile: Plain) -> list[dict[str, Any]]:
    """Return the profiles one by one, with arrays."""
    onsets = profile["onset_s"]
    own = bool(onsets) and isinstance(onsets[0], list)
    return [
        {
            **{key: profile[key][i] for key in ("shape", "channel", "frequency_hz", "threshold", "unit")},
            **{key: np.array(profile[key][i], dtype=np.float64) for key in ("statistic", "magnitude", "sd")},
            "onset_s": np.array(onsets[i] if own else onsets, dtype=np.float64),
        }
        for i in range(len(profile["shape"]))
    ]


def _shape_table(profiles: Sequence[Plain]) -> Table:
    rows = []
    for one in profiles:
        best = int(one["statistic"].argmax())
        onset, size = instant(one["onset_s"][best]), quantity(float(one["magnitude"][best]), one["unit"])
        statistic, threshold = number(float(one["statistic"][best])), number(one["threshold"])
        rows.append((_shape(one), str(one["channel"]), f"{onset} s", size, statistic, threshold))
    heads = ("shape", "channel", "best onset", "magnitude", "statistic", "threshold")
    return Table(name="shapes", title="Every shape at its best onset", heads=heads, rows=tuple(rows))


def _profile_drawing(profiles: Sequence[Plain], faults: Sequence[Plain]) -> Drawing:
    panels: list[Panel] = []
    for one in profiles:
        spans: list[Span] = []
        for fault in faults:
            if fault["shape"] == one["shape"]:
                low, high = _ends(fault["onset_ci95"] or (fault["onset_s"], fault["onset_s"]))
                spans.append(Span(label="onset", low=low, high=high))
                if fault["offset_s"] is not None:
                    spans.append(Span(label="end", low=fault["offset_s"], high=fault["offset_s"]))
        onset_s, statistic, z, sd = one["onset_s"], one["statistic"], one["magnitude"], np.nan_to_num(one["sd"])
        reach = INSIDE * max(abs(float(z[statistic.argmax()])), float(np.quantile(np.abs(z), 0.9)))
        panels += [
            Panel(
                title=f"{_shape(one)} on {one['channel']}",
                x_label="onset [s]",
                y_label="statistic [-]",
                curves=(curve("", onset_s, np.maximum(statistic, LEAST)),),
                log_y=True,
                levels=() if one["threshold"] is None else (("threshold", max(one["threshold"], LEAST)),),
                spans=tuple(spans),
            ),
            Panel(
                x_label="onset [s]",
                y_label=f"magnitude [{one['unit'] or '-'}]",
                curves=(curve("", onset_s, z, low=z - 2.0 * sd, high=z + 2.0 * sd),),
                spans=tuple(spans),
                y_limits=(-reach, reach) if reach > 0.0 else None,
            ),
        ]
    return Drawing(name="profile", caption=PROFILE_CAPTION, panels=tuple(panels), across=2)


def _series_drawing(series: Plain, faults: Sequence[Plain], units: Units) -> Drawing:
    panels = []
    for one in series["outputs"]:
        shown = units.of(one["unit"], channel=one["channel"])
        curves = [curve("measured", series["time_s"], shown.readings(one["measured"]))]
        if any(fault["channel"] == one["channel"] for fault in faults):
            curves.append(curve("corrected", series["time_s"], shown.readings(one["corrected"]), style="dashed"))
        panels.append(
            Panel(
                x_label="time [s]",
                y_label=f"{one['channel']} [{shown.unit or '-'}]",
                curves=tuple(curves),
                spans=tuple(Span(label="plain 5-sigma test", low=t, high=t) for t in one["plain_alarms_s"]),
            )
        )
    return Drawing(name="outputs", caption=SERIES_CAPTION, panels=tuple(panels))
