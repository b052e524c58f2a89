"""Nonlinear dynamic inversion: from commanded aoa, sideslip and roll to body rates, from these to control surfaces.

Wang, Tang, Chen (F-16 diagnosability), eq. 3-6. Its five inputs drive three rates, so the inverse of (5) needs a rule:
the surfaces come first, and what they cannot give in pitch and yaw is asked of the thrust-vectoring nozzle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .airframe import AOA, CONTROLS, NOZZLE, PITCH, ROLL, SIDESLIP, SURFACE_LIMITS, SURFACES, THROTTLE
from .loads import NORMAL_PER_ELEVATOR, SIDE_PER_CONTROL, Body, Conditions, accelerations, thrust_force
from .motion import rate_derivatives, translation
from .tables import tables

__all__ = ["Inversion", "inverted_controls", "inverted_kinematics"]

FloatArray = NDArray[np.float64]

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
        still, F_T = at.coefficients(measured, u), thrust_force(at, u)
        # The outer loop: rates at which the angles approach the command.
        change = self.outer_gain * (wanted - x[[AOA, SIDESLIP, ROLL]])
        change[:2] -= translation(x, accelerations(at, still, F_T))[1:]
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
    pitching = at.section.by_elevator[1]
    arm = frame.reference_cg - body.cg
    C_m = still[4] + pitching - pitching[grid.size // 2] + arm * NORMAL_PER_ELEVATOR * points[:, None]
    cell = np.clip((C_m > wanted[1]).sum(axis=0) - 1, 0, grid.size - 2)
    column = np.arange(wanted.shape[1])
    low, high = C_m[cell, column], C_m[cell + 1, column]
    elevator = points[cell] + np.radians(grid.step) * (wanted[1] - low) / (high - low)

    (a, b), (c, d) = at.section.control
    arm = arm * frame.chord_m / frame.span_m
    c, d = c - arm * SIDE_PER_CONTROL[0], d - arm * SIDE_PER_CONTROL[1]
    roll, yaw = wanted[0] - still[3], wanted[2] - still[5]
    determinant = a * d - b * c
    surfaces = np.array([elevator, (d * roll - b * yaw) / determinant, (a * yaw - c * roll) / determinant])
    limits = np.array(SURFACE_LIMITS)[:, None]
    return np.asarray(np.minimum(np.maximum(surfaces, -limits), limits))
