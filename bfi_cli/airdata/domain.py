"""What the equations of air data hold for: the checks of their arguments."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["FloatArray", "checked"]

FloatArray = NDArray[np.float64]


def checked(
    name: str, values: ArrayLike, unit: str, *, least: float, most: float = np.inf, above: bool = False, why: str
) -> FloatArray:
    """Return the values as an array of floats.

    Parameters
    ----------
    least, most : between which they lie, in `unit`; NaN is let through.
    above : `least` itself is refused, too.
    why : what the equations hold for, for the message.

    Raises
    ------
    ValueError : a value lies outside.
    """
    array = np.asarray(values, dtype=np.float64)
    wrong = array <= least if above else array < least
    if most < np.inf:
        wrong = wrong | (array > most)
    if wrong.any():
        value = float(array[wrong].flat[0] if array.ndim else array)
        raise ValueError(f"{name}: {why}, got {value:.6g} {unit}".rstrip())
    return array
