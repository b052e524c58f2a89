"""A fault that was looked for, the state that it ends in, and what one source says of all of them.

"No fault" is a claim about size. Every candidate ends in one state:

declared   : it is in the log;
suspected  : it was favoured and then declined, or two sources disagree about it;
excluded   : had it been there with an effect beyond the channel's tolerance, it would have been declared;
not_seen   : none of these: a fault beyond the tolerance could be there unseen.

A limit holds for onsets that could be tested, and only for what may not stand in place of a declared fault. What
another source finds at an entry of a dictionary is that entry.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np

from ..faults import Fault, FaultEstimate, build_up_s, magnitude_unit, meaning, physical
from ..faults.shapes import SHAPES, Kind, Shape
from ..kernels import TWO_SIDED_95, FloatArray
from ..kernels.runs import runs
from ..notes import Note
from ..quantities.channels import LARGEST_ERROR
from ..quantities.text import SI, Units, change
from .implausible import Implausible

State = Literal["declared", "suspected", "excluded", "not_seen"]
KINDS: tuple[Kind, ...] = get_args(Kind)
# A lag of 5 s reaches nine tenths of its size in 11.5 s, a ramp over 10 s in 9 s: those that a claim about steps covers
# (`onset.claims.BUILT_UP`). What takes longer cannot be told from a drift in a window of a minute or two.
BUILD_UP_S = 12.0
# Attributes of a candidate that are None where they are not finite.
SIZES = ("magnitude", "sd", "minimal_detectable", "minimal_detectable_scan", "excluded_above", "effect", "seen_above")


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
    seen_above : error, no less than `effect`, from which on a fault would be declared or suspected with 90 % power, at
        95 % of the onsets, frequencies and time constants covered; None where it is not known.
    onset_s : of an entry of a dictionary, on the log's axis; None where all onsets were looked at.
    note : why it is left out, suspected or not seen.
    onsets_checked : (from, to), s, of the onsets that were searched and at which the limit holds; None for an entry
        with a stated onset.
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
    seen_above: float | None = None
    tolerance: float | None = None
    channel_unit: str = ""
    onset_s: float | None = None
    note: str | None = None
    physical_scale: float | None = None
    physical_unit: str | None = None
    onsets_checked: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        for name in SIZES:
            object.__setattr__(self, name, finite(getattr(self, name)))

    @property
    def is_unseen(self) -> bool:
        """Whether it is neither declared nor suspected nor left out, so that its limit counts."""
        return self.state in ("excluded", "not_seen")

    @property
    def limit(self) -> float | None:
        """The largest error that may hide, None where that is as large as any reading of the channel can be wrong."""
        return self.effect if (self.effect or 0.0) <= LARGEST_ERROR.get(self.channel, math.inf) else None

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


def with_limit(
    candidate: Candidate,
    effect: float | None,
    excluded_above: float | None,
    seen_above: float | None = None,
    **changes: Any,
) -> Candidate:
    """Return a candidate with another limit and the state that follows; a declared or suspected one keeps its own."""
    state = candidate.state
    if candidate.is_unseen:
        state = state_of(declared=False, suspected=False, effect=effect, tolerance=candidate.tolerance)
    limits = {"effect": effect, "excluded_above": excluded_above, "seen_above": seen_above}
    return replace(candidate, **{"state": state, **limits, **changes})


def beyond_tolerance(effect: float, magnitude: float, sd: float, tolerance: float | None) -> bool | None:
    """Return whether the error of a fault surely exceeds, or surely keeps within, a tolerance; None where neither.

    Parameters
    ----------
    effect : the largest error by a fault of this magnitude, whose 95 % interval decides.
    """
    if tolerance is None or not magnitude or not math.isfinite(sd):
        return None
    spread = TWO_SIDED_95 * sd / abs(magnitude)
    if effect * (1.0 + spread) <= tolerance:
        return False
    return True if effect * (1.0 - spread) > tolerance else None


def candidate_of(
    fault: Fault,
    channel_unit: str,
    *,
    declared: bool = False,
    suspected: bool = False,
    magnitude: float | None = None,
    sd: float | None = None,
    effect: float | None = None,
    tolerance: float | None = None,
    **others: Any,
) -> Candidate:
    """Return what became of a fault that was looked for, with the kind and the state that follow.

    Parameters
    ----------
    magnitude, sd, effect, tolerance : see `Candidate`; None or not finite where unknown.
    others : further attributes of `Candidate`, or some in place of those that follow; the name is that of the fault, or
        its shape, where none is given.
    """
    scale, unit = meaning(fault, channel_unit)
    defaults = {
        "name": fault.called,
        "kind": kind_of(fault, declared=declared),
        "state": state_of(declared=declared, suspected=suspected, effect=effect, tolerance=tolerance),
    }
    return Candidate(
        shape=fault.shape,
        channel=fault.channel,
        magnitude=magnitude,
        unit=magnitude_unit(fault, channel_unit),
        sd=sd,
        effect=effect,
        tolerance=tolerance,
        channel_unit=channel_unit,
        physical_scale=scale,
        physical_unit=unit,
        **{**defaults, **others},
    )


def estimate_of(
    fault: Fault,
    magnitude: float,
    sd: float,
    channel_unit: str,
    *,
    effect: float | None = None,
    tolerance: float | None = None,
    quantile: float = TWO_SIDED_95,
    **others: Any,
) -> FaultEstimate:
    """Return the estimate of a declared fault, its interval, and how its error compares with a tolerance.

    Parameters
    ----------
    effect : the largest error that it makes on its channel, None where that is not known.
    quantile : standard deviations to each side of the interval.
    others : further attributes of `FaultEstimate`; the name is that of the fault, or its shape, where none is given.
    """
    value, physical_unit = physical(fault, magnitude, channel_unit)
    defaults = {"name": fault.called, "unit": magnitude_unit(fault, channel_unit)} | others
    return FaultEstimate(
        fault=fault,
        magnitude=magnitude,
        physical_value=value,
        physical_unit=physical_unit,
        sd=sd,
        ci95=(magnitude - quantile * sd, magnitude + quantile * sd),
        effect=effect,
        beyond_tolerance=None if effect is None else beyond_tolerance(effect, magnitude, sd, tolerance),
        **defaults,
    )


def shown_limit(candidate: Candidate, units: Units = SI) -> str | None:
    """Return the largest error that may hide, to two digits with its unit; None where any may."""
    if candidate.limit is None:
        return None
    return change(candidate.limit, units.of(candidate.channel_unit, channel=candidate.channel))


def share_of(effect: float | None, tolerance: float | None) -> float:
    """Return an error that may hide over its tolerance: infinite where any may, itself where there is no tolerance."""
    return math.inf if effect is None else effect / tolerance if tolerance else effect


def finite(value: float | None) -> float | None:
    """Return a number, None for one that is unknown or not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


