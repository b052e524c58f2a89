"""Whiteness of a prediction error: null distributions, effective rows, robust spread."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal, stats

from bfi_cli.kernels import whiteness
from bfi_cli.kernels.whiteness import autocorrelation, effective_rows, exceedances, ljung_box, robust_sd

LEVEL = 1e-6


def white(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def coloured(n: int, pole: float, seed: int = 0) -> np.ndarray:
    return signal.lfilter([1.0], [1.0, -pole], white(n, seed))


def test_autocorrelation_of_a_first_order_process_is_geometric():
    n, pole = 100_000, 0.7
    r = autocorrelation(coloured(n, pole) + 40.0, 5)
    # Bartlett's variance is at most (1 + pole^2) / (1 - pole^2) / n.
    bound = stats.norm.isf(LEVEL / 10) * np.sqrt((1 + pole**2) / (1 - pole**2) / n)
    np.testing.assert_allclose(r, pole ** np.arange(1, 6), atol=bound)


@pytest.mark.parametrize("n", [300, 777, 2048])
def test_autocorrelation_by_transforms_of_blocks_is_that_of_shifts(monkeypatch: pytest.MonkeyPatch, n: int):
    e = coloured(n, 0.7)
    shifted = autocorrelation(e, 123)
    monkeypatch.setattr(whiteness, "MOST_PRODUCTS", 1)
    monkeypatch.setattr(whiteness, "BLOCK", 100)
    np.testing.assert_allclose(autocorrelation(e, 123), shifted, rtol=0, atol=1e-13)


def test_autocorrelation_does_not_depend_on_level_or_scale():
    e = coloured(500, 0.4)
    np.testing.assert_allclose(autocorrelation(1e-6 * e + 3e-6, 8), autocorrelation(e, 8), atol=1e-10)
    np.testing.assert_array_equal(autocorrelation(np.full(20, 2.0), 3), 0.0)


def test_ljung_box_is_uniform_under_the_null_and_small_otherwise():
    p = [ljung_box(white(400, seed), 20, 0) for seed in range(400)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert max(ljung_box(coloured(400, 0.5, seed), 20, 0) for seed in range(20)) < 1e-4


def test_ljung_box_is_the_sum_of_its_paper():
    e, n, statistic = coloured(30, 0.2, 5), 30, 0.0
    e = e - e.mean()
    for lag in range(1, 7):
        r = sum(e[k] * e[k - lag] for k in range(lag, n)) / sum(e**2)
        statistic += n * (n + 2) * r**2 / (n - lag)
    assert ljung_box(e, 6, 2) == pytest.approx(stats.chi2.sf(statistic, 4), rel=1e-12)


def test_ljung_box_takes_the_fitted_lags_off_the_degrees_of_freedom():
    p = []
    for seed in range(300):
        y = coloured(800, 0.6, seed)
        X = np.column_stack([y[3 - lag : -lag] for lag in (1, 2, 3)])
        p.append(ljung_box(y[3:] - X @ np.linalg.lstsq(X, y[3:], rcond=None)[0], 10, 3))
    assert stats.kstest(p, "uniform").pvalue > 1e-3


def test_ljung_box_of_a_zero_residual_is_no_evidence():
    assert ljung_box(np.zeros(50), 10, 2) == 1.0


@pytest.mark.parametrize("n", [50, 300, 3000])
def test_white_noise_counts_nearly_all_its_rows(n):
    """A lag's excess over 4/n has mean 0.08/n, so sqrt(n) lags cost little."""
    share = [effective_rows(white(2 * n, seed).reshape(n, 2)) / n for seed in range(40)]
    assert max(share) <= 1.0
    assert np.mean(share) > 0.85


def test_a_predictable_residual_counts_for_few_rows():
    n = 1000
    leftover = np.sin(0.05 * np.arange(n))[:, None]
    assert effective_rows(leftover) < 0.1 * n
    assert effective_rows(coloured(n, 0.95)[:, None]) < 0.3 * n


def test_effective_rows_of_a_first_order_process_are_bartletts():
    n, pole = 100_000, 0.8
    assert effective_rows(coloured(n, pole)[:, None]) == pytest.approx(n * (1 - pole**2) / (1 + pole**2), rel=0.05)


def test_the_worst_output_counts():
    n = 500
    both = np.column_stack([white(n), np.sin(0.05 * np.arange(n))])
    assert effective_rows(both) == effective_rows(both[:, 1:])


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_few_rows_are_no_division_by_zero(n):
    assert 0.0 < effective_rows(np.zeros((n, 1))) <= n
    assert 0.0 < effective_rows(white(n)[:, None]) <= n


def test_robust_sd_is_the_sd_of_a_gaussian_and_does_not_see_outliers():
    e = 3.0 * white(40_000) + 7.0
    # The asymptotic efficiency of the median absolute deviation is 37 %.
    bound = stats.norm.isf(LEVEL) * np.sqrt(1.0 / (2 * 0.37 * e.size))
    assert robust_sd(e) == pytest.approx(3.0, rel=bound)
    spoilt = e.copy()
    spoilt[:200] = 1e9
    assert robust_sd(spoilt) == pytest.approx(3.0, rel=0.02)


def test_exceedances_are_the_steps_and_nothing_else():
    e = 0.1 * white(2000)
    e[[7, 900]] += [2.0, -2.0]
    np.testing.assert_array_equal(exceedances(e), [7, 900])
    np.testing.assert_array_equal(exceedances(-1e6 * e), [7, 900])
    assert exceedances(e, sigmas=1.0).size > 400


def test_a_residual_without_spread_has_no_exceedances():
    assert exceedances(np.zeros(30)).size == 0


def test_inputs_are_left_alone():
    e = white(100) + 1.0
    copy = e.copy()
    autocorrelation(e, 5), robust_sd(e), exceedances(e), effective_rows(e[:, None])
    np.testing.assert_array_equal(e, copy)
