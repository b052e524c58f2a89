"""One trial of the blind FIR sweeps: a dictionary, an output with noise, the error of every method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fir import identify_fir

__all__ = [
    "METHODS",
    "TAPS",
    "Outcome",
    "Problem",
    "Trial",
    "bound",
    "error",
    "output",
    "run",
    "slow_and_white",
    "z_of",
]

FloatArray = NDArray[np.float64]

TAPS = np.array([1.0, 0.5, -0.3])
SIZES = {1: 4.0, 2: 2.0, 6: 1.0}
METHODS: Mapping[str, Mapping[str, Any]] = {
    "RISRO": {"method": "risro"},
    "nuclear norm, penalty 0.001": {"method": "nuclear", "penalty": 1e-3},
    "nuclear norm, penalty 1e-06": {"method": "nuclear", "penalty": 1e-6},
}
N_SAMPLES, N_ATOMS, MOST_CYCLES = 1000, 7, 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A point of a sweep.

    Attributes
    ----------
    theta : (n_samples, n_atoms) dictionary; None for one drawn anew in every trial.
    white : then the share of white noise in it; the rest is slow oscillations, of which lags nearly coincide.
    noise : of the output, over its standard deviation.
    """

    theta: FloatArray | None
    white: float
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One trial of a problem; the seed is all that is random about it."""

    problem: Problem
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Relative errors by method in the order of `METHODS`, their first-order bound, the condition number."""

    errors: tuple[float, ...]
    bound: float
    condition_number: float


def run(trial: Trial) -> Outcome:
    """Return the outcome of a trial."""
    rng, problem = np.random.default_rng(trial.seed), trial.problem
    theta = slow_and_white(problem.white, rng) if problem.theta is None else problem.theta
    z = z_of(theta.shape[1])
    clean = output(theta, z)
    sd = problem.noise * float(np.std(clean))
    y = clean + sd * rng.standard_normal(len(clean))
    found = [identify_fir(y, theta, n_taps=len(TAPS), **how) for how in METHODS.values()]
    return Outcome(
        errors=tuple(error(one.product, z) for one in found),
        bound=bound(theta, z, sd),
        condition_number=found[0].condition_number,
    )


def z_of(n_atoms: int) -> FloatArray:
    """Return (n_atoms,) the true magnitudes, of which three are not zero."""
    return np.array([SIZES.get(j, 0.0) for j in range(n_atoms)])


def output(theta: FloatArray, z: FloatArray) -> FloatArray:
    """Return (n_samples,) y(k) = sum_i b_i u(k-i), i = 1.., of the input u = theta z that was zero before (eq. 3-2)."""
    return np.convolve(theta @ z, np.concatenate([[0.0], TAPS]))[: len(theta)]


def error(product: FloatArray, z: FloatArray) -> float:
    """Return the relative Frobenius error of a product b z^T."""
    truth = np.outer(TAPS, z)
    return float(np.linalg.norm(product - truth) / np.linalg.norm(truth))


def bound(theta: FloatArray, z: FloatArray, sd: float) -> float:
    """Return the root mean square of that error to first order: least squares over the tangent space at the truth.

    Parameters
    ----------
    sd : of white noise on the output.
    """
    if sd == 0.0:
        return 0.0
    n, p = len(theta), len(TAPS)
    lags = np.hstack([theta[p - lag : n - lag] for lag in range(1, p + 1)])
    tangent = np.hstack([np.kron(np.eye(p), z[:, None]), np.kron(TAPS[:, None], np.eye(len(z)))])
    basis = np.linalg.svd(tangent, full_matrices=False)[0][:, : p + len(z) - 1]
    values = np.linalg.svd(lags @ basis, compute_uv=False)
    return float(sd * np.sqrt(np.sum(values**-2.0)) / np.linalg.norm(np.outer(TAPS, z)))


def slow_and_white(white: float, rng: np.random.Generator) -> FloatArray:
    """Return (N_SAMPLES, N_ATOMS) signals of unit power: one to five cycles, with a share of white noise."""
    phase = rng.uniform(0.0, 2.0 * np.pi, N_ATOMS)
    cycles = rng.uniform(1.0, MOST_CYCLES, N_ATOMS)
    slow = np.sqrt(2.0) * np.sin(2.0 * np.pi * np.outer(np.arange(N_SAMPLES) / N_SAMPLES, cycles) + phase)
    return np.asarray(np.sqrt(1.0 - white**2) * slow + white * rng.standard_normal((N_SAMPLES, N_ATOMS)))
