"""Two tails from their series, against scipy, which knows them from others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special

from bfi_cli.kernels.student import chi_square_tail, student_two_sided_95


@pytest.mark.parametrize("degrees", [1.0, 2.0, 2.3, 5.0, 30.0, 273.25, 1e4, 1e6])
def test_quantile_of_student(degrees: float):
    assert student_two_sided_95(degrees) == pytest.approx(special.stdtrit(degrees, 0.975), rel=1e-8)


def test_quantile_without_degrees_is_none():
    assert math.isnan(student_two_sided_95(math.nan))


@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 37, 38, 400])
def test_tail_of_chi_square(degrees: int):
    x = np.array([0.0, 1e-3, 1.0, 10.0, 55.5, 300.0])
    tails = [chi_square_tail(degrees, value) for value in x.tolist()]
    np.testing.assert_allclose(tails, special.chdtrc(degrees, x), rtol=1e-12)
