"""Boeing 747-100/200 at 92.6 m/s: the longitudinal model of the null-space detector's example.

A is printed by Bondarenko and Zybin (2020); B, C and D are those of the test data "Linearized Boeing-747" of Varga's
FaultDetectionTools. The order of the paper's inputs inside equal pairs (right, left; engines) is not established.
"""

from __future__ import annotations

import numpy as np

from .linear import LinearModel

__all__ = ["B747", "ELEVATORS", "ENGINES"]

TRIM_AIRSPEED = 92.6
STATES = ("pitch_rate", "tas", "aoa", "pitch", "altitude")
OUTPUTS = ("aoa", "tas_rate", "pitch", "pitch_rate", "altitude_rate", "altitude")
ELEVATORS = ("elevator_inner_right", "elevator_inner_left", "elevator_outer_right", "elevator_outer_left")
ENGINES = ("thrust_command_1", "thrust_command_2", "thrust_command_3", "thrust_command_4")
INPUTS = (*ELEVATORS, "stabiliser", *ENGINES)
UNITS = {
    "pitch_rate": "rad/s",
    "tas": "m/s",
    "aoa": "rad",
    "pitch": "rad",
    "altitude": "m",
    "tas_rate": "m/s^2",
    "altitude_rate": "m/s",
    **dict.fromkeys(INPUTS, "rad"),
}

# The paper prints -2.4e-6 for the effect of altitude on pitch acceleration, the test data have -2.04e-6.
A = np.array(
    [
        [-0.4861, 0.000317, -0.5588, 0.0, -2.04e-6],
        [0.0, -0.0199, 3.0796, -9.8048, 8.98e-5],
        [1.0053, -0.0021, -0.5211, 0.0, 9.30e-6],
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -92.6, 92.6, 0.0],
    ]
)
B = np.array(
    [
        [-0.1455, -0.1455, -0.1494, -0.1494, -1.2860, 0.0013, 0.0035, 0.0035, 0.0013],
        [0.0, 0.0, 0.0, 0.0, -0.3122, 0.1999, 0.1999, 0.1999, 0.1999],
        [-0.0071, -0.0071, -0.0074, -0.0074, -0.0676, -0.0004, -0.0004, -0.0004, -0.0004],
        [0.0] * 9,
        [0.0] * 9,
    ]
)
PITCH_RATE, _, AOA, PITCH, ALTITUDE = np.eye(5)

B747 = LinearModel(
    name="b747",
    title="Boeing 747-100/200, longitudinal, 92.6 m/s",
    A=A,
    B=B,
    C=np.array([AOA, A[1], PITCH, PITCH_RATE, A[4], ALTITUDE]),
    D=np.array([np.zeros(9), B[1], *np.zeros((4, 9))]),
    states=STATES,
    inputs=INPUTS,
    outputs=OUTPUTS,
    units=UNITS,
    trim={},
    airspeed_m_s=TRIM_AIRSPEED,
    source="Bondarenko and Zybin 2020 (A); Varga, FaultDetectionTools, Linearized Boeing-747 (B, C, D); all values are "
    "deviations from the trim",
    manoeuvred=ELEVATORS,
)
