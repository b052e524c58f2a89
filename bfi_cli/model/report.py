"""What the report of an identification holds, made from its result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..decision import Candidate
from ..kernels import TWO_SIDED_95, FloatArray
from ..methods import METHODS
from ..printable import shortened
from ..quantities.text import SI, Units, axis_label, change, counted, instant, interval, number, quantity, with_unit
from ..report.claims import (
    candidate_columns,
    candidate_tables,
    hidden_drawing,
    shown_meaning,
)
from ..report.clock import with_clock
from ..report.content import (
    AT_ONCE,
    Curve,
    Drawing,
    Panel,
    ReportContent,
    Span,
    Style,
    Table,
    curve,
    shown_notes,
    thinned,
)
from ..report.first_screen import Screen, window_screen
from ..report.proof import proof_tables
from .result import (
    DERIVED,
    IdentifyResult,
    OutputSeries,
    ResidualSummary,
    fault_columns,
    identify_from_document,
    meaning,
)

# Entries of the dictionary that the figure of the magnitudes has room for.
MAX_CANDIDATES = 30
# Below this p-value of the Ljung-Box test the residual is called not white: the usual level of 1 %.
WHITE_ABOVE = 0.01
# The criterion is drawn linearly up to this difference, which is decisive evidence by any of the criteria.
LINEAR_CRITERION = 10.0
NAME_LETTERS = 40  # in a table
FAULT_COLUMNS = (
    *("name", "shape", "channel", "magnitude", "unit", "sd", "ci95_low", "ci95_high", "physical_value"),
    *("physical_unit", "onset_s", "offset_s", "frequency_hz"),
)
FAULT_HEADS = ("fault", "channel", "from", "magnitude", "95 % interval", "until", "shape", "sd", "multiplier")
RESIDUAL_HEADS = ("output", "noise sd", "VAF", "whiteness", "5 σ without faults", "samples beyond 5 σ")
READINGS = ("measured", *DERIVED)
CHANGES = ("fault", "fault_sd", "prediction_error", "plain_residual", "true_fault")
SERIES = (*READINGS, *CHANGES)
MAGNITUDE_CAPTION = (
    "Magnitude of every dictionary entry with its 95 % interval, in units of its minimal detectable magnitude (90 % "
    "power). Filled circles are declared; open ones show what the entry would be if it were added. Inside the grey "
    "strip nothing is detected reliably. Linear up to 1, logarithmic beyond. To the right: the magnitude ± half its "
    "95 % interval, and the minimal detectable magnitude."
)
RESIDUAL_CAPTION = (
    "Prediction error of the fault-free model (dashed: ±5 robust standard deviations, with the samples beyond them) "
    "and of the final one, and the autocorrelation of the latter with the 95 % band of white noise. The plain 5-sigma "
    "test sees steps, names no shape and misses drifts. An axis that is far outside is logarithmic beyond ±5 σ."
)


def identify_content(result: IdentifyResult, units: Units = SI) -> ReportContent:
    """Return what the report of an identification holds, in `units`; its CSV files are in SI."""
    hidden, drawn = hidden_drawing(result.candidates, units), _in_units(result, units)
    screen = identify_screen(result, units)
    content = ReportContent(
        category="Fault identification",
        title=result.log.path,
        tone=result.decision,
        lead=len(hidden),
        facts=_facts(result, units),
        tables=tuple(_tables(result, units)),
        drawings=(
            *hidden,
            _draw_outputs(drawn),
            _draw_fault(drawn),
            # Without a limit there is nothing to hold a magnitude against.
            *(
                [_draw_magnitudes(result, units)]
                if any(_ratio(candidate) is not None for candidate in result.candidates)
                else []
            ),
            _draw_residuals(drawn),
            *_draw_orders(result),
        ),
        notes=shown_notes(result.notes, units),
        data=_data(result),
    )
    return with_clock(content.headed(screen), result.log.clock, start_s=result.log.start_s, stop_s=result.log.stop_s)


def identify_screen(result: IdentifyResult, units: Units = SI) -> Screen:
    """Return the first screen of an identification, in `units`."""
    return window_screen(result, units, channel_units=result.channel_units, named=True)


def content_of_document(document: object, units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi identify` holds; see `identify_from_document`."""
    result, _ = identify_from_document(document, where=where)
    return identify_content(result, units)


