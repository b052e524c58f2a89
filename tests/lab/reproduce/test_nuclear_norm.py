"""The nuclear-norm solver: closed forms, optimality conditions, shrinkage."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.kernels.progress import Termination
from bfi_cli.lab.reproduce.fir import largest_penalty, nuclear_least_squares, soft_threshold

P1, P2, N = 4, 6, 60


def singular_values(found) -> np.ndarray:
    return np.linalg.svd(found.X, compute_uv=False)


def problem(seed: int = 0, *, condition: float = 30.0, noise: float = 0.1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, y, X) with X of rank 1 and covariates of the given condition number."""
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((N, P1 * P2)))[0]
    V = np.linalg.qr(rng.standard_normal((P1 * P2, P1 * P2)))[0]
    A = ((U * np.geomspace(1.0, 1.0 / condition, P1 * P2)) @ V.T).reshape(N, P1, P2)
    X = np.outer(rng.standard_normal(P1), rng.standard_normal(P2))
    return A, np.tensordot(A, X) + noise * rng.standard_normal(N), X


def objective(A: np.ndarray, y: np.ndarray, X: np.ndarray, penalty: float) -> float:
    return float(0.5 * np.sum((y - np.tensordot(A, X)) ** 2) + penalty * np.linalg.norm(X, "nuc"))


@pytest.mark.parametrize("fraction", [0.01, 0.3, 0.9])
def test_orthonormal_covariates_soft_threshold_the_unpenalised_answer(fraction):
    A, y, _ = problem(condition=1.0)
    free = np.tensordot(y, A, axes=1)
    penalty = fraction * largest_penalty(A, y)
    found = nuclear_least_squares(A, y, penalty=penalty, tolerance=1e-12)
    np.testing.assert_allclose(found.X, soft_threshold(free, penalty), rtol=0, atol=1e-5)
    expected = np.maximum(np.linalg.svd(free, compute_uv=False) - penalty, 0.0)
    np.testing.assert_allclose(singular_values(found), expected, rtol=0, atol=1e-5)


@given(seed=st.integers(0, 10_000), exponent=st.floats(-4.0, -0.1), condition=st.sampled_from([1.0, 30.0, 1e3]))
def test_the_gradient_is_a_subgradient_of_the_nuclear_norm(seed, exponent, condition):
    A, y, _ = problem(seed, condition=condition)
    penalty = 10.0**exponent * largest_penalty(A, y)
    found = nuclear_least_squares(A, y, penalty=penalty, tolerance=1e-11)
    gradient = np.tensordot(y - np.tensordot(A, found.X), A, axes=1) / penalty
    assert found.termination is Termination.CONVERGED
    assert np.linalg.norm(gradient, 2) <= 1.0 + 1e-2
    assert np.sum(gradient * found.X) == pytest.approx(np.linalg.norm(found.X, "nuc"), rel=1e-2)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), direction=st.integers(0, 10_000))
def test_no_other_matrix_has_a_smaller_objective_than_the_gap_allows(seed, direction):
    A, y, truth = problem(seed)
    penalty = 0.05 * largest_penalty(A, y)
    found = nuclear_least_squares(A, y, penalty=penalty, tolerance=1e-9)
    best = objective(A, y, found.X, penalty)
    allowed = found.gap * 0.5 * float(y @ y) + 1e-12
    away = np.random.default_rng(direction).standard_normal((P1, P2))
    for other in (truth, 0.0 * truth, found.X + 1e-3 * away, found.X + away):
        assert objective(A, y, other, penalty) >= best - allowed


def test_soft_threshold_is_the_proximal_map_of_the_nuclear_norm():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((5, 3))
    kept = soft_threshold(X, 0.7)
    value = 0.5 * np.sum((kept - X) ** 2) + 0.7 * np.linalg.norm(kept, "nuc")
    for _ in range(50):
        other = kept + 0.1 * rng.standard_normal((5, 3))
        assert 0.5 * np.sum((other - X) ** 2) + 0.7 * np.linalg.norm(other, "nuc") > value


def test_the_answer_vanishes_from_the_largest_penalty_on_and_not_before():
    A, y, _ = problem()
    largest = largest_penalty(A, y)
    assert not nuclear_least_squares(A, y, penalty=1.001 * largest).X.any()
    assert nuclear_least_squares(A, y, penalty=0.99 * largest).X.any()


def test_a_smaller_penalty_fits_better_and_shrinks_less():
    A, y, truth = problem(noise=0.0)
    largest = largest_penalty(A, y)
    solved = [nuclear_least_squares(A, y, penalty=f * largest) for f in (0.3, 0.1, 0.01, 1e-3, 1e-5)]
    misfits = [np.linalg.norm(y - np.tensordot(A, found.X)) for found in solved]
    norms = [singular_values(found).sum() for found in solved]
    assert misfits == sorted(misfits, reverse=True)
    assert norms == sorted(norms)
    assert norms[-1] < np.linalg.norm(truth, "nuc")
    np.testing.assert_allclose(solved[-1].X, truth, rtol=0, atol=1e-3 * np.linalg.norm(truth))


def test_low_rank_truth_gives_an_answer_of_low_rank_under_noise():
    A, y, _ = problem(condition=3.0, noise=0.02)
    found = nuclear_least_squares(A, y, penalty=0.2 * largest_penalty(A, y))
    assert np.count_nonzero(singular_values(found) > 1e-12 * singular_values(found)[0]) == 1


def test_fewer_samples_than_entries_still_recover_a_matrix_of_rank_one():
    rng = np.random.default_rng(2)
    A, X = rng.standard_normal((70, 10, 10)), np.outer(rng.standard_normal(10), rng.standard_normal(10))
    y = np.tensordot(A, X)
    found = nuclear_least_squares(A, y, penalty=1e-5 * largest_penalty(A, y))
    np.testing.assert_allclose(found.X, X, rtol=0, atol=1e-3 * np.linalg.norm(X))


def test_zero_data_give_zero_at_once():
    A, y, _ = problem()
    found = nuclear_least_squares(A, 0.0 * y, penalty=1.0)
    assert not found.X.any()
    assert found.termination is Termination.CONVERGED


def test_the_iteration_limit_is_reported_not_raised():
    A, y, _ = problem(condition=1e3)
    found = nuclear_least_squares(A, y, penalty=1e-4 * largest_penalty(A, y), max_iterations=3)
    assert (found.iterations, found.termination) == (3, Termination.MAX_ITERATIONS)
    assert found.gap > 1e-10


@pytest.mark.parametrize(
    ("rows", "penalty", "message"), [(N - 1, 1.0, "A must be"), (N, 0.0, "must be positive"), (N, np.nan, "positive")]
)
def test_what_makes_no_problem_is_refused(rows, penalty, message):
    A, y, _ = problem()
    with pytest.raises(ValueError, match=message):
        nuclear_least_squares(A, y[:rows], penalty=penalty)


def test_balanced_residuals_need_few_iterations():
    """850 in all; with a constant penalty parameter, or a price not rescaled with it, 5990 and 1260."""
    iterations = 0
    for condition in (1.0, 30.0, 1000.0):
        A, y, _ = problem(condition=condition)
        for fraction in (0.001, 0.1, 0.5):
            iterations += nuclear_least_squares(A, y, penalty=fraction * largest_penalty(A, y)).iterations
    assert iterations < 1050
