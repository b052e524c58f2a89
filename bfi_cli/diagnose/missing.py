"""What a log lacks, and what that costs: said in the answer, so that silence is not taken for health."""

from __future__ import annotations

from collections.abc import Sequence

from ..decision import two_digits
from ..flightlog.phases import NO_AIRSPEED
from ..parity import LENGTHS_S, available
from .flight import Flight
from .limits import PITOT_LINE
from .looks import Scanned
from .result import FlightLimit

# By residual, what it bounds and what it is made of.
BOUNDS = {
    "lift": "the lift does not bound the airspeed and the angle of attack",
    "climb": "the climb angle does not bound pitch and angle of attack",
    "kinematics": "the inertial acceleration does not bound the airspeed",
    "ground_speed": "the ground speed does not bound the airspeed",
}


def missing_sentences(flight: Flight, scanned: Sequence[Scanned], limits: Sequence[FlightLimit]) -> tuple[str, ...]:
    """Return a sentence for each residual that the log does not allow, with what is seen without it.

    Parameters
    ----------
    scanned : the windows in which a residual is known.
    """
    kinds, lacking = available(flight.record.channels)
    for one in scanned:
        lacking.update(one.lacking)
    used = {name for one in scanned for name in one.residuals}
    mostly = next((one for one in limits if one.fault == PITOT_LINE and one.holds_in < 1.0), None)
    cost = ""
    if mostly is not None and mostly.effect is not None:
        within = f"{two_digits(mostly.effect)} m/s in {mostly.to_s - mostly.from_s:.0f} s"
        cost = f"; in most of the flight a slow fault of the airspeed of less than {within} would not be seen"
    said = [
        f"from {one.from_s:.0f} to {one.to_s:.0f} s no airspeed is recorded, or it is that of an aircraft at "
        "rest while other signs tell of flight: nothing else was looked for there"
        for one in flight.part_phases
        if one.phase == NO_AIRSPEED
    ]
    for name, channels in lacking.items():
        if name not in used:
            said.append(f"no {channels}: {BOUNDS[name]}{cost}")
            cost = ""
    if not any(flight.windows(length_s) for length_s in LENGTHS_S):
        said.append(f"no slow fault was looked for: no {min(LENGTHS_S):g} s of flight between take-off and approach")
    elif not kinds:
        said.append("no slow fault was looked for: nothing bounds the airspeed")
    elif not scanned:
        said.append("no slow fault was looked for: in every window most samples are no numbers")
    return tuple(said)
