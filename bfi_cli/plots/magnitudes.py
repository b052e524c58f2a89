"""Magnitudes of all dictionary entries beside what could have been found, whatever their units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..wording import number, quantity
from .style import BLUE, GREY, Look, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..identify.result import Candidate, IdentifyResult

__all__ = ["MAX_ROWS", "plot_magnitudes", "shown_candidates"]

MAX_ROWS = 30
ROW_IN = 0.21


@styled
def plot_magnitudes(result: IdentifyResult) -> Figure:
    """Draw each magnitude in units of its own minimal detectable one, with 95 % interval, and the numbers beside it.

    A dictionary of more than `MAX_ROWS` entries is cut to the active and the most conspicuous ones.
    """
    candidates = shown_candidates(result)
    height = ROW_IN * _rows(candidates)
    figure, grid = page([height], widths=(1.0, 1.15), left_in=1.55, column_gap_in=0.05)
    axes, numbers = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    _scale(axes, candidates)
    for row, candidate in enumerate(candidates):
        _draw_candidate(axes, row, candidate)
    _write_numbers(numbers, candidates)
    if len(candidates) < len(result.candidates):
        axes.set_title(f"{len(candidates)} most conspicuous of {len(result.candidates)} entries", loc="left", pad=5.0)
    return figure


def shown_candidates(result: IdentifyResult) -> tuple[Candidate, ...]:
    """Return the dictionary entries the figure has room for, in the order of the dictionary."""
    ranked = sorted(result.candidates, key=lambda one: (not one.active, -abs(_ratio(one) or 0.0)))
    kept = {id(candidate) for candidate in ranked[:MAX_ROWS]}
    return tuple(candidate for candidate in result.candidates if id(candidate) in kept)


def _rows(candidates: Sequence[Candidate]) -> int:
    return max(len(candidates), 4)


def _ratio(candidate: Candidate) -> float | None:
    limit = candidate.minimal_detectable
    if candidate.magnitude is None or limit is None or not limit > 0.0:
        return None
    ratio = candidate.magnitude / limit
    return ratio if math.isfinite(ratio) else None


def _scale(axes: Axes, candidates: Sequence[Candidate]) -> None:
    reach = max([2.0, *(abs(_ratio(candidate) or 0.0) for candidate in candidates)])
    decades = math.ceil(math.log10(2.0 * reach))
    powers = [10.0**power for power in range(0, decades + 1, 1 + decades // 4)]
    ticks = [-power for power in reversed(powers)] + [0.0, *powers]
    axes.set_xscale("symlog", linthresh=1.0, linscale=1.0)
    axes.set_xticks(ticks, labels=[f"{tick:g}".replace("-", "−") for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(-2.0 * reach, 2.0 * reach)
    axes.axvspan(-1.0, 1.0, color="#ececec", zorder=0)
    axes.set_xlabel("magnitude / minimal detectable magnitude [-]")
    axes.set_ylabel("dictionary entry")
    axes.set_yticks(range(len(candidates)), labels=[plain(candidate.name, 22) for candidate in candidates])
    axes.set_ylim(_rows(candidates) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)


def _draw_candidate(axes: Axes, row: int, candidate: Candidate) -> None:
    ratio = _ratio(candidate)
    if ratio is None:
        axes.text(0.0, row, "not estimated", ha="center", va="center", color=GREY)
        return
    half = 1.96 * (candidate.sd or 0.0) / (candidate.minimal_detectable or 1.0)
    look: Look = {"color": BLUE, "marker": "s"} if candidate.active else {"color": GREY, "marker": "o", "mfc": "white"}
    axes.errorbar(ratio, row, xerr=half, ms=4.5, lw=1.2, capsize=2.5, **look)


def _write_numbers(axes: Axes, candidates: Sequence[Candidate]) -> None:
    axes.set_axis_off()
    axes.set(xlim=(0.0, 1.0), ylim=(_rows(candidates) - 0.5, -0.5))
    head = -0.5 - 0.1 / ROW_IN
    columns = (0.03, 0.66)
    for x, title in zip(columns, ("magnitude ± 95 % interval", "min. detectable"), strict=True):
        axes.text(x, head, title, va="bottom", color=GREY)
    for row, candidate in enumerate(candidates):
        look: Look = {"va": "center", "color": "black" if candidate.active else GREY}
        axes.text(columns[0], row, plain(_estimate(candidate)), **look)
        axes.text(columns[1], row, plain(quantity(candidate.minimal_detectable, candidate.unit)), **look)


def _estimate(candidate: Candidate) -> str:
    if candidate.magnitude is None:
        return "-"
    half = 1.96 * (candidate.sd or math.nan)
    spread = number(half, spread=half, extra=1)
    return f"{number(candidate.magnitude, spread=half, extra=1)} ± {spread} {candidate.unit}".rstrip()
