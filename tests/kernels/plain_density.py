"""Equations (19)-(25) of the F-16 diagnosability paper, term by term, with any constant of the kernel."""

from __future__ import annotations

import math

import numpy as np

SQRT_2_PI = math.sqrt(2.0 * math.pi)


def kernel(x: float, constant: float) -> float:
    return constant * math.exp(-0.5 * x * x)


def density(x: float, samples: np.ndarray, widths: np.ndarray, *, constant: float = 1.0 / SQRT_2_PI) -> float:
    return sum(kernel((x - r) / h, constant) / h for r, h in zip(samples, widths, strict=True)) / len(samples)


def bandwidth(samples: np.ndarray) -> float:
    low, high = np.percentile(samples, [25, 75])
    return 0.9 * min(np.std(samples, ddof=1), (high - low) / 1.34) * len(samples) ** (-1 / 5)


def local_bandwidths(samples: np.ndarray, a: float, *, constant: float = 1.0 / SQRT_2_PI) -> np.ndarray:
    h = bandwidth(samples)
    pilot = [density(r, samples, np.full(len(samples), h), constant=constant) for r in samples]
    geometric_mean = math.exp(sum(math.log(p) for p in pilot) / len(samples))
    return np.array([h * (p / geometric_mean) ** -a for p in pilot])


def left_out(samples: np.ndarray, a: float) -> float:
    widths = local_bandwidths(samples, a)
    total = 0.0
    for i, r in enumerate(samples):
        others = [j for j in range(len(samples)) if j != i]
        total += math.log(
            sum(kernel((r - samples[j]) / widths[j], 1.0 / SQRT_2_PI) / widths[j] for j in others) / len(others)
        )
    return total
