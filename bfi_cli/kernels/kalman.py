"""The Kalman filter of a linear time-invariant system, and several of them weighed by Bayes.

The system is x(k+1) = A x(k) + B u(k) + w(k), y(k) = C x(k) + D u(k) + v(k), w and v white with covariances Q and R.
The Joseph form of the update keeps the covariance positive for any gain.

Probabilities of models live in logarithms: an innovation of a thousand standard deviations costs a log-likelihood of
-5e5, far beyond what a product of densities survives. Two filters make the double-model adaptive estimator, algorithm 1
of the thesis (Lu et al. 2015, 2016): one without a fault, one with the fault as a further state, and after every sample
the less probable of the two restarts from the other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from . import FloatArray
from .compiled import lapack

# An eigenvalue of Q below zero by less than this share of its largest entry is round-off: 1e4 times the precision of a
# double.
NEGATIVE = 1e-12
# The two filters of the double model.
NO_FAULT, FAULT = 0, 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gaussian:
    """A state estimate: mean (n_x,) and covariance (n_x, n_x)."""

    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateSpace:
    """A discrete-time system with noise.

    Attributes
    ----------
    A, B, C, D : (n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u).
    Q : (n_x, n_x) covariance of the process noise of one step, positive semidefinite.
    R : (n_y, n_y) covariance of the measurement noise, positive definite.

    Raises
    ------
    ValueError : shapes disagree, or Q or R is no covariance.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    Q: FloatArray
    R: FloatArray

    def __post_init__(self) -> None:
        n_x, n_u, n_y = len(self.A), self.B.shape[-1], len(self.C)
        wanted = {"A": (n_x, n_x), "B": (n_x, n_u), "C": (n_y, n_x), "D": (n_y, n_u), "Q": (n_x, n_x), "R": (n_y, n_y)}
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected {shape}")
        if not _smallest_eigenvalue(self.Q) >= -NEGATIVE * np.abs(self.Q).max(initial=0.0):
            raise ValueError("Q must be symmetric and positive semidefinite")
        if not _smallest_eigenvalue(self.R) > 0:
            raise ValueError("R must be symmetric and positive definite")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Filtered(Gaussian):
    """The estimate after a measurement; of a record, all with a first axis of samples, row k knowing y(0) to y(k).

    Attributes
    ----------
    innovation, innovation_covariance : (n_y,) and (n_y, n_y), the measurement minus its prediction.
    log_likelihood : (), of the measurement given what came before.
    """

    innovation: FloatArray
    innovation_covariance: FloatArray
    log_likelihood: FloatArray


Systems = tuple[StateSpace, ...]
Estimates = tuple[Gaussian, ...]
Exchange = Callable[[Systems, tuple[Filtered, ...], int], tuple[Systems, Estimates]]


def predict(posterior: Gaussian, system: StateSpace, *, u: FloatArray) -> Gaussian:
    """Return the estimate of the next state, `u` (n_u,) being the input of the present sample."""
    A = system.A
    return Gaussian(mean=A @ posterior.mean + system.B @ u, covariance=A @ posterior.covariance @ A.T + system.Q)


