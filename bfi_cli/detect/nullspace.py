"""The paper's form, for data without noise: the right null space of the last samples, applied to every output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.nullspace import Criteria, criteria
from .preparation import PreparedRecord

__all__ = ["LEVEL", "NullSpaceCriteria", "null_space_criteria"]

# Of a channel's own size. Boeing 747 without noise: healthy channels stay 3e10 times below what a failing one shows
# (docs/validation.md). The healthy time has to keep a tenth of it free.
LEVEL, MARGIN = 1e-7, 0.1
# One lag where the outputs hold all states (H 15); two or four where they do not.
LAGS = (1, 2, 4)
# Columns of a window, and how many more than the rank, so that the null space is not empty.
NARROWEST, SPARE = 10, 5
# What a failure inside the window leaves in the other channels is smaller by orders of magnitude (H, after eq. 29).
SELECTIVE = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NullSpaceCriteria:
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
    criteria: Criteria
    explained: bool
    failures: tuple[tuple[int, int], ...]


def null_space_criteria(prepared: PreparedRecord) -> NullSpaceCriteria:
    """Return the criteria with the fewest lags that explain the healthy time, and the failures by them.

    A constant counts as an input, so that values need not be deviations from a trim. For as long as a failure is inside
    the window, other channels may leave round-off too (paper H, after eq. 29), by orders of magnitude less: they are
    not declared.
    """
    record = prepared.record
    y, healthy = record.y, record.time_s < prepared.train[1]
    u = np.column_stack([record.u, np.ones(len(record.u))])
    both = np.hstack([y, u])
    for lags in LAGS:
        # Inputs bring the samples before the last one with them: z(i) then reaches `lags` samples back.
        past = (np.vstack([np.zeros((lag, both.shape[1])), both[:-lag]]) for lag in range(1, lags))
        inputs = np.hstack([u, *past])
        rank = int(criteria(y[healthy], inputs[healthy], width=int(healthy.sum())).rank.max())
        width = max(NARROWEST, rank + SPARE)
        of_record = criteria(y, inputs, width=width)
        explained = not bool((np.nan_to_num(of_record.channel[healthy]) > MARGIN * LEVEL).any())
        if explained or lags == LAGS[-1]:
            break
    channel = np.nan_to_num(of_record.channel)
    last = np.full(channel.shape[1], -width - 1)
    failures = []
    for i in np.flatnonzero((channel > LEVEL).any(axis=1)):
        above = channel[i] > max(LEVEL, SELECTIVE * float(channel[i].max()))
        failures += [(int(i), int(k)) for k in np.flatnonzero(above & (last < i - width))]
        last[above] = i
    return NullSpaceCriteria(lags=lags, width=width, criteria=of_record, explained=explained, failures=tuple(failures))
