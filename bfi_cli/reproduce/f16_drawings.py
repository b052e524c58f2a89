"""The figures of the F-16 experiment: manoeuvre, residuals, local bandwidths, densities."""

from __future__ import annotations

import numpy as np

from ..aircraft.f16 import STATES
from ..exhibit import Curve, Drawing, Panel, Span, curve
from ..kernels.density import log_density
from .f16_flights import Residuals
from .f16_indices import AXES, WINDOWS, density_pair, in_window
from .f16_options import F16Options

__all__ = ["drawings"]

FAULTY = WINDOWS[1:]
AMPLITUDE = ("2 deg/s", "4 deg/s")
WITH_FAULT = tuple(zip(AMPLITUDE, FAULTY, strict=True))
POINTS = 401
REACH = 3.0
LIMITS = (1e-3, 20.0)


def drawings(flown: Residuals, options: F16Options) -> tuple[Drawing, ...]:
    """Return the figures of one set of flights."""
    return (
        Drawing(
            name="f16_manoeuvre",
            caption="The fault-free flight of the aircraft with aerodynamic variation.",
            panels=_manoeuvre(flown, options),
        ),
        Drawing(
            name="f16_residuals",
            caption="Residuals of the rate observer with a sine of 1 Hz on one gyro and without (paper: figure 1).",
            panels=tuple(_residual(flown, axis) for axis in range(2)),
        ),
        Drawing(
            name="f16_bandwidths",
            caption="Local bandwidths of the faulty residuals, dashed the fixed ones (paper: figure 2).",
            panels=tuple(_bandwidths(flown, options, axis) for axis in range(2)),
        ),
        Drawing(
            name="f16_densities",
            caption="Densities of the residuals with a fault, and the fault-free reference (paper: figure 3).",
            panels=tuple(_densities(flown, options, axis) for axis in range(2)),
        ),
    )


def _manoeuvre(flown: Residuals, options: F16Options) -> tuple[Panel, ...]:
    times, corners = zip(*options.aoa_command, strict=True)
    angles = [
        curve(name, flown.time_s, np.degrees(flown.states[:, STATES.index(name)])) for name in ("aoa", "roll", "pitch")
    ]
    airspeed = curve("tas", flown.time_s, flown.states[:, STATES.index("tas")])
    return (
        Panel(
            x_label="time [s]",
            y_label="angle [deg]",
            curves=(*angles, curve("aoa, commanded", times, corners, style="dashed")),
        ),
        Panel(x_label="time [s]", y_label="true airspeed [m/s]", curves=(airspeed,)),
    )


def _residual(flown: Residuals, axis: int) -> Panel:
    faulty = (flown.roll_fault, flown.pitch_fault)[axis]
    return Panel(
        title=AXES[axis],
        x_label="time [s]",
        y_label="residual [deg/s]",
        curves=(
            curve("faulty gyro", flown.time_s, faulty[:, axis]),
            curve("no fault", flown.time_s, flown.healthy[:, axis]),
        ),
        spans=tuple(Span(label=f"fault of {label}", low=low, high=low) for label, (low, _) in WITH_FAULT),
    )


def _bandwidths(flown: Residuals, options: F16Options, axis: int) -> Panel:
    curves: list[Curve] = []
    for label, window in WITH_FAULT:
        density, _ = density_pair(flown, options, axis=axis, window=window)
        time_s = flown.time_s[in_window(flown.time_s, window)]
        fixed = np.full_like(time_s, density.pilot_bandwidth)
        curves += [curve(label, time_s, density.bandwidths), curve("", time_s, fixed, style="dashed")]
    return Panel(title=AXES[axis], x_label="time [s]", y_label="bandwidth [deg/s]", curves=tuple(curves))


def _densities(flown: Residuals, options: F16Options, axis: int) -> Panel:
    pairs = [density_pair(flown, options, axis=axis, window=window) for window in FAULTY]
    reach = max(float(np.max(np.abs(p.samples) + REACH * p.bandwidths)) for p, _ in pairs)
    at = np.linspace(-reach, reach, POINTS)
    curves = [
        curve(f"fault of {label}", at, np.exp(log_density(p, at)))
        for label, (p, _) in zip(AMPLITUDE, pairs, strict=True)
    ]
    reference = curve("no fault", at, np.exp(log_density(pairs[0][1], at)), style="dashed")
    return Panel(
        title=AXES[axis],
        x_label="residual [deg/s]",
        y_label="density [s/deg]",
        curves=(*curves, reference),
        log_y=True,
        y_limits=LIMITS,
    )
