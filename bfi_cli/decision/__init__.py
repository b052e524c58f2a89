"""The decision: evidence from every source, and one conclusion."""

from .candidate import (
    BUILD_UP_S,
    KINDS,
    MOSTLY,
    NOT_EXACT,
    STEPS,
    UNTESTED,
    Candidate,
    Evidence,
    Manoeuvre,
    OnsetBound,
    Proof,
    State,
    at_entries,
    beyond_tolerance,
    candidate_of,
    estimate_of,
    finite,
    kind_of,
    not_excluded,
    shown_limit,
    state_of,
    two_digits,
    untested,
    with_limit,
    with_limit_of_scan,
)
from .conclude import WITHHELD, Conclusion, conclude, decide, summarise, verdicts_of

__all__ = [
    "BUILD_UP_S",
    "KINDS",
    "MOSTLY",
    "NOT_EXACT",
    "STEPS",
    "UNTESTED",
    "WITHHELD",
    "Candidate",
    "Conclusion",
    "Evidence",
    "Manoeuvre",
    "OnsetBound",
    "Proof",
    "State",
]
__all__ += ["at_entries", "beyond_tolerance", "candidate_of", "conclude", "decide", "estimate_of", "finite", "kind_of"]
__all__ += ["not_excluded", "shown_limit", "state_of", "summarise", "two_digits", "untested"]
__all__ += ["verdicts_of", "with_limit", "with_limit_of_scan"]
