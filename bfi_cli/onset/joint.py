"""Magnitudes of given signals by maximum likelihood on the record of a scan: where one magnitude is not enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.bilinear import Fit, bilinear, fit_magnitudes
from ..kernels.lagged import compress
from ..kernels.progress import Step
from .record import ScanRecord

__all__ = ["Likelihood"]

FloatArray = NDArray[np.float64]

FLOOR = 1e-9
TOLERANCE = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Likelihood:
    """A record and the order of its model.

    Attributes
    ----------
    y : (n_samples, n_outputs) scaled outputs.
    step : called at every fit, so that whoever fits many can tell how far it is.
    """

    record: ScanRecord
    y: FloatArray
    order: int
    step: Step | None = None

    @property
    def n_rows(self) -> int:
        """Rows of the regression."""
        return len(self.y) - self.order

    def fit(self, theta: FloatArray, start: FloatArray | None = None) -> Fit:
        """Return the maximum over the magnitudes of signals theta (n_samples, n_outputs, n_signals)."""
        if self.step is not None:
            self.step()
        data = compress(self.record.u, self.y, theta, order=self.order, feedthrough=self.record.feedthrough)
        problem = bilinear(data, self.order, floor=FLOOR if self.record.floor is None else self.record.floor)
        return fit_magnitudes(problem, range(theta.shape[2]), start, tolerance=TOLERANCE)

    def on_output(self, signals: FloatArray, output: int, start: FloatArray | None = None) -> Fit:
        """Return the maximum over the magnitudes of signals (n_samples, n_signals) of one output."""
        theta = np.zeros((*self.y.shape, signals.shape[1]))
        theta[:, output] = signals
        return self.fit(theta, start)
