"""Lagged regression, compressed: one triangular factor stands for a record of any length.

The columns are ``[1 | u lags | theta lags 1..s | y lags 1..s | theta(k) | y(k)]``, rows k = s .. n_samples - 1. Their
triangular factor R carries every inner product between columns, so any least squares over any subset of them, for any
order up to s, any support and any magnitudes, is a least squares over R. Householder QR does not care how columns are
scaled, so R is in the caller's units. The constant and the inputs come first: the trailing block of R is the rest with
these projected out. Faults enter outputs after theta, so adding a fault leaves R triangular. Where there are fewer rows
than columns nothing is gained by triangularity beyond the constant and the inputs, and R stays full below those.

The factor is accumulated block by block (tall and skinny QR: the factor so far stacked on the next rows; Demmel and
others 2012).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from . import FloatArray
from .atom_signals import acting
from .compiled import lapack
from .progress import Report, parts, silent

# Columns that LAPACK's blocked QR treats together; it changes the speed only.
PANEL = 16
# Lagged rows that are formed at a time; memory and speed only.
BLOCK_ROWS = 1024


@dataclass(frozen=True, kw_only=True)
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

    @cached_property
    def input_lags(self) -> range:
        """The lags of u, from 0 with feedthrough, else from 1."""
        return range(0 if self.feedthrough else 1, self.order + 1)

    @cached_property
    def n_base(self) -> int:
        """Number of columns of the constant and the inputs, which come first."""
        return 1 + len(self.input_lags) * self.n_inputs

    @property
    def ones(self) -> slice:
        """The constant's column."""
        return slice(0, 1)

    @cached_property
    def theta_lags(self) -> slice:
        """The dictionary signals at lags 1..s."""
        return slice(self.n_base, self.n_base + self.order * len(self.signals))

    @cached_property
    def y_lags(self) -> slice:
        """The outputs at lags 1..s."""
        return slice(self.theta_lags.stop, self.theta_lags.stop + self.order * self.n_outputs)

    @cached_property
    def theta(self) -> slice:
        """The dictionary signals at lag 0."""
        return slice(self.y_lags.stop, self.y_lags.stop + len(self.signals))

    @cached_property
    def y(self) -> slice:
        """The outputs at lag 0: the last columns."""
        return slice(self.theta.stop, self.theta.stop + self.n_outputs)

    @cached_property
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
    """

    R: FloatArray
    columns: Columns
    n_rows: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EarlierRows:
    """What other records of the system say of its model: their lagged rows, compressed, without their own constants.

    No signal acts in them. They are rows of every factor of the record that they stand beside.

    Attributes
    ----------
    u : (n, n_lags * n_inputs), past : (n, order * n_outputs), y : (n, n_outputs) columns as `Columns` has them, in the
        units of the record.
    n_rows : that they stand for, one less per record for its constant.
    """

    u: FloatArray
    past: FloatArray
    y: FloatArray
    n_rows: int

    @classmethod
    def of(cls, data: Compressed) -> EarlierRows:
        """Return the rows of a record without signals."""
        columns, rest = data.columns, data.R[1:]  # the first row alone has to do with the constant
        return cls(
            u=rest[:, 1 : columns.n_base], past=rest[:, columns.y_lags], y=rest[:, columns.y], n_rows=data.n_rows - 1
        )

    @classmethod
    def together(cls, several: Sequence[EarlierRows]) -> EarlierRows:
        """Return the rows of several records as those of one."""
        n_rows = sum(earlier.n_rows for earlier in several)
        rows = np.concatenate([np.hstack([earlier.u, earlier.past, earlier.y]) for earlier in several])
        rows = np.asarray(np.linalg.qr(rows, mode="r")) if len(rows) > rows.shape[1] else rows
        n_u, n_y = several[0].u.shape[1], several[0].y.shape[1]
        return cls(u=rows[:, :n_u], past=rows[:, n_u:-n_y], y=rows[:, -n_y:], n_rows=n_rows)

    def scaled(self, scale: FloatArray) -> EarlierRows:
        """Return the rows with outputs times `scale`, (n_outputs,)."""
        copies = self.past.shape[1] // len(scale)
        return replace(self, past=self.past * np.tile(scale, copies), y=self.y * scale)

    def among(self, columns: Columns) -> FloatArray:
        """Return (n, n_columns) the rows with zeros for the constant and for signals."""
        rows = np.zeros((len(self.y), columns.size), order="F")
        rows[:, 1 : columns.n_base], rows[:, columns.y_lags], rows[:, columns.y] = self.u, self.past, self.y
        return rows


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
    fill_lagged(rows, x, lags)
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
    report : called with the fraction that is done.

    Raises
    ------
    ValueError : shapes disagree, no row remains, or a value is not finite.
    """
    dimensions = tuple(len(x.shape) for x in (u, y, theta))
    if dimensions != (2, 2, 3):
        raise ValueError(f"u, y, theta must have 2, 2, 3 dimensions, got {', '.join(map(str, dimensions))}")
    if len(u) != len(y) or theta.shape[:2] != y.shape:
        raise ValueError(f"shapes disagree: u {u.shape}, y {y.shape}, theta {theta.shape}")
    if not 1 <= order < len(y):
        raise ValueError(f"order must lie in 1..{len(y) - 1} for {len(y)} samples, got {order}")
    columns = Columns(
        order=order,
        n_inputs=u.shape[1],
        n_outputs=y.shape[1],
        n_atoms=theta.shape[2],
        signals=acting(theta),
        feedthrough=feedthrough,
    )
    n_rows = len(y) - order
    wide = n_rows <= columns.size
    blocks = _blocks(u, y, theta, columns, weights, n_rows if wide else min(BLOCK_ROWS, n_rows), report)
    R = np.zeros((0 if wide else columns.size, columns.size), order="F")
    for block in blocks:
        R = triangular_first(block, columns.n_base) if wide else add_rows(R, block, overwrite=True)
    return _compressed(R, columns, n_rows)


