"""Flight that no analysis covered, and what a log lacks: named, so that silence is not taken for health."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from ..flightlog.phases import AIRBORNE, NO_AIRSPEED, PARTS, note_on_rotors, spans_of
from ..kernels.runs import left_of, union
from ..quantities.text import quantity
from .flight import Flight
from .limits import AIRSPEEDS, PITOT_LINE, Bounds
from .looks import GLANCE_S, Scanned
from .parity import LENGTHS_S, available
from .parity.windows import Window, overlaps
from .result import Event, FlightLimit

# Half a minute of flight: what is shorter narrows a claim by less than the onsets of slow faults are uncertain.
LEAST_S = 30.0
# A step is told where it lies so far inside of a window of the scan: the overlap of these is twice that.
STEP_MARGIN_S = 15.0

NO_SPEED = "no airspeed is recorded, or none that is right"
# By residual, what its lack costs.
BOUNDS = {
    "lift": "the lift does not bound the airspeed and the angle of attack",
    "climb": "the climb angle does not bound pitch and angle of attack",
    "kinematics": "the inertial acceleration does not bound the airspeed",
    "ground_speed": "the ground speed does not bound the airspeed",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Unwatched:
    """A stretch of flight that one analysis did not cover, and why."""

    from_s: float
    to_s: float
    why: str

    @property
    def seconds(self) -> float:
        return self.to_s - self.from_s


def flown_of(flight: Flight) -> list[Window]:
    """Return the flight within the part that is diagnosed, from screen height to screen height.

    Time without a phase has no airspeed; it counts as flight where it follows or precedes flight.
    """
    parts = sorted((phase for phase in flight.part_phases if phase.phase in PARTS), key=lambda phase: phase.from_s)
    airborne = [phase.phase in AIRBORNE for phase in parts]
    flown = [(phase.from_s, phase.to_s) for phase, flies in zip(parts, airborne, strict=True) if flies]
    gaps = pairwise([flight.from_s, *(time_s for phase in parts for time_s in (phase.from_s, phase.to_s)), flight.to_s])
    for (first, last), beside in zip([*gaps][::2], pairwise([False, *airborne, False]), strict=True):
        if last > first and any(beside):
            flown.append((first, last))
    return union(flown)


def unwatched_by_scan(
    flight: Flight, bounds: Sequence[Bounds], events: Sequence[Event], stand: Sequence[Event]
) -> list[Unwatched]:
    """Return where no window bounds a slow fault of the pitot line, or of an airspeed, that begins there.

    A window bounds an airspeed by its residuals, or by its relation to another.

    Parameters
    ----------
    events : that finders proposed; stand : those that were confirmed or are suspected.
    """
    drifts = [hidden for windows in bounds for hidden in windows if hidden.shape == "drift"]
    unbounded: list[tuple[Window, str]] = []
    for name in (PITOT_LINE, *(name for name in AIRSPEEDS if name in flight.recorded)):
        watched = union([stretch for hidden in drifts if hidden.fault == name for stretch in hidden.watched])
        for piece in left_of(flown_of(flight), watched):
            if piece[1] - piece[0] >= LEAST_S:
                unbounded.append((piece, "the pitot line" if name == PITOT_LINE else name))
    lasting = [(event.onset_s, event.until_s) for event in stand]
    masked = [event.shown_s for event in events if event.state == "declared"]
    fault, other = "the fault there masks others", "what looks like a fault masks others"
    reasons = _reasons(flight, [(window, fault if overlaps(window, lasting) else other) for window in masked])
    parts = [(phase.from_s, phase.to_s) for phase in flight.part_phases]
    stretches = [*parts, *(piece for piece, _ in unbounded), *(window for window, _ in reasons)]
    known = spans_of(flight.part_phases, PARTS)
    pieces = []
    # A reason holds in all of a piece between two cuts, or in none of it; so does a phase.
    for first, last in pairwise(sorted({time_s for stretch in stretches for time_s in stretch})):
        names = [name for piece, name in unbounded if piece[0] <= first and last <= piece[1]]
        why = next((why for window, why in reasons if window[0] <= first and last <= window[1]), None)
        if left_of([(first, last)], known) == [(first, last)]:
            why = NO_SPEED
        if names:
            why = why or f"nothing bounds a slow fault of {', '.join(names)} that begins there"
            pieces.append(Unwatched(from_s=first, to_s=last, why=why))
    return _long(pieces)


def _reasons(flight: Flight, masked: Sequence[tuple[Window, str]]) -> list[tuple[Window, str]]:
    """Return the stretches in which slow faults are not looked for, and why, the first that holds first."""
    return [
        *((span, NO_SPEED) for span in spans_of(flight.part_phases, (NO_AIRSPEED,))),
        *masked,
        *((span, "parabola: no slow fault is looked for") for span in spans_of(flight.part_phases, ("parabola",))),
        *((window, "flaps or gear may move") for window in flight.moved),
    ]


def unwatched_by_steps(flight: Flight, windows: Sequence[Window]) -> list[Unwatched]:
    """Return where no window of the scan for steps looked; `windows` are those that were scanned."""
    covered = [(first + STEP_MARGIN_S, last - STEP_MARGIN_S) for first, last in windows]
    why = f"no window of {GLANCE_S:g} s could be scanned for steps and oscillations"
    left = left_of(flown_of(flight), union(covered))
    return _long([Unwatched(from_s=first, to_s=last, why=why) for first, last in left])


def unwatched_by_lines(flight: Flight) -> list[Unwatched]:
    """Return where a blocked pressure line would not have been seen."""
    stretches = [
        Unwatched(
            from_s=max(line.from_s, flight.from_s),
            to_s=min(line.to_s, flight.to_s),
            why=f"{line.fault} {line.what}: {line.why}",
        )
        for line in flight.held.unseen
    ]
    return sorted((stretch for stretch in stretches if stretch.seconds >= LEAST_S), key=lambda stretch: stretch.from_s)


def _long(pieces: Sequence[Unwatched]) -> list[Unwatched]:
    """Return runs of pieces of half a minute and more, a short piece of a run with the longer of its neighbours."""
    runs: list[list[Unwatched]] = []
    for piece in pieces:
        if not runs or piece.from_s > runs[-1][-1].to_s:
            runs.append([piece])
        elif piece.why == runs[-1][-1].why:
            runs[-1][-1] = replace(runs[-1][-1], to_s=piece.to_s)
        else:
            runs[-1].append(piece)
    long_enough = []
    for run in runs:
        while len(run) > 1 and min(piece.seconds for piece in run) < LEAST_S:
            k = min(range(len(run)), key=lambda k: run[k].seconds)
            other = max((j for j in (k - 1, k + 1) if 0 <= j < len(run)), key=lambda j: run[j].seconds)
            first, last = sorted((k, other))
            run[first : last + 1] = [replace(run[first], to_s=run[last].to_s, why=run[other].why)]
        long_enough += [piece for piece in run if piece.seconds >= LEAST_S - 1e-6]
    return long_enough


def missing_sentences(flight: Flight, scanned: Sequence[Scanned], limits: Sequence[FlightLimit]) -> tuple[str, ...]:
    """Return a sentence for each residual that the log does not allow, with what is seen without it.

    Parameters
    ----------
    scanned : the windows in which a residual is known.
    """
    kinds, lacking = available(flight.record.channels)
    for scan in scanned:
        lacking.update(scan.lacking)
    used = {name for scan in scanned for name in scan.residuals}
    mostly = next((limit for limit in limits if limit.fault == PITOT_LINE and limit.holds_in < 1.0), None)
    cost = ""
    if mostly is not None and mostly.effect is not None:
        within = f"{quantity(mostly.effect, 'm/s')} in {mostly.to_s - mostly.from_s:.0f} s"
        cost = f"; in most of the flight a slow fault of the airspeed below {within} passes unseen"
    sentences = [note.text for note in note_on_rotors(flight.part_phases)]
    lost = spans_of(flight.part_phases, (NO_AIRSPEED,))
    if without := [f"{from_s:.0f} to {to_s:.0f} s" for from_s, to_s in lost]:
        more = f" and {len(without) - 3} times more" if len(without) > 3 else ""
        sentences.append(
            f"from {', from '.join(without[:3])}{more} no airspeed shows the flight that other channels show: nothing "
            "else was looked for there"
        )
    for name, channels in lacking.items():
        if name not in used:
            sentences.append(f"no {channels}: {BOUNDS[name]}{cost}")
            cost = ""
    if not any(flight.windows(length_s) for length_s in LENGTHS_S):
        shortest = f"{min(LENGTHS_S):g} s of flight between take-off and landing"
        sentences.append(f"no slow fault was looked for: no {shortest}")
    elif not kinds:
        sentences.append("no slow fault was looked for: nothing bounds the airspeed")
    elif not scanned:
        sentences.append("no slow fault was looked for: most samples of every window are missing")
    return tuple(sentences)
