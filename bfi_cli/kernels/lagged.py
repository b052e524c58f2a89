"""Lagged regression, compressed: one triangular factor stands for a record of any length.

The columns are ``[1 | u lags | theta lags 1..s | y lags 1..s | theta(k) | y(k)]``, rows k = s .. n_samples - 1. Their
triangular factor R carries every inner product between columns, so any least squares over any subset of them, for any
order up to s, any support and any magnitudes, is a least squares over R. Householder QR does not care how columns are
scaled, so R is in the caller's units. The constant and the inputs come first: the trailing block of R is the rest with
these projected out. Faults enter outputs after theta, so adding a fault leaves R triangular. Where there are fewer rows
than columns nothing is gained by triangularity beyond the constant and the inputs, and R stays full below those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from . import FloatArray
from .progress import Report, parts, silent

# Columns that LAPACK's blocked QR treats together; it changes the speed only.
PANEL = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Where each block of the stacked lagged matrix lies; within a block columns are lag-major.

    Attributes
    ----------
    order : the largest lag s.
    n_inputs, n_outputs, n_atoms : widths of u, y and the dictionary.
    signals : (output, atom) of each theta column of one lag; a pair whose signal is zero everywhere has no column.
    feedthrough : the input lags start at 0 instead of 1.
    """

    order: int
    n_inputs: int
    n_outputs: int
    n_atoms: int
    signals: tuple[tuple[int, int], ...]
    feedthrough: bool

    @property
    def input_lags(self) -> range:
        """The lags of u, from 0 with feedthrough, else from 1."""
        return range(0 if self.feedthrough else 1, self.order + 1)

    @property
    def n_base(self) -> int:
        """Number of columns of the constant and the inputs, which come first."""
        return 1 + len(self.input_lags) * self.n_inputs

    @property
    def ones(self) -> slice:
        """The constant's column."""
        return slice(0, 1)

    @property
    def theta_lags(self) -> slice:
        """The dictionary signals at lags 1..s."""
        return slice(self.n_base, self.n_base + self.order * len(self.signals))

    @property
    def y_lags(self) -> slice:
        """The outputs at lags 1..s."""
        return slice(self.theta_lags.stop, self.theta_lags.stop + self.order * self.n_outputs)

    @property
    def theta(self) -> slice:
        """The dictionary signals at lag 0."""
        return slice(self.y_lags.stop, self.y_lags.stop + len(self.signals))

    @property
    def y(self) -> slice:
        """The outputs at lag 0: the last columns."""
        return slice(self.theta.stop, self.theta.stop + self.n_outputs)

    @property
    def size(self) -> int:
        """Number of columns."""
        return int(self.y.stop)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compressed:
    """The triangular factor of the stacked lagged matrix.

    Attributes
    ----------
    R : (n_cols, n_cols) upper triangular; where there are no more rows than columns (n_rows, n_cols), triangular in the
        columns of the constant and the inputs only. Read-only.
    columns : where the blocks lie.
    n_rows : rows of the matrix that R stands for.
    scales : (n_cols,) norm of each column, 1 for a column that is zero beside the largest.
    """

    R: FloatArray
    columns: Columns
    n_rows: int
    scales: FloatArray


def lagged(x: FloatArray, lags: Sequence[int], *, first: int | None = None) -> FloatArray:
    """Return the lagged copies of `x` side by side: all channels at lags[0], then at lags[1], ...

    Parameters
    ----------
    x : (n_samples, n_channels).
    lags : non-negative.
    first : sample of the first row, at least the largest lag (the default); several orders share rows through it.

    Returns
    -------
    (n_samples - first, len(lags) * n_channels), column-major.
    """
    longest = max(lags, default=0)
    first = longest if first is None else first
    if min(lags, default=0) < 0 or first < longest:
        raise ValueError(f"lags must lie in 0..first = {first}, got {min(lags)}..{longest}")
    x = np.asarray(x, dtype=np.float64)
    rows = np.empty((len(lags) * x.shape[1], max(x.shape[0] - first, 0)))
    _fill(rows, x, lags)
    return rows.T


