"""Dryden gusts along and across the flight path, and how they enter a linear model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ..errors import ConfigError
from .model import LinearModel, propagate

__all__ = ["GUSTS", "Dryden", "dryden_gusts", "with_gusts"]

FloatArray = NDArray[np.float64]

GUSTS = ("headwind_gust", "updraught")
# States (u, w1, w2) in time units of scale length / airspeed, driven by unit white noise; stationary covariance P.
A = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -2.0]])
P = np.diag([1.0, 0.25, 0.25])
C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, np.sqrt(3.0)]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Dryden:
    """Intensity in m/s and scale length in m, alike in both directions (medium and high altitude: 533 m).

    Raises
    ------
    ConfigError : the intensity is negative, the scale length not positive, or one of them not finite.
    """

    sigma_m_s: float
    scale_length_m: float = 533.4

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma_m_s) and self.sigma_m_s >= 0):
            raise ConfigError(f"turbulence: no intensity, got {self.sigma_m_s:g} m/s; give 0 or a positive number")
        if not (np.isfinite(self.scale_length_m) and self.scale_length_m > 0):
            raise ConfigError(f"turbulence: no scale length, got {self.scale_length_m:g} m; give a positive number")


def dryden_gusts(
    dryden: Dryden, n_samples: int, *, airspeed_m_s: float, rate_hz: float, rng: np.random.Generator
) -> FloatArray:
    """Return headwind and upward gust velocity, (n_samples, 2), m/s, stationary from the first sample.

    With T = scale length / airspeed the spectra are sigma^2 2T/(1 + (wT)^2) along and sigma^2 T (1 + 3(wT)^2)/(1 +
    (wT)^2)^2 across the flight path (MIL-F-8785C). The filters are discretised exactly: at every rate the samples have
    variance sigma^2 and autocorrelations exp(-t/T) and exp(-t/T) (1 - t/(2T)).
    """
    step = airspeed_m_s / (dryden.scale_length_m * rate_hz)
    Ad = np.asarray(expm(A * step))
    variances, axes = np.linalg.eigh(P - Ad @ P @ Ad.T)
    shocks = rng.standard_normal((n_samples + 1, A.shape[0]))
    drive = shocks[1:] @ (axes * np.sqrt(np.maximum(variances, 0.0))).T
    states = propagate(Ad, drive, x0=np.sqrt(P) @ shocks[0])
    return np.asarray(dryden.sigma_m_s * states @ C.T)


def with_gusts(model: LinearModel) -> LinearModel:
    """Return `model` with two more inputs, the gust velocities `GUSTS` in m/s.

    The states are then motion over the ground; aerodynamic forces and air-data sensors see the motion through the air,
    tas + headwind and aoa + updraught / airspeed. A steady wind therefore leaves the aircraft trimmed in the air. The
    gust's gradient along the aircraft (a pitch rate) is left out, and so is a state the model does not have.
    """
    to_air = np.zeros((len(model.states), len(GUSTS)))
    if "tas" in model.states:
        to_air[model.states.index("tas"), 0] = 1.0
    if "aoa" in model.states:
        to_air[model.states.index("aoa"), 1] = 1.0 / model.airspeed_m_s
    return replace(
        model,
        B=np.hstack([model.B, model.A @ to_air]),
        D=np.hstack([model.D, model.C @ to_air]),
        inputs=model.inputs + GUSTS,
        units={**model.units, **dict.fromkeys(GUSTS, "m/s")},
    )
