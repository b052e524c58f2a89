"""The filter of a stack of hypotheses: its density by another road, its score by differences, and its bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from bfi_cli.kernels import FloatArray
from bfi_cli.kernels.bounded_filter import (
    ChangeScores,
    Coupling,
    Stack,
    StackRun,
    Transition,
    bounded_log_density,
    change_scores,
    filter_stack,
    variance_scores,
)

N_SAMPLES, N_ROWS, N_X = 7, 3, 4
TRANSITION = Transition(decay=np.array([1.0, 0.9, 0.7, 1.0]), couplings=(Coupling(to=0, source=1, value=0.5),))
MEAN = np.array([1.0, -0.5, 0.2, 0.0])
COVARIANCE = np.diag([2.0, 1.0, 0.5, 0.3])


def _stack(n_h: int = 1, seed: int = 1) -> Stack:
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(N_SAMPLES, n_h, N_ROWS))
    y[2, :, 1] = np.nan
    y[4] = np.nan
    return Stack(
        y=y,
        Z=rng.normal(size=(N_SAMPLES, 1, N_ROWS, N_X)),
        R=rng.uniform(0.2, 1.0, size=(N_SAMPLES, 1, N_ROWS)),
        Q=rng.uniform(0.0, 0.5, size=(N_SAMPLES, 1, N_X)),
    )


def _filtered(stack: Stack, bound: float = np.inf) -> StackRun:
    return filter_stack(stack, TRANSITION, mean=MEAN, covariance=COVARIANCE, bound=bound, with_gains=True)


def _joint_log_density(stack: Stack) -> float:
    """The density of all measurements at once, from their joint mean and covariance."""
    F, n = TRANSITION.matrix, N_SAMPLES
    mean, covariance = np.empty(n * N_X), np.zeros((n * N_X, n * N_X))
    x, P = MEAN, COVARIANCE
    for k in range(n):
        mean[k * N_X : (k + 1) * N_X] = x
        cross = P
        for j in range(k, n):
            covariance[k * N_X : (k + 1) * N_X, j * N_X : (j + 1) * N_X] = cross
            covariance[j * N_X : (j + 1) * N_X, k * N_X : (k + 1) * N_X] = cross.T
            cross = cross @ F.T
        x, P = F @ x, F @ P @ F.T + np.diag(stack.Q[k, 0])
    Z = np.zeros((n * N_ROWS, n * N_X))
    for k in range(n):
        Z[k * N_ROWS : (k + 1) * N_ROWS, k * N_X : (k + 1) * N_X] = stack.Z[k, 0]
    y, known = stack.y[:, 0].ravel(), np.isfinite(stack.y[:, 0].ravel())
    S = Z @ covariance @ Z.T + np.diag(stack.R[:, 0].ravel())
    return float(multivariate_normal(Z[known] @ mean, S[np.ix_(known, known)]).logpdf(y[known]))


def test_densities_of_rows_add_up_to_the_joint_one() -> None:
    stack = _stack()
    assert _filtered(stack).log_likelihood[0] == pytest.approx(_joint_log_density(stack), rel=1e-12)


def test_a_missing_row_is_no_row() -> None:
    """A row of which every measurement is missing may as well have any loading."""
    stack = _stack()
    y = stack.y.copy()
    y[:, :, 2] = np.nan
    Z = stack.Z.copy()
    Z[:, :, 2] = 1e6
    run, other = _filtered(replace(stack, y=y)), _filtered(replace(stack, y=y, Z=Z))
    assert np.array_equal(run.final_mean, other.final_mean)
    assert np.isnan(run.log_density[:, :, 2]).all()


def test_a_stack_is_its_hypotheses_by_themselves() -> None:
    stack = _stack(n_h=3)
    run = _filtered(stack, bound=1.0)
    for h in range(3):
        alone = _filtered(replace(stack, y=stack.y[:, [h]]), bound=1.0)
        assert np.allclose(run.log_density[:, h], alone.log_density[:, 0], rtol=1e-12, atol=0.0, equal_nan=True)
        assert np.allclose(run.final_covariance[h], alone.final_covariance[0], rtol=1e-12)


def test_states_with_loadings_of_their_own_are_states() -> None:
    stack = _stack(n_h=2)
    split = replace(stack, Z=stack.Z[..., :3], extra=np.broadcast_to(stack.Z[..., 3:], (N_SAMPLES, 2, N_ROWS, 1)))
    run, other = _filtered(stack), _filtered(split)
    assert np.allclose(run.log_density, other.log_density, rtol=1e-12, equal_nan=True)
    scores = (variance_scores(one, TRANSITION, each).Q for one, each in ((stack, run), (split, other)))
    assert np.allclose(*scores, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", ["R", "Q"])
def test_scores_are_the_differences_of_the_likelihood(name: str) -> None:
    stack = _stack()
    scores: FloatArray = getattr(variance_scores(stack, TRANSITION, _filtered(stack)), name)
    variances: FloatArray = getattr(stack, name)
    step = 1e-5
    for index in np.ndindex(*variances.shape):
        ends = []
        for sign in (1.0, -1.0):
            moved = variances.copy()
            moved[index] += sign * step
            ends.append(_filtered(replace(stack, **{name: moved})).log_likelihood[0])
        assert scores[index] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-6)


def test_scores_of_a_bounded_record_are_those_with_the_enlarged_variances() -> None:
    """A gross error of one row enlarges that row's variance until its innovation is at the bound."""
    stack = _stack()
    y = stack.y.copy()
    y[3, 0, 0] = 50.0
    gross = replace(stack, y=y)
    run = _filtered(gross, bound=3.0)
    R = stack.R.copy()
    R[3, 0, 0] += run.sd[3, 0, 0] ** 2 * ((run.innovation[3, 0, 0] / 3.0) ** 2 - 1.0)
    other = _filtered(replace(gross, R=R))
    assert abs(run.innovation[3, 0, 0]) > 3.0
    assert np.allclose(run.mean, other.mean, rtol=1e-9)
    mine, theirs = (variance_scores(gross, TRANSITION, one).Q for one in (run, other))
    assert np.allclose(mine, theirs, rtol=1e-9, atol=1e-12)


