"""The page on which drawings can be zoomed: one file with its data and a short script, nothing fetched."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..printable import printable
from ..serialization import to_json
from .content import Block, Curve, Panel, ReportContent
from .figures import LOOKS
from .html import page_environment, resource
from .style import SHADES

# Height of a panel of relative height 1, pixels.
PANEL_PIXELS = 240
# Precision of numbers on the page: finer than any sensor, in a third of the letters of full precision.
VALUE_DIGITS, TIME_DECIMALS = 7, 4


def render_zoom(content: ReportContent) -> str:
    """Return the HTML page of the drawings in `content.zoom`, one below the other on one axis of time.

    Everything from a log, a name or a result stands in a block of JSON, in which no tag can begin or end, and is put on
    the page as text; the page forbids the browser to fetch anything.
    """
    panels = [panel for drawing in content.zoom for panel in drawing.panels]
    limits = _limits(panels)
    labels = tuple(dict.fromkeys(curve.label for panel in panels for curve in panel.curves if curve.label))
    data = {
        "limits": limits,
        "midnight": next((panel.midnight_s for panel in panels if panel.midnight_s is not None), None),
        "step": _step(panels, limits),
        "shades": SHADES,
        "panels": [_panel(panel, labels) for panel in panels],
    }
    text = to_json(data, indent=None, ascii_only=True)
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    blocks = dict.fromkeys((band.label, band.shade) for panel in panels for band in panel.bands if band.label)
    return (
        page_environment()
        .get_template("zoom.html.j2")
        .render(
            css=resource("report.css"),
            script=resource("zoom.js"),
            content=content,
            caption=content.zoom[0].caption if content.zoom else "",
            curves=[(label, _colour(i)) for i, label in enumerate(labels)],
            blocks=[(label, *SHADES[shade]) for label, shade in blocks],
            data=text,
        )
    )


def _colour(i: int) -> str:
    return str(LOOKS[i % len(LOOKS)]["color"])


def _limits(panels: list[Panel]) -> tuple[float, float]:
    given = [panel.x_limits for panel in panels if panel.x_limits is not None]
    low, high = min(ends[0] for ends in given), max(ends[1] for ends in given)
    return (low, high) if high > low else (low, low + 1.0)


def _step(panels: list[Panel], limits: tuple[float, float]) -> float:
    """Return the smallest median time step of the curves, which limits the zoom."""
    steps = [float(np.median(np.diff(curve.x))) for panel in panels for curve in panel.curves if curve.x.size > 1]
    return min((step for step in steps if step > 0.0), default=0.01 * (limits[1] - limits[0]))


def _panel(panel: Panel, labels: Sequence[str]) -> dict[str, Any]:
    """Return the data of a panel for the script, which does not escape: names are made printable here.

    Parameters
    ----------
    labels : of all curves of the page; curves of one label have one look, and a click shows or hides them together.
    """
    label = [printable(line) for line in panel.y_label.split("\n")]

    def stated(i: int, curve: Curve) -> dict[str, Any]:
        look = labels.index(curve.label) if curve.label else i
        name = " ".join(filter(None, (*label, printable(curve.label))))
        band = () if curve.low is None or curve.high is None else (_rounded(curve.low), _rounded(curve.high))
        x, y = np.round(curve.x, TIME_DECIMALS), _rounded(curve.y)
        return {"x": x, "y": y, "band": band, "name": name, "look": look, "colour": _colour(look)}

    return {
        "label": [*label, ""][:2],
        "height": round(PANEL_PIXELS * panel.height),
        "lanes": [
            {"label": printable(lane.label), "blocks": [_block(block) for block in lane.blocks]} for lane in panel.lanes
        ],
        "bands": [_block(band) for band in panel.bands],
        "levels": [(printable(name), place) for name, place in panel.levels],
        "log": panel.log_y,
        "curves": [stated(i, curve) for i, curve in enumerate(panel.curves)],
    }


def _block(block: Block) -> tuple[str, float, float, str]:
    return printable(block.label), block.low, block.high, block.shade


def _rounded(values: np.ndarray[Any, np.dtype[np.float64]]) -> list[float | None]:
    """Return the values to seven digits of the largest of them; None for values that are not finite."""
    largest = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    decimals = VALUE_DIGITS - int(np.ceil(np.log10(largest))) if largest > 0.0 else 0
    kept = values if decimals > 15 else np.round(values, decimals)
    return [value if np.isfinite(value) else None for value in kept.tolist()]
