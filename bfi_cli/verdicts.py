"""What is said of every fault that was looked for, and the verdicts on the three kinds of fault that follow.

"No fault" is a claim about size. Every candidate ends in one state:

declared   : it is in the log;
suspected  : it was favoured and then declined, or two analyses of the same window disagree about it;
excluded   : had it been there with an effect beyond the channel's tolerance, it would have been declared;
not_seen   : none of these: a fault beyond the tolerance could be there unseen.

The verdict on a kind of fault is `fault` where one of it is declared, `no_fault` where all its candidates are excluded,
and `inconclusive` otherwise. The decision is the worst of the kinds that are required (docs/theory.md, 8).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from .channels import LARGEST_ERROR
from .display_units import SI, Units
from .faults import Decision, Fault, build_up_s
from .shapes import SHAPES, Kind

__all__ = ["BUILD_UP_S", "KINDS", "UNTESTED", "Candidate", "State", "decide", "kind_of", "shown_limit", "state_of"]
__all__ += ["summarise", "two_digits", "verdicts_of"]

State = Literal["declared", "suspected", "excluded", "not_seen"]
KINDS: tuple[Kind, ...] = get_args(Kind)
# A lag of 5 s reaches nine tenths of its size in 11.5 s, a ramp over 10 s in 9 s: those that a claim about steps covers
# (`onset.claims.BUILT_UP`). What takes longer cannot be told from a drift in a window of a minute or two.
BUILD_UP_S = 12.0
# The note of an entry of a dictionary that counts for no verdict, since no analysis of the window could tell.
UNTESTED = "too near an end of the window"
# The note of a scan on the frequencies that it covers.
BAND = re.compile(r"of \S+ to \S+ Hz")
NOUNS: Mapping[Kind, tuple[str, str]] = {
    "abrupt": ("step", "a step"),
    "oscillating": ("oscillation", "an oscillation"),
    "slow": ("slow fault", "a slow fault"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A fault that was looked for, and what became of it.

    Attributes
    ----------
    kind : the verdict that it counts for.
    state : None for an entry of the dictionary that was left out, which counts for none.
    magnitude, sd : of a declared fault its estimate, of another what it would be if it were added; None where unknown.
    unit : of the magnitudes; channel_unit : of effect and tolerance.
    physical_scale, physical_unit : what a magnitude of 1 means, 0.23 m/s^2 for a drift with that slope; None where the
        magnitudes mean themselves.
    minimal_detectable : magnitude that would be declared with 90 % power at the onset as well as it is known;
        minimal_detectable_scan : the same of the scan over all onsets, the median over these.
    excluded_above : magnitude beyond which the log excludes the fault, at the worst of the onsets covered.
    effect : largest error that this magnitude makes on the channel within the window; tolerance : of the channel.
    onset_s : of an entry of a dictionary, on the log's axis; None where all onsets were looked at.
    note : why it is left out, suspected or not seen.
    """

    name: str
    shape: str
    channel: str
    kind: Kind
    state: State | None
    magnitude: float | None
    unit: str
    sd: float | None
    minimal_detectable: float | None = None
    minimal_detectable_scan: float | None = None
    excluded_above: float | None = None
    effect: float | None = None
    tolerance: float | None = None
    channel_unit: str = ""
    onset_s: float | None = None
    note: str | None = None
    physical_scale: float | None = None
    physical_unit: str | None = None

    @property
    def limit(self) -> float | None:
        """The largest error that may hide, None where that is as large as any reading of the channel can be wrong."""
        if self.effect is None or not math.isfinite(self.effect):
            return None
        return None if self.effect > LARGEST_ERROR.get(self.channel, math.inf) else self.effect

    @property
    def meaning(self) -> tuple[float, str]:
        """What a magnitude of 1 means: value and unit."""
        scale, unit = self.physical_scale, self.physical_unit
        return (1.0, self.unit) if scale is None or unit is None else (scale, unit)


def kind_of(fault: Fault, *, declared: bool) -> Kind:
    """Return the kind of a fault: of a declared one that of its shape, else that of the claim which excludes it.

    A lag or a ramp that builds up too slowly for a claim about steps is excluded by what excludes slow faults.
    """
    kind, seconds = SHAPES[fault.shape].kind, build_up_s(fault)
    if kind == "abrupt" and not declared and (seconds is None or seconds > BUILD_UP_S):
        return "slow"
    return kind


def state_of(*, declared: bool, suspected: bool, effect: float | None, tolerance: float | None) -> State:
    """Return the state of a candidate from what the analysis says and from the largest error that may hide."""
    if declared:
        return "declared"
    if suspected:
        return "suspected"
    if effect is None or tolerance is None or not effect <= tolerance:
        return "not_seen"
    return "excluded"


def verdicts_of(candidates: Iterable[Candidate]) -> dict[Kind, Decision]:
    """Return the verdict on each kind of fault; a kind of which no fault was looked for is inconclusive."""
    states: dict[Kind, set[State]] = {kind: set() for kind in KINDS}
    for one in candidates:
        if one.state is not None:
            states[one.kind].add(one.state)
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
    return "; ".join(_of_kind(kind, verdicts[kind], candidates, units) for kind in KINDS if verdicts[kind] != "fault")


def _of_kind(kind: Kind, verdict: Decision, candidates: Sequence[Candidate], units: Units) -> str:
    noun, one_noun = NOUNS[kind]
    of_kind = [one for one in candidates if one.kind == kind and one.state not in (None, "declared")]
    if not of_kind:
        return f"{one_noun} was not looked for"
    suspects = [one.name for one in sorted(of_kind, key=_prominence, reverse=True) if one.state == "suspected"]
    worst = max(of_kind, key=_share)
    on = f" on {worst.channel}" if len({one.channel for one in of_kind}) > 1 else ""
    limit = shown_limit(worst, units)
    if verdict == "no_fault":
        # The claim of a scan ends with the frequencies that it looked at; those of a dictionary are in its table.
        band = next((f" {one.note}" for one in of_kind if one.onset_s is None and BAND.fullmatch(one.note or "")), "")
        return f"no {noun}{band} above {limit}{on}"
    if suspects:
        return f"{one_noun} is suspected ({', '.join(suspects[:3])}{', ...' if len(suspects) > 3 else ''})"
    if limit is None:
        # The worst of the entries of a dictionary decides, and the others may be bounded well.
        which = f" ({worst.name}: {worst.note})" if worst.note and worst.onset_s is not None else ""
        return f"{one_noun} of any size could be there unseen{on}{which}"
    return f"{one_noun} could reach {limit}{on} unseen"


def _prominence(one: Candidate) -> float:
    """Return how far a candidate stands out of what could be declared; what a scan declares has no such size."""
    if one.minimal_detectable is None or one.magnitude is None:
        return math.inf
    return abs(one.magnitude) / one.minimal_detectable if one.minimal_detectable else math.inf


def _share(one: Candidate) -> float:
    """Return the largest hidden error over the tolerance."""
    if one.effect is None or not math.isfinite(one.effect):
        return math.inf
    return one.effect / one.tolerance if one.tolerance else one.effect


def shown_limit(one: Candidate, units: Units = SI) -> str | None:
    """Return the largest error that may hide, to two digits with its unit; None where any may."""
    if one.limit is None:
        return None
    shown = units.of(one.channel_unit, channel=one.channel)
    value = one.limit / shown.factor
    return two_digits(value) if shown.unit == "1" else f"{two_digits(value)} {shown.unit}".rstrip()


def two_digits(value: float) -> str:
    """Return a size to two digits, from a hundred on to the whole number: it has no exponent."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.2g}"
