"""Signals centred and scaled as they are asked for, so that a long record is held once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from . import FloatArray

# Samples of which means are taken at once, for memory.
AT_ONCE = 65_536


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScaledSignals:
    """Signals less their centre, over their unit; as an array (n_samples, n_signals).

    Attributes
    ----------
    values : (n_samples, n_signals); center, unit : (n_signals,).
    """

    values: FloatArray
    center: FloatArray
    unit: FloatArray

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_samples, n_signals)."""
        return self.values.shape

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, rows: Any) -> FloatArray:
        """Return the scaled signals of a slice of samples, or what else of all of them is asked for."""
        if not isinstance(rows, slice):
            return np.asarray(np.asarray(self)[rows])
        scaled = self.values[rows] - self.center
        scaled /= self.unit
        return scaled

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> FloatArray:
        """Return (n_samples, n_signals), which a short record has the memory for."""
        return self[:]


def standardised(values: FloatArray, *, centred: bool) -> ScaledSignals:
    """Return signals (n_samples, n_signals) with standard deviation 1 and, if centred, mean 0; constants unscaled."""
    n, parts = len(values), range(0, len(values), AT_ONCE)
    mean = np.sum([np.sum(values[k : k + AT_ONCE], axis=0) for k in parts], axis=0) / n
    squares = np.sum([np.sum((values[k : k + AT_ONCE] - mean) ** 2, axis=0) for k in parts], axis=0)
    unit = np.sqrt(squares / n)
    return ScaledSignals(
        values=values, center=mean if centred else np.zeros(values.shape[1]), unit=np.where(unit > 0.0, unit, 1.0)
    )
