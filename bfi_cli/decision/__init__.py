"""The decision: evidence from every source, and one conclusion."""

from .candidate import (
    BUILD_UP_S,
    KINDS,
    UNTESTED,
    Candidate,
    State,
    beyond_tolerance,
    estimate_of,
    kind_of,
    shown_limit,
    state_of,
    two_digits,
)
from .conclude import Conclusion, conclude
from .evidence import Evidence
from .verdict import decide, summarise, verdicts_of

__all__ = ["BUILD_UP_S", "KINDS", "UNTESTED", "Candidate", "Conclusion", "Evidence", "State", "beyond_tolerance"]
__all__ += ["conclude", "decide", "estimate_of"]
__all__ += ["kind_of", "shown_limit", "state_of", "summarise", "two_digits", "verdicts_of"]
