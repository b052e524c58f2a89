"""What a sweep of several methods shows of each: a table at one rate of false alarms, and how often each is right."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...quantities.text import number
from ...report.content import Curve, Drawing, Panel, Table, curve
from .counts import ScenarioSummary, curve_of_shares, proportion, share_cell

TABLES, DRAWINGS = ("equal_rate", "isolated", "own_threshold"), ("detection", "rates")
# Methods of a panel: that many can be told apart by colour and marker.
MOST_CURVES = 6
# Part of the way from one fault to the next over which the methods stand side by side.
SPREAD = 0.7
DETECTION_CAPTION = (
    "Share of the trials in which the score of a method is beyond its threshold, by fault, with 95 % Wilson intervals; "
    "the threshold of every method is that which trials without a fault exceed equally seldom. Methods are drawn side "
    "by side."
)
RATES_CAPTION = (
    "What each method declares by its own threshold: trials with a fault in which it declares one, of all faults, "
    "against trials without a fault in which it does, with 95 % Wilson intervals."
)


def comparison_tables(scenarios: Sequence[ScenarioSummary]) -> tuple[Table, ...]:
    """Return the tables of a sweep of methods: a row per method, a column per fault."""
    rows = _by_method(scenarios)
    faults = list(dict.fromkeys(_fault(scenario) for scenario in scenarios))
    equal = next((scenario.equal_rate for scenario in scenarios if scenario.equal_rate), None)
    tables = []
    if equal is not None:
        percent = number(100.0 * equal.false_alarm)
        title = f"Detected, % of the trials, at false alarms in {percent} % of those without a fault"
        heads = ("method", "false alarms", *(fault for fault in faults if fault != "none"))
        cells = []
        for method, of in rows.items():
            rates = {fault: scenario.equal_rate for fault, scenario in of.items() if scenario.equal_rate}
            detected = {fault: rate.detected for fault, rate in rates.items()}
            alarms = next((rate.alarms for rate in rates.values()), None)
            cells.append((method, share_cell(alarms), *(share_cell(detected.get(fault)) for fault in heads[2:])))
        tables.append(Table(name="equal_rate", title=title, heads=heads, rows=tuple(cells)))
    isolated = {method: {fault: s.isolation_rate for fault, s in of.items()} for method, of in rows.items()}
    declared = {method: {fault: s.decisions["fault"] for fault, s in of.items()} for method, of in rows.items()}
    for name, shares, title in (
        ("isolated", isolated, "Named with channel and kind and nothing else, % of the trials"),
        ("own_threshold", declared, "Declared by the method's own threshold, % of the trials"),
    ):
        body = tuple((method, *(share_cell(of.get(fault)) for fault in faults)) for method, of in shares.items())
        tables.append(Table(name=name, title=title, heads=("method", *faults), rows=body))
    return tuple(tables)


def comparison_drawings(scenarios: Sequence[ScenarioSummary]) -> tuple[Drawing, ...]:
    """Return the figures of a sweep of methods."""
    rows = _by_method(scenarios)
    faults = [fault for fault in dict.fromkeys(_fault(scenario) for scenario in scenarios) if fault != "none"]
    ticks = tuple((fault, float(k)) for k, fault in enumerate(faults))
    shares = {
        method: [
            (k, rate.detected)
            for k, fault in enumerate(faults)
            if fault in of and (rate := of[fault].equal_rate) and rate.detected.rate is not None
        ]
        for method, of in rows.items()
    }
    shares = {method: of for method, of in shares.items() if of}
    aside = SPREAD / _per_panel(len(shares)) if shares else 0.0
    detection = [
        curve_of_shares(
            method,
            [k + aside * (n % _per_panel(len(shares)) + 0.5) - 0.5 * SPREAD for k, _ in of],
            [share for _, share in of],
            style="points",
        )
        for n, (method, of) in enumerate(shares.items())
    ]
    rates = [_rates(method, of, faults) for method, of in rows.items() if "none" in of and faults]
    fault_axis = {
        "x_label": "fault",
        "y_label": "detected [%]",
        "x_ticks": ticks,
        "x_limits": (-0.5, len(faults) - 0.5),
    }
    rate_axis = {"x_label": "false alarms [%]", "y_label": "declared, all faults [%]", "x_limits": (-3.0, 103.0)}
    return (
        *_drawing("detection", DETECTION_CAPTION, detection, fault_axis),
        *_drawing("rates", RATES_CAPTION, rates, rate_axis),
    )


def _drawing(name: str, caption: str, curves: Sequence[Curve], axis: Mapping[str, Any]) -> tuple[Drawing, ...]:
    """Return a figure with as many panels as it takes to tell the methods apart; none without curves."""
    size = _per_panel(len(curves))
    parts = [tuple(curves[k : k + size]) for k in range(0, len(curves), size)]
    panels = tuple(Panel(**axis, curves=part, y_limits=(-3.0, 103.0)) for part in parts)
    return (Drawing(name=name, caption=caption, panels=panels),) if panels else ()


def _per_panel(n: int) -> int:
    """Return how many of n methods a panel has: panels as full as each other, and no more than can be told apart."""
    return math.ceil(n / math.ceil(n / MOST_CURVES)) if n else 1


def _rates(method: str, of: Mapping[str, ScenarioSummary], faults: Sequence[str]) -> Curve:
    """Return the point of a method: false alarms with their interval, and what it declares of all faults."""
    without, declared = of["none"].decisions["fault"], [of[fault].decisions["fault"] for fault in faults if fault in of]
    every = proportion(sum(share.count for share in declared), sum(share.of for share in declared))
    low, high = without.ci95 or (math.nan, math.nan)
    x, y = (100.0 * (math.nan if share.rate is None else share.rate) for share in (without, every))
    return curve(method, [x], [y], style="intervals", low=[100.0 * low], high=[100.0 * high])


def _fault(scenario: ScenarioSummary) -> str:
    """Return what faults a scenario has, and what else it varies beside the method."""
    words = [word for word in scenario.name.split(" ") if not word.startswith("compare=")]
    return " ".join(word.removeprefix("inject=") for word in words) or "all"


def _by_method(scenarios: Sequence[ScenarioSummary]) -> dict[str, dict[str, ScenarioSummary]]:
    """Return the scenarios by method, then by fault."""
    rows: dict[str, dict[str, ScenarioSummary]] = {}
    for scenario in scenarios:
        rows.setdefault(str(scenario.axes["compare"]), {})[_fault(scenario)] = scenario
    return rows
