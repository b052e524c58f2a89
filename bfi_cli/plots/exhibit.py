"""The figure of a drawing: panels of curves and heat maps, in the style of every other figure."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from ..printable import printable
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, Look, plain, settled, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..exhibit import Curve, Drawing, HeatMap, Panel

__all__ = ["draw"]

WIDTH_IN, PANEL_IN, LINE_IN = 6.9, 2.1, 0.16
CELL_IN, MAP_LABELS_IN, TALLEST_MAP_IN = 0.28, 0.9, 6.0
LETTERS, MAP_LETTERS, TITLE_LETTERS = 60, 24, 110
# The layout fails where labels do not fit: beside a panel of 2.1 in, and side by side over the page of 6.9 in.
AXIS_LETTERS, ROOM_LETTERS, HANDLE_LETTERS = 40, 140, 6
MOST_NUMBERS = 16
LOOKS: tuple[Look, ...] = (
    {"color": BLUE, "marker": "o"},
    {"color": VERMILLION, "marker": "s"},
    {"color": GREEN, "marker": "^"},
    {"color": ORANGE, "marker": "D"},
    {"color": SKY, "marker": "v"},
    {"color": BLACK, "marker": "x"},
)
DASHES = {"line": "-", "dashed": "--", "dotted": ":", "steps": "-", "points": "", "bars": "-"}


@styled
def draw(drawing: Drawing) -> Figure:
    """Return the figure: panels row by row, then the heat maps below each other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    across = max(drawing.across, 1)
    columns = 4 if across == 1 else 2
    rows = [drawing.panels[i : i + across] for i in range(0, len(drawing.panels), across)]
    heights = [PANEL_IN + max(_legend_in(panel, columns) for panel in row) for row in rows]
    heights += [min(CELL_IN * len(one.rows), TALLEST_MAP_IN) + MAP_LABELS_IN for one in drawing.heat_maps]
    figure = Figure(figsize=(WIDTH_IN, sum(heights)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), across, height_ratios=heights)
    for i, panel in enumerate(drawing.panels):
        _draw_panel(
            figure.add_subplot(grid[i // across, i % across]), panel, columns=columns, room=ROOM_LETTERS // across
        )
    for i, heat_map in enumerate(drawing.heat_maps):
        _draw_map(figure.add_subplot(grid[len(rows) + i, :]), heat_map)
    return settled(figure)


def _legend_in(panel: Panel, columns: int) -> float:
    return LINE_IN * (-(-len(_labels(panel)) // columns) + bool(panel.title))


def _labels(panel: Panel) -> set[str]:
    labels = {one.label for one in panel.curves} | {name for name, _ in panel.levels} | {s.label for s in panel.spans}
    return labels - {""}


def _letters(panel: Panel, columns: int, room: int) -> int:
    """Return to how many letters the labels of the legend are cut so that the columns fit beside each other."""
    longest = sorted((len(printable(label)) for label in _labels(panel)), reverse=True)[:columns]
    fits = sum(min(length, LETTERS) + HANDLE_LETTERS for length in longest) <= room
    return LETTERS if fits else room // len(longest) - HANDLE_LETTERS


def _draw_panel(axes: Axes, panel: Panel, *, columns: int, room: int) -> None:
    letters = _letters(panel, columns, room)
    for i, one in zip(count(), panel.curves, strict=False):
        _draw_curve(axes, one, LOOKS[i % len(LOOKS)], letters)
    for (label, level), dash in zip(panel.levels, ("--", ":", "-.", (0, (1, 3))) * 9, strict=False):
        axes.axhline(level, color=BLACK, ls=dash, lw=0.9, label=plain(label, letters) or None)
    named: set[str] = set()
    for span in panel.spans:
        label = span.label if span.label not in named else ""
        named.add(span.label)
        if span.high > span.low:
            axes.axvspan(span.low, span.high, color=GREY, alpha=0.3, lw=0.0, label=plain(label, letters) or None)
        else:
            axes.axvline(span.low, color=GREY, ls=":", lw=1.0, label=plain(label, letters) or None)
    _set_axes(axes, panel)
    _name_all(axes, plain(panel.title, room), columns)


def _set_axes(axes: Axes, panel: Panel) -> None:
    if panel.log_x:
        axes.set_xscale("log")
    if panel.log_y:
        axes.set_yscale("log")
    if panel.y_limits is not None:
        axes.set_ylim(*panel.y_limits)
    axes.set_xlabel(plain(panel.x_label, LETTERS))
    axes.set_ylabel(plain(panel.y_label, AXIS_LETTERS))


def _name_all(axes: Axes, title: str, columns: int) -> None:
    """Put legend and title above the panel, where they hide no data."""
    handles, _ = axes.get_legend_handles_labels()
    if not handles:
        axes.set_title(title, loc="left")
        return
    legend = axes.legend(
        title=title or None,
        alignment="left",
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=min(columns, len(handles)),
        borderaxespad=0.1,
        handlelength=2.2,
        columnspacing=1.4,
    )
    legend.get_title().set_fontsize(axes.title.get_fontsize())


def _draw_curve(axes: Axes, one: Curve, look: Look, letters: int) -> None:
    name: Look = {"label": plain(one.label, letters) or None, "ls": DASHES[one.style], "lw": 1.0}
    if one.style in ("points", "bars"):
        ends = None if one.low is None or one.high is None else np.clip([one.y - one.low, one.high - one.y], 0.0, None)
        axes.errorbar(one.x, one.y, ends, ms=3.5, capsize=2.0, **look, **name)
        return
    if one.low is not None and one.high is not None:
        axes.fill_between(one.x, one.low, one.high, color=look["color"], alpha=0.25, lw=0.0)
    steps = "steps-post" if one.style == "steps" else "default"
    axes.plot(one.x, one.y, color=look["color"], drawstyle=steps, **name)


def _draw_map(axes: Axes, heat_map: HeatMap) -> None:
    values = np.array(heat_map.values, dtype=np.float64).reshape(len(heat_map.rows), len(heat_map.columns))
    image = axes.imshow(values, aspect="auto", cmap="cividis")
    axes.grid(visible=False)
    axes.set_xticks(
        range(len(heat_map.columns)), [plain(name, MAP_LETTERS) for name in heat_map.columns], rotation=30, ha="right"
    )
    axes.set_yticks(range(len(heat_map.rows)), [plain(name, MAP_LETTERS) for name in heat_map.rows])
    axes.set_title(plain(heat_map.title, TITLE_LETTERS), loc="left")
    axes.figure.colorbar(image, ax=axes, label=plain(heat_map.label, AXIS_LETTERS), fraction=0.04, pad=0.02)
    if max(values.shape, default=0) > MOST_NUMBERS:
        return
    middle = float(np.nanmean([np.nanmin(values), np.nanmax(values)])) if np.isfinite(values).any() else 0.0
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            axes.text(j, i, f"{value:.2g}", ha="center", va="center", color=BLACK if value > middle else "white")
