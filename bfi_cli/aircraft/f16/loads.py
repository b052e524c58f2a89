"""Loads of the F-16 in flight: aerodynamic coefficients, thrust, weight; one column per aircraft, SI and radians.

Body axes, forces positive forward, right and down. A positive elevator pitches down, a positive aileron rolls to the
left, a positive rudder yaws to the left. Source: `tables.yaml`, and the engine and standard atmosphere of Stevens and
Lewis, section 3.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...kernels import FloatArray
from ...quantities.channels import FOOT
from .airframe import (
    AIRFRAME,
    ALTITUDE,
    AOA,
    ELEVATOR,
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

AOA_RANGE = (-10.0, 45.0)  # degrees, the ends of the tables
# The book's linear parts of the coefficients, per rad of control or sideslip.
NORMAL_PER_ELEVATOR = -0.19 / np.radians(25.0)
SIDE_PER_SIDESLIP = -0.02 * np.degrees(1.0)
SIDE_PER_CONTROL = np.array([0.021 / np.radians(20.0), 0.086 / np.radians(30.0)])
CONTROL_UNITS = np.array([np.radians(20.0), np.radians(30.0)] * 2)
BOOK_RADIAN = 57.3  # degrees, as the book rounds it

# The book's engine, and its standard atmosphere in degrees Rankine.
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
    """The parts of the loads of n states that do not depend on rates and controls.

    Attributes
    ----------
    tas, pressure, thrust : airspeed, dynamic pressure and size of the thrust, (n,), m/s, Pa, N.
    weight : acceleration of gravity, (3, n) m/s^2.
    by_elevator : (2, 5, n) axial force and pitching moment at the elevator's break points.
    still : (4, n) side force, normal force, rolling and yawing moment without rates and controls.
    control : (2, 2, n) rolling and yawing moment per rad of aileron and rudder.
    damping : (9, n) in the order of `airframe.DAMPING_ROWS`.
    """

    body: Body
    tas: FloatArray
    pressure: FloatArray
    thrust: FloatArray
    weight: FloatArray
    by_elevator: FloatArray
    still: FloatArray
    control: FloatArray
    damping: FloatArray

    def coefficients(self, rates: FloatArray, u: FloatArray) -> FloatArray:
        """Return CX, CY, CZ, Cl, Cm, Cn, (6, n), at body rates, (3, n), and controls, (6, n).

        Beyond its tables, 24 degrees, the elevator is extrapolated.
        """
        airframe, (p, q, r) = self.body.airframe, rates
        elevator, lateral = u[ELEVATOR], u[SURFACES][1:]
        q = 0.5 * airframe.chord_m / self.tas * q
        p, r = 0.5 * airframe.span_m / self.tas * p, 0.5 * airframe.span_m / self.tas * r
        side, normal, rolling, yawing = self.still
        axial_q, side_r, side_p, normal_q, rolling_r, rolling_p, pitching_q, yawing_r, yawing_p = self.damping
        axial, pitching = interpolate(self.by_elevator, tables().elevator, np.degrees(elevator))
        rolling_control, yawing_control = (self.control * lateral).sum(axis=1)
        Y = side + SIDE_PER_CONTROL @ lateral + side_r * r + side_p * p
        Z = normal + NORMAL_PER_ELEVATOR * elevator + normal_q * q
        arm = airframe.reference_cg - self.body.cg
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

    def thrust_force(self, u: FloatArray) -> FloatArray:
        """Return the thrust in body axes, (3, n) N, turned by the nozzle to the right and down."""
        (yaw, pitch), (cos_yaw, cos_pitch) = np.sin(u[NOZZLE]), np.cos(u[NOZZLE])
        return np.asarray(self.thrust * np.array([cos_yaw * cos_pitch, yaw, cos_yaw * pitch]))

    def accelerations(self, C: FloatArray, F_T: FloatArray) -> FloatArray:
        """Return force per mass, gravity included, (3, n) m/s^2, of coefficients, (6, n), and thrust, (3, n) N."""
        frame = self.body.airframe
        return np.asarray((self.pressure * frame.wing_area_m2 * C[:3] + F_T) / frame.mass_kg + self.weight)

    @property
    def unit_moments(self) -> FloatArray:
        """The roll, pitch and yaw moments of unit coefficients, (3, n) N m."""
        frame = self.body.airframe
        lengths = np.array([[frame.span_m], [frame.chord_m], [frame.span_m]])
        return np.asarray(self.pressure * frame.wing_area_m2 * lengths)

    def moments(self, C: FloatArray, F_T: FloatArray) -> FloatArray:
        """Return the moments about the centre of gravity, (3, n) N m, of coefficients, (6, n), and thrust, (3, n) N."""
        M = self.unit_moments * C[3:]
        M[1] += self.body.nozzle_arm_m * F_T[2]
        M[2] -= self.body.nozzle_arm_m * F_T[1]
        return np.asarray(M)


def conditions_at(x: FloatArray, body: Body) -> Conditions:
    """Return the conditions of states, (13, n).

    Angles of attack outside -10 to 45 degrees count as the nearest of them; sideslip beyond 30 degrees is extrapolated.
    """
    data, (tas, altitude), n = tables(), (x[TAS], x[ALTITUDE]), x.shape[1]
    slip, g = np.degrees(x[SIDESLIP]), body.airframe.gravity_m_s2
    cell, part = data.aoa.place(np.minimum(np.maximum(np.degrees(x[AOA]), AOA_RANGE[0]), AOA_RANGE[1]))
    low = np.take(data.stack, cell, axis=1)
    rows = low + part * (np.take(data.stack, cell + 1, axis=1) - low)
    odd = interpolate(rows[10:24].reshape(2, 7, n), data.sideslip_size, np.abs(slip)) * np.sign(slip)
    control = interpolate(rows[24:52].reshape(4, 7, n), data.sideslip, slip) / CONTROL_UNITS[:, None]
    normal = rows[52] * (1.0 - (slip / BOOK_RADIAN) ** 2)
    down = g * np.cos(x[PITCH])
    return Conditions(
        body=body,
        tas=tas,
        pressure=0.5 * air_density(altitude) * tas * tas,
        thrust=thrust(x[POWER], altitude, mach_number(tas, altitude)),
        weight=np.array([-g * np.sin(x[PITCH]), down * np.sin(x[ROLL]), down * np.cos(x[ROLL])]),
        by_elevator=rows[:10].reshape(2, 5, n),
        still=np.array([SIDE_PER_SIDESLIP * x[SIDESLIP], normal, *odd]),
        control=control.reshape(2, 2, n),
        damping=rows[53:],
    )
