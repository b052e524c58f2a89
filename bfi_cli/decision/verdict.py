"""The verdicts on the three kinds of fault that follow from what was looked for, and the sentence that says them.

The verdict on a kind of fault is `fault` where one of it is declared, `no_fault` where all its candidates are excluded,
and `inconclusive` otherwise. The decision is the worst of the kinds that are required (docs/theory.md, 8).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

from ..faults import Decision
from ..faults.shapes import Kind
from ..quantities.display_units import SI, Units
from .candidate import KINDS, Candidate, State, shown_limit

# The note of a scan on the frequencies, and on the onsets where a dictionary narrows them, that its claim covers.
BAND = re.compile(r"(of \S+ to \S+ Hz)?( ?that begins from \S+ to \S+ s)?")
NOUNS: Mapping[Kind, tuple[str, str]] = {
    "abrupt": ("step", "a step"),
    "oscillating": ("oscillation", "an oscillation"),
    "slow": ("slow fault", "a slow fault"),
}


def verdicts_of(candidates: Iterable[Candidate]) -> dict[Kind, Decision]:
    """Return the verdict on each kind of fault; a kind of which no fault was looked for is inconclusive."""
    states: dict[Kind, set[State]] = {kind: set() for kind in KINDS}
    for candidate in candidates:
        if candidate.state is not None:
            states[candidate.kind].add(candidate.state)
    return {
        kind: "fault" if "declared" in seen else "no_fault" if seen == {"excluded"} else "inconclusive"
        for kind, seen in states.items()
    }


def decide(verdicts: Mapping[Kind, Decision], required: Sequence[Kind]) -> Decision:
    """Return the worst verdict of the kinds required; a declared fault of any kind is a fault."""
    if "fault" in verdicts.values():
        return "fault"
    return "inconclusive" if any(verdicts[kind] == "inconclusive" for kind in required) else "no_fault"


def summarise(verdicts: Mapping[Kind, Decision], candidates: Sequence[Candidate], units: Units = SI) -> str:
    """Return what the log says of the kinds of which no fault is declared, in one line.

    "no step above 0.4 m/s; no oscillation of 0.05 to 0.4 Hz above 0.2 m/s; a slow fault could reach 9 m/s unseen".
    """
    return "; ".join(
        _kind_summary(kind, verdicts[kind], candidates, units) for kind in KINDS if verdicts[kind] != "fault"
    )


def _kind_summary(kind: Kind, verdict: Decision, candidates: Sequence[Candidate], units: Units) -> str:
    noun, one_noun = NOUNS[kind]
    alike = [
        candidate for candidate in candidates if candidate.kind == kind and candidate.state not in (None, "declared")
    ]
    if not alike:
        return f"{one_noun} was not looked for"
    suspects = [
        candidate.name for candidate in sorted(alike, key=_prominence, reverse=True) if candidate.state == "suspected"
    ]
    worst = max(alike, key=_share)
    on = f" on {worst.channel}" if len({candidate.channel for candidate in alike}) > 1 else ""
    limit = shown_limit(worst, units)
    if verdict == "no_fault":
        # The claim of a scan ends with the frequencies that it looked at; those of a dictionary are in its table.
        band = next(
            (
                f" {candidate.note}"
                for candidate in alike
                if candidate.onset_s is None and candidate.note and BAND.fullmatch(candidate.note)
            ),
            "",
        )
        return f"no {noun}{band} above {limit}{on}"
    if suspects:
        return f"{one_noun} is suspected ({', '.join(suspects[:3])}{', ...' if len(suspects) > 3 else ''})"
    if limit is None:
        # The worst of the entries of a dictionary decides, and the others may be bounded well.
        which = f" ({worst.name}: {worst.note})" if worst.note and worst.onset_s is not None else ""
        return f"{one_noun} of any size could be there unseen{on}{which}"
    return f"{one_noun} could reach {limit}{on} unseen"


def _prominence(candidate: Candidate) -> float:
    """Return how far a candidate stands out of what could be declared; what a scan declares has no such size."""
    if candidate.minimal_detectable is None or candidate.magnitude is None:
        return math.inf
    return abs(candidate.magnitude) / candidate.minimal_detectable if candidate.minimal_detectable else math.inf


def _share(candidate: Candidate) -> float:
    """Return the largest hidden error over the tolerance."""
    if candidate.effect is None or not math.isfinite(candidate.effect):
        return math.inf
    return candidate.effect / candidate.tolerance if candidate.tolerance else candidate.effect