# The note of an entry of a dictionary that counts for no verdict, since no analysis of the window could tell.
UNTESTED = "too near an end of the window"
NOT_EXACT = "no claim where its onset is not exact{} (--onset-tolerance 0)"
IN_PLACE = "in place of what is declared it would explain the log nearly as well"


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """How many faults of the size that an answer excludes were seen by the same analysis when added to the same log.

    Attributes
    ----------
    kind : of the faults; channel : that they were added to, or a pressure line by its fault.
    size : largest error or slope that the answer does not exclude, in `unit`.
    n_seen : declared or suspected, of this kind and at their onsets; n_added : faults that were added, one at a time.
    """

    kind: Kind
    channel: str
    size: float
    unit: str
    n_seen: int = field(metadata={"key": "found"})
    n_added: int = field(metadata={"key": "of"})


def untested(candidate: Candidate) -> Candidate:
    """Return a candidate that begins where no claim is made: it narrows the claim, and is no doubt of it.

    One that is declared or suspected stays so.
    """
    return with_limit(candidate, None, None, state=None, note=UNTESTED) if candidate.is_unseen else candidate


def with_limit_of_scan(candidate: Candidate, scanned: Candidate | None) -> Candidate:
    """Return a candidate whose onset is known to a tolerance only, excluded by what a scan over all onsets excludes.

    Parameters
    ----------
    scanned : what became of the same fault in the scan; None where the window is not scanned.
    """
    if not candidate.is_unseen:
        return candidate
    if scanned is None:
        bounded = with_limit(candidate, None, None, note=NOT_EXACT.format(" and the window is not scanned"))
    else:
        bounded = with_limit(candidate, scanned.effect, scanned.excluded_above, scanned.seen_above, note=scanned.note)
        bounded = untested(bounded) if scanned.state is None else bounded
    # What is left out as the same signal as another entry says so.
    return replace(bounded, note=candidate.note) if candidate.magnitude is None else bounded


