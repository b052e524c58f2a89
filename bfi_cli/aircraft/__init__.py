"""Aircraft models about a trimmed flight, their manoeuvres, gusts and sensors: logs without a flight.

`MODELS` holds them by name. States, inputs and outputs are deviations from the trim inside a linear model; `simulate`
returns a `FlightLog` of absolute values (airspeed near 100 m/s). `f16` is nonlinear. Units are SI and radians.
"""

from __future__ import annotations

from .catalogue import MODELS, find_model
from .model import Discretisation, Flown, LinearModel, NonlinearModel, discretise, response
from .simulate import MANOEUVRES, Dryden, dryden_gusts, manoeuvre, simulate, time_axis, with_gusts

__all__ = ["MANOEUVRES", "MODELS", "Discretisation", "Dryden", "Flown", "LinearModel", "NonlinearModel"]
__all__ += ["discretise", "dryden_gusts", "find_model", "manoeuvre", "response", "simulate", "time_axis", "with_gusts"]
