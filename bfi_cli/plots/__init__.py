"""Figures of a result: each function takes the result and returns the figure; only this package knows matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .magnitudes import plot_magnitudes
from .orders import plot_orders
from .residuals import plot_residuals
from .signals import plot_fault, plot_outputs
from .style import to_png, to_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..identify.result import IdentifyResult

__all__ = [
    "FIGURES",
    "plot_fault",
    "plot_magnitudes",
    "plot_orders",
    "plot_outputs",
    "plot_residuals",
    "to_png",
    "to_svg",
]

FIGURES: dict[str, Callable[[IdentifyResult], Figure]] = {
    "outputs": plot_outputs,
    "fault": plot_fault,
    "magnitudes": plot_magnitudes,
    "residuals": plot_residuals,
    "orders": plot_orders,
}
