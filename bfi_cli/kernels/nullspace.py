"""Null-space detector: the right null space of the past data matrix, applied to each output (paper H, eq. 17 to 30).

A linear system whose outputs hold all states obeys y(i) = Omega z(i) with z(i) = [y(i-1); u(i-1); u(i)]. A window of h
columns gives Y = Omega Z, hence Y N = 0 for the right null space N of Z, whatever Omega is: no model is identified. A
failure of sensor k breaks this in row k alone, at the sample where it begins.

The criterion of row k is the distance of Y(k) from the row space of Z, which a QR of Z' with pivoted columns gives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray, IntArray
from .compiled import lapack

# The data are taken to be accurate to this fraction of a channel's largest motion: double precision and a few digits.
TOLERANCE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Criteria:
    """The criteria over a record.

    Attributes
    ----------
    channel : (n_samples, n_outputs) eq. 29 relative to the channel's largest magnitude so far times sqrt(h); NaN where
        the window has no null space yet.
    share : (n_samples,) how much of a failure that begins with the last sample of the window is outside the row space
        of Z, between 0 and 1; NaN likewise. At its first sample a failure d of sensor k changes the last column of Y
        alone, in row k, and Z not at all: eq. 29 becomes |d| times the length of the last row of the null space. That
        is 0 where the sample moves in a direction in which the rest of the window does not.
    rank : (n_samples,) of Z within the tolerance.
    ready : samples needed before the first window with a null space, None where there is none.
    """

    channel: FloatArray
    share: FloatArray
    rank: IntArray
    ready: int | None


def criteria(y: FloatArray, u: FloatArray, *, width: int = 10) -> Criteria:
    """Return the criteria of every window of a record.

    Parameters
    ----------
    y : (n_samples, n_outputs), u : (n_samples, n_inputs), SI, not centred (a gain failure acts on the absolute value).
        Rows are scaled by the channel's largest magnitude so far.
    width : columns h of a window; fewer near the start of the record, whose first sample has no past.

    Raises
    ------
    ValueError : shapes disagree, the record has a single sample or a value is not finite.
    """
    if width < 2:
        raise ValueError(f"a window has two columns or more, got {width}")
    Z, scales = _past(y, u)
    now = np.asarray(y, dtype=np.float64)[1:]
    sizes = _peaks(now)
    channel, share, rank = np.full(y.shape, np.nan), np.full(len(y), np.nan), np.zeros(len(y), dtype=np.intp)
    for i in range(len(Z)):
        rows = slice(max(0, i - width + 1), i + 1)
        packed, tau, rank[i + 1] = _factor(Z[rows] / scales[i])
        n = len(packed)
        if rank[i + 1] < n:
            # The distance of each output's column, and of the last sample, from the span of Z'.
            others = np.asfortranarray(np.hstack([now[rows] / sizes[i], np.eye(n)[:, -1:]]))
            turned = lapack.dormqr("L", "T", packed[:, : len(tau)], tau, others, 64 * others.shape[1])[0]
            *left, share[i + 1] = np.linalg.norm(turned[rank[i + 1] :], axis=0)
            channel[i + 1] = np.array(left) / np.sqrt(width)
    usable = np.flatnonzero(np.isfinite(share))
    return Criteria(channel=channel, share=share, rank=rank, ready=int(usable[0]) + 1 if usable.size else None)


def past_rank(y: FloatArray, u: FloatArray) -> int:
    """Return the rank of Z of a window that is the whole record, see `criteria`."""
    Z, scales = _past(y, u)
    return _factor(Z / scales[-1])[2]


def _past(y: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Z', (n_samples - 1, n_columns), and the largest magnitude of each column so far."""
    y, u = np.asarray(y, dtype=np.float64), np.asarray(u, dtype=np.float64)
    if y.ndim != 2 or u.ndim != 2 or len(y) != len(u) or len(y) < 2:
        raise ValueError(f"y and u must be (n_samples, n_channels) of two samples or more, got {y.shape}, {u.shape}")
    if not (np.isfinite(y).all() and np.isfinite(u).all()):
        raise ValueError("y and u must be finite; cut NaN and infinite values out first")
    # Columns that stay zero or are a multiple of another one are left out, but for one column at least: surfaces that
    # move together are logged one by one, and their columns change no distance but cost as much as others.
    Z = np.hstack([y[:-1], u[:-1], u[1:]])
    size = np.abs(Z).max(axis=0)
    moving = np.flatnonzero(size > 0.0)
    if moving.size:
        scaled = Z[:, moving] / size[moving]
        signs = np.sign(scaled[np.abs(scaled).argmax(axis=0), np.arange(len(moving))])
        moving = np.sort(moving[np.unique(scaled * signs, axis=1, return_index=True)[1]])
    Z = Z[:, moving if moving.size else [0]]
    return Z, _peaks(Z)


def _peaks(x: FloatArray) -> FloatArray:
    """Return the largest magnitude so far of each column, 1 where there is none."""
    peaks = np.maximum.accumulate(np.abs(x), axis=0)
    return np.where(peaks > 0.0, peaks, 1.0)


def _factor(Z: FloatArray) -> tuple[FloatArray, FloatArray, int]:
    """Return reflectors, their factors and the rank of scaled Z'.

    Column pivoting stands in for the singular value decomposition: its diagonal falls with the singular values.
    """
    packed, _, tau, _, _ = lapack.dgeqp3(Z)
    diagonal = np.abs(packed.diagonal())
    return packed, tau, int(np.count_nonzero(diagonal > TOLERANCE * diagonal[0]))
