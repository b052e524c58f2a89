"""Aircraft as linear models about a trimmed flight, their manoeuvres, gusts and sensors: logs without a flight.

`MODELS` holds them by name. States, inputs and outputs are deviations from the trim inside a model; `simulate` returns
a `FlightLog` of absolute values (airspeed near 100 m/s). Units are SI and radians.
"""

from __future__ import annotations

from .catalogue import MODELS, find_model
from .linear import DISCRETISATIONS, Discretisation, LinearModel, discretise, response
from .manoeuvre import MANOEUVRES, manoeuvre
from .simulate import simulate, time_axis
from .turbulence import Dryden, dryden_gusts, with_gusts

__all__ = [
    "DISCRETISATIONS",
    "MANOEUVRES",
    "MODELS",
    "Discretisation",
    "Dryden",
    "LinearModel",
    "discretise",
    "dryden_gusts",
    "find_model",
    "manoeuvre",
    "response",
    "simulate",
    "time_axis",
    "with_gusts",
]
