"""Standard deviations about lines against a direct fit, and the noise of second differences."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.running import noise_of_second_differences, sd_about_lines


@pytest.mark.parametrize(("n_points", "stride"), [(12, 5), (3, 1), (7, 4)])
def test_it_is_a_fit_of_every_stretch(n_points, stride):
    x = 1e5 + np.cumsum(np.random.default_rng(0).standard_normal(200))
    made = sd_about_lines(x, n_points, stride)
    assert len(made) == len(x) - n_points * stride + 1
    for first in (0, 17, len(made) - 1):
        points = x[first : first + n_points * stride].reshape(n_points, stride).mean(axis=1)
        line = np.polyfit(np.arange(n_points), points - points[0], 1)
        rest = points - points[0] - np.polyval(line, np.arange(n_points))
        assert made[first] == pytest.approx(np.sqrt(np.sum(rest**2) / (n_points - 2)), rel=1e-8)


def test_a_line_is_nothing():
    x, at = np.random.default_rng(1).standard_normal(100), np.arange(100)
    np.testing.assert_allclose(sd_about_lines(x + 90_000.0 - 3.0 * at, 6, 5), sd_about_lines(x, 6, 5), atol=1e-9)
    assert sd_about_lines(5.0 + 0.25 * at, 6, 5).max() < 1e-12


def test_what_is_missing_or_short_has_none():
    x = np.zeros(50)
    x[20] = np.nan
    made = sd_about_lines(x, 3, 4)
    assert np.isnan(made[9:21]).all()
    assert (made[:9] == 0.0).all()
    assert sd_about_lines(x, 30, 2).size == 0


def test_the_noise_is_that_of_white_noise_beside_slow_motion():
    rng, at = np.random.default_rng(2), np.arange(20_000)
    x = 1e3 * np.sin(at / 500.0) + 0.7 * rng.standard_normal(at.size)
    assert noise_of_second_differences(x, 1000, 0.5) == pytest.approx(0.7, rel=0.05)
    x[4000:4100] = np.nan
    assert noise_of_second_differences(x, 1000, 0.5) == pytest.approx(0.7, rel=0.05)
    assert noise_of_second_differences(x[:5], 10, 0.5) == 0.0
