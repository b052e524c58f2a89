"""Medians, quantiles and distinct values are numpy's, to the last bit, whatever the values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from bfi_cli.kernels.order_statistics import distinct, median_of, quantile_of

VALUES = arrays(
    np.float64,
    array_shapes(max_dims=2, max_side=12),
    elements=st.floats(-1e6, 1e6) | st.sampled_from([0.0, 1.0, np.nan]),
)
SHARES = st.floats(0.0, 1.0) | st.lists(st.floats(0.0, 1.0), min_size=1, max_size=3)


@given(VALUES, st.sampled_from([None, 0, -1]))
def test_medians(x: np.ndarray, axis: int | None):
    median = np.median(x, axis=axis)
    np.testing.assert_array_equal(median_of(x, axis), median)
    np.testing.assert_array_equal(median_of(x.copy(), axis, overwrite=True), median)


@given(VALUES, SHARES, st.sampled_from([None, 0, -1]), st.booleans())
def test_quantiles(x: np.ndarray, share: float | list[float], axis: int | None, higher: bool):
    expected = np.quantile(x, share, axis=axis, method="higher" if higher else "linear")
    np.testing.assert_array_equal(quantile_of(x, share, axis, higher=higher), expected, strict=True)


def test_infinite_values_have_quantiles_that_are_not_interpolated():
    assert quantile_of([1.0, np.inf, np.inf], 0.9, higher=True) == np.inf == median_of([1.0, np.inf, np.inf])


@given(arrays(np.int64, array_shapes(max_dims=1, max_side=20), elements=st.integers(-5, 5)))
def test_distinct_values(x: np.ndarray):
    np.testing.assert_array_equal(distinct(x), np.unique(x), strict=True)


def test_of_nothing():
    assert np.isnan(median_of([]))
    assert distinct(np.zeros(0)).size == 0
    with pytest.raises(IndexError):
        quantile_of([], 0.5)
