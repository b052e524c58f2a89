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

from dataclasses import dataclass, replace

import numpy as np

from . import FloatArray
from .compiled import lapack

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

    def with_constants(self, n: int) -> Transition:
        """Return the transition of a state with n more parts that stay as they are."""
        return replace(self, decay=np.append(self.decay, np.ones(n)))


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
class Gains:
    """What the backward pass needs of a filter's run, with the enlarged variances.

    Attributes
    ----------
    inverse : (n_samples, n_h, n_rows, n_rows) of the Cholesky factors of the innovations' covariances.
    e : (n_samples, n_h, n_rows) innovations over their standard deviations.
    W : (n_samples, n_h, n_rows, n_x) by which they move the state.
    """

    inverse: FloatArray
    e: FloatArray
    W: FloatArray

    @classmethod
    def empty(cls, shape: tuple[int, ...], n_x: int) -> Gains:
        """Return those to be filled in of innovations, (n_samples, n_h, n_rows)."""
        n_rows = shape[-1]
        return cls(inverse=np.empty((*shape, n_rows)), e=np.empty(shape), W=np.empty((*shape, n_x)))

    def between(self, first: int, end: int, hypothesis: int) -> Gains:
        """Return those of some samples of one hypothesis."""
        part = slice(first, end), slice(hypothesis, hypothesis + 1)
        return Gains(inverse=self.inverse[part], e=self.e[part], W=self.W[part])

    def with_constants(self, n: int) -> Gains:
        """Return those of a state with n more parts, which are known and so are never moved."""
        return replace(self, W=np.pad(self.W, [*3 * [(0, 0)], (0, n)]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StackRun:
    """The filter of a stack over a record.

    Attributes
    ----------
    log_density : (n_samples, n_h, n_rows) of each measurement given those before it, NaN where nothing is measured.
    innovation, sd : alike; the innovation over its standard deviation, and that.
    mean : (n_samples, n_h, n_x) of the state, from the measurements up to each sample.
    final_mean, final_covariance : (n_h, n_x) and (n_h, n_x, n_x), of the state after the last sample.
    gains : None where they were not asked for.
    """

    log_density: FloatArray
    innovation: FloatArray
    sd: FloatArray
    mean: FloatArray
    final_mean: FloatArray
    final_covariance: FloatArray
    gains: Gains | None

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
    decay, F = transition.decay, transition.matrix
    n_x, shrunk = decay.size, np.vstack([np.outer(decay, decay), decay])
    coupled = np.array(sorted({coupling.to for coupling in transition.couplings}), dtype=np.intp)
    F_coupled = F[coupled].T
    known = np.isfinite(stack.y)
    y, R = np.where(known, stack.y, 0.0), np.where(known, stack.R, 1.0)
    Z = np.where(known[..., None], stack.Z, 0.0)
    extra = None if stack.extra is None else np.where(known[..., None], stack.extra, 0.0)
    n_shared = Z.shape[-1]
    # Covariance and mean in one array, the mean below, so that one product serves both.
    state = np.empty((n_h, n_x + 1, n_x))
    P, x = state[:, :n_x], state[:, n_x]
    P[:], x[:] = covariance, mean
    variances = state.reshape(n_h, -1)[:, : n_x * n_x : n_x + 1]
    innovation, sd = np.empty((2, n_samples, n_h, n_rows))
    means = np.empty((n_samples, n_h, n_x))
    gains = Gains.empty(innovation.shape, n_x) if with_gains else None
    measured = _diagonal(S := np.empty((n_h, n_rows, n_rows)))
    for k, Zk in enumerate(Z):
        # 1. Innovations and their covariance.
        loaded = _loaded(state[..., :n_shared], Zk)
        if extra is not None:
            loaded += np.matmul(state[..., n_shared:], extra[k].swapaxes(-1, -2))
        PZ, v = loaded[:, :n_x], y[k] - loaded[:, n_x]
        np.matmul(Zk, PZ[:, :n_shared], out=S)
        if extra is not None:
            S += np.matmul(extra[k], PZ[:, n_shared:])
        measured += R[k]
        # 2. Each row given those before it.
        inverse, e, sd[k] = _white(S, v)
        innovation[k] = e
        if np.count_nonzero(is_beyond := np.abs(e) > bound):
            some = np.flatnonzero(is_beyond.any(axis=1))
            white = inverse[some], e[some], sd[k, some]
            inverse[some], e[some], innovation[k, some], sd[k, some] = _bounded(S[some], v[some], white, bound)
        # 3. The state from them, and at the next sample.
        W = np.matmul(inverse, PZ.swapaxes(-1, -2))
        x += np.matmul(e[:, None, :], W)[:, 0]
        P -= np.matmul(W.swapaxes(-1, -2), W)
        means[k] = x
        if gains is not None:
            gains.inverse[k], gains.e[k], gains.W[k] = inverse, e, W
        # F P F' and F x, where F is diagonal but for a few rows.
        columns = np.matmul(state, F_coupled)
        columns[:, :n_x] = np.matmul(F, columns[:, :n_x])
        state *= shrunk
        state[:, :, coupled], state[:, coupled] = columns, columns[:, :n_x].swapaxes(-1, -2)
        variances += stack.Q[k]
    known = np.broadcast_to(known, innovation.shape)
    log_density = np.where(known, bounded_log_density(innovation, sd, bound), np.nan)
    return StackRun(
        log_density=log_density,
        innovation=np.where(known, innovation, np.nan),
        sd=np.where(known, sd, np.nan),
        mean=means,
        final_mean=x.copy(),
        final_covariance=P.copy(),
        gains=gains,
    )


def _diagonal(matrices: FloatArray) -> FloatArray:
    """Return (n_h, n) the diagonals of contiguous (n_h, n, n) matrices, to be changed in place."""
    return matrices.reshape(len(matrices), -1)[:, :: matrices.shape[-1] + 1]


def _loaded(P: FloatArray, Z: FloatArray) -> FloatArray:
    """Return P Z' of (n_h, n, n_x) and (n_h or 1, n_rows, n_x)."""
    if len(Z) == len(P):
        return np.asarray(np.matmul(P, Z.swapaxes(-1, -2)))
    return np.asarray((P.reshape(-1, P.shape[-1]) @ Z[0].T).reshape(*P.shape[:-1], -1))


def _white(S: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the inverses of the Cholesky factors of covariances, and innovations over their sds, with these."""
    inverse, sd = np.empty(S.shape), np.empty(v.shape)
    for h, covariance in enumerate(S):
        factor, failed = lapack.dpotrf(covariance, lower=True)
        if failed:
            raise np.linalg.LinAlgError("a covariance of innovations is not positive definite")
        sd[h] = factor.diagonal()
        inverse[h] = lapack.dtrtri(factor, lower=True, overwrite_c=True)[0]
    return inverse, np.matmul(inverse, v[..., None])[..., 0], sd


def _bounded(
    S: FloatArray, v: FloatArray, white: tuple[FloatArray, FloatArray, FloatArray], bound: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what `_white` does with the variances of innovations beyond the bound enlarged, row after row.

    Parameters
    ----------
    S : overwritten; white : of `_white` as they are.

    Returns
    -------
    inverse, e : (n, n_rows, n_rows) and (n, n_rows), so that the state is moved by no more than the bound.
    innovation, sd : (n, n_rows), as they were before their variances were enlarged.
    """
    inverse, e, deviation = white
    innovation, sd, enlarged = np.empty_like(v), np.empty_like(v), np.zeros(v.shape, dtype=bool)
    while True:
        innovation, sd = np.where(enlarged, innovation, e), np.where(enlarged, sd, deviation)
        beyond = (np.abs(e) > bound) & ~enlarged
        (which,) = np.nonzero(beyond.any(axis=1))
        if not which.size:
            return inverse, e, innovation, sd
        row = beyond[which].argmax(axis=1)  # those before it stay as they are
        enlarged[which, row] = True
        S[which, row, row] += sd[which, row] ** 2 * ((innovation[which, row] / bound) ** 2 - 1.0)
        inverse, e, deviation = _white(S, v)


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
    assert run.gains is not None
    gains, F, known = run.gains, transition.matrix, np.isfinite(stack.y)
    Z = np.where(known[..., None], stack.Z if stack.extra is None else _joined(stack), 0.0)
    r, N = _backward(Z, gains, transition)
    spread = np.diagonal(N[1:], axis1=-2, axis2=-1)
    Q, Q_information = 0.5 * (r[1:] ** 2 - spread), 0.5 * spread**2
    inverse = gains.inverse.swapaxes(-1, -2)
    K = inverse @ gains.W @ F.T  # transposed, (n_samples, n_h, n_rows, n_x)
    u = ((inverse @ gains.e[..., None]) - K @ r[1:, ..., None])[..., 0]
    spread = np.sum(inverse**2, axis=-1) + np.einsum("...ij,...ij->...i", K @ N[1:], K)
    return VarianceScores(
        R=np.where(known, 0.5 * (u**2 - spread), 0.0),
        R_information=np.where(known, 0.5 * spread**2, 0.0),
        Q=Q,
        Q_information=Q_information,
    )


def _backward(
    Z: FloatArray, gains: Gains, transition: Transition, after: JumpScores | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of the log-likelihood by the state before each sample, and its covariance (de Jong 1989).

    Parameters
    ----------
    Z : (n_samples, n_h, n_rows, n_x) loadings, 0 where nothing is measured; an axis of 1 in place of n_h is shared.
    after : of the record that follows; None where none does.

    Returns
    -------
    r, N : (n_samples + 1, n_h, n_x) and with another axis of n_x; the last are of what follows.
    """
    loaded = gains.inverse @ Z
    F, (n_samples, n_h, _, n_x) = transition.matrix, loaded.shape
    moves = F @ gains.W.swapaxes(-1, -2)
    r, N = np.empty((n_samples + 1, n_h, n_x, 1)), np.empty((n_samples + 1, n_h, n_x, n_x))
    np.matmul(loaded.swapaxes(-1, -2), gains.e[..., None], out=r[:-1])
    np.matmul(loaded.swapaxes(-1, -2), loaded, out=N[:-1])
    r[-1, :, :, 0], N[-1] = (0.0, 0.0) if after is None else (after.r[0], after.N[0])
    for k in range(n_samples - 1, -1, -1):
        L = F - moves[k] @ loaded[k]
        transposed = L.swapaxes(-1, -2)
        r[k] += transposed @ r[k + 1]
        N[k] += transposed @ (N[k + 1] @ L)
    return r[..., 0], N


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JumpScores:
    """What a record says of a change of the state from before each sample on.

    Attributes
    ----------
    r : (n_samples, n_x), the derivative of the log-likelihood by the change, at none.
    N : (n_samples, n_x, n_x), its covariance, and the information on the change.
    """

    r: FloatArray
    N: FloatArray

    def gain(self, sd: FloatArray) -> FloatArray:
        """Return (n_samples,) log-likelihoods that changes of (n_x,) standard deviations of all states are worth."""
        moved = np.flatnonzero(sd)
        r, N = self.r[:, moved] * sd[moved], self.N[:, moved[:, None], moved] * np.outer(sd[moved], sd[moved])
        S = np.eye(moved.size) + N
        solved = np.linalg.solve(S, r[..., None])[..., 0]
        return np.asarray(0.5 * np.sum(r * solved, axis=1) - 0.5 * np.linalg.slogdet(S)[1])

    def gains_alone(self, sd: FloatArray) -> FloatArray:
        """Return (n_samples, n_x) what `gain` does for a change of each state alone."""
        r, S = self.r * sd, 1.0 + np.diagonal(self.N, axis1=1, axis2=2) * sd**2
        return np.asarray(0.5 * r * (r / S) - 0.5 * np.log(S))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChangeScores:
    """What a record says of a jump of the state, and of a change that takes a while.

    Attributes
    ----------
    jump, gradual : of a jump before each sample, and of a change that begins there and nears its end exponentially.
    between : (n_samples, n_x, n_x), the covariance of the derivatives by the two.
    """

    jump: JumpScores
    gradual: JumpScores
    between: FloatArray


def change_scores(
    Z: FloatArray, gains: Gains, transition: Transition, after: ChangeScores | None = None, *, time_constant: float
) -> ChangeScores:
    """Return what a record says of changes of the state, from one backward pass (de Jong and Penzer 1998).

    A change that is gradual moves the state before each sample by a share of what is left of it, so that its derivative
    is the mean of those by jumps there, weighted by that share.

    Parameters
    ----------
    Z : (n_samples, n_rows, n_x) loadings, 0 where nothing is measured.
    gains : of one hypothesis of a filter's run.
    after : of the record that follows; None where none does.
    time_constant : of a gradual change, in samples.
    """
    r, N = _backward(Z[:, None], gains, transition, None if after is None else after.jump)
    r, N = r[:, 0], N[:, 0]
    left = float(np.exp(-1.0 / time_constant))
    moved = 1.0 - left
    mean, spread, between = moved * r, moved**2 * N, moved * N
    mean[-1], spread[-1], between[-1] = (
        (0.0, 0.0, 0.0) if after is None else (after.gradual.r[0], after.gradual.N[0], after.between[0])
    )
    L = transition.matrix - (transition.matrix @ gains.W[:, 0].swapaxes(-1, -2)) @ (gains.inverse[:, 0] @ Z)
    for k in range(len(r) - 2, -1, -1):
        later = L[k].T @ between[k + 1]
        mean[k] += left * mean[k + 1]
        spread[k] += left**2 * spread[k + 1] + moved * left * (later + later.T)
        between[k] += left * later
    return ChangeScores(
        jump=JumpScores(r=r[:-1], N=N[:-1]), gradual=JumpScores(r=mean[:-1], N=spread[:-1]), between=between[:-1]
    )


def _joined(stack: Stack) -> FloatArray:
    """Return the loadings of all states."""
    assert stack.extra is not None
    shape = np.broadcast_shapes(stack.Z.shape[:3], stack.extra.shape[:3])
    parts = (stack.Z, stack.extra)
    return np.concatenate([np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)
