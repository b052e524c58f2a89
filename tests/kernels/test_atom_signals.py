"""The signals of a dictionary answer as their samples do."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels import atom_signals as module
from bfi_cli.kernels.atom_signals import AtomSignals

N = 300


def made() -> AtomSignals:
    """Return signals of two outputs: steps, lines and waves that begin, end and last, and one that is zero."""
    k = np.arange(N, dtype=np.float64)
    courses = (k >= 50, np.maximum(k - 80.0, 0.0), np.sin(0.1 * k) * (k < 200), -3.0 * (k >= 290), 0.0 * k)
    array = np.zeros((N, 2, len(courses)))
    for j, course in enumerate(courses):
        array[:, j % 2, j] = course
    return AtomSignals(array)


def test_a_sum_a_part_and_a_replacement_are_those_of_the_samples():
    signals = made()
    whole, z = np.asarray(signals), np.arange(1.0, 6.0)
    assert signals.shape == whole.shape == (N, 2, 5)
    np.testing.assert_allclose(signals.combined(z), whole @ z, atol=1e-12)
    np.testing.assert_array_equal(np.asarray(signals.over(np.array([2.0, 0.5]))), whole / [[2.0], [0.5]])
    np.testing.assert_array_equal(np.asarray(signals.of([3, 1]).joined(signals.of([2]))), whole[:, :, [3, 1, 2]])
    np.testing.assert_array_equal(np.asarray(signals.of(range(2, 5))), whole[:, :, 2:5])
    # An atom keeps its own output, so that it takes that of the one it replaces.
    replaced = np.asarray(signals.replaced([0, 1], signals.of([2, 3])))
    np.testing.assert_array_equal(replaced[:, :, :2], whole[:, :, 2:4])
    np.testing.assert_array_equal(replaced[:, :, 2:], whole[:, :, 2:])


@pytest.mark.parametrize("at_once", [64, 262_144])
def test_extremes_and_powers_are_those_of_the_samples(monkeypatch: pytest.MonkeyPatch, at_once: int):
    monkeypatch.setattr(module, "SQUARED", at_once)
    signals, whole = made(), np.asarray(made())
    np.testing.assert_array_equal(signals.peaks(), np.abs(whole).max(axis=0))
    np.testing.assert_array_equal(signals.travels(), np.ptp(whole, axis=0))
    np.testing.assert_allclose(signals.powers(), np.sqrt((whole**2).sum(axis=1).mean(axis=0)), rtol=1e-12)
    assert signals.acting() == ((0, 0), (0, 2), (1, 1), (1, 3))
    assert signals.active_rows(60) == (240, 219, np.count_nonzero(whole[60:, :, 2]), 10, 0)
