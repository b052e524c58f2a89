"""The diagnosability index of eq. 15-17 for both gyros in the three windows of table II."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.density import Density, gaussian_density, kernel_density
from ..kernels.divergence import jensen_shannon_montecarlo, jensen_shannon_quadrature
from .f16_flights import Case, Residuals, fly_cases
from .f16_options import F16Options

__all__ = [
    "AXES",
    "BANDWIDTHS",
    "TABLE_2",
    "WINDOWS",
    "Indices",
    "density_pair",
    "in_window",
    "indices",
    "measured",
    "montecarlo",
]

FloatArray = NDArray[np.float64]

AXES = ("roll rate", "pitch rate")
WINDOWS = ((0.0, 4.0), (4.0, 12.0), (12.0, 20.0))
TABLE_2 = np.array([[0.1691, 0.6362, 0.8890], [0.1934, 0.4276, 0.6248]])
"""Published: one row per axis, one column per window."""
BANDWIDTHS = np.array([[np.nan, 0.2600, 0.5738], [np.nan, 0.3430, 0.6798]])
"""Published fixed bandwidths, deg/s; none for the first window."""
INSTANT = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Indices:
    """One row per set of flights, axis and window: FD, and the bandwidth of eq. 24 in deg/s, (n, 2, 3)."""

    index: FloatArray
    bandwidth: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square difference of the mean index to table II."""
        return float(np.sqrt(np.mean((self.index.mean(axis=0) - TABLE_2) ** 2)))

    @property
    def worst(self) -> float:
        """Largest difference of the mean index to table II."""
        return float(np.max(np.abs(self.index.mean(axis=0) - TABLE_2)))


def measured(options: F16Options, *, seeds: Sequence[int]) -> Indices:
    """Fly four flights per seed and return their indices."""
    return indices(fly_cases([Case(options=options, seed=seed) for seed in seeds]), options)


def indices(flights: Sequence[Residuals], options: F16Options) -> Indices:
    """Return the indices of sets of four flights by quadrature."""
    scale = (1.0 if options.halves else 2.0) * (1.0 if options.log_base == "2" else np.log(2.0))
    pairs = [
        density_pair(flown, options, axis=axis, window=window)
        for flown in flights
        for axis in range(len(AXES))
        for window in WINDOWS
    ]
    shape = (len(flights), len(AXES), len(WINDOWS))
    return Indices(
        index=scale * np.array([jensen_shannon_quadrature(p, q) for p, q in pairs]).reshape(shape),
        bandwidth=np.array([p.pilot_bandwidth for p, _ in pairs]).reshape(shape),
    )


def montecarlo(
    flown: Residuals, options: F16Options, n: int, *, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return J in bits by n values of each density, and its standard errors, both (2, 3)."""
    found = [
        [
            jensen_shannon_montecarlo(*density_pair(flown, options, axis=axis, window=window), n, rng=rng)
            for window in WINDOWS
        ]
        for axis in range(len(AXES))
    ]
    value, error = np.moveaxis(np.array(found), 2, 0)
    return value, error


def density_pair(
    flown: Residuals, options: F16Options, *, axis: int, window: tuple[float, float]
) -> tuple[Density, Density]:
    """Return the density of the residual of a faulty gyro in a window, and that without a fault."""
    faulty = (flown.roll_fault, flown.pitch_fault)[axis][:, axis]
    healthy = (flown.healthy if options.reference_aircraft == "varied" else flown.nominal)[:, axis]
    inside = in_window(flown.time_s, window)
    normal = healthy if options.reference_window == "whole" else healthy[inside]
    if options.reference == "gaussian":
        q = gaussian_density(normal)
    else:
        q = kernel_density(normal, exponent=options.exponent)
    return kernel_density(faulty[inside], exponent=options.exponent), q


def in_window(time_s: FloatArray, window: tuple[float, float]) -> NDArray[np.bool_]:
    """Return which times are in a window, its end left out."""
    low, high = window
    return np.asarray((time_s > low - INSTANT) & (time_s < high - INSTANT))
