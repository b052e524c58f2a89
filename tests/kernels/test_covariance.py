"""How sure the magnitudes are: identities of the unfolded fit, coverage, serial correlation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_varx import dictionary, explicit_error, made, wave
from scipy import signal, stats

from bfi_cli.kernels import covariance as covariance_module
from bfi_cli.kernels.covariance import (
    Layout,
    covariance,
    regressors_of_support,
    single_additions,
    unfold,
    unfold_own,
)
from bfi_cli.kernels.lagged import compress
from bfi_cli.kernels.variable_projection import fit_magnitudes, project_inputs

ORDER = 2
FLOOR = 1e-12


def fitted(u, y, theta, atoms, *, order: int = ORDER, first: int | None = None, feedthrough: bool = False):
    """Return the layout and the fit of `atoms` on the rows from `first`."""
    first = order if first is None else first
    data = compress(u, y, theta, order=first, feedthrough=feedthrough)
    fit = fit_magnitudes(project_inputs(data, order, floor=FLOOR), atoms)
    return Layout(u=u, y=y, theta=theta, first=first, feedthrough=feedthrough), fit


def record(seed: int, z, *, n: int = 400, n_y: int = 1, noise_sd: object = 0.1):
    rng = np.random.default_rng(seed)
    u, y = made(rng, order=ORDER, n_y=n_y).fly(n, rng, noise_sd=noise_sd)
    theta = dictionary(n, n_y=n_y, n_atoms=len(z))
    return u, y + theta @ np.array(z), theta


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("first", [2, 6])
def test_rows_and_factor_are_the_same_fit(n_y, first, feedthrough):
    u, y, theta = record(0, (1.0, -2.0, 0.5), n_y=n_y)
    layout, fit = fitted(u, y, theta, (0, 2), first=first, feedthrough=feedthrough)
    unfolded = unfold(layout, fit)
    e = unfolded.error
    assert e.shape == (400 - first, n_y)
    np.testing.assert_allclose(e.T @ e / len(e), fit.sigma, rtol=1e-9)
    z = np.zeros(3)
    z[[0, 2]] = fit.z
    expected = explicit_error(u, y, theta, z, order=ORDER, feedthrough=feedthrough, first=first)
    np.testing.assert_allclose(e, expected, atol=1e-9 * np.abs(y).max())
    np.testing.assert_allclose(unfolded.coefficients[-ORDER * n_y :].reshape(ORDER, n_y, n_y), fit.K.transpose(0, 2, 1))
    g = unfolded.signatures[:, :, [0, 2]]
    white = np.einsum("koi,op,kpj->ij", g, np.linalg.inv(fit.sigma), g)
    np.testing.assert_allclose(white, fit.information, rtol=1e-8)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("n_y", [1, 2])
def test_a_record_at_a_lower_order_has_the_same_rows(n_y, weighted):
    u, y, theta = record(0, (1.0, -2.0, 0.5), n_y=n_y)
    weights = np.linspace(0.5, 2.0, len(y)) if weighted else None
    layout, _ = fitted(u, y, theta, (0, 2), first=6)
    layout = layout.with_weights(weights)
    there, by_restriction = (
        fit_magnitudes(project_inputs(data, ORDER, floor=FLOOR), (0, 2))
        for data in (layout.at_order(ORDER).factor(), layout.factor())
    )
    assert there.log_det == pytest.approx(by_restriction.log_det, abs=1e-10)
    np.testing.assert_allclose(there.z, by_restriction.z, rtol=1e-9)
    np.testing.assert_allclose(there.information, by_restriction.information, rtol=1e-8)


def test_classical_covariance_is_the_inverse_information_with_the_degrees_of_freedom():
    """Scores without serial correlation and of the nominal size: a lower bound that white noise nearly reaches."""
    u, y, theta = record(1, (1.0, -2.0, 0.5), n=5000)
    layout, fit = fitted(u, y, theta, (0, 1, 2))
    unfolded = unfold(layout, fit)
    lower = np.linalg.inv(fit.information) * len(unfolded.error) / (len(unfolded.error) - 5 - 3)
    ratio = np.diag(covariance(fit, unfolded)) / np.diag(lower)
    assert (ratio >= 1.0 - 1e-9).all()
    assert (ratio < 1.6).all()


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9, -0.9])
def test_the_sandwich_never_narrows(n_y, pole):
    u, y, theta = record(2, (1.0, -2.0, 0.5), n_y=n_y, noise_sd=0.0)
    noise = np.random.default_rng(2).standard_normal(y.shape)
    layout, fit = fitted(u, y + 0.1 * signal.lfilter([1.0], [1.0, -pole], noise, axis=0), theta, (0, 1, 2))
    found = covariance(fit, unfold(layout, fit))
    assert (np.diag(found) >= np.diag(np.linalg.inv(fit.information)) * (1 - 1e-9)).all()
    np.testing.assert_allclose(found, found.T, rtol=1e-9)
    assert (np.linalg.eigvalsh(found) > 0).all()


@pytest.mark.parametrize("n_y", [1, 2])
def test_the_sandwich_is_the_sum_of_newey_and_west_written_out(n_y):
    """Bartlett weights over all pairs of rows, for errors that order 1 cannot whiten."""
    rng = np.random.default_rng(12)
    n, order, atoms = 260, 1, [0, 1, 2]
    slow = signal.lfilter([1.0], [1.0, -0.95], 0.1 * rng.standard_normal((n, n_y)), axis=0)
    theta = np.stack([wave(n, onset, "ramp") for onset in (20, 90, 150)], axis=1)[:, None, :] * np.ones((n, n_y, 1))
    layout, fit = fitted(
        rng.standard_normal((n, 1)), slow + rng.standard_normal((n, n_y)), theta, (0, 1, 2), order=order
    )
    unfolded = unfold(layout, fit)
    g, e, W = unfolded.signatures[:, :, atoms], unfolded.error, np.linalg.inv(fit.sigma)
    rows = n - order
    lags = np.ceil(np.cbrt(rows))
    apart = np.abs(np.subtract.outer(np.arange(rows), np.arange(rows)))
    scores = np.einsum("koi,op,kp->ki", g, W, e)
    B = np.linalg.inv(np.einsum("koi,op,kpj->ij", g, W, g))
    M = np.einsum("ki,kl,lj->ij", scores, np.maximum(0.0, 1.0 - apart / (lags + 1.0)), scores)
    wider = np.diag(B @ M @ B) / np.diag(B)
    assert wider.max() > 1.1
    root = np.sqrt(np.maximum(wider, 1.0))
    regressors = 1 + order + order * n_y
    expected = B * np.outer(root, root) * rows / (rows - regressors - 3 / n_y)
    np.testing.assert_allclose(covariance(fit, unfolded), expected, rtol=1e-8)


def test_slowly_varying_errors_widen_the_interval_of_a_slow_fault():
    """Order 1 cannot whiten the sum of two processes; classical intervals would miss the truth too often."""
    rng = np.random.default_rng(3)
    n = 2000
    slow = signal.lfilter([1.0], [1.0, -0.98], 0.1 * rng.standard_normal(n))
    y = (slow + rng.standard_normal(n))[:, None]
    theta = np.sin(0.003 * np.arange(n))[:, None, None]
    layout, fit = fitted(np.empty((n, 0)), y, theta, (0,), order=1)
    assert covariance(fit, unfold(layout, fit))[0, 0] > 1.3 / fit.information[0, 0]


@pytest.mark.slow
def test_coverage_of_the_interval_is_nominal():
    """400 records of a well-specified model with white noise, three faults each; bounds binomial at 1e-4 per fault.

    The interval may not be narrower than nominal, and cost at most 2.5 % more.
    """
    z, trials = np.array([0.3, 0.2, -0.4]), 400
    rng = np.random.default_rng(4)
    aircraft = made(rng, order=1)
    theta = dictionary(150)
    hits = np.zeros(3)
    for _ in range(trials):
        u, y = aircraft.fly(150, rng, noise_sd=0.1)
        layout, fit = fitted(u, y + theta @ z, theta, (0, 1, 2), order=1)
        sd = np.sqrt(np.diag(covariance(fit, unfold(layout, fit))))
        hits += np.abs(fit.z - z) < stats.t.ppf(0.975, 150 - 1 - 6) * sd
    assert (hits >= stats.binom.ppf(1e-4, trials, 0.95)).all(), hits / trials
    assert (hits <= stats.binom.ppf(1 - 1e-4, trials, 0.98)).all(), hits / trials


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("base", [(), (0,)])
def test_single_additions_are_those_of_a_refit(n_y, base):
    """For small faults one linearised step is the whole way."""
    z = np.array([1.0 if 0 in base else 0.0, 0.0, 0.0])
    for added in (1, 2):
        z[added] = 0.02
        u, y, theta = record(5, z, n=800, n_y=n_y)
        layout, fit = fitted(u, y, theta, base)
        magnitude, variance = single_additions(fit, unfold(layout, fit))
        atoms = tuple(sorted((*base, added)))
        _, refit = fitted(u, y, theta, atoms)
        sd = np.sqrt(variance[added])
        assert abs(magnitude[added] - refit.z[atoms.index(added)]) < 0.05 * sd
        place = atoms.index(added)
        assert variance[added] == pytest.approx(np.linalg.inv(refit.information)[place, place], rel=0.1)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("base", [(), (0,), (0, 2)])
def test_single_additions_are_a_least_squares_with_its_degrees_of_freedom(n_y, base):
    """On few rows, where the degrees of freedom count."""
    n = 40
    u, y, theta = record(13, (1.0, 0.3, -0.5), n=n, n_y=n_y)
    layout, fit = fitted(u, y, theta, base)
    unfolded = unfold(layout, fit)
    root = np.linalg.cholesky(np.linalg.inv(fit.sigma))
    G = np.einsum("op,koj->kpj", root, unfolded.signatures).reshape(-1, 3)
    e = (unfolded.error @ root).ravel()
    factor = (n - ORDER) / (n - ORDER - (1 + ORDER + ORDER * n_y) - len(base) / n_y)
    magnitude, variance = single_additions(fit, unfolded)
    for atom in {0, 1, 2} - set(base):
        columns = G[:, [*base, atom]]
        assert magnitude[atom] == pytest.approx(np.linalg.lstsq(columns, e, rcond=None)[0][-1], rel=1e-6)
        assert variance[atom] == pytest.approx(factor * np.linalg.inv(columns.T @ columns)[-1, -1], rel=1e-9)


@pytest.mark.parametrize("rows", [50, 1000])
@pytest.mark.parametrize("is_weighted", [False, True])
@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("base", [(), (0,), (0, 2)])
def test_additions_by_inner_products_are_those_by_rows(monkeypatch, base, n_y, is_weighted, rows):
    """Also where rows are taken in parts, of some of which a signal is zero; its own atom again is not seen."""
    monkeypatch.setattr(covariance_module, "ROWS", rows)
    u, y, theta = record(13, (1.0, 0.3, -0.5), n_y=n_y)
    layout, fit = fitted(u, y, theta, base, first=6)
    layout = layout.with_weights(1.0 + np.random.default_rng(0).uniform(size=400) if is_weighted else None)
    expected = single_additions(fit, unfold(layout, fit))
    added = regressors_of_support(layout, fit).each_of(layout.theta)
    np.testing.assert_allclose(added, expected, rtol=1e-9)
    assert np.isnan(added[0][list(base)]).all()


def test_an_active_atom_added_again_brings_nothing():
    u, y, theta = record(6, (1.0, 0.0, 0.0))
    theta[:, :, 2] = theta[:, :, 0]
    layout, fit = fitted(u, y, theta, (0,))
    magnitude, variance = single_additions(fit, unfold(layout, fit))
    assert np.isnan(magnitude[[0, 2]]).all()
    assert np.isnan(variance[[0, 2]]).all()
    assert np.isfinite(magnitude[1])


def test_what_the_regressors_explain_is_not_seen():
    """A constant, and an input of the model: NaN, not a number of the size 1e15."""
    u, y, theta = record(7, (1.0, 0.0, 0.0))
    theta[:, 0, 1] = 1.0
    layout, fit = fitted(u, y, theta, (0,))
    assert np.isnan(single_additions(fit, unfold(layout, fit))[1][1])
    theta[:, 0, 2] = 0.0
    layout, fit = fitted(u, y, theta, ())
    _, variance = single_additions(fit, unfold(layout, fit))
    assert np.isfinite(variance).tolist() == [True, False, False]
    static = signal.lfilter([1.0, -0.5], [1.0], u[:, 0])
    layout, fit = fitted(u, y, static[:, None, None], ())
    unfolded = unfold(replace(layout, feedthrough=True), replace(fit, K=np.zeros_like(fit.K)))
    assert np.isnan(single_additions(replace(fit, K=np.zeros_like(fit.K)), unfolded)[0][0])


def test_scaling_a_signal_scales_its_deviation():
    u, y, theta = record(8, (1.0, -2.0, 0.5))
    factor = np.array([1e6, 1.0, 1e-6])
    layouts = [fitted(u, y, theta / scale, (0, 1, 2)) for scale in (np.ones(3), factor)]
    one, other = (covariance(fit, unfold(layout, fit)) for layout, fit in layouts)
    np.testing.assert_allclose(other / np.outer(factor, factor), one, rtol=1e-5)


def test_no_atoms_and_a_repeated_input():
    u, y, theta = record(9, (0.0, 0.0, 0.0))
    layout, fit = fitted(np.hstack([u, u]), y, theta, ())
    unfolded = unfold(layout, fit)
    assert covariance(fit, unfolded).shape == (0, 0)
    assert unfolded.condition_number > 1e12
    once, fit = fitted(u, y, theta, ())
    np.testing.assert_allclose(unfolded.error, unfold(once, fit).error, atol=1e-10)


def test_one_unit_impulse_is_as_uncertain_as_one_sample():
    """A fault seen by one sample: the sandwich, fooled by an error of zero there, must not win."""
    u, y, _ = record(10, (0.0,))
    theta = (np.arange(400) == 200).astype(float)[:, None, None]
    layout, fit = fitted(u, y, theta, (0,))
    sd = float(np.sqrt(covariance(fit, unfold(layout, fit))[0, 0]))
    assert 0.05 < sd < 0.15


def test_shapes_are_documented_ones():
    n, n_y = 60, 2
    u, y, theta = record(11, (0.0,) * 5, n=n, n_y=n_y)
    theta[:, :, 4] = wave(n, 30, "step")[:, None]
    layout, fit = fitted(u, y, theta, (1, 4))
    unfolded = unfold(layout, fit)
    assert unfolded.signatures.shape == (n - ORDER, n_y, 5)
    assert unfolded.raw_norm.shape == (5,)
    assert unfolded.coefficients.shape == (unfolded.n_regressors, n_y) == (1 + ORDER + ORDER * n_y, n_y)
    assert covariance(fit, unfolded).shape == (2, 2)


@pytest.mark.parametrize("n_y", [1, 2])
@pytest.mark.parametrize("atoms", [(), (0, 2)])
def test_regressors_factorised_in_place_are_those_at_once(
    monkeypatch: pytest.MonkeyPatch, n_y: int, atoms: tuple[int, ...]
):
    layout, fit = fitted(*record(5, (1.0, -2.0, 0.5, 0.0, 0.3), n_y=n_y), atoms, first=6, feedthrough=True)
    layout = replace(layout, weights=1.0 + np.random.default_rng(0).uniform(size=400))
    whole = unfold(layout, fit)
    monkeypatch.setattr(covariance_module, "MOST_VALUES", 900)
    parts, own = unfold(layout, fit), unfold_own(layout, fit)
    for name in ("error", "weighted_error", "signatures", "raw_norm", "coefficients", "condition_number"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(own.error, whole.error, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(own.signatures, whole.signatures[:, :, list(atoms)], rtol=1e-10, atol=1e-11)


def test_a_dependent_regressor_of_a_long_record_is_left_out(monkeypatch: pytest.MonkeyPatch):
    u, y, theta = record(6, (1.0,))
    layout, fit = fitted(np.hstack([u, u[:, :1]]), y, theta, (0,))
    whole = unfold(layout, fit)
    monkeypatch.setattr(covariance_module, "MOST_VALUES", 100)
    parts = unfold(layout, fit)
    np.testing.assert_allclose(parts.error, whole.error, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(parts.signatures, whole.signatures, rtol=1e-9, atol=1e-11)
