"""The compressed lagged regression: theorems on the factor, then memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.kernels.lagged import compress, lagged, restrict, with_fault


def record(n: int, *, n_u: int = 2, n_y: int = 2, n_z: int = 3, seed: int = 0):
    rng = np.random.default_rng(seed)
    theta = rng.standard_normal((n, n_y, n_z))
    if n_z > 1:
        theta[:, 0, 1] = 0.0
    return rng.standard_normal((n, n_u)), rng.standard_normal((n, n_y)), theta


def stacked(u, y, theta, *, order: int, first: int, feedthrough: bool):
    """Return the whole lagged matrix, and nothing clever."""
    past = range(1, order + 1)
    signals = theta.reshape(len(y), -1)
    signals = signals[:, signals.any(axis=0)]
    return np.hstack(
        [
            np.ones((len(y) - first, 1)),
            lagged(u, range(0 if feedthrough else 1, order + 1), first=first),
            lagged(signals, past, first=first),
            lagged(y, past, first=first),
            signals[first:],
            y[first:],
        ]
    )


def assert_same_gram(R, S):
    np.testing.assert_allclose(R.T @ R, S.T @ S, rtol=0, atol=1e-12 * np.linalg.norm(S.T @ S))


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("n", [6, 30, 400])
def test_factor_is_triangular_and_has_the_gram_matrix_of_the_whole(n, feedthrough):
    u, y, theta = record(n)
    data = compress(u, y, theta, order=4, feedthrough=feedthrough)
    S = stacked(u, y, theta, order=4, first=4, feedthrough=feedthrough)
    assert data.n_rows == n - 4
    assert data.R.shape == (min(n - 4, data.columns.size), data.columns.size)
    triangular = data.columns.size if n - 4 > data.columns.size else data.columns.n_base
    assert not np.tril(data.R[:, :triangular], -1).any()
    assert_same_gram(data.R, S)


def test_dependent_columns_lose_nothing_where_there_are_fewer_rows_than_columns():
    """A column that the ones before it explain leaves a row of the triangle empty, and none may be cut off."""
    u, y, theta = record(30)
    theta = np.concatenate([theta, theta[:, :, :1], np.roll(theta, 1, axis=0)], axis=2)
    data = compress(u, y, theta, order=4)
    assert data.n_rows < data.columns.size
    assert_same_gram(data.R, stacked(u, y, theta, order=4, first=4, feedthrough=False))
    lower = restrict(data, order=2)
    assert_same_gram(lower.R, stacked(u, y, theta, order=2, first=4, feedthrough=False))


@given(block_rows=st.integers(1, 300), order=st.integers(1, 9))
def test_block_size_does_not_matter(block_rows, order):
    u, y, theta = record(250)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bfi_cli.kernels.lagged.BLOCK_ROWS", block_rows)
        data = compress(u, y, theta, order=order)
    assert_same_gram(data.R, stacked(u, y, theta, order=order, first=order, feedthrough=False))


def test_trailing_block_is_the_rest_with_the_base_projected_out():
    u, y, theta = record(200)
    data = compress(u, y, theta, order=3)
    S = stacked(u, y, theta, order=3, first=3, feedthrough=False)
    base, rest = S[:, : data.columns.n_base], S[:, data.columns.n_base :]
    left = rest - base @ np.linalg.lstsq(base, rest, rcond=None)[0]
    trailing = data.R[data.columns.n_base :, data.columns.n_base :]
    assert_same_gram(trailing, left)


@pytest.mark.parametrize("order", [1, 3, 5])
def test_a_lower_order_shares_the_rows(order):
    u, y, theta = record(120)
    there = restrict(compress(u, y, theta, order=5, feedthrough=True), order=order)
    rows = slice(5 - order, None)
    here = compress(u[rows], y[rows], theta[rows], order=order, feedthrough=True)
    assert there.columns == here.columns
    assert there.n_rows == here.n_rows
    assert_same_gram(there.R, here.R)


@given(z=st.lists(st.floats(-100, 100), min_size=3, max_size=3))
def test_a_fault_added_to_the_factor_is_the_fault_added_to_the_record(z):
    u, y, theta = record(90)
    faulty = y + theta @ np.array(z)
    there = with_fault(compress(u, y, theta, order=3), np.array(z))
    here = compress(u, faulty, theta, order=3)
    assert not np.tril(there.R, -1).any()
    assert_same_gram(there.R, stacked(u, faulty, theta, order=3, first=3, feedthrough=False))
    assert_same_gram(there.R, here.R)


def test_zero_signals_have_no_column_and_a_zero_input_has_columns_of_zero():
    u, y, theta = record(50)
    u[:, 1] = 0.0
    data = compress(u, y, theta, order=2)
    assert (0, 1) not in data.columns.signals
    assert len(data.columns.signals) == 5
    np.testing.assert_array_equal(data.R[:, [2, 4]], 0.0)


def test_no_atoms_and_no_inputs():
    rng = np.random.default_rng(0)
    y = rng.standard_normal((40, 1))
    data = compress(np.empty((40, 0)), y, np.empty((40, 1, 0)), order=2)
    assert_same_gram(data.R, np.hstack([np.ones((38, 1)), lagged(y, [1, 2]), y[2:]]))


def test_lagged_columns_are_lag_major():
    x = np.arange(12.0).reshape(6, 2)
    expected = [[4, 5, 0, 1], [6, 7, 2, 3], [8, 9, 4, 5], [10, 11, 6, 7]]
    np.testing.assert_array_equal(lagged(x, [0, 2]), expected)
    np.testing.assert_array_equal(lagged(x, [0, 2], first=4), expected[2:])


def test_inputs_are_left_alone_and_the_factor_is_read_only():
    u, y, theta = record(50)
    before = [x.copy() for x in (u, y, theta)]
    data = compress(u, y, theta, order=2)
    for x, copy in zip((u, y, theta), before, strict=True):
        np.testing.assert_array_equal(x, copy)
    with pytest.raises(ValueError, match="read-only"):
        data.R[0, 0] = 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda u, y, theta: (u[1:], y, theta), "shapes disagree"),
        (lambda u, y, theta: (u, y, theta[:, :1]), "shapes disagree"),
        (lambda u, y, theta: (u[:, 0], y, theta), "dimensions"),
        (lambda u, y, theta: (u[:3], y[:3], theta[:3]), r"order must lie in 1\.\.2 for 3 samples, got 4"),
        (lambda u, y, theta: (u, np.where(y == y[9], np.nan, y), theta), "must be finite"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        compress(*change(*record(20)), order=4)


def test_lag_refusals():
    with pytest.raises(ValueError, match="lags must lie in"):
        lagged(np.zeros((5, 1)), [0, 3], first=2)
    with pytest.raises(ValueError, match=r"order must lie in 1\.\.4, got 5"):
        restrict(compress(*record(20), order=4), order=5)


def peak_of_compress(n: int) -> int:
    u, y, theta = record(n, n_u=1, n_y=1, n_z=7)
    tracemalloc.start()
    compress(u, y, theta, order=4)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_memory_does_not_depend_on_the_length():
    short, long = peak_of_compress(20_000), peak_of_compress(200_000)
    assert abs(long - short) < 0.01 * short