def not_excluded(candidates: Sequence[Candidate], rivals: Collection[tuple[str, str]]) -> tuple[Candidate, ...]:
    """Return candidates with none excluded that may stand in place of a declared fault.

    Parameters
    ----------
    rivals : shape and channel of what may.
    """
    return tuple(
        with_limit(candidate, None, None, note=IN_PLACE)
        if candidate.state == "excluded" and (candidate.shape, candidate.channel) in rivals
        else candidate
        for candidate in candidates
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """A stretch of flight that no linear model of one trim follows.

    Attributes
    ----------
    name : "stall" or "parabola"; from_s, to_s : on the axis of the log.
    beside_s : how long before and after it the aircraft is still far from its trim.
    """

    name: str
    from_s: float
    to_s: float
    beside_s: float

    @property
    def reach_s(self) -> tuple[float, float]:
        """Start and end of what it disturbs."""
        return self.from_s - self.beside_s, self.to_s + self.beside_s


Spans = tuple[tuple[float, float], ...]

# Share of the onsets, frequencies or time constants, and of the watched time of a flight, at which what an answer says
# of a fault holds: a reader can rely on it, as the worst stretch of an hour tells of itself only.
MOSTLY = 0.95
# Shapes that a claim about steps is about: they build up within `BUILD_UP_S`, and last.
STEPS: tuple[Shape, ...] = tuple(
    name for name, shape in SHAPES.items() if shape.kind == "abrupt" and shape.course is not None
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnsetBound:
    """How large an error by a step, a lag or a ramp may be unseen, by its onset.

    Attributes
    ----------
    channel : that errs.
    onsets_s : (n,) ascending, on the log's axis; errors : (n,) at each the largest, infinite where any may be.
    """

    channel: str
    onsets_s: FloatArray
    errors: FloatArray

    def over(self, spans_s: Spans, tolerance: float | None) -> tuple[float, Spans]:
        """Return the largest error at the onsets of some spans, and the spans: infinite where some are not bounded.

        Where it is beyond the tolerance, but within that at most of the onsets, it is that of these, and so are the
        spans.
        """
        inside, held = list[FloatArray](), list[tuple[float, float]]()
        for from_s, to_s in spans_s:
            first = int(np.searchsorted(self.onsets_s, from_s, side="right")) - 1
            last = int(np.searchsorted(self.onsets_s, to_s, side="left"))
            if first < 0 or last >= len(self.onsets_s):
                return math.inf, spans_s
            errors, onsets_s = self.errors[first : last + 1], self.onsets_s[first : last + 1]
            inside.append(errors)
            if tolerance is not None:
                ends_s = [(onsets_s[start], onsets_s[end - 1]) for start, end in runs(errors <= tolerance)]
                held += [(max(from_s, float(low)), min(to_s, float(high))) for low, high in ends_s]
        every = np.concatenate(inside)
        largest = float(every.max())
        if tolerance is None or largest <= tolerance or np.mean(every <= tolerance) < MOSTLY:
            return largest, spans_s
        return float(every[every <= tolerance].max()), tuple((low, high) for low, high in held if low < high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The evidence of one source, each at its share of the level (see `bfi_cli.decision.conclude`).

    Attributes
    ----------
    source : "dictionary" (entries at stated onsets), "scan" (every onset of the window), "physics" (relations between
        channels, pressure lines, lift and inertia), "phases" (manoeuvres), "arithmetic" (channels that are wrong
        throughout), "detector" and "flight" (`bfi detect`, `bfi diagnose`).
    faults : that it declares.
    candidates : what it looked for, declared, suspected, excluded or not seen; its limits hold at its share.
    bounds : of steps of a channel by their onset, at its share too.
    since_start : by channel that oscillates from the window's start on, maybe beyond its tolerance, what shows it.
    notes : what limits the source, in sentences.
    manoeuvres : in which what a model of the window declares may be the aircraft's own motion.
    findings : on channels that are wrong throughout the flight.
    """

    source: str
    faults: tuple[FaultEstimate, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    bounds: tuple[OnsetBound, ...] = ()
    since_start: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    manoeuvres: tuple[Manoeuvre, ...] = ()
    findings: tuple[Implausible, ...] = ()


# Samples by which an estimated onset may miss the true one: one for the estimate, half a one for the resampling. Cycles
# in the window by which a frequency may: half of what a window resolves.
ONSET_SAMPLES, FREQUENCY_CYCLES = 1.5, 0.5


def at_entries(
    stated: Evidence, searched: Evidence, entries: Sequence[Fault], *, rate_hz: float, duration_s: float
) -> tuple[Evidence, Evidence]:
    """Return the evidence of a dictionary, and that of another source, with each fault at an entry as that entry.

    The entry is declared, by the name that the dictionary gives it and with the magnitude that the source estimates;
    onset and parameters are those that it found.

    Parameters
    ----------
    stated : with one candidate per entry, in their order; entries : with their onsets on the axis of the log.
    searched : the search over all onsets, or physics.
    rate_hz, duration_s : of the record.
    """
    known, faults, taken = list(stated.candidates), list[FaultEstimate](), set[str]()
    for fault in searched.faults:
        at = [
            k
            for k, entry in enumerate(entries)
            if known[k].name not in taken and _is_of_entry(fault, entry, rate_hz=rate_hz, duration_s=duration_s)
        ]
        if at:
            nearest = min(at, key=lambda k: abs(entries[k].onset_s - fault.fault.onset_s))
            name = known[nearest].name
            taken.add(name)
            if known[nearest].state != "declared":
                known[nearest] = _declared(known[nearest], fault)
            fault = replace(fault, name=name, fault=replace(fault.fault, name=name))
        faults.append(fault)
    left = {(estimate.fault.shape, estimate.fault.channel) for estimate in faults if estimate.name not in taken}
    remaining = tuple(
        candidate
        for candidate in searched.candidates
        if candidate.state != "declared" or (candidate.shape, candidate.channel) in left
    )
    return replace(stated, candidates=tuple(known)), replace(searched, faults=tuple(faults), candidates=remaining)


def _is_of_entry(fault: FaultEstimate, entry: Fault, *, rate_hz: float, duration_s: float) -> bool:
    """Say whether a fault has the shape, the channel and the frequency of an entry, and its onset in its interval."""
    estimated = fault.fault
    both_oscillate = {estimated.shape, entry.shape} <= {"sine", "cosine"}  # which differ by a phase that is estimated
    if estimated.channel != entry.channel or not (estimated.shape == entry.shape or both_oscillate):
        return False
    beside_hz = (entry.frequency_hz or 0.0) - (estimated.frequency_hz or 0.0)
    if both_oscillate and abs(beside_hz) * duration_s > FREQUENCY_CYCLES:
        return False
    low, high = fault.onset_span_s
    return low - ONSET_SAMPLES / rate_hz <= entry.onset_s <= high + ONSET_SAMPLES / rate_hz


def _declared(candidate: Candidate, fault: FaultEstimate) -> Candidate:
    """Return an entry as declared, with the magnitude of a fault in the entry's own measure."""
    scale, _ = candidate.meaning
    magnitude = fault.physical_value / scale
    sd = fault.sd * abs(magnitude / fault.magnitude) if fault.magnitude else fault.sd
    kind = SHAPES[candidate.shape].kind
    return with_limit(candidate, None, None, kind=kind, state="declared", magnitude=magnitude, sd=sd, note=None)
