"""What a reader is shown of a scan, made from its JSON document alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..exhibit import Curve, Drawing, Exhibit, Panel, Span, Table, curve
from ..wording import instant, interval, number, quantity, shortened

__all__ = ["onset_exhibit"]

FloatArray = NDArray[np.float64]
Plain = Mapping[str, Any]

LEAST = 0.1
INSIDE = 1.3
WORDS = {"lagged_bias": "lagged bias", "ramp_hold": "ramp and hold", "samples": "sampled shape"}
HEADINGS = {"fault": "Fault found", "no_fault": "No fault found", "not_identifiable": "Not identifiable"}
PROFILE_CAPTION = (
    "Left: likelihood-ratio statistic of every shape against its onset, with the threshold at the wanted rate of false "
    "alarms. Right: the magnitude that explains the record best at each onset, with two standard deviations. A stretch "
    "marks the 95 % interval of a declared onset."
)
SERIES_CAPTION = (
    "Measured output and the same less the declared faults. Dotted lines: alarms of the plain 5-sigma test on the "
    "residual of the fault-free model, for comparison."
)


def onset_exhibit(document: Plain) -> Exhibit:
    """Return the exhibit of a document of `bfi start-time`."""
    return Exhibit(
        kicker="Onset of a fault",
        title=str(document["log"]["path"]),
        heading=HEADINGS[document["decision"]],
        verdict=_verdict(document),
        tone=document["decision"],
        facts=tuple(_facts(document)),
        tables=(*_faults(document["faults"]), _shapes(document["profile"])),
        drawings=(_profiles(document), _series(document)),
        notes=tuple(document["notes"]),
    )


def _verdict(document: Plain) -> str:
    faults = [_described(fault) for fault in document["faults"]]
    if not faults:
        return f"No fault stands out at a false-alarm rate of {number(100.0 * document['false_alarm'])} %."
    return f"Fault: {faults[0]}." if len(faults) == 1 else f"{len(faults)} faults: {'; '.join(faults)}."


def _described(fault: Plain) -> str:
    """Return "a bias of 4.00 m/s (95 % interval 3.99 to 4.01) on tas from 13.80 s (13.79 to 13.81 s)"."""
    low, high = _ends(fault["ci95"])
    value, unit = number(fault["magnitude"], spread=0.5 * (high - low)), fault["unit"]
    within = interval((low, high))
    size = f"{value} {unit}".rstrip() + (f" (95 % interval {within})" if within != "-" else "")
    until = "" if fault["offset_s"] is None else f" to {instant(fault['offset_s'])} s"
    first, last = _ends(fault["onset_ci95"])
    onset = number(fault["onset_s"], spread=0.5 * (last - first))
    when = f"from {onset} s ({interval((first, last))} s){until}"
    return f"a {_shape(fault['shape'], fault['frequency_hz'])} of {size} on {shortened(fault['channel'], 40)} {when}"


def _ends(ends: Sequence[float | None]) -> tuple[float, float]:
    low, high = (math.nan if end is None else float(end) for end in ends)
    return low, high


def _shape(shape: str, frequency_hz: float | None) -> str:
    word = WORDS.get(shape, shape)
    return word if frequency_hz is None else f"{number(frequency_hz)} Hz {word}"


def _facts(document: Plain) -> list[tuple[str, str]]:
    log, model, use = document["log"], document["model"], document["calibration"]
    window = f"{number(log['start_s'])} to {number(log['stop_s'])} s"
    noise = (f"{name} {number(sd, digits=2)}" for name, sd in model["noise_sd"].items())
    rows = [
        ("Window", f"{window}, {log['n_samples']} samples at {number(log['rate_hz'])} Hz"),
        ("Model", f"VARX of order {model['order']}, inputs {', '.join(model['inputs'])}"),
        ("Noise", ", ".join(noise)),
    ]
    if use is not None:
        fits = "made for these settings" if use["matches"] else "made for other settings"
        rows.append(("Calibration", f"{use['source']}, {use['n_windows']} windows, {fits}"))
        rows.append(("p-value", number(document["p_value"], digits=2)))
    for series in document["series"]["outputs"]:
        alarms = series["plain_alarms_s"]
        told = f"{len(alarms)}, first at {number(min(alarms), digits=6)} s" if alarms else "none"
        rows.append((f"Plain 5-sigma test, {series['channel']}", told))
    rows += [("Injected", _injected(fault)) for fault in document["truth"] or ()]
    return rows


def _injected(fault: Plain) -> str:
    until = "" if fault["offset_s"] is None else f" to {instant(fault['offset_s'])} s"
    shape = _shape(fault["shape"], fault.get("frequency_hz"))
    return f"{shape}, magnitude {fault['magnitude']:g}, on {fault['channel']} from {instant(fault['onset_s'])} s{until}"


def _faults(faults: Sequence[Plain]) -> tuple[Table, ...]:
    if not faults:
        return ()
    heads = (
        "shape",
        "channel",
        "onset",
        "95 % interval",
        "until",
        "magnitude",
        "95 % interval",
        "statistic",
        "p-value",
    )
    return (Table(name="faults", title="Faults", heads=heads, rows=tuple(map(_fault_row, faults))),)


def _fault_row(fault: Plain) -> tuple[str, ...]:
    when, size = _ends(fault["onset_ci95"]), _ends(fault["ci95"])
    return (
        _shape(fault["shape"], fault["frequency_hz"]),
        fault["channel"],
        f"{number(fault['onset_s'], spread=0.5 * (when[1] - when[0]))} s",
        interval(when),
        "-" if fault["offset_s"] is None else f"{instant(fault['offset_s'])} s",
        f"{number(fault['magnitude'], spread=0.5 * (size[1] - size[0]), extra=1)} {fault['unit']}".rstrip(),
        interval(size),
        number(fault["statistic"]),
        number(fault["p_value"], digits=2),
    )


def _each(profile: Plain) -> list[dict[str, Any]]:
    """Return the profiles one by one, with arrays."""
    n = len(profile["shape"])
    onsets = profile["onset_s"]
    own = bool(onsets) and isinstance(onsets[0], list)
    lists = ("shape", "channel", "frequency_hz", "threshold", "unit")
    found = []
    for i in range(n):
        arrays = {key: np.array(profile[key][i], dtype=np.float64) for key in ("statistic", "magnitude", "sd")}
        when = np.array(onsets[i] if own else onsets, dtype=np.float64)
        found.append({**{key: profile[key][i] for key in lists}, **arrays, "onset_s": when})
    return found


def _shapes(profile: Plain) -> Table:
    rows = []
    for one in _each(profile):
        best = int(one["statistic"].argmax())
        rows.append(
            (
                _shape(one["shape"], one["frequency_hz"]),
                str(one["channel"]),
                f"{instant(one['onset_s'][best])} s",
                quantity(float(one["magnitude"][best]), one["unit"]),
                number(float(one["statistic"][best])),
                number(one["threshold"]),
            )
        )
    heads = ("shape", "channel", "best onset", "magnitude", "statistic", "threshold")
    return Table(name="shapes", title="Every shape at its best onset", heads=heads, rows=tuple(rows))


def _profiles(document: Plain) -> Drawing:
    panels: list[Panel] = []
    for one in _each(document["profile"]):
        spans = tuple(_spans([fault for fault in document["faults"] if fault["shape"] == one["shape"]]))
        title = f"{_shape(one['shape'], one['frequency_hz'])} on {one['channel']}"
        levels = () if one["threshold"] is None else (("threshold", max(one["threshold"], LEAST)),)
        panels.append(
            Panel(
                title=title,
                x_label="onset [s]",
                y_label="statistic [-]",
                curves=(curve("", one["onset_s"], np.maximum(one["statistic"], LEAST)),),
                log_y=True,
                levels=levels,
                spans=spans,
            )
        )
        panels.append(_magnitude(one, spans))
    return Drawing(name="profile", caption=PROFILE_CAPTION, panels=tuple(panels), across=2)


def _magnitude(one: Mapping[str, Any], spans: tuple[Span, ...]) -> Panel:
    z, sd = one["magnitude"], np.nan_to_num(one["sd"])
    reach = INSIDE * max(abs(float(z[one["statistic"].argmax()])), float(np.quantile(np.abs(z), 0.9)))
    return Panel(
        x_label="onset [s]",
        y_label=f"magnitude [{one['unit'] or '-'}]",
        curves=(curve("", one["onset_s"], z, low=z - 2.0 * sd, high=z + 2.0 * sd),),
        spans=spans,
        y_limits=(-reach, reach) if reach > 0.0 else None,
    )


def _spans(faults: Sequence[Plain]) -> list[Span]:
    found = []
    for fault in faults:
        low, high = _ends(fault["onset_ci95"])
        found.append(Span(label="onset", low=low, high=high))
        if fault["offset_s"] is not None:
            found.append(Span(label="end", low=fault["offset_s"], high=fault["offset_s"]))
    return found


def _series(document: Plain) -> Drawing:
    time_s = document["series"]["time_s"]
    return Drawing(
        name="outputs",
        caption=SERIES_CAPTION,
        panels=tuple(_output(time_s, one, document["faults"]) for one in document["series"]["outputs"]),
    )


def _output(time_s: Sequence[float], one: Plain, faults: Sequence[Plain]) -> Panel:
    curves: tuple[Curve, ...] = (curve("measured", time_s, one["measured"]),)
    spans = [Span(label="plain 5-sigma test", low=t, high=t) for t in one["plain_alarms_s"]]
    if any(fault["channel"] == one["channel"] for fault in faults):
        curves += (curve("corrected", time_s, one["corrected"], style="dashed"),)
    return Panel(
        x_label="time [s]", y_label=f"{one['channel']} [{one['unit'] or '-'}]", curves=curves, spans=tuple(spans)
    )
