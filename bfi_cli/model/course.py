"""A fault of unknown course, as a method of identification leaves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..decision import estimate_of
from ..faults import FaultEstimate
from ..kernels import FloatArray
from .preprocessing.window import PreparedWindow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeOutcome:
    """What is said of an entry of unknown course.

    Attributes
    ----------
    entry : of the dictionary; output : the index of the output it acts on.
    declared : it is in the log, and its course can be told; suspected : it is, and its course cannot.
    value, sd : (n_samples,) of the course at the samples of the window, SI; of one that is not declared as well.
    note : why it is not declared.
    """

    entry: int
    output: int
    declared: bool
    suspected: bool
    value: FloatArray
    sd: FloatArray
    note: str | None = None

    @property
    def peak(self) -> int:
        """The sample at which it is largest."""
        return int(np.argmax(np.abs(self.value)))

    def estimate(self, window: PreparedWindow, quantile: float) -> FaultEstimate:
        """Return the estimate of the fault, whose magnitude is its largest value.

        Parameters
        ----------
        window : in which it is declared; quantile : standard deviations that an interval reaches to each side.
        """
        fault, z, sd = window.faults[self.entry], float(self.value[self.peak]), float(self.sd[self.peak])
        return estimate_of(fault, z, sd, window.log.channel(fault.channel).unit, quantile=quantile)
