"""Force and moment coefficients of the F-16 about a given centre of gravity.

Body axes, forces positive forward, right and down. A positive elevator pitches down, a positive aileron rolls to the
left, a positive rudder yaws to the left. Source: `tables.yaml`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .airframe import Airframe
from .tables import interpolate, tables

__all__ = ["AOA_RANGE", "NORMAL_PER_ELEVATOR", "SIDE_PER_CONTROL", "Section", "coefficients", "section_at"]

FloatArray = NDArray[np.float64]

AOA_RANGE = (-10.0, 45.0)
NORMAL_PER_ELEVATOR = -0.19 / np.radians(25.0)
SIDE_PER_SIDESLIP = -0.02 * np.degrees(1.0)
SIDE_PER_CONTROL = np.array([0.021 / np.radians(20.0), 0.086 / np.radians(30.0)])
CONTROL_UNITS = np.array([np.radians(20.0), np.radians(30.0)] * 2)
BOOK_RADIAN = 57.3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """The tables at n angles of attack and sideslip.

    Attributes
    ----------
    by_elevator : (2, 5, n) axial force and pitching moment at the elevator's break points.
    still : (4, n) side force, normal force, rolling and yawing moment without rates and controls.
    control : (2, 2, n) rolling and yawing moment per rad of aileron and rudder.
    damping : (9, n) in the order of `tables.DAMPING_ROWS`.
    """

    by_elevator: FloatArray
    still: FloatArray
    control: FloatArray
    damping: FloatArray


def section_at(aoa: FloatArray, sideslip: FloatArray) -> Section:
    """Return the tables at (n,) angles, rad; angles of attack outside -10 to 45 degrees count as the nearest of them.

    Sideslip beyond 30 degrees is extrapolated.
    """
    data, n = tables(), aoa.size
    slip = np.degrees(sideslip)
    cell, part = data.aoa.place(np.minimum(np.maximum(np.degrees(aoa), AOA_RANGE[0]), AOA_RANGE[1]))
    low = np.take(data.stack, cell, axis=1)
    rows = low + part * (np.take(data.stack, cell + 1, axis=1) - low)
    odd = interpolate(rows[10:24].reshape(2, 7, n), data.sideslip_size, np.abs(slip)) * np.sign(slip)
    control = interpolate(rows[24:52].reshape(4, 7, n), data.sideslip, slip) / CONTROL_UNITS[:, None]
    normal = rows[52] * (1.0 - (slip / BOOK_RADIAN) ** 2)
    return Section(
        by_elevator=rows[:10].reshape(2, 5, n),
        still=np.array([SIDE_PER_SIDESLIP * sideslip, normal, *odd]),
        control=control.reshape(2, 2, n),
        damping=rows[53:],
    )


def coefficients(
    section: Section, motion: tuple[FloatArray, FloatArray], surfaces: FloatArray, *, airframe: Airframe, cg: float
) -> FloatArray:
    """Return CX, CY, CZ, Cl, Cm, Cn, (6, n).

    Parameters
    ----------
    section : the tables at the angles of attack and sideslip.
    motion : true airspeed, (n,) m/s, and body rates p, q, r, (3, n) rad/s.
    surfaces : (3, n) elevator, aileron, rudder, rad; beyond its tables (24 degrees) the elevator is extrapolated.
    cg : centre of gravity, as a part of the chord.
    """
    tas, (p, q, r) = motion
    elevator, lateral = surfaces[0], surfaces[1:]
    q = 0.5 * airframe.chord_m / tas * q
    p, r = 0.5 * airframe.span_m / tas * p, 0.5 * airframe.span_m / tas * r
    side, normal, rolling, yawing = section.still
    axial_q, side_r, side_p, normal_q, rolling_r, rolling_p, pitching_q, yawing_r, yawing_p = section.damping
    axial, pitching = interpolate(section.by_elevator, tables().elevator, np.degrees(elevator))
    rolling_control, yawing_control = (section.control * lateral).sum(axis=1)
    Y = side + SIDE_PER_CONTROL @ lateral + side_r * r + side_p * p
    Z = normal + NORMAL_PER_ELEVATOR * elevator + normal_q * q
    arm = airframe.reference_cg - cg
    return np.array(
        [
            axial + axial_q * q,
            Y,
            Z,
            rolling + rolling_control + rolling_r * r + rolling_p * p,
            pitching + pitching_q * q + Z * arm,
            yawing + yawing_control + yawing_r * r + yawing_p * p - Y * (arm * airframe.chord_m / airframe.span_m),
        ]
    )
