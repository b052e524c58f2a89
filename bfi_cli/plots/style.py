"""Paper size, colours and line styles of every figure, and the figure files; independent of the user's matplotlibrc.

Colours are those of Okabe and Ito (2008), told apart by the colour blind; every line also has its own dash or weight.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

from ..wording import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "SKY",
    "VERMILLION",
    "Look",
    "legend_above",
    "page",
    "plain",
    "settled",
    "styled",
    "to_png",
    "to_svg",
]

BLACK, GREY = "#000000", "#8c8c8c"
BLUE, SKY, GREEN, ORANGE, VERMILLION = "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00"

WIDTH_IN = 6.9
LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 0.8, 0.12, 0.34, 0.46
PNG_DPI = 150
SETTINGS = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.4,
    "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True,
    "lines.solid_capstyle": "butt",
    "svg.fonttype": "path",
    "svg.hashsalt": "bfi",
    "figure.dpi": 100.0,
}

P = ParamSpec("P")
Look = dict[str, Any]


def _settings() -> AbstractContextManager[None]:
    from matplotlib import style

    return style.context(["default", SETTINGS])


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Return `draw` run under the settings of this module."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with _settings():
            return draw(*args, **kwargs)

    return drawn


def page(
    heights_in: Sequence[float],
    *,
    widths: Sequence[float] = (1.0,),
    gap_in: float = 0.14,
    left_in: float = LEFT_IN,
    column_gap_in: float = 0.6,
) -> tuple[Figure, GridSpec]:
    """Return a figure as wide as the text of an A4 page and its grid of panels.

    Parameters
    ----------
    heights_in : inches, one per row of panels.
    widths : relative, one per column.
    gap_in, column_gap_in : inches between rows and between columns.
    left_in : inches left of the first column, for its labels.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = sum(heights_in) + gap_in * (len(heights_in) - 1)
    height = TOP_IN + panels + BOTTOM_IN
    figure = Figure(figsize=(WIDTH_IN, height))
    FigureCanvasAgg(figure)
    column = (WIDTH_IN - left_in - RIGHT_IN - column_gap_in * (len(widths) - 1)) / len(widths)
    grid = figure.add_gridspec(
        len(heights_in),
        len(widths),
        height_ratios=heights_in,
        width_ratios=widths,
        left=left_in / WIDTH_IN,
        right=1.0 - RIGHT_IN / WIDTH_IN,
        bottom=BOTTOM_IN / height,
        top=1.0 - TOP_IN / height,
        hspace=gap_in * len(heights_in) / sum(heights_in),
        wspace=column_gap_in / column,
    )
    return figure, grid


def plain(text: str, width: int = 200) -> str:
    """Return `text` as drawn letter by letter: names out of a file are no mathematics."""
    return shortened(text, width).replace("$", r"\$")


def settled(figure: Figure) -> Figure:
    """Return the figure with the places its layout engine found, fixed to a millionth of the page.

    The solver behind the engine is free in its last digits, and the names of clip paths in an SVG depend on all digits.
    """
    engine = figure.get_layout_engine()
    if engine is None:
        return figure
    engine.execute(figure)
    figure.set_layout_engine("none")
    for axes in figure.axes:
        left, bottom, width, height = (round(float(x), 6) for x in axes.get_position(original=True).bounds)
        axes.set_position((left, bottom, width, height))
    return figure


def legend_above(axes: Axes) -> None:
    """Put the legend in one line above the panel, where it hides no data."""
    handles, _ = axes.get_legend_handles_labels()
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=max(len(handles), 1),
        borderaxespad=0.1,
        handlelength=2.4,
        columnspacing=1.6,
    )


def to_svg(figure: Figure) -> bytes:
    """Return the figure as SVG, letters as outlines; the same figure always gives the same bytes."""
    with _settings():
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
        return file.getvalue()


def to_png(figure: Figure) -> bytes:
    """Return the figure as PNG at 150 dots per inch."""
    with _settings():
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=PNG_DPI, metadata={"Software": None})
        return file.getvalue()
