"""The step size of the alternating direction method of multipliers."""

from __future__ import annotations

import pytest

from bfi_cli.kernels.admm import LARGEST_CHANGE, UNBALANCED, step_change


@pytest.mark.parametrize("primal", [1e-6, 1.0])
def test_the_step_goes_to_where_both_residuals_would_be_equal(primal: float):
    # The primal residual falls, and the dual grows, in proportion to the step.
    change = step_change(primal, primal / 9.0)
    assert primal / change == pytest.approx(primal / 9.0 * change)
    assert step_change(primal / 9.0, primal) == pytest.approx(1.0 / change)


def test_the_step_stays_where_the_residuals_are_near_each_other():
    assert step_change(UNBALANCED, 1.0) == step_change(1.0, UNBALANCED) == step_change(1.0, 1.0) == 1.0


def test_the_step_changes_by_a_bounded_factor():
    assert step_change(1.0, 0.0) == LARGEST_CHANGE
    assert step_change(0.0, 1.0) == 1.0 / LARGEST_CHANGE
