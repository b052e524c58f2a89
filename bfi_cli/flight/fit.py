"""The levels of a flight: by its own likelihood, with log-normal priors about those of other aircraft."""

from __future__ import annotations

import numpy as np

from ..kernels import BoolArray, FloatArray
from ..kernels.bounded_filter import Stack, filter_stack, variance_scores
from ..kernels.runs import runs
from .model import FlightModel
from .tables import LEVELS

# Standard deviation of the logarithm of a level over aircraft.
PRIOR_SD = 0.7
# Stretches of the flight that tell the levels, each of so many seconds or the longest there is; the whole would say the
# same at ten times the cost.
STRETCHES, STRETCH_S = 6, 200
SETTLING_S = 20  # at the start of a stretch, in which the states are found
STEPS = 8
LARGEST_STEP = 0.5  # of the logarithm of a variance
# Share of the step of Fisher scoring: scores of neighbouring seconds are not independent, as it takes them to be.
DAMPING = 0.6


def fitted_levels(model: FlightModel, without: BoolArray | None = None) -> dict[str, float]:
    """Return the levels of a flight by scoring steps of the posterior, all at once.

    Parameters
    ----------
    without : (n,) seconds that are not to be used.
    """
    levels = dict(model.levels)
    usable = model.frame.airborne if without is None else model.frame.airborne & ~without
    length = min(STRETCH_S, max((end - start for start, end in runs(usable)), default=0))
    if length <= 2 * SETTLING_S:
        return levels
    starts = _starts(usable, length)
    rows = np.array(starts)[:, None] + np.arange(length)  # (n_stretches, n_seconds)
    y, Z = np.swapaxes(model.y[rows], 0, 1), np.swapaxes(model.Z[rows], 0, 1)
    y = np.where(usable[rows].T[..., None], y, np.nan)
    transition, covariance = model.transition(), model.start_covariance()
    mean = np.array([_start(model, first) for first in starts])
    precision = 1.0 / (2.0 * PRIOR_SD) ** 2  # of the logarithm of a variance
    used = np.arange(length) >= SETTLING_S
    for _ in range(STEPS):
        R, Q = (np.swapaxes(variances[rows], 0, 1) for variances in model.noise(levels))
        stack = Stack(y=y, Z=Z, R=R, Q=Q)
        run = filter_stack(stack, transition, mean=mean, covariance=covariance, with_gains=True)
        scores = variance_scores(stack, transition, run)
        change = dict.fromkeys(levels, 0.0)
        information = dict.fromkeys(levels, 0.0)
        for share in model.frame.shares:
            weight = levels[share.level] ** 2 * np.swapaxes(share.weight[rows], 0, 1)
            score, expected = (scores.R, scores.R_information) if share.is_row else (scores.Q, scores.Q_information)
            change[share.level] += float(np.sum((weight * score[..., share.index])[used]))
            information[share.level] += float(np.sum((weight**2 * expected[..., share.index])[used]))
        for name in levels:
            if LEVELS[name].fitted:
                pull = -precision * 2.0 * np.log(levels[name] / model.levels[name])
                step = DAMPING * (change[name] + pull) / (information[name] + precision)
                level = levels[name] * np.exp(0.5 * np.clip(step, -LARGEST_STEP, LARGEST_STEP))
                levels[name] = float(np.clip(level, LEVELS[name].lowest, LEVELS[name].highest))
    return levels


def _start(model: FlightModel, first: int) -> FloatArray:
    start = model.start.copy()
    start[model.state("height")] = model.coefficients.height[first]
    start[model.state("airspeed")] = model.coefficients.airspeed[first]
    return start


def _starts(usable: BoolArray, length: int) -> list[int]:
    """Return the first seconds of stretches of a length spread over what is flown and to be used."""
    possible = [first for start, end in runs(usable) for first in range(start, end - length + 1)]
    places = np.linspace(0, len(possible) - 1, STRETCHES).round().astype(int)
    chosen: list[int] = []
    for place in places:
        if not chosen or possible[place] >= chosen[-1] + length // 2:
            chosen.append(possible[place])
    return chosen
