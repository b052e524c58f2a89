"""Parity residuals: the left null space, the pattern of a step two ways, and where the chi-square drops most."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from bfi_cli.kernels.lagged import lagged
from bfi_cli.kernels.parity import largest_drops, past_basis, step_response
from bfi_cli.kernels.recursive_least_squares import recursive_residuals

flown = runpy.run_path(str(Path(__file__).with_name("made_linear.py")))["flown"]
LAGS, START, WINDOW, ONSET = 3, 150, 20, 250


def parity(y, *, basis):
    """Return the recursive residuals of y on a constant and its past within the basis."""
    past = lagged(y, range(1, LAGS + 1)) @ basis
    X = np.hstack([np.ones((len(past), 1)), past])
    return recursive_residuals(X, y[LAGS:], start=START)


def noisy(n: int = 290, seed: int = 0):
    """Return three outputs of two slow motions in units of their white noise."""
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(n)
    motion = np.column_stack([np.sin(t), np.cos(0.7 * t)])
    return 20.0 * motion @ rng.standard_normal((2, 3)) + rng.standard_normal((n, 3))


def drops(y):
    basis, _ = past_basis(y[:START], lags=LAGS)
    return largest_drops(parity(y, basis=basis), basis, window=WINDOW)


@cache
def stepped(channel: int, size: float):
    """Return the drops of a record with a step, and the row it begins in."""
    y = noisy()
    y[ONSET:, channel] += size
    return drops(y), ONSET - LAGS - START


def test_the_basis_is_orthonormal_and_spans_the_stack_of_a_motion_without_noise():
    """Two sinusoids span four directions and a mean, however many outputs and lags are stacked."""
    t = 0.1 * np.arange(200)
    y = np.column_stack([np.sin(t), np.cos(t)]) @ np.random.default_rng(0).standard_normal((2, 4)) + 5.0
    V, spread = past_basis(y, lags=5)
    stack = lagged(y, range(1, 6))
    centred = stack - stack.mean(axis=0)
    assert V.shape == (20, 2)
    np.testing.assert_allclose(V.T @ V, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(centred @ V @ V.T, centred, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.mean((centred @ V) ** 2, axis=0)), spread, rtol=1e-12)


def test_directions_that_move_less_than_the_edge_and_beyond_the_rank_are_left_out():
    y = noisy()
    full, spread = past_basis(y, lags=LAGS)
    assert full.shape == (9, 9)
    assert (np.diff(spread) <= 0.0).all()
    np.testing.assert_array_equal(past_basis(y, lags=LAGS, rank=2)[0], full[:, :2])
    edge = 0.5 * (spread[3] + spread[4])
    np.testing.assert_array_equal(past_basis(y, lags=LAGS, edge=edge)[1], spread[:4])


def test_no_past_is_refused():
    with pytest.raises(ValueError, match="3 samples have no past of 3 lags"):
        past_basis(np.zeros((3, 2)), lags=3)


@pytest.mark.parametrize("rows", [1, 2, 4, 30])
def test_the_step_response_is_what_a_step_adds_to_the_prediction_errors(rows):
    K = np.random.default_rng(1).standard_normal((LAGS, 3, 3))
    y = flown(100)[0]

    def errors(y):
        return y[LAGS:] - lagged(y, range(1, LAGS + 1)) @ K.reshape(-1, 3)

    found = step_response(K, rows)
    for channel in range(3):
        stepped = y.copy()
        stepped[40:, channel] += 1.0
        added = (errors(stepped) - errors(y))[40 - LAGS :][:rows]
        np.testing.assert_allclose(found[:, :, channel], added, atol=1e-12)


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_step_is_attributed_to_its_channel_and_its_row_and_has_the_order_of_its_size(channel):
    found, row = stepped(channel, 20.0)
    healthy = [k for k in range(3) if k != channel]
    assert found.deviate[:row].max() < 5.5
    for after in (0, 5, 15):
        amplitude = found.deviate[row + after]
        assert amplitude[channel] > 8.0
        assert amplitude[channel] > 1.1 * amplitude[healthy].max()
        assert found.age[row + after, channel] in (after, after + 1)
    assert 0.7 < found.size[row + 10, channel] / 20.0 < 2.0


def plain_drops(errors, basis, i):
    """Return deviate, age and size of each channel at row i, by one least squares per onset in the window."""
    w, q = errors.residual, errors.residual.shape[1]
    before = max(i - WINDOW + 1, 0)
    freedom = errors.freedom + before
    scatter = errors.scatter + sum((np.outer(r, r) for r in w[:before]), np.zeros((q, q)))
    root = np.linalg.cholesky(np.linalg.inv(scatter / freedom + 1e-6 * np.eye(q))).T
    K = (basis @ errors.coefficients[i][-basis.shape[1] :]).reshape(LAGS, q, q)
    results = []
    for channel in range(q):
        best = (-1.0, 0, 0.0)
        for age in range(min(i + 1, WINDOW)):
            # What a unit step adds to the errors of its rows, and the same a row later.
            step = [np.eye(q)[channel] - K[:n].sum(axis=0)[channel] for n in range(age + 1)]
            later = [np.zeros(q), *step[:-1]]
            shrink = 1.0 / np.sqrt(1.0 + errors.leverage[i - age : i + 1])
            rows = np.concatenate([root @ w[i - age + n] for n in range(age + 1)])
            first = np.concatenate([root @ (step[n] - later[n]) * shrink[n] for n in range(age + 1)])
            rest = np.concatenate([root @ later[n] * shrink[n] for n in range(age + 1)])
            X = np.stack([first, rest], axis=1)[:, : 2 if age else 1]
            heights = np.linalg.lstsq(X, rows, rcond=None)[0]
            left = np.sum((rows - X @ heights) ** 2)
            drop = (np.sum(rows**2) - left) / max(1.0, left / max(q * (age + 1) - 2, 1))
            best = max(best, (drop, age, heights[1] if age else 0.0))
        rare = stats.f.sf(best[0] / 2.0, 2, max(freedom - q + 1.0, 1.0))
        results.append((stats.norm.isf(0.5 * rare), *best[1:]))
    return np.array(results).T


def test_drops_are_those_of_a_least_squares_per_onset():
    """On a short healthy time, where leverage and degrees of freedom count."""
    y = noisy(110, seed=4)
    y[80:, 1] += 4.0
    basis, _ = past_basis(y[:30], lags=LAGS, rank=4)
    past = lagged(y, range(1, LAGS + 1)) @ basis
    errors = recursive_residuals(np.hstack([np.ones((len(past), 1)), past]), y[LAGS:], start=12)
    found = largest_drops(errors, basis, window=WINDOW, recent=0)
    for i in (WINDOW - 1, 30, 60, 66, 75, 90):
        deviate, age, size = plain_drops(errors, basis, i)
        np.testing.assert_allclose(found.deviate[i], deviate, rtol=1e-6)
        np.testing.assert_array_equal(found.age[i], age)
        np.testing.assert_allclose(found.size[i], size, rtol=1e-6, atol=1e-9)


def test_no_step_is_looked_for_before_the_window():
    found, _ = stepped(1, 15.0)
    assert found.age.max() == WINDOW - 1


def test_the_drops_do_not_depend_on_which_way_is_up():
    plain, _ = stepped(1, 15.0)
    y = noisy()
    y[ONSET:, 1] += 15.0
    mirrored = drops(-y)
    np.testing.assert_allclose(mirrored.deviate, plain.deviate, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(mirrored.size, -plain.size, rtol=1e-6, atol=1e-6)


def test_amplitudes_of_white_noise_are_those_of_the_largest_of_a_window_of_deviates():
    """The largest of 20 dependent deviates is seldom above 5."""
    amplitude = np.concatenate([drops(noisy(400, seed)).deviate for seed in range(3)])
    print(f"median {np.median(amplitude):.2f}, above 5: {np.mean(amplitude > 5.0):.4f}")
    assert 0.5 < np.median(amplitude) < 3.0
    assert np.mean(amplitude > 5.0) < 1e-2


def test_a_disturbance_of_every_channel_counts_less_than_a_step_of_its_size_in_one():
    """What a step leaves unexplained enlarges the variance it is judged by."""
    gust = noisy()
    gust[ONSET:] += 15.0 * np.random.default_rng(5).standard_normal((len(gust) - ONSET, 3))
    plain, row = stepped(1, 15.0)
    rows = slice(row + 5, row + WINDOW)
    assert drops(gust).deviate[rows].max() < 0.75 * plain.deviate[rows, 1].min()
