"""What the trials of each scenario say together: rates with Wilson intervals, quantiles of the magnitude error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from ..decision import KINDS
from ..faults import Decision
from ..kernels.normal import TWO_SIDED_95
from ..notes import Note
from ..shapes import Kind
from .scenarios import Sweep
from .trial import Row, rounded

DECISIONS: tuple[Decision, ...] = get_args(Decision)
# Those of a box and its whiskers, and the largest.
QUANTILES = {"p05": 0.05, "p25": 0.25, "p50": 0.5, "p75": 0.75, "p95": 0.95, "max": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """So many of so many, with the 95 % Wilson interval; None where there are none to count."""

    count: int
    of: int
    rate: float | None
    ci95: tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSummary:
    """A scenario.

    Attributes
    ----------
    axes : what it is, value by axis.
    trials, failed : how many, and how many gave an error instead of an answer.
    isolation_rate : trials whose declared faults are those added; a failed trial isolates nothing.
    false_alarm_rate : trials with an answer that declare a fault which was not added.
    missed_detection_rate : trials with an answer and faults that do not declare one of them.
    decisions : trials with an answer by their decision; verdicts : by their verdict on each kind of fault.
    wrong_no_fault_rate : trials with an answer and a fault whose largest error in the window exceeds the channel's
        tolerance, in which the verdict that covers such a fault is no_fault.
    coverage : 95 % intervals of rightly declared faults that hold the truth.
    magnitude_error : quantiles over trials with an answer and faults, relative; None where there are none.
    onset_error_s : median size of the errors of the onsets of rightly declared faults.
    seconds : median time of a trial.
    """

    name: str
    axes: Mapping[str, Any]
    trials: int
    failed: int
    isolation_rate: Proportion
    false_alarm_rate: Proportion
    missed_detection_rate: Proportion
    decisions: Mapping[Decision, Proportion]
    verdicts: Mapping[Kind, Mapping[Decision, Proportion]]
    wrong_no_fault_rate: Proportion
    coverage: Proportion
    magnitude_error: Mapping[str, float] | None
    detection_delay_s: float | None
    onset_error_s: float | None
    seconds: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Summary:
    """All scenarios, and sentences for the reader."""

    scenarios: tuple[ScenarioSummary, ...]
    notes: tuple[Note, ...]


def wilson(count: int, of: int) -> tuple[float, float] | None:
    """Return the 95 % interval of a proportion (Wilson 1927), None without trials."""
    if of == 0:
        return None
    share, z2 = count / of, TWO_SIDED_95**2
    middle = share + z2 / (2 * of)
    half = TWO_SIDED_95 * math.sqrt(share * (1 - share) / of + z2 / (4 * of**2))
    low = 0.0 if count == 0 else (middle - half) / (1 + z2 / of)
    return low, 1.0 if count == of else (middle + half) / (1 + z2 / of)


def summarise(sweep: Sweep, done: Sequence[tuple[Row, float]]) -> Summary:
    """Return the summary of the rows of a sweep and their seconds, in any order."""
    by_name: dict[str, list[tuple[Row, float]]] = {scenario.name: [] for scenario in sweep.scenarios}
    for row, seconds in done:
        by_name[row.scenario].append((row, seconds))
    scenarios = tuple(_scenario(s.name, s.axes, by_name[s.name]) for s in sweep.scenarios)
    notes = []
    for one in scenarios:
        if one.failed:
            first = next(row.error for row, _ in by_name[one.name] if row.error)
            failed = f"{one.failed} of {one.trials} trials of '{one.name}' failed and count as not isolated"
            notes.append(Note.limit(f"{failed}; the first: {first}"))
    return Summary(scenarios=scenarios, notes=tuple(notes))


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
    given = list(answers)
    return {decision: proportion(given.count(decision), len(given)) for decision in DECISIONS}


def _share(hits: Iterable[object]) -> Proportion:
    flags = [bool(hit) for hit in hits]
    return proportion(sum(flags), len(flags))


def proportion(count: int, of: int) -> Proportion:
    """Return so many of so many with their interval."""
    return Proportion(count=count, of=of, rate=count / of if of else None, ci95=wilson(count, of))
