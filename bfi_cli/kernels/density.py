"""Densities of residuals: adaptive kernels after Abramson, and the Gaussian fit they are compared with.

Equation numbers are those of Wang, Tang, Chen, "Quantitative Evaluation of Sensor Fault Diagnosability of F-16 High
Maneuvering Fighter". Its (20) prints 1/(2 pi) for the constant of a Gaussian kernel; 1/sqrt(2 pi) is used here, so that
a density integrates to 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from . import FloatArray

# Fewest samples from which a bandwidth is estimated.
FEWEST = 3
# Distances between points and kernels that are held at a time: half a megabyte, which stays in the cache.
BLOCK = 1 << 16
# Sums of exponentials this far from overflow and underflow need no scaling by the largest.
SMALL = 1e-250
# The exponents a of (22) to choose from. They end at 1 because on a multimodal residual the likelihood may rise beyond
# any sensible exponent.
EXPONENTS = np.linspace(0.0, 1.0, 21)
HALF_LOG_2_PI = 0.5 * np.log(2.0 * np.pi)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Density:
    """The mean of Gaussian kernels, one per sample; a Gaussian is one kernel.

    Attributes
    ----------
    samples : (n,) centres of the kernels.
    bandwidths : (n,) standard deviation of each, h_i of (21).
    pilot_bandwidth : h of (24), before the local factors.
    exponent : a of (22), 0 where all kernels are alike.
    """

    samples: FloatArray
    bandwidths: FloatArray
    pilot_bandwidth: float
    exponent: float


def kernel_density(samples: FloatArray, *, exponent: float | None = 0.5, bandwidth: float | None = None) -> Density:
    """Return the adaptive kernel density of samples, (19) with (21)-(24).

    Parameters
    ----------
    samples : (n,) of any unit, three or more.
    exponent : a of (22), 0 for one bandwidth everywhere; None for the one of 0, 0.05 .. 1 with the
        largest leave-one-out likelihood (25).
    bandwidth : in place of the rule of thumb (24), in the samples' unit.

    Raises
    ------
    ValueError : too few samples, all of them equal, not finite, or a setting that is out of range.
    """
    samples = _checked(samples)
    spread = float(np.std(samples, ddof=1))
    low, high = np.percentile(samples, [25.0, 75.0])
    # (24); where half the samples are equal, the standard deviation alone is the spread.
    narrow = min(spread, (high - low) / 1.34) if high > low else spread
    h = float(0.9 * narrow * samples.size**-0.2) if bandwidth is None else bandwidth
    if not (np.isfinite(h) and h > 0.0):
        raise ValueError(f"bandwidth must be positive, got {h:g}")
    # (22) and (23): local factors of geometric mean 1, from the preliminary estimate with the own kernel included.
    alike = Density(samples=samples, bandwidths=np.full(samples.size, h), pilot_bandwidth=h, exponent=0.0)
    relative = log_density(alike, samples)
    relative = relative - np.mean(relative)
    if exponent is None:
        exponent = float(EXPONENTS[np.argmax([_left_out(samples, h * np.exp(-a * relative)) for a in EXPONENTS])])
    if not (np.isfinite(exponent) and exponent >= 0.0):
        raise ValueError(f"exponent must not be negative, got {exponent:g}")
    return _density(samples, h * np.exp(-exponent * relative), pilot_bandwidth=h, exponent=float(exponent))


def gaussian_density(samples: FloatArray) -> Density:
    """Return the Gaussian with the samples' mean and standard deviation.

    Raises
    ------
    ValueError : see `kernel_density`.
    """
    samples = _checked(samples)
    spread = float(np.std(samples, ddof=1))
    return _density(np.array([np.mean(samples)]), np.array([spread]), pilot_bandwidth=spread, exponent=0.0)


def log_density(density: Density, points: FloatArray) -> FloatArray:
    """Return the natural logarithm of the density at points of any shape; finite however far out."""
    points = np.asarray(points, dtype=np.float64)
    weights = -np.log(density.bandwidths)
    most = float(np.max(weights))
    logarithms = np.empty(points.size)
    for rows in _blocks(points.size, density.samples.size):
        off = (points.reshape(-1)[rows, None] - density.samples) / density.bandwidths
        logarithms[rows] = _log_sum_exp(-0.5 * off * off + (weights - most))
    return np.asarray(logarithms.reshape(points.shape) + (most - np.log(density.samples.size) - HALF_LOG_2_PI))


def draw(density: Density, n: int, *, rng: np.random.Generator) -> FloatArray:
    """Return (n,) independent values of the density."""
    kernel = rng.integers(density.samples.size, size=n)
    return np.asarray(density.samples[kernel] + density.bandwidths[kernel] * rng.standard_normal(n))


def convolve(density: Density, sd: float) -> Density:
    """Return the density of a value with an independent Gaussian one of mean 0 and deviation `sd` added."""
    if not (np.isfinite(sd) and sd >= 0.0):
        raise ValueError(f"a deviation must not be negative, got {sd:g}")
    wider = np.hypot(density.bandwidths, sd)
    pilot = float(np.hypot(density.pilot_bandwidth, sd))
    return _density(density.samples, wider, pilot_bandwidth=pilot, exponent=density.exponent)


def _checked(samples: FloatArray) -> FloatArray:
    samples = np.asarray(samples, dtype=np.float64)
    if samples.ndim != 1 or samples.size < FEWEST:
        raise ValueError(f"a density needs {FEWEST} samples or more in one dimension, got shape {samples.shape}")
    if not np.isfinite(samples).all():
        raise ValueError("samples must be finite, got NaN or infinite values; cut them first")
    if np.ptp(samples) <= 8.0 * np.finfo(float).eps * np.max(np.abs(samples)):
        raise ValueError(f"samples must differ, got {samples.size} times {samples[0]:.6g}; they have no density")
    return samples


def _density(samples: FloatArray, bandwidths: FloatArray, *, pilot_bandwidth: float, exponent: float) -> Density:
    samples = samples.copy()
    for array in (samples, bandwidths):
        array.setflags(write=False)
    return Density(samples=samples, bandwidths=bandwidths, pilot_bandwidth=pilot_bandwidth, exponent=exponent)


def _left_out(samples: FloatArray, bandwidths: FloatArray) -> float:
    """Return the sum of the logarithms of (25), without the terms that do not depend on the bandwidths."""
    total = 0.0
    for rows in _blocks(samples.size, samples.size):
        off = (samples[rows, None] - samples) / bandwidths
        exponents = -0.5 * off * off - np.log(bandwidths)
        exponents[np.arange(len(exponents)), np.arange(samples.size)[rows]] = -np.inf
        total += float(np.sum(_log_sum_exp(exponents)))
    return total


def _log_sum_exp(exponents: FloatArray) -> FloatArray:
    """Return the logarithm of the sum of exponentials of each row, scaled by the largest only where that is needed."""
    total = np.sum(np.exp(exponents), axis=1)
    far = ~((total > SMALL) & (total < 1.0 / SMALL))
    total[far] = 1.0
    logarithms = np.log(total)
    if np.any(far):
        top = np.max(exponents[far], axis=1, keepdims=True)
        logarithms[far] = top[:, 0] + np.log(np.sum(np.exp(exponents[far] - top), axis=1))
    return np.asarray(logarithms)


def _blocks(n_points: int, n_kernels: int) -> Iterator[slice]:
    """Yield ranges of points whose distances to all kernels fit into the cache."""
    size = max(1, BLOCK // n_kernels)
    yield from (slice(start, start + size) for start in range(0, n_points, size))