def _in_units(result: IdentifyResult, units: Units) -> IdentifyResult:
    """Return the result with its signals, and what its figures say of them, in the units that are shown."""
    shown = {output.channel: units.of(output.unit, channel=output.channel) for output in result.outputs}
    outputs = []
    for output in result.outputs:
        here = shown[output.channel]
        signals: dict[str, Any] = {"measured": here.readings(output.measured)}
        known = {key: values for key in CHANGES if (values := getattr(output, key)) is not None}
        signals |= {key: here.changes(values) for key, values in known.items()}
        outputs.append(replace(output, unit=here.unit, **signals))
    inputs = {name: units.of(result.input_units.get(name, ""), channel=name) for name in result.inputs}
    return replace(
        result,
        outputs=tuple(outputs),
        inputs={name: inputs[name].readings(values) for name, values in result.inputs.items()},
        input_units={name: display.unit for name, display in inputs.items()},
        residuals=tuple(
            replace(residual, plain_sd=residual.plain_sd / shown[residual.channel].factor)
            if residual.channel in shown
            else residual
            for residual in result.residuals
        ),
    )


def shown_candidates(result: IdentifyResult) -> tuple[Candidate, ...]:
    """Return the dictionary entries the figure has room for, in the order of the dictionary.

    Those of a larger dictionary are the declared ones and those with the largest magnitude for their limit.
    """
    ranked = sorted(
        result.candidates, key=lambda candidate: (candidate.state != "declared", -abs(_ratio(candidate) or 0.0))
    )
    kept = {id(candidate) for candidate in ranked[:MAX_CANDIDATES]}
    return tuple(candidate for candidate in result.candidates if id(candidate) in kept)


def _ratio(candidate: Candidate) -> float | None:
    """Return the magnitude in units of the minimal detectable one, None where one of them is not known."""
    limit = _smallest(candidate)
    if candidate.magnitude is None or limit is None or not limit > 0.0:
        return None
    ratio = candidate.magnitude / limit
    return ratio if math.isfinite(ratio) else None


def _smallest(candidate: Candidate) -> float | None:
    """Return the minimal detectable magnitude, without a dictionary that of the scan."""
    limit = candidate.minimal_detectable
    return candidate.minimal_detectable_scan if limit is None else limit


def _facts(result: IdentifyResult, units: Units) -> tuple[tuple[str, str], ...]:
    log, model, solver = result.log, result.model, result.solver
    span = f"{instant(log.start_s)} to {instant(log.stop_s)} s ({number(log.stop_s - log.start_s)} s"
    return (
        ("Window", f"{span}, {log.n_samples} samples)"),
        ("Rate", f"{number(log.rate_hz)} Hz (recorded at {number(log.native_rate_hz)} Hz)"),
        ("Inputs", ", ".join(model.inputs) or "none"),
        ("Outputs", ", ".join(model.outputs)),
        ("Looked for", f"{len(result.candidates)} candidates, {len(result.faults)} declared"),
        ("Scan of all onsets", units.sentence(result.scan.note)),
        ("Model", f"VARX of order {model.order} at {number(model.rate_hz)} Hz"),
        ("Inputs act", "in the same sample too" if model.feedthrough else "from the next sample on"),
        ("Orders tried", ", ".join(map(str, model.orders)) or "this one only"),
        ("Method", METHODS[solver.method].summary if solver.method in METHODS else solver.method),
        ("Termination", f"{solver.termination} ({counted(solver.iterations, 'iteration')})"),
        ("Condition number", number(solver.condition_number, digits=3)),
    )


