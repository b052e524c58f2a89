"""The paper's form, for data without noise: the right null space of the last samples, applied to every output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.nullspace import Criteria, criteria
from .record import Prepared

__all__ = ["LEVEL", "Exact", "exactly"]

FloatArray = NDArray[np.float64]

LEVEL, MARGIN = 1e-7, 0.1
LAGS = (1, 2, 4)
NARROWEST, SPARE = 10, 5
SELECTIVE = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exact:
    """Criteria of a record and what fails by them.

    Attributes
    ----------
    lags : of the past data; the paper's one where the outputs hold all states.
    width : columns of a window, more than the rank of the past data.
    explained : the healthy time stays well below the level.
    failures : (sample, output) in the order of time.
    """

    lags: int
    width: int
    found: Criteria
    explained: bool
    failures: tuple[tuple[int, int], ...]


def exactly(prepared: Prepared) -> Exact:
    """Return the criteria with the fewest lags that explain the healthy time, and the failures by them.

    A constant counts as an input, so that values need not be deviations from a trim. For as long as a failure is inside
    the window, other channels may leave round-off too (paper H, after eq. 29), by orders of magnitude less: they are
    not declared.
    """
    record = prepared.record
    healthy = record.time_s < prepared.train[1]
    u = np.column_stack([record.u, np.ones(len(record.u))])
    for lags in LAGS:
        inputs = _with_past(record.y, u, lags)
        rank = int(criteria(record.y[healthy], inputs[healthy], width=int(healthy.sum())).rank.max())
        width = max(NARROWEST, rank + SPARE)
        found = criteria(record.y, inputs, width=width)
        explained = not bool((np.nan_to_num(found.channel[healthy]) > MARGIN * LEVEL).any())
        if explained or lags == LAGS[-1]:
            break
    failures = _failures(np.nan_to_num(found.channel), width)
    return Exact(lags=lags, width=width, found=found, explained=explained, failures=failures)


def _with_past(y: FloatArray, u: FloatArray, lags: int) -> FloatArray:
    """Return inputs that bring the samples before the last one with them: z(i) then reaches `lags` samples back."""
    columns = [u]
    for lag in range(1, lags):
        both = np.hstack([y, u])
        columns.append(np.vstack([np.zeros((lag, both.shape[1])), both[:-lag]]))
    return np.hstack(columns)


def _failures(channel: FloatArray, width: int) -> tuple[tuple[int, int], ...]:
    last = np.full(channel.shape[1], -width - 1)
    failures = []
    for i in np.flatnonzero((channel > LEVEL).any(axis=1)):
        above = channel[i] > max(LEVEL, SELECTIVE * float(channel[i].max()))
        failures += [(int(i), int(k)) for k in np.flatnonzero(above & (last < i - width))]
        last[above] = i
    return tuple(failures)