def add_rows(R: FloatArray, rows: FloatArray, *, overwrite: bool = False) -> FloatArray:
    """Return the triangular factor of the rows that `R`, (n, n), stands for and of `rows`, (m, n), below them."""
    return np.asarray(lapack.dtpqrt(0, min(PANEL, len(R)), R, rows, overwrite_a=overwrite, overwrite_b=overwrite)[0])


def triangular_first(rows: FloatArray, n_first: int) -> FloatArray:
    """Return `rows`, overwritten where column-major, so rotated that their first columns are triangular."""
    rows = np.asfortranarray(rows)
    factored, tau = lapack.dgeqrf(rows[:, :n_first])[:2]
    rest, reflectors = rows[:, n_first:], factored[:, : len(rows)]
    rows[:, n_first:] = lapack.dormqr("L", "T", reflectors, tau, rest, PANEL * rest.shape[1], overwrite_c=True)[0]
    rows[:, :n_first] = np.triu(factored)
    return rows


def compress(
    u: FloatArray,
    y: FloatArray,
    theta: FloatArray,
    *,
    order: int,
    feedthrough: bool = False,
    weights: FloatArray | None = None,
    block_rows: int = 1024,
    report: Report = silent,
) -> Compressed:
    """Return the triangular factor of the stacked lagged matrix, accumulated block by block.

    Working memory is one block and the factor, whatever the record's length. Centring and scaling are the caller's.

    Parameters
    ----------
    u : (n_samples, n_inputs), y : (n_samples, n_outputs), theta : (n_samples, n_outputs, n_atoms).
    order : largest lag s, at least 1.
    feedthrough : inputs act in the same sample too.
    weights : (n_samples,) of the rows, by which the whole row of a sample is multiplied; None for 1.
    block_rows : lagged rows formed at a time.
    report : called with the fraction that is done.

    Raises
    ------
    ValueError : shapes disagree, no row remains, or a value is not finite.
    """
    u, y, theta = (np.asarray(x, dtype=np.float64) for x in (u, y, theta))
    if u.ndim != 2 or y.ndim != 2 or theta.ndim != 3:
        raise ValueError(f"u, y, theta must have 2, 2, 3 dimensions, got {u.ndim}, {y.ndim}, {theta.ndim}")
    if len(u) != len(y) or theta.shape[:2] != y.shape:
        raise ValueError(f"shapes disagree: u {u.shape}, y {y.shape}, theta {theta.shape}")
    if not 1 <= order < len(y):
        raise ValueError(f"order must lie in 1..{len(y) - 1} for {len(y)} samples, got {order}")
    signals = tuple((int(i), int(j)) for i, j in np.argwhere(np.any(theta, axis=0)))
    columns = Columns(
        order=order,
        n_inputs=u.shape[1],
        n_outputs=y.shape[1],
        n_atoms=theta.shape[2],
        signals=signals,
        feedthrough=feedthrough,
    )
    picked = np.array([i * columns.n_atoms + j for i, j in signals], dtype=np.intp)
    past = range(1, order + 1)
    n_rows = len(y) - order
    wide = n_rows <= columns.size
    R = np.zeros((0 if wide else columns.size, columns.size), order="F")
    block = np.empty((columns.size, n_rows if wide else min(block_rows, n_rows)))
    for start, _ in parts(report, range(order, len(y), block.shape[1])):
        rows = slice(start - order, start + block.shape[1])
        atoms = theta[rows].reshape(len(y[rows]), -1)[:, picked]
        part = block[:, : len(atoms) - order]
        block[:, part.shape[1] :] = 0.0
        part[columns.ones] = 1.0
        _fill(part[1 : columns.n_base], u[rows], columns.input_lags)
        _fill(part[columns.theta_lags], atoms, past)
        _fill(part[columns.y_lags], y[rows], past)
        _fill(part[columns.theta], atoms, range(1))
        _fill(part[columns.y], y[rows], range(1))
        if weights is not None:
            part *= weights[start : start + part.shape[1]]
        R = triangular_first(block.T, columns.n_base) if wide else add_rows(R, block.T, overwrite=True)
    return _compressed(R, columns, n_rows)


