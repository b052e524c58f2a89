"""Closed-loop flights with faulty rate gyros and an observer of the rates, many at once: its residuals.

Wang, Tang, Chen (F-16 diagnosability), eq. 7-10. The observer knows the nominal aircraft; the one that flies has other
moment coefficients (8). The inner loop of the inversion is fed by the gyros, so a fault moves the aircraft too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .airframe import ALTITUDE, CONTROLS, POWER, RATES, STATES, TAS
from .inversion import Inversion
from .loads import commanded_power, conditions_at, moments, thrust_force
from .motion import derivatives, rate_derivatives

__all__ = ["Flights", "Observation", "observe"]

FloatArray = NDArray[np.float64]

BEFORE_THE_END = 1.0 - 1e-6  # a fault or a command that jumps at the end of a step belongs to the next one


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
    states, controls : (m, 13, n) and (m, 6, n), in the orders of `STATES` and `CONTROLS`.
    """

    time_s: FloatArray
    residual: FloatArray
    states: FloatArray
    controls: FloatArray


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
    report : told how many samples of all are flown.
    """
    n, body = variation.shape[1], setting.inversion.body
    samples = np.arange(round(setting.duration_s / setting.record_s))
    steps = max(1, round(setting.record_s / setting.step_s))
    h = setting.record_s / steps

    def change(t: float, z: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dz/dt, of the aircraft's state, (13, n), and the observer's, (3, n), and the controls."""
        x, seen, y = z[:-3], z[-3:], z[RATES] + offset + fault(t)
        at = conditions_at(x, body)
        u = setting.inversion.controls(x, y, setting.command(t), throttle=setting.throttle, at=at)
        rates = y if setting.from_measured else seen
        M = moments(at, at.coefficients(rates, u), thrust_force(at, u))
        observed = rate_derivatives(rates, M, body.airframe) + setting.observer_gain * (y - seen)
        return np.concatenate([derivatives(x, u, body, at=at, variation=variation), observed]), u

    z = np.zeros((len(STATES) + 3, n))
    z[TAS], z[ALTITUDE], z[POWER] = setting.tas_m_s, setting.altitude_m, commanded_power(np.array(setting.throttle))
    residual, states, controls = (np.empty((samples.size, rows, n)) for rows in (3, len(STATES), len(CONTROLS)))
    for k in samples:
        start = float(k) * setting.record_s
        residual[k], states[k] = z[RATES] + noise[k] + fault(start) - z[-3:], z[:-3]
        for i in range(steps):
            t = start + i * h
            first, u = change(t, z, noise[k])
            controls[k] = u if i == 0 else controls[k]
            second, _ = change(t + 0.5 * h, z + 0.5 * h * first, noise[k])
            third, _ = change(t + 0.5 * h, z + 0.5 * h * second, noise[k])
            fourth, _ = change(t + BEFORE_THE_END * h, z + h * third, noise[k])
            z = z + h / 6.0 * (first + 2.0 * (second + third) + fourth)
        if report is not None:
            report(int(k) + 1, samples.size)
    time_s = np.asarray(samples * setting.record_s, dtype=np.float64)
    return Flights(time_s=time_s, residual=residual, states=states, controls=controls)
