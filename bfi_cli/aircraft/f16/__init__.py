"""The F-16 of Stevens and Lewis: tables, equations of motion, trim, nonlinear dynamic inversion, rate observer.

States and controls are columns, one per aircraft, in the orders of `STATES` and `CONTROLS`, SI and radians, so that
many aircraft are computed at once. A positive elevator pitches down, a positive aileron rolls left, a positive
rudder yaws left; altitude is positive up (the z of Wang, Tang and Chen is positive down and starts at -3000 m).
"""

from __future__ import annotations

from .airframe import AIRFRAME, BOOK_AIRFRAME, CONTROLS, STATES, Airframe
from .closed_loop import Flights, Inversion, Observation, observe
from .loads import Body
from .motion import CRUISE, F16, SteadyFlight, Trim, derivatives, fly, trim

__all__ = ["AIRFRAME", "BOOK_AIRFRAME", "CONTROLS", "CRUISE", "F16", "STATES", "Airframe", "Body", "Flights"]
__all__ += ["Inversion", "Observation", "SteadyFlight", "Trim", "derivatives", "fly", "observe", "trim"]
