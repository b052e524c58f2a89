"""What one source says of a window: the faults that it declares, and what became of all that it looked for."""

from __future__ import annotations

from dataclasses import dataclass

from ..faults import FaultEstimate
from ..notes import Note
from .candidate import Candidate


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The evidence of one source, each at its share of the level (see `bfi_cli.decision.conclude`).

    Attributes
    ----------
    source : "dictionary" (entries at stated onsets), "scan" (every onset of the window), "physics" (relations between
        channels, pressure lines, lift and inertia), "detector" and "flight" (`bfi detect`, `bfi diagnose`).
    faults : that it declares.
    candidates : what it looked for, declared, suspected, excluded or not seen; its limits hold at its share.
    notes : what limits the source, in sentences.
    """

    source: str
    faults: tuple[FaultEstimate, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    notes: tuple[Note, ...] = ()
