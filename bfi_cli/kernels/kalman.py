"""The Kalman filter of a linear time-invariant system, with the likelihood of every sample.

The system is x(k+1) = A x(k) + B u(k) + w(k), y(k) = C x(k) + D u(k) + v(k), w and v white with covariances Q and R.
The Joseph form of the update keeps the covariance positive for any gain.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi

import numpy as np
from scipy.linalg import lapack

from . import FloatArray

# An eigenvalue of Q below zero by less than this share of its largest entry is round-off.
NEGATIVE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gaussian:
    """A state estimate: mean (n_x,) and covariance (n_x, n_x)."""

    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateSpace:
    """A discrete-time system with noise.

    Attributes
    ----------
    A, B, C, D : (n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u).
    Q : (n_x, n_x) covariance of the process noise of one step, positive semidefinite.
    R : (n_y, n_y) covariance of the measurement noise, positive definite.

    Raises
    ------
    ValueError : shapes disagree, or Q or R is no covariance.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    Q: FloatArray
    R: FloatArray

    def __post_init__(self) -> None:
        n_x, n_u, n_y = len(self.A), self.B.shape[-1], len(self.C)
        wanted = {"A": (n_x, n_x), "B": (n_x, n_u), "C": (n_y, n_x), "D": (n_y, n_u), "Q": (n_x, n_x), "R": (n_y, n_y)}
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected {shape}")
        if not _smallest_eigenvalue(self.Q) >= -NEGATIVE * np.abs(self.Q).max(initial=0.0):
            raise ValueError("Q must be symmetric and positive semidefinite")
        if not _smallest_eigenvalue(self.R) > 0:
            raise ValueError("R must be symmetric and positive definite")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterStep:
    """The estimate after one measurement, and the innovation with its covariance and log-likelihood."""

    estimate: Gaussian
    innovation: FloatArray
    innovation_covariance: FloatArray
    log_likelihood: float


def predict(posterior: Gaussian, system: StateSpace, *, u: FloatArray) -> Gaussian:
    """Return the estimate of the next state, `u` (n_u,) being the input of the present sample."""
    A = system.A
    return Gaussian(mean=A @ posterior.mean + system.B @ u, covariance=A @ posterior.covariance @ A.T + system.Q)


def update(prior: Gaussian, system: StateSpace, *, y: FloatArray, u: FloatArray) -> FilterStep:
    """Correct the predicted state `prior` with a measurement `y`, (n_y,); `u`, (n_u,), is the input with it.

    Raises
    ------
    ValueError : the covariance of the innovation is not positive definite (the prior's is none, or not finite).
    """
    C, P = system.C, prior.covariance
    innovation = y - C @ prior.mean - system.D @ u
    S = C @ P @ C.T + system.R
    factor, failed = lapack.dpotrf(S, lower=True)
    if failed:
        raise ValueError("the covariance of the innovation is not positive definite")
    gain = lapack.dpotrs(factor, C @ P, lower=True)[0].T
    kept = np.eye(len(P)) - gain @ C
    covariance = kept @ P @ kept.T + gain @ system.R @ gain.T
    white = lapack.dtrtrs(factor, innovation, lower=True)[0]
    log_det = 2.0 * float(np.log(factor.diagonal()).sum())
    return FilterStep(
        estimate=Gaussian(mean=prior.mean + gain @ innovation, covariance=(covariance + covariance.T) / 2.0),
        innovation=innovation,
        innovation_covariance=S,
        log_likelihood=-0.5 * (len(y) * log(2.0 * pi) + log_det + float(white @ white)),
    )


def _smallest_eigenvalue(M: FloatArray) -> float:
    """Return it for a finite symmetric matrix, NaN for any other."""
    return float(np.linalg.eigvalsh(M)[0]) if np.allclose(M, M.T, rtol=1e-9, atol=0.0) else float("nan")
