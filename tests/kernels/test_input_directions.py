"""Inputs of the detector: directions they move in, means and moments, and which columns are needed."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.input_directions import directions, independent, moments

HEALTHY = np.arange(200) < 120


def moving(seed: int = 0):
    """Return two inputs that move on their own, the second the smaller."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.standard_normal((200, 2)), axis=0) * [1.0, 1e-3] + [5.0, -2.0]


def test_directions_span_the_inputs_whatever_their_units():
    u = moving()
    signals, weak = directions(u, HEALTHY)
    assert not weak.any()
    centred = u - u[HEALTHY].mean(axis=0)
    rest = centred - signals @ np.linalg.lstsq(signals, centred, rcond=None)[0]
    np.testing.assert_allclose(rest, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(directions(u * [7.0, -0.1], HEALTHY)[0]), np.abs(signals), atol=1e-9)


def test_what_tells_copies_apart_is_weak_and_an_exact_copy_is_nothing():
    u = moving()
    noise = 1e-4 * np.random.default_rng(1).standard_normal((200, 2))
    copies = np.column_stack([u, u[:, :1] + noise[:, :1], u[:, :1]])
    signals, weak = directions(copies, HEALTHY)
    np.testing.assert_array_equal(weak, [False, False, True])
    assert signals.shape == (200, 3)


def test_an_input_that_rests_while_healthy_is_not_weak():
    u = np.column_stack([moving(), np.where(HEALTHY, 0.0, 1.0), np.ones(200)])
    signals, weak = directions(u, HEALTHY)
    assert signals.shape == (200, 3)
    assert not weak.any()
    np.testing.assert_array_equal(signals[:, 2], u[:, 2])


@pytest.mark.parametrize("columns", [0, 2])
def test_no_inputs_and_inputs_that_never_move_are_none(columns):
    signals, weak = directions(np.ones((200, columns)), HEALTHY)
    assert (signals.shape, weak.shape) == ((200, 0), (0,))


def test_moments_of_a_ramp_are_its_mean_and_its_slope():
    u = np.arange(40.0)[:, None]
    found = moments(u, 5)
    np.testing.assert_allclose(found[10:, 0], u[10:, 0] - 2.0)
    np.testing.assert_allclose(found[10:, 1], 2.0 * (0.16 + 0.04))
    assert moments(u, 1) is u


def test_columns_that_depend_on_those_before_them_are_left_out():
    u = moving()
    columns = np.column_stack([u, u @ [2.0, -3.0], np.ones(200)])
    np.testing.assert_array_equal(independent(columns), [0, 1])
    assert independent(np.zeros((5, 0))).shape == (0,)