def restrict(data: Compressed, *, order: int | None = None, atoms: Sequence[int] | None = None) -> Compressed:
    """Return the factor of a lower order, or of some of the atoms, over the same rows.

    Parameters
    ----------
    data : from `compress`.
    order : at most the order of `data`; None keeps it.
    atoms : indices of the atoms to keep, in the order of the result; None keeps all.
    """
    whole = data.columns
    order = whole.order if order is None else order
    if not 1 <= order <= whole.order:
        raise ValueError(f"order must lie in 1..{whole.order}, got {order}")
    atoms = range(whole.n_atoms) if atoms is None else atoms
    place = {atom: n for n, atom in enumerate(atoms)}
    pairs = sorted((output, place[j], n) for n, (output, j) in enumerate(whole.signals) if j in place)
    kept = [n for _, _, n in pairs]
    signals = tuple((output, atom) for output, atom, _ in pairs)
    columns = replace(whole, order=order, n_atoms=len(atoms), signals=signals)
    index = np.arange(whole.size)
    parts = (
        index[: columns.n_base],
        index[whole.theta_lags].reshape(whole.order, -1)[:order, kept].ravel(),
        index[whole.y_lags][: order * whole.n_outputs],
        index[whole.theta][kept],
        index[whole.y],
    )
    picked = np.concatenate(parts)
    R = data.R.T[picked].T
    if len(R) > columns.size:
        R = np.asarray(np.linalg.qr(R, mode="r"))
    else:
        upper = min(whole.n_base, len(R))  # rows below are zero in the columns of the constant and the inputs
        R[:upper] = triangular_first(R[:upper], columns.n_base)
    return _frozen(R, columns, data.n_rows, data.scales[picked])


def with_fault(data: Compressed, magnitudes: FloatArray) -> Compressed:
    """Return the factor of the same record with the fault ``theta @ magnitudes`` added to its outputs.

    No factorisation is needed: an output's columns are after those of the signals that are added to it.
    """
    columns, R = data.columns, data.R.copy(order="F")
    add = np.zeros((len(columns.signals), columns.n_outputs))
    for n, (output, atom) in enumerate(columns.signals):
        add[n, output] = magnitudes[atom]
    lags = data.R[:, columns.theta_lags].reshape(len(R), columns.order, -1)
    R[:, columns.y_lags] += (lags @ add).reshape(len(R), -1)
    R[:, columns.y] += data.R[:, columns.theta] @ add
    return _compressed(R, columns, data.n_rows)


def with_scaled_outputs(data: Compressed, scale: FloatArray, shift: FloatArray) -> Compressed:
    """Return the factor of the same record with ``scale * y + shift``, each (n_outputs,), in place of its outputs y.

    A shift needs the column of ones; without it the shift must be zero.
    """
    columns, R = data.columns, data.R.copy(order="F")
    ones = R[:, columns.ones].sum(axis=1)
    for place, copies in ((columns.y_lags, columns.order), (columns.y, 1)):
        R[:, place] = R[:, place] * np.tile(scale, copies) + np.outer(ones, np.tile(shift, copies))
    return _compressed(R, columns, data.n_rows)


def _fill(rows: FloatArray, x: FloatArray, lags: Sequence[int]) -> None:
    """Write the lagged copies of (n_samples, n_channels) `x` into `rows`, one row per lag and channel."""
    channels, n, width = np.ascontiguousarray(x.T), rows.shape[1], x.shape[1]
    for j, lag in enumerate(lags):
        start = len(x) - n - lag
        rows[j * width : (j + 1) * width] = channels[:, start : start + n]


def _compressed(R: FloatArray, columns: Columns, n_rows: int) -> Compressed:
    if not np.isfinite(R).all():
        raise ValueError("u, y and theta must be finite, got NaN or infinite values; repair or cut them first")
    norms = np.linalg.norm(R, axis=0)
    scales = np.where(norms > np.finfo(float).eps * norms.max(), norms, 1.0)
    return _frozen(R, columns, n_rows, scales)


def _frozen(R: FloatArray, columns: Columns, n_rows: int, scales: FloatArray) -> Compressed:
    for array in (R, scales):
        array.setflags(write=False)
    return Compressed(R=R, columns=columns, n_rows=n_rows, scales=scales)
