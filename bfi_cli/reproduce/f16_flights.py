"""The F-16 experiment: what the diagnosability paper leaves open, and flights without and with a faulty gyro.

The paper states neither command, aerodynamic variation, gyro noise, observer, reference window, throttle, exponent nor
the base of its logarithm. Each is an option, whose default comes close to the paper's table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..aircraft.f16 import Inversion, Observation, observe
from ..errors import ConfigError
from ..validation import Number, Positive, Rules, validate
from ..yaml12 import load_yaml

__all__ = ["Case", "F16Options", "Residuals", "fault_deg_s", "fly_cases", "options_from"]

FloatArray = NDArray[np.float64]
NotNegative = Annotated[Number, Field(ge=0)]
WHERE = "f16-table2"  # what messages about an option name
AOA_COMMAND = ((0.0, 0.0), (1.0, 8.0), (2.0, 8.0), (4.0, 35.0), (5.5, 35.0), (7.5, 6.0), (20.0, 6.0))
ONSET_S, GROWS_S = 4.0, 12.0  # of the fault, eq. 26
AMPLITUDES_DEG_S = (2.0, 4.0)
FREQUENCY_HZ = 1.0
ROLL_RAMP_S = 1.0
SAMPLES = 200  # of the record, 20 s at 10 Hz
KINDS = ("nominal", "healthy", "roll_fault", "pitch_fault")
FAULTY_GYRO = {"roll_fault": 0, "pitch_fault": 1}
INSTANT = 1e-9  # s: a sample at an instant belongs to what begins there


class F16Options(Rules):
    """One reading of the experiment."""

    reference: Literal["kde", "gaussian"] = "kde"
    """Density of the fault-free residual: by kernels, or a Gaussian fit, as the paper's conclusion says."""
    reference_window: Literal["whole", "same"] = "whole"
    """Of the fault-free residual: the whole flight, or the window of the faulty one."""
    reference_aircraft: Literal["varied", "nominal"] = "varied"
    """That flies without a fault: with the aerodynamic variation, or without."""
    exponent: NotNegative | None = 0.5
    """a of eq. 22, 0 for one bandwidth everywhere, none for the most likely."""
    log_base: Literal["2", "e"] = "2"
    """Of eq. 15."""
    halves: bool = True
    """The factors 1/2 of eq. 15, which eq. 17 leaves out."""
    noise_deg_s: NotNegative = 0.05
    """Standard deviation of the gyros, held for 0.1 s."""
    variation: tuple[Number, Number, Number] = (0.10, 0.25, 0.20)
    """Relative changes of Cl, Cm, Cn, eq. 8."""
    observer_gain: tuple[Positive, Positive, Positive] = (9.0, 6.0, 8.0)
    """Of p, q, r, 1/s."""
    observer_rates: Literal["measured", "estimated"] = "measured"
    """At which the observer takes the nominal moments: f2(y) or f2(x-hat)."""
    aoa_command: tuple[tuple[Number, Number], ...] = AOA_COMMAND
    """Corners of the commanded angle of attack: seconds, degrees."""
    roll_deg: Number = 25.0
    """Commanded roll, reached after 1 s."""
    throttle: Annotated[Number, Field(ge=0, le=1)] = 0.9
    """Fixed."""
    nozzle_deg: Annotated[Number, Field(ge=0, le=45)] = 15.0
    """Largest deflection of the thrust-vectoring nozzle."""
    step_s: Annotated[Number, Field(gt=0, le=0.1)] = 0.02
    """Of the Runge-Kutta integration; the record's step is 0.1 s."""

    @model_validator(mode="after")
    def _has_a_density(self) -> F16Options:
        times = [time for time, _ in self.aoa_command]
        if len(times) < 2 or any(after <= before for before, after in pairwise(times)):
            raise ValueError("aoa_command: needs two corners or more in the order of time; write [[0, 0], [1, 8]]")
        still = self.noise_deg_s == 0.0
        if still and (self.reference_aircraft == "nominal" or not any(self.variation)):
            raise ValueError("noise_deg_s: the fault-free residual is zero and has no density; give some noise")
        return self


def options_from(assignments: Sequence[str]) -> F16Options:
    """Return the options of texts like "noise_deg_s=0.03" or "variation=[0.3, 0.3, 0.3]"; the rest as by default.

    Raises
    ------
    ConfigError : there is no such option, or it cannot have this value.
    """
    given: dict[str, object] = {}
    for text in assignments:
        name, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"{WHERE}: expected KEY=VALUE, got '{text}'; write noise_deg_s=0.03")
        read = load_yaml(value, where=f"{WHERE}: {name.strip()}")
        given[name.strip()] = str(read) if name.strip() == "log_base" else read
    return validate(F16Options, given, where=WHERE, error=ConfigError)


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
        found.update(zip(members, _fly([cases[i] for i in members], told), strict=True))
    return [found[i] for i in range(len(cases))]


def _fly(cases: Sequence[Case], report: Callable[[int, int], None] | None) -> list[Residuals]:
    """Fly the four flights of every case, one column each."""
    o = cases[0].options
    gains, variation = (
        np.repeat(np.array([getattr(case.options, key) for case in cases]).T, len(KINDS), axis=1)
        for key in ("observer_gain", "variation")
    )
    variation[:, :: len(KINDS)] = 0.0
    faulty = np.zeros_like(variation)
    for kind, gyro in FAULTY_GYRO.items():
        faulty[gyro, KINDS.index(kind) :: len(KINDS)] = 1.0
    noise = []  # (m, 3, 4) rad/s; a seed gives the same noise but for its size
    for case in cases:
        rng = np.random.default_rng(case.seed)
        noise.append(np.radians(case.options.noise_deg_s) * rng.standard_normal((SAMPLES, 3, len(KINDS))))
    flown = observe(
        Observation(
            command=_command([case.options for case in cases]),
            observer_gain=gains,
            from_measured=o.observer_rates == "measured",
            inversion=Inversion(nozzle_limit=float(np.radians(o.nozzle_deg))),
            throttle=o.throttle,
            step_s=o.step_s,
        ),
        variation=variation,
        noise=np.concatenate(noise, axis=2),
        fault=lambda t: fault_deg_s(t) * np.radians(faulty),
        report=report,
    )
    found = []
    for first in range(0, len(cases) * len(KINDS), len(KINDS)):
        columns = {kind: first + i for i, kind in enumerate(KINDS)}
        of = {kind: np.degrees(flown.residual[:, :, column]) for kind, column in columns.items()}
        found.append(Residuals(time_s=flown.time_s, states=flown.states[:, :, columns["healthy"]], **of))
    return found


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
