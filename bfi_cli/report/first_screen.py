"""The first screen of an answer: its headline, and at most one line of each kind of what else a reader needs.

Every line is composed from the data of the answer, in the units that are shown; none is made from another sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, Protocol

from ..decision import KINDS, UNTESTED, Candidate, Proof, shown_limit
from ..decision.implausible import Implausible
from ..faults import Decision, FaultEstimate
from ..faults.shapes import SHAPES, Kind
from ..notes import Note
from ..printable import shortened
from ..quantities.channels import STANDARD, Conversion, channel_in_words
from ..quantities.text import SI, Units, capital, change, duration, instant, interval, number, with_unit

State = Literal["fault", "deviation", "suspected", "no_fault_found", "cannot_tell"]
Headline = tuple[State, str, str]  # state, channel and text of a screen
Label = Literal[
    "Wrong from then on",
    "Also",
    "Ordinary",
    "Ruled out",
    "Still possible",
    "Would have been found",
    "Not checked",
    "Caution",
    "To decide",
    "Look at",
]
# Rows of a terminal of 100 columns that a first screen takes at most.
MOST_ROWS = 12
NAME_LETTERS = 24
NOUNS: Mapping[Kind, tuple[str, str]] = {
    "abrupt": ("step", "steps"),
    "oscillating": ("oscillation", "oscillations"),
    "slow": ("slow error", "slow errors"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """The first screen of an answer.

    Attributes
    ----------
    state : "deviation" is an error that surely lies within its tolerance.
    channel : that is wrong, "" where it is none, or not one.
    text : what is wrong, how far, from when, and 95 % intervals; without a full stop.
    name : of the entry of a dictionary that this is about, "" for none.
    lines : the parts of each by its label, in their order, none without parts; those parts are shown that fit in a row,
        the first of them always.
    """

    state: State
    channel: str
    text: str
    lines: Mapping[Label, tuple[str, ...]]
    name: str = ""

    @property
    def head(self) -> str:
        """The state in words, "No fault found"."""
        return capital(self.state.replace("_", " "))

    @property
    def first(self) -> str:
        """The first line, "FAULT  true airspeed reads 4.00 m/s too high from 13.8 s"."""
        name = f"     {shortened(self.name, NAME_LETTERS)}" if self.name else ""
        return f"{self.head.upper()}  {self.text}{name}"

    @property
    def headline(self) -> dict[str, str]:
        """That line as documents have it."""
        return {"state": self.state, "channel": self.channel, "text": self.text}

    def with_sentences(self, change: Callable[[str], str]) -> Screen:
        """Return the screen with its sentences changed."""
        lines = {label: tuple(map(change, parts)) for label, parts in self.lines.items()}
        return replace(self, text=change(self.text), lines=lines)


def lines_of(parts: Mapping[Label, Iterable[str]]) -> dict[Label, tuple[str, ...]]:
    """Return the lines of a screen, each sentence once, without those that have nothing to say."""
    lines = {label: tuple(dict.fromkeys(filter(None, sentences))) for label, sentences in parts.items()}
    return {label: shown for label, shown in lines.items() if shown}


def error_in_words(
    shape: str,
    channel: str,
    value: float | None,
    ends: tuple[float, float] | None,
    shown: Conversion,
    *,
    frequency_hz: float | None = None,
    seconds: float | None = None,
) -> tuple[str, str]:
    """Return what a fault does, "true airspeed reads 4.00 m/s too high", and the interval of its size, "" for none.

    Parameters
    ----------
    value, ends : physical value and its 95 % interval, in SI; None where unknown.
    shown : unit of the value.
    seconds : time constant or duration of the shape, None where it has none.
    """
    entry = SHAPES[shape]
    subject = f"{channel_in_words(channel)} " if channel and entry.lines is None else ""
    if value is None or not math.isfinite(value):
        return (f"{subject}{entry.plainly}" if entry.plainly else f"{subject}shows a {entry.label}"), ""
    factor, unit = shown.factor, shown.unit
    if unit in ("1", "1/s"):  # of a share
        factor, unit = 0.01, unit.replace("1", "%", 1)
    size, sign = abs(value) / factor, math.copysign(1.0, value)
    between = None
    if ends is not None and all(map(math.isfinite, ends)):
        low, high = sorted(sign * end / factor for end in ends)
        between = (low, high)
    spread = None if between is None else 0.5 * (between[1] - between[0])
    says = entry.says or f"{entry.plainly} by {{size}}"
    effect = says.format(
        size=with_unit(number(size, spread=spread), unit),
        side="high" if sign > 0.0 else "low",
        way="up" if sign > 0.0 else "down",
        frequency="" if frequency_hz is None else f" at {number(frequency_hz)} Hz",
        seconds="" if seconds is None else duration(seconds),
    )
    return f"{subject}{effect}", "" if between is None else interval(between)


def intervals(size: str, onset: str) -> str:
    """Return " (95 %: size 3.99 to 4.02, onset 13.79 to 13.81 s)", "" where neither is known."""
    if size and onset:
        return f" (95 %: size {size}, onset {onset} s)"
    if size:
        return f" (size, 95 %: {size})"
    return f" (onset, 95 %: {onset} s)" if onset else ""


def estimate_in_words(estimate: FaultEstimate, units: Units, channel_unit: str, tolerance: float | None) -> str:
    """Return a declared fault: what it does, from when, its intervals, and that it is within its tolerance.

    Parameters
    ----------
    channel_unit : of its channel, where that is not standard; tolerance : of it, in SI.
    """
    fault, entry = estimate.fault, SHAPES[estimate.fault.shape]
    shown = units.of(estimate.physical_unit, channel=fault.channel, channel_unit=channel_unit)
    sized = entry.has_magnitude or entry.acts_on == "course"
    low, high = (estimate.physical_scale * end for end in estimate.ci95)
    effect, size = error_in_words(
        fault.shape,
        fault.channel,
        estimate.physical_value if sized else None,
        (low, high),
        shown,
        frequency_hz=fault.frequency_hz,
        seconds=fault.time_constant_s if fault.duration_s is None else fault.duration_s,
    )
    onset, between = instant(fault.onset_s), ""
    if estimate.onset_ci95 is not None and all(map(math.isfinite, estimate.onset_ci95)):
        spread = 0.5 * (estimate.onset_ci95[1] - estimate.onset_ci95[0])
        onset, between = number(fault.onset_s, spread=spread), interval(estimate.onset_ci95)
    until = "" if fault.offset_s is None else f" to {instant(fault.offset_s)}"
    small = ""
    if estimate.beyond_tolerance is False and tolerance is not None:
        small = f", within its tolerance of {change(tolerance, units.of(unit_of_channel(fault.channel, channel_unit)))}"
    return f"{effect} from {onset}{until} s{intervals(size, between)}{small}"


def unit_of_channel(name: str, channel_unit: str) -> str:
    """Return the SI unit of a channel, `channel_unit` of one that is not standard."""
    return STANDARD[name].unit if name in STANDARD else channel_unit


def candidate_lines(candidates: Sequence[Candidate], units: Units) -> dict[Label, list[str]]:
    """Return what is ruled out, still possible and not checked, the kinds of fault one after the other."""
    ruled: list[str] = []
    possible: list[str] = []
    unchecked: list[str] = []
    for kind in KINDS:
        noun, nouns = NOUNS[kind]
        same_kind = [candidate for candidate in candidates if candidate.kind == kind and candidate.state is not None]
        declared = any(candidate.state == "declared" for candidate in same_kind)
        asked = [candidate for candidate in same_kind if candidate.is_unseen]
        if not same_kind:
            unchecked.append(nouns)
        if not asked:
            continue
        worst = max(asked, key=lambda candidate: beside_tolerance(candidate.limit, candidate.tolerance))
        on = f" of {channel_in_words(worst.channel)}" if len({candidate.channel for candidate in same_kind}) > 1 else ""
        limit = shown_limit(worst, units)
        if all(candidate.state == "excluded" for candidate in asked):
            ruled.append(f"{'other ' if declared else ''}{nouns}{on} above {limit}")
        else:
            article = "another" if declared else "an" if noun[0] in "aeiou" else "a"
            possible.append(f"{article} {noun}{on} of {'any size' if limit is None else f'up to {limit}'}")
    spans = [candidate.onsets_checked for candidate in candidates if candidate.onsets_checked and candidate.is_unseen]
    if spans:
        first_s, last_s = max(span[0][0] for span in spans), min(span[-1][1] for span in spans)
        within = {(a[1], b[0]) for span in spans for a, b in pairwise(span)}
        between = "".join(f", from {instant(from_s)} to {instant(to_s)} s" for from_s, to_s in sorted(within))
        unchecked.append(f"faults that start before {instant(first_s)} s{between} or after {instant(last_s)} s")
    near_an_end = [candidate.name for candidate in candidates if candidate.state is None and candidate.note == UNTESTED]
    if near_an_end:
        start = f"'{near_an_end[0]}' starts" if len(near_an_end) == 1 else f"{len(near_an_end)} entries start"
        unchecked.append(f"{start} {UNTESTED}")
    return {"Ruled out": ruled, "Still possible": possible, "Not checked": unchecked}


def proof_in_words(proofs: Sequence[Proof], units: Units) -> list[str]:
    """Return by kind and channel how many faults were found, "20 of 20 steps of 0.3 m/s added to this log"."""
    several = len({proof.channel for proof in proofs}) > 1
    lines = []
    for proof in proofs:
        channel = channel_in_words(proof.channel) if proof.channel in STANDARD else proof.channel.replace("_", " ")
        size = change(proof.size, units.of(proof.unit, channel=proof.channel))
        what = f"{NOUNS[proof.kind][1]} of {size}{f' on {channel}' if several else ''}"
        lines.append(f"{proof.n_seen} of {proof.n_added} {what} added to this log")
    return lines


def beside_tolerance(error: float | None, tolerance: float | None) -> float:
    """Return the largest error that could hide over the tolerance; infinite without a limit or a tolerance."""
    return math.inf if error is None or not tolerance else error / tolerance


def suspect_in_words(candidate: Candidate) -> str:
    """Return a suspected candidate, "a step of true airspeed from 431 s: why"."""
    label = SHAPES[candidate.shape].label if candidate.shape in SHAPES else candidate.shape
    since = "" if candidate.onset_s is None else f" from {instant(candidate.onset_s)} s"
    return f"a {label} of {channel_in_words(candidate.channel)}{since}" + (
        f": {candidate.note}" if candidate.note else ""
    )


class Concluded(Protocol):
    """The answer of an analysis that looks for candidates."""

    @property
    def decision(self) -> Decision:
        """Limits of the kinds of fault that are required."""

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Looked for."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """For its reader."""

    @property
    def plausibility(self) -> tuple[Implausible, ...]:
        """What is wrong with channels throughout."""


class OfWindow(Concluded, Protocol):
    """The answer of an analysis of a window, as `identify` and `start-time` give it."""

    @property
    def faults(self) -> tuple[FaultEstimate, ...]:
        """Declared."""

    @property
    def proved(self) -> tuple[Proof, ...]:
        """What the limits are worth on the log."""


def screen_of(
    answer: Concluded,
    declared: Sequence[str],
    channel: str,
    units: Units,
    *,
    name: str = "",
    proved: Sequence[str] = (),
    commands: Sequence[str] = (),
) -> Screen:
    """Return the first screen of an answer: what is declared in it, and what could be there.

    Parameters
    ----------
    declared : each fault in words; channel, name : of the first, "" for none.
    proved : what the limits are worth, in words; commands : to run next.
    """
    if contradicted := contradiction(answer.plausibility, answer.notes, units):
        return contradicted
    suspects = [suspect_in_words(candidate) for candidate in answer.candidates if candidate.state == "suspected"]
    claims, notes = candidate_lines(answer.candidates, units), note_lines(answer.notes, units)
    if declared:
        headline: Headline = ("fault", channel, declared[0])
    else:
        headline = undeclared(answer.decision, answer.candidates, suspects, claims, units)
    state, channel, text = headline
    also = [*declared[1:], *(f"suspected: {suspect}" for suspect in suspects[0 if declared else 1 :])]
    lines: dict[Label, Iterable[str]] = {"Also": also, **claims, "Would have been found": proved, **notes}
    return Screen(
        state=state,
        channel=channel,
        text=text,
        name=name,
        lines=lines_of({**lines, "To decide": [*commands, *notes["To decide"]]}),
    )


def window_screen(
    answer: OfWindow, units: Units = SI, *, channel_units: Mapping[str, str], named: bool = False
) -> Screen:
    """Return the first screen of an analysis of a window: what is declared in it, and what could be there.

    Parameters
    ----------
    channel_units : of the outputs, by channel.
    named : whether faults have names of a dictionary.
    """
    # What surely lies within its tolerance comes last.
    faults = sorted(answer.faults, key=lambda estimate: estimate.beyond_tolerance is False)
    tolerances = {
        candidate.channel: candidate.tolerance for candidate in answer.candidates if candidate.tolerance is not None
    }
    texts = []
    for i, estimate in enumerate(faults):
        channel = estimate.fault.channel
        text = estimate_in_words(estimate, units, channel_units.get(channel, ""), tolerances.get(channel))
        texts.append(f"{text} [{estimate.name}]" if named and i else text)
    return screen_of(
        answer,
        texts,
        faults[0].fault.channel if faults else "",
        units,
        name=faults[0].name if faults and named else "",
        proved=proof_in_words(answer.proved, units),
    )


def contradiction(findings: Sequence[Implausible], notes: Sequence[Note], units: Units) -> Screen | None:
    """Return the first screen while channels contradict each other and nothing is concluded, None where they do not."""
    to_state = [finding for finding in findings if finding.is_open]
    if not to_state:
        return None
    first, *others = to_state
    lines = note_lines(notes, units)
    return Screen(
        state="cannot_tell",
        channel=next(iter(first.channels), ""),
        text=first.text,
        lines=lines_of(
            {
                "Also": [finding.text for finding in others],
                "Caution": lines["Caution"],
                "To decide": [*(finding.advice for finding in to_state), *lines["To decide"]],
            }
        ),
    )


def undeclared(
    decision: str,
    candidates: Sequence[Candidate],
    suspects: Sequence[str],
    claims: dict[Label, list[str]],
    units: Units,
) -> Headline:
    """Return the headline of a window in which nothing is declared, and take what it says out of the claims."""
    if decision == "fault":  # of a method that says that there is one, and no more
        return "fault", "", "the method raises an alarm and names no fault"
    if suspects:
        first = next(candidate for candidate in candidates if candidate.state == "suspected")
        return "suspected", first.channel, suspects[0]
    if decision == "no_fault":
        return "no_fault_found", "", "in this window"
    not_seen = [candidate for candidate in candidates if candidate.state == "not_seen"]
    if not not_seen:
        return "cannot_tell", "", "not every kind of fault could be checked"
    worst = max(not_seen, key=lambda candidate: beside_tolerance(candidate.limit, candidate.tolerance))
    several = len({candidate.channel for candidate in candidates if candidate.kind == worst.kind}) > 1
    nouns = NOUNS[worst.kind][1] + (f" of {channel_in_words(worst.channel)}" if several else "")
    limit = shown_limit(worst, units)
    size = "any size" if limit is None else f"up to {limit}"
    shown = units.of(worst.channel_unit, channel=worst.channel)
    allowed = "" if worst.tolerance is None else f" (allowed {change(worst.tolerance, shown)})"
    kinds = [kind for kind in KINDS if any(candidate.kind == kind for candidate in not_seen)]
    rest = [text for kind, text in zip(kinds, claims["Still possible"], strict=True) if kind != worst.kind]
    claims["Still possible"] = rest
    return "cannot_tell", worst.channel, f"{nouns} of {size} could hide{allowed}"


def note_lines(notes: Sequence[Note], units: Units) -> dict[Label, list[str]]:
    """Return what narrows an answer, and what its reader can do."""
    return {
        "Caution": [units.sentence(note.text) for note in notes if note.kind == "limit"],
        "To decide": [units.sentence(note.text) for note in notes if note.kind == "advice"],
    }
