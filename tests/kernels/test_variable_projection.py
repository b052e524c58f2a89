"""The likelihood of magnitudes and predictor: exact recovery, derivatives, invariance, bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_varx import dictionary, explicit_error, made, wave

from bfi_cli.kernels import variable_projection as module
from bfi_cli.kernels.covariance import Layout, single_additions, unfold
from bfi_cli.kernels.lagged import compress, lagged
from bfi_cli.kernels.progress import Termination
from bfi_cli.kernels.variable_projection import (
    Fit,
    fit_magnitudes,
    linear_additions,
    log_dets_beside,
    project_inputs,
    relaxed_bound,
    single_magnitudes,
    with_unit_root,
    without_signal,
)

ORDER = 2
TINY = 1e-12


def faulty(seed: int, *, n=300, n_u=1, n_y=1, n_atoms=3, z=(1.0, -2.0, 0.5), feedthrough=False, noise_sd=0.0):
    """Return u, y, theta and the predictor that made them, with faults `z` added to y."""
    rng = np.random.default_rng(seed)
    truth = made(rng, order=ORDER, n_u=n_u, n_y=n_y, feedthrough=feedthrough)
    u, y = truth.fly(n, rng, noise_sd=noise_sd)
    theta = dictionary(n, n_y=n_y, n_atoms=n_atoms)
    return u, y + theta @ np.array(z), theta, truth


def problem_of(u, y, theta, *, order=ORDER, feedthrough=False, floor=TINY):
    return project_inputs(compress(u, y, theta, order=order, feedthrough=feedthrough), order, floor=floor)


def log_det_at(problem, atoms, z) -> float:
    return fit_magnitudes(problem, atoms, np.array(z, dtype=float), max_iterations=0).log_det


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize(("n_u", "n_y"), [(1, 1), (2, 1), (1, 2), (2, 2)])
@pytest.mark.parametrize("seed", range(3))
def test_noise_free_records_give_the_truth_back(seed, n_u, n_y, feedthrough):
    z = np.array([1.0, -2.0, 0.5])
    u, y, theta, truth = faulty(seed, n_u=n_u, n_y=n_y, z=z, feedthrough=feedthrough)
    fit = fit_magnitudes(problem_of(u, y, theta, feedthrough=feedthrough), (0, 1, 2))
    np.testing.assert_allclose(fit.z, z, rtol=1e-7)
    np.testing.assert_allclose(fit.K, truth.K, rtol=0, atol=1e-7)
    assert fit.termination is Termination.CONVERGED


@pytest.mark.parametrize("n_y", [1, 2])
def test_a_support_leaves_the_other_atoms_out(n_y):
    u, y, theta, _ = faulty(1, n_y=n_y, z=(0.0, -2.0, 0.5))
    problem = problem_of(u, y, theta)
    np.testing.assert_allclose(fit_magnitudes(problem, (1, 2)).z, [-2.0, 0.5], rtol=1e-7)
    assert fit_magnitudes(problem, (0, 2)).log_det > fit_magnitudes(problem, (1, 2)).log_det + 10


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_likelihood_is_that_of_an_explicit_least_squares(n_y, order):
    u, y, theta, _ = faulty(2, n_y=n_y, noise_sd=0.1)
    data = compress(u, y, theta, order=4, feedthrough=True)
    problem = project_inputs(data, order, floor=TINY)
    for z in ([0.0, 0.0, 0.0], [1.0, -2.0, 0.5], [7.0, 3.0, -9.0]):
        e = explicit_error(u, y, theta, np.array(z), order=order, feedthrough=True, first=4)
        fit = fit_magnitudes(problem, (0, 1, 2), np.array(z), max_iterations=0)
        np.testing.assert_allclose(fit.sigma, e.T @ e / len(e), rtol=1e-9, atol=1e-12)
        assert fit.log_det == pytest.approx(np.linalg.slogdet(e.T @ e / len(e))[1], abs=1e-9)
        assert fit.n_parameters == n_y * (1 + (order + 1) + order * n_y) + 3


@pytest.mark.parametrize("n_y", [1, 2])
def test_the_step_comes_from_the_gradient_of_the_likelihood(n_y):
    """A full step solves information x step = -n/2 gradient of log det, so the gradient is known from outside."""
    u, y, theta, _ = faulty(3, n_y=n_y, noise_sd=0.1)
    problem, atoms, z = problem_of(u, y, theta), (0, 1, 2), np.array([1.05, -1.95, 0.45])
    here = fit_magnitudes(problem, atoms, z, max_iterations=0)
    step = fit_magnitudes(problem, atoms, z, max_iterations=1).z - z
    h = 1e-5
    numeric = [
        (log_det_at(problem, atoms, z + h * unit) - log_det_at(problem, atoms, z - h * unit)) / (2 * h)
        for unit in np.eye(3)
    ]
    implied = -2.0 / problem.n_rows * here.information @ step
    np.testing.assert_allclose(implied, numeric, rtol=1e-5, atol=1e-7)


def test_information_is_the_curvature_of_the_likelihood_where_errors_are_white():
    """They differ by (e times second derivative) terms of relative size 1/sqrt(n)."""
    u, y, theta, _ = faulty(4, n=3000, noise_sd=0.3)
    problem, atoms = problem_of(u, y, theta), (0, 1, 2)
    fit = fit_magnitudes(problem, atoms)
    h = 1e-2
    steps = h * np.eye(3)
    curvature = np.array(
        [
            [
                log_det_at(problem, atoms, fit.z + a + b)
                - log_det_at(problem, atoms, fit.z + a - b)
                - log_det_at(problem, atoms, fit.z - a + b)
                + log_det_at(problem, atoms, fit.z - a - b)
                for a in steps
            ]
            for b in steps
        ]
    ) * (problem.n_rows / 2.0 / (4.0 * h**2))
    size = np.sqrt(np.diag(fit.information))
    np.testing.assert_allclose(curvature / np.outer(size, size), fit.information / np.outer(size, size), atol=0.05)


def same_answer(one: Fit, other: Fit, *, factor=1.0, shift=0.0):
    np.testing.assert_allclose(other.z, one.z * factor, rtol=1e-6)
    assert other.log_det == pytest.approx(one.log_det + shift, abs=1e-8)
    np.testing.assert_allclose(other.information * np.multiply.outer(factor, factor), one.information, rtol=1e-5)


ATOMS = (0, 1, 2)


@pytest.fixture(scope="module")
def noisy():
    """Return u, y, theta with two inputs and two outputs, and the fit."""
    u, y, theta, _ = faulty(5, n_u=2, n_y=2, noise_sd=[0.1, 0.2])
    return u, y, theta, fit_magnitudes(problem_of(u, y, theta), ATOMS)


def test_scaling_and_mixing_of_inputs_change_nothing(noisy):
    u, y, theta, fit = noisy
    same_answer(fit, fit_magnitudes(problem_of(u @ [[1e3, 2.0], [0.0, 1e-2]] + 5.0, y, theta), ATOMS))


def test_scaling_and_mixing_of_outputs_change_only_the_units(noisy):
    u, y, theta, fit = noisy
    T = np.array([[30.0, 0.0], [2.0, 0.01]])
    mixed = problem_of(u, y @ T.T, np.einsum("io,koj->kij", T, theta))
    same_answer(fit, fit_magnitudes(mixed, ATOMS), shift=2.0 * np.linalg.slogdet(T)[1])


def test_scaling_of_a_signal_scales_its_magnitude(noisy):
    u, y, theta, fit = noisy
    factor = np.array([1e3, -0.5, 1e-2])
    same_answer(fit, fit_magnitudes(problem_of(u, y, theta / factor), ATOMS), factor=factor)


def test_a_constant_added_to_outputs_or_signals_is_absorbed(noisy):
    u, y, theta, fit = noisy
    same_answer(
        fit, fit_magnitudes(problem_of(u, y + np.array([85.0, -3.0]), theta + np.array([[0.3], [-0.7]])), ATOMS)
    )


def test_permuting_the_atoms_permutes_the_magnitudes(noisy):
    u, y, theta, fit = noisy
    order = [2, 0, 1]
    other = fit_magnitudes(problem_of(u, y, theta[:, :, order]), ATOMS)
    np.testing.assert_allclose(other.z, fit.z[order], rtol=1e-6)
    assert other.log_det == pytest.approx(fit.log_det, abs=1e-9)


def test_two_sensors_of_one_fault_add_their_information():
    """Independent noise: z is the mean of the separate answers, weighted by their information."""
    rng = np.random.default_rng(6)
    single = made(rng, order=1)
    u, clean = single.fly(5000, rng)
    noise = rng.standard_normal((5000, 2)) * [0.1, 0.2]
    theta = np.broadcast_to(wave(5000, 2000, "wave")[:, None, None], (5000, 2, 1))
    y = clean + noise + 0.5 * theta[:, :, 0]
    both = fit_magnitudes(problem_of(u, y, theta, order=1), (0,))
    alone = [fit_magnitudes(problem_of(u, y[:, [i]], theta[:, [i]], order=1), (0,)) for i in range(2)]
    weights = np.array([fit.information[0, 0] for fit in alone])
    sd = 1.0 / np.sqrt(weights.sum())
    assert abs(both.z[0] - 0.5) < 4.5 * sd
    # The pair filters its noise better than each alone, never worse.
    assert both.information[0, 0] > 0.9 * weights.sum()
    assert abs(both.z[0] - np.average([fit.z[0] for fit in alone], weights=weights)) < 2.0 * sd


@settings(max_examples=15)
@given(seed=st.integers(0, 50), m=st.floats(-30, 30), n_y=st.sampled_from([1, 2]), base=st.sampled_from([(), (0,)]))
def test_relaxed_fit_is_never_worse_than_any_magnitude(seed, m, n_y, base):
    u, y, theta, _ = faulty(seed, n=80, n_y=n_y, noise_sd=0.5)
    problem = problem_of(u, y, theta)
    fit = fit_magnitudes(problem, base)
    bound, _ = relaxed_bound(problem, fit, 2)
    assert bound <= log_det_at(problem, (*base, 2), [*fit.z, m]) + 1e-10


def test_relaxed_magnitude_is_exact_without_noise():
    u, y, theta, _ = faulty(7, z=(0.0, 3.0, 0.0))
    bound, magnitude = relaxed_bound(problem_of(u, y, theta), None, 1)
    assert magnitude == pytest.approx(3.0, rel=1e-8)
    assert bound < np.log(1e-20)


@pytest.mark.parametrize("atom", [0, 1, 2])
@pytest.mark.parametrize("magnitude", [50.0, -50.0])
def test_large_faults_are_found_from_the_relaxed_start(atom, magnitude):
    z = np.zeros(3)
    z[atom] = magnitude
    for seed in range(4):
        u, y, theta, _ = faulty(seed, z=z, noise_sd=0.1)
        problem = problem_of(u, y, theta)
        start = relaxed_bound(problem, None, atom)[1]
        fit = fit_magnitudes(problem, (atom,), np.array([start]))
        assert abs(fit.z[0] - magnitude) < 5.0 / np.sqrt(fit.information[0, 0])


def test_the_start_does_not_matter_on_an_easy_problem():
    u, y, theta, _ = faulty(8, noise_sd=0.1)
    problem, rng = problem_of(u, y, theta), np.random.default_rng(0)
    fits = [fit_magnitudes(problem, ATOMS, start) for start in rng.uniform(-3, 3, (8, 3))]
    sd = 1.0 / np.sqrt(np.diag(fits[0].information))
    for fit in fits[1:]:
        np.testing.assert_allclose((fit.z - fits[0].z) / sd, 0.0, atol=0.01)


def test_nothing_worse_than_the_start_is_returned():
    rng = np.random.default_rng(9)
    u, y, theta, _ = faulty(9, n=60, noise_sd=1.0)
    problem = problem_of(u, y, theta)
    for start in rng.uniform(-50, 50, (6, 3)):
        for limit in (1, 3):
            assert fit_magnitudes(problem, ATOMS, start, max_iterations=limit).log_det <= log_det_at(
                problem, ATOMS, start
            )


def test_floor_bounds_the_likelihood_from_below():
    u, y, theta, _ = faulty(10, n_y=2)
    fit = fit_magnitudes(problem_of(u, y, theta, floor=1e-4), ATOMS)
    assert fit.log_det == pytest.approx(2 * 2 * np.log(1e-4), abs=1e-6)
    np.testing.assert_allclose(np.diag(fit.sigma), 1e-8, rtol=1e-6)


def test_exact_record_without_a_floor_is_finite():
    u, y, theta, _ = faulty(10)
    fit = fit_magnitudes(problem_of(u, y, theta, floor=0.0), ATOMS)
    assert np.isfinite(fit.log_det)
    np.testing.assert_allclose(fit.z, [1.0, -2.0, 0.5], rtol=1e-7)


def test_an_atom_without_a_signal_keeps_its_start_and_has_no_information():
    u, y, theta, _ = faulty(11, z=(1.0, 0.0, 0.0), noise_sd=0.1)
    theta[:, :, 2] = 0.0
    fit = fit_magnitudes(problem_of(u, y, theta), (0, 2), np.array([0.0, 4.0]))
    assert fit.z[1] == 4.0
    assert not fit.information[1].any()
    assert abs(fit.z[0] - 1.0) < 5.0 / np.sqrt(fit.information[0, 0])


def test_two_equal_atoms_share_the_magnitude_and_do_not_crash():
    u, y, theta, _ = faulty(12, z=(1.0, 0.0, 0.0), noise_sd=0.1)
    theta[:, :, 2] = theta[:, :, 0]
    problem = problem_of(u, y, theta)
    both, one = fit_magnitudes(problem, (0, 2)), fit_magnitudes(problem, (0,))
    assert both.z.sum() == pytest.approx(one.z[0], rel=1e-4)
    assert both.log_det == pytest.approx(one.log_det, abs=1e-8)


def test_equal_inputs_and_equal_outputs_do_not_crash():
    u, y, theta, _ = faulty(13, noise_sd=0.1)
    fit, repeated = (fit_magnitudes(problem_of(inputs, y, theta), ATOMS) for inputs in (u, np.hstack([u, u])))
    # A repeated regressor costs one row each, in an arbitrary direction.
    np.testing.assert_allclose((repeated.z - fit.z) * np.sqrt(np.diag(fit.information)), 0.0, atol=0.3)
    twice = fit_magnitudes(problem_of(u, np.hstack([y, y]), np.repeat(theta, 2, axis=1), floor=1e-6), ATOMS)
    assert np.isfinite(twice.log_det)
    np.testing.assert_allclose(twice.z, fit.z, rtol=1e-2)


def test_no_atoms_no_inputs_no_iterations():
    _, y, _, _ = faulty(14, noise_sd=0.1)
    n = len(y)
    fit = fit_magnitudes(problem_of(np.empty((n, 0)), y, np.empty((n, 1, 0))), ())
    e = explicit_error(np.empty((n, 0)), y, np.empty((n, 1, 0)), np.zeros(0), order=ORDER, feedthrough=False)
    assert fit.log_det == pytest.approx(np.log(np.mean(e**2)), abs=1e-10)
    assert (fit.z.shape, fit.information.shape, fit.iterations) == ((0,), (0, 0), 0)


def test_the_iteration_limit_is_reported():
    u, y, theta, _ = faulty(15, noise_sd=0.1)
    fit = fit_magnitudes(problem_of(u, y, theta), ATOMS, max_iterations=1)
    assert (fit.iterations, fit.termination) == (1, Termination.MAX_ITERATIONS)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("atoms", [(), (1,)])
def test_what_an_addition_promises_is_what_it_brings_near_the_fit(n_y, atoms):
    """For a small fault the likelihood is linear, so that gain and magnitude are those of the fit itself."""
    z = np.array([0.0, -2.0 if atoms else 0.0, 0.02])
    u, y, theta, _ = faulty(3, n_y=n_y, z=z, noise_sd=0.1)
    problem = problem_of(u, y, theta)
    base = fit_magnitudes(problem, atoms)
    others = [atom for atom in range(3) if atom not in atoms]
    gains, magnitudes = linear_additions(problem, base, others)
    for gain, magnitude, atom in zip(gains, magnitudes, others, strict=True):
        support = tuple(sorted((*atoms, atom)))
        fit = fit_magnitudes(problem, support)
        assert gain == pytest.approx(problem.n_rows * (base.log_det - fit.log_det), rel=0.1, abs=0.05)
        assert magnitude == pytest.approx(fit.z[support.index(atom)], rel=0.1, abs=2e-3)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("order", [2, 4])
def test_a_root_at_1_is_a_regression_of_differences(n_y, order):
    """Against least squares written out: y(k) - y(k-1) on the inputs and on s - 1 lagged differences."""
    u, y, theta, _ = faulty(16, n_y=n_y, noise_sd=0.1)
    held = with_unit_root(problem_of(u, y, theta, order=order))
    z = np.array([1.0, -2.0, 0.5])
    steps = np.diff(y - theta @ z, axis=0, prepend=0.0)
    X = np.hstack(
        [
            np.ones((len(y) - order, 1)),
            lagged(u, range(1, order + 1)),
            lagged(steps, range(1, order), first=order),
        ]
    )
    e = steps[order:] - X @ np.linalg.lstsq(X, steps[order:], rcond=None)[0]
    expected = np.linalg.slogdet(e.T @ e / len(e))[1]
    assert log_det_at(held, ATOMS, z) == pytest.approx(expected, abs=1e-9)
    free = fit_magnitudes(problem_of(u, y, theta, order=order), ATOMS)
    assert fit_magnitudes(held, ATOMS, free.z).log_det > free.log_det
    assert fit_magnitudes(held, ATOMS).n_parameters == free.n_parameters - n_y**2


def test_with_a_root_at_1_a_trend_of_the_whole_record_tells_nothing():
    u, y, theta, _ = faulty(17, noise_sd=0.1)
    trend = np.linspace(0.0, 30.0, len(y))[:, None]
    one, other = (fit_magnitudes(with_unit_root(problem_of(u, x, theta)), ATOMS) for x in (y, y + trend))
    assert other.log_det == pytest.approx(one.log_det, abs=1e-7)
    np.testing.assert_allclose(other.z, one.z, atol=1e-4 / np.sqrt(np.diag(one.information)).min())


def test_a_record_that_integrates_gives_its_faults_back_with_the_root_held():
    u, _, theta, _ = faulty(18)
    y = np.cumsum(0.3 * u, axis=0)
    problem = problem_of(u, y + theta @ np.array([1.0, -2.0, 0.5]), theta, feedthrough=True)
    fit = fit_magnitudes(with_unit_root(problem), ATOMS)
    np.testing.assert_allclose(fit.z, [1.0, -2.0, 0.5], rtol=1e-6)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("atoms", [(), (1,), ATOMS])
def test_single_magnitudes_on_the_factor_are_those_on_the_rows(n_y, atoms):
    u, y, theta, _ = faulty(19, n_y=n_y, noise_sd=0.1)
    theta[:, :, 2] *= 0.01
    problem = problem_of(u, y, theta)
    fit = fit_magnitudes(problem, atoms)
    layout = Layout(u=u, y=y, theta=theta, first=ORDER, feedthrough=False)
    expected = single_additions(fit, unfold(layout, fit))
    magnitude, variance = single_magnitudes(problem, fit, 3)
    others = [atom for atom in ATOMS if atom not in atoms]
    np.testing.assert_allclose(magnitude[others], expected[0][others], rtol=1e-6)
    np.testing.assert_allclose(variance[others], expected[1][others], rtol=1e-6)
    np.testing.assert_array_equal(magnitude[list(atoms)], fit.z)
    rows, free = problem.n_rows, problem.n_predictor / n_y + len(atoms) / n_y
    classical = np.diag(np.linalg.inv(fit.information)) * rows / (rows - free) if atoms else []
    np.testing.assert_allclose(variance[list(atoms)], classical, rtol=1e-8)


def test_the_single_magnitude_of_what_is_not_there_is_none():
    u, y, theta, _ = faulty(20, noise_sd=0.1)
    theta[:, :, 2] = 0.0
    problem = problem_of(u, y, theta)
    magnitude, variance = single_magnitudes(problem, fit_magnitudes(problem, (0,)), 3)
    assert np.isnan([magnitude[2], variance[2]]).all()
    assert np.isfinite([*magnitude[:2], *variance[:2]]).all()


@pytest.mark.parametrize("together", [1, 2 * 10**6])
@pytest.mark.parametrize("atoms", [(), (0,), (0, 2), (0, 1, 2)])
@pytest.mark.parametrize(("n_y", "scaling"), [(1, {}), (1, {1: (150, 0.01)}), (2, {})])
def test_fits_made_together_are_those_made_one_by_one(n_y, scaling, atoms, together, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "TOGETHER", together)
    u, y, theta, _ = faulty(11, n_y=n_y, noise_sd=0.1)
    problem = replace(problem_of(u, y, theta), scaling=scaling)
    fit, sizes = fit_magnitudes(problem, atoms), np.array([0.3, -2.0, 5.0])
    made_together = log_dets_beside(problem, range(3), sizes, fit)
    for atom, size in enumerate(sizes):
        for column, sign in enumerate((1.0, -1.0)):
            alone = fit_magnitudes(without_signal(problem, atom, sign * size), atoms, fit.z)
            assert made_together[atom, column] == pytest.approx(alone.log_det, abs=1e-5)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("atoms", [(), (0,), (1, 4)])
def test_fits_on_the_few_rows_that_hold_them_are_those_on_all_rows(n_y, atoms, monkeypatch: pytest.MonkeyPatch):
    u, y, theta, _ = faulty(11, n_y=n_y, n_atoms=40, z=(1.0, *[0.0] * 39), noise_sd=0.1)
    problem, sizes = problem_of(u, y, theta), np.linspace(-2.0, 5.0, 40)
    fit = fit_magnitudes(problem, atoms)
    on_few = log_dets_beside(problem, range(40), sizes, fit)
    monkeypatch.setattr(module, "COMPRESSED", np.inf)
    np.testing.assert_allclose(on_few, log_dets_beside(problem, range(40), sizes, fit), rtol=0, atol=1e-10)


def test_fits_of_dependent_signals_are_made_one_by_one():
    u, y, theta, _ = faulty(12, noise_sd=0.1)
    problem = problem_of(u, y, np.concatenate([theta, theta[:, :, :1]], axis=2))
    fit = fit_magnitudes(problem, (0, 3))
    once = fit_magnitudes(problem, (0,))
    np.testing.assert_allclose(
        log_dets_beside(problem, [1], np.array([2.0]), fit),
        log_dets_beside(problem, [1], np.array([2.0]), once),
        atol=1e-5,
    )
    assert log_dets_beside(problem, [], np.zeros(0), once).shape == (0, 2)
