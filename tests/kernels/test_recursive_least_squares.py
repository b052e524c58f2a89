"""Recursive residuals: against a fresh solution per row, their sum of squares, and what they tell of the noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special, stats

from bfi_cli.kernels.recursive_least_squares import predictive_score, recursive_residuals, running_covariances

START = 20


def regression(n: int = 200, *, p: int = 4, q: int = 2, noise: float = 1.0, seed: int = 0):
    """Return X, Y = X theta + noise, theta."""
    rng = np.random.default_rng(seed)
    X, theta = rng.standard_normal((n, p)), rng.standard_normal((p, q))
    return X, X @ theta + noise * rng.standard_normal((n, q)), theta


@pytest.mark.parametrize("prior", [0.1, np.array([0.1, 0.2, 3.0, 20.0])], ids=["one", "each"])
@pytest.mark.parametrize("forgetting", [1.0, 0.98])
def test_every_row_is_predicted_as_least_squares_over_the_rows_before_it_would(forgetting, prior):
    X, Y, _ = regression(60)
    found = recursive_residuals(X, Y, start=START, forgetting=forgetting, prior=prior)
    for i in range(START, 60):
        weight = np.sqrt(forgetting ** np.r_[np.full(START, i - START + 1.0), np.arange(i - START, 0, -1)])
        before = forgetting ** (0.5 * (i - START + 1))
        rows = np.vstack([before * np.diag(np.full(4, prior)), weight[:, None] * X[:i]])
        theta = np.linalg.lstsq(rows, np.vstack([np.zeros((4, 2)), weight[:, None] * Y[:i]]), rcond=None)[0]
        leverage = X[i] @ np.linalg.solve(rows.T @ rows, X[i])
        np.testing.assert_allclose(found.coefficients[i - START], theta, atol=1e-10)
        np.testing.assert_allclose(found.leverage[i - START], leverage, rtol=1e-9)
        np.testing.assert_allclose(found.residual[i - START], (Y[i] - X[i] @ theta) / np.sqrt(1 + leverage), atol=1e-10)


def test_their_squares_add_up_to_the_residual_sum_of_squares_of_all_rows():
    """Brown, Durbin and Evans (1975), lemma 3."""
    X, Y, _ = regression()
    found = recursive_residuals(X, Y, start=START, prior=1e-9)
    rest = Y - X @ np.linalg.lstsq(X, Y, rcond=None)[0]
    np.testing.assert_allclose(found.scatter + found.residual.T @ found.residual, rest.T @ rest, rtol=1e-9)
    assert found.freedom == START - 4


def test_a_regression_without_noise_is_predicted_to_round_off():
    X, Y, theta = regression(noise=0.0)
    found = recursive_residuals(X, Y, start=START, prior=1e-9)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.coefficients[-1], theta, atol=1e-12)


def test_residuals_are_white_and_of_the_noise_s_covariance_from_the_first_row_on():
    """The first rows, of high leverage, alone: 400 records, bounds of four standard deviations."""
    first = []
    for seed in range(400):
        X, Y, _ = regression(10, q=1, seed=seed)
        first.append(recursive_residuals(X, Y, start=5).residual[:, 0])
    w = np.array(first)
    bound = 4.0 / np.sqrt(400)
    assert np.abs(w.T @ w / 400 - np.eye(5)).max() < np.sqrt(2.0) * bound


def test_they_are_white_where_coefficients_are_as_uncertain_as_was_said_however_many_they_are():
    """More coefficients than rows, drawn from their prior: 400 records, bounds of four standard deviations."""
    rng = np.random.default_rng(3)
    p, rows, prior = 12, 10, 2.0
    first = []
    for _ in range(400):
        X, theta = rng.standard_normal((rows, p)), rng.standard_normal((p, 1)) / prior
        found = recursive_residuals(X, X @ theta + rng.standard_normal((rows, 1)), start=4, prior=prior)
        first.append(np.append(found.residual[:, 0], found.scatter[0, 0] / found.freedom))
    w = np.array(first)
    assert found.freedom == 4
    assert np.abs(w[:, :-1].T @ w[:, :-1] / 400 - np.eye(6)).max() < 4.0 * np.sqrt(2.0 / 400)
    assert np.mean(w[:, -1]) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 4.0 / 400))


def test_a_regressor_that_has_not_moved_makes_the_prediction_uncertain_and_not_singular():
    X, Y, _ = regression()
    X[:100, 3] = 0.0
    found = recursive_residuals(X, Y, start=START)
    assert np.isfinite(found.residual).all()
    assert found.leverage[100 - START] > 1e3 * found.leverage[: 100 - START].max()
    assert found.leverage[101 - START :].max() < 1e3


def test_the_covariance_of_a_row_knows_nothing_of_its_window():
    X, Y, _ = regression()
    found = recursive_residuals(X, Y, start=START)
    changed = Y.copy()
    changed[150:] += 100.0
    other = recursive_residuals(X, changed, start=START)
    before, freedom = running_covariances(found, window=10, recent=0)
    after, _ = running_covariances(other, window=10, recent=0)
    row = 150 - START
    np.testing.assert_array_equal(before[: row + 10], after[: row + 10])
    assert after[row + 10, 0, 0] > 2.0 * before[row + 10, 0, 0]
    np.testing.assert_array_equal(freedom, START - 4 + np.maximum(np.arange(len(before)) - 9, 0))


def test_a_rough_stretch_enlarges_the_variance_and_a_calm_one_does_not_reduce_it():
    X, Y, theta = regression(400)
    rough = Y.copy()
    rough[200:300] += 4.0 * (rough - X @ theta)[200:300]
    found = recursive_residuals(X, rough, start=START)
    plain, _ = running_covariances(found, window=1, recent=0)
    enlarged, _ = running_covariances(found, window=1, recent=60)
    diagonal = np.diagonal(enlarged / plain, axis1=1, axis2=2)
    assert diagonal.min() >= 1.0 - 1e-12
    assert diagonal[280 - START].min() > 1.5
    np.testing.assert_allclose(diagonal[375 - START], 1.0, rtol=1e-12)


def test_a_patch_of_gusts_enlarges_the_variance_at_once_and_the_rows_of_a_step_do_not():
    X, Y, theta = regression(400)
    disturbed = Y.copy()
    disturbed[200:206] += 5.0 * (Y - X @ theta).std(axis=0)
    disturbed[300:] += 4.0 * (Y - X @ theta)[300:]
    found = recursive_residuals(X, disturbed, start=START)
    plain, _ = running_covariances(found, window=60, recent=0)
    enlarged, _ = running_covariances(found, window=60, recent=0, patch=40)
    ratio = np.diagonal(enlarged / plain, axis1=1, axis2=2)
    assert ratio.min() >= 1.0 - 1e-12
    assert ratio[200 - START : 300 - START].max() < 3.0
    assert ratio[345 - START].min() > 6.0
    np.testing.assert_array_equal(running_covariances(found, window=60, recent=0, patch=0)[0], plain)


def test_the_score_is_the_mean_log_density_of_students_t():
    X, Y, _ = regression(60, seed=3)
    errors = recursive_residuals(X, Y, start=8)
    scatter, total = errors.scatter.copy(), 0.0
    for i, (residual, leverage) in enumerate(zip(errors.residual, errors.leverage, strict=True)):
        freedom = errors.freedom + i
        shape = (scatter / freedom + 1e-6 * np.eye(2)) * (1.0 + leverage)
        error = residual * np.sqrt(1.0 + leverage)
        constant = special.gammaln((freedom + 2) / 2) - special.gammaln(freedom / 2) - np.log(freedom * np.pi)
        total += stats.multivariate_t.logpdf(error, shape=shape, df=freedom) - constant
        scatter += np.outer(residual, residual)
    assert predictive_score(errors) == pytest.approx(total / len(errors.residual), rel=1e-9)


def test_the_score_prefers_the_regressors_the_data_were_made_of():
    X, Y, _ = regression(300, noise=0.1)
    scores = {p: predictive_score(recursive_residuals(X[:, :p], Y, start=START)) for p in (2, 4)}
    more = np.hstack([X, np.random.default_rng(9).standard_normal((300, 12))])
    assert scores[4] > scores[2] + 1.0
    assert scores[4] > predictive_score(recursive_residuals(more, Y, start=START))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"start": 4}, "between 4 regressors and 200 rows of X and 200 of Y, got 4"),
        ({"start": 200}, "got 200"),
        ({"start": 50, "forgetting": 0.0}, r"forgetting must lie in \(0, 1\], got 0"),
        ({"start": 50, "forgetting": 1.1}, "got 1.1"),
    ],
)
def test_what_cannot_be_used_is_refused(options, text):
    X, Y, _ = regression()
    with pytest.raises(ValueError, match=text):
        recursive_residuals(X, Y, **options)


def test_rows_that_do_not_match_are_refused():
    X, Y, _ = regression()
    with pytest.raises(ValueError, match="200 rows of X and 199 of Y"):
        recursive_residuals(X, Y[:-1], start=START)
