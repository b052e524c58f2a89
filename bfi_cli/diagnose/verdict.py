"""The verdict on a flight, kind by kind, and what is said of the kinds that were not found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..channels import LARGEST_ERROR
from ..faults import Decision
from ..shapes import Kind
from ..verdicts import KINDS, decide, two_digits
from .limits import AIRSPEEDS
from .result import Event, FlightLimit

__all__ = ["decision_of", "sentence_of", "verdicts_of"]

STEPS: Mapping[Kind, str] = {"abrupt": "a step", "oscillating": "an oscillation"}


def verdicts_of(events: Sequence[Event], limits: Sequence[FlightLimit]) -> dict[Kind, Decision]:
    """Return the verdict on every kind: a slow fault is excluded where its limits on all airspeeds are tolerable.

    Relations between airspeeds say nothing of the line that all are made of, so that its own limit is needed.
    How small a step or an oscillation could hide is told by `start-time` on a window: here they are only found.
    """
    verdicts: dict[Kind, Decision] = dict.fromkeys(KINDS, "inconclusive")
    suspected = {one.kind for one in events if one.state == "suspected"}
    slow = [one for one in limits if one.shape == "drift" and one.channel in AIRSPEEDS]
    if _bounds_line(slow) and all(one.within_tolerance for one in slow) and "slow" not in suspected:
        verdicts["slow"] = "no_fault"
    for one in events:
        if one.state == "declared" and one.beyond_tolerance is not False:
            verdicts[one.kind] = "fault"
    return verdicts


def decision_of(verdicts: Mapping[Kind, Decision], events: Sequence[Event], required: Sequence[Kind]) -> Decision:
    """Return the decision on the flight: what is only suspected leaves it open."""
    if any(one.state == "suspected" for one in events) and "fault" not in verdicts.values():
        return "inconclusive"
    return decide(verdicts, required)


def sentence_of(
    verdicts: Mapping[Kind, Decision],
    events: Sequence[Event],
    limits: Sequence[FlightLimit],
    *,
    looked_for_steps: bool,
) -> str:
    """Return what a reader is told of the kinds of faults that were not found, with their sizes."""
    slow = [one for one in limits if one.shape == "drift" and one.channel in ("tas", "cas", "ias")]
    said = []
    worst = max(slow, key=lambda one: one.effect, default=None)
    if (
        verdicts["slow"] != "fault"
        and worst is not None
        and _bounds_line(slow)
        and worst.effect <= LARGEST_ERROR["tas"]
    ):
        verb = "no slow fault above" if verdicts["slow"] == "no_fault" else "a slow fault could reach"
        end = "" if verdicts["slow"] == "no_fault" else " unseen"
        said.append(
            f"{verb} {two_digits(worst.effect)} m/s on {worst.channel}{end} within {worst.to_s - worst.from_s:.0f} s"
        )
    elif verdicts["slow"] != "fault":
        said.append("a slow fault of any size could be there unseen")
    unseen_kinds = [noun for kind, noun in STEPS.items() if verdicts[kind] == "inconclusive"]
    if unseen_kinds and looked_for_steps:
        beside = " beside these events" if events else ""
        none = " and ".join(f"no {noun.split(' ', 1)[1]}" for noun in unseen_kinds)
        said.append(f"{none} was found{beside}; bfi start-time says how large one could be unseen")
    elif unseen_kinds:
        said.append(f"{' or '.join(unseen_kinds)} was not looked for")
    return "; ".join(said)


def _bounds_line(limits: Sequence[FlightLimit]) -> bool:
    return any(one.fault == "pitot_icing" for one in limits)
