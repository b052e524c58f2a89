"""The files of `--out` by name: report, figures, tables and the whole answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .documents import identify_document
from .exhibit import Drawing, Exhibit
from .identify.result import IdentifyResult
from .kernels.progress import Report, parts, silent
from .printable import SHOWN
from .provenance import Provenance
from .serialize import to_csv, to_json

__all__ = ["IDENTIFY_NAMES", "exhibit_files", "exhibit_names", "identify_files"]

FAULT_COLUMNS = (
    *("name", "shape", "channel", "magnitude", "unit", "sd", "ci95_low", "ci95_high"),
    *("physical_value", "physical_unit", "onset_s", "offset_s", "frequency_hz"),
)
CANDIDATE_COLUMNS = ("name", "channel", "active", "magnitude", "unit", "sd", "minimal_detectable", "note")
IDENTIFY_NAMES = (
    *(f"{name}.{end}" for name in ("outputs", "fault", "magnitudes", "residuals", "orders") for end in ("svg", "png")),
    *("faults.csv", "candidates.csv", "orders.csv", "series.csv", "report.html", "result.json"),
)
DRAWING_COLUMNS = ("panel", "curve", "x", "y", "low", "high")
SERIES = ("measured", "corrected", "predicted", "fault", "fault_sd", "prediction_error", "plain_residual", "true_fault")


def identify_files(result: IdentifyResult, provenance: Provenance, report: Report = silent) -> dict[str, bytes]:
    """Return the content of every file of `bfi identify --out` by its name, result.json last."""
    from .plots import FIGURES, to_png, to_svg
    from .report import render_report

    files: dict[str, bytes] = {}
    vectors: dict[str, bytes] = {}
    for (name, plot), _ in parts(report, list(FIGURES.items())):
        figure = plot(result)
        vectors[name] = files[f"{name}.svg"] = to_svg(figure)
        files[f"{name}.png"] = to_png(figure)
    files |= _tables(result)
    files["report.html"] = render_report(result, provenance, vectors).encode("utf-8", SHOWN)
    files["result.json"] = to_json(identify_document(result, provenance)).encode() + b"\n"
    return files


def exhibit_names(drawings: Sequence[str] = (), tables: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of the files of an exhibit that has these drawings and tables."""
    figures = (f"{name}{end}" for name in drawings for end in (".svg", ".png", "_figure.csv"))
    return (*figures, *(f"{name}.csv" for name in tables), "report.html", "result.json")


def exhibit_files(
    exhibit: Exhibit, document: Mapping[str, Any], origin: Provenance, report: Report = silent
) -> dict[str, bytes]:
    """Return the content of every file of an exhibit by its name: figures, tables, report.html, result.json last.

    Parameters
    ----------
    document : what becomes result.json.
    report : told how far it is.
    """
    from .plots.exhibit import draw
    from .plots.style import to_png, to_svg
    from .report import render_exhibit

    files: dict[str, bytes] = {}
    vectors: dict[str, bytes] = {}
    for drawing, _ in parts(report, exhibit.drawings):
        figure = draw(drawing)
        vectors[drawing.name] = files[f"{drawing.name}.svg"] = to_svg(figure)
        files[f"{drawing.name}.png"] = to_png(figure)
        files[f"{drawing.name}_figure.csv"] = to_csv(DRAWING_COLUMNS, _points(drawing))
    files |= {f"{table.name}.csv": to_csv(table.heads, table.rows) for table in exhibit.tables}
    files["report.html"] = render_exhibit(exhibit, origin, vectors).encode("utf-8", SHOWN)
    files["result.json"] = to_json(document).encode() + b"\n"
    return files


def _points(drawing: Drawing) -> Iterable[Sequence[object]]:
    for panel in drawing.panels:
        for one in panel.curves:
            nothing = [None] * one.x.size
            low, high = (nothing if ends is None else ends.tolist() for ends in (one.low, one.high))
            for point in zip(one.x.tolist(), one.y.tolist(), low, high, strict=True):
                yield (panel.title or panel.y_label, one.label, *point)
    for heat_map in drawing.heat_maps:
        for row, values in zip(heat_map.rows, heat_map.values, strict=True):
            for column, value in zip(heat_map.columns, values.tolist(), strict=True):
                yield (heat_map.title, row, column, value, None, None)


def _tables(result: IdentifyResult) -> dict[str, bytes]:
    orders = zip(result.model.orders, result.model.criterion_no_fault, result.model.criterion_best, strict=True)
    candidates = ([getattr(candidate, column) for column in CANDIDATE_COLUMNS] for candidate in result.candidates)
    series = _series(result)
    samples = zip(*(values.tolist() for values in series.values()), strict=True)
    return {
        "faults.csv": to_csv(FAULT_COLUMNS, _faults(result)),
        "candidates.csv": to_csv(CANDIDATE_COLUMNS, candidates),
        "orders.csv": to_csv(("order", "criterion_no_fault", "criterion_best"), orders),
        "series.csv": to_csv(tuple(series), samples),
    }


def _faults(result: IdentifyResult) -> Iterable[Sequence[object]]:
    for estimate in result.faults:
        fault = estimate.fault
        size = (estimate.magnitude, estimate.unit, estimate.sd, *estimate.ci95)
        physical = (estimate.physical_value, estimate.physical_unit)
        when = (fault.onset_s, fault.offset_s, fault.frequency_hz)
        yield (estimate.name, fault.shape, fault.channel, *size, *physical, *when)


def _series(result: IdentifyResult) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    columns = {"time [s]": result.time_s}
    columns |= {_column(name, result.input_units.get(name, "")): values for name, values in result.inputs.items()}
    for series in result.outputs:
        for kind in SERIES:
            values = getattr(series, kind)
            if values is not None:
                columns[_column(f"{series.channel}_{kind}", series.unit)] = values
    return columns


def _column(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name
