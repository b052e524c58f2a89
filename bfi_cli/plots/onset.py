"""The likelihood ratio and the magnitude against the onset, one column per shape (thesis figures 5-14 to 5-16)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .style import BLACK, BLUE, GREY, VERMILLION, legend_above, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..onset import OnsetFault, OnsetResult, ShapeProfile

__all__ = ["plot_profile"]

STATISTIC_IN, MAGNITUDE_IN, BETWEEN_IN = 1.15, 1.15, 0.5
LEAST = 0.1
INSIDE = 1.3


@styled
def plot_profile(result: OnsetResult) -> Figure:
    """Draw statistic and magnitude of every shape over its onset; faults declared are marked, with their interval."""
    n = len(result.profiles)
    figure, grid = page([STATISTIC_IN, MAGNITUDE_IN] * n, gap_in=BETWEEN_IN)
    for row, profile in enumerate(result.profiles):
        top = figure.add_subplot(grid[2 * row, 0])
        bottom = figure.add_subplot(grid[2 * row + 1, 0], sharex=top)
        _draw_statistic(top, profile)
        _draw_magnitude(bottom, profile)
        declared = [one for one in result.faults if one.estimate.fault.shape == profile.shape]
        for axes in (top, bottom):
            for one in declared:
                _mark(axes, one)
        legend_above(top)
    return figure


def _draw_statistic(axes: Axes, profile: ShapeProfile) -> None:
    shape = profile.shape if profile.frequency_hz is None else f"{profile.shape}, {profile.frequency_hz:.4g} Hz"
    statistic = np.maximum(profile.statistic, LEAST)
    axes.plot(profile.onset_s, statistic, color=BLUE, lw=1.0, label=f"{shape} on {plain(profile.channel, 20)}")
    if profile.threshold is not None:
        axes.axhline(max(profile.threshold, LEAST), color=BLACK, ls="--", lw=0.9, label="threshold")
    axes.set_yscale("log")
    axes.set_ylabel("2 log likelihood\nratio [-]")
    axes.set_xlabel("onset [s]")


def _draw_magnitude(axes: Axes, profile: ShapeProfile) -> None:
    sd = np.where(np.isfinite(profile.sd), profile.sd, 0.0)
    low, high = profile.magnitude - 2.0 * sd, profile.magnitude + 2.0 * sd
    axes.fill_between(profile.onset_s, low, high, color=GREY, alpha=0.4, lw=0.0)
    axes.plot(profile.onset_s, profile.magnitude, color=BLUE, lw=1.0)
    best = int(profile.statistic.argmax())
    reach = max(abs(float(profile.magnitude[best])), float(np.quantile(np.abs(profile.magnitude), 0.9)))
    axes.set_ylim(-INSIDE * reach or -1.0, INSIDE * reach or 1.0)
    axes.set_ylabel(f"magnitude\n[{plain(profile.unit) or '-'}]")
    axes.set_xlabel("onset [s]")


def _mark(axes: Axes, one: OnsetFault) -> None:
    axes.axvspan(*one.onset_ci95, color=VERMILLION, alpha=0.25, lw=0.0)
    axes.axvline(one.estimate.fault.onset_s, color=VERMILLION, lw=0.9, ls=":")
