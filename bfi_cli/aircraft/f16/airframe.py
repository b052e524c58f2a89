"""The F-16's rows of state and controls, mass, inertia, dimensions, limits and tables. SI, radians; power in percent.

Source: Stevens and Lewis, Aircraft Control and Simulation, section 3.5, after NASA TP-1538; the tables are those of
`tables.yaml`, read once and interpolated linearly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from ...flightlog.record import frozen_array
from ...kernels import FloatArray
from ...quantities.channels import DEGREE, FOOT
from ...yaml12 import load_yaml

IntArray = NDArray[np.intp]

STATES = (
    *("tas", "aoa", "sideslip", "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate"),
    *("north", "east", "altitude", "power"),
)
# Where the states and controls stand in their vectors.
TAS, AOA, SIDESLIP, ROLL, PITCH, YAW = range(6)
RATES = slice(6, 9)
GROUND = slice(9, 12)
ALTITUDE, POWER = 11, 12

CONTROLS = ("elevator", "aileron", "rudder", "throttle", "nozzle_yaw", "nozzle_pitch")
ELEVATOR, THROTTLE = 0, 3  # see above
SURFACES = slice(0, 3)
NOZZLE = slice(4, 6)

# In SI, of a force, and rounded to fourteen digits.
POUND = 4.4482216152605
SLUG_FT2 = 1.3558179483314

# The book's.
SURFACE_LIMITS = (25.0 * DEGREE, 21.5 * DEGREE, 30.0 * DEGREE)
"""Largest elevator, aileron and rudder deflections."""

IXX, IYY, IZZ, IXZ = 9496.0, 55814.0, 63100.0, 982.0  # slug ft^2
GAMMA = IXX * IZZ - IXZ * IXZ


@dataclass(frozen=True, slots=True, kw_only=True)
class Airframe:
    """A rigid body with a spinning engine.

    Attributes
    ----------
    inertia : c1 .. c9 of the moment equations (Stevens and Lewis, eq. 1.7-18); c3, c4, c7, c9 in 1/(kg m^2).
    engine_momentum : angular momentum of the engine along body x, kg m^2/s.
    reference_cg : centre of gravity of the tables, as a part of the chord.
    """

    inertia: tuple[float, ...]
    mass_kg: float = 1.0 / 1.57e-3 * POUND / FOOT
    wing_area_m2: float = 300.0 * FOOT**2
    span_m: float = 30.0 * FOOT
    chord_m: float = 11.32 * FOOT
    engine_momentum: float = 160.0 * SLUG_FT2
    reference_cg: float = 0.35
    gravity_m_s2: float = 32.17 * FOOT


AIRFRAME = Airframe(
    inertia=(
        ((IYY - IZZ) * IZZ - IXZ * IXZ) / GAMMA,
        (IXX - IYY + IZZ) * IXZ / GAMMA,
        IZZ / GAMMA / SLUG_FT2,
        IXZ / GAMMA / SLUG_FT2,
        (IZZ - IXX) / IYY,
        IXZ / IYY,
        1.0 / IYY / SLUG_FT2,
        ((IXX - IYY) * IXX + IXZ * IXZ) / GAMMA,
        IXX / GAMMA / SLUG_FT2,
    )
)
"""The inertia of NASA TP-1538."""

BOOK_AIRFRAME = Airframe(
    inertia=(
        *(-0.770, 0.02755, 1.055e-4 / SLUG_FT2, 1.642e-6 / SLUG_FT2, 0.9604),
        *(1.759e-2, 1.792e-5 / SLUG_FT2, -0.7336, 1.587e-5 / SLUG_FT2),
    )
)
"""The same with the coefficients rounded as in the book, whose check case was computed with them."""

AERO_ROWS = (
    *("axial", "pitching", "rolling", "yawing"),
    *("aileron_rolling", "rudder_rolling", "aileron_yawing", "rudder_yawing", "normal"),
)
DAMPING_ROWS = (
    *("axial_q", "side_r", "side_p", "normal_q"),
    *("rolling_r", "rolling_p", "pitching_q", "yawing_r", "yawing_p"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Equally spaced break points."""

    first: float
    step: float
    size: int

    def place(self, values: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the cell of every value and how far into it, below 0 or above 1 outside the grid."""
        position = (values - self.first) / self.step
        cell = np.minimum(np.maximum(position.astype(np.intp), 0), self.size - 2)
        return cell, position - cell

    @property
    def points(self) -> FloatArray:
        """The break points, (size,)."""
        return np.asarray(self.first + self.step * np.arange(self.size))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tables:
    """All coefficients over angle of attack, in one stack, and thrust.

    Attributes
    ----------
    aoa, elevator, sideslip_size, sideslip : break points in degrees.
    stack : (62, n_aoa): axial and pitching by elevator, rolling and yawing by size of sideslip, the four control
        effectivenesses by sideslip, the normal force, nine damping derivatives.
    mach, altitude : break points of thrust; altitude in m.
    thrust : (3, n_mach, n_altitude), idle, military and maximum, N.
    """

    aoa: Grid
    elevator: Grid
    sideslip_size: Grid
    sideslip: Grid
    stack: FloatArray
    mach: Grid
    altitude: Grid
    thrust: FloatArray


@cache
def tables() -> Tables:
    """Return the tables, read once."""
    with resources.as_file(resources.files(__package__).joinpath("tables.yaml")) as path:
        document = load_yaml(path)
    aero, axes, thrust = document["aero"], document["axes"], document["thrust"]
    points = {name: axes[f"{name}_deg"] for name in ("aoa", "elevator", "sideslip_size", "sideslip")}
    points |= {"mach": thrust["mach"], "altitude": [FOOT * altitude for altitude in thrust["altitude_ft"]]}
    grids = {name: Grid(first=float(p[0]), step=float(p[1] - p[0]), size=len(p)) for name, p in points.items()}
    rows = [row for name in AERO_ROWS for row in aero[name]] + [document["damping"][name] for name in DAMPING_ROWS]
    newtons = POUND * np.array([thrust[name] for name in ("idle", "military", "maximum")])
    return Tables(stack=frozen_array(rows), thrust=frozen_array(newtons), **grids)


def interpolate(rows: FloatArray, grid: Grid, values: FloatArray) -> FloatArray:
    """Return (k, n), column i of `rows`, (k, size, n), at the i-th of `values`, (n,)."""
    cell, part = grid.place(values)
    column = np.arange(values.size)
    low = rows[:, cell, column]
    return np.asarray(low + part * (rows[:, cell + 1, column] - low))
