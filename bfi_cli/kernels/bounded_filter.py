"""The Kalman filter of many hypotheses of one record at once, with bounded innovations, and the score of its variances.

The system is x(k+1) = F x(k) + w(k), y(k) = Z(k) x(k) + v(k), w and v white with diagonal covariances Q(k) and R(k),
and F = diag(decay) + the couplings, constant. Hypotheses differ in measurements, loadings and variances; they stand on
the second axis (the stack), so that an interpreter walks over the samples once for all of them.

The Cholesky factor of the innovations' covariance takes the rows of one sample one after the other: innovation i is
that of row i given the past and the rows before it, and their log densities add up to that of the sample. An
innovation beyond `bound` standard deviations counts as if its variance were as much larger (Huber 1964), so that a
gross error neither costs nor moves more than a linear function of its size.

The score is that of Koopman and Shephard (1992): of every variance, from one backward pass (de Jong 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import FloatArray

# Standard deviations from which on an innovation counts linearly: of white noise 0.3 % lie beyond.
BOUND = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Coupling:
    """An entry of the transition beside its diagonal: state `to` gains `value` times state `source` in a step."""

    to: int
    source: int
    value: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transition:
    """Transition of the state in one step: (n_x,) the diagonal `decay`, and the entries beside it."""

    decay: FloatArray
    couplings: tuple[Coupling, ...] = ()

    @property
    def matrix(self) -> FloatArray:
        """The transition as an (n_x, n_x) matrix."""
        F = np.diag(self.decay)
        for coupling in self.couplings:
            F[coupling.to, coupling.source] += coupling.value
        return F

    def mean(self, x: FloatArray) -> FloatArray:
        """Return F x of (..., n_x) states."""
        moved = self.decay * x
        for coupling in self.couplings:
            moved[..., coupling.to] += coupling.value * x[..., coupling.source]
        return moved

    def covariance(self, P: FloatArray) -> FloatArray:
        """Return F P F' of (..., n_x, n_x) covariances."""
        moved = self.decay[:, None] * P
        for coupling in self.couplings:
            moved[..., coupling.to, :] += coupling.value * P[..., coupling.source, :]
        both = moved * self.decay
        for coupling in self.couplings:
            both[..., :, coupling.to] += coupling.value * moved[..., :, coupling.source]
        return both


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Measurements of a record under several hypotheses; an axis of 1 in place of n_h is shared by all.

    Attributes
    ----------
    y : (n_samples, n_h, n_rows), NaN where nothing is measured.
    Z : (n_samples, n_h, n_rows, n_shared), loadings of the first states.
    R : (n_samples, n_h, n_rows), variances of the measurements, positive.
    Q : (n_samples, n_h, n_x), variances of what moves the state between a sample and the next.
    extra : (n_samples, n_h, n_rows, n_x - n_shared), loadings of the last states; None where there are none.
    """

    y: FloatArray
    Z: FloatArray
    R: FloatArray
    Q: FloatArray
    extra: FloatArray | None = None

    @property
    def size(self) -> int:
        """Number of hypotheses."""
        sizes: list[int] = [part.shape[1] for part in (self.y, self.Z, self.R, self.Q, self.extra) if part is not None]
        return max(sizes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StackRun:
    """The filter of a stack over a record.

    Attributes
    ----------
    log_density : (n_samples, n_h, n_rows) of each measurement given those before it, NaN where nothing is measured.
    innovation, sd : alike; the innovation over its standard deviation, and that.
    mean : (n_samples, n_h, n_x) of the state, from the measurements up to each sample.
    final_mean, final_covariance : (n_h, n_x) and (n_h, n_x, n_x), of the state after the last sample.
    gains : per sample what the backward pass needs, () where it was not asked for.
    """

    log_density: FloatArray
    innovation: FloatArray
    sd: FloatArray
    mean: FloatArray
    final_mean: FloatArray
    final_covariance: FloatArray
    gains: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]

    @property
    def log_likelihood(self) -> FloatArray:
        """(n_h,), of the whole record."""
        return np.asarray(np.nansum(self.log_density, axis=(0, 2)))


def bounded_log_density(innovation: FloatArray, sd: FloatArray, bound: float = BOUND) -> FloatArray:
    """Return the log densities of innovations over their standard deviations, linear beyond the bound (Huber 1964)."""
    size = np.abs(innovation)
    inside = np.minimum(size, bound)
    return np.asarray(-inside * (size - 0.5 * inside) - np.log(sd) - 0.5 * np.log(2.0 * np.pi))


def filter_stack(
    stack: Stack,
    transition: Transition,
    *,
    mean: FloatArray,
    covariance: FloatArray,
    bound: float = BOUND,
    with_gains: bool = False,
) -> StackRun:
    """Return the filter of every hypothesis of a stack over a record.

    Parameters
    ----------
    mean, covariance : (n_x,) or (n_h, n_x), and with another axis of n_x, of the state before the first measurement.
    bound : standard deviations beyond which an innovation counts linearly; infinite for none.
    with_gains : keeps what `variance_scores` needs.
    """
    n_samples, n_rows, n_h = stack.y.shape[0], stack.y.shape[2], stack.size
    n_x = transition.decay.size
    known = np.isfinite(stack.y)
    y = np.where(known, stack.y, 0.0)
    R = np.where(known, stack.R, 1.0)
    Z = np.where(known[..., None], stack.Z, 0.0)
    extra = None if stack.extra is None else np.where(known[..., None], stack.extra, 0.0)
    n_shared = Z.shape[-1]
    x = np.broadcast_to(mean, (n_h, n_x)).copy()
    P = np.broadcast_to(covariance, (n_h, n_x, n_x)).copy()
    innovation, sd = np.empty((n_samples, n_h, n_rows)), np.empty((n_samples, n_h, n_rows))
    means = np.empty((n_samples, n_h, n_x))
    diagonal, states = np.arange(n_rows), np.arange(n_x)
    gains: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for k in range(n_samples):
        # 1. Innovations and their covariance.
        Zk = Z[k]
        PZ = _loaded(P[..., :n_shared], Zk)
        v = y[k] - _loaded(x[:, None, :n_shared], Zk)[:, 0]
        S = np.matmul(Zk, PZ[:, :n_shared])
        if extra is not None:
            PZ = PZ + np.matmul(P[..., n_shared:], extra[k].swapaxes(-1, -2))
            v = v - np.matmul(extra[k], x[:, n_shared:, None])[..., 0]
            S = np.matmul(Zk, PZ[:, :n_shared]) + np.matmul(extra[k], PZ[:, n_shared:])
        S[:, diagonal, diagonal] += R[k]
        # 2. Each row given those before it.
        factor = np.linalg.cholesky(S)
        inverse: FloatArray = np.asarray(np.linalg.inv(factor), dtype=np.float64)
        e = np.matmul(inverse, v[..., None])[..., 0]
        innovation[k], sd[k] = e, factor[:, diagonal, diagonal]
        beyond = np.flatnonzero((np.abs(e) > bound).any(axis=1))
        if beyond.size:
            factor[beyond], e[beyond], innovation[k, beyond], sd[k, beyond] = _bounded(S[beyond], v[beyond], bound)
            inverse[beyond] = np.linalg.inv(factor[beyond])
        # 3. The state from them, and at the next sample.
        W = np.matmul(inverse, PZ.swapaxes(-1, -2))
        x += np.matmul(e[:, None, :], W)[:, 0]
        P -= np.matmul(W.swapaxes(-1, -2), W)
        means[k] = x
        if with_gains:
            gains.append((inverse, e, W))
        x = transition.mean(x)
        P = transition.covariance(P)
        P[:, states, states] += stack.Q[k]
    known = np.broadcast_to(known, innovation.shape)
    log_density = np.where(known, bounded_log_density(innovation, sd, bound), np.nan)
    return StackRun(
        log_density=log_density,
        innovation=np.where(known, innovation, np.nan),
        sd=np.where(known, sd, np.nan),
        mean=means,
        final_mean=x,
        final_covariance=P,
        gains=tuple(gains),
    )


def _loaded(P: FloatArray, Z: FloatArray) -> FloatArray:
    """Return P Z' of (n_h, n, n_x) and (n_h or 1, n_rows, n_x)."""
    if len(Z) > 1:
        return np.asarray(np.matmul(P, Z.swapaxes(-1, -2)))
    return np.asarray((P.reshape(-1, P.shape[-1]) @ Z[0].T).reshape(*P.shape[:-1], -1))


