"""MFDDFD: the optimality of the group lasso, its limits, time courses, and its agreement with a general solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.kernels.mfddfd import (
    BlockRegression,
    best_within,
    block_regression,
    largest_weight,
    solve_blocks,
    solve_on_support,
    standardised,
    time_courses,
)
from bfi_cli.kernels.model_selection import Penalty
from bfi_cli.kernels.variable_projection import ProjectedRegression

PRESENT = (1, 4)
N, ORDER = 300, 2


def problem_of(seed: int, *, n_outputs: int = 2, noise: float = 0.02, channels: int = 1) -> ProjectedRegression:
    """Return a record whose states, not its sensors, two of six square waves drive, in directions drawn at random.

    Parameters
    ----------
    channels : on how many outputs the dictionary has every wave, one entry each.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(N)
    waves = np.sign(np.sin(2.0 * np.pi * k[:, None] / np.array([17.0, 19.0, 23.0, 29.0, 31.0, 37.0]) + 0.3))
    E = rng.standard_normal((n_outputs, len(PRESENT)))
    A = 0.6 * np.eye(n_outputs) + 0.1 * rng.standard_normal((n_outputs, n_outputs))
    x = np.zeros((N, n_outputs))
    for i in range(1, N):
        x[i] = A @ x[i - 1] + E @ waves[i - 1, PRESENT] + noise * rng.standard_normal(n_outputs)
    theta = np.tile(waves, channels)
    lagged_theta, lagged_y = (np.stack([z[ORDER - i : N - i] for i in range(ORDER + 1)], axis=1) for z in (theta, x))
    signals = tuple((output, 6 * output + j) for output in range(channels) for j in range(6))
    return ProjectedRegression(theta=lagged_theta, y=lagged_y, signals=signals, n_rows=N - ORDER, n_base=0, floor=1e-9)


def blocks_of(seed: int, **settings: float) -> BlockRegression:
    problem = problem_of(seed, **settings)
    return block_regression(problem, time_courses(problem, 1.0 - 1e-7))


PENALTY = Penalty(n_rows=N - ORDER, n_effective=float(N - ORDER), n_candidates=6, evidence=4.6)


@pytest.mark.parametrize("n_outputs", [1, 2, 3])
@pytest.mark.parametrize("share", [0.5, 0.05, 0.002])
def test_at_the_solution_every_gradient_balances_the_norm_of_its_block(n_outputs: int, share: float):
    blocks = blocks_of(0, n_outputs=n_outputs)
    weight = share * largest_weight(blocks)
    found = solve_blocks(blocks, weight, tolerance=1e-10)
    assert found.converged
    error = blocks.Y - blocks.A @ found.W
    norms, gradient = blocks.norms(found.W), blocks.A.T @ error
    assert found.objective == pytest.approx(0.5 * np.sum(error**2) + weight * norms.sum(), rel=1e-12)
    assert blocks.norms(gradient).max() <= weight * (1.0 + 1e-6)
    for j in found.support:
        own = blocks.block_of == j
        np.testing.assert_allclose(gradient[own], weight * found.W[own] / norms[j], atol=1e-6 * weight)


def test_the_largest_weight_is_where_the_first_block_appears():
    blocks = blocks_of(1)
    top = largest_weight(blocks)
    assert solve_blocks(blocks, 1.0001 * top).support == ()
    assert len(solve_blocks(blocks, 0.999 * top).support) == 1


def test_a_start_changes_the_way_and_not_the_solution():
    blocks = blocks_of(2)
    weight = 0.01 * largest_weight(blocks)
    warm = solve_blocks(blocks, weight, solve_blocks(blocks, 2.0 * weight).W, tolerance=1e-9)
    cold = solve_blocks(blocks, weight, tolerance=1e-9)
    np.testing.assert_allclose(warm.W, cold.W, atol=1e-6 * np.abs(cold.W).max())


def test_outputs_in_another_basis_have_the_same_blocks_in_it():
    """The Frobenius norm does not change with an orthogonal basis of the outputs."""
    blocks = blocks_of(3)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((2, 2)))[0]
    turned = BlockRegression(
        A=blocks.A,
        Y=blocks.Y @ turn,
        block_of=blocks.block_of,
        n_rows=blocks.n_rows,
        n_free=blocks.n_free,
        floor=blocks.floor,
    )
    weight = 0.05 * largest_weight(blocks)
    ours, theirs = (solve_blocks(one, weight, tolerance=1e-10) for one in (blocks, turned))
    assert theirs.support == ours.support
    np.testing.assert_allclose(theirs.W, ours.W @ turn, atol=1e-7 * np.abs(ours.W).max())


def test_blocks_are_shrunk_and_the_least_squares_on_the_support_is_not():
    blocks = blocks_of(4)
    weight = 0.3 * largest_weight(blocks)
    found = solve_blocks(blocks, weight)
    fit = solve_on_support(blocks, found.support, PENALTY)
    for effect, j in zip(fit.effects, fit.support, strict=True):
        own = blocks.block_of == j
        solved = np.linalg.norm(blocks.A[:, own] @ found.W[own]) / np.sqrt(blocks.n_rows)
        assert solved < 0.95 * np.linalg.norm(effect)


@pytest.mark.parametrize("noise", [0.02, 0.0])
@pytest.mark.parametrize("n_outputs", [1, 2, 3])
def test_from_a_support_with_all_blocks_those_that_act_are_left(n_outputs: int, noise: float):
    blocks = blocks_of(5, n_outputs=n_outputs, noise=noise)
    assert best_within(blocks, range(6), PENALTY).support == PRESENT


def test_entries_with_one_time_course_are_one_block():
    problem = problem_of(6, channels=2)
    courses = time_courses(problem, 1.0 - 1e-7)
    assert courses == tuple((j, 6 + j) for j in range(6))
    np.testing.assert_array_equal(block_regression(problem, courses).A, blocks_of(6).A)


@pytest.mark.slow
def test_the_objective_is_that_of_a_general_solver():
    cp = pytest.importorskip("cvxpy")
    blocks = blocks_of(7)
    for share in (0.3, 0.03):
        weight = share * largest_weight(blocks)
        W = cp.Variable((blocks.A.shape[1], blocks.Y.shape[1]))
        norms = [cp.norm(W[np.flatnonzero(blocks.block_of == j)], "fro") for j in range(blocks.n_blocks)]
        cost = 0.5 * cp.sum_squares(blocks.Y - blocks.A @ W) + weight * sum(norms)
        general = cp.Problem(cp.Minimize(cost)).solve(solver="CLARABEL")
        assert solve_blocks(blocks, weight).objective == pytest.approx(general, rel=1e-4)


def test_a_standardised_block_charges_what_it_adds_whatever_its_columns():
    blocks, rng = blocks_of(8), np.random.default_rng(8)
    mixed = blocks.A.copy()
    for j in range(blocks.n_blocks):
        own = blocks.block_of == j
        mixed[:, own] = mixed[:, own] @ rng.standard_normal((own.sum(), own.sum())) * 10.0**j
    other = replace(blocks, A=mixed)
    ours, theirs = standardised(blocks), standardised(other)
    weight = 0.1 * largest_weight(ours)
    found, again = (solve_blocks(one, weight, tolerance=1e-10) for one in (ours, theirs))
    assert again.support == found.support
    np.testing.assert_allclose(theirs.A @ again.W, ours.A @ found.W, atol=1e-6 * np.abs(ours.A @ found.W).max())
