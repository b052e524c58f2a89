"""Control inputs that excite the longitudinal modes, as pure functions of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..faults import did_you_mean

__all__ = ["MANOEUVRES", "manoeuvre"]

FloatArray = NDArray[np.float64]

EDGE_TOLERANCE = 1e-9  # in unit steps: a sample at an edge belongs to the step that begins there
MULTISINE_PERIOD = 10.0  # in unit steps
MULTISINE_LINES = 16


def manoeuvre(
    name: str,
    time_s: FloatArray,
    *,
    amplitude_rad: float = 0.035,
    start_s: float = 0.2,
    step_s: float = 1.0,
) -> FloatArray:
    """Return the control deflection at `time_s`, (n,), zero before `start_s`.

    Parameters
    ----------
    name : "3211" (steps of 3, 2, 1, 1 units with changing sign), "doublet" (one unit each way), "multisine" (16 lines
        k/10 per unit with Schroeder's phases, up to the end of the record), or "none".
    time_s : (n,) seconds, any values in any order.
    amplitude_rad : largest deflection; the thesis's listing uses 0.5, far outside the linear range.
    start_s : 0.2 s in the thesis's listing.
    step_s : the unit step.

    Raises
    ------
    ConfigError : no such manoeuvre, a step that is not positive, or a number that is not finite.
    """
    if name not in MANOEUVRES:
        raise ConfigError(f"manoeuvre: unknown, got '{name}'{did_you_mean(name, tuple(MANOEUVRES))}")
    if not (np.isfinite([amplitude_rad, start_s, step_s]).all() and step_s > 0):
        raise ConfigError(
            f"manoeuvre: needs finite numbers and a positive step, got amplitude {amplitude_rad:g} rad, "
            f"start {start_s:g} s, step {step_s:g} s; change --amplitude, --start or --step"
        )
    units = (np.asarray(time_s, dtype=np.float64) - start_s) / step_s
    return amplitude_rad * MANOEUVRES[name](units)


def _steps(lengths: tuple[int, ...]) -> Callable[[FloatArray], FloatArray]:
    edges = np.cumsum((0, *lengths)) - EDGE_TOLERANCE
    levels = np.array([0.0, *((-1.0) ** np.arange(len(lengths))), 0.0])
    return lambda units: levels[np.searchsorted(edges, units, side="right")]


def _multisine(units: FloatArray) -> FloatArray:
    """Return equal cosines whose phases keep the crest factor low (Schroeder 1970), their largest sum 1."""
    k = np.arange(1, MULTISINE_LINES + 1)
    phase = -np.pi * k * (k - 1) / MULTISINE_LINES

    def cosines(at: FloatArray) -> FloatArray:
        angle: FloatArray = 2.0 * np.pi * np.multiply.outer(at, k) / MULTISINE_PERIOD + phase
        return np.asarray(np.cos(angle).sum(axis=-1))

    fine = np.linspace(0.0, MULTISINE_PERIOD, 64 * MULTISINE_LINES, endpoint=False)
    return np.where(units >= -EDGE_TOLERANCE, cosines(units) / np.abs(cosines(fine)).max(), 0.0)


MANOEUVRES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "3211": _steps((3, 2, 1, 1)),
    "doublet": _steps((1, 1)),
    "multisine": _multisine,
    "none": np.zeros_like,
}
