"""Channels of a log averaged over short blocks in flight, and the steps in which they were recorded."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ...flightlog import FlightLog
from ...kernels import FloatArray, IntArray
from ...kernels.runs import block_means
from ...quantities.channels import STANDARD


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blocks:
    """Which samples of a log each block averages.

    Attributes
    ----------
    block : (n_samples,) number of the block of every sample.
    count : (n_blocks,) samples in each.
    time_s : (n_blocks,) their mean time.
    """

    block: IntArray
    count: FloatArray
    time_s: FloatArray

    @classmethod
    def of(cls, time_s: FloatArray, block_s: float) -> Blocks:
        """Return blocks of a length, those without samples left out."""
        number = np.floor((time_s - time_s[0]) / block_s + 1e-6).astype(np.intp)
        block = np.concatenate([[0], np.cumsum(np.diff(number) > 0)]).astype(np.intp)
        count = np.bincount(block).astype(np.float64)
        return cls(block=block, count=count, time_s=block_means(time_s - time_s[0], block, count.size) + time_s[0])

    def mean(self, x: FloatArray) -> FloatArray:
        """Return (n_blocks,) means of the finite samples of x (n_samples,); NaN where more than half are missing."""
        finite = x[np.isfinite(x)]
        middle = float(finite.mean()) if finite.size else 0.0  # about it a trapped pressure keeps its last digits
        return block_means(x - middle, self.block, self.count.size, least=0.5 * self.count) + middle


def quanta_of(log: FlightLog, names: Collection[str]) -> Mapping[str, float]:
    """Return the steps in which channels were recorded, in their units, where the log shows them."""
    steps = {name: log.channels[name].step for name in names}
    steps |= {name: log.channels[name].plateau_step(log.rate_hz) for name, step in steps.items() if step is None}
    return {name: step for name, step in steps.items() if step is not None}


def unit_of(log: FlightLog, name: str) -> str:
    """Return the unit of a channel, the standard one where the log states none."""
    return log.channels[name].unit or (STANDARD[name].unit if name in STANDARD else "")
