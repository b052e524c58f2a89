"""What one source says of a window: the faults that it declares, and what became of all that it looked for.

What another source finds at an entry of a dictionary is that entry.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..faults import Fault, FaultEstimate
from ..faults.shapes import SHAPES, Shape
from ..kernels import FloatArray
from ..kernels.runs import runs
from ..notes import Note
from .candidate import Candidate, with_limit

if TYPE_CHECKING:  # its package needs the configuration, which needs this one
    from .implausible import Implausible


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


# Samples by which an estimated onset may lie outside of its interval: one for the estimate, half a one for the
# resampling. Cycles in the window by which a frequency may miss: half of what a window resolves.
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
    low, high = fault.onset_ci95 or (estimated.onset_s, estimated.onset_s)
    return low - ONSET_SAMPLES / rate_hz <= entry.onset_s <= high + ONSET_SAMPLES / rate_hz


def _declared(candidate: Candidate, fault: FaultEstimate) -> Candidate:
    """Return an entry as declared, with the magnitude of a fault in the entry's own measure."""
    scale, _ = candidate.meaning
    magnitude = fault.physical_value / scale
    sd = fault.sd * abs(magnitude / fault.magnitude) if fault.magnitude else fault.sd
    kind = SHAPES[candidate.shape].kind
    return with_limit(candidate, None, None, kind=kind, state="declared", magnitude=magnitude, sd=sd, note=None)
