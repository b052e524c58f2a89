"""What a log lacks, and what that costs: said in the answer, so that silence is not taken for health."""

from __future__ import annotations

from collections.abc import Sequence

from ..flightlog import FlightLog
from .looks import Scanned
from .result import FlightLimit

__all__ = ["missing_sentences"]

# By residual, what it bounds and what it is made of.
BOUNDS = {
    "lift": "the lift does not bound the airspeed and the angle of attack",
    "climb": "the climb angle does not bound pitch and angle of attack",
    "kinematics": "the inertial acceleration does not bound the airspeed",
    "ground_speed": "the ground speed does not bound the airspeed",
}


def missing_sentences(log: FlightLog, scanned: Sequence[Scanned], limits: Sequence[FlightLimit]) -> tuple[str, ...]:
    """Return a sentence for each residual that the log does not allow, with what is seen without it."""
    lacking: dict[str, str] = {}
    for one in scanned:
        lacking.update(one.lacking)
    used = {name for one in scanned for name in one.residuals}
    seen = [one for one in limits if one.shape == "drift" and one.channel in ("tas", "cas", "ias")]
    cost = ""
    if seen:
        worst = max(seen, key=lambda one: one.effect)
        amount = f"{worst.excluded_above:.2g} {worst.unit}"
        cost = f"; a slow loss of airspeed below {amount} ({worst.effect:.2g} m/s in the window) would not be seen"
    said = []
    for name, channels in lacking.items():
        if name not in used:
            said.append(f"no {channels}: {BOUNDS[name]}{cost}")
            cost = ""
    if not scanned:
        has = ", ".join(sorted(log.channels))
        said.append(f"no slow fault was looked for: no residual can be made of {has}")
    return tuple(said)
