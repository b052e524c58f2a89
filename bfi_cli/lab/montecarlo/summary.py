"""What the trials of each scenario say together, the document of that, `summary.json`, and what its report holds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np

from ...decision import KINDS
from ...faults import Decision
from ...notes import Note, unique
from ...quantities.text import counted, number
from ...report.content import Curve, Drawing, Panel, ReportContent, Table, curve, notes_of
from ...serialization import SCHEMA, Provenance, from_plain, to_plain
from . import comparison
from .comparison import MOST_CURVES, comparison_drawings, comparison_tables
from .counts import EqualRate, Proportion, ScenarioSummary, curve_of_shares, proportion, share_cell
from .scenarios import Sweep
from .trial import Row, rounded

Plain = Mapping[str, Any]

DRAWINGS = ("isolation", "magnitude_error", *comparison.DRAWINGS)
TABLES = ("scenarios", "decisions", "trials", "timings", *comparison.TABLES)
HEADS = ("scenario", "isolated, %", "trials", "false alarms, %", "missed, %", "coverage, %", "median error")
DECISION_HEADS = ("scenario", "fault, %", "no fault, %", "inconclusive, %", "beyond tolerance", "wrong no fault, %")
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
DECISIONS: tuple[Decision, ...] = get_args(Decision)
# Those of a box and its whiskers, and the largest.
QUANTILES = {"p05": 0.05, "p25": 0.25, "p50": 0.5, "p75": 0.75, "p95": 0.95, "max": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Summary:
    """All scenarios, and sentences for the reader."""

    scenarios: tuple[ScenarioSummary, ...]
    notes: tuple[Note, ...]


def summarise(sweep: Sweep, done: Sequence[tuple[Row, float]]) -> Summary:
    """Return the summary of the rows of a sweep and their seconds, in any order."""
    by_name: dict[str, list[tuple[Row, float]]] = {scenario.name: [] for scenario in sweep.scenarios}
    for row, seconds in done:
        by_name[row.scenario].append((row, seconds))
    healthy = {
        _shared_axes(s.axes): _scores(by_name[s.name])
        for s in sweep.scenarios
        if s.n_active == 0 and not s.setting.injected
    }
    scenarios = []
    for s in sweep.scenarios:
        scenario, without = _scenario(s.name, s.axes, by_name[s.name]), healthy.get(_shared_axes(s.axes), [])
        if sweep.false_alarm is not None and without:
            scenario = replace(scenario, equal_rate=equal_rate(_scores(by_name[s.name]), without, sweep.false_alarm))
        scenarios.append(scenario)
    return Summary(scenarios=tuple(scenarios), notes=_failures(scenarios, by_name))


def _failures(
    scenarios: Sequence[ScenarioSummary], by_name: Mapping[str, Sequence[tuple[Row, float]]]
) -> tuple[Note, ...]:
    """Return a note on each reason for which trials failed first in a scenario, with the scenarios."""
    failed: dict[str, list[ScenarioSummary]] = {}
    for scenario in scenarios:
        if scenario.failed:
            failed.setdefault(next(row.error for row, _ in by_name[scenario.name] if row.error), []).append(scenario)
    notes = []
    for first, alike in failed.items():
        count, trials = sum(scenario.failed for scenario in alike), sum(scenario.trials for scenario in alike)
        more = "" if len(alike) == 1 else f" and {len(alike) - 1} other scenarios"
        text = f"{count} of {trials} trials of '{alike[0].name}'{more} failed and count as not isolated"
        notes.append(Note.limit(f"{text}; the first: {first}"))
    return tuple(notes)


def _shared_axes(axes: Mapping[str, Any]) -> str:
    """Return what scenarios have in common that differ in their faults alone."""
    return json.dumps({key: value for key, value in axes.items() if key not in ("inject", "active")}, sort_keys=True)


def _scores(done: Sequence[tuple[Row, float]]) -> list[float]:
    """Return the scores of trials, in their order."""
    rows = sorted((row for row, _ in done), key=lambda row: row.trial)
    return [row.score for row in rows if row.score is not None]


def equal_rate(scores: Sequence[float], healthy: Sequence[float], false_alarm: float) -> EqualRate:
    """Hold scores against those without a fault, of which the first half sets the threshold.

    The threshold is the score of rank (1 - P)(n + 1) of n, which the next healthy one exceeds with a probability of P
    at most, whatever the distribution of continuous scores (Vovk, Gammerman and Shafer 2005, section 2.2).
    """
    half = len(healthy) // 2
    rank = math.ceil((1.0 - false_alarm) * (half + 1) - 1e-9)
    threshold = sorted(healthy[:half])[rank - 1] if rank <= half else None

    def beyond(values: Sequence[float]) -> Proportion:
        return proportion(0, 0) if threshold is None else proportion(sum(x > threshold for x in values), len(values))

    return EqualRate(
        false_alarm=false_alarm, threshold=threshold, alarms=beyond(healthy[half:]), detected=beyond(scores)
    )


def _scenario(name: str, axes: Mapping[str, Any], done: Sequence[tuple[Row, float]]) -> ScenarioSummary:
    rows = [row for row, _ in done]
    analysed = [row for row in rows if row.error is None]
    faulty = [row for row in analysed if row.truth]
    errors = [row.magnitude_error for row in faulty if row.magnitude_error is not None]
    delays = [row.detection_delay_s for row in analysed if row.detection_delay_s is not None]
    onsets = [abs(late) for row in analysed for late in (row.onset_error_s or {}).values()]
    return ScenarioSummary(
        name=name,
        axes=axes,
        trials=len(rows),
        failed=len(rows) - len(analysed),
        isolation_rate=_share(row.isolated for row in rows),
        false_alarm_rate=_share(row.false_alarms for row in analysed),
        missed_detection_rate=_share(row.missed for row in faulty),
        decisions=_shares(row.decision for row in analysed),
        verdicts={kind: _shares(getattr(row, kind) for row in analysed) for kind in KINDS},
        wrong_no_fault_rate=_share(row.wrong_no_fault for row in analysed if row.beyond_tolerance),
        coverage=proportion(sum(row.covered or 0 for row in analysed), sum(row.intervals or 0 for row in analysed)),
        magnitude_error={key: rounded(float(np.quantile(errors, q)), 6) for key, q in QUANTILES.items()}
        if errors
        else None,
        detection_delay_s=float(np.median(delays)) if delays else None,
        onset_error_s=float(np.median(onsets)) if onsets else None,
        seconds=float(np.median([seconds for _, seconds in done])) if done else None,
    )


def _shares(answers: Iterable[str | None]) -> dict[Decision, Proportion]:
    given = [answer for answer in answers if answer is not None]
    return {decision: proportion(given.count(decision), len(given)) for decision in DECISIONS}


def _share(hits: Iterable[object]) -> Proportion:
    flags = [bool(hit) for hit in hits]
    return proportion(sum(flags), len(flags))


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


def montecarlo_content(document: Plain, *, where: str = "result") -> ReportContent:
    """Return what the report of a document of `bfi montecarlo` holds.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    scenarios = from_plain(tuple[ScenarioSummary, ...], document["scenarios"], where=f"{where}: scenarios")
    if all("compare" in scenario.axes for scenario in scenarios):
        return _content(document, scenarios, comparison_tables(scenarios), comparison_drawings(scenarios))
    curves: dict[str, list[ScenarioSummary]] = {}
    for scenario in scenarios:
        words = [word for word in scenario.name.split(" ") if not word.startswith("active=")]
        curves.setdefault(" ".join(words) or "all trials", []).append(scenario)
    active = sorted({int(scenario.axes["active"]) for scenario in scenarios})
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
    errors = tuple(curve for curve in _side_by_side(curves, _errors) if curve.x.size)
    rows, decisions = [], []
    for scenario in scenarios:
        alarms, missed, covered, wrong = (
            share_cell(share, digits=3)
            for share in (
                *(scenario.false_alarm_rate, scenario.missed_detection_rate),
                *(scenario.coverage, scenario.wrong_no_fault_rate),
            )
        )
        error = number((scenario.magnitude_error or {}).get("p50"), digits=2)
        isolated = share_cell(scenario.isolation_rate, digits=3)
        rows.append((scenario.name, isolated, str(scenario.trials), alarms, missed, covered, error))
        shares = [share_cell(scenario.decisions[key], digits=3) for key in DECISIONS]
        decisions.append((scenario.name, *shares, str(scenario.wrong_no_fault_rate.of), wrong))
    tables = (
        Table(name="scenarios", title="Scenarios", heads=HEADS, rows=tuple(rows)),
        Table(
            name="decisions",
            title="Decisions, and no fault said of the kind of a fault that is beyond the tolerance",
            heads=DECISION_HEADS,
            rows=tuple(decisions),
        ),
    )
    magnitudes = Panel(**axis, y_label="magnitude error, relative [-]", log_y=bool(errors), curves=errors)
    drawings = (
        Drawing(name="isolation", caption=ISOLATION_CAPTION, panels=(rates,)),
        Drawing(name="magnitude_error", caption=ERROR_CAPTION, panels=(magnitudes,)),
    )
    return _content(document, scenarios, tables, drawings)