def update(prior: Gaussian, system: StateSpace, *, y: FloatArray, u: FloatArray) -> Filtered:
    """Correct the predicted state `prior` with a measurement `y`, (n_y,); `u`, (n_u,), is the input with it.

    Raises
    ------
    ValueError : the covariance of the innovation is not positive definite, since that of the prior is no covariance.
    """
    C, P = system.C, prior.covariance
    innovation = y - C @ prior.mean - system.D @ u
    S = C @ P @ C.T + system.R
    factor, failed = lapack.dpotrf(S, lower=True)
    if failed:
        raise ValueError("the covariance of the innovation is not positive definite")
    gain = lapack.dpotrs(factor, C @ P, lower=True)[0].T
    kept = np.eye(len(P)) - gain @ C
    covariance = kept @ P @ kept.T + gain @ system.R @ gain.T
    white = lapack.dtrtrs(factor, innovation, lower=True)[0]
    log_det = 2.0 * float(np.log(factor.diagonal()).sum())
    return Filtered(
        mean=prior.mean + gain @ innovation,
        covariance=(covariance + covariance.T) / 2.0,
        innovation=innovation,
        innovation_covariance=S,
        log_likelihood=-0.5 * (len(y) * np.log(2.0 * np.pi) + log_det + white @ white),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BankRun:
    """A bank of filters over a record: every filter's own run, and (n_samples, n_filters) probabilities."""

    filters: tuple[Filtered, ...]
    probability: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomWalk:
    """The fault as a state.

    Attributes
    ----------
    value, variance : that it is given when the filter with the fault restarts.
    step_variance : process noise per step, its least value with a `window`.
    window : number of samples over which that noise is adapted: the excess of the mean squared innovation of the faulty
        channel over its expected variance is attributed to the fault. None for no adaptation.
    """

    value: float = 1e-3
    variance: float = 100.0
    step_variance: float = 0.0
    window: int | None = None


def update_probabilities(log_probability: FloatArray, log_likelihood: FloatArray, *, floor: float = 0.0) -> FloatArray:
    """Return log-probabilities after a sample, by Bayes.

    Parameters
    ----------
    log_probability, log_likelihood : (n_models,); any finite log-likelihood will do.
    floor : probabilities are raised to it and all divided by their sum, so that no model is given up for good.
    """
    joint = log_probability + log_likelihood
    log_p = joint - joint.max()
    log_p -= np.log(np.exp(log_p).sum())
    if floor > 0.0:
        log_p = np.maximum(log_p, np.log(floor))
        log_p -= np.log(np.exp(log_p).sum())
    return np.asarray(log_p)


def filter_bank(
    systems: Systems,
    y: FloatArray,
    u: FloatArray,
    *,
    initial: Estimates,
    probability: Sequence[float],
    floor: float = 0.001,
    exchange: Exchange | None = None,
) -> BankRun:
    """Run filters on the same record and weigh them.

    Parameters
    ----------
    systems : one per filter, of the same outputs and inputs.
    y, u : (n_samples, n_y) and (n_samples, n_u).
    initial : per filter, of the state at sample 0, before y(0).
    probability : (n_filters,), before y(0), positive.
    floor : see `update_probabilities`.
    exchange : from the systems, their steps and the index of the most probable one to the systems and the estimates
        the next sample starts from; by default the filters know nothing of each other.
    """
    log_p = np.log(np.asarray(probability, dtype=np.float64))
    priors, steps, history = initial, [], []
    for y_k, u_k in zip(y, u, strict=True):
        now = tuple(update(prior, system, y=y_k, u=u_k) for prior, system in zip(priors, systems, strict=True))
        log_p = update_probabilities(log_p, np.array([step.log_likelihood for step in now]), floor=floor)
        steps.append(now)
        history.append(log_p)
        posteriors: Estimates = now
        if exchange is not None:
            systems, posteriors = exchange(systems, now, int(np.argmax(log_p)))
        priors = tuple(predict(p, system, u=u_k) for p, system in zip(posteriors, systems, strict=True))
    names = [each.name for each in fields(Filtered)]
    runs = (
        Filtered(**{name: np.array([getattr(step, name) for step in filter_steps]) for name in names})
        for filter_steps in zip(*steps, strict=True)
    )
    return BankRun(filters=tuple(runs), probability=np.exp(np.array(history)))


def mixture(mean: FloatArray, covariance: FloatArray, probability: FloatArray) -> Gaussian:
    """Return mean and covariance of a mixture, sample by sample.

    Parameters
    ----------
    mean, covariance, probability : (n_samples, n_models, n), (n_samples, n_models, n, n), (n_samples, n_models).
    """
    centre = np.einsum("km,kmi->ki", probability, mean)
    off = mean - centre[:, None]
    spread = covariance + off[..., :, None] * off[..., None, :]
    return Gaussian(mean=centre, covariance=np.einsum("km,kmij->kij", probability, spread))


def augment(system: StateSpace, channel: int, *, fault_variance: float = 0.0) -> StateSpace:
    """Return `system` with a last state, the additive fault of output `channel`.

    The fault is a random walk whose steps have the variance `fault_variance`, a constant where that is 0.
    """
    n_u, n_y = system.B.shape[1], len(system.C)
    return replace(
        system,
        A=_bordered(system.A, 1.0),
        B=np.vstack([system.B, np.zeros((1, n_u))]),
        C=np.hstack([system.C, np.eye(n_y)[:, [channel]]]),
        Q=_bordered(system.Q, fault_variance),
    )


def restart(state: Gaussian, fault: RandomWalk) -> Gaussian:
    """Return the estimate of state and fault that takes over `state`, with a fault that restarts, uncorrelated."""
    return Gaussian(mean=np.append(state.mean, fault.value), covariance=_bordered(state.covariance, fault.variance))


class SelectiveReinitialisation:
    """The exchange of the double model: the less probable filter restarts from the more probable one.

    Parameters
    ----------
    fault : restarts when the filter without it wins.
    channel : the faulty output.
    """

    def __init__(self, fault: RandomWalk, *, channel: int) -> None:
        self.fault = fault
        self.channel = channel
        self.squares: deque[float] = deque(maxlen=fault.window or 0)
        self.excess = 0.0

    def __call__(self, systems: Systems, steps: tuple[Filtered, ...], winner: int) -> tuple[Systems, Estimates]:
        """Return what the next sample starts from; `winner` is `NO_FAULT` or `FAULT`."""
        free, faulty = steps
        if self.squares.maxlen:
            c, system, step = self.channel, systems[FAULT], steps[FAULT]
            self.squares.append(float(step.innovation[c]) ** 2)
            expected = float(step.innovation_covariance[c, c]) - self.excess
            least = max(0.0, float(system.Q[-1, -1]) - self.excess)
            excess = max(0.0, float(np.mean(self.squares)) - expected)
            if excess != self.excess:
                systems = systems[NO_FAULT], replace(system, Q=_bordered(system.Q[:-1, :-1], least + excess))
            self.excess = excess
        if winner == NO_FAULT:
            return systems, (free, restart(free, self.fault))
        return systems, (Gaussian(mean=faulty.mean[:-1], covariance=faulty.covariance[:-1, :-1]), faulty)


def double_model(
    system: StateSpace,
    y: FloatArray,
    u: FloatArray,
    *,
    channel: int,
    initial: Gaussian,
    prior_fault: float = 0.05,
    floor: float = 0.001,
    fault: RandomWalk | None = None,
) -> BankRun:
    """Run the double-model adaptive estimator for a fault of one output (algorithm 1 of the thesis).

    Parameters
    ----------
    system : without a fault.
    y, u : (n_samples, n_y) and (n_samples, n_u).
    channel : the output that may be faulty.
    initial : of the state at sample 0, before y(0).
    prior_fault : probability of a fault before y(0).
    floor : of both probabilities.
    fault : how it walks, and restarts after every sample that the filter without it wins; it starts so too.

    Returns
    -------
    BankRun with the filters `NO_FAULT` and `FAULT`; the last state of the latter is the fault.
    """
    fault = fault or RandomWalk()
    return filter_bank(
        (system, augment(system, channel, fault_variance=fault.step_variance)),
        y,
        u,
        initial=(initial, restart(initial, fault)),
        probability=(1.0 - prior_fault, prior_fault),
        floor=floor,
        exchange=SelectiveReinitialisation(fault, channel=channel),
    )


def state_and_fault(run: BankRun) -> Gaussian:
    """Return state and fault of a double model, the mixture of both hypotheses; the fault is 0 in that without one."""
    free, faulty = run.filters[NO_FAULT], run.filters[FAULT]
    mean = np.stack([np.pad(free.mean, ((0, 0), (0, 1))), faulty.mean], axis=1)
    covariance = np.stack([np.pad(free.covariance, ((0, 0), (0, 1), (0, 1))), faulty.covariance], axis=1)
    return mixture(mean, covariance, run.probability)


def _bordered(M: FloatArray, corner: float) -> FloatArray:
    """Return `M` with one more row and column, zero but for the corner."""
    bordered = np.zeros((len(M) + 1, len(M) + 1))
    bordered[:-1, :-1] = M
    bordered[-1, -1] = corner
    return bordered


def _smallest_eigenvalue(M: FloatArray) -> float:
    """Return it for a finite symmetric matrix, NaN for any other."""
    # Equal entries, the usual case, are seen in a tenth of the time; a filter that adapts asks at every sample.
    symmetric = np.array_equal(M, M.T) or np.allclose(M, M.T, rtol=1e-9, atol=0.0)
    return float(np.linalg.eigvalsh(M)[0]) if symmetric else float("nan")
