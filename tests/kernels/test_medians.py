"""Medians are numpy's, whatever the numbers are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from bfi_cli.kernels.runs import median, median_of_known, medians_of_rows

NUMBERS = st.floats(width=16, allow_nan=True, allow_infinity=False)


@given(arrays(np.float64, array_shapes(max_dims=2, max_side=40), elements=NUMBERS))
def test_a_median_is_that_of_numpy(x: np.ndarray):
    np.testing.assert_array_equal(median(x), np.median(x))
    np.testing.assert_array_equal(median(x.ravel().copy(), in_place=True), np.median(x))
    if not np.isnan(x).all():
        assert median_of_known(x) == np.nanmedian(x)
    if x.ndim == 2:
        np.testing.assert_array_equal(medians_of_rows(x), np.median(x, axis=1))


@pytest.mark.parametrize("n", [1000, 1001])
def test_a_long_record_has_the_same_median(n: int):
    x = np.random.default_rng(n).standard_normal(n)
    assert median(x) == np.median(x)
    x[-1] = np.nan
    assert np.isnan(median(x))
    assert median_of_known(x) == np.nanmedian(x)


def test_nothing_has_no_median():
    assert np.isnan(median([]))
    assert np.isnan(median_of_known(np.array([np.nan])))
