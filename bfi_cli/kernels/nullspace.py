"""Null-space detector: the right null space of the past data matrix, applied to each output (paper H, eq. 17 to 30).

A linear system whose outputs hold all states obeys y(i) = Omega z(i) with z(i) = [y(i-1); u(i-1); u(i)]. A window of h
columns gives Y = Omega Z, hence Y N = 0 for the right null space N of Z, whatever Omega is: no model is identified. A
failure of sensor k breaks this in row k alone, at the sample where it begins.

The criterion of row k is the distance of Y(k) from the row space of Z, so a triangular factor of [Z' Y'] holds all of
it. `SlidingWindow` keeps factors of the last h samples as a queue made of two stacks: every factor is made by adding
rows, none by taking rows away, which would lose all digits where Z has no full rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from . import FloatArray, IntArray
from .lagged import add_rows

# The data are taken to be accurate to this fraction of a channel's largest motion: double precision and a few digits.
TOLERANCE = 1e-12
# Rows that enter a factor together; it changes the speed only.
BLOCK = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Criteria:
    """The criteria over a record.

    Attributes
    ----------
    channel : (n_samples, n_outputs) eq. 29 relative to the channel's largest magnitude so far times sqrt(h); NaN where
        the window has no null space yet.
    rank : (n_samples,) of Z within the tolerance.
    ready : samples needed before the first window with a null space, None where there is none.
    """

    channel: FloatArray
    rank: IntArray
    ready: int | None


def data_matrices(y: FloatArray, u: FloatArray, *, at: int, width: int) -> tuple[FloatArray, FloatArray]:
    """Return Y, (n_outputs, h), and Z, (n_outputs + 2 n_inputs, h), of eq. 17 and 18.

    Parameters
    ----------
    y : (n_samples, n_outputs), u : (n_samples, n_inputs).
    at : the window's last sample i.
    width : columns h; fewer near the start of the record, whose first sample has no past.

    Raises
    ------
    ValueError : shapes disagree, `at` is the first sample or outside the record, or the window is empty.
    """
    y, u = _checked(y, u, width)
    if not 1 <= at < len(y):
        raise ValueError(f"the window must end at a sample of 1..{len(y) - 1}, got {at}")
    i = np.arange(max(1, at - width + 1), at + 1)
    return y[i].T, np.hstack([y[i - 1], u[i - 1], u[i]]).T


def right_null_space(Z: FloatArray, *, tolerance: float = TOLERANCE) -> FloatArray:
    """Return an orthonormal N, (h, h - rank), with Z N = 0 up to the tolerance.

    Rows are scaled to equal length first. A singular value below `tolerance` times the largest is round-off: the
    data are taken to be accurate to that fraction of the largest motion.
    """
    norms = np.linalg.norm(Z, axis=1)
    scaled = Z[norms > 0.0] / norms[norms > 0.0, None]
    if not len(scaled):
        return np.eye(Z.shape[1])
    _, values, V = np.linalg.svd(scaled, full_matrices=True)
    return np.asarray(V[np.count_nonzero(values > tolerance * values[0]) :].T)


def window_criteria(Y: FloatArray, Z: FloatArray, *, tolerance: float = TOLERANCE) -> FloatArray:
    """Return (n_outputs,) |Y(k) N| of one window, eq. 29 as printed, in the units of Y."""
    return np.asarray(np.linalg.norm(Y @ right_null_space(Z, tolerance=tolerance), axis=1))


def criteria(y: FloatArray, u: FloatArray, *, width: int = 10, tolerance: float = TOLERANCE) -> Criteria:
    """Return the criteria of every window of a record, each from the one before by an update.

    Parameters
    ----------
    y : (n_samples, n_outputs), u : (n_samples, n_inputs), SI, not centred (a gain failure acts on the absolute value).
    width : columns h of a window.
    tolerance : see `right_null_space`; rows are scaled by the channel's largest magnitude so far.

    Raises
    ------
    ValueError : shapes disagree, the record has a single sample or a value is not finite.
    """
    y, u = _checked(y, u, width)
    # Columns that stay zero or are a multiple of another one are left out, but for one column at least: surfaces that
    # move together are logged one by one, and their columns change no distance but cost as much as others.
    Z = np.hstack([y[:-1], u[:-1], u[1:]])
    size = np.abs(Z).max(axis=0)
    moving = np.flatnonzero(size > 0.0)
    if moving.size:
        scaled = Z[:, moving] / size[moving]
        signs = np.sign(scaled[np.abs(scaled).argmax(axis=0), np.arange(len(moving))])
        moving = np.sort(moving[np.unique(scaled * signs, axis=1, return_index=True)[1]])
    rows = np.hstack([Z[:, moving if moving.size else [0]], y[1:]])

    peaks = np.maximum.accumulate(np.abs(rows), axis=0)
    scales = np.where(peaks > 0.0, peaks, 1.0)
    n_z = rows.shape[1] - y.shape[1]
    channel = np.full(y.shape, np.nan)
    rank = np.zeros(len(y), dtype=np.intp)
    window = SlidingWindow(rows.shape[1], width)
    for i, row in enumerate(rows):
        window.append(row)
        # The distance of each output's column from the span of Z. Column pivoting stands in for the singular value
        # decomposition: its diagonal falls with the singular values.
        condensed = window.condensed() / scales[i]
        packed, _, tau, _, _ = lapack.dgeqp3(condensed[:, :n_z])
        diagonal = np.abs(packed.diagonal())
        rank[i + 1] = np.count_nonzero(diagonal > tolerance * diagonal[0])
        if rank[i + 1] < min(i + 1, width):
            turned = lapack.dormqr("L", "T", packed, tau, condensed[:, n_z:], 64 * condensed.shape[1])[0]
            channel[i + 1] = np.linalg.norm(turned[rank[i + 1] :], axis=0) / np.sqrt(width)
    usable = np.flatnonzero(np.isfinite(channel[:, 0]))
    return Criteria(channel=channel, rank=rank, ready=int(usable[0]) + 1 if usable.size else None)


def onset_shares(y: FloatArray, u: FloatArray, *, width: int = 10, tolerance: float = TOLERANCE) -> FloatArray:
    """Return how much of a failure that begins with the last sample of a window is outside the row space of Z.

    At its first sample a failure d of sensor k changes the last column of Y alone, in row k, and Z not at all: eq. 29
    becomes |d| times the length of the last row of the null space. That is 0 where the sample moves in a direction in
    which the rest of the window does not.

    Parameters
    ----------
    y, u, width, tolerance : as of `criteria`.

    Returns
    -------
    (n_samples,) between 0 and 1; NaN where the window has no null space yet.
    """
    y, u = _checked(y, u, width)
    Z = np.hstack([y[:-1], u[:-1], u[1:]])
    peaks = np.maximum.accumulate(np.abs(Z), axis=0)
    scales = np.where(peaks > 0.0, peaks, 1.0)
    shares = np.full(len(y), np.nan)
    for i in range(len(Z)):
        window = Z[max(0, i - width + 1) : i + 1] / scales[i]
        packed, _, tau, _, _ = lapack.dgeqp3(window)
        diagonal = np.abs(packed.diagonal())
        rank = int(np.count_nonzero(diagonal > tolerance * diagonal[0]))
        if rank < len(window):
            last = np.zeros((len(window), 1))
            last[-1] = 1.0
            turned = lapack.dormqr("L", "T", packed[:, : len(tau)], tau, last, 64)[0]
            shares[i + 1] = np.linalg.norm(turned[rank:])
    return shares


class SlidingWindow:
    """The last `width` rows appended, condensed to about twice as many rows as there are columns.

    Rows enter a running triangular factor, a block at a time. When the window has moved on by its width, the rows in
    it are factorised once from the newest block back to the oldest and each partial factor is kept: to drop the oldest
    block is then to take the partial factor without it. Rows that fill no block are kept as they are.
    """

    def __init__(self, n_columns: int, width: int) -> None:
        """Start with rows of zeros, which add nothing; `width` is the number of rows kept."""
        self._width = width
        self._rows = np.zeros((2 * width, n_columns))
        self._end = width
        self._new = self._empty = np.zeros((n_columns, n_columns), order="F")
        self._old = [self._new] * (-(-width // BLOCK) + 1)

    def append(self, row: FloatArray) -> None:
        """Add a row, (n_columns,), and drop the oldest."""
        if self._end == 2 * self._width:
            # Turn over: the newer half becomes the older, factorised from its newest block backwards.
            self._rows[: self._width] = self._rows[self._width :]
            self._end, self._new, factor = self._width, self._empty, self._empty
            for block in reversed(range(len(self._old) - 1)):
                factor = add_rows(factor, self._rows[block * BLOCK : min((block + 1) * BLOCK, self._width)])
                self._old[block] = factor
        self._rows[self._end] = row
        self._end += 1
        if (self._end - self._width) % BLOCK == 0:
            self._new = add_rows(self._new, self._rows[self._end - BLOCK : self._end])

    def condensed(self) -> FloatArray:
        """Return rows, at least as many as columns, that have the inner products of the window's columns."""
        first, n_columns = self._end - self._width, self._rows.shape[1]
        if self._width <= 2 * (n_columns + BLOCK):
            short = np.zeros((max(self._width, n_columns), n_columns), order="F")
            short[: self._width] = self._rows[first : self._end]
            return short
        block = -(-first // BLOCK)
        whole = min(block * BLOCK, self._width)
        last = self._end - (self._end - self._width) % BLOCK
        parts = (self._old[block], self._new, self._rows[first:whole], self._rows[last : self._end])
        stack = np.empty((2 * n_columns + whole - first + self._end - last, n_columns), order="F")
        return np.concatenate(parts, out=stack)


def _checked(y: FloatArray, u: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
    y, u = np.asarray(y, dtype=np.float64), np.asarray(u, dtype=np.float64)
    if y.ndim != 2 or u.ndim != 2 or len(y) != len(u) or len(y) < 2:
        raise ValueError(f"y and u must be (n_samples, n_channels) of two samples or more, got {y.shape}, {u.shape}")
    if not (np.isfinite(y).all() and np.isfinite(u).all()):
        raise ValueError("y and u must be finite; cut NaN and infinite values out first")
    if width < 2:
        raise ValueError(f"a window has two columns or more, got {width}")
    return y, u