def _bounded(S: FloatArray, v: FloatArray, bound: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return Cholesky factors with the variances of innovations beyond the bound enlarged, row after row.

    Returns
    -------
    factor, e : (n, n_rows, n_rows) and (n, n_rows), so that the state is moved by no more than the bound.
    innovation, sd : (n, n_rows), as they were before their variances were enlarged.
    """
    S, v = S.copy(), v.copy()
    n_rows = v.shape[1]
    factor, e = np.zeros_like(S), np.empty_like(v)
    innovation, sd = np.empty_like(v), np.empty_like(v)
    for i in range(n_rows):
        sd[:, i] = np.sqrt(S[:, i, i])
        innovation[:, i] = v[:, i] / sd[:, i]
        wider = sd[:, i] * np.maximum(np.abs(innovation[:, i]) / bound, 1.0)
        column = S[:, i:, i] / wider[:, None]
        column[:, 0] = wider
        e[:, i] = v[:, i] / wider
        factor[:, i:, i] = column
        v[:, i + 1 :] -= column[:, 1:] * e[:, i, None]
        S[:, i + 1 :, i + 1 :] -= column[:, 1:, None] * column[:, None, 1:]
    return factor, e, innovation, sd


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VarianceScores:
    """Derivatives of the log-likelihood by variances.

    Attributes
    ----------
    R, R_information : (n_samples, n_h, n_rows), the score of each variance of a measurement, and half the squared
        expectation of what it is the difference of: its Fisher information as if scores were independent.
    Q, Q_information : (n_samples, n_h, n_x), alike of what moves the state after each sample.
    """

    R: FloatArray
    R_information: FloatArray
    Q: FloatArray
    Q_information: FloatArray


def variance_scores(stack: Stack, transition: Transition, run: StackRun) -> VarianceScores:
    """Return the score of every variance of a stack that was filtered with its gains (Koopman and Shephard 1992).

    Where innovations are beyond the bound, the score is that of the record with their variances enlarged.
    """
    n_samples, n_h, n_rows = run.innovation.shape
    n_x = transition.decay.size
    F = transition.matrix
    known = np.isfinite(stack.y)
    Z = stack.Z if stack.extra is None else _joined(stack)
    r, N = np.zeros((n_h, n_x)), np.zeros((n_h, n_x, n_x))
    R, R_information = np.zeros((n_samples, n_h, n_rows)), np.zeros((n_samples, n_h, n_rows))
    Q, Q_information = np.zeros((n_samples, n_h, n_x)), np.zeros((n_samples, n_h, n_x))
    rows, states = np.arange(n_rows), np.arange(n_x)
    for k in range(n_samples - 1, -1, -1):
        inverse, e, W = run.gains[k]
        Q[k] = 0.5 * (r**2 - N[:, states, states])
        Q_information[k] = 0.5 * N[:, states, states] ** 2
        Zk = np.where(known[k][..., None], Z[k], 0.0)
        r, N = r @ F, F.T @ N @ F
        K = np.matmul(inverse.swapaxes(-1, -2), W)  # transposed, (n_h, n_rows, n_x)
        S_inverse = np.matmul(inverse.swapaxes(-1, -2), inverse)
        u = np.matmul(e[:, None, :], inverse)[:, 0] - np.matmul(K, r[..., None])[..., 0]
        M = S_inverse + np.matmul(np.matmul(K, N), K.swapaxes(-1, -2))
        spread = M[:, rows, rows]
        R[k] = np.where(known[k], 0.5 * (u**2 - spread), 0.0)
        R_information[k] = np.where(known[k], 0.5 * spread**2, 0.0)
        r = r + np.matmul(u[:, None, :], Zk)[:, 0]
        left = np.eye(n_x) - np.matmul(K.swapaxes(-1, -2), Zk)
        N = np.matmul(np.matmul(Zk.swapaxes(-1, -2), S_inverse), Zk) + np.matmul(
            np.matmul(left.swapaxes(-1, -2), N), left
        )
    return VarianceScores(R=R, R_information=R_information, Q=Q, Q_information=Q_information)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JumpScores:
    """What a record says of a jump of the state before each sample.

    Attributes
    ----------
    r : (n_samples, n_x), the derivative of the log-likelihood by the jump, at none.
    N : (n_samples, n_x, n_x), its covariance, and the information on the jump.
    """

    r: FloatArray
    N: FloatArray

    def gain(self, sd: FloatArray) -> FloatArray:
        """Return (n_samples,) log-likelihoods that jumps of (n_x,) standard deviations in all states are worth."""
        moved = np.flatnonzero(sd)
        r, N = self.r[:, moved] * sd[moved], self.N[:, moved[:, None], moved] * np.outer(sd[moved], sd[moved])
        S = np.eye(moved.size) + N
        solved = np.linalg.solve(S, r[..., None])[..., 0]
        return np.asarray(0.5 * np.sum(r * solved, axis=1) - 0.5 * np.linalg.slogdet(S)[1])


def jump_scores(
    Z: FloatArray,
    gains: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    transition: Transition,
    after: JumpScores | None = None,
) -> JumpScores:
    """Return what a record says of jumps of the state, from one backward pass (de Jong and Penzer 1998).

    Parameters
    ----------
    Z : (n_samples, n_rows, n_x) loadings, 0 where nothing is measured.
    gains : of one hypothesis of a filter's run, without the axis of the stack.
    after : of the record that follows; None where none does.
    """
    n_samples, n_x = Z.shape[0], Z.shape[2]
    F = transition.matrix
    r, N = np.zeros((n_samples + 1, n_x)), np.zeros((n_samples + 1, n_x, n_x))
    if after is not None:
        r[-1], N[-1] = after.r[0], after.N[0]
    for k in range(n_samples - 1, -1, -1):
        inverse, e, W = gains[k]
        loaded = inverse @ Z[k]
        L = F - F @ W.T @ loaded
        r[k] = L.T @ r[k + 1] + loaded.T @ e
        N[k] = L.T @ N[k + 1] @ L + loaded.T @ loaded
    return JumpScores(r=r[:-1], N=N[:-1])


def _joined(stack: Stack) -> FloatArray:
    """Return the loadings of all states."""
    assert stack.extra is not None
    shape = np.broadcast_shapes(stack.Z.shape[:3], stack.extra.shape[:3])
    parts = (stack.Z, stack.extra)
    return np.concatenate([np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)
