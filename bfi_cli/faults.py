"""A fault: its shape, where and when it acts, and the signal it adds to a sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = ["SHAPES", "Fault", "Shape"]

FloatArray = NDArray[np.float64]
Shape = Literal["bias", "drift", "sine", "cosine", "lagged_bias", "ramp_hold", "samples"]
SHAPES: tuple[str, ...] = get_args(Shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """An additive sensor fault `magnitude * signal(t)`, zero before `onset_s` and from `offset_s` on.

    Times are seconds on the axis the fault was stated on (see `relative_to` of a dictionary).
    """

    shape: Shape
    channel: str = "tas"
    magnitude: float = 1.0
    onset_s: float = 0.0
    offset_s: float | None = None
    name: str | None = None
    slope: float | None = None
    frequency_hz: float | None = None
    phase_rad: float = 0.0
    phase_reference: Literal["onset", "window"] = "onset"
    time_constant_s: float | None = None
    duration_s: float | None = None
    file: str | None = None