def with_earlier(data: Compressed, earlier: EarlierRows | None) -> Compressed:
    """Return the factor of a record and of others of its order, of which there may be none."""
    if earlier is None:
        return data
    columns, R = data.columns, np.concatenate([data.R, earlier.among(data.columns)])
    R = np.asarray(np.linalg.qr(R, mode="r")) if len(R) > columns.size else triangular_first(R, columns.n_base)
    return _compressed(R, columns, data.n_rows + earlier.n_rows)


def _blocks(
    u: FloatArray,
    y: FloatArray,
    theta: FloatArray,
    columns: Columns,
    weights: FloatArray | None,
    n_at_once: int,
    report: Report,
) -> Iterator[FloatArray]:
    """Yield (n_at_once, n_columns) rows of the stacked lagged matrix, the last filled up with zeros."""
    order = columns.order
    picked = np.array([i * columns.n_atoms + j for i, j in columns.signals], dtype=np.intp)
    block = np.empty((columns.size, n_at_once))
    for start, _ in parts(report, range(order, len(y), n_at_once)):
        rows = slice(start - order, start + n_at_once)
        now = y[rows]
        part = block[:, : len(now) - order]
        block[:, part.shape[1] :] = 0.0
        _fill_record(part, u[rows], now, columns)
        atoms = theta[rows].reshape(len(now), -1)[:, picked]
        fill_lagged(part[columns.theta_lags], atoms, range(1, columns.order + 1))
        fill_lagged(part[columns.theta], atoms, range(1))
        if weights is not None:
            part *= weights[start : start + part.shape[1]]
        yield block.T


def restrict(data: Compressed, *, order: int) -> Compressed:
    """Return the factor of an order, at most that of `data`, over the same rows."""
    whole = data.columns
    if not 1 <= order <= whole.order:
        raise ValueError(f"order must lie in 1..{whole.order}, got {order}")
    if order == whole.order:
        return data
    columns, index = replace(whole, order=order), np.arange(whole.size)
    parts = (
        index[: columns.n_base],
        index[whole.theta_lags][: order * len(whole.signals)],
        index[whole.y_lags][: order * whole.n_outputs],
        index[whole.theta],
        index[whole.y],
    )
    R = data.R.T[np.concatenate(parts)].T
    if len(R) > columns.size:
        R = np.asarray(np.linalg.qr(R, mode="r"))
    else:
        upper = min(whole.n_base, len(R))  # rows below are zero in the columns of the constant and the inputs
        R[:upper] = triangular_first(R[:upper], columns.n_base)
    return _compressed(R, columns, data.n_rows)


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


def _fill_record(part: FloatArray, u: FloatArray, y: FloatArray, columns: Columns) -> None:
    """Write the columns of the constant, the inputs and the outputs into `part`, one row each."""
    part[columns.ones] = 1.0
    fill_lagged(part[1 : columns.n_base], u, columns.input_lags)
    fill_lagged(part[columns.y_lags], y, range(1, columns.order + 1))
    fill_lagged(part[columns.y], y, range(1))


def fill_lagged(rows: FloatArray, x: FloatArray, lags: Sequence[int]) -> None:
    """Write the lagged copies of (n_samples, n_channels) `x` into `rows`, one row per lag and channel."""
    channels, n, width = np.ascontiguousarray(x.T), rows.shape[1], x.shape[1]
    for j, lag in enumerate(lags):
        start = len(x) - n - lag
        rows[j * width : (j + 1) * width] = channels[:, start : start + n]


def _compressed(R: FloatArray, columns: Columns, n_rows: int) -> Compressed:
    if not np.isfinite(R).all():
        raise ValueError("u, y and theta must be finite, got NaN or infinite values; repair or cut them first")
    R.setflags(write=False)
    return Compressed(R=R, columns=columns, n_rows=n_rows)
