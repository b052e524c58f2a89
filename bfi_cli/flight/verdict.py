"""The verdict on a flight, kind by kind, and what is said of the kinds that were not found."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ..decision import NOUNS, Candidate, Evidence, State, share_of
from ..decision.implausible import Implausible
from ..faults import Decision
from ..faults.shapes import Kind
from ..quantities.text import quantity
from .limits import AIRSPEEDS, PITOT_LINE
from .result import Event, FlightLimit
from .unwatched import Unwatched

SUDDEN: tuple[Kind, ...] = ("abrupt", "oscillating")
SPEEDS = ("tas", "cas", "ias")
SHOWN = 3  # of what was not watched, in a sentence


def evidence_of(
    events: Sequence[Event],
    limits: Sequence[FlightLimit],
    unwatched: Sequence[Unwatched],
    recorded: Collection[str],
    findings: Sequence[Implausible] = (),
) -> Evidence:
    """Return what the flight says of every kind: its events, and slow faults of the airspeeds and of their line.

    Relations between airspeeds say nothing of the line that all are made of, so that its own limit is needed, and each
    recorded airspeed needs one; of one that only a relation reads (mach beside cas) that relation excludes what is its
    own. How small a step or an oscillation could hide is told by `start-time` on a window: here they are only found.

    Parameters
    ----------
    events : without those that are surely within the tolerances.
    unwatched : flight in which a slow fault would not have been seen.
    findings : on channels that are wrong throughout the flight.
    """

    def candidate(name: str, kind: Kind, state: State) -> Candidate:
        shape = "drift" if kind == "slow" else "bias" if kind == "abrupt" else "sine"
        return Candidate(name=name, shape=shape, channel=name, kind=kind, state=state, magnitude=None, unit="", sd=None)

    candidates = [candidate(event.fault, event.kind, event.state) for event in events]
    only_found = [candidate(NOUNS[kind][0], kind, "not_seen") for kind in SUDDEN]
    needed = (PITOT_LINE, *(name for name in AIRSPEEDS if name in recorded))
    bounded = {}
    for name in needed:
        drifts = [limit for limit in limits if limit.shape == "drift" and limit.fault == name]
        # Its error decides, where nothing bounds that its disagreement.
        deciding = [limit for limit in drifts if limit.bounds == "error"] or drifts
        bounded[name] = bool(deciding) and all(limit.within_tolerance for limit in deciding)
    slow = [candidate(name, "slow", "excluded" if bounded[name] and not unwatched else "not_seen") for name in needed]
    return Evidence(source="flight", candidates=(*candidates, *only_found, *slow), findings=tuple(findings))


def sentence_of(
    events: Sequence[Event],
    limits: Sequence[FlightLimit],
    unwatched: Sequence[Unwatched],
    unwatched_by_steps: Sequence[Unwatched],
    verdicts: Mapping[Kind, Decision],
    _candidates: Sequence[Candidate] = (),
    *,
    looked_for_steps: bool,
) -> str:
    """Return what a reader is told of the kinds of faults that were not found, with their sizes, and where not."""
    sentences = []
    if verdicts["slow"] != "fault":
        sentences.append(_slow_faults_sentence(limits, excluded=verdicts["slow"] == "no_fault") + _except(unwatched))
    kinds = [NOUNS[kind] for kind in SUDDEN if verdicts[kind] == "inconclusive"]
    if kinds and looked_for_steps:
        other = "no other" if events else "no"
        sentences.append(f"{other} {' or '.join(noun for noun, _ in kinds)} found{_except(unwatched_by_steps)}")
    elif kinds:
        sentences.append(f"{' or '.join(noun for _, noun in kinds)} was not looked for")
    return "; ".join(sentences)


def _slow_faults_sentence(limits: Sequence[FlightLimit], *, excluded: bool) -> str:
    slow = [limit for limit in limits if limit.shape == "drift" and limit.bounds == "error" and limit.channel in SPEEDS]
    worst, most, last = (
        max(
            (limit for limit in slow if limit.grows_on == grows and (limit.holds_in == 1.0) == always),
            key=lambda limit: share_of(limit.effect, limit.tolerance),
            default=None,
        )
        for grows, always in ((False, True), (False, False), (True, True))
    )
    if not any(limit.fault == PITOT_LINE for limit in slow) or worst is None or most is None or most.effect is None:
        return "a slow fault of any size could be there unseen"
    length = f"within {most.to_s - most.from_s:.0f} s"
    at_worst = f"{_size(worst)} from {worst.from_s:.0f} to {worst.to_s:.0f} s"
    grown = "" if last is None else f", {_size(last)} by {last.to_s:.0f} s if it grows on from {last.from_s:.0f} s"
    if excluded:
        return f"no slow fault above {_size(most)} {length} in 95 % of the watched flight, {at_worst}{grown}"
    return f"a slow fault could reach {_size(most)} unseen {length} in 95 % of the watched flight, {at_worst}{grown}"


def _size(limit: FlightLimit) -> str:
    return "any size" if limit.effect is None else f"{quantity(limit.effect, 'm/s')} on {limit.channel}"


def _except(unwatched: Sequence[Unwatched]) -> str:
    """Return where a statement does not hold, the longest stretches first, "" where it does everywhere."""
    if not unwatched:
        return ""
    longest = sorted(unwatched, key=lambda stretch: -stretch.seconds)[:SHOWN]
    stretches = ", ".join(f"{stretch.from_s:.0f} to {stretch.to_s:.0f} s ({stretch.why})" for stretch in longest)
    rest = unwatched[SHOWN:] and sum(stretch.seconds for stretch in unwatched) - sum(
        stretch.seconds for stretch in longest
    )
    more = f", and {rest:.0f} s elsewhere" if rest else ""
    return f"; not checked {stretches}{more}"
