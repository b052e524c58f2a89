"""The document of a sweep, `summary.json`, and what its report holds: rates, and the figures 5-4 and 5-3 of T."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..notes import unique
from ..provenance import Provenance
from ..report.content import Curve, Drawing, Panel, ReportContent, Table, curve, notes_of
from ..report.text import counted, number
from ..serialization import SCHEMA, to_plain
from .summary import DECISIONS, QUANTILES, Summary

Plain = Mapping[str, Any]

DRAWINGS, TABLES = ("isolation", "magnitude_error"), ("scenarios", "decisions", "trials", "timings")
HEADS = ("scenario", "isolated, %", "trials", "false alarms, %", "missed, %", "coverage, %", "median error")
DECISION_HEADS = ("scenario", "fault, %", "no fault, %", "inconclusive, %", "beyond tolerance", "wrong no fault, %")
# Curves that can be told apart by colour and marker; the others are in the table.
MOST_CURVES = 6
# Part of the way from one number of faults to the next over which the curves stand side by side.
SPREAD = 0.6
# What is drawn of an error of 0 on a logarithmic axis: round-off.
FLOOR = 1e-16
ISOLATION_CAPTION = (
    "Share of the trials whose declared faults are exactly those added, against the number of faults in the record, "
    "with 95 % Wilson intervals. Curves are drawn side by side around the whole number."
)
ERROR_CAPTION = (
    "Relative error of the magnitudes (2-norm of estimate less truth over that of the truth) of the trials with "
    "faults: median, quartiles, 5 and 95 % quantiles, and the largest."
)


def summary_document(summary: Summary, provenance: Provenance, *, digest: str) -> dict[str, Any]:
    """Return the document of `bfi montecarlo --json`, which is `summary.json`.

    Parameters
    ----------
    digest : of the sweep and its records, by which --resume knows its own.
    """
    return {
        "kind": "montecarlo",
        "schema": SCHEMA,
        "digest": digest,
        "scenarios": to_plain(summary.scenarios),
        "notes": to_plain(unique(summary.notes)),
        "provenance": to_plain(provenance),
    }


def montecarlo_content(document: Plain) -> ReportContent:
    """Return what the report of a document of `bfi montecarlo` holds."""
    scenarios = document["scenarios"]
    curves: dict[str, list[Plain]] = {}
    for scenario in scenarios:
        words = [word for word in scenario["name"].split(" ") if not word.startswith("active=")]
        curves.setdefault(" ".join(words) or "all trials", []).append(scenario)
    active = sorted({int(scenario["axes"]["active"]) for scenario in scenarios})
    trials = sum(scenario["trials"] for scenario in scenarios)
    left = f"first {MOST_CURVES} of {len(curves)} curves" if len(curves) > MOST_CURVES else ""
    axis: dict[str, Any] = {
        "title": left,
        "x_label": "number of active faults [-]",
        "x_ticks": tuple((str(n), float(n)) for n in active),
        "x_limits": (active[0] - 0.5, active[-1] + 0.5),
        "height": 1.2,
    }
    rates = Panel(
        **axis, y_label="isolated exactly [%]", y_limits=(-3.0, 103.0), curves=tuple(_side_by_side(curves, _rates))
    )
    errors = tuple(one for one in _side_by_side(curves, _errors) if one.x.size)
    rows, decisions = [], []
    for one in scenarios:
        shares = [_percent(one[f"{key}_rate"]) for key in ("isolation", "false_alarm", "missed_detection")]
        error = number((one["magnitude_error"] or {}).get("p50"), digits=2)
        rows.append((one["name"], shares[0], str(one["trials"]), *shares[1:], _percent(one["coverage"]), error))
        shares = [_percent(one["decisions"][key]) for key in DECISIONS]
        wrong = one["wrong_no_fault_rate"]
        decisions.append((one["name"], *shares, str(wrong["of"]), _percent(wrong)))
    return ReportContent(
        category="Monte Carlo sweep",
        title=str(document["provenance"]["command"]),
        heading=counted(len(scenarios), "scenario"),
        verdict=f"{counted(trials, 'trial')} of {counted(len(scenarios), 'scenario')}; "
        "rates in % with their 95 % Wilson intervals.",
        tables=(
            Table(name="scenarios", title="Scenarios", heads=HEADS, rows=tuple(rows)),
            Table(
                name="decisions",
                title="Decisions, and no fault said of the kind of a fault that is beyond the tolerance",
                heads=DECISION_HEADS,
                rows=tuple(decisions),
            ),
        ),
        drawings=(
            Drawing(name="isolation", caption=ISOLATION_CAPTION, panels=(rates,)),
            Drawing(
                name="magnitude_error",
                caption=ERROR_CAPTION,
                panels=(Panel(**axis, y_label="magnitude error, relative [-]", log_y=bool(errors), curves=errors),),
            ),
        ),
        notes=notes_of(document),
    )


def _percent(share: Plain) -> str:
    if share["rate"] is None or share["ci95"] is None:
        return "-"
    low, high = (number(100.0 * end, digits=3) for end in share["ci95"])
    return f"{number(100.0 * share['rate'], digits=3)} ({low}-{high})"


def _side_by_side(curves: Mapping[str, Sequence[Plain]], draw: Any) -> list[Curve]:
    """Return the first curves, each beside the whole number so that none hides another."""
    n = min(len(curves), MOST_CURVES)
    shifts = SPREAD * (np.arange(n) - 0.5 * (n - 1)) / n
    return [
        draw("" if name == "all trials" else name, scenarios, float(shift))
        for shift, (name, scenarios) in zip(shifts, curves.items(), strict=False)
    ]


def _rates(name: str, scenarios: Sequence[Plain], shift: float) -> Curve:
    shares = [scenario["isolation_rate"] for scenario in scenarios]
    ends = 100.0 * np.array([share["ci95"] or (math.nan, math.nan) for share in shares]).reshape(-1, 2)
    rates = 100.0 * np.array([share["rate"] for share in shares], dtype=np.float64)
    active = [scenario["axes"]["active"] + shift for scenario in scenarios]
    return curve(name, active, rates, style="bars", low=ends[:, 0], high=ends[:, 1])


def _errors(name: str, scenarios: Sequence[Plain], shift: float) -> Curve:
    known = [scenario for scenario in scenarios if scenario["magnitude_error"]]
    active = np.repeat([float(scenario["axes"]["active"]) + shift for scenario in known], len(QUANTILES))
    errors = [max(scenario["magnitude_error"][key], FLOOR) for scenario in known for key in QUANTILES]
    return curve(name, active, errors, style="boxes")
