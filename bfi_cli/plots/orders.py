"""Order selection: the criterion over the order, without a fault and with the best support."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .style import BLACK, BLUE, GREY, VERMILLION, Look, legend_above, page, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..identify.result import IdentifyResult

__all__ = ["plot_orders"]

PANEL_IN = 1.9
LINEAR_TO = 10.0


@styled
def plot_orders(result: IdentifyResult) -> Figure:
    """Draw how far the criterion of each order lies above the least of all; the chosen order is ringed."""
    figure, grid = page([PANEL_IN])
    axes = figure.add_subplot(grid[0, 0])
    axes.set_xlabel("model order [samples of lag]")
    axes.set_ylabel("criterion above its least value [-]")
    curves = np.array([result.model.criterion_no_fault, result.model.criterion_best], dtype=np.float64)
    if np.isfinite(curves).any():
        _draw_curves(axes, result, curves - np.nanmin(np.where(np.isfinite(curves), curves, np.nan)))
    else:
        axes.text(0.5, 0.5, "the order was given, not selected", transform=axes.transAxes, ha="center", color=GREY)
        axes.set(xticks=[], yticks=[])
    return figure


def _draw_curves(axes: Axes, result: IdentifyResult, above: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> None:
    orders = result.model.orders
    axes.plot(orders, above[0], color=BLACK, ls="--", marker="o", mfc="white", ms=5.0, lw=1.0, label="no fault")
    axes.plot(orders, above[1], color=BLUE, ls="-", marker="s", ms=4.0, lw=1.2, label="best set of faults")
    if result.model.order in orders:
        chosen = above[:, orders.index(result.model.order)]
        ring: Look = {"ls": "none", "marker": "o", "ms": 11.0, "mfc": "none", "mec": VERMILLION, "mew": 1.3}
        axes.plot([result.model.order], [np.nanmin(chosen)], label="chosen", **ring)
    axes.set_xticks(orders)
    axes.set_yscale("symlog", linthresh=LINEAR_TO)
    top = max(2.0 * float(np.nanmax(above)), LINEAR_TO)
    ticks = [0.0, 5.0, *(10.0**power for power in range(1, int(np.log10(top)) + 1))]
    axes.set_yticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.set_ylim(-1.5, top)
    legend_above(axes)
