"""RSS as a function of the magnitude, H(z) = I - z H1 + z^2 H2, for many onsets at once.

H(z) holds the inner products of [lags | lag 0] of the corrected outputs in coordinates where they are I at z = 0. The
Schur complement S(z) of its last block is the residuals' covariance relative to the one without a fault; what is
minimised is F(z) = log det S(z), for one output log(RSS / RSS0). Onsets lie along the last axis, so that one step of an
elimination is one array operation over all of them: for matrices of ten rows that is several times faster than a call
of a factorisation per matrix.

The global minimum is sought by Newton's method from the best two of a coarse logarithmic grid's minima and one more
start: let the signature's lags and lag 0 take any coefficients, keep the dynamics K that this regression finds, and fit
the magnitude for that K. This start finds the narrow minima of large faults, which no grid would.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import EPS, TINY, FloatArray, IntArray
from ..compiled import einsum

# Numbers per table of a stack that stays in the processor's cache: 1 MB.
CACHE_DOUBLES = 120_000
# Magnitudes of the grid relative to the bound, of either sign.
GRID = np.geomspace(1e-4, 1.0, 6)
# Starts of Newton's method per onset; from z = 0 alone it misses the minimum at 5 to 9 % of the onsets of true drifts.
STARTS = 2
# Steps of Newton's method from each start at most. On a simulated and on a recorded flight ten reached the tolerances
# below; the rest is a reserve.
ITERATIONS = 40
# Newton's method ends where F would fall by less than this, or z move by less than that share of the bound.
TOLERANCE = 1e-13
SMALLEST_STEP = 1e-15
# A parabola through a minimum goes through another start if it misses it by less than this share of its height there.
ALIKE = 0.1
# First step of Newton's method at z = 0, as a share of the bound.
FIRST_RADIUS = 0.01
# Converged onsets are taken out of the stack, which costs a copy, once less than this share of it is still moving.
STILL_MOVING = 0.6
# A pivot that rounding leaves below this share of its diagonal entry, or of the terms that the entry is the difference
# of, is raised to it, and its row left out: what stands there is rounding, which further eliminations would square.
SINGULAR = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProfilePolynomial:
    """RSS of a stack of onsets as a function of z.

    Attributes
    ----------
    H1, H2 : (m, m, n_onsets).
    start : (n_onsets,) magnitude fitted for the dynamics of the regression with free lagged coefficients.
    n_outputs : the last rows, those of lag 0.
    """

    H1: FloatArray
    H2: FloatArray
    start: FloatArray
    n_outputs: int

    def take(self, index: IntArray) -> ProfilePolynomial:
        """Return the polynomials of some of the onsets."""
        return ProfilePolynomial(
            H1=self.H1[:, :, index], H2=self.H2[:, :, index], start=self.start[index], n_outputs=self.n_outputs
        )

    def at(self, z: FloatArray) -> FloatArray:
        """Return H(z), (m, m, n) for z (n_onsets,) or (n_magnitudes, n_onsets), n the number of entries of z."""
        m, m, n_onsets = self.H1.shape
        H: FloatArray = self.H2[:, :, None] * z.reshape(-1, n_onsets)
        H -= self.H1[:, :, None]
        H *= z.reshape(-1, n_onsets)
        H = H.reshape(m, m, -1)
        left = einsum("iin->in", H)
        left += 1.0
        # What a signature leaves of a record is never less than nothing: where it explains all, rounding of its terms.
        terms = 1.0 + einsum("iin->in", self.H2)[:, None] * z.reshape(-1, n_onsets) ** 2
        np.maximum(left, EPS * terms.reshape(left.shape), out=left)
        return H


def profile_polynomial(C: FloatArray, S: FloatArray, W: FloatArray) -> ProfilePolynomial:
    """Return H1 and H2 from inner products.

    Parameters
    ----------
    C : (m, s + 1, n_onsets) Q1' T, T the lagged signature.
    S : (s + 1, s + 1, n_onsets) T' T off the base.
    W : (s + 1, m) the rows of R1^-1 that belong to the columns of T.
    """
    Wt = np.ascontiguousarray(W.T)
    (m, width), n = Wt.shape, C.shape[2]
    A = np.matmul(Wt, C)
    H2 = (Wt @ np.matmul(Wt, S).reshape(width, -1)).reshape(m, m, -1)

    # The start: v are the dynamics of the regression whose signature takes any coefficients.
    free = np.zeros((width + 1, width + 1, n))
    free[:-1, :-1] = S - np.matmul(C[:-1].transpose(2, 1, 0), C[:-1].transpose(2, 0, 1)).transpose(1, 2, 0)
    free[:-1, -1] = free[-1, :-1] = -C[-1]
    # A signature that the regressors explain leaves the rounding of the difference, which is no pivot.
    eliminate(free, width, einsum("iin->in", S))
    v = np.ones((m, n))
    v[:-1] = einsum("jin,in->jn", C[:-1], solve_last(free, width)[:-1, 0])
    top, bottom = (einsum("in,in->n", v, einsum("ijn,jn->in", X, v)) for X in (A, H2))
    start = np.divide(top, bottom, out=np.zeros(n), where=bottom > 0.0)
    return ProfilePolynomial(H1=A + A.transpose(1, 0, 2), H2=H2, start=start, n_outputs=m - width + 1)


def log_ratio(stack: ProfilePolynomial, z: FloatArray) -> FloatArray:
    """Return F at the magnitudes z (n_onsets,) or (n_magnitudes, n_onsets), of the same shape."""
    together = max(1, CACHE_DOUBLES // stack.H1.size)
    if z.ndim == 2 and len(z) > together:
        return np.concatenate([log_ratio(stack, z[k : k + together]) for k in range(0, len(z), together)])
    H = stack.at(z)
    S = eliminate(H, len(H) - stack.n_outputs)
    F = np.log(S[0, 0]) if len(S) == 1 else np.linalg.slogdet(S.transpose(2, 0, 1))[1]
    return np.asarray(F).reshape(z.shape)


def minimise(stack: ProfilePolynomial, bound: FloatArray) -> FloatArray:
    """Return (3, n_onsets) z, F and its curvature at the global minimum over |z| <= bound (n_onsets,)."""
    grid = np.concatenate([-GRID[::-1], [0.0], GRID])[:, None] * bound
    seeds = np.concatenate([grid, np.clip(stack.start, -bound, bound)[None]])
    F, every = log_ratio(stack, seeds), np.arange(len(bound))
    F[len(GRID)] = 0.0
    padded = np.full((len(F) + 1, len(every)), np.inf)
    padded[1:-1] = F[:-1]
    F[:-1][(F[:-1] > padded[:-2]) | (F[:-1] > padded[2:])] = np.inf
    first, *further = np.argsort(F, axis=0)[:STARTS]
    best = _newton(stack, seeds[first, every], bound)
    for row in further:
        # Where the parabola through a start's minimum goes through the next start as well, that leads to the same one.
        z, here, curvature = best
        expected = here + 0.5 * curvature * (seeds[row, every] - z) ** 2
        alike = np.abs(F[row, every] - expected) <= ALIKE * (F[row, every] - here)
        onsets = np.flatnonzero(np.isfinite(F[row, every]) & ~alike)
        if not len(onsets):
            break
        other = _newton(stack.take(onsets), seeds[row, every][onsets], bound[onsets])
        won = best[1, onsets] > other[1]
        best[:, onsets[won]] = other[:, won]
    return best


def screen(stack: ProfilePolynomial, bound: FloatArray) -> FloatArray:
    """Return F (n_onsets,) at the magnitude `start`, near the minimum of a fault that is well seen, at most 0."""
    return np.minimum(log_ratio(stack, np.clip(stack.start, -bound, bound)), 0.0)


def _newton(stack: ProfilePolynomial, z: FloatArray, bound: FloatArray) -> FloatArray:
    """Return (3, n_onsets) z, F and curvature that Newton's method with step control reaches from z, within bounds."""
    F, slope, curvature = _derivatives(stack, z)
    radius, live = np.maximum(np.abs(z), FIRST_RADIUS * bound), np.arange(len(z))
    for _ in range(ITERATIONS):
        here, limit, tilt, bend, reach = (x[live] for x in (z, bound, slope, curvature, radius))
        convex = bend > 0.0
        step = np.where(convex, -tilt / np.where(convex, bend, 1.0), -np.sign(tilt) * reach)
        step = np.clip(here + np.clip(step, -reach, reach), -limit, limit) - here
        gain = np.abs(step) * (np.abs(tilt) + np.abs(step * bend))
        moving = (gain > TOLERANCE) & (np.abs(step) > SMALLEST_STEP * limit)
        if not (n_moving := np.count_nonzero(moving)):
            break
        if n_moving < STILL_MOVING * len(moving):
            stack, live, step = stack.take(np.flatnonzero(moving)), live[moving], step[moving]
        trial = _derivatives(stack, z[live] + step)
        better = trial[0] < F[live]
        won = live[better]
        z[won] += step[better]
        for old, new in zip((F, slope, curvature), trial, strict=True):
            old[won] = new[better]
        radius[live] = np.where(better, np.maximum(radius[live], 3.0 * np.abs(step)), 0.25 * np.abs(step))
    return np.stack([z, F, curvature])


