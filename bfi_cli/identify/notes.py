"""What the reader must know beside the numbers: ambiguity, blindness, near misses, how the rate was chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels.model_selection import ScoredFit
from ..kernels.whiteness import exceedances
from ..result import OutputSeries, ResidualSummary
from ..study import Intake, Study
from .estimation import Answer, Magnitudes

__all__ = [
    "STRONG",
    "abrupt_note",
    "blind",
    "edge_note",
    "near_miss_note",
    "notes_of",
    "rate_note",
    "rivals",
    "slow_note",
]

FloatArray = NDArray[np.float64]

STRONG = 4.6
WHITE_P = 1e-3
ILL_CONDITIONED = 1e8
MOST_NAMED = 5
BLIND = 3.0
RARE = 0.02
SLOW_SHAPES = ("drift", "lagged_bias", "ramp_hold", "samples")
SLOW_CYCLES = 10.0


def rate_note(intake: Intake) -> str:
    """Say which rate was used and why."""
    return f"analysed at {intake.conditioned.rate_hz:.4g} Hz: {intake.choice.reason}"


def blind(study: Study, magnitudes: Magnitudes) -> tuple[bool, ...]:
    """Say of each live atom whether only a fault far larger than the output's whole movement could be seen."""
    conditioned = study.conditioned
    answers = []
    for n, j in enumerate(study.live):
        theta = conditioned.theta[:, :, j]
        output = int(np.argmax(np.max(np.abs(theta), axis=0)))
        smallest = magnitudes.minimal_detectable[n] * float(np.max(np.abs(theta[:, output])))
        answers.append(not np.isfinite(smallest) or smallest > BLIND * float(np.ptp(conditioned.y[:, output])))
    return tuple(answers)


def rivals(answer: Answer, evidence: float = STRONG) -> list[ScoredFit]:
    """Return the other supports of the same size that explain the log nearly as well, best first."""
    best = answer.best
    by_support: dict[tuple[int, ...], ScoredFit] = {}
    for search in answer.searches:
        for scored in search.visited:
            known = by_support.get(scored.fit.atoms)
            if known is None or scored.criterion < known.criterion:
                by_support[scored.fit.atoms] = scored
    size = len(best.fit.atoms)
    close = [
        scored
        for atoms, scored in by_support.items()
        if atoms != best.fit.atoms and len(atoms) == size and scored.criterion - best.criterion < evidence
    ]
    return sorted(close, key=lambda scored: scored.criterion)


def near_miss_note(names: Sequence[str], answer: Answer) -> str | None:
    """Name the best support that was turned down only because its evidence was not strong."""
    best, evidence = answer.best, answer.penalty.evidence
    above = [
        scored
        for search in answer.searches
        for scored in search.visited
        if set(scored.fit.atoms) > set(best.fit.atoms) and len(scored.fit.atoms) == len(best.fit.atoms) + 1
    ]
    if not above or evidence <= 0.0:
        return None
    nearest = min(above, key=lambda scored: scored.criterion)
    shown = evidence - (nearest.criterion - best.criterion)
    if shown <= evidence / 2.0:
        return None
    (atom,) = set(nearest.fit.atoms) - set(best.fit.atoms)
    return (
        f"'{names[atom]}' has some support but not enough to be declared (evidence {shown:.1f}, {evidence:.1f} needed)"
    )


def notes_of(
    intake: Intake, study: Study, magnitudes: Magnitudes, residuals: Sequence[ResidualSummary], condition_number: float
) -> list[str]:
    """Return the notes that hold for any method."""
    notes = [rate_note(intake)]
    names = [intake.names[j] for j in study.live]
    unseen = [name for name, hidden in zip(names, blind(study, magnitudes), strict=True) if hidden]
    if unseen:
        notes.append(
            f"{_listed(unseen)}: only a fault larger than the output's whole movement would be seen in this window"
        )
    notes += [reason for _, reason in sorted(intake.reasons.items())]
    if condition_number > ILL_CONDITIONED:
        notes.append(
            f"the regressors are nearly dependent (condition number {condition_number:.1e}): little excitation, "
            "or a rate far above the dynamics"
        )
    notes += [
        f"the prediction error of '{each.channel}' is not white (Ljung-Box p = {each.ljung_box_p:.1e}): "
        "the intervals may be too narrow"
        for each in residuals
        if each.ljung_box_p < WHITE_P
    ]
    return notes


def abrupt_note(study: Study, output: OutputSeries) -> str | None:
    """Say where the prediction error of the answer still jumps: something abrupt is there that the answer lacks."""
    first = study.layout.first
    times = study.conditioned.time_s[first:][exceedances(output.prediction_error[first:])]
    if not 0 < times.size <= max(1.0, RARE * (len(output.prediction_error) - first)):
        return None
    shown = ", ".join(f"{t:.4g}" for t in times[:MOST_NAMED])
    return (
        f"the prediction error of '{output.channel}' still exceeds five standard deviations {times.size} times "
        f"(first at {shown} s): something abrupt there that the dictionary does not hold, or gusts"
    )


def edge_note(intake: Intake, study: Study, entries: Sequence[int]) -> str | None:
    """Warn of declared faults that act on too few samples of the window to be told by their shape."""
    time_s, needed = study.conditioned.time_s, 2 * study.layout.first
    late = [intake.names[j] for j in entries if np.count_nonzero(time_s >= intake.faults[j].onset_s) < needed]
    if not late:
        return None
    return f"{_listed(late)}: fewer than {needed} samples after its onset; choose a window that ends later"


def slow_note(intake: Intake, entries: Sequence[int]) -> str | None:
    """Warn of declared faults that an input missing from the list would imitate."""
    duration = len(intake.record.time_s) / intake.record.rate_hz
    slow = [
        intake.names[j]
        for j in entries
        if (fault := intake.faults[j]).shape in SLOW_SHAPES
        or (fault.frequency_hz is not None and fault.frequency_hz * duration < SLOW_CYCLES)
    ]
    if not slow:
        return None
    return (
        f"{_listed(slow)}: a change of thrust, configuration or wind that is not among the inputs can look like a slow "
        "fault; add inputs that explain it (--input)"
    )


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:MOST_NAMED])
    return shown if len(names) <= MOST_NAMED else f"{shown} and {len(names) - MOST_NAMED} more"
