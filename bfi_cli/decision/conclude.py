"""One conclusion from the evidence of several sources on one window.

Sources share channels and gusts, so that their evidence is not added. Each has a share of the level: a fault is
declared where one source declares it at its share, and a limit is the smallest of the sources' limits. By the union
bound both statements hold at the level of all, however the sources depend on each other. The verdict on a kind of fault
is `fault` where one of it is declared, `no_fault` where all its candidates are excluded, and `inconclusive` otherwise;
the decision is the worst of the kinds that are required (docs/theory.md, 8).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from ..faults import Decision, FaultEstimate, build_up_s
from ..faults.shapes import LINE_SHAPES, SHAPES, Kind
from ..notes import Note
from ..quantities.text import instant, quantity
from .candidate import KINDS, STEPS, Candidate, Evidence, Manoeuvre, State, share_of, shown_limit, with_limit
from .implausible import Implausible, in_words

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


def summarise(verdicts: Mapping[Kind, Decision], candidates: Sequence[Candidate]) -> str:
    """Return what the log says of the kinds of which no fault is declared, in one line.

    "no step above 0.4 m/s; no oscillation of 0.05 to 0.4 Hz above 0.2 m/s; a slow fault could reach 9 m/s unseen".
    """
    return "; ".join(_kind_summary(kind, verdicts[kind], candidates) for kind in KINDS if verdicts[kind] != "fault")


def _kind_summary(kind: Kind, verdict: Decision, candidates: Sequence[Candidate]) -> str:
    noun, one_noun = NOUNS[kind]
    alike = [
        candidate for candidate in candidates if candidate.kind == kind and candidate.state not in (None, "declared")
    ]
    if not alike:
        return f"{one_noun} was not looked for"
    suspects = [
        candidate.name for candidate in sorted(alike, key=_prominence, reverse=True) if candidate.state == "suspected"
    ]
    worst = max(alike, key=lambda candidate: share_of(candidate.effect, candidate.tolerance))
    on = f" on {worst.channel}" if len({candidate.channel for candidate in alike}) > 1 else ""
    limit = shown_limit(worst)
    if verdict == "no_fault":
        # The claim of a scan ends with the frequencies and onsets that it looked at, not with how slow a lag may be.
        scanned = [candidate for candidate in alike if candidate.onsets_checked and candidate.note]
        covers = next((f" {candidate.note}" for candidate in scanned if not SHAPES[candidate.shape].claimed_s), "")
        return f"no {noun}{covers} above {limit}{on}"
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


# Sources that explain the window by a linear model of the aircraft.
MODELS = ("dictionary", "scan")
REFUTED = "declared, and refuted by another source: see the notes"
# s; two faults of a channel are not told apart within the second over which relations take their means.
TOGETHER_S = 0.5
WITHHELD = "withheld while channels contradict each other"


@dataclass(frozen=True, slots=True, kw_only=True)
class Conclusion:
    """What all sources together say of a window.

    Attributes
    ----------
    decision : on the kinds that are required; verdicts : on each kind of fault.
    summary : what the log says of the kinds of which no fault is declared.
    faults : declared; candidates : all that was looked for, with the smallest limits.
    notes : where sources disagree, and what is wrong with channels throughout.
    plausibility : the channels that are wrong throughout.
    is_withheld : whether they contradict each other, so that there is no verdict and nothing is declared.
    has_failed : there is no verdict, for the method has none.
    """

    decision: Decision
    verdicts: Mapping[Kind, Decision]
    summary: str
    faults: tuple[FaultEstimate, ...]
    candidates: tuple[Candidate, ...]
    notes: tuple[Note, ...]
    plausibility: tuple[Implausible, ...] = ()
    is_withheld: bool = False
    has_failed: bool = False


def conclude(
    evidence: Sequence[Evidence],
    required: Sequence[Kind],
    *,
    says: Callable[[Mapping[Kind, Decision], Sequence[Candidate]], str] = summarise,
    fires: bool = False,
    failed: str = "",
) -> Conclusion:
    """Return what the evidence of all sources says together.

    1. A fault that a source declares is declared, unless another source excludes its error on the channel, or a model
       declares it where it begins in a manoeuvre that no linear model follows: then it is suspected. What two sources
       declare of one channel at one time is one fault, named by the one with more evidence: a reading that is held to
       the last bit has most, and a line of pressure that is blocked or leaks; whatever seems to begin on its channel
       since is that.
    2. What bounds a slow error, or a step, of a channel in one source bounds it in all: the smallest limit counts.
    3. A sensor that is frozen tells of no other fault of its channel.
    4. The verdicts on the kinds, and the sentence that says them.
    5. What is wrong with channels throughout the flight is told beside that. Where it is larger than an installation
       makes it, no kind is excluded; where channels contradict each other by a unit, a sign, a place or the clock that
       is still to be stated, there is no verdict, and nothing is declared.

    Parameters
    ----------
    evidence : the sources, the one that names a fault best first.
    required : kinds of fault that the decision rests on.
    says : from verdicts and candidates, what the log says of the kinds of which no fault is declared.
    fires : a source says that there is a fault, whatever is declared.
    failed : why there is no verdict, a sentence; "" where there is.
    """
    refuted = _refuted(evidence)
    faults = _joined(evidence, refuted)
    candidates = tuple(
        _while_it_read(_with_least_limit(candidate, evidence), faults) for candidate in _suspecting(evidence, refuted)
    )
    verdicts: dict[Kind, Decision] = {
        **verdicts_of(candidates),
        **dict.fromkeys([SHAPES[estimate.fault.shape].kind for estimate in faults], "fault"),
    }
    summary = failed or says(verdicts, candidates)
    findings, notes = tuple(finding for source in evidence for finding in source.findings), list(refuted.values())
    to_state = [finding for finding in findings if finding.is_open]
    if to_state:
        declared = [candidate for candidate in candidates if candidate.state == "declared"]
        names = [named.name for named in faults or declared]
        notes += [Note.limit(f"what would be declared is {WITHHELD}: {', '.join(names)}")] if names else []
        summary, faults = in_words(to_state), []
        candidates = tuple(
            replace(candidate, state="suspected", note=WITHHELD) if candidate.state == "declared" else candidate
            for candidate in candidates
        )
    else:
        notes += _notes_on(findings)
        # Those that are set aside, or err by more than an installation makes them.
        if errors := [
            finding.sentence
            for finding in findings
            if finding.what == "unrelated" or (finding.is_constant and not finding.is_installation)
        ]:
            summary = "; ".join(filter(None, (*errors, summary)))
            verdicts = {kind: "fault" if verdict == "fault" else "inconclusive" for kind, verdict in verdicts.items()}
    if failed or to_state:
        fires, verdicts = False, dict.fromkeys(KINDS, "inconclusive")
    return Conclusion(
        decision="fault" if fires else decide(verdicts, required),
        verdicts=verdicts,
        summary=summary,
        faults=tuple(faults),
        candidates=candidates,
        notes=tuple(notes),
        plausibility=findings,
        is_withheld=bool(to_state),
        has_failed=bool(failed),
    )


def _refuted(evidence: Sequence[Evidence]) -> dict[int, Note]:
    """Return by `id` why faults are only suspected: another source excludes them, or they begin in a manoeuvre."""
    refuted: dict[int, Note] = {}
    for source in evidence:
        for fault in source.faults:
            why = _excluded_by(fault, [other for other in evidence if other is not source])
            if why is None and source.source in MODELS:
                why = _within(fault, [manoeuvre for other in evidence for manoeuvre in other.manoeuvres])
            if why is not None:
                label, channel = SHAPES[fault.fault.shape].label, fault.fault.channel
                size, from_s = quantity(fault.magnitude, fault.unit), instant(fault.fault.onset_s)
                what = f"a {label} of {size} on {channel} from {from_s} s, which the {source.source} declares"
                refuted[id(fault)] = Note.limit(f"only suspected: {what}; {why}")
    return refuted


def _joined(evidence: Sequence[Evidence], refuted: Collection[int]) -> list[FaultEstimate]:
    """Return the faults that are declared, in the order of their sources: what two of them see alike is one fault."""
    faults: list[FaultEstimate] = []
    declared = [
        replace(fault, source=source.source)
        for source in evidence
        for fault in source.faults
        if id(fault) not in refuted
    ]
    declared.sort(key=lambda fault: math.inf if fault.statistic is None else fault.statistic, reverse=True)
    for fault in sorted(declared, key=_is_lost, reverse=True):
        same = _same_fault(fault, faults)
        if same is None:
            faults.append(replace(fault, evidence={fault.source: fault.statistic}))
        else:
            known = faults[same]
            faults[same] = replace(known, evidence={**known.evidence, fault.source: fault.statistic})
    order = {source.source: k for k, source in enumerate(evidence)}
    return sorted(faults, key=lambda estimate: order[estimate.source])


def _suspecting(evidence: Sequence[Evidence], refuted: Collection[int]) -> Iterator[Candidate]:
    """Yield the candidates of all sources, as suspected where all that declares them is refuted."""
    for source in evidence:
        for candidate in source.candidates:
            # An entry of the dictionary may be declared by the search.
            matching = [
                fault
                for other in evidence
                for fault in other.faults
                if (other is source or fault.name == candidate.name) and _is_of(fault, candidate)
            ]
            if candidate.state == "declared" and matching and all(id(fault) in refuted for fault in matching):
                candidate = replace(candidate, state="suspected", note=REFUTED)
            yield candidate


def _notes_on(findings: Sequence[Implausible]) -> list[Note]:
    """Return notes on constant errors, which withhold nothing that was found, and on units that are stated and kept."""
    there = [finding for finding in findings if not finding.fixed]
    return [
        *(Note.limit(f"throughout the flight: {finding.text}") for finding in there if finding.is_constant),
        *(Note.method(finding.sentence) for finding in there if finding.is_stated),
    ]


def _is_of(fault: FaultEstimate, candidate: Candidate) -> bool:
    """Say whether a fault is of a candidate: an entry that states its onset, or a kind at any onset."""
    alike = (fault.fault.shape, fault.fault.channel) == (candidate.shape, candidate.channel)
    return alike and (candidate.onset_s is None or candidate.name == fault.name)


def _is_held(estimate: FaultEstimate) -> bool:
    return SHAPES[estimate.fault.shape].acts_on == "held"


def _is_lost(estimate: FaultEstimate) -> bool:
    """Say whether a channel follows no motion since a fault: it is held, or its line shows the pressure of no air.

    What a model declares has a course, beside which others are seen.
    """
    is_line = estimate.fault.shape in LINE_SHAPES and not SHAPES[estimate.fault.shape].has_magnitude
    return _is_held(estimate) or (is_line and estimate.source not in MODELS)


def _same_fault(fault: FaultEstimate, known: Sequence[FaultEstimate]) -> int | None:
    """Return which fault of another source is the same.

    It is on its channel, and both build up at one time, or both are slow, or that one has lost it by then.
    """

    def span(estimate: FaultEstimate) -> tuple[float, float]:
        low, high = estimate.onset_span_s
        return low, high + (build_up_s(estimate.fault) or 0.0)

    low, high = span(fault)
    is_slow = SHAPES[fault.fault.shape].kind == "slow"
    for k, other in enumerate(known):
        if other.source == fault.source or fault.fault.channel not in (other.fault.channel, *other.among):
            continue
        both_slow = is_slow and SHAPES[other.fault.shape].kind == "slow"
        latest = math.inf if _is_lost(other) else span(other)[1]
        if both_slow or (span(other)[0] - TOGETHER_S <= high and low - TOGETHER_S <= latest):
            return k
    return None


def _excluded_by(fault: FaultEstimate, others: Sequence[Evidence]) -> str | None:
    """Return what excludes the error that a slow fault makes on its channel, None where no other source does.

    What is excluded from an onset that is stated says nothing of a fault that begins at another.
    """
    if SHAPES[fault.fault.shape].kind != "slow" or fault.effect is None:
        return None
    first_s, last_s = fault.onset_span_s
    for other in others:
        for candidate in other.candidates:
            alike = candidate.kind == "slow" and candidate.channel == fault.fault.channel and candidate.is_unseen
            there = candidate.onset_s is None or first_s <= candidate.onset_s <= last_s
            if alike and there and candidate.limit is not None and candidate.limit < fault.effect:
                return (
                    f"the {other.source} excludes more than {quantity(candidate.limit, candidate.channel_unit)} there"
                )
    return None


def _within(fault: FaultEstimate, manoeuvres: Sequence[Manoeuvre]) -> str | None:
    """Return in or beside which manoeuvre a fault begins; a reading that is held is told without a model."""
    for manoeuvre in () if _is_held(fault) else manoeuvres:
        if manoeuvre.reach_s[0] <= fault.fault.onset_s <= manoeuvre.reach_s[1]:
            return (
                f"it begins within {manoeuvre.beside_s:.3g} s of a {manoeuvre.name} ({instant(manoeuvre.from_s)} to "
                f"{instant(manoeuvre.to_s)} s), which no linear model follows"
            )
    return None


def _while_it_read(candidate: Candidate, faults: Sequence[FaultEstimate]) -> Candidate:
    """Return a candidate, which nothing excludes where a fault holds the reading of its channel."""
    held = [estimate for estimate in faults if estimate.fault.channel == candidate.channel and _is_held(estimate)]
    if not held or candidate.state in ("declared", None):
        return candidate
    note = f"{candidate.channel} tells nothing from {instant(held[0].fault.onset_s)} s on"
    return with_limit(candidate, None, None, state="not_seen", note=note)


def _with_least_limit(candidate: Candidate, evidence: Sequence[Evidence]) -> Candidate:
    """Return a candidate with the smallest error that any source leaves of a slow fault or a step of its channel."""
    if not candidate.is_unseen:
        return candidate
    if candidate.kind == "abrupt":
        return _with_least_step(candidate, evidence)
    if candidate.kind == "oscillating":
        shown = [
            source.since_start[candidate.channel] for source in evidence if candidate.channel in source.since_start
        ]
        return with_limit(candidate, None, None, state="suspected", note=shown[0]) if shown else candidate
    bounds = [
        (other.effect, other.seen_above)
        for source in evidence
        for other in source.candidates
        if other.kind == "slow" and other.channel == candidate.channel and other.is_unseen and other.effect is not None
    ]
    least = min((effect for effect, _ in bounds), default=math.inf)
    seen_above = min((seen for _, seen in bounds if seen is not None), default=None)
    return _with_error(replace(candidate, seen_above=seen_above), least)


def _with_least_step(candidate: Candidate, evidence: Sequence[Evidence]) -> Candidate:
    """Return a candidate with the smallest error that a source leaves of a step at its onsets, or at most of them."""
    spans_s = candidate.onsets_checked or ()
    if candidate.onset_s is not None:
        spans_s = ((candidate.onset_s, candidate.onset_s),)
    bounds = [bound for source in evidence for bound in source.bounds if bound.channel == candidate.channel]
    if candidate.shape not in STEPS or not (spans_s and bounds):
        return candidate
    least, held_s = min((bound.over(spans_s, candidate.tolerance) for bound in bounds), key=lambda bound: bound[0])
    bounded = _with_error(candidate, least)
    return bounded if bounded is candidate or held_s == spans_s else replace(bounded, onsets_checked=held_s)


def _with_error(candidate: Candidate, least: float) -> Candidate:
    """Return a candidate with an error that bounds it, itself where that is no less than its own."""
    if math.isinf(least) or (candidate.effect is not None and candidate.effect <= least):
        return candidate
    scale = None if candidate.effect in (None, 0.0) else least / candidate.effect
    above = None if scale is None or candidate.excluded_above is None else scale * candidate.excluded_above
    return with_limit(candidate, least, above, candidate.seen_above)
