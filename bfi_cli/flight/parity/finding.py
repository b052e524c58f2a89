"""What an analysis of the air data of one window says: the faults it found, and what it could not have missed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...kernels import CHI_SQUARE_95, FloatArray, IntArray
from ...kernels.runs import runs

Bound = Literal["error", "disagreement"]
Stage = Literal["sensors", "static relations", "holds", "parity", "scan", "flight model"]

# Twice the loss in log-likelihood up to which another fault explains as well: 2 ln 10, odds of ten to one.
AS_GOOD = 4.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """A fault that explains a window.

    Attributes
    ----------
    fault : a fault of a pressure line by its shape ("pitot_icing"), or the standard name of the one channel that errs.
    among : every fault that explains the window about as well, `fault` first; more than one is no isolation.
    channels : the recorded channels that err under `fault`.
    shape, magnitude, unit, sd : of the course of its error; None where it has no size, or none is told.
    constant_s, frequency_hz : time constant or duration, and frequency of the course, where it has one.
    effect : by channel the largest error in the window, in the channel's unit.
    onset_s, onset_ci95, offset_s : on the log's axis; offset_s is None where it lasts.
    statistic, threshold, p_value : that it was declared by; p_value is None where no distribution is known.
    evidence : by residual, what it says for the fault: a log-likelihood ratio, or the residual's own statistic.
    """

    fault: str
    among: tuple[str, ...]
    channels: tuple[str, ...]
    shape: str
    constant_s: float | None = None
    frequency_hz: float | None = None
    magnitude: float | None = None
    sd: float | None = None
    unit: str = ""
    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None = None
    statistic: float
    threshold: float
    p_value: float | None = None
    effect: Mapping[str, float] = field(default_factory=dict)
    evidence: Mapping[str, float] = field(default_factory=dict)

    @property
    def until_s(self) -> float:
        """When it ends, infinite where it lasts."""
        return np.inf if self.offset_s is None else self.offset_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(Explanation):
    """What one analysis finds in a window.

    Attributes
    ----------
    stage : the analysis.
    rivals : of other channels in `among`, the error that shows as an error of 1 of `fault` does.
    doubt : why it is only suspected, "" where nothing speaks against it.
    """

    stage: Stage
    rivals: Mapping[str, float] = field(default_factory=dict)
    doubt: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hidden:
    """What one window leaves unseen of a fault of a shape.

    Attributes
    ----------
    unit : of its sizes; channel : whose error counts.
    bounds : the error of the channel, or only how far it disagrees with others that share one of its sensors.
    onsets_s : (n,) on the log's axis, that the window shows.
    sizes : (n,) the largest that may begin there unseen, infinite where any may.
    declared : (n,) those that would be declared with 90 % power.
    spreads : (n,) what of the sizes its noise makes, whatever it shows: of several windows that with the least counts,
        since the least of what they show would exclude too much.
    scale : error on the channel by a fault of size 1, after a second where it grows.
    tolerance : of the channel in this window, None where it has none.
    """

    fault: str
    shape: str
    channel: str
    unit: str
    bounds: Bound
    window: tuple[float, float]
    onsets_s: FloatArray
    sizes: FloatArray
    declared: FloatArray
    spreads: FloatArray
    scale: float = 1.0
    tolerance: float | None = None

    @property
    def watched(self) -> list[tuple[float, float]]:
        """The onsets that it covers; a fault that grew before the first of them shows as one from there on."""
        return [
            (float(self.onsets_s[first]) if first else self.window[0], float(self.onsets_s[end - 1]))
            for first, end in runs(np.isfinite(self.sizes))
        ]


def squares_by_onset(y: FloatArray, courses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n_onsets,) what is left of squares by a constant and each course, and the size of the course.

    Parameters
    ----------
    y : (n,); courses : (n, n_onsets), none of them constant.
    """
    y, courses = y - y.mean(), courses - courses.mean(axis=0)
    sizes = courses.T @ y / np.einsum("ij,ij->j", courses, courses)
    rest = y[:, None] - sizes * courses
    return np.einsum("ij,ij->j", rest, rest), sizes


def as_good(squares: FloatArray, n: int, alike: float) -> IntArray:
    """Return which onsets explain n samples about as well as the best, of whose errors so many in a row are alike."""
    return np.flatnonzero(squares <= squares.min() * (1.0 + alike * CHI_SQUARE_95 / n))
