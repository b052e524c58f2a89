"""How a sweep is drawn and tabulated: rates with Wilson intervals, errors with their quartiles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..exhibit import Curve, Panel, Table, curve
from ..montecarlo import wilson
from ..montecarlo.summary import Proportion
from ..wording import number
from .sweep import Cell, Swept

__all__ = ["error_panel", "isolation_panel", "noise_words", "percent", "pooled", "rate_curve", "rates_table"]

LEAST_ERROR = 1e-16
SPREAD = 0.06
HEADS = ("method", "noise m/s", "active", "isolated %", "false alarms %", "missed %", "median error")


def percent(share: Proportion) -> str:
    """Return "96 % (90 to 98)", the rate with its 95 % Wilson interval."""
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} % ({low:.0f} to {high:.0f})"


def noise_words(noise: float) -> str:
    """Return "no noise", or "noise 0.01 m/s"."""
    return f"noise {noise:g} m/s" if noise else "no noise"


def pooled(cells: Sequence[Cell]) -> Proportion:
    """Return how many of all trials of several cells are isolated."""
    count, of = (sum(getattr(cell.summary.isolation, key) for cell in cells) for key in ("count", "of"))
    return Proportion(count=count, of=of, rate=count / of if of else None, ci95=wilson(count, of))


def rates_table(swept: Swept, labels: Mapping[str, str]) -> Table:
    """Return a row per cell, methods by their `labels`."""
    rows = []
    for cell in swept.cells:
        one = cell.summary
        rates = (one.isolation, one.false_alarm, one.missed_detection)
        which = (labels[cell.method], f"{cell.noise:g}", str(cell.active))
        rows.append((*which, *map(_bare, rates), number(one.magnitude_error.get("p50"), digits=2)))
    return Table(name="rates", title="Every point, with 95 % Wilson intervals", heads=HEADS, rows=tuple(rows))


def _bare(share: Proportion) -> str:
    """Return "96 (90-98)", in %."""
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} ({low:.0f}-{high:.0f})"


def error_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return median magnitude error against the number of active faults, quartiles as bars."""
    curves = tuple(
        _curve(labels[method], swept.of(method, noise), aside=_aside(i, len(labels)))
        for i, method in enumerate(labels)
        if swept.of(method, noise)
    )
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="relative magnitude error [-]",
        curves=curves,
        log_y=True,
    )


def _aside(place: int, places: int) -> float:
    """Return how far points of one method stand aside, so that they do not hide those of another."""
    return SPREAD * (place - 0.5 * (places - 1))


def _curve(label: str, cells: Sequence[Cell], *, aside: float) -> Curve:
    at = [cell.active + aside for cell in cells]
    quartile = {key: [_floored(cell, key) for cell in cells] for key in ("p25", "p50", "p75")}
    return curve(label, at, quartile["p50"], style="points", low=quartile["p25"], high=quartile["p75"])


def isolation_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return the isolation rate against the number of active faults, with Wilson intervals."""
    curves = []
    for i, (method, label) in enumerate(labels.items()):
        cells = swept.of(method, noise)
        at = [cell.active + _aside(i, len(labels)) for cell in cells]
        curves.append(rate_curve(label, at, [cell.summary.isolation for cell in cells]))
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="isolated [%]",
        curves=tuple(curves),
        y_limits=(-3.0, 103.0),
    )


def rate_curve(label: str, x: Sequence[float], shares: Sequence[Proportion]) -> Curve:
    """Return rates in % with their intervals as bars."""
    ends = [share.ci95 or (math.nan, math.nan) for share in shares]
    return curve(
        label,
        x,
        [100.0 * (math.nan if share.rate is None else share.rate) for share in shares],
        style="bars",
        low=[100.0 * low for low, _ in ends],
        high=[100.0 * high for _, high in ends],
    )


def _floored(cell: Cell, key: str) -> float:
    """Return a quantile of the error as a log axis can show it."""
    return float(np.maximum(cell.summary.magnitude_error.get(key, math.nan), LEAST_ERROR))
