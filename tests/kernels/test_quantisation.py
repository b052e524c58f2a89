"""Steps of a quantisation behind a low-pass."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.low_pass import low_pass
from bfi_cli.kernels.quantisation import quantum_of_plateaus

RATE_HZ = 10.0


def slow(n: int, seed: int, sd: float) -> np.ndarray:
    """Return a walk that rests on a step for seconds."""
    rng = np.random.default_rng(seed)
    return np.cumsum(np.repeat(sd * rng.standard_normal(n // 50), 50) / 50.0)


def stored(x: np.ndarray, step: float) -> np.ndarray:
    through = low_pass("gaussian", 0.75, RATE_HZ)
    rounded = np.round(x / step) * step
    return through.filtered(np.pad(rounded, (through.after, through.before), mode="edge"))


@pytest.mark.parametrize("step", [0.3048, 0.0322, 0.25])
def test_the_step_is_seen_behind_the_low_pass(step):
    x = 300.0 + slow(20_000, 0, 3.0 * step)
    assert quantum_of_plateaus(stored(x, step), RATE_HZ) == pytest.approx(step, rel=1e-3)


def test_level_and_unit_do_not_matter():
    x = stored(slow(20_000, 1, 1.0), 0.3)
    assert quantum_of_plateaus(7.0 + 1e-3 * x, RATE_HZ) == pytest.approx(3e-4, rel=1e-3)


def test_samples_that_are_missing_are_left_out():
    x = stored(slow(20_000, 2, 1.0), 0.3)
    x[500:520] = np.nan
    assert quantum_of_plateaus(x, RATE_HZ) == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize(
    "x",
    [np.zeros(1000), np.full(1000, np.nan), np.zeros(3), slow(20_000, 3, 1.0), np.sin(np.arange(5000) / 40.0)],
    ids=["constant", "missing", "short", "smooth walk", "sine"],
)
def test_where_there_is_no_step_none_is_seen(x):
    assert quantum_of_plateaus(x, RATE_HZ) is None


def test_moves_between_any_levels_are_no_steps():
    levels = 100.0 * np.random.default_rng(4).random(200)
    assert quantum_of_plateaus(np.repeat(levels, 60), RATE_HZ) is None