def _derivatives(stack: ProfilePolynomial, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return F, its slope and its curvature at z."""
    H = stack.at(z)
    s = len(H) - stack.n_outputs
    S = eliminate(H, s).copy()
    V = solve_last(H, s)
    first, second = (einsum("ijn,jrn->irn", X, V) for X in (stack.H1, stack.H2))
    G = 2.0 * z * second - first
    slope = einsum("irn,iqn->rqn", V, G)
    curvature = 2.0 * (einsum("irn,iqn->rqn", V, second) - solved_norm(H, G[:s]))
    if len(S) == 1:
        slope, curvature = slope[0, 0] / S[0, 0], curvature[0, 0] / S[0, 0]
        return np.log(S[0, 0]), slope, curvature - slope**2
    S, slope, curvature = (x.transpose(2, 0, 1) for x in (S, slope, curvature))
    relative = np.linalg.solve(S, slope)
    bend = np.linalg.solve(S, curvature)
    return (
        np.asarray(np.linalg.slogdet(S)[1]),
        np.asarray(np.trace(relative, axis1=1, axis2=2)),
        np.asarray(np.trace(bend, axis1=1, axis2=2) - einsum("nij,nji->n", relative, relative)),
    )


def eliminate(H: FloatArray, n_pivots: int, size: FloatArray | None = None) -> FloatArray:
    """Eliminate the first pivots of symmetric H (m, m, n) in place; return the Schur complement (m - n_pivots, ..., n).

    Rows above it then hold the factor: pivots on the diagonal, pivot rows right of it, multipliers below. Of a pivot
    that vanishes both are zero: what depends on earlier ones takes no part.

    Parameters
    ----------
    size : (n_pivots, n) of the terms that the first diagonal entries are differences of; None where they are not.
    """
    smallest = SINGULAR * einsum("iin->in", H) + TINY
    if size is not None:
        smallest[:n_pivots] = SINGULAR * size + TINY
    for j in range(len(H)):
        if k := min(j, n_pivots):
            H[j, j:] -= einsum("kn,kin->in", H[j, :k], H[:k, j:])
        if j < n_pivots and np.count_nonzero(gone := H[j, j] < smallest[j]):
            H[j, j + 1 :, gone] = 0.0
        np.maximum(H[j, j], smallest[j], out=H[j, j])
        if j < n_pivots:
            np.divide(H[j, j + 1 :], H[j, j], out=H[j + 1 :, j])
    rest = H[n_pivots:, n_pivots:]
    for j in range(1, len(rest)):
        rest[j, :j] = rest[:j, j]
    return rest


def solve_last(H: FloatArray, n_pivots: int) -> FloatArray:
    """Return V (m, m - n_pivots, n), [-Haa^-1 Hab; I] of the H that `eliminate` went through."""
    m, n = len(H), H.shape[2]
    V = np.empty((m, m - n_pivots, n))
    V[n_pivots:] = np.eye(m - n_pivots)[:, :, None]
    for j in range(n_pivots - 1, -1, -1):
        einsum("in,irn->rn", H[j, j + 1 :], V[j + 1 :], out=V[j])
        V[j] /= -H[j, j]
    return V


def solved_norm(H: FloatArray, G: FloatArray) -> FloatArray:
    """Return G' Haa^-1 G (r, r, n) for G (n_pivots, r, n)."""
    G = G.copy()
    for j in range(len(G)):
        G[j + 1 :] -= H[j + 1 : len(G), j, None] * G[j]
    pivots = einsum("iin->in", H)[: len(G)]
    return np.asarray(einsum("irn,iqn->rqn", G / pivots[:, None], G))


def peaks(statistic: FloatArray, count: int) -> IntArray:
    """Return the indices of the highest local maxima, highest first."""
    padded = np.pad(statistic, 1, constant_values=-np.inf)
    maxima = np.flatnonzero((statistic >= padded[:-2]) & (statistic >= padded[2:]))
    return maxima[np.argsort(-statistic[maxima])[:count]]
