"""Slow faults that no single flight shows: the constant error of a relation over the flights of an aircraft."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..kernels.monotone_trend import monotone_trend
from ..report.content import Drawing, Panel, curve
from .answers import LogAnswer

# Chance with which any trend of an aircraft is declared that is none; shared by its channels, and of a channel by the
# relations that imply it (Bonferroni, weighted).
FALSE_ALARM = 0.05
# Flights of which a trend is told: of seven the best order has a chance of 0.0004, of five 0.02.
FEWEST_FLIGHTS = 7
MOST_PANELS = 12  # trends that are drawn: more is no glance


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTrend:
    """The constant error of a channel by the same others over the flights of an aircraft.

    Attributes
    ----------
    aircraft, channel, by, unit : see `bfi_cli.flight.plausibility.constants.ConstantError`.
    values, low, high : of each flight, in order of time, with its 95 % interval.
    slope, ci95, level : per flight, with its 95 % interval, and the line at the first flight.
    p_value : of no trend; is_declared : whether that is less than the share of the relation in `FALSE_ALARM`.
    """

    aircraft: str
    channel: str
    by: str
    unit: str
    values: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    slope: float
    ci95: tuple[float, float]
    level: float
    p_value: float
    is_declared: bool = False


def trends_of(answers: Iterable[LogAnswer]) -> tuple[FleetTrend, ...]:
    """Return the trends of every aircraft, the least likely to be none first.

    Flights are in order of their clocks where all of an aircraft have one with a day, else in the order given.
    """
    by_aircraft: dict[str, list[LogAnswer]] = {}
    for answer in answers:
        if answer.aircraft and not answer.error:
            by_aircraft.setdefault(answer.aircraft, []).append(answer)
    trends = [trend for name, flights in by_aircraft.items() for trend in _trends_of(name, flights)]
    return tuple(sorted(trends, key=lambda trend: trend.p_value))


def _trends_of(aircraft: str, flights: Sequence[LogAnswer]) -> list[FleetTrend]:
    if all(answer.flight.get("since_1970_s") is not None for answer in flights):
        flights = sorted(flights, key=lambda answer: float(answer.flight["since_1970_s"]))
    courses: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for flight in flights:
        for row in flight.constants:
            courses.setdefault((row["channel"], row["by"], row["unit"]), []).append(row)
    trends = []
    for (channel, by, unit), rows in courses.items():
        if len(rows) < FEWEST_FLIGHTS:
            continue
        values, low, high = (tuple(float(row[key]) for row in rows) for key in ("value", "low", "high"))
        trend = monotone_trend(np.array(values), rng=np.random.default_rng(0))
        trends.append(
            FleetTrend(
                aircraft=aircraft,
                channel=channel,
                by=by,
                unit=unit,
                values=values,
                low=low,
                high=high,
                slope=trend.slope,
                ci95=trend.ci95,
                level=trend.level,
                p_value=trend.p_value,
            )
        )
    relations = Counter(trend.channel for trend in trends)
    return [
        replace(trend, is_declared=trend.p_value < FALSE_ALARM / (len(relations) * relations[trend.channel]))
        for trend in trends
    ]


def trend_rows(trends: Iterable[FleetTrend]) -> list[dict[str, Any]]:
    """Return the rows of the table `trends`."""
    same = ("aircraft", "channel", "by", "unit", "slope", "p_value")
    return [
        {
            **{key: getattr(trend, key) for key in same},
            "n_flights": len(trend.values),
            "declared": trend.is_declared,
            "low": trend.ci95[0],
            "high": trend.ci95[1],
            "first": trend.level,
            "last": trend.level + trend.slope * (len(trend.values) - 1),
        }
        for trend in trends
    ]


def sentence_of_trend(trend: FleetTrend) -> str:
    """Return a trend in words: "tas by circles changes by 0.05 m/s a flight (0.04 to 0.06) over 40 flights"."""
    low, high = trend.ci95
    n = len(trend.values)
    what = f"{trend.channel} by {trend.by} changes by {trend.slope:.3g} {trend.unit} a flight"
    return f"{what} ({low:.3g} to {high:.3g}) over {n} flights, {trend.slope * (n - 1):.3g} {trend.unit} in all"


def trend_drawing(trends: Sequence[FleetTrend]) -> Drawing | None:
    """Return the figure of the trends that are declared, None without one."""
    declared = [trend for trend in trends if trend.is_declared][:MOST_PANELS]
    if not declared:
        return None
    panels = []
    for trend in declared:
        number = np.arange(1, len(trend.values) + 1, dtype=np.float64)
        values, low, high = (np.array(ends) for ends in (trend.values, trend.low, trend.high))
        line = trend.level + trend.slope * (number - 1.0)
        slope = f"{trend.slope:.3g} {trend.unit} a flight ({trend.ci95[0]:.3g} to {trend.ci95[1]:.3g})"
        panels.append(
            Panel(
                x_label="flight",
                y_label=f"{trend.channel} by {trend.by}\n[{trend.unit}]",
                title=f"{trend.aircraft}: {slope}",
                curves=(
                    curve("each flight, 95 %", number, values, low=low, high=high, style="points"),
                    curve("trend", number, line, style="dashed"),
                ),
            )
        )
    caption = (
        "Constant errors that change from flight to flight: a channel less what others imply of it, over the flights "
        "of an aircraft in order of time."
    )
    return Drawing(name="trends", caption=caption, panels=tuple(panels))
