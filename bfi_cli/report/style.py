"""Paper size, colours and line styles of every figure, and the figure files; independent of the user's matplotlibrc.

Colours are those of Okabe and Ito (2008), told apart by the colour blind; every line also has its own dash or weight.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

from ..printable import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLACK, GREY = "#000000", "#8c8c8c"
BLUE, SKY, GREEN, ORANGE, VERMILLION = "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00"

# Face and edge of the shades of blocks; light ones carry dark letters.
SHADES = {
    "grey": ("#dcdcdc", "#9a9a9a"),
    "white": ("#fbfbfb", "#b0b0b0"),
    "sky": ("#cfe6f7", "#7fb4d8"),
    "green": ("#cfe9dd", "#7dbfa2"),
    "yellow": ("#fbe7b5", "#d9b04a"),
    "rose": ("#f6d3c0", "#d99a78"),
    "violet": ("#ead3e3", "#bd8fae"),
    "blue": (BLUE, BLUE),
    "black": ("#4d4d4d", "#4d4d4d"),
    "outline": ("#ffffff", BLUE),
    "fault": (VERMILLION, VERMILLION),
    "suspect": (ORANGE, ORANGE),
}

PNG_DPI = 150  # legible on a screen, and a picture of 100 kB
# Settings of matplotlib; sizes of letters and lines in points.
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
    "figure.dpi": PNG_DPI,
}

P = ParamSpec("P")
Look = dict[str, Any]
_IN_FORCE = ContextVar("_IN_FORCE", default=False)


@contextmanager
def settings() -> Iterator[None]:
    """Draw under the settings of this module; within itself it changes nothing, and takes no time."""
    if _IN_FORCE.get():
        yield
        return
    with _style():
        before = _IN_FORCE.set(True)
        try:
            yield
        finally:
            _IN_FORCE.reset(before)


def _style() -> AbstractContextManager[None]:
    # A shell inside a notebook hands on a backend with which matplotlib cannot be imported where that is not installed.
    # None is asked for: every figure has a canvas of its own.
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        from matplotlib import style
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    return style.context(["default", SETTINGS])


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Return `draw` run under the settings of this module."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with settings():
            return draw(*args, **kwargs)

    return drawn


def plain(text: str, width: int = 200) -> str:
    """Return `text` as drawn letter by letter: names out of a file are no mathematics."""
    return shortened(text, width).replace("$", r"\$")


def fix_places(figure: Figure) -> Figure:
    """Return the figure with its axes fixed where the layout engine places them, to a millionth of the page.

    The solver behind the engine is free in the last digits, on which the names of clip paths in an SVG depend.
    """
    engine = figure.get_layout_engine()
    if engine is None:
        return figure
    engine.execute(figure)
    with settings():  # no engine at all: "none" would leave a place holder, for which every file is drawn twice
        figure.set_layout_engine(None)
    for axes in figure.axes:
        left, bottom, width, height = (round(float(x), 6) for x in axes.get_position(original=True).bounds)
        axes.set_position((left, bottom, width, height))
    _fix_labels(figure)
    return figure


def _fix_labels(figure: Figure) -> None:
    """Fix the labels of all axes where they are placed, those of the y axes of a column in line where they have room.

    Left to `align_ylabels`, whoever draws or measures the figure measures the ticks of each panel for every other.
    """
    from matplotlib.transforms import blended_transform_factory

    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    columns: dict[object, list[tuple[Axes, float, float]]] = {}
    # A colour bar finds its place when it is drawn, beside its map.
    for axes in (axes for axes in figure.axes if axes.get_axes_locator() is None):
        for axis in (axes.xaxis, axes.yaxis):
            axis.get_tightbbox(renderer)  # which places its label
        below = blended_transform_factory(axes.transAxes, figure.transFigure)
        axes.xaxis.set_label_coords(0.5, axes.xaxis.label.get_position()[1] / figure.bbox.height, transform=below)
        spec, label = axes.get_subplotspec(), axes.yaxis.label
        if label.get_text():
            placed = axes, label.get_position()[0], label.get_window_extent(renderer).x0
            columns.setdefault(axes if spec is None else spec.colspan.start, []).append(placed)
    for placed_labels in columns.values():
        line, edge = (min(values) for values in list(zip(*placed_labels, strict=True))[1:])
        for axes, x, left in placed_labels:
            beside = blended_transform_factory(figure.transFigure, axes.transAxes)
            axes.yaxis.set_label_coords(max(line, edge + x - left) / figure.bbox.width, 0.5, transform=beside)


def to_svg(figure: Figure) -> bytes:
    """Return the figure as SVG, letters as outlines; the same figure always gives the same bytes."""
    with settings():
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
        return file.getvalue()


def to_png(figure: Figure) -> bytes:
    """Return the figure as PNG at 150 dots per inch."""
    with settings():
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=PNG_DPI, metadata={"Software": None})
        return file.getvalue()