def _tables(result: IdentifyResult, units: Units) -> Iterator[Table]:
    faults, channel_units = [], result.channel_units
    for estimate in result.faults:
        fault = estimate.fault
        scale, shown = meaning(estimate, units, channel_units.get(fault.channel, ""))
        sd, ends = abs(scale) * estimate.sd, sorted(scale * bound for bound in estimate.ci95)
        multiplier = number(estimate.magnitude, spread=TWO_SIDED_95 * estimate.sd, extra=1)
        faults.append(
            (
                shortened(estimate.name, NAME_LETTERS),
                fault.channel,
                f"{instant(fault.onset_s)} s",
                with_unit(number(scale * estimate.magnitude, spread=TWO_SIDED_95 * sd, extra=1), shown.unit),
                with_unit(interval(ends, extra=1), shown.unit),
                "-" if fault.offset_s is None else f"{instant(fault.offset_s)} s",
                fault.shape if fault.frequency_hz is None else f"{fault.shape}, {fault.frequency_hz:.4g} Hz",
                quantity(sd, shown.unit),
                # Multiplier of the slope that the dictionary states, else the magnitude itself.
                "-" if fault.slope is None else f"{multiplier} x slope {fault.slope:g}/s",
            )
        )
    if faults:
        n = len(FAULT_HEADS) - all(estimate.fault.slope is None for estimate in result.faults)
        rows = tuple(row[:n] for row in faults)
        times_s = tuple((estimate.fault.onset_s, estimate.fault.offset_s) for estimate in result.faults)
        last = FAULT_HEADS.index("from")
        yield Table(name="faults", title="Faults", heads=FAULT_HEADS[:n], rows=rows, times_s=times_s, last_time=last)
    yield from candidate_tables(result.candidates, units)
    yield from proof_tables(result.proved, units)
    residuals = []
    for summary in result.residuals:
        shown = units.of(channel_units.get(summary.channel, ""), channel=summary.channel)
        alarms_s, p = summary.plain_alarms_s, summary.ljung_box_p
        white = "" if p >= WHITE_ABOVE else ", not white: structure is left"
        residuals.append(
            (
                summary.channel,
                change(result.model.noise_sd.get(summary.channel), shown),
                f"{number(result.vaf_output.get(summary.channel))} %",
                f"p = {number(p, digits=2)}{white}" if p == p else "-",
                change(5.0 * summary.plain_sd, shown),
                f"{len(alarms_s)}, first at {instant(min(alarms_s))} s" if alarms_s else "none",
            )
        )
    if residuals:
        title = "Residuals of the final model, and the plain 5-sigma test on those of the fault-free model"
        yield Table(name="residuals", title=title, heads=RESIDUAL_HEADS, rows=tuple(residuals))
    if result.truth is not None:
        truth, error = result.truth, result.truth.magnitude_error
        vaf = ((f"VAF of the fault on {name}", value) for name, value in truth.vaf_fault.items())
        rows = (
            ("Isolation", "exactly the injected faults" if truth.isolated else "not the injected faults"),
            ("False alarms", ", ".join(truth.false_alarms) or "none"),
            ("Missed", ", ".join(truth.missed) or "none"),
            ("Relative magnitude error", "-" if error is None else quantity(100.0 * error, "%")),
            *((name, "-" if value is None else f"{number(value, digits=5)} %") for name, value in vaf),
        )
        yield Table(name="truth", title="Against the injected truth", heads=("measure", "value"), rows=rows)


def _line(label: str, result: IdentifyResult, values: FloatArray, style: Style = "line", sd: Any = None) -> Curve:
    """Return a signal over time, thinned to what the paper shows; with the 95 % band of its standard deviation."""
    kept = thinned(values)
    y = values[kept]
    low, high = (None, None) if sd is None else (y - TWO_SIDED_95 * sd[kept], y + TWO_SIDED_95 * sd[kept])
    return curve(label, result.time_s[kept], y, style=style, low=low, high=high)


