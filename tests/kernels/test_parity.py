"""Parity residuals: the left null space, the pattern of a step two ways, and where the chi-square drops most."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path

import numpy as np
import pytest

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
