"""Outputs against their prediction, and the reconstructed fault, over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..wording import axis_label, shortened
from .envelope import thinned
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, Look, legend_above, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..identify.result import IdentifyResult, OutputSeries

    FloatArray = NDArray[np.float64]

__all__ = ["draw_line", "plot_fault", "plot_outputs", "time_axis"]

ONE_LINE_LETTERS = 16
OUTPUT_IN, INPUT_IN, FAULT_IN = 1.75, 0.85, 1.9
INPUT_LINES: tuple[Look, ...] = (
    {"color": BLACK, "ls": "-"},
    {"color": BLUE, "ls": "--"},
    {"color": VERMILLION, "ls": ":"},
    {"color": GREEN, "ls": "-."},
)


@styled
def plot_outputs(result: IdentifyResult) -> Figure:
    """Draw each output as measured, corrected for the faults and predicted, the inputs below."""
    groups = _inputs_by_unit(result)
    figure, grid = page([OUTPUT_IN] * len(result.outputs) + [INPUT_IN] * len(groups), gap_in=0.22)
    panels = [figure.add_subplot(grid[row, 0]) for row in range(grid.nrows)]
    for axes, series in zip(panels, result.outputs, strict=False):
        _draw_output(axes, result, series)
    for axes, (unit, names) in zip(panels[len(result.outputs) :], groups, strict=True):
        _draw_inputs(axes, result, names)
        label = axis_label(shortened(names[0], 18) if len(names) == 1 else "inputs", unit)
        axes.set_ylabel(plain(label).replace(" [", "\n[", int(len(label) > ONE_LINE_LETTERS)))
    legend_above(panels[0])
    time_axis(panels, result)
    figure.align_ylabels()
    return figure


def _inputs_by_unit(result: IdentifyResult) -> list[tuple[str, list[str]]]:
    groups: dict[str, list[str]] = {}
    for name in result.inputs:
        groups.setdefault(result.input_units.get(name, ""), []).append(name)
    return list(groups.items())


def _draw_output(axes: Axes, result: IdentifyResult, series: OutputSeries) -> None:
    time_s = result.time_s
    draw_line(axes, time_s, series.measured, color="#b4b4b4", lw=2.4, label="measured")
    draw_line(axes, time_s, series.predicted, color=BLACK, lw=0.8, label="predicted one step ahead")
    if np.any(series.fault):
        draw_line(axes, time_s, series.corrected, color=BLUE, lw=1.1, ls=(0, (4, 1.5)), label="corrected for the fault")
        mark_onsets(axes, result, series.channel)
    axes.set_ylabel(plain(axis_label(series.channel, series.unit)))


def _draw_inputs(axes: Axes, result: IdentifyResult, names: Sequence[str]) -> None:
    for i, name in enumerate(names):
        draw_line(
            axes, result.time_s, result.inputs[name], lw=0.9, label=plain(name), **INPUT_LINES[i % len(INPUT_LINES)]
        )
    if len(names) > 1:
        legend_above(axes)


@styled
def plot_fault(result: IdentifyResult) -> Figure:
    """Draw the reconstructed fault of each output with its 95 % band, and the injected one where it is known."""
    figure, grid = page([FAULT_IN] * len(result.outputs), gap_in=0.2)
    for row, series in enumerate(result.outputs):
        axes = figure.add_subplot(grid[row, 0])
        _draw_fault(axes, result.time_s, series)
        mark_onsets(axes, result, series.channel)
    legend_above(figure.axes[0])
    time_axis(figure.axes, result)
    figure.align_ylabels()
    return figure


def _draw_fault(axes: Axes, time_s: FloatArray, series: OutputSeries) -> None:
    kept = thinned(series.fault)
    half = 1.96 * series.fault_sd[kept]
    band = (series.fault[kept] - half, series.fault[kept] + half)
    axes.fill_between(time_s[kept], *band, color=SKY, alpha=0.55, lw=0.0, label="95 % band")
    if series.true_fault is not None:
        draw_line(axes, time_s, series.true_fault, color=ORANGE, lw=2.2, label="injected")
    draw_line(axes, time_s, series.fault, color=BLACK, lw=1.0, ls="--", label="reconstructed")
    axes.set_ylabel(plain(axis_label(f"fault on {series.channel}", series.unit)))
    if not np.any(series.fault):
        _keep_zero_in_the_middle(axes, series)
        look: Look = {"ha": "center", "va": "top", "color": GREY, "bbox": {"fc": "white", "ec": "none"}}
        axes.text(0.5, 0.9, "no fault declared on this channel", transform=axes.transAxes, **look)


def _keep_zero_in_the_middle(axes: Axes, series: OutputSeries) -> None:
    if series.true_fault is None or not np.any(series.true_fault):
        spread = np.nanstd(series.measured)
        axes.set_ylim(*(0.2 * max(float(spread), 1e-6) * np.array([-1.0, 1.0])))


def mark_onsets(axes: Axes, result: IdentifyResult, channel: str) -> None:
    """Draw a thin vertical line where each fault of `channel` starts and ends, if that is inside the window."""
    for estimate in result.faults:
        if estimate.fault.channel == channel:
            for moment in (estimate.fault.onset_s, estimate.fault.offset_s):
                if moment is not None and result.log.start_s < moment < result.log.stop_s:
                    axes.axvline(moment, color=VERMILLION, lw=0.8, ls=(0, (1, 1.5)))


def draw_line(axes: Axes, time_s: FloatArray, values: FloatArray, **look: Any) -> None:
    """Draw a signal over time, thinned to what the paper shows."""
    kept = thinned(values)
    axes.plot(time_s[kept], values[kept], **look)


def time_axis(panels: Sequence[Axes], result: IdentifyResult) -> None:
    """Name the time axis of the lowest panel and give all panels the analysed window."""
    for axes in panels:
        axes.set_xlim(float(result.time_s[0]), float(result.time_s[-1]))
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[-1].set_xlabel("time [s]")
