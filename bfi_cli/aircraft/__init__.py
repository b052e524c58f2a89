"""Aircraft models about a trimmed flight, their manoeuvres, gusts and sensors: logs without a flight.

`MODELS` holds the models by name. Inside a linear model, states, inputs and outputs are deviations from the trim;
`simulate` returns a `FlightLog` of absolute values (airspeed near 100 m/s). `f16` and the aircraft of JSBSim,
`find_model("jsbsim:c172p")`, are nonlinear. Units are SI and radians.
"""

from __future__ import annotations

from .catalogue import MODELS, find_model
from .jsbsim_model import PREFIX, STICK
from .model import Discretisation, FlightPlan, Flown, LinearModel, NonlinearModel, discretise, response
from .simulate import (
    MANOEUVRES,
    Dryden,
    deviations,
    dryden_gusts,
    flight_of,
    manoeuvre,
    simulate,
    time_axis,
    with_gusts,
)

__all__ = ["MANOEUVRES", "MODELS", "PREFIX", "STICK", "Discretisation", "Dryden", "FlightPlan", "Flown", "LinearModel"]
__all__ += ["NonlinearModel", "deviations", "discretise", "dryden_gusts", "find_model", "flight_of", "manoeuvre"]
__all__ += ["response", "simulate", "time_axis", "with_gusts"]
