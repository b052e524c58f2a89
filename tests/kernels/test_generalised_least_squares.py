"""Many small least squares at once give what LAPACK gives of each alone."""

import numpy as np
import pytest

from bfi_cli.kernels.generalised_least_squares import least_squares


@pytest.mark.parametrize("rank", [3, 2, 1])
def test_each_problem_has_its_smallest_solution(rank):
    """Also where columns depend on each other, and where rows do not count."""
    rng = np.random.default_rng(rank)
    columns = rng.standard_normal((5, 40, rank)) @ rng.standard_normal((5, rank, 3)) * [1.0, 300.0, 1e-3]
    y, rows = rng.standard_normal((5, 40)), rng.random((5, 40)) < 0.7
    expected = [np.linalg.lstsq(A[some], b[some], rcond=None)[0] for A, b, some in zip(columns, y, rows, strict=True)]
    np.testing.assert_allclose(least_squares(columns, y, rows), expected, rtol=1e-9, atol=1e-12)
