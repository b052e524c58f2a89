"""Sparse fault magnitudes by pseudo-measurements: the stage of method risro, and the published one.

A pseudo-measurement claims that a norm of z was measured as zero (Carmi, Gurfil and Kanevsky 2010; thesis algorithm 2).
The published stage takes one such measurement of the whole norm, in whatever units z has. The stage of method risro,
`sparse_supports`, takes one per atom, in units of the atom's own standard deviation, as rows of RISRO's least squares:

    minimise misfit^2 / sigma^2 + (1/R) sum_j rho(|z_j| / s_j),  rho(x) = 1 - exp(-alpha x), x or x^p,

where s_j = sigma / |R_zz[:, j]| is the standard deviation of z_j with the other atoms known. A penalty that is concave
in z^2 lies below its tangent there, so the update "0 = z_j with weight W = rho'(x) / (2 R x) / s_j^2" lowers it.

The constants follow from the price c at which the criterion sells an atom. For orthogonal signatures a nonzero fixed
point obeys x_0 = x + rho'(x) / (2 R), x_0 being the magnitude without the stage. The right side is smallest at some
x_least, below which nothing survives, and its value there is the hard threshold, set to sqrt(c). For the exponential
x_least = ln u / alpha, u = alpha^2 / (2 R); for given R the threshold is largest at u = e, where x_least = 1 / alpha.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from . import FloatArray
from .compiled import lapack
from .lagged import PANEL
from .risro import least_squares, whitened_outputs
from .variable_projection import ProjectedRegression

Sparsity = Literal["none", "l1", "lp", "exp-l0"]
KINDS: tuple[str, ...] = get_args(Sparsity)

# The thesis's settings of its own stage (section 5-3): steepness, variance of the pseudo-measurement, prior variance.
PUBLISHED = {"alpha": 1.0, "r": 10.0, "p0": 1.0}
# Steps of the stage from one start; with seven and with eighty atoms it usually takes 5 to 20.
MAX_STEPS = 40
# In standard deviations, beside the least survivor's two: a magnitude below the first leaves the problem, since its
# weight only grows; steps below the second have settled.
NOTHING, SETTLED = 0.1, 0.01
# A number whose inverse and square are still numbers. No weight is below the second: equal atoms share a magnitude.
SMALLEST, ROUND_OFF = 1e-30, 1e-14


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseStage:
    """Settings of the stage; None is the derived value, in the published stage the thesis's.

    Attributes
    ----------
    kind : the penalty: "l1", "lp" (of exponent p), "exp-l0" (eq. 3-21), or "none".
    alpha : steepness of the exponential.
    p : exponent of "lp", in (0, 1].
    r : variance of the pseudo-measurement; the larger, the weaker the stage.
    p0 : prior variance of a magnitude in units of its own; None for no prior beside the data.
    updates : of the published stage per iteration.
    """

    kind: Sparsity = "none"
    alpha: float | None = None
    p: float = 0.5
    r: float | None = None
    p0: float | None = None
    updates: int = 1

    def __post_init__(self) -> None:
        """Refuse what has no meaning."""
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        positive = all(value is None or value > 0 for value in (self.alpha, self.r, self.p0))
        if not (positive and 0 < self.p <= 1 and self.updates >= 0):
            raise ValueError(f"need alpha > 0, r > 0, p0 > 0, 0 < p <= 1, updates >= 0, got {self}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SparseSolution:
    """Where the stage went from one start.

    Attributes
    ----------
    supports : the supports it visited, ascending atoms, in the order of their last visit.
    z : (n_atoms,) the last magnitudes, zero for what left the problem; K : (order,).
    iterations : steps made; converged : they settled.
    """

    supports: tuple[tuple[int, ...], ...]
    z: FloatArray
    K: FloatArray
    iterations: int
    converged: bool


def penalty_constants(stage: SparseStage, price: float) -> tuple[float, float, float]:
    """Return alpha (of "l1" and "lp" the exponent), R and x_least for an atom's price, see the module.

    A given alpha or R takes the place of the derived one.
    """
    threshold = np.sqrt(price)
    if stage.kind == "exp-l0":
        alpha = 2.0 / threshold if stage.alpha is None else stage.alpha
        R = 2.0 / (math.e * price) if stage.r is None else stage.r
        return alpha, R, max(float(np.log(alpha**2 / (2.0 * R))), 0.0) / alpha
    p = stage.p if stage.kind == "lp" else 1.0
    # x + p x^(p-1) / (2R) is least at x^(2-p) = p (1-p) / (2R), where it is x (2-p) / (1-p); for p = 1 it is 1 / (2R).
    if stage.r is not None:
        return p, stage.r, float((p * (1.0 - p) / (2.0 * stage.r)) ** (1.0 / (2.0 - p)))
    least = threshold * (1.0 - p) / (2.0 - p)
    return p, float(p * least ** (p - 1.0) / (2.0 * (threshold - least))), float(least)


def sparse_supports(
    problem: ProjectedRegression,
    z: FloatArray,
    K: FloatArray,
    *,
    stage: SparseStage,
    price: float,
    guarded: bool = False,
) -> SparseSolution:
    """Follow the stage from a start to its fixed point.

    Parameters
    ----------
    problem : with more rows than unknowns. Several outputs are whitened by the prediction error of the start.
    z : (n_atoms,) and K of the start, (order,) of one output, (order, n_outputs, n_outputs) of several.
    price : of an atom in the criterion.
    guarded : the first step is not a plain one of RISRO but takes every magnitude as the least survivor of the
        exponential, whose weight is 1. Where the atoms are many and alike, a plain step makes all of them large.
    """
    shape, R, least = penalty_constants(stage, price)
    prior = 0.0 if stage.p0 is None else 1.0 / stage.p0
    n_atoms, n_y, outputs = len(z), problem.n_outputs, whitened_outputs(problem, z, K)
    live, theta, y, H = outputs.atoms, outputs.theta, outputs.y, outputs.coefficients(K)
    floor_variance, n_past = problem.floor**2 * np.sum(outputs.whiten**2) / n_y, len(H)
    z, dof = z[live], float(len(live))
    supports: dict[tuple[int, ...], None] = {}
    settled, count = not len(live), 0
    while not settled and count < MAX_STEPS:
        # 1. Linearise at (z, K): the columns of K, those of z, and the residual, of every output.
        n, corrected = len(z), (y - z @ theta).reshape(n_past + n_y, -1)
        stacked, predictor = np.empty((n_past + (n + 1) * n_y, y.shape[2])), np.hstack([np.eye(n_y), -H.T])
        stacked[:n_past] = corrected[n_y:]
        signatures = np.tensordot(predictor, theta.reshape(len(corrected), n, -1), axes=1)
        stacked[n_past:-n_y], errors = signatures.reshape(n * n_y, -1), predictor @ corrected
        stacked[-n_y:], residual = errors, errors.ravel()
        size = len(stacked)
        whole = np.triu(lapack.dgeqrt(min(PANEL, size), stacked.T, overwrite_a=True)[0][:size])
        across, below = whole[:n_past, n_past:], whole[n_past:, n_past:]
        triangle = below
        if n_y > 1:
            each = below[:, :-n_y].reshape(len(below), n_y, n), below[:, -n_y:, None]
            rows = np.concatenate(each, axis=2).transpose(1, 0, 2).reshape(-1, n + 1)
            triangle = np.linalg.qr(rows, mode="r")
        R_zz = triangle[:-1, :-1]
        # 2. The unit of each magnitude: its standard deviation with K eliminated and the other atoms known.
        degrees = max(n_y * (problem.n_rows - problem.n_base - n_past) - dof, 1.0)
        sigma = np.sqrt(residual @ residual / degrees + floor_variance)
        norms = np.maximum(np.linalg.norm(R_zz, axis=0), SMALLEST)
        sd = sigma / norms
        # 3. The pseudo-measurements 0 = z_j: their weights are the slope of the penalty at |z_j|, and the prior.
        x = np.maximum(np.abs(z) / sd, SMALLEST)
        slope = shape * (np.exp(-shape * x) if stage.kind == "exp-l0" else x ** (shape - 1.0))
        W = slope / (2.0 * R * x) + prior if count else np.full(n, float(guarded))
        w = norms * np.sqrt(np.maximum(W, ROUND_OFF))
        # 4. The step: least squares over the triangle and the pseudo-measurements below it.
        claims = np.column_stack([np.diag(w), -w * z])
        S = np.triu(lapack.dtpqrt(n, min(PANEL, n + 1), triangle, claims)[0])
        dz = lapack.dtrtrs(S[:n, :n], S[:n, -1])[0]
        left = (across[:, i - n_y] - across[:, i * n : (i + 1) * n] @ dz for i in range(n_y))
        dH = np.column_stack([least_squares(whole[:n_past, :n_past], column)[0] for column in left])
        dof = n - float(np.sum((w[:, None] * lapack.dtrtri(S[:n, :n])[0]) ** 2))
        z, H, count = z + dz, H + dH, count + 1
        if count == 1:
            continue
        # 5. Magnitudes above the least survivor are a support; those that are nothing leave the problem.
        x = np.abs(z) / sd
        supports.pop(support := tuple(live[x > least].tolist()), None)
        supports[support] = None
        keep = x >= NOTHING
        settled = not keep.any() or bool(keep.all() and np.all(np.abs(dz) < SETTLED * sd))
        z, live, theta = z[keep], live[keep], theta if keep.all() else theta[:, :, keep]
    every = np.zeros(n_atoms)
    every[live] = z
    return SparseSolution(
        supports=tuple(supports), z=every, K=outputs.predictor(H), iterations=count, converged=settled
    )


def pseudo_norm(z: FloatArray, stage: SparseStage) -> tuple[float, FloatArray]:
    """Return the published stage's norm of z and its gradient (zero where an entry is zero)."""
    size, sign = np.abs(z), np.sign(z)
    if stage.kind == "exp-l0":
        alpha = PUBLISHED["alpha"] if stage.alpha is None else stage.alpha
        decay = np.exp(-alpha * size)
        return float(np.sum(1.0 - decay)), alpha * sign * decay
    p = stage.p if stage.kind == "lp" else 1.0
    largest = size.max(initial=0.0)
    if largest == 0.0:
        return 0.0, sign
    norm = largest * np.sum((size / largest) ** p) ** (1.0 / p)
    ratio = np.divide(norm, size, out=np.zeros_like(size), where=size > 0)
    return float(norm), sign * ratio ** (1.0 - p)


def published_updates(z: FloatArray, stage: SparseStage) -> tuple[FloatArray, int]:
    """Return z after the updates of the published stage, and how many really changed it (eq. 3-20 to 3-22).

    With h(z) the norm and H its gradient the update is ``z - K h(z)``, ``K = P H' / (H P H' + R)``. The thesis prints
    the exponential stage's H as minus the gradient; eq. 3-22 then has the wrong sign and algorithm 3 the right one,
    which is this. An entry that is exactly zero has no gradient and stays zero.
    """
    z, made = np.array(z, dtype=np.float64), 0
    if stage.kind == "none" or not z.size:
        return z, made
    R = PUBLISHED["r"] if stage.r is None else stage.r
    P = (PUBLISHED["p0"] if stage.p0 is None else stage.p0) * np.eye(z.size)
    for _ in range(stage.updates):
        norm, H = pseudo_norm(z, stage)
        PH = P @ H
        gain = PH / (H @ PH + R)
        made += bool(np.any(gain * norm))
        z, P = z - gain * norm, P - np.outer(gain, PH)
    return z, made
