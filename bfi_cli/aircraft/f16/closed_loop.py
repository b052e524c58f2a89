"""Closed-loop flights with faulty rate gyros: nonlinear dynamic inversion, and an observer of the rates.

Wang, Tang, Chen (F-16 diagnosability), eq. 3-10. The inversion goes from commanded aoa, sideslip and roll to body rates
and from these to control surfaces. Five inputs drive three rates, so that the inverse of (5) needs a rule: the surfaces
act first, and the thrust-vectoring nozzle adds the pitch and yaw beyond their limits. The observer has the model of the
nominal aircraft; the aircraft that flies has other moment coefficients (8). The gyros feed the inner loop, so that
their fault moves the aircraft too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ...kernels import FloatArray
from .airframe import (
    ALTITUDE,
    AOA,
    CONTROLS,
    NOZZLE,
    PITCH,
    POWER,
    RATES,
    ROLL,
    SIDESLIP,
    STATES,
    SURFACE_LIMITS,
    SURFACES,
    TAS,
    THROTTLE,
    tables,
)
from .loads import NORMAL_PER_ELEVATOR, SIDE_PER_CONTROL, Body, Conditions, commanded_power, conditions_at
from .motion import derivatives, rate_derivatives, runge_kutta, translation

LEAST_THRUST_N = 1.0  # keeps the nozzle's angle finite where the engine gives none


@dataclass(frozen=True, slots=True, kw_only=True)
class Inversion:
    """A two-loop inversion of the nominal aircraft, with its gains in 1/s.

    Attributes
    ----------
    outer_gain, inner_gain : of aoa, sideslip, roll, and of the rates.
    rate_limits : largest commanded p, q, r, rad/s.
    nozzle_limit : largest nozzle deflection, rad; 0 for no thrust vectoring.
    """

    body: Body = field(default_factory=Body)
    outer_gain: float = 2.0
    inner_gain: float = 10.0
    rate_limits: tuple[float, float, float] = (1.5, 1.0, 0.7)
    nozzle_limit: float = 0.26

    def controls(
        self, x: FloatArray, measured: FloatArray, wanted: FloatArray, *, throttle: float, at: Conditions
    ) -> FloatArray:
        """Return the controls, (6, n).

        Parameters
        ----------
        x : (13, n) state, of which the rates are not read.
        measured : (3, n) rates of the gyros.
        wanted : (3, n) commanded aoa, sideslip, roll, rad.
        at : the conditions of the states.
        """
        u = np.zeros((len(CONTROLS), x.shape[1]))
        u[THROTTLE] = throttle
        still, F_T = at.coefficients(measured, u), at.thrust_force(u)
        # The outer loop: rates at which the angles approach the command.
        change = self.outer_gain * (wanted - x[[AOA, SIDESLIP, ROLL]])
        change[:2] -= translation(x, at.accelerations(still, F_T))[1:]
        limits = np.array(self.rate_limits)[:, None]
        commanded = np.minimum(np.maximum(inverted_kinematics(x, change), -limits), limits)
        # The inner loop: moment coefficients Cl, Cm, Cn at which the rates approach those.
        frame = self.body.airframe
        acceleration = self.inner_gain * (commanded - measured)
        roll, pitch, yaw = acceleration - rate_derivatives(measured, np.zeros_like(measured), frame)
        _, _, c3, c4, _, _, c7, _, c9 = frame.inertia
        determinant = c3 * c9 - c4 * c4
        M = np.array([(c9 * roll - c4 * yaw) / determinant, pitch / c7, (c3 * yaw - c4 * roll) / determinant])
        C = M / at.unit_moments
        u[SURFACES] = inverted_controls(at, still, C)
        if self.nozzle_limit > 0.0:  # it replaces, as far as it can, the moments that the surfaces do not give
            _, pitch, yaw = (C - at.coefficients(measured, u)[3:]) * at.unit_moments / self.body.nozzle_arm_m
            most = np.sin(self.nozzle_limit)
            sines = np.clip(np.array([-yaw, pitch]) / np.maximum(at.thrust, LEAST_THRUST_N), -most, most)
            sines[1] /= np.sqrt(1.0 - sines[0] ** 2)
            u[NOZZLE] = np.arcsin(np.clip(sines, -most, most))
        return u


def inverted_kinematics(x: FloatArray, change: FloatArray) -> FloatArray:
    """Return rates p, q, r, (3, n), at which aoa, sideslip and roll change as wanted, (3, n) rad/s, forces left out.

    Solved in stability axes, where sideslip gives the yaw rate alone.
    """
    sin, cos = np.sin(x[AOA : PITCH + 1]), np.cos(x[AOA : PITCH + 1])
    tan_b, tan_pitch = sin[1] / cos[1], sin[3] / cos[3]
    r_s = -change[1]
    rolling = cos[0] + tan_pitch * (sin[2] * tan_b + sin[0] * cos[2])
    p_s = (change[2] + sin[0] * r_s - tan_pitch * (change[0] * sin[2] + cos[0] * cos[2] * r_s)) / rolling
    return np.array([p_s * cos[0] - r_s * sin[0], change[0] + p_s * tan_b, p_s * sin[0] + r_s * cos[0]])


def inverted_controls(at: Conditions, still: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return elevator, aileron, rudder, (3, n) rad within their limits, that give moment coefficients.

    The pitching moment falls with the elevator and is inverted piece by piece between the break points of its table;
    aileron and rudder solve two equations, and away from the reference centre of gravity their side forces yaw too.

    Parameters
    ----------
    at : the conditions of the states.
    still : (6, n) coefficients with the surfaces at zero.
    wanted : (3, n) Cl, Cm, Cn.
    """
    grid, body, frame = tables().elevator, at.body, at.body.airframe
    points = np.radians(grid.points)
    pitching = at.by_elevator[1]
    arm = frame.reference_cg - body.cg
    C_m = still[4] + pitching - pitching[grid.size // 2] + arm * NORMAL_PER_ELEVATOR * points[:, None]
    cell = np.clip((C_m > wanted[1]).sum(axis=0) - 1, 0, grid.size - 2)
    column = np.arange(wanted.shape[1])
    low, high = C_m[cell, column], C_m[cell + 1, column]
    elevator = points[cell] + np.radians(grid.step) * (wanted[1] - low) / (high - low)

    (a, b), (c, d) = at.control
    arm = arm * frame.chord_m / frame.span_m
    c, d = c - arm * SIDE_PER_CONTROL[0], d - arm * SIDE_PER_CONTROL[1]
    roll, yaw = wanted[0] - still[3], wanted[2] - still[5]
    determinant = a * d - b * c
    surfaces = np.array([elevator, (d * roll - b * yaw) / determinant, (a * yaw - c * roll) / determinant])
    limits = np.array(SURFACE_LIMITS)[:, None]
    return np.asarray(np.minimum(np.maximum(surfaces, -limits), limits))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """How the flights are flown and observed.

    Attributes
    ----------
    command : aoa, sideslip and roll, (3, n) or (3, 1) rad, wanted at a time in s.
    observer_gain : of the rates p, q, r, (3, n) or (3, 1), 1/s.
    from_measured : the observer's nominal moments act at the measured rates, f2(y); else at its own, f2(x-hat).
    step_s, record_s : of the integration and of the record; the controller and the observer are continuous.
    """

    command: Callable[[float], FloatArray]
    observer_gain: FloatArray
    from_measured: bool = True
    inversion: Inversion = field(default_factory=Inversion)
    tas_m_s: float = 125.0
    altitude_m: float = 3000.0
    throttle: float = 0.9
    duration_s: float = 20.0
    step_s: float = 0.02
    record_s: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flights:
    """The record, at m times of n flights.

    Attributes
    ----------
    time_s : (m,).
    residual : (m, 3, n) measured minus observed p, q, r, rad/s.
    states : (m, 13, n), in the order of `STATES`.
    """

    time_s: FloatArray
    residual: FloatArray
    states: FloatArray


def observe(
    setting: Observation,
    *,
    variation: FloatArray,
    noise: FloatArray,
    fault: Callable[[float], FloatArray],
    report: Callable[[int, int], None] | None = None,
) -> Flights:
    """Fly n aircraft from wings level with aoa, angles and rates zero, and return the observer's residuals.

    Parameters
    ----------
    variation : (3, n) relative changes of Cl, Cm, Cn.
    noise : (m, 3, n) of the gyros, rad/s; one row per recorded sample, held until the next.
    fault : (3, n) added to the gyros at a time in s, rad/s.
    report : called with the number of samples flown, and of all.
    """
    n, body = variation.shape[1], setting.inversion.body
    samples = np.arange(round(setting.duration_s / setting.record_s))
    steps = max(1, round(setting.record_s / setting.step_s))
    h = setting.record_s / steps

    def change(offset: FloatArray, t: float, z: FloatArray) -> FloatArray:
        """Return dz/dt of the aircraft's state, (13, n), and the observer's, (3, n); the gyros read `offset` more."""
        x, seen, y = z[:-3], z[-3:], z[RATES] + offset + fault(t)
        at = conditions_at(x, body)
        u = setting.inversion.controls(x, y, setting.command(t), throttle=setting.throttle, at=at)
        rates = y if setting.from_measured else seen
        M = at.moments(at.coefficients(rates, u), at.thrust_force(u))
        observed = rate_derivatives(rates, M, body.airframe) + setting.observer_gain * (y - seen)
        return np.concatenate([derivatives(x, u, body, at=at, variation=variation), observed])

    z = np.zeros((len(STATES) + 3, n))
    z[TAS], z[ALTITUDE], z[POWER] = setting.tas_m_s, setting.altitude_m, commanded_power(np.array(setting.throttle))
    residual, states = (np.empty((samples.size, rows, n)) for rows in (3, len(STATES)))
    for k in samples:
        start = float(k) * setting.record_s
        residual[k], states[k] = z[RATES] + noise[k] + fault(start) - z[-3:], z[:-3]
        for i in range(steps):
            z = runge_kutta(partial(change, noise[k]), start + i * h, z, h)
        if report is not None:
            report(int(k) + 1, samples.size)
    time_s = np.asarray(samples * setting.record_s, dtype=np.float64)
    return Flights(time_s=time_s, residual=residual, states=states)
