"""An answer on a log with channels that are wrong throughout: what to state first, and how far a verdict holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from ..notes import Note
from .finding import Implausible, in_words

Result = TypeVar("Result", bound=Any)

WITHHELD = "withheld while channels contradict each other"


def with_plausibility(result: Result, findings: Sequence[Implausible]) -> Result:
    """Return an answer with what is wrong with channels throughout the flight, which is told beside it.

    A unit that is stated is kept, and what arithmetic thinks of it is one line. A constant error, or a channel that is
    set aside, is no fault of the flight and withholds nothing that was found.
    While a constant error is larger than an installation makes it, or a channel does not follow the flight, no kind of
    fault is excluded. Where channels contradict each other by a unit, a sign, a place or the clock that is still to be
    stated, there is no verdict and no declared fault.

    Parameters
    ----------
    result : of an analysis, with `decision`, `verdicts`, `summary`, `notes` and `plausibility`; what it declares is in
        `faults`, `alarms` and `candidates`, or in `events`.
    """
    findings = tuple(findings)
    result = replace(result, plausibility=findings)
    if to_state := [one for one in findings if one.is_open]:
        return _without_verdict(result, to_state)
    beside = [Note.limit(f"throughout the flight: {one.text}") for one in findings if one.is_constant and not one.fixed]
    beside += [Note.method(f"{one.advice}: {one.text}") for one in findings if one.is_stated and not one.fixed]
    result = replace(result, notes=(*result.notes, *beside))
    errors = [one for one in findings if one.what == "unrelated" or (one.is_constant and not one.is_installation)]
    if not errors:
        return result
    return replace(
        result,
        decision=_not_excluded(result.decision),
        verdicts={kind: _not_excluded(verdict) for kind, verdict in result.verdicts.items()},
        summary="; ".join(filter(None, (*(f"{one.advice}: {one.text}" for one in errors), result.summary))),
    )


def _not_excluded(verdict: str) -> str:
    return "inconclusive" if verdict == "no_fault" else verdict


def _without_verdict(result: Result, to_state: Sequence[Implausible]) -> Result:
    has = {one.name for one in fields(result)}
    changes: dict[str, Any] = {name: () for name in ("faults", "alarms") if name in has}
    notes = []
    if any(getattr(result, name) for name in changes):
        notes.append(Note.limit(f"what would be declared is {WITHHELD}: {result.summary or 'see the candidates'}"))
    for name in {"candidates", "events"} & has:
        changes[name] = tuple(
            replace(one, state="suspected", note=WITHHELD) if one.state == "declared" else one
            for one in getattr(result, name)
        )
    return replace(
        result,
        decision="inconclusive",
        verdicts=dict.fromkeys(result.verdicts, "inconclusive"),
        summary=in_words(to_state),
        notes=(*result.notes, *notes),
        **changes,
    )
