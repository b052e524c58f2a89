"""The aircraft models by their names: two of the Cessna Citation II, two of the Boeing 747, one of the F-16.

`jsbsim:NAME` is an aircraft of JSBSim, where that is installed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..errors import ConfigError
from ..faults import did_you_mean
from .f16 import CRUISE, F16, fly
from .jsbsim_model import PREFIX, jsbsim_model
from .model import FlightPlan, LinearModel, NonlinearModel

# Cessna Citation II at 100 m/s and 5000 m: equation 5-4 of the thesis, states tas, aoa, pitch, pitch rate.
CITATION = LinearModel(
    name="citation",
    title="Cessna Citation II, longitudinal, 100 m/s, 5000 m",
    A=np.array(
        [
            [-0.0179, 3.4177, -9.7911, -0.2036],
            [-0.0020, -1.1443, 0.0, 0.9777],
            [0.0, 0.0, 0.0, 1.0],
            [0.0017, -7.1848, 0.0, -1.6400],
        ]
    ),
    B=np.array([[-0.4525], [-0.1186], [0.0], [-11.4642]]),
    C=np.eye(4),
    D=np.zeros((4, 1)),
    states=("tas", "aoa", "pitch", "pitch_rate"),
    inputs=("elevator",),
    outputs=("tas", "aoa", "pitch", "pitch_rate"),
    trim={"tas": 100.0},
    airspeed_m_s=100.0,
    source="blind fault identification thesis, eq. 5-4; angles and elevator are deviations from their trim",
)

CITATION_SHORT_PERIOD = LinearModel(
    name="citation-short-period",
    title="Cessna Citation II, short period only, 100 m/s, 5000 m",
    A=CITATION.A[1::2, 1::2],
    B=CITATION.B[1::2],
    C=np.eye(2),
    D=np.zeros((2, 1)),
    states=("aoa", "pitch_rate"),
    inputs=("elevator",),
    outputs=("aoa", "pitch_rate"),
    trim={},
    airspeed_m_s=100.0,
    source="rows and columns 2 and 4 of the thesis's eq. 5-4; angles and elevator are deviations from their trim",
)

# Boeing 747-100/200 at 92.6 m/s: the longitudinal model of the null-space detector's example. A is printed by
# Bondarenko and Zybin (2020); B, C and D are those of the test data "Linearized Boeing-747" of Varga's
# FaultDetectionTools. The order of the paper's inputs inside equal pairs (right, left; engines) is not established.
ELEVATORS = ("elevator_inner_right", "elevator_inner_left", "elevator_outer_right", "elevator_outer_left")
ENGINES = ("thrust_command_1", "thrust_command_2", "thrust_command_3", "thrust_command_4")
# The paper prints -2.4e-6 for the effect of altitude on pitch acceleration, the test data have -2.04e-6.
_A = np.array(
    [
        [-0.4861, 0.000317, -0.5588, 0.0, -2.04e-6],
        [0.0, -0.0199, 3.0796, -9.8048, 8.98e-5],
        [1.0053, -0.0021, -0.5211, 0.0, 9.30e-6],
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -92.6, 92.6, 0.0],
    ]
)
_B = np.array(
    [
        [-0.1455, -0.1455, -0.1494, -0.1494, -1.2860, 0.0013, 0.0035, 0.0035, 0.0013],
        [0.0, 0.0, 0.0, 0.0, -0.3122, 0.1999, 0.1999, 0.1999, 0.1999],
        [-0.0071, -0.0071, -0.0074, -0.0074, -0.0676, -0.0004, -0.0004, -0.0004, -0.0004],
        [0.0] * 9,
        [0.0] * 9,
    ]
)
_PITCH_RATE, _, _AOA, _PITCH, _ALTITUDE = np.eye(5)

B747 = LinearModel(
    name="b747",
    title="Boeing 747-100/200, longitudinal, 92.6 m/s",
    A=_A,
    B=_B,
    C=np.array([_AOA, _A[1], _PITCH, _PITCH_RATE, _A[4], _ALTITUDE]),
    D=np.array([np.zeros(9), _B[1], *np.zeros((4, 9))]),
    states=("pitch_rate", "tas", "aoa", "pitch", "altitude"),
    inputs=(*ELEVATORS, "stabiliser", *ENGINES),
    outputs=("aoa", "tas_rate", "pitch", "pitch_rate", "altitude_rate", "altitude"),
    trim={},
    airspeed_m_s=92.6,
    source="Bondarenko and Zybin 2020 (A); Varga, FaultDetectionTools, Linearized Boeing-747 (B, C, D); all values are "
    "deviations from the trim",
    manoeuvred=ELEVATORS,
)

# Boeing 747 at 40 000 ft and 774 ft/s: Bryson's longitudinal model in ft, s and hundredths of a radian, as in the
# example of MF2D. `_SI` takes its states, speeds along and down the body, pitch rate and pitch, to SI.
_FT, _CRAD = 0.3048, 0.01
_SI = np.diag([_FT, _FT, _CRAD, _CRAD])
_TO_FT = np.linalg.inv(_SI)

B747_CRUISE = LinearModel(
    name="b747-mf2d",
    title="Boeing 747, longitudinal, 235.9 m/s, 12 192 m",
    A=_SI
    @ np.array(
        [
            [-0.003, 0.039, 0.0, -0.322],
            [-0.065, -0.319, 7.74, 0.0],
            [0.0201, -0.101, -0.429, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )
    @ _TO_FT,
    B=_SI @ np.array([[0.01], [-0.18], [-1.16], [0.0]]) / _CRAD,
    C=_FT * np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 7.74]]) @ _TO_FT,
    D=np.zeros((2, 1)),
    states=("tas", "down_speed", "pitch_rate", "pitch"),
    inputs=("elevator",),
    outputs=("tas", "altitude_rate"),
    trim={"tas": 774.0 * _FT},
    airspeed_m_s=774.0 * _FT,
    source="Bryson, Control of Spacecraft and Aircraft, 1994; angles and elevator are deviations from their trim",
    units={"down_speed": "m/s"},
)

MODELS: dict[str, LinearModel | NonlinearModel] = {
    model.name: model for model in (CITATION, CITATION_SHORT_PERIOD, B747, B747_CRUISE, F16)
}


def find_model(name: str, plan: FlightPlan | None = None) -> LinearModel | NonlinearModel:
    """Return the model called `name`, flown by a plan; None for the model's trim.

    Raises
    ------
    ConfigError : no such model, or it cannot fly the plan.
    """
    plan = plan or FlightPlan()
    if name.startswith(PREFIX):
        return jsbsim_model(name.removeprefix(PREFIX), plan)
    if name not in MODELS:
        raise ConfigError(f"simulate: no such model, got '{name}'{did_you_mean(name, (*MODELS, PREFIX + 'NAME'))}")
    model = MODELS[name]
    if plan == FlightPlan():
        return model
    if not isinstance(model, NonlinearModel):
        raise ConfigError(
            f"{name}: a linear model flies straight from its own trim, in still air; leave out --tas, --altitude, "
            "--wind, --ordinary and the tour"
        )
    if plan.wind_m_s != (0.0, 0.0) or plan.tour or plan.ordinary:
        raise ConfigError(f"{name}: flies straight, in still air; leave out --wind, --ordinary and the tour")
    given = {"tas_m_s": plan.tas_m_s, "altitude_m": plan.altitude_m}
    start = replace(CRUISE, **{key: value for key, value in given.items() if value is not None})
    return replace(model, fly=partial(fly, start=start))
