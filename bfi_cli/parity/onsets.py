"""Where a course begins: least squares over every onset, and the onsets that explain a record about as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .finding import CHI_SQUARE

FloatArray = NDArray[np.float64]


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


def as_good(squares: FloatArray, n: int, alike: float) -> NDArray[np.intp]:
    """Return which onsets explain n samples about as well as the best, of whose errors so many in a row are alike."""
    return np.flatnonzero(squares <= squares.min() * (1.0 + alike * CHI_SQUARE / n))
