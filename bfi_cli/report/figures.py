"""The figure of a drawing: panels of curves and heat maps, all in one style."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import count, cycle, zip_longest
from typing import TYPE_CHECKING

import numpy as np

from ..printable import printable
from ..quantities.text import clock, clock_of_day
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, SHADES, SKY, VERMILLION, Look, fix_places, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .content import Block, Curve, Drawing, HeatMap, Panel, Shade

# Inches: width of a page of A4, heights of a panel and of a line of a key, and of a cell of a map; letters of labels.
WIDTH_IN, PANEL_IN, LINE_IN = 6.9, 2.1, 0.16
CELL_IN, MAP_LABELS_IN, TALLEST_MAP_IN = 0.28, 0.9, 6.0
LETTERS, MAP_LETTERS, TITLE_LETTERS = 60, 24, 110
# Limits of labels, beyond which the layout fails: beside a panel of 2.1 in, and side by side over a page of 6.9 in.
AXIS_LETTERS, ROOM_LETTERS, HANDLE_LETTERS = 40, 140, 6
# Letters are up to 2 % wider at another resolution than that of the layout.
PAD_IN = 0.06
# Rows or columns of a heat map up to which the cells have numbers, and names along its side.
MOST_NUMBERS, MOST_NAMES = 16, 24
# Labelled powers of ten on either side of the linear part of an axis.
MOST_POWERS = 4
# Width of a box of quantiles on an axis of whole numbers.
BOX_WIDTH = 0.08
# Height of a horizontal bar on rows that are 1 apart.
ROW_WIDTH = 0.55
# Inches: width of axes with a name and numbers on their left, and of a letter of 6.5 points.
AXES_IN, LETTER_IN = 6.0, 0.056
LANE_HEIGHT, BAND_ALPHA = 0.8, 0.45
# Bright shades, whose labels stand beside them, and shades without a key.
LOUD, UNKEYED = ("fault", "suspect"), ("outline", "black")
# Steps of the times on the upper edge, s, their largest number, and their height, inches.
CLOCK_STEPS, MOST_CLOCK_TICKS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600), 9
CLOCK_IN = 0.17
X_LABEL_IN = 0.3  # height of numbers and name below lanes, whose panel is too low for them
KEY_COLUMNS = 6  # of the key of lanes
LOOKS: tuple[Look, ...] = (
    {"color": BLUE, "marker": "o"},
    {"color": VERMILLION, "marker": "s"},
    {"color": GREEN, "marker": "^"},
    {"color": ORANGE, "marker": "D"},
    {"color": SKY, "marker": "v"},
    {"color": BLACK, "marker": "x"},
)
DASHES = {"dashed": "--", "dotted": ":", "points": "", "intervals": "", "faint_intervals": ""}
OWN_LOOKS: dict[str, Look] = {
    "wide": {"color": "#b4b4b4", "lw": 2.4},
    "faint_intervals": {"color": GREY, "marker": "o", "mfc": "white"},
    "rows_green": {"color": GREEN},
    "rows_orange": {"color": ORANGE},
    "rows_red": {"color": VERMILLION},
}


@styled
def draw(drawing: Drawing) -> Figure:
    """Return the figure: panels row by row, then the heat maps below each other."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    across = max(drawing.across, 1)
    columns = 4 if across == 1 else 2
    wide = {panel: KEY_COLUMNS if panel.lanes else columns for panel in drawing.panels}
    rows = [drawing.panels[i : i + across] for i in range(0, len(drawing.panels), across)]
    heights = [max(PANEL_IN * panel.height + _legend_in(panel, wide[panel]) for panel in row) for row in rows]
    if not drawing.shared_x:
        heights = [height + (X_LABEL_IN if row[-1].lanes else 0.0) for height, row in zip(heights, rows, strict=True)]
    heights += [min(CELL_IN * len(heat_map.rows), TALLEST_MAP_IN) + MAP_LABELS_IN for heat_map in drawing.heat_maps]
    figure = Figure(figsize=(WIDTH_IN, sum(heights)))
    figure.set_layout_engine("constrained", w_pad=PAD_IN, h_pad=PAD_IN)
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), across, height_ratios=heights)
    shared: Look = {}
    for i, panel in enumerate(drawing.panels):
        axes = figure.add_subplot(grid[i // across, i % across], **shared)
        _draw_panel(axes, panel, columns=wide[panel], room=ROOM_LETTERS // across)
        if drawing.shared_x:
            shared = {"sharex": axes}
            if i + 1 < len(drawing.panels):
                axes.tick_params(labelbottom=False)
                axes.set_xlabel("")
    for i, heat_map in enumerate(drawing.heat_maps):
        _draw_map(figure.add_subplot(grid[len(rows) + i, :]), heat_map)
    return fix_places(figure)


def _legend_in(panel: Panel, columns: int) -> float:
    lines = -(-len(_labels(panel)) // columns) + bool(panel.title)
    return LINE_IN * lines + (CLOCK_IN if panel.clock else 0.0)


def _labels(panel: Panel) -> set[str]:
    keyed = {label for label, _ in _unwritten(panel, ())} if panel.lanes else set()
    labels = (
        keyed
        | {curve.label for curve in panel.curves}
        | {name for name, _ in panel.levels}
        | {s.label for s in panel.spans}
    )
    return labels - {""}


def _draw_panel(axes: Axes, panel: Panel, *, columns: int, room: int) -> None:
    # The labels of the legend are cut so that the columns fit beside each other.
    longest = sorted((len(printable(label)) for label in _labels(panel)), reverse=True)[:columns]
    fits = sum(min(length, LETTERS) + HANDLE_LETTERS for length in longest) <= room
    letters = LETTERS if fits else room // len(longest) - HANDLE_LETTERS
    _draw_bands(axes, panel)
    if panel.lanes:
        _draw_lanes(axes, panel)
    looks = count()
    for curve in panel.curves:
        look = OWN_LOOKS[curve.style] if curve.style in OWN_LOOKS else LOOKS[next(looks) % len(LOOKS)]
        _draw_curve(axes, curve, look, plain(curve.label, letters) or None)
    dashes = cycle(("--", ":", "-.", (0, (1, 3))))
    dash = next(dashes)
    for i, (label, level) in enumerate(panel.levels):
        dash = next(dashes) if i and label else dash  # a level without a name belongs to the one before it
        axes.axhline(level, color=BLACK, ls=dash, lw=0.9, label=plain(label, letters) or None)
    named: set[str] = set()
    for span in panel.spans:
        label = plain("" if span.label in named else span.label, letters)
        named.add(span.label)
        if span.high > span.low:
            axes.axvspan(span.low, span.high, color=GREY, alpha=0.3, lw=0.0, label=label or None)
        else:
            axes.axvline(span.low, color=GREY, ls=":", lw=1.0, label=label or None)
    if panel.clock and panel.x_limits is not None and panel.x_limits[1] > panel.x_limits[0]:
        _add_clock(axes, panel.x_limits, panel.midnight_s)
    _set_axes(axes, panel)
    _write_legend(axes, plain(panel.title, room), columns, lift_in=CLOCK_IN if panel.clock else 0.0)


def _set_axes(axes: Axes, panel: Panel) -> None:
    letters = AXIS_LETTERS if "\n" not in panel.y_label else max(8, int(AXIS_LETTERS * panel.height))
    y_label = "\n".join(plain(line, letters) for line in panel.y_label.split("\n"))
    axes.set(xlabel=plain(panel.x_label, LETTERS), ylabel=y_label)
    for name, log, limits, linear, ticks in (
        ("x", panel.log_x, panel.x_limits, panel.linear_x, panel.x_ticks),
        ("y", panel.log_y, panel.y_limits, panel.linear_y, panel.y_ticks),
    ):
        if log:
            axes.set(**{f"{name}scale": "log"})
        if limits is not None:
            axes.set(**{f"{name}lim": limits})
        if linear is not None:
            _set_linear_part(axes, name, linear)
        if ticks:
            names = [plain(label, MAP_LETTERS) for label, _ in ticks]
            axes.set(**{f"{name}ticks": [place for _, place in ticks], f"{name}ticklabels": names})
    for text, y in panel.side_notes:
        axes.text(1.015, y, plain(text, LETTERS), transform=axes.get_yaxis_transform(), va="center", fontsize=7.5)


def _draw_bands(axes: Axes, panel: Panel) -> None:
    for block in panel.bands:
        face, edge = SHADES[block.shade]
        if block.high > block.low:
            axes.axvspan(block.low, block.high, color=face, alpha=BAND_ALPHA, lw=0.0, zorder=0.5)
        else:
            axes.axvline(block.low, color=edge, lw=0.9, ls="--", zorder=1.5)


def _draw_lanes(axes: Axes, panel: Panel) -> None:
    """Draw rows of blocks with their labels; a key above explains the colours of blocks too small for their labels."""
    left, right = panel.x_limits or (0.0, 1.0)
    written: set[str] = set()
    for row, lane in enumerate(reversed(panel.lanes)):
        blocks = [block for block in lane.blocks if block.low <= right and block.high >= left]
        for block, following in zip_longest(blocks, blocks[1:]):
            low, high = max(block.low, left), min(block.high, right)
            face, edge = SHADES[block.shade]
            if high > low:
                axes.barh(row, high - low, left=low, height=LANE_HEIGHT, color=face, ec=edge, lw=0.5)
            if block.shade in LOUD:
                axes.vlines(low, row - 0.5 * LANE_HEIGHT, row + 0.5 * LANE_HEIGHT, color=edge, lw=1.6)
            free_to = right if following is None else min(following.low, right)
            if _write_block(axes, block, row, (low, high), (left, free_to), (right - left) / AXES_IN):
                written.add(block.label)
    names = [plain(lane.label, MAP_LETTERS) for lane in reversed(panel.lanes)]
    axes.set(ylim=(-0.6, len(names) - 0.4), yticks=range(len(names)), yticklabels=names, xlim=(left, right))
    axes.tick_params(axis="y", length=0.0)
    axes.grid(visible=False, axis="y")
    for label, shade in _unwritten(panel, written):
        face, edge = SHADES[shade]
        axes.bar([left], [0.0], color=face, ec=edge, lw=0.5, label=plain(label, LETTERS))


def _unwritten(panel: Panel, written: Collection[str]) -> list[tuple[str, Shade]]:
    blocks = [block for lane in panel.lanes for block in lane.blocks if block.shade not in {*LOUD, *UNKEYED}]
    left, right = panel.x_limits or (0.0, 1.0)
    shown = [block for block in blocks if block.low <= right and block.high >= left]
    return list(
        dict.fromkeys((block.label, block.shade) for block in shown if block.label and block.label not in written)
    )


def _write_block(
    axes: Axes, block: Block, row: int, ends: tuple[float, float], room: tuple[float, float], scale: float
) -> bool:
    """Write the label of a block into it, or beside it for frames and bright blocks; return whether there was room.

    Parameters
    ----------
    ends : of the part of the block that is shown.
    room : the free stretch around it, from the left of the axes to the next block.
    scale : of the x axis, per inch.
    """
    text, letter = plain(block.label, LETTERS), LETTER_IN * scale
    width, (low, high) = (len(text) + 1.5) * letter, ends
    look: Look = {"va": "center_baseline", "fontsize": 6.5, "clip_on": True}
    if block.shade not in LOUD and width < high - low:
        colour = "white" if block.shade in ("blue", "black") else BLACK
        axes.text(0.5 * (low + high), row, text, ha="center", color=colour, **look)
        return True
    if block.shade in {*LOUD, "outline"} and high + width < room[1]:
        axes.text(high + 0.5 * letter, row, text, ha="left", **look)
        return True
    if block.shade in LOUD and low - width > room[0]:
        axes.text(low - 0.5 * letter, row, text, ha="right", **look)
        return True
    return False


def _add_clock(axes: Axes, limits: tuple[float, float], midnight_s: float | None) -> None:
    """Number the upper edge of axes in minutes and seconds too, or by the clock of the day that is 0:00 at midnight."""
    upper = axes.secondary_xaxis("top")
    span = limits[1] - limits[0]
    step = next((seconds for seconds in CLOCK_STEPS if span / seconds <= MOST_CLOCK_TICKS), CLOCK_STEPS[-1])
    step *= max(1, math.ceil(span / step / MOST_CLOCK_TICKS))
    low, high = ((limit - (midnight_s or 0.0)) / step for limit in limits)
    times = [float(step * k) for k in range(math.ceil(low), math.floor(high) + 1)]
    labels = [clock(time) if midnight_s is None else clock_of_day(time) for time in times]
    upper.set_ticks([time + (midnight_s or 0.0) for time in times], labels=labels)
    upper.tick_params(labelsize=6.5, length=2.0)


def _set_linear_part(axes: Axes, name: str, linear: float) -> None:
    """Make an axis linear up to a size and logarithmic beyond, labelled at 0, that size and powers of ten."""
    axis = getattr(axes, f"{name}axis")
    getattr(axes, f"set_{name}scale")("symlog", linthresh=linear)
    low, high = axis.get_view_interval()
    top = math.log10(max(abs(low), abs(high), linear))
    powers = 10.0 ** np.arange(math.ceil(math.log10(1.5 * linear)), math.floor(top) + 1.0)
    sizes = [linear, *powers[:: 1 + powers.size // MOST_POWERS]]
    places = [place for place in [-size for size in reversed(sizes)] + [0.0, *sizes] if low <= place <= high]
    axis.set_ticks(places, labels=[f"{float(f'{place:.3g}'):g}".replace("-", "−") for place in places])
    axis.set_ticks([], minor=True)
    getattr(axes, f"set_{name}lim")(low, high)


def _write_legend(axes: Axes, title: str, columns: int, *, lift_in: float = 0.0) -> None:
    """Put legend and title above the panel, where they hide no data, and above the numbers of its upper edge."""
    handles, _ = axes.get_legend_handles_labels()
    if not handles:
        axes.set_title(title, loc="left")
        return
    from matplotlib.transforms import ScaledTranslation

    legend = axes.legend(
        title=title or None,
        alignment="left",
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        bbox_transform=axes.transAxes + ScaledTranslation(0.0, lift_in, axes.figure.dpi_scale_trans),
        ncols=min(columns, len(handles)),
        borderaxespad=0.1,
        handlelength=2.2,
        columnspacing=1.4,
    )
    legend.get_title().set_fontsize(axes.title.get_fontsize())


def _draw_curve(axes: Axes, curve: Curve, look: Look, label: str | None) -> None:
    name: Look = {"lw": 1.0, "label": label, "ls": DASHES.get(curve.style, "-")}
    if curve.style == "boxes":
        _draw_boxes(axes, curve, look, label)
    elif curve.style.startswith("rows"):
        axes.barh(curve.y, curve.x, height=ROW_WIDTH, color=look["color"], label=label)
    elif curve.style in ("points", "bars", "intervals", "faint_intervals"):
        sideways = curve.style.endswith("intervals")
        middle, ends = curve.x if sideways else curve.y, None
        if curve.low is not None and curve.high is not None:
            ends = np.clip([middle - curve.low, curve.high - middle], 0.0, None)
        bars: Look = {"xerr" if sideways else "yerr": ends}
        axes.errorbar(curve.x, curve.y, **bars, **{"ms": 3.5, "capsize": 2.0, **name, **look})
    else:
        if curve.low is not None and curve.high is not None:
            axes.fill_between(curve.x, curve.low, curve.high, color=look["color"], alpha=0.25, lw=0.0)
        steps = "steps-post" if curve.style == "steps" else "default"
        axes.plot(curve.x, curve.y, drawstyle=steps, **{**name, **look, "marker": ""})


def _draw_boxes(axes: Axes, curve: Curve, look: Look, label: str | None) -> None:
    line: Look = {"color": look["color"], "lw": 0.9}
    boxes = [
        {"whislo": y[0], "q1": y[1], "med": y[2], "q3": y[3], "whishi": y[4], "fliers": y[5:]}
        for y in curve.y.reshape(-1, 6)
    ]
    axes.bxp(
        boxes,
        positions=curve.x[::6],
        widths=BOX_WIDTH,
        manage_ticks=False,
        boxprops=line,
        whiskerprops=line,
        capprops=line,
        medianprops=line | {"lw": 1.8},
        flierprops={"marker": look["marker"], "ms": 2.5, "mec": look["color"], "mfc": "none", "mew": 0.5},
    )
    axes.plot([], [], label=label, **line)


def _draw_map(axes: Axes, heat_map: HeatMap) -> None:
    values = np.array(heat_map.values, dtype=np.float64).reshape(len(heat_map.rows), len(heat_map.columns))
    image = axes.imshow(values, aspect="auto", cmap="cividis")
    axes.grid(visible=False)
    turned: Look = {"rotation": 30 if len(heat_map.columns) <= MOST_NUMBERS else 60, "ha": "right"}
    for names, set_ticks, look in ((heat_map.columns, axes.set_xticks, turned), (heat_map.rows, axes.set_yticks, {})):
        step = max(1, -(-len(names) // MOST_NAMES))
        set_ticks(range(0, len(names), step), [plain(name, MAP_LETTERS) for name in names[::step]], **look)
    axes.set_title(plain(heat_map.title, TITLE_LETTERS), loc="left")
    axes.figure.colorbar(image, ax=axes, label=plain(heat_map.label, AXIS_LETTERS), fraction=0.04, pad=0.02)
    if max(values.shape, default=0) > MOST_NUMBERS:
        return
    middle = float(np.nanmean([np.nanmin(values), np.nanmax(values)])) if np.isfinite(values).any() else 0.0
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            # Values below 1 must not read 1: a coherence of 1 means that two faults cannot be told apart.
            text = f"{value:.2g}" if not 0.995 <= value < 1.0 - 1e-9 else f"{min(value, 0.999):.3f}"
            axes.text(j, i, text, ha="center", va="center", color=BLACK if value > middle else "white")
