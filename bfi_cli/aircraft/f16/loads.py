"""What acts on the F-16 in flight: forces per mass and moments, in body axes; one column per aircraft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .aerodynamics import Section, coefficients, section_at
from .airframe import AIRFRAME, Airframe
from .engine import air_density, mach_number, thrust
from .states import ALTITUDE, AOA, NOZZLE, PITCH, POWER, ROLL, SIDESLIP, SURFACES, TAS

__all__ = ["Body", "Conditions", "accelerations", "conditions_at", "moments", "thrust_force"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """The aircraft as loaded.

    Attributes
    ----------
    cg : centre of gravity, as a part of the chord.
    nozzle_arm_m : from the centre of gravity back to the nozzle, for thrust vectoring; not published.
    """

    airframe: Airframe = AIRFRAME
    cg: float = 0.35
    nozzle_arm_m: float = 5.0

    @property
    def lengths(self) -> FloatArray:
        """Of the roll, pitch and yaw coefficients, (3, 1) m."""
        frame = self.airframe
        return np.array([[frame.span_m], [frame.chord_m], [frame.span_m]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conditions:
    """What n states say about the loads before rates and controls are known.

    Attributes
    ----------
    section : the tables at the angles of attack and sideslip.
    tas, pressure, thrust : airspeed, dynamic pressure and size of the thrust, (n,), m/s, Pa, N.
    weight : acceleration of gravity, (3, n) m/s^2.
    """

    section: Section
    body: Body
    tas: FloatArray
    pressure: FloatArray
    thrust: FloatArray
    weight: FloatArray

    def coefficients(self, rates: FloatArray, u: FloatArray) -> FloatArray:
        """Return CX, CY, CZ, Cl, Cm, Cn, (6, n), at body rates, (3, n), and controls, (6, n)."""
        body = self.body
        return coefficients(self.section, (self.tas, rates), u[SURFACES], airframe=body.airframe, cg=body.cg)


def conditions_at(x: FloatArray, body: Body) -> Conditions:
    """Return the conditions of states, (13, n)."""
    tas, altitude, g = x[TAS], x[ALTITUDE], body.airframe.gravity_m_s2
    down = g * np.cos(x[PITCH])
    return Conditions(
        section=section_at(x[AOA], x[SIDESLIP]),
        body=body,
        tas=tas,
        pressure=0.5 * air_density(altitude) * tas * tas,
        thrust=thrust(x[POWER], altitude, mach_number(tas, altitude)),
        weight=np.array([-g * np.sin(x[PITCH]), down * np.sin(x[ROLL]), down * np.cos(x[ROLL])]),
    )


def thrust_force(at: Conditions, u: FloatArray) -> FloatArray:
    """Return the thrust in body axes, (3, n) N, turned by the nozzle to the right and down."""
    (yaw, pitch), (cos_yaw, cos_pitch) = np.sin(u[NOZZLE]), np.cos(u[NOZZLE])
    return np.asarray(at.thrust * np.array([cos_yaw * cos_pitch, yaw, cos_yaw * pitch]))


def accelerations(at: Conditions, C: FloatArray, F_T: FloatArray) -> FloatArray:
    """Return force per mass, gravity included, (3, n) m/s^2, of coefficients, (6, n), and thrust, (3, n) N."""
    frame = at.body.airframe
    return np.asarray((at.pressure * frame.wing_area_m2 * C[:3] + F_T) / frame.mass_kg + at.weight)


def moments(at: Conditions, C: FloatArray, F_T: FloatArray) -> FloatArray:
    """Return the moments about the centre of gravity, (3, n) N m, of coefficients, (6, n), and thrust, (3, n) N."""
    M = at.pressure * at.body.airframe.wing_area_m2 * at.body.lengths * C[3:]
    M[1] += at.body.nozzle_arm_m * F_T[2]
    M[2] -= at.body.nozzle_arm_m * F_T[1]
    return np.asarray(M)
