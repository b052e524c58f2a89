"""One-step residuals: the final model beside the plain test of the fault-free model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..wording import axis_label, number
from .signals import draw_line
from .style import BLACK, BLUE, SKY, VERMILLION, Look, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..identify.result import IdentifyResult, OutputSeries, ResidualSummary

__all__ = ["plot_residuals"]

PANEL_IN = 0.95


@styled
def plot_residuals(result: IdentifyResult) -> Figure:
    """Draw, per output, the fault-free model's residual with its 5-sigma alarms, the final one, its autocorrelation."""
    summaries = {summary.channel: summary for summary in result.residuals}
    n = len(result.outputs)
    figure, grid = page([PANEL_IN] * (2 * n), widths=(2.3, 1.0), gap_in=0.24)
    for i, series in enumerate(result.outputs):
        over_time = [figure.add_subplot(grid[2 * i + j, 0]) for j in range(2)]
        drawn = over_time
        summary = summaries.get(series.channel)
        _draw_plain(over_time[0], result, series, summary)
        _draw_final(over_time[1], result, series)
        if summary is not None:
            drawn = [*over_time, figure.add_subplot(grid[2 * i : 2 * i + 2, 1])]
            _draw_autocorrelation(drawn[-1], summary)
        over_time[0].tick_params(labelbottom=False)
        _name_below(drawn[1:], last=i == n - 1)
    figure.align_ylabels()
    return figure


def _name_below(panels: Sequence[Axes], *, last: bool) -> None:
    for axes, label in zip(panels, ("time [s]", "lag [samples]"), strict=False):
        axes.tick_params(labelbottom=last)
        axes.set_xlabel(label if last else "")


def _draw_plain(axes: Axes, result: IdentifyResult, series: OutputSeries, summary: ResidualSummary | None) -> None:
    draw_line(axes, result.time_s, series.plain_residual, color=BLACK, lw=0.7)
    title = "fault-free model"
    if summary is not None:
        _draw_alarms(axes, series, summary)
        title += f", {len(summary.plain_alarms_s)} samples beyond ±5 σ"
    _name(axes, result, series, title)


def _draw_alarms(axes: Axes, series: OutputSeries, summary: ResidualSummary) -> None:
    limit = 5.0 * summary.plain_sd
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, color=BLUE, lw=0.9, ls="--")
    peak = float(np.nanmax(np.abs(np.append(series.plain_residual, limit))))
    top = 1.4 * peak if peak > 0.0 else 1.0
    if limit > 0.0 and peak > 3.0 * limit:
        top = _stretch_the_middle(axes, limit, peak)
    axes.set_ylim(-top, top)
    look: Look = {"marker": "v", "s": 18.0, "color": VERMILLION, "lw": 0.0}
    heights = np.full(len(summary.plain_alarms_s), 0.92)
    axes.scatter(summary.plain_alarms_s, heights, transform=axes.get_xaxis_transform(), **look)


def _stretch_the_middle(axes: Axes, limit: float, peak: float) -> float:
    axes.set_yscale("symlog", linthresh=limit, linscale=1.0)
    powers = 10.0 ** np.arange(np.ceil(np.log10(1.5 * limit)), np.floor(np.log10(peak)) + 1.0)
    ticks = [limit, *powers[:: 1 + powers.size // 3]]
    both = [*(-tick for tick in reversed(ticks)), 0.0, *ticks]
    axes.set_yticks(both, labels=[f"{tick:.2g}".replace("-", "−") for tick in both])
    axes.set_yticks([], minor=True)
    return 4.0 * peak


def _draw_final(axes: Axes, result: IdentifyResult, series: OutputSeries) -> None:
    draw_line(axes, result.time_s, series.prediction_error, color=BLACK, lw=0.7)
    _name(axes, result, series, "final model")


def _name(axes: Axes, result: IdentifyResult, series: OutputSeries, title: str) -> None:
    axes.set_title(f"{plain(series.channel, 28)}: {title}", loc="left", pad=2.5)
    axes.set_ylabel(plain(axis_label("residual", series.unit)))
    axes.set_xlim(float(result.time_s[0]), float(result.time_s[-1]))


def _draw_autocorrelation(axes: Axes, summary: ResidualSummary) -> None:
    axes.axhspan(-summary.band, summary.band, color=SKY, alpha=0.35, lw=0.0)
    axes.axhline(0.0, color=BLACK, lw=0.5)
    axes.vlines(summary.lags, 0.0, summary.autocorrelation, color=BLACK, lw=1.2)
    axes.plot(summary.lags, summary.autocorrelation, ls="none", marker="o", ms=2.5, color=BLACK)
    axes.set_title(f"final: whiteness p = {number(summary.ljung_box_p, digits=2)}", loc="left", pad=2.5)
    axes.set_ylabel("autocorrelation [-]", labelpad=1.0)
    reach = max([0.3, *np.abs(summary.autocorrelation)])
    axes.set_ylim(-1.15 * reach, 1.15 * reach)
