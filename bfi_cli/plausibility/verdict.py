"""An answer on a log whose channels cannot be true together: what to state first, and no verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from ..notes import Note
from .finding import Implausible, in_words

Result = TypeVar("Result", bound=Any)

WITHHELD = "withheld while channels contradict each other"


def without_verdict(result: Result, findings: Sequence[Implausible]) -> Result:
    """Return an answer with the findings, and where one is left open, with no verdict and no declared fault.

    A fault that begins within the window stays declared beside a constant error: the model of the window absorbs that,
    while physics does not, so that events of a diagnosis are suspected.

    Parameters
    ----------
    result : of an analysis, with `decision`, `verdicts`, `summary`, `notes` and `plausibility`; what it declares is in
        `faults`, `alarms` and `candidates`, or in `events`, of which constant errors stay.
    """
    findings = tuple(findings)
    if not in_words(findings):
        return replace(result, plausibility=findings)
    has = {one.name for one in fields(result)}
    if "events" not in has and result.decision == "fault" and all(one.is_constant for one in findings if not one.fixed):
        doubted = {kind: "fault" if said == "fault" else "inconclusive" for kind, said in result.verdicts.items()}
        summary = "; ".join(filter(None, (in_words(findings), result.summary)))
        return replace(result, plausibility=findings, verdicts=doubted, summary=summary)
    changes: dict[str, Any] = {name: () for name in ("faults", "alarms") if name in has}
    notes = []
    if any(getattr(result, name) for name in changes):
        notes.append(Note.limit(f"what would be declared is {WITHHELD}: {result.summary or 'see the candidates'}"))
    for name in {"candidates", "events"} & has:
        changes[name] = tuple(
            replace(one, state="suspected", note=WITHHELD) if one.state == "declared" and one.shape != "offset" else one
            for one in getattr(result, name)
        )
    own = [one for one in changes.get("events", ()) if one.state == "declared"]
    return replace(
        result,
        decision="fault" if own else "inconclusive",
        verdicts={kind: "fault" if kind in {one.kind for one in own} else "inconclusive" for kind in result.verdicts},
        summary=in_words(findings),
        plausibility=findings,
        notes=(*result.notes, *notes),
        **changes,
    )
