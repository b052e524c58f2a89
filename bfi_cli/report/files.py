"""The files of `--out` by name: report, figures, tables and the whole answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..files import REPORT, list_of_files
from ..kernels.progress import Report, parts, silent
from ..printable import SHOWN
from ..serialization import Provenance, to_csv, to_json
from .content import Drawing, ReportContent

# Each row has the labels of its axes, `name [unit]`, since panels differ in them.
DRAWING_COLUMNS = ("panel", "curve", "x_is", "x", "y_is", "y", "low", "high")


def content_names(
    drawings: Sequence[str] = (), tables: Sequence[str] = (), *, stored: str = "result.json", zoom: bool = False
) -> tuple[str, ...]:
    """Return the names of the files of a report with these drawings and tables, and with a page to `zoom` if wanted."""
    figures = (f"{name}{end}" for name in drawings for end in (".svg", ".png", "_figure.csv"))
    pages = ("report.html", "zoom.html") if zoom else ("report.html",)
    return (*figures, *(f"{name}.csv" for name in tables), *pages, stored)


def content_files(
    content: ReportContent,
    document: Mapping[str, Any],
    origin: Provenance,
    report: Report = silent,
    *,
    plain: ReportContent | None = None,
    stored: str = "result.json",
) -> dict[str, bytes]:
    """Return the bytes of every file of a report by its name: figures, tables, the document, report.html.

    Parameters
    ----------
    document : stored under the name `stored`.
    report : called with the part of the drawings that is done.
    plain : the same content in SI and radians, for the CSV files; None if `content` is in these.
    """
    from .figures import draw
    from .html import render_content
    from .style import settings, to_png, to_svg
    from .zoom import render_zoom

    files: dict[str, bytes] = {}
    vectors: dict[str, bytes] = {}
    plain = content if plain is None else plain
    for (drawing, _), in_si in zip(parts(report, content.drawings), plain.drawings, strict=True):
        with settings():
            figure = draw(drawing)
            vectors[drawing.name] = files[f"{drawing.name}.svg"] = to_svg(figure)
            files[f"{drawing.name}.png"] = to_png(figure)
        files[f"{drawing.name}_figure.csv"] = to_csv(DRAWING_COLUMNS, _points(in_si))
    files |= {f"{table.name}.csv": to_csv(table.heads, table.rows) for table in plain.tables}
    for name, made in plain.data.items():
        columns = made() if callable(made) else made
        values = (column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values())
        files[name] = to_csv(tuple(columns), zip(*values, strict=True))
    if content.zoom:
        files["zoom.html"] = render_zoom(content).encode("utf-8", SHOWN)
    files[stored] = to_json(document).encode() + b"\n"
    files[REPORT] = render_content(content, origin, vectors).encode("utf-8", SHOWN) + list_of_files(files)
    return files


def _points(drawing: Drawing) -> Iterable[Sequence[object]]:
    """Yield the rows of the CSV file of a figure; a heat map has the column's name as x and the value as y."""
    for k, panel in enumerate(drawing.panels):
        # A panel without a label shares the axis of a panel below it.
        x_label = next((lower.x_label for lower in drawing.panels[k:] if lower.x_label), "")
        x_is, y_is = _one_line(x_label), _one_line(panel.y_label)
        name = _one_line(panel.title) or (y_is if "[" in y_is else x_is)
        for curve in panel.curves:
            nothing = [None] * curve.x.size
            low, high = (nothing if ends is None else ends.tolist() for ends in (curve.low, curve.high))
            for x, y, *ends in zip(curve.x.tolist(), curve.y.tolist(), low, high, strict=True):
                yield (name, _one_line(curve.label), x_is, x, y_is, y, *ends)
    for heat_map in drawing.heat_maps:
        for row, values in zip(heat_map.rows, heat_map.values, strict=True):
            for column, value in zip(heat_map.columns, values.tolist(), strict=True):
                yield (heat_map.title, row, "", column, _one_line(heat_map.label), value, None, None)


def _one_line(label: str) -> str:
    return " ".join(label.split())
