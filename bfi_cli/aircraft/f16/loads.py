"""What acts on the F-16 in flight: aerodynamic coefficients, thrust, weight; one column per aircraft, SI and radians.

Body axes, forces positive forward, right and down. A positive elevator pitches down, a positive aileron rolls to the
left, a positive rudder yaws to the left. Source: `tables.yaml`, and the engine and standard atmosphere of Stevens and
Lewis, section 3.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .airframe import (
    AIRFRAME,
    ALTITUDE,
    AOA,
    FOOT,
    NOZZLE,
    PITCH,
    POUND,
    POWER,
    ROLL,
    SIDESLIP,
    SURFACES,
    TAS,
    Airframe,
    interpolate,
    tables,
)

__all__ = [
    *("AOA_RANGE", "NORMAL_PER_ELEVATOR", "SIDE_PER_CONTROL", "Body", "Conditions", "Section", "accelerations"),
    *("air_density", "coefficients", "commanded_power", "conditions_at", "mach_number", "moments", "power_rate"),
    *("section_at", "thrust", "thrust_force"),
]

FloatArray = NDArray[np.float64]

AOA_RANGE = (-10.0, 45.0)  # degrees, the ends of the tables
NORMAL_PER_ELEVATOR = -0.19 / np.radians(25.0)
SIDE_PER_SIDESLIP = -0.02 * np.degrees(1.0)
SIDE_PER_CONTROL = np.array([0.021 / np.radians(20.0), 0.086 / np.radians(30.0)])
CONTROL_UNITS = np.array([np.radians(20.0), np.radians(30.0)] * 2)
BOOK_RADIAN = 57.3  # degrees, as the book rounds it

MILITARY = 50.0  # percent of power, above it the afterburner burns
DENSITY_0 = 0.002377 * POUND / FOOT**4
LAPSE = 0.703e-5 / FOOT
TEMPERATURE_0, STRATOSPHERE, TROPOPAUSE = 519.0, 390.0, 35000.0 * FOOT
GAS = 1.4 * 1716.3 * FOOT**2


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """The tables at n angles of attack and sideslip.

    Attributes
    ----------
    by_elevator : (2, 5, n) axial force and pitching moment at the elevator's break points.
    still : (4, n) side force, normal force, rolling and yawing moment without rates and controls.
    control : (2, 2, n) rolling and yawing moment per rad of aileron and rudder.
    damping : (9, n) in the order of `airframe.DAMPING_ROWS`.
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


def coefficients(section: Section, tas: FloatArray, rates: FloatArray, surfaces: FloatArray, body: Body) -> FloatArray:
    """Return CX, CY, CZ, Cl, Cm, Cn, (6, n).

    Parameters
    ----------
    section : the tables at the angles of attack and sideslip.
    tas : (n,) true airspeed, m/s; rates : (3, n) body rates p, q, r, rad/s.
    surfaces : (3, n) elevator, aileron, rudder, rad; beyond its tables (24 degrees) the elevator is extrapolated.
    """
    airframe, (p, q, r) = body.airframe, rates
    elevator, lateral = surfaces[0], surfaces[1:]
    q = 0.5 * airframe.chord_m / tas * q
    p, r = 0.5 * airframe.span_m / tas * p, 0.5 * airframe.span_m / tas * r
    side, normal, rolling, yawing = section.still
    axial_q, side_r, side_p, normal_q, rolling_r, rolling_p, pitching_q, yawing_r, yawing_p = section.damping
    axial, pitching = interpolate(section.by_elevator, tables().elevator, np.degrees(elevator))
    rolling_control, yawing_control = (section.control * lateral).sum(axis=1)
    Y = side + SIDE_PER_CONTROL @ lateral + side_r * r + side_p * p
    Z = normal + NORMAL_PER_ELEVATOR * elevator + normal_q * q
    arm = airframe.reference_cg - body.cg
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


def air_density(altitude: FloatArray) -> FloatArray:
    """Return kg/m^3 at altitudes in m."""
    return np.asarray(DENSITY_0 * (1.0 - LAPSE * altitude) ** 4.14)


def mach_number(tas: FloatArray, altitude: FloatArray) -> FloatArray:
    """Return the Mach number of an airspeed in m/s at an altitude in m."""
    rankine = np.where(altitude >= TROPOPAUSE, STRATOSPHERE, TEMPERATURE_0 * (1.0 - LAPSE * altitude))
    return np.asarray(tas / np.sqrt(GAS * rankine))


def commanded_power(throttle: FloatArray) -> FloatArray:
    """Return the power, percent, that a throttle position asks for; 0.77 is military power."""
    return np.where(throttle <= 0.77, 64.94 * throttle, 217.38 * throttle - 117.38)


def power_rate(power: FloatArray, throttle: FloatArray) -> FloatArray:
    """Return d power / dt, percent/s: a first-order lag, slow for large steps, that enters the afterburner at 60 %."""
    wanted = commanded_power(throttle)
    burning, rising = power >= MILITARY, wanted >= MILITARY
    goal = np.where(rising & ~burning, 60.0, np.where(burning & ~rising, 40.0, wanted))
    quickness = np.minimum(np.maximum(1.9 - 0.036 * (goal - power), 0.1), 1.0)
    return np.asarray(np.where(burning, 5.0, quickness) * (goal - power))


def thrust(power: FloatArray, altitude: FloatArray, mach: FloatArray) -> FloatArray:
    """Return thrust, N, from power in percent, altitude in m and Mach number, all (n,)."""
    data = tables()
    i, up = data.mach.place(mach)
    j, across = data.altitude.place(altitude)
    low = (1.0 - across) * data.thrust[:, i, j] + across * data.thrust[:, i, j + 1]
    high = (1.0 - across) * data.thrust[:, i + 1, j] + across * data.thrust[:, i + 1, j + 1]
    idle, military, maximum = (1.0 - up) * low + up * high
    dry = power < MILITARY
    part = power / MILITARY - np.where(dry, 0.0, 1.0)
    return np.asarray(np.where(dry, idle + part * (military - idle), military + part * (maximum - military)))


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
        return coefficients(self.section, self.tas, rates, u[SURFACES], self.body)

    @property
    def unit_moments(self) -> FloatArray:
        """The roll, pitch and yaw moments of unit coefficients, (3, n) N m."""
        frame = self.body.airframe
        lengths = np.array([[frame.span_m], [frame.chord_m], [frame.span_m]])
        return np.asarray(self.pressure * frame.wing_area_m2 * lengths)


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
    M = at.unit_moments * C[3:]
    M[1] += at.body.nozzle_arm_m * F_T[2]
    M[2] -= at.body.nozzle_arm_m * F_T[1]
    return np.asarray(M)
