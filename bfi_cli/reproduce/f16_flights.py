"""The flights of the F-16 experiment: fault-free as designed and as built, and with a faulty roll or pitch gyro."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..aircraft.f16 import Flights, Inversion, Observation, observe
from .f16_options import F16Options

__all__ = ["Case", "Residuals", "fly_cases"]

FloatArray = NDArray[np.float64]

ONSET_S, GROWS_S = 4.0, 12.0
AMPLITUDES_DEG_S = (2.0, 4.0)
FREQUENCY_HZ = 1.0
ROLL_RAMP_S = 1.0
SAMPLES = 200
KINDS = ("nominal", "healthy", "roll_fault", "pitch_fault")
FAULTY_GYRO = {"roll_fault": 0, "pitch_fault": 1}
INSTANT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One set of four flights."""

    options: F16Options
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """What a set of four flights gave.

    Attributes
    ----------
    time_s : (m,).
    nominal, healthy, roll_fault, pitch_fault : (m, 3) residuals of p, q, r, deg/s; all but the first with the
        aerodynamic variation.
    states : (m, 13) of the healthy flight.
    """

    time_s: FloatArray
    nominal: FloatArray
    healthy: FloatArray
    roll_fault: FloatArray
    pitch_fault: FloatArray
    states: FloatArray


def fly_cases(cases: Sequence[Case], report: Callable[[int, int], None] | None = None) -> list[Residuals]:
    """Fly all cases, those that share an aircraft at once, and return their residuals in the order of `cases`.

    Parameters
    ----------
    report : told how many samples are flown, (done, total).
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, case in enumerate(cases):
        o = case.options
        groups.setdefault((o.observer_rates, o.throttle, o.nozzle_deg, o.step_s), []).append(i)
    found: dict[int, Residuals] = {}
    for number, members in enumerate(groups.values()):
        before, total = number * SAMPLES, len(groups) * SAMPLES
        told = None if report is None else lambda done, _all, first=before, of=total: report(first + done, of)
        flown = _fly([cases[i] for i in members], told)
        found.update((i, _residuals(flown, place)) for place, i in enumerate(members))
    return [found[i] for i in range(len(cases))]


def _fly(cases: Sequence[Case], report: Callable[[int, int], None] | None) -> Flights:
    o = cases[0].options
    setting = Observation(
        command=_command([case.options for case in cases]),
        observer_gain=_columns([case.options.observer_gain for case in cases]),
        from_measured=o.observer_rates == "measured",
        inversion=Inversion(nozzle_limit=float(np.radians(o.nozzle_deg))),
        throttle=o.throttle,
        step_s=o.step_s,
    )
    variation = _columns([case.options.variation for case in cases])
    variation[:, :: len(KINDS)] = 0.0
    faulty = np.zeros_like(variation)
    for kind, gyro in FAULTY_GYRO.items():
        faulty[gyro, KINDS.index(kind) :: len(KINDS)] = 1.0
    noise = np.concatenate([_noise(case) for case in cases], axis=2)
    return observe(
        setting, variation=variation, noise=noise, fault=lambda t: fault_deg_s(t) * np.radians(faulty), report=report
    )


def _residuals(flown: Flights, place: int) -> Residuals:
    columns = {kind: place * len(KINDS) + i for i, kind in enumerate(KINDS)}
    of = {kind: np.degrees(flown.residual[:, :, column]) for kind, column in columns.items()}
    return Residuals(time_s=flown.time_s, states=flown.states[:, :, columns["healthy"]], **of)


def fault_deg_s(t: float) -> float:
    """Return f(t) of eq. 26: a sine of 1 Hz, called a bias there."""
    if t < ONSET_S - INSTANT:
        return 0.0
    amplitude = AMPLITUDES_DEG_S[int(t > GROWS_S - INSTANT)]
    return float(amplitude * np.sin(2.0 * np.pi * FREQUENCY_HZ * t))


def _command(options: Sequence[F16Options]) -> Callable[[float], FloatArray]:
    """Return the commanded aoa, sideslip and roll, (3, n) rad, as a function of time; equal curves are one look-up."""
    curves = list(dict.fromkeys(one.aoa_command for one in options))
    which = np.repeat([curves.index(one.aoa_command) for one in options], len(KINDS))
    rolls = np.repeat(np.radians([one.roll_deg for one in options]), len(KINDS))
    corners = [np.array(one).T for one in curves]

    def at(t: float) -> FloatArray:
        aoa = np.radians([float(np.interp(t, times, degrees)) for times, degrees in corners])[which]
        return np.array([aoa, np.zeros_like(aoa), rolls * min(t / ROLL_RAMP_S, 1.0)])

    return at


def _columns(values: Sequence[tuple[float, float, float]]) -> FloatArray:
    return np.repeat(np.array(values, dtype=np.float64).T, len(KINDS), axis=1)


def _noise(case: Case) -> FloatArray:
    """Return (m, 3, 4) rad/s; a seed gives the same noise but for its size."""
    rng = np.random.default_rng(case.seed)
    return np.asarray(np.radians(case.options.noise_deg_s) * rng.standard_normal((SAMPLES, 3, len(KINDS))))
