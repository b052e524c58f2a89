"""The decision: evidence from every source, and one conclusion."""

from .candidate import (
    KINDS,
    MOSTLY,
    NOT_EXACT,
    ONSET_SAMPLES,
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
    share_of,
    shown_limit,
    untested,
    with_limit,
    with_limit_of_scan,
)
from .conclude import NOUNS, WITHHELD, Conclusion, conclude, decide, verdicts_of

__all__ = [
    "KINDS",
    "MOSTLY",
    "NOT_EXACT",
    "NOUNS",
    "ONSET_SAMPLES",
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
__all__ += ["not_excluded", "share_of", "shown_limit", "untested"]
__all__ += ["verdicts_of", "with_limit", "with_limit_of_scan"]