def test_a_gross_error_costs_its_size_and_no_more() -> None:
    near, far = (bounded_log_density(np.array([size]), np.array([2.0]), 3.0)[0] for size in (3.0, 103.0))
    normal = -0.5 * 9.0 - np.log(2.0) - 0.5 * np.log(2.0 * np.pi)
    assert near == pytest.approx(normal, rel=1e-12)
    assert near - far == pytest.approx(3.0 * 100.0, rel=1e-12)


TIME_CONSTANT = 2.5


def _change_scores(
    stack: Stack, run: StackRun, part: slice = slice(None), after: ChangeScores | None = None
) -> ChangeScores:
    Z = np.where(np.isfinite(stack.y[:, 0])[..., None], stack.Z[:, 0], 0.0)
    assert run.gains is not None
    first, end, _ = part.indices(N_SAMPLES)
    gains = run.gains.between(first, end, 0)
    return change_scores(Z[part], gains, TRANSITION, after, time_constant=TIME_CONSTANT)


def test_a_jump_is_worth_what_its_variance_gains() -> None:
    stack, sd = _stack(), np.array([0.8, 0.0, 1.5, 0.0])
    run = _filtered(stack)
    gains = _change_scores(stack, run).jump.gain(sd)
    for k in range(1, N_SAMPLES):
        Q = stack.Q.copy()
        Q[k - 1, 0] += sd**2
        jumped = _filtered(replace(stack, Q=Q)).log_likelihood[0]
        assert gains[k] == pytest.approx(jumped - run.log_likelihood[0], rel=1e-9, abs=1e-12)


def test_a_change_of_one_state_is_worth_the_same_alone() -> None:
    jump, sd = _change_scores(_stack(), _filtered(_stack())).jump, np.array([0.8, 0.3, 1.5, 0.1])
    each = np.stack([jump.gain(alone) for alone in np.diag(sd)], axis=1)
    np.testing.assert_allclose(jump.gains_alone(sd), each, rtol=1e-12, atol=1e-14)


def test_a_part_that_is_known_not_to_move_is_scored_without_a_filter_of_its_own() -> None:
    """What a jump of it is worth is that of a filter that holds it, with no variance but there."""
    rng, stack = np.random.default_rng(2), _stack()
    loads, sd = rng.normal(size=(N_SAMPLES, 1, N_ROWS, 1)), 1.7
    run = _filtered(stack)
    assert run.gains is not None
    Z = np.where(np.isfinite(stack.y[:, 0])[..., None], np.concatenate([stack.Z, loads], axis=-1)[:, 0], 0.0)
    gains, transition = run.gains.with_constants(1), TRANSITION.with_constants(1)
    jump = change_scores(Z, gains, transition, time_constant=TIME_CONSTANT).jump.gain(np.append(np.zeros(N_X), sd))
    held = replace(stack, Z=np.concatenate([stack.Z, loads], axis=-1), Q=np.pad(stack.Q, [*2 * [(0, 0)], (0, 1)]))
    for k in range(1, N_SAMPLES):
        Q = held.Q.copy()
        Q[k - 1, 0, -1] = sd**2
        start = {"mean": np.append(MEAN, 0.0), "covariance": np.pad(COVARIANCE, (0, 1))}
        moved = filter_stack(replace(held, Q=Q), transition, bound=np.inf, **start)
        assert jump[k] == pytest.approx(moved.log_likelihood[0] - run.log_likelihood[0], rel=1e-9, abs=1e-12)


def test_scores_of_a_gradual_change_are_the_derivatives_of_the_likelihood_by_it() -> None:
    """The likelihood is quadratic in the change, so that its differences are exact."""
    stack, left = _stack(), np.exp(-1.0 / TIME_CONSTANT)
    run = _filtered(stack)
    gradual = _change_scores(stack, run).gradual
    for k in range(N_SAMPLES):

        def likelihood(change: FloatArray, first: int = k) -> float:
            y, x = stack.y.copy(), np.zeros(N_X)
            for t in range(first, N_SAMPLES):
                x = TRANSITION.matrix @ x + (1.0 - left) * left ** (t - first) * change
                y[t, 0] -= stack.Z[t, 0] @ x
            return float(_filtered(replace(stack, y=y)).log_likelihood[0])

        none, axes = likelihood(np.zeros(N_X)), np.eye(N_X)
        slope = [(likelihood(axis) - likelihood(-axis)) / 2.0 for axis in axes]
        assert gradual.r[k] == pytest.approx(slope, rel=1e-9, abs=1e-12)
        curved = [[none - likelihood(a) - likelihood(b) + likelihood(a + b) for b in axes] for a in axes]
        assert np.allclose(gradual.N[k], -np.array(curved), rtol=1e-9, atol=1e-12)


def test_what_a_change_is_worth_goes_on_over_the_stretches_of_a_record() -> None:
    stack = _stack()
    run = _filtered(stack)
    whole, last = _change_scores(stack, run), _change_scores(stack, run, slice(3, None))
    first = _change_scores(stack, run, slice(3), last)
    for kind in ("jump", "gradual"):
        early, late, both = (getattr(scores, kind) for scores in (first, last, whole))
        assert np.allclose(np.concatenate([early.r, late.r]), both.r, rtol=1e-12)
        assert np.allclose(np.concatenate([early.N, late.N]), both.N, rtol=1e-12)
