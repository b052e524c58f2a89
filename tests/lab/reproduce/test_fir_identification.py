"""Blind FIR identification: exact recovery, invariances, errors of the predicted size, and what the penalty costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.dictionary import load_dictionary, signals
from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.kernels.progress import Termination
from bfi_cli.lab.reproduce.fir import FirResult, identify_fir

CONFIGS = Path(__file__).parents[3] / "configs"
TAPS = np.array([1.0, 0.5, -0.3])
RISRO, NUCLEAR = None, 1e-3  # penalties
both_methods = pytest.mark.parametrize("penalty", [RISRO, NUCLEAR], ids=["risro", "nuclear"])


def response(theta: np.ndarray, taps: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return y(k) = sum_i b_i u(k-i), i = 1.., by convolution, of the input theta z that was zero before."""
    return np.convolve(theta @ z, np.concatenate([[0.0], taps]))[: len(theta)]


def random_atoms(n_atoms: int = 5, n: int = 300, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((n, n_atoms))


def thesis_atoms(step: int = 1) -> np.ndarray:
    time_s = np.arange(3172)[::step] / 100.0
    dictionary = load_dictionary(CONFIGS / "thesis_dictionary.yaml")
    return signals(dictionary.resolved(0.0), time_s, ["tas"], window_start_s=0.0)[:, 0, :]


def error(found: FirResult, taps: np.ndarray, z: np.ndarray) -> float:
    """Return the relative Frobenius error of the product."""
    truth = np.outer(taps, z)
    return float(np.linalg.norm(found.product - truth) / np.linalg.norm(truth))


def cosines(found: FirResult, taps: np.ndarray, z: np.ndarray) -> list[float]:
    return [
        float(np.abs(a @ b) / np.linalg.norm(a) / np.linalg.norm(b))
        for a, b in ((found.taps, taps), (found.magnitudes, z))
    ]


@given(seed=st.integers(0, 10_000), n_taps=st.integers(1, 8), n_atoms=st.integers(1, 6))
def test_risro_recovers_the_product_exactly_without_noise(seed, n_taps, n_atoms):
    rng = np.random.default_rng(seed)
    theta, taps, z = random_atoms(n_atoms, seed=seed), rng.standard_normal(n_taps), rng.standard_normal(n_atoms)
    found = identify_fir(response(theta, taps, z), theta, n_taps=n_taps)
    assert found.termination is Termination.CONVERGED
    assert error(found, taps, z) < 1e-8


@pytest.mark.parametrize("step", [1, 10])
@pytest.mark.parametrize("z", [[0, 4, 0, 0, 0, 0, 0], [0, 4, 2, 0, 0, 0, 1], [1, -2, 3, 0.5, 1, 2, -1]])
def test_risro_recovers_the_thesis_dictionary_although_its_lags_lack_rank(step, z):
    theta = thesis_atoms(step)
    found = identify_fir(response(theta, TAPS, np.array(z, dtype=float)), theta, n_taps=3)
    assert np.isinf(found.condition_number)
    assert error(found, TAPS, np.array(z)) < 1e-8


@pytest.mark.parametrize("penalty", [RISRO, 1e-6], ids=["risro", "nuclear"])
def test_factors_and_input_rebuild_product_and_output(penalty):
    theta, z = random_atoms(), np.array([0.0, 4.0, 2.0, 0.0, -1.0])
    y = response(theta, TAPS, z)
    found = identify_fir(y, theta, n_taps=3, penalty=penalty)
    np.testing.assert_allclose(np.outer(found.taps, found.magnitudes), found.product, rtol=0, atol=1e-12)
    assert np.linalg.norm(found.taps) == pytest.approx(1.0, abs=1e-12)
    assert found.taps[np.argmax(np.abs(found.taps))] > 0
    rebuilt = np.convolve(theta @ found.magnitudes, np.concatenate([[0.0], found.taps]))[: len(y)]
    assert np.linalg.norm((y - rebuilt)[3:]) == pytest.approx(found.misfit, abs=1e-9 * np.linalg.norm(y))


def test_b_and_z_trade_a_factor_that_nobody_can_see():
    theta, z = random_atoms(), np.array([0.0, 4.0, 2.0, 0.0, -1.0])
    one, other = (identify_fir(response(theta, c * TAPS, z / c), theta, n_taps=3) for c in (1.0, -40.0))
    np.testing.assert_allclose(one.taps, other.taps, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.magnitudes, other.magnitudes, rtol=0, atol=1e-11)


@both_methods
def test_rescaled_atoms_rescale_their_magnitudes(penalty):
    theta, z, by = random_atoms(), np.array([0.0, 4.0, 2.0, 0.0, -1.0]), np.array([1e-4, 1.0, 50.0, 3.0, 0.2])
    y = response(theta, TAPS, z) + 0.1 * np.random.default_rng(1).standard_normal(len(theta))
    plain, scaled = (identify_fir(y, atoms, n_taps=3, penalty=penalty) for atoms in (theta, theta * by))
    np.testing.assert_allclose(scaled.product * by, plain.product, rtol=0, atol=1e-7 * np.abs(plain.product).max())


@both_methods
def test_the_output_in_another_unit_gives_the_product_in_that_unit(penalty):
    theta, z = random_atoms(), np.array([0.0, 4.0, 2.0, 0.0, -1.0])
    y = response(theta, TAPS, z) + 0.1 * np.random.default_rng(1).standard_normal(len(theta))
    small, large = (identify_fir(c * y, theta, n_taps=3, penalty=penalty) for c in (1e-6, 1e6))
    np.testing.assert_allclose(large.product / 1e12, small.product, rtol=0, atol=1e-7 * np.abs(small.product).max())


def test_errors_under_noise_are_as_large_as_the_tangent_space_predicts():
    """To first order the covariance of the product is that of least squares over the tangent space at the truth."""
    theta, z, sd = random_atoms(), np.array([0.0, 4.0, 2.0, 0.0, -1.0]), 0.05
    regressor = np.hstack([theta[3 - lag : 300 - lag] for lag in (1, 2, 3)])
    tangent = np.hstack([np.kron(np.eye(3), z[:, None]), np.kron(TAPS[:, None], np.eye(5))])
    basis = np.linalg.svd(tangent, full_matrices=False)[0][:, : 3 + 5 - 1]
    expected = sd**2 * np.trace(np.linalg.inv((regressor @ basis).T @ (regressor @ basis)))
    rng, squared = np.random.default_rng(0), []
    for _ in range(60):
        y = response(theta, TAPS, z) + sd * rng.standard_normal(len(theta))
        squared.append(np.sum((identify_fir(y, theta, n_taps=3).product - np.outer(TAPS, z)) ** 2))
    assert np.mean(squared) == pytest.approx(expected, rel=4.0 * np.sqrt(2.0 / (7 * 60)))


@pytest.mark.parametrize("atoms", [random_atoms(7), thesis_atoms()], ids=["random", "thesis"])
def test_the_error_of_risro_is_proportional_to_small_noise(atoms):
    z = np.array([0.0, 4.0, 2.0, 0.0, 0.0, 0.0, 1.0])
    noise = np.random.default_rng(0).standard_normal(len(atoms))
    clean = response(atoms, TAPS, z)
    errors = [error(identify_fir(clean + sd * noise, atoms, n_taps=3), TAPS, z) for sd in (1e-6, 1e-4, 1e-2)]
    assert errors[1] / errors[0] == pytest.approx(100.0, rel=0.05)
    assert errors[2] / errors[1] == pytest.approx(100.0, rel=0.2)


@pytest.mark.parametrize("penalty", [1e-5, 1e-3, 1e-1])
def test_the_nuclear_norm_keeps_the_directions_and_shrinks_by_the_penalty(penalty):
    theta, z = random_atoms(n=5000), np.array([0.0, 4.0, 2.0, 0.0, -1.0])
    found = identify_fir(response(theta, TAPS, z), theta, n_taps=3, penalty=penalty)
    assert min(cosines(found, TAPS, z)) > 1.0 - 0.05 * penalty
    assert found.rank_one_share > 1.0 - 0.05 * penalty
    assert found.shrinkage == pytest.approx(penalty, rel=0.05)
    kept = np.linalg.norm(found.product) / np.linalg.norm(np.outer(TAPS, z))
    assert 1.0 - kept == pytest.approx(penalty, rel=0.1)
    refitted = found.product / (1.0 - found.shrinkage) - np.outer(TAPS, z)
    assert np.linalg.norm(refitted) < 0.3 * np.linalg.norm(found.product - np.outer(TAPS, z))


def test_the_nuclear_norm_errs_on_an_ill_conditioned_dictionary_where_risro_does_not():
    theta, z = thesis_atoms(), np.array([0.0, 4.0, 2.0, 0.0, 0.0, 0.0, 1.0])
    y = response(theta, TAPS, z)
    kept, relaxed = (identify_fir(y, theta, n_taps=3, penalty=penalty) for penalty in (RISRO, NUCLEAR))
    assert kept.shrinkage == pytest.approx(0.0, abs=1e-9)
    assert relaxed.vaf > 99.9
    assert error(relaxed, TAPS, z) > 0.1
    assert error(kept, TAPS, z) < 1e-8


def test_the_data_and_settings_are_not_changed_and_results_are_read_only():
    theta, z = random_atoms(), np.ones(5)
    y = response(theta, TAPS, z)
    before = y.copy(), theta.copy()
    found = identify_fir(y, theta, n_taps=3)
    np.testing.assert_array_equal(y, before[0])
    np.testing.assert_array_equal(theta, before[1])
    with pytest.raises(ValueError, match="read-only"):
        found.product[0, 0] = 1.0


def test_an_output_of_nothing_gives_a_product_of_nothing():
    for penalty in (RISRO, NUCLEAR):
        found = identify_fir(np.zeros(100), random_atoms(2, 100), n_taps=3, penalty=penalty)
        assert not found.product.any()


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        ({"n_taps": 0}, ConfigError, "allow 1 to 18 taps, got 0"),
        ({"n_taps": 19}, ConfigError, "got 19; take fewer taps or more samples"),
        ({"theta": random_atoms(5, 40) * [1, 1, 0, 1, 1]}, DictionaryError, r"theta\[:, 2\] is zero"),
        (
            {"theta": random_atoms(5, 40)[:, [0, 1, 2, 0, 4]] * [1, 1, 1, -3, 1]},
            DictionaryError,
            r"equals theta\[:, 0\]",
        ),
    ],
)
def test_what_cannot_be_identified_is_named(change, kind, message):
    given = {"y": np.ones(40), "theta": random_atoms(5, 40), "n_taps": 3} | change
    with pytest.raises(kind, match=message):
        identify_fir(given.pop("y"), given.pop("theta"), **given)
