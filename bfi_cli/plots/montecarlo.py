"""Figures of a sweep: isolation rate and magnitude error of its scenarios, as the thesis's figures 5-4 and 5-3."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, Look, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..montecarlo import Summary
    from ..montecarlo.summary import ScenarioSummary

__all__ = ["MONTECARLO_FIGURES", "plot_isolation", "plot_magnitude_error"]

PANEL_IN = 2.4
LOOKS: tuple[Look, ...] = (
    {"color": BLUE, "ls": "-", "marker": "o"},
    {"color": VERMILLION, "ls": "--", "marker": "s"},
    {"color": GREEN, "ls": "-.", "marker": "^"},
    {"color": ORANGE, "ls": ":", "marker": "D"},
    {"color": SKY, "ls": "-", "marker": "v"},
    {"color": BLACK, "ls": "--", "marker": "x"},
)
NAME_LETTERS = 44
MOST_CURVES = len(LOOKS)
SPREAD = 0.6
IN_ONE_LINE, LINE_IN = 2, 0.17
FLOOR = 1e-16
Curves = Mapping[str, Sequence["ScenarioSummary"]]


@styled
def plot_isolation(summary: Summary) -> Figure:
    """Draw the share of trials with the right faults against their number, with 95 % Wilson intervals."""
    curves = _curves(summary)
    figure, axes = _panel("trials with exactly the right faults [%]", curves)
    for look, shift, (name, scenarios) in zip(LOOKS, _shifts(curves), curves.items(), strict=False):
        active = [scenario.axes["active"] + shift for scenario in scenarios]
        rates = 100.0 * np.array([scenario.isolation.rate for scenario in scenarios], dtype=np.float64)
        ends = 100.0 * np.array([scenario.isolation.ci95 or (np.nan, np.nan) for scenario in scenarios])
        bars = np.abs(ends.T - rates)
        axes.errorbar(active, rates, bars, label=plain(name, NAME_LETTERS), capsize=2.0, ms=4.0, lw=1.1, **look)
    axes.set_ylim(-3.0, 103.0)
    _finish(axes, summary, curves)
    return figure


@styled
def plot_magnitude_error(summary: Summary) -> Figure:
    """Draw quartiles, 5 and 95 % whiskers and median of the relative magnitude error against the number of faults."""
    curves = _curves(summary)
    figure, axes = _panel("magnitude error, relative [-]", curves)
    errors = _errors(summary)
    width = 0.7 * SPREAD / max(len(curves), 1)
    for look, shift, (name, scenarios) in zip(LOOKS, _shifts(curves), curves.items(), strict=False):
        drawn = [scenario for scenario in scenarios if errors.get(scenario.name)]
        line: dict[str, Any] = {"color": look["color"], "ls": look["ls"], "lw": 0.9}
        if drawn:
            axes.boxplot(
                [errors[scenario.name] for scenario in drawn],
                positions=[scenario.axes["active"] + shift for scenario in drawn],
                widths=width,
                whis=(5, 95),
                manage_ticks=False,
                boxprops=line,
                whiskerprops=line,
                capprops=line | {"ls": "-"},
                medianprops={"color": look["color"], "lw": 1.6},
                flierprops={"marker": look["marker"], "ms": 2.0, "mec": look["color"], "mfc": "none", "mew": 0.4},
            )
            axes.plot([], [], label=plain(name, NAME_LETTERS), **line)
    axes.set_yscale("log")
    _finish(axes, summary, curves)
    return figure


MONTECARLO_FIGURES = {"isolation": plot_isolation, "magnitude_error": plot_magnitude_error}


def _panel(label: str, curves: Curves) -> tuple[Figure, Axes]:
    """Return the figure and its panel, with room above for a legend of several lines."""
    lines = -(-min(len(curves), MOST_CURVES) // IN_ONE_LINE)
    figure, grid = page([LINE_IN * (lines - 1), PANEL_IN] if lines > 1 else [PANEL_IN], gap_in=0.0)
    axes = figure.add_subplot(grid[-1, 0])
    axes.set_xlabel("number of active faults [-]")
    axes.set_ylabel(label)
    return figure, axes


def _curves(summary: Summary) -> Curves:
    """Return scenarios that differ in the number of active faults only, by what they are called without it."""
    curves: dict[str, list[ScenarioSummary]] = {}
    for scenario in summary.scenarios:
        words = [word for word in scenario.name.split(" ") if not word.startswith("active=")]
        curves.setdefault(" ".join(words) or "all trials", []).append(scenario)
    return curves


def _shifts(curves: Curves) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Side by side around the whole number, so that no curve hides another."""
    n = min(len(curves), MOST_CURVES)
    return np.zeros(1) if n == 1 else SPREAD * (np.arange(n) / n - 0.5 * (n - 1) / n)


def _errors(summary: Summary) -> dict[str, list[float]]:
    errors: dict[str, list[float]] = {}
    for row in summary.rows:
        if row.magnitude_error is not None:
            errors.setdefault(row.scenario, []).append(max(row.magnitude_error, FLOOR))
    return errors


def _finish(axes: Axes, summary: Summary, curves: Curves) -> None:
    active = sorted({scenario.axes["active"] for scenario in summary.scenarios})
    axes.set_xticks(active, labels=[str(n) for n in active])
    axes.set_xlim(active[0] - 0.5, active[-1] + 0.5)
    if not axes.get_legend_handles_labels()[0]:
        axes.text(0.5, 0.5, "nothing to compare", transform=axes.transAxes, ha="center", color=GREY)
    else:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=IN_ONE_LINE, borderaxespad=0.1, handlelength=2.4)
    if len(curves) > MOST_CURVES:
        left = f"{len(curves) - MOST_CURVES} more curves in summary.json"
        axes.text(1.0, 1.01, left, transform=axes.transAxes, ha="right", va="bottom", color=GREY)