def _spread(values: FloatArray) -> float:
    """Return the standard deviation of what is known of a signal, a part of it at a time."""
    pieces = np.array_split(values, 1 + len(values) // AT_ONCE)
    n = max(sum(int(np.isfinite(part).sum()) for part in pieces), 1)
    mean = sum(float(np.nansum(part)) for part in pieces) / n
    return float(np.sqrt(sum(float(np.nansum((part - mean) ** 2)) for part in pieces) / n))


def _over_time(result: IdentifyResult, panels: Sequence[dict[str, Any]]) -> tuple[Panel, ...]:
    """Return panels over the analysed window, the time named under the lowest."""
    limits = (float(result.time_s[0]), float(result.time_s[-1]))
    names = [""] * (len(panels) - 1) + ["time [s]"]
    return tuple(Panel(x_label=name, x_limits=limits, **panel) for name, panel in zip(names, panels, strict=True))


def _onsets(result: IdentifyResult, channel: str) -> tuple[Span, ...]:
    """Return where the faults of a channel start and end inside the window."""
    moments = (
        t
        for estimate in result.faults
        if estimate.fault.channel == channel
        for t in (estimate.fault.onset_s, estimate.fault.offset_s)
    )
    inside = [t for t in moments if t is not None and result.log.start_s < t < result.log.stop_s]
    return tuple(Span(label="start or end of a fault", low=t, high=t) for t in inside)


def _draw_outputs(result: IdentifyResult) -> Drawing:
    panels: list[dict[str, Any]] = []
    for series in result.outputs:
        curves = [
            _line("measured", result, series.measured, "wide"),
            _line("predicted one step ahead", result, series.predicted),
        ]
        if np.any(series.fault):
            curves.append(_line("corrected for the fault", result, series.corrected, "dashed"))
        panels.append(
            {
                "y_label": axis_label(series.channel, series.unit),
                "curves": tuple(curves),
                "spans": _onsets(result, series.channel),
                "height": 0.85,
            }
        )
    for unit in dict.fromkeys(result.input_units.get(name, "") for name in result.inputs):
        names = [name for name in result.inputs if result.input_units.get(name, "") == unit]
        curves = [_line(name if len(names) > 1 else "", result, result.inputs[name]) for name in names]
        label = axis_label(shortened(names[0], 18) if len(names) == 1 else "inputs", unit)
        # On two lines, which the low panel has room for.
        panels.append({"y_label": label.replace(" [", "\n["), "curves": tuple(curves), "height": 0.5})
    outputs, inputs = ", ".join(result.model.outputs), ", ".join(result.model.inputs)
    caption = (
        f"Measured {outputs} with the one-step prediction of the final model and the measurement corrected for the "
        f"declared faults; below, {inputs}. {result.log.n_samples} samples at {number(result.model.rate_hz)} Hz, "
        f"{instant(result.log.start_s)} to {instant(result.log.stop_s)} s on the log's time axis."
    )
    return Drawing(name="outputs", caption=caption, panels=_over_time(result, panels))


def _draw_fault(result: IdentifyResult) -> Drawing:
    panels: list[dict[str, Any]] = []
    has_band = all(np.isfinite(series.fault_sd).all() for series in result.outputs)
    for series in result.outputs:
        declared, injected = (
            bool(np.any(series.fault)),
            series.true_fault is not None and bool(np.any(series.true_fault)),
        )
        label = "reconstructed, with 95 % band" if has_band else "reconstructed"
        curves = [_line(label, result, series.fault, "dashed", series.fault_sd if has_band else None)]
        if series.true_fault is not None:
            curves.insert(0, _line("injected", result, series.true_fault, "wide"))
        # A fifth of the output's spread keeps the zero in the middle of an empty panel.
        room = 0.2 * max(_spread(series.measured), 1e-6)
        panels.append(
            {
                "title": "" if declared else "no fault declared on this channel",
                "y_label": axis_label(f"fault on {series.channel}", series.unit),
                "curves": tuple(curves),
                "spans": _onsets(result, series.channel),
                "y_limits": None if declared or injected else (-room, room),
                "height": 0.9,
            }
        )
    caption = "Reconstructed fault on each output" + (
        " with its pointwise 95 % band (1.96 standard deviations)." if has_band else "; the method has no band."
    )
    if result.truth is not None:
        caption += " The injected fault is known and drawn beneath."
    return Drawing(name="fault", caption=caption, panels=_over_time(result, panels))


def _draw_magnitudes(result: IdentifyResult, units: Units) -> Drawing:
    shown = shown_candidates(result)
    ratios = [_ratio(candidate) for candidate in shown]
    reach = 2.0 * max([2.0, *(abs(ratio) for ratio in ratios if ratio is not None)])
    curves: list[Curve] = []
    styles: tuple[tuple[str, Style, bool], ...] = (
        ("declared", "intervals", True),
        ("not declared", "faint_intervals", False),
    )
    for label, style, active in styles:
        drawn = [
            (j, ratio)
            for j, ratio in enumerate(ratios)
            if ratio is not None and (shown[j].state == "declared") is active
        ]
        x = np.array([ratio for _, ratio in drawn])
        half = np.array([TWO_SIDED_95 * (shown[j].sd or 0.0) / (shown[j].minimal_detectable or 1.0) for j, _ in drawn])
        if drawn:
            curves.append(curve(label, x, [float(j) for j, _ in drawn], style=style, low=x - half, high=x + half))
    notes: list[tuple[str, float]] = []
    for j, candidate in enumerate(shown):
        scale, meant = shown_meaning(candidate, units)
        factor, smallest = scale / meant.factor, _smallest(candidate)
        spread = math.nan if candidate.sd is None else TWO_SIDED_95 * abs(factor) * candidate.sd
        value = number(None if candidate.magnitude is None else factor * candidate.magnitude, spread=spread, extra=1)
        size = with_unit(f"{value} ± {number(spread, spread=spread, extra=1)}", meant.unit)
        limit = change(None if smallest is None else abs(scale) * smallest, meant)
        notes.append(("not estimated" if candidate.magnitude is None else f"{size}, limit {limit}", float(j)))
    more = f"{len(shown)} of {len(result.candidates)} entries: declared, and largest for their limit"
    panel = Panel(
        title=more if len(shown) < len(result.candidates) else "",
        x_label="magnitude / minimal detectable magnitude [-]",
        y_label="dictionary entry",
        curves=tuple(curves),
        spans=(Span(label="cannot be found reliably", low=-1.0, high=1.0),),
        x_limits=(-reach, reach),
        linear_x=1.0,
        y_limits=(len(shown) - 0.5, -0.5),
        y_ticks=tuple((candidate.name, float(j)) for j, candidate in enumerate(shown)),
        side_notes=tuple(notes),
        height=0.25 + 0.1 * max(len(shown), 4),
    )
    return Drawing(name="magnitudes", caption=MAGNITUDE_CAPTION, panels=(panel,))


def _draw_residuals(result: IdentifyResult) -> Drawing:
    summaries = {summary.channel: summary for summary in result.residuals}
    limits = (float(result.time_s[0]), float(result.time_s[-1]))
    panels = []
    for series in result.outputs:
        summary = summaries.get(series.channel)
        look: dict[str, Any] = {"y_label": axis_label("residual", series.unit), "x_limits": limits, "height": 0.55}
        name = shortened(series.channel, 28)
        panels.append(Panel(x_label="", **look, **_plain_test(result, series, summary, name)))
        final = (_line("", result, series.prediction_error),)
        panels.append(Panel(title=f"{name}: final model", x_label="time [s]", curves=final, **look))
        if summary is not None:
            y = np.array(summary.autocorrelation)
            reach = 1.15 * max([0.3, *np.abs(y)])
            lags = curve(
                "",
                np.array(summary.lags, dtype=np.float64),
                y,
                style="points",
                low=np.minimum(y, 0.0),
                high=np.maximum(y, 0.0),
            )
            panels.append(
                Panel(
                    title=f"{name}: final model, whiteness p = {number(summary.ljung_box_p, digits=2)}",
                    x_label="lag [samples]",
                    y_label="autocorrelation [-]",
                    curves=(lags,),
                    levels=(("95 % band of white noise", summary.band), ("", -summary.band)),
                    y_limits=(-reach, reach),
                    height=0.55,
                )
            )
    return Drawing(name="residuals", caption=RESIDUAL_CAPTION, panels=tuple(panels))


def _plain_test(
    result: IdentifyResult, series: OutputSeries, summary: ResidualSummary | None, name: str
) -> dict[str, Any]:
    """Return what the panel of the fault-free model's residual shows: its alarms and the limits of the 5-sigma test."""
    residual = _line("", result, series.plain_residual)
    if summary is None:
        return {"title": f"{name}: fault-free model", "curves": (residual,)}
    limit, alarms_s = 5.0 * summary.plain_sd, np.array(summary.plain_alarms_s)
    at = series.plain_residual[np.searchsorted(result.time_s, alarms_s).clip(0, result.time_s.size - 1)]
    # A thinned curve has the least and the greatest value.
    peak = float(np.nanmax(np.abs(np.append(residual.y, limit)))) or 1.0
    far = 0.0 < 3.0 * limit < peak
    return {
        "title": f"{name}: fault-free model, {alarms_s.size} samples beyond ±5 σ",
        "curves": (residual, *([curve("beyond ±5 σ", alarms_s, at, style="points")] if alarms_s.size else [])),
        "levels": (("±5 σ", limit), ("", -limit)),
        "y_limits": (-4.0 * peak, 4.0 * peak) if far else (-1.4 * peak, 1.4 * peak),
        "linear_y": limit if far else None,
    }


def _draw_orders(result: IdentifyResult) -> tuple[Drawing, ...]:
    """Draw how far the criterion of each order lies above the least of all; nothing where the order was given."""
    model = result.model
    curves = np.array([model.criterion_no_fault, model.criterion_best], dtype=np.float64)
    if not np.isfinite(curves).any():
        return ()
    above = curves - np.nanmin(np.where(np.isfinite(curves), curves, np.nan))
    orders = np.array(model.orders, dtype=np.float64)
    drawn = [curve("best set of faults", orders, above[1]), curve("no fault", orders, above[0], style="dashed")]
    if model.order in model.orders:
        least = float(np.nanmin(above[:, model.orders.index(model.order)]))
        drawn.append(curve("chosen", [float(model.order)], [least], style="points"))
    panel = Panel(
        x_label="model order [samples of lag]",
        y_label="criterion above its least [-]",
        curves=tuple(drawn),
        x_ticks=tuple((str(order), float(order)) for order in model.orders),
        linear_y=LINEAR_CRITERION,
        y_limits=(-1.5, max(2.0 * float(np.nanmax(above)), LINEAR_CRITERION)),
    )
    caption = (
        "Model-selection criterion over the model order, above its least value, without a fault and with the best set "
        f"of faults; order {model.order} was used. The gap between the curves is the evidence for the faults. "
        f"Condition number of the regressors: {number(result.solver.condition_number, digits=3)}."
    )
    return (Drawing(name="orders", caption=caption, panels=(panel,)),)


def _data(result: IdentifyResult) -> dict[str, dict[str, Any] | Callable[[], dict[str, Any]]]:
    model, channel_units = result.model, result.channel_units
    residuals = {
        "output": [residual.channel for residual in result.residuals],
        "unit": [channel_units.get(residual.channel, "") for residual in result.residuals],
        "noise_sd": [model.noise_sd.get(residual.channel) for residual in result.residuals],
        "vaf_percent": [result.vaf_output.get(residual.channel) for residual in result.residuals],
        "ljung_box_p": [residual.ljung_box_p for residual in result.residuals],
        "plain_sd": [residual.plain_sd for residual in result.residuals],
        "plain_alarms_s": [
            " ".join(f"{time_s:.12g}" for time_s in residual.plain_alarms_s) for residual in result.residuals
        ],
    }
    return {
        **({"residuals.csv": residuals} if result.residuals else {}),
        "faults.csv": fault_columns(result.faults, FAULT_COLUMNS),
        "candidates.csv": candidate_columns(result.candidates),
        "orders.csv": {
            "order": model.orders,
            "criterion_no_fault": model.criterion_no_fault,
            "criterion_best": model.criterion_best,
        },
        "series.csv": partial(_series, result),
    }


def _series(result: IdentifyResult) -> dict[str, Any]:
    series: dict[str, Any] = {"time [s]": result.time_s}
    for name, values in result.inputs.items():
        series[_column(name, result.input_units.get(name, ""))] = values
    for output in result.outputs:
        for kind in SERIES:
            values = getattr(output, kind)
            if values is not None:
                series[_column(f"{output.channel}_{kind}", output.unit)] = values
    return series


def _column(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name
