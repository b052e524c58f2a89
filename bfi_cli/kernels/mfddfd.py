"""MFDDFD: which time courses of a dictionary are in a record, when nobody knows where they act.

Of a fault ``f_j`` with an unknown column of E and G in ``x' = A x + B u + E f, y = C x + D u + G f + e`` the predictor
has a block of free coefficients W_j, those of every lag, the present one among them, on every output:

    y(k) = c + sum B_i u(k-i) + sum K_i y(k-i) + sum_j sum_i W_ji f_j(k-i) + e(k).

Nothing is bilinear, and a fault that is not there has a block of zeros. With constant, inputs and past outputs
projected out by one QR the blocks solve a group lasso, half the squared misfit + weight * sum_j ||W_j||_F (Yuan and Lin
2006), each block in an orthonormal basis of its columns.

Noom, Soloviev and Verhaegen (Automatica 2024, "Proximal-based recursive implementation for model-free data-driven fault
diagnosis") is the source of the data equation, of proximal splitting and of solving again on the support. This departs
from their public program for one output: there every coefficient is charged by the l1 norm and the matrix of all blocks
by its nuclear norm, lags begin at 1, PPXA splits the terms, and a share of the largest decides. Here whole blocks are
charged, so that they are exactly zero together, and the criterion decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import TINY, FloatArray
from .admm import RELAXATION, step_change
from .model_selection import Penalty
from .variable_projection import RANK_TOLERANCE, ProjectedRegression

# Iterations between changes of the step size, which cost nothing: the singular value decomposition serves every size.
EVERY = 20
# Blocks that join those that are solved for at a time, the worst first: it changes the speed only.
JOINING = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockRegression:
    """What is left of outputs and dictionary without constant, inputs and past outputs.

    Attributes
    ----------
    A : (m, n_columns) lags of the time courses; block_of : (n_columns,) the block of each, 0 to n_blocks - 1.
    Y : (m, n_outputs).
    n_rows : rows the compressed data stand for; n_free : regressors per output that are projected out.
    floor : smallest standard deviation a prediction error can have.
    """

    A: FloatArray
    Y: FloatArray
    block_of: NDArray[np.intp]
    n_rows: int
    n_free: int
    floor: float

    @property
    def n_blocks(self) -> int:
        return int(self.block_of[-1]) + 1 if len(self.block_of) else 0

    def norms(self, W: FloatArray) -> FloatArray:
        """Return (n_blocks,) Frobenius norms of coefficients or gradients (n_columns, n_outputs)."""
        return np.sqrt(np.bincount(self.block_of, weights=np.sum(W**2, axis=1), minlength=self.n_blocks))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockSolution:
    """A solution of the group lasso, or the last iterate.

    Attributes
    ----------
    W : (n_columns, n_outputs), whole blocks exactly zero; support : those that are not.
    objective : half the squared misfit and the norms with their weight.
    """

    W: FloatArray
    support: tuple[int, ...]
    objective: float
    iterations: int
    converged: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockFit:
    """Least squares on a support.

    Attributes
    ----------
    support : blocks, ascending.
    effects : (n_active, n_outputs) RMS over the rows of what each block adds to the prediction, less what constant,
        inputs and past outputs can add in its place.
    criterion : twice the negative log-likelihood and its price.
    W : (n_columns of the support, n_outputs).
    """

    support: tuple[int, ...]
    effects: FloatArray
    criterion: float
    W: FloatArray


def time_courses(problem: ProjectedRegression, same: float) -> tuple[tuple[int, ...], ...]:
    """Return the atoms by time course: atoms on single outputs are together where their signals are one.

    Parameters
    ----------
    same : coherence of two signals from which on they are one.
    """
    columns: dict[int, list[int]] = {}
    for column, (_, atom) in enumerate(problem.signals):
        columns.setdefault(atom, []).append(column)
    flat = problem.theta.reshape(-1, len(problem.signals))
    norms = np.linalg.norm(flat, axis=0)
    flat = flat / np.where(norms > 0.0, norms, 1.0)
    courses: list[list[int]] = []
    for atom, members in columns.items():
        for course in courses:
            others = columns[course[0]]
            if len(members) == len(others) == 1 and abs(float(flat[:, members[0]] @ flat[:, others[0]])) >= same:
                course.append(atom)
                break
        else:
            courses.append([atom])
    return tuple(tuple(course) for course in courses)


def block_regression(problem: ProjectedRegression, courses: Sequence[Sequence[int]]) -> BlockRegression:
    """Project the past outputs out of the outputs and of every lag of the time courses, each that of its first atom."""
    m, n_lags = len(problem.y), problem.order + 1
    columns = [[column for column, (_, atom) in enumerate(problem.signals) if atom == course[0]] for course in courses]
    wanted = [column for members in columns for column in members]
    A = problem.theta[:, :, wanted].transpose(0, 2, 1).reshape(m, -1)
    past, Y = problem.y[:, 1:].reshape(m, -1), problem.y[:, 0]
    U, s, _ = np.linalg.svd(past, full_matrices=False)
    Q = U[:, : int(np.count_nonzero(s > RANK_TOLERANCE * s[0])) if s.size else 0]
    return BlockRegression(
        A=A - Q @ (Q.T @ A),
        Y=Y - Q @ (Q.T @ Y),
        block_of=np.repeat(np.arange(len(courses)), [n_lags * len(members) for members in columns]),
        n_rows=problem.n_rows,
        n_free=problem.n_base + problem.order * problem.n_outputs,
        floor=problem.floor,
    )


def standardised(blocks: BlockRegression) -> BlockRegression:
    """Return the regression with an orthonormal basis of each block in its place.

    A norm then charges what a block adds to the prediction, whatever its columns (Simon and Tibshirani 2012): the lags
    of a step are nearly one column, and coefficients of opposite signs are no smaller a fault.
    """
    bases = []
    for j in range(blocks.n_blocks):
        U, s, _ = np.linalg.svd(blocks.A[:, blocks.block_of == j], full_matrices=False)
        bases.append(U[:, s > RANK_TOLERANCE * max(float(s[0]), TINY)])
    return BlockRegression(
        A=np.hstack([np.zeros((len(blocks.A), 0)), *bases]),
        Y=blocks.Y,
        block_of=np.repeat(np.arange(blocks.n_blocks), [basis.shape[1] for basis in bases]),
        n_rows=blocks.n_rows,
        n_free=blocks.n_free,
        floor=blocks.floor,
    )


def largest_weight(blocks: BlockRegression) -> float:
    """Return the weight from which on every block is zero."""
    return float(blocks.norms(blocks.A.T @ blocks.Y).max(initial=0.0))


def solve_blocks(
    blocks: BlockRegression,
    weight: float,
    start: FloatArray | None = None,
    *,
    max_iterations: int = 20_000,
    tolerance: float = 1e-7,
) -> BlockSolution:
    """Minimise half the squared misfit + weight * sum of the blocks' Frobenius norms.

    It is solved for the blocks that matter, and those whose gradient exceeds the weight at the solution join them.

    Parameters
    ----------
    weight : positive.
    start : (n_columns, n_outputs) of a weight nearby.
    tolerance : of both residuals of the splitting, and of a gradient beyond the weight, relative.
    """
    W = np.zeros((blocks.A.shape[1], blocks.Y.shape[1])) if start is None else start.copy()
    chosen, iterations, converged = np.flatnonzero(blocks.norms(W)), 0, True
    while True:
        gradient = blocks.norms(blocks.A.T @ (blocks.Y - blocks.A @ W))
        gradient[chosen] = 0.0
        if iterations or not len(chosen):
            beyond = np.flatnonzero(gradient > weight * (1.0 + tolerance))
            if not len(beyond) or not converged:
                break
            worst = beyond[np.argsort(-gradient[beyond])[:JOINING]]
            chosen = np.sort(np.concatenate([chosen, worst]))
        columns = np.isin(blocks.block_of, chosen)
        W[columns], made, converged = _split(
            blocks.A[:, columns],
            blocks.Y,
            np.searchsorted(chosen, blocks.block_of[columns]),
            weight,
            W[columns],
            max_iterations,
            tolerance,
        )
        iterations += made
    misfit, norms = float(np.sum((blocks.Y - blocks.A @ W) ** 2)), blocks.norms(W)
    return BlockSolution(
        W=np.asarray(W, dtype=np.float64),
        support=tuple(np.flatnonzero(norms).tolist()),
        objective=0.5 * misfit + weight * float(norms.sum()),
        iterations=iterations,
        converged=converged,
    )


def _split(
    A: FloatArray,
    Y: FloatArray,
    block_of: NDArray[np.intp],
    weight: float,
    start: FloatArray,
    max_iterations: int,
    tolerance: float,
) -> tuple[FloatArray, int, bool]:
    """Solve a group lasso by the alternating direction method of multipliers (Boyd et al. 2011, section 6.4.2)."""
    left, s, right = np.linalg.svd(A, full_matrices=False)
    explained = s[:, None] * (left.T @ Y)
    # Between the stiff and the loose directions; it is balanced on the way.
    step = float(s[0] * max(s[-1], 1e-3 * s[0]))
    V, dual = start, A.T @ (Y - A @ start) / step
    for iteration in range(1, max_iterations + 1):
        # 1. Least squares: in the row space of A by its singular values, else as it is.
        near = V - dual
        inside = right @ near
        W = near + right.T @ ((explained + step * inside) / (s**2 + step)[:, None] - inside)
        # 2. Every block is shrunk by its norm.
        relaxed = RELAXATION * W + (1.0 - RELAXATION) * V
        before, wanted = V, relaxed + dual
        norms = np.sqrt(np.bincount(block_of, weights=np.sum(wanted**2, axis=1)))
        shrunk = np.maximum(1.0 - weight / step / np.where(norms > 0.0, norms, 1.0), 0.0)
        V = shrunk[block_of, None] * wanted
        # 3. Multipliers.
        dual = wanted - V
        apart, moved = float(np.linalg.norm(W - V)), step * float(np.linalg.norm(V - before))
        size = max(float(np.linalg.norm(W)), float(np.linalg.norm(V)), 1e-300)
        multiplier = max(step * float(np.linalg.norm(dual)), 1e-300)
        if apart <= tolerance * size and moved <= tolerance * multiplier:
            return V, iteration, True
        if iteration % EVERY == 0:
            change = step_change(apart / size, moved / multiplier)
            step, dual = step * change, dual / change
    return V, max_iterations, False


def solve_on_support(blocks: BlockRegression, support: Sequence[int], penalty: Penalty) -> BlockFit:
    """Return the least squares with blocks of a support, not shrunk."""
    columns = np.isin(blocks.block_of, support)
    blocks_of_columns, A = blocks.block_of[columns], blocks.A[:, columns]
    W, _, rank, _ = np.linalg.lstsq(A, blocks.Y, rcond=RANK_TOLERANCE)
    error = blocks.Y - A @ W
    n_outputs = error.shape[1]
    # By eigenvalues: of errors that vanish in a direction a triangular factor leaves minus infinity.
    variances = np.maximum(np.linalg.eigvalsh(error.T @ error / blocks.n_rows), 0.0)
    variances += max(blocks.floor, TINY**0.25) ** 2
    price = n_outputs * (blocks.n_free + int(rank)) * penalty.per_parameter + len(support) * penalty.per_atom
    parts = [np.linalg.norm(A[:, blocks_of_columns == j] @ W[blocks_of_columns == j], axis=0) for j in support]
    return BlockFit(
        support=tuple(support),
        effects=np.array(parts).reshape(-1, n_outputs) / np.sqrt(blocks.n_rows),
        criterion=penalty.n_effective * float(np.log(variances).sum()) + price,
        W=np.asarray(W, dtype=np.float64),
    )


def best_within(
    blocks: BlockRegression, support: Sequence[int], penalty: Penalty, *, most: int | None = None
) -> BlockFit:
    """Return the best fit on the way from a support to none, the least block dropped again and again.

    Parameters
    ----------
    most : blocks of the answer; None for no limit.
    """
    columns = np.isin(blocks.block_of, support)
    # The fits are all of these columns: their triangular factor stands for the rows.
    R = np.asarray(np.linalg.qr(np.hstack([blocks.A[:, columns], blocks.Y]), mode="r"))
    n_columns = int(columns.sum())
    small = BlockRegression(
        A=R[:, :n_columns],
        Y=R[:, n_columns:],
        block_of=blocks.block_of[columns],
        n_rows=blocks.n_rows,
        n_free=blocks.n_free,
        floor=blocks.floor,
    )
    best = current = solve_on_support(small, support, penalty)
    while current.support:
        fewer = (tuple(k for k in current.support if k != j) for j in current.support)
        current = min((solve_on_support(small, subset, penalty) for subset in fewer), key=lambda fit: fit.criterion)
        if most is not None and len(best.support) > most:
            best = current
        best = min(best, current, key=lambda fit: fit.criterion)
    return best


def as_sensor_faults(
    problem: ProjectedRegression, courses: Sequence[Sequence[int]], fit: BlockFit
) -> dict[int, tuple[float, float]]:
    """Return what each atom of a support would be as an error of its own sensor.

    A sensor that reads z f too much adds ``z (f(k) - sum_i K_i f(k-i))`` to the prediction error; z is the least
    squares of the block's part on that, exact for an error of the sensor.

    Returns
    -------
    By atom z and the share of the square of the block's part that it explains, 1 for an error of that sensor alone.
    """
    m, n_y, s = len(problem.y), problem.n_outputs, problem.order
    columns_of = {j: [c for c, (_, atom) in enumerate(problem.signals) if atom == courses[j][0]] for j in fit.support}
    theta: list[FloatArray] = [
        problem.theta[:, :, columns_of[j]].transpose(0, 2, 1).reshape(m, -1) for j in fit.support
    ]
    A, past = np.hstack([np.zeros((m, 0)), *theta]), problem.y[:, 1:].reshape(m, -1)
    coefficients = np.linalg.lstsq(past, problem.y[:, 0] - A @ fit.W, rcond=RANK_TOLERANCE)[0]
    K = coefficients.reshape(s, n_y, n_y).transpose(0, 2, 1)
    magnitudes, first = dict[int, tuple[float, float]](), 0
    for j, lags in zip(fit.support, theta, strict=True):
        part = lags @ fit.W[first : first + lags.shape[1]]
        first += lags.shape[1]
        for atom in courses[j]:
            g = np.zeros((m, n_y))
            for column in (c for c, (_, of) in enumerate(problem.signals) if of == atom):
                output, f = problem.signals[column][0], problem.theta[:, :, column]
                g[:, output] += f[:, 0]
                g -= np.einsum("io,ki->ko", K[:, :, output], f[:, 1:])
            size, whole = float(np.sum(g**2)), float(np.sum(part**2))
            product = float(np.sum(g * part))
            magnitudes[atom] = (
                (product / size, product**2 / (size * whole)) if size > 0.0 and whole > 0.0 else (0.0, 0.0)
            )
    return magnitudes
