"""The flights of paper H's experiment: a Boeing 747 from rest under thrust, sensors that fail by a gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..aircraft.catalogue import B747, ELEVATORS, ENGINES
from ..aircraft.model import LinearModel, response
from ..kernels.nullspace import Criteria, criteria

__all__ = ["FAILURES", "GAIN", "KINDS", "LEVEL", "N_SAMPLES", "RATE_HZ", "WIDTH", "Case", "Failure", "columns", "fly"]

FloatArray = NDArray[np.float64]
Failure = tuple[int, tuple[str, ...]]

RATE_HZ, N_SAMPLES, WIDTH, GAIN = 100.0, 61, 10, 0.9
DEFLECTION = np.radians(5.0)
LEVEL = 1e-4
FAILURES: tuple[Failure, ...] = (
    (10, ("aoa",)),
    (15, ("tas_rate",)),
    (20, ("pitch",)),
    (25, ("pitch_rate",)),
    (30, ("altitude_rate",)),
    (35, ("altitude",)),
    (40, ("tas_rate", "pitch_rate")),
)
KINDS = {"one sample": 1, "to the end": N_SAMPLES}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A flight with failures.

    Attributes
    ----------
    failures : (sample, channels) of each.
    healthy, measured, u : (n_samples, n_channels) true outputs, those with the failures, inputs.
    found : the criteria of the measured ones.
    """

    failures: tuple[Failure, ...]
    healthy: FloatArray
    measured: FloatArray
    u: FloatArray
    found: Criteria

    @property
    def recent(self) -> NDArray[np.bool_]:
        """(n_samples, n_outputs) where a failure of the channel began inside the window."""
        inside = np.zeros(self.healthy.shape, dtype=bool)
        for k, names in self.failures:
            inside[k : k + WIDTH + 1, columns(names)] = True
        return inside

    @property
    def expected(self) -> set[tuple[int, str]]:
        """(sample, channel) of every failure."""
        return {(k, name) for k, names in self.failures for name in names}

    @property
    def flagged(self) -> set[tuple[int, str]]:
        """(sample, channel) wherever a criterion rises above the level."""
        above = np.nan_to_num(self.found.channel) > LEVEL
        rises = above[1:] & ~above[:-1]
        return {(int(i) + 1, B747.outputs[k]) for i, k in np.argwhere(rises)}

    def levels(self, failure: Failure, *, after: int = 0) -> tuple[float, float]:
        """Return the least criterion of the channels that fail, and the largest of those without a failure.

        Both `after` samples after the failure; without a failure means none inside the window.
        """
        i = failure[0] + after
        values, recent = self.found.channel[i], self.recent[i]
        return float(values[columns(failure[1])].min()), float(values[~recent].max(initial=0.0))

    def ratio(self, failure: Failure, *, after: int = 0) -> float:
        """Return the ratio of `levels`, no criterion counted below the precision of a number near 1."""
        low, high = self.levels(failure, after=after)
        return low / max(high, float(np.finfo(np.float64).eps) / 2)


def fly(
    failures: Sequence[Failure], *, lasting: int, model: LinearModel = B747, elevators: FloatArray | None = None
) -> Case:
    """Fly the experiment, every failure a gain of 0.9 during `lasting` samples.

    Parameters
    ----------
    elevators : (n_samples,) deflection of all four, rad; the paper leaves them at rest.
    """
    u = np.zeros((N_SAMPLES, len(model.inputs)))
    u[:, [model.inputs.index(name) for name in ENGINES]] = DEFLECTION
    if elevators is not None:
        u[:, [model.inputs.index(name) for name in ELEVATORS]] = elevators[:, None]
    healthy = response(model, u, rate_hz=RATE_HZ, rule="euler")
    measured = healthy.copy()
    for k, names in failures:
        measured[k : k + lasting, columns(names)] *= GAIN
    found = criteria(measured, u, width=WIDTH)
    return Case(failures=tuple(failures), healthy=healthy, measured=measured, u=u, found=found)


def columns(names: Sequence[str]) -> list[int]:
    """Return where the outputs stand in the model."""
    return [B747.outputs.index(name) for name in names]
