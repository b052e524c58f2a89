"""The signals of a dictionary answer as their samples do."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels import atom_signals as module
from bfi_cli.kernels.atom_signals import acting, amplitudes, powers, some_of

N = 300


def made() -> np.ndarray:
    """Return signals of two outputs: steps, lines and waves that begin, end and last, and one that is zero."""
    k = np.arange(N, dtype=np.float64)
    courses = (k >= 50, np.maximum(k - 80.0, 0.0), np.sin(0.1 * k) * (k < 200), -3.0 * (k >= 290), 0.0 * k)
    array = np.zeros((N, 2, len(courses)))
    for j, course in enumerate(courses):
        array[:, j % 2, j] = course
    return array


@pytest.mark.parametrize("at_once", [64, 262_144])
def test_extremes_and_powers_are_those_of_the_samples(monkeypatch: pytest.MonkeyPatch, at_once: int):
    monkeypatch.setattr(module, "SQUARED", at_once)
    theta = made()
    np.testing.assert_array_equal(amplitudes(theta), np.abs(theta).max(axis=0))
    np.testing.assert_allclose(powers(theta), np.sqrt((theta**2).sum(axis=1).mean(axis=0)), rtol=1e-12)
    assert acting(theta) == ((0, 0), (0, 2), (1, 1), (1, 3))


def test_some_signals_are_those_of_their_atoms():
    theta = made()
    np.testing.assert_array_equal(some_of(theta, [3, 1]), theta[:, :, [3, 1]])
    assert np.shares_memory(some_of(theta, range(2, 5)), theta)
