"""The published tables, read once from `tables.yaml`, and linear interpolation in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from ...yaml12 import load_yaml
from .airframe import FOOT, POUND

__all__ = ["Grid", "Tables", "interpolate", "tables"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

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
    rows = [row for name in AERO_ROWS for row in aero[name]]
    return Tables(
        aoa=_grid(axes["aoa_deg"]),
        elevator=_grid(axes["elevator_deg"]),
        sideslip_size=_grid(axes["sideslip_size_deg"]),
        sideslip=_grid(axes["sideslip_deg"]),
        stack=_frozen(rows + [document["damping"][name] for name in DAMPING_ROWS]),
        mach=_grid(thrust["mach"]),
        altitude=_grid([FOOT * altitude for altitude in thrust["altitude_ft"]]),
        thrust=_frozen(POUND * np.array([thrust[name] for name in ("idle", "military", "maximum")])),
    )


def interpolate(rows: FloatArray, grid: Grid, values: FloatArray) -> FloatArray:
    """Return (k, n), column i of `rows`, (k, size, n), at the i-th of `values`, (n,)."""
    cell, part = grid.place(values)
    column = np.arange(values.size)
    low = rows[:, cell, column]
    return np.asarray(low + part * (rows[:, cell + 1, column] - low))


def _grid(points: list[float]) -> Grid:
    return Grid(first=float(points[0]), step=float(points[1] - points[0]), size=len(points))


def _frozen(values: object) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
