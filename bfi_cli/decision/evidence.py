"""What one source says of a window: the faults that it declares, and what became of all that it looked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..faults import FaultEstimate
from ..notes import Note
from .candidate import Candidate

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
    notes : what limits the source, in sentences.
    manoeuvres : in which what a model of the window declares may be the aircraft's own motion.
    findings : on channels that are wrong throughout the flight.
    """

    source: str
    faults: tuple[FaultEstimate, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    notes: tuple[Note, ...] = ()
    manoeuvres: tuple[Manoeuvre, ...] = ()
    findings: tuple[Implausible, ...] = ()
