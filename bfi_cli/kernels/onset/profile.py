"""RSS as a function of the magnitude, H(z) = I - z H1 + z^2 H2, for many onsets at once (METHOD section 5, steps 3-4).

H(z) holds the inner products of [lags | lag 0] of the corrected outputs in coordinates where they are I at z = 0. The
Schur complement S(z) of its last block is the residuals' covariance relative to the one without a fault; what is
minimised is F(z) = log det S(z), for one output log(RSS / RSS0). Onsets lie along the last axis.

The global minimum is sought by Newton's method from the best two of a coarse logarithmic grid's minima and one more
start: let the signature's lags and lag 0 take any coefficients, keep the dynamics K that this regression finds, and fit
the magnitude for that K. This start finds the narrow minima of large faults, which no grid would.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .elimination import eliminate, solve_last, solved_norm

__all__ = ["Minimum", "ProfilePolynomial", "log_ratio", "minimise", "pencil", "screen"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

GRID = np.geomspace(1e-4, 1.0, 6)
STARTS = 2
ITERATIONS = 40
TOLERANCE = 1e-13
SMALLEST_STEP = 1e-15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProfilePolynomial:
    """RSS of a stack of onsets as a function of z.

    Attributes
    ----------
    H1, H2 : (m, m, n_onsets).
    start : (n_onsets,) magnitude by the dynamics of the unconstrained regression.
    n_outputs : the last rows, those of lag 0.
    """

    H1: FloatArray
    H2: FloatArray
    start: FloatArray
    n_outputs: int

    def take(self, index: IntArray) -> ProfilePolynomial:
        """Return the pencil of some of the onsets."""
        return ProfilePolynomial(
            H1=self.H1[:, :, index],
            H2=self.H2[:, :, index],
            start=self.start[index],
            n_outputs=self.n_outputs,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Minimum:
    """The least F of each onset: z, F and the curvature of F there, each (n_onsets,)."""

    z: FloatArray
    F: FloatArray
    curvature: FloatArray


def pencil(C: FloatArray, S: FloatArray, W: FloatArray) -> ProfilePolynomial:
    """Return H1 and H2 from inner products.

    Parameters
    ----------
    C : (m, s + 1, n_onsets) Q1' T, T the lagged signature.
    S : (s + 1, s + 1, n_onsets) T' T off the base.
    W : (s + 1, m) the rows of R1^-1 that belong to the columns of T.
    """
    Wt = np.ascontiguousarray(W.T)
    m, width = Wt.shape
    A = np.matmul(Wt, C)
    H2 = (Wt @ np.matmul(Wt, S).reshape(width, -1)).reshape(m, m, -1)
    return ProfilePolynomial(H1=A + A.transpose(1, 0, 2), H2=H2, start=_start(A, H2, (C, S)), n_outputs=m - width + 1)


def _start(A: FloatArray, H2: FloatArray, inner: tuple[FloatArray, FloatArray]) -> FloatArray:
    C, S = inner
    width, m, n = len(S), len(A), A.shape[2]
    free = np.zeros((width + 1, width + 1, n))
    free[:-1, :-1] = S - np.matmul(C[:-1].transpose(2, 1, 0), C[:-1].transpose(2, 0, 1)).transpose(1, 2, 0)
    free[:-1, -1] = free[-1, :-1] = -C[-1]
    eliminate(free, width)
    coefficients = solve_last(free, width)[:-1, 0]
    v = np.ones((m, n))
    v[:-1] = np.einsum("jin,in->jn", C[:-1], coefficients)
    top, bottom = (np.einsum("in,in->n", v, np.einsum("ijn,jn->in", X, v)) for X in (A, H2))
    return np.asarray(np.divide(top, bottom, out=np.zeros(n), where=bottom > 0.0))


def log_ratio(stack: ProfilePolynomial, z: FloatArray) -> FloatArray:
    """Return F (n_onsets,) at the magnitudes z (n_onsets,)."""
    H = _at(stack, z)
    return _log_det(eliminate(H, len(H) - stack.n_outputs))


def minimise(stack: ProfilePolynomial, bound: FloatArray) -> Minimum:
    """Return the global minimum over |z| <= bound (n_onsets,) of each onset."""
    grid = np.concatenate([-GRID[::-1], [0.0], GRID])[:, None] * bound
    seeds = np.concatenate([grid, np.clip(stack.start, -bound, bound)[None]])
    F = np.stack([log_ratio(stack, z) if z.any() else np.zeros_like(z) for z in seeds])
    padded = np.pad(F[:-1], ((1, 1), (0, 0)), constant_values=np.inf)
    F[:-1][(F[:-1] > padded[:-2]) | (F[:-1] > padded[2:])] = np.inf
    best: Minimum | None = None
    for row in np.argsort(F, axis=0)[:STARTS]:
        worth = np.flatnonzero(np.isfinite(np.take_along_axis(F, row[None], axis=0)[0]))
        z = np.take_along_axis(seeds, row[None], axis=0)[0]
        best = _better(best, _newton(stack, (z, bound), worth), worth)
    assert best is not None
    return best


def screen(stack: ProfilePolynomial, bound: FloatArray) -> Minimum:
    """Return F at one magnitude near the minimum where a fault is well seen, at 0 where that is worse; no curvature."""
    z = np.clip(stack.start, -bound, bound)
    F = log_ratio(stack, z)
    return Minimum(z=np.where(F < 0.0, z, 0.0), F=np.minimum(F, 0.0), curvature=np.zeros_like(z))


def _better(old: Minimum | None, new: Minimum, where: IntArray) -> Minimum:
    if old is None:
        return new
    won = old.F[where] > new.F
    merged = []
    for name in ("z", "F", "curvature"):
        values = getattr(old, name).copy()
        values[where[won]] = getattr(new, name)[won]
        merged.append(values)
    return Minimum(z=merged[0], F=merged[1], curvature=merged[2])


def _newton(stack: ProfilePolynomial, task: tuple[FloatArray, FloatArray], onsets: IntArray) -> Minimum:
    """Newton with step control from z, both of all onsets, within the bound, on some onsets."""
    z, bound = (x[onsets] for x in task)
    work, live = (stack if len(onsets) == len(task[0]) else stack.take(onsets)), np.arange(len(onsets))
    F, slope, curvature = _local(work, z)
    radius = np.maximum(np.abs(z), 0.01 * bound)
    for _ in range(ITERATIONS):
        step = _step(z[live], bound[live], (slope[live], curvature[live], radius[live]))
        gain = np.abs(step) * (np.abs(slope[live]) + np.abs(step * curvature[live]))
        moving = (gain > TOLERANCE) & (np.abs(step) > SMALLEST_STEP * bound[live])
        if not moving.any():
            break
        if moving.mean() < 0.6:
            work, live, step = work.take(np.flatnonzero(moving)), live[moving], step[moving]
        trial = _local(work, z[live] + step)
        down = trial[0] < F[live]
        won = live[down]
        z[won] += step[down]
        for old, new in zip((F, slope, curvature), trial, strict=True):
            old[won] = new[down]
        radius[live] = np.where(down, np.maximum(radius[live], 3.0 * np.abs(step)), 0.25 * np.abs(step))
    return Minimum(z=z, F=F, curvature=curvature)


def _step(z: FloatArray, bound: FloatArray, local: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    slope, curvature, radius = local
    bent = curvature > 0.0
    step = np.where(bent, -slope / np.where(bent, curvature, 1.0), -np.sign(slope) * radius)
    return np.asarray(np.clip(z + np.clip(step, -radius, radius), -bound, bound) - z)


def _at(stack: ProfilePolynomial, z: FloatArray) -> FloatArray:
    H: FloatArray = z * stack.H2
    H -= stack.H1
    H *= z
    np.einsum("iin->in", H)[:] += 1.0
    return H


def _log_det(S: FloatArray) -> FloatArray:
    return np.log(S[0, 0]) if len(S) == 1 else np.asarray(np.linalg.slogdet(S.transpose(2, 0, 1))[1])


def _local(stack: ProfilePolynomial, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """F, its slope and its curvature."""
    H = _at(stack, z)
    s = len(H) - stack.n_outputs
    S = eliminate(H, s).copy()
    V = solve_last(H, s)
    first, second = (np.einsum("ijn,jrn->irn", X, V) for X in (stack.H1, stack.H2))
    G = 2.0 * z * second - first
    slope = np.einsum("irn,iqn->rqn", V, G)
    curvature = 2.0 * (np.einsum("irn,iqn->rqn", V, second) - solved_norm(H, G[:s]))
    if len(S) == 1:
        slope, curvature = slope[0, 0] / S[0, 0], curvature[0, 0] / S[0, 0]
        return np.log(S[0, 0]), slope, curvature - slope**2
    S, slope, curvature = (x.transpose(2, 0, 1) for x in (S, slope, curvature))
    relative = np.linalg.solve(S, slope)
    bend = np.linalg.solve(S, curvature)
    return (
        np.asarray(np.linalg.slogdet(S)[1]),
        np.asarray(np.trace(relative, axis1=1, axis2=2)),
        np.asarray(np.trace(bend, axis1=1, axis2=2) - np.einsum("nij,nji->n", relative, relative)),
    )
