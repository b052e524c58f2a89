"""Running weights: constant for constant noise, inverse to a noise that changes, blind to a step."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels import running as module
from bfi_cli.kernels.running import running_weights


def test_weights_are_inverse_to_the_size_of_the_error():
    rng = np.random.default_rng(0)
    size = np.repeat([1.0, 2.0], 2000)
    weights = running_weights(size[:, None] * rng.standard_normal((4000, 1)), 200)
    ratio = np.median(weights[:1500]) / np.median(weights[2500:])
    assert 1.8 < ratio < 2.2
    np.testing.assert_allclose(np.mean(weights**2), 1.0)


def test_an_outlier_or_a_factor_changes_nothing():
    error = np.random.default_rng(1).standard_normal((500, 1))
    spoilt = error.copy()
    spoilt[250] = 1e6
    np.testing.assert_allclose(running_weights(spoilt, 50), running_weights(error, 50), rtol=0.1)
    np.testing.assert_allclose(running_weights(1e3 * error, 50), running_weights(error, 50))


def test_an_error_of_zeros_has_equal_weights():
    np.testing.assert_array_equal(running_weights(np.zeros((50, 1)), 10), np.ones(50))


@pytest.mark.parametrize("values", [1, 50, 1000])
@pytest.mark.parametrize("half", [1, 10, 199])
def test_windows_that_move_along_are_those_at_once(monkeypatch: pytest.MonkeyPatch, values: int, half: int):
    """Medians and means, in blocks that do not divide the record's length."""
    error = np.round(np.random.default_rng(0).standard_normal((401, 1)), 2)
    whole = running_weights(error, half)
    monkeypatch.setattr(module, "MOST_VALUES", values)
    monkeypatch.setattr(module, "BLOCK", 30)
    np.testing.assert_allclose(running_weights(error, half), whole, rtol=1e-12)
