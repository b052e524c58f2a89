"""What an analysis of the air data of one window says: the faults it found, and what it could not have missed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...kernels import FloatArray, IntArray

Bound = Literal["error", "disagreement"]
Stage = Literal["sensors", "static relations", "holds", "parity", "scan", "flight model"]


CHI_SQUARE = 3.84  # with one degree of freedom, 95 %: twice what a log-likelihood may lose of an interval's middle


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What a window excludes of a fault and shape: magnitudes above `excluded_above`, in `unit`.

    Attributes
    ----------
    excluded_above : at the worst onset; of a drift of those in the first half of the window.
    effect : largest error in the window that such a fault makes on `channel`, in the channel's unit.
    onsets_s : on the log's axis; sizes : at each the largest that may hide, infinite where any may.
    bounds : the error of the channel, or only how far it disagrees with others that share one of its sensors.
    """

    fault: str
    shape: str
    channel: str
    excluded_above: float
    unit: str
    effect: float
    onsets_s: tuple[float, ...]
    sizes: tuple[float, ...]
    bounds: Bound


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
    return np.flatnonzero(squares <= squares.min() * (1.0 + alike * CHI_SQUARE / n))
