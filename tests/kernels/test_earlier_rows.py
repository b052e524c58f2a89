"""Records that share a model: the factor of all rows, each with a constant of its own; two roads to one covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.kernels.covariance import Layout, covariance, single_additions, unfold
from bfi_cli.kernels.lagged import EarlierRows, compress, lagged, restrict, with_earlier
from bfi_cli.kernels.variable_projection import fit_magnitudes, project_inputs, single_magnitudes

ORDER = 3


def flown(seed: int, n: int, level: float = 0.0, noise: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Return one input and two outputs about a level of their own."""
    rng = np.random.default_rng(seed)
    u, y = rng.standard_normal((n, 1)), np.zeros((n, 2))
    A = np.array([[0.7, 0.1], [-0.2, 0.5]])
    for k in range(1, n):
        y[k] = A @ y[k - 1] + u[k, 0] * np.array([1.0, -0.5]) + noise * rng.standard_normal(2)
    return u, y + level


def rows_of(u: np.ndarray, y: np.ndarray) -> EarlierRows:
    return EarlierRows.of(compress(u, y, np.zeros((*y.shape, 0)), order=ORDER, feedthrough=True))


def layout_of(n: int = 80) -> tuple[Layout, list[tuple[np.ndarray, np.ndarray]]]:
    """Return a record with a step and a ramp of its first output, and two other records."""
    u, y = flown(0, n)
    theta = np.zeros((n, 2, 2))
    theta[n // 2 :, 0, 0] = 1.0
    theta[n // 3 :, 0, 1] = np.linspace(0.0, 1.0, n - n // 3)
    y = y + theta[:, :, 0] * 0.7
    return Layout(u=u, y=y, theta=theta, first=ORDER, feedthrough=True), [
        flown(1, 60, 5.0),
        flown(2, 40, -3.0),
    ]


@pytest.mark.parametrize("n", [12, 80])
def test_the_factor_is_that_of_all_rows_with_a_constant_for_each_record(n: int):
    layout, others = layout_of(n)
    shared = with_earlier(
        compress(layout.u, layout.y, layout.theta, order=ORDER, feedthrough=True),
        EarlierRows.together([rows_of(*one) for one in others]),
    )

    def stacked(u: np.ndarray, y: np.ndarray, theta: np.ndarray) -> np.ndarray:
        flat = theta.reshape(len(y), -1)[:, [0, 1]]
        return np.hstack(
            [
                lagged(u, range(ORDER + 1)),
                lagged(flat, range(1, ORDER + 1)),
                lagged(y, range(1, ORDER + 1), first=ORDER),
                flat[ORDER:],
                y[ORDER:],
            ]
        )

    own = stacked(layout.u, layout.y, np.asarray(layout.theta))
    further = [stacked(u, y, np.zeros((len(y), 2, 2))) for u, y in others]
    whole = np.hstack([np.ones((len(own), 1)), own])
    for one in further:
        centred = one - one.mean(axis=0)  # what a constant of its own leaves
        whole = np.vstack([whole, np.hstack([np.zeros((len(one), 1)), centred])])
    np.testing.assert_allclose(shared.R.T @ shared.R, whole.T @ whole, atol=1e-9 * np.abs(whole.T @ whole).max())
    assert shared.n_rows == len(own) + sum(len(one) - 1 for one in further)


def test_the_order_of_the_records_and_the_level_they_fly_at_do_not_matter():
    first, second = flown(1, 60), flown(2, 40)
    one = EarlierRows.together([rows_of(*first), rows_of(*second)])
    other = EarlierRows.together([rows_of(second[0], second[1] + 9.0), rows_of(first[0] - 2.0, first[1])])
    for ours, theirs in ((one.u, other.u), (one.past, other.past), (one.y, other.y)):
        np.testing.assert_allclose(theirs.T @ theirs, ours.T @ ours, atol=1e-9)


def test_rows_and_factor_give_one_covariance_of_every_magnitude():
    layout, others = layout_of()
    layout = replace(layout, earlier=EarlierRows.together([rows_of(*one) for one in others]))
    data = with_earlier(compress(layout.u, layout.y, layout.theta, order=ORDER, feedthrough=True), layout.earlier)
    for order in (ORDER, ORDER - 1):
        problem = project_inputs(restrict(data, order=order), order, floor=1e-12)
        fit = fit_magnitudes(problem, (0,))
        on_rows, on_factor = single_additions(fit, unfold(layout, fit)), single_magnitudes(problem, fit, 2)
        np.testing.assert_allclose([on_rows[0][1], on_rows[1][1]], [on_factor[0][1], on_factor[1][1]], rtol=1e-8)


def test_more_records_narrow_the_interval_of_a_short_one():
    layout, _ = layout_of(24)
    others = [flown(seed, 200) for seed in (3, 4)]
    shared = replace(layout, earlier=EarlierRows.together([rows_of(*one) for one in others]))
    sd = []
    for one in (layout, shared):
        data = with_earlier(compress(one.u, one.y, one.theta, order=ORDER, feedthrough=True), one.earlier)
        fit = fit_magnitudes(project_inputs(data, ORDER, floor=1e-12), (0,))
        sd.append(float(np.sqrt(covariance(fit, unfold(one, fit))[0, 0] / fit.sigma[0, 0])))
    assert sd[1] < 0.8 * sd[0]
