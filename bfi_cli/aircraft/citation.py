"""Cessna Citation II at 100 m/s and 5000 m: the longitudinal model of the thesis, eq. 5-4."""

from __future__ import annotations

import numpy as np

from .linear import LinearModel

__all__ = ["CITATION", "CITATION_SHORT_PERIOD"]

STATES = ("tas", "aoa", "pitch", "pitch_rate")
UNITS = {"tas": "m/s", "aoa": "rad", "pitch": "rad", "pitch_rate": "rad/s", "elevator": "rad"}
TRIM_AIRSPEED = 100.0
SHORT_PERIOD = [STATES.index("aoa"), STATES.index("pitch_rate")]

A = np.array(
    [
        [-0.0179, 3.4177, -9.7911, -0.2036],
        [-0.0020, -1.1443, 0.0, 0.9777],
        [0.0, 0.0, 0.0, 1.0],
        [0.0017, -7.1848, 0.0, -1.6400],
    ]
)
B = np.array([[-0.4525], [-0.1186], [0.0], [-11.4642]])

CITATION = LinearModel(
    name="citation",
    title="Cessna Citation II, longitudinal, 100 m/s, 5000 m",
    A=A,
    B=B,
    C=np.eye(4),
    D=np.zeros((4, 1)),
    states=STATES,
    inputs=("elevator",),
    outputs=STATES,
    units=UNITS,
    trim={"tas": TRIM_AIRSPEED},
    airspeed_m_s=TRIM_AIRSPEED,
    source="blind fault identification thesis, eq. 5-4; angles and elevator are deviations from their trim",
)

CITATION_SHORT_PERIOD = LinearModel(
    name="citation-short-period",
    title="Cessna Citation II, short period only, 100 m/s, 5000 m",
    A=A[np.ix_(SHORT_PERIOD, SHORT_PERIOD)],
    B=B[SHORT_PERIOD],
    C=np.eye(2),
    D=np.zeros((2, 1)),
    states=("aoa", "pitch_rate"),
    inputs=("elevator",),
    outputs=("aoa", "pitch_rate"),
    units={name: UNITS[name] for name in ("aoa", "pitch_rate", "elevator")},
    trim={},
    airspeed_m_s=TRIM_AIRSPEED,
    source="rows and columns 2 and 4 of the thesis's eq. 5-4; angles and elevator are deviations from their trim",
)