def _content(
    document: Plain,
    scenarios: Sequence[ScenarioSummary],
    tables: tuple[Table, ...],
    drawings: tuple[Drawing, ...],
) -> ReportContent:
    trials = sum(scenario.trials for scenario in scenarios)
    return ReportContent(
        category="Monte Carlo sweep",
        title=str(document["provenance"]["command"]),
        heading=counted(len(scenarios), "scenario"),
        verdict=f"{counted(trials, 'trial')} of {counted(len(scenarios), 'scenario')}; "
        "rates in % with their 95 % Wilson intervals.",
        tables=tables,
        drawings=drawings,
        notes=notes_of(document),
    )


def _side_by_side(curves: Mapping[str, Sequence[ScenarioSummary]], draw: Any) -> list[Curve]:
    """Return the first curves, each beside the whole number so that none hides another."""
    n = min(len(curves), MOST_CURVES)
    shifts = SPREAD * (np.arange(n) - 0.5 * (n - 1)) / n
    return [
        draw("" if name == "all trials" else name, scenarios, float(shift))
        for shift, (name, scenarios) in zip(shifts, curves.items(), strict=False)
    ]


def _rates(name: str, scenarios: Sequence[ScenarioSummary], shift: float) -> Curve:
    active = [scenario.axes["active"] + shift for scenario in scenarios]
    return curve_of_shares(name, active, [scenario.isolation_rate for scenario in scenarios], style="bars")


def _errors(name: str, scenarios: Sequence[ScenarioSummary], shift: float) -> Curve:
    known = [(scenario.axes["active"], errors) for scenario in scenarios if (errors := scenario.magnitude_error)]
    active = np.repeat([float(n) + shift for n, _ in known], len(QUANTILES))
    return curve(name, active, [max(errors[key], FLOOR) for _, errors in known for key in QUANTILES], style="boxes")
