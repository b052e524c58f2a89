"""The height of a step: exact whatever the filters make of its first rows, and as uncertain as the record is."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.lagged import lagged
from bfi_cli.kernels.parity import StepHeight, step_height
from bfi_cli.kernels.recursive_least_squares import recursive_residuals

N, START, BEGIN, FREE, SHARED = 400, 60, 330, 4, 10
DYNAMICS = np.array([[0.8, 0.1], [-0.2, 0.7]])


def record(noise: np.ndarray) -> np.ndarray:
    """Return outputs of a first-order model driven by `noise`, (N, 2)."""
    y = np.zeros_like(noise)
    for k in range(1, N):
        y[k] = DYNAMICS @ y[k - 1] + noise[k]
    return y


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((N, 2))


def estimated(y: np.ndarray, *, begin: int = BEGIN, shared: int = SHARED, free: int = FREE) -> StepHeight | None:
    X, Y = np.hstack([np.ones((N - 2, 1)), lagged(y, [1, 2])]), y[2:]
    errors = recursive_residuals(X, Y, start=START)
    basis = np.eye(4)
    rows = {"begin": begin, "n_free": free, "n_shared": shared}
    return step_height(X, Y, errors.coefficients, basis, **rows, output=1)


@pytest.mark.parametrize("first", [(0.0, 0.0, 0.0, 0.0), (-0.4, 3.0, 5.5, 4.1)])
def test_a_step_adds_its_height_to_the_answer_whatever_its_first_rows_are(first: tuple[float, ...]):
    y = record(white(0))
    before = estimated(y)
    fault = np.zeros(N)
    fault[2 + BEGIN : 2 + BEGIN + FREE], fault[2 + BEGIN + FREE :] = first, 4.7
    y[:, 1] += fault
    after = estimated(y)
    assert before is not None
    assert after is not None
    for name in ("height", "low", "high"):
        assert getattr(after, name) - getattr(before, name) == pytest.approx(4.7, rel=1e-9)


def test_the_answer_is_in_the_units_of_the_record():
    one, other = (estimated(record(scale * white(1))) for scale in (1.0, 40.0))
    assert one is not None
    assert other is not None
    for name in ("height", "low", "high"):
        assert getattr(other, name) == pytest.approx(40.0 * getattr(one, name), rel=1e-6)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say_and_more_is_seen_in_longer_steps():
    found = [(estimated(record(white(seed))), estimated(record(white(seed)), shared=30)) for seed in range(60)]
    held = sum(short.low <= 0.0 <= short.high for short, _ in found if short is not None)
    assert held >= 51  # of 60 with 95 % each, fewer once in 2000 times
    assert np.mean([long.high - long.low < short.high - short.low for short, long in found if short and long]) > 0.9


def test_errors_that_depend_on_each_other_widen_the_interval():
    """Drifting errors of the same size as white ones, which a model of so few lags does not predict."""
    wide = []
    for seed in range(4):
        slow = np.zeros((N, 2))
        for k in range(1, N):
            slow[k] = 0.98 * slow[k - 1] + np.sqrt(1.0 - 0.98**2) * white(seed)[k]
        y = slow + 0.5 * white(seed + 100)
        found = estimated(y)
        assert found is not None
        wide.append(abs(found.height) / (found.high - found.low))
    assert max(wide) < 0.75  # half an interval, and a half more


@pytest.mark.parametrize("asked", [{"begin": N - 2 - FREE - SHARED + 1}, {"begin": START + 20}])
def test_too_little_before_or_after_determines_nothing(asked: dict[str, int]):
    assert estimated(record(white(2)), **asked) is None
