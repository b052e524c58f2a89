"""A nonlinear aircraft that is flown from a trimmed flight by its own equations of motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Flown", "NonlinearModel"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """A flight: absolute inputs and outputs, (n_samples, n_u) and (n_samples, n_y); `notes` for the user."""

    inputs: FloatArray
    outputs: FloatArray
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NonlinearModel:
    """What `simulate` needs to know of an aircraft.

    Attributes
    ----------
    name, title : the name on the command line, and what it is.
    inputs, outputs : standard channel names.
    units : of every input and output, by name.
    fly : the flight from trim with input deviations, (n_samples, n_u), held between samples, at a rate in Hz.
    source : where the numbers come from.
    manoeuvred : inputs that a manoeuvre moves, all alike; the first one where none is named.
    """

    name: str
    title: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    fly: Callable[[FloatArray, float], Flown]
    source: str
    manoeuvred: tuple[str, ...] = ()
