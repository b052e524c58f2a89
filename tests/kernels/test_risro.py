"""RISRO: exact recovery, order of convergence and invariances; then the VARX form against two plainer ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_varx import dictionary as made_dictionary
from made_varx import explicit_error, made
from plain_risro import covariates, plain_risro
from scipy.signal import lfilter

from bfi_cli.kernels.lagged import compress, lagged, with_fault
from bfi_cli.kernels.progress import StoppingRule, Termination, iterate
from bfi_cli.kernels.risro import Factors, least_squares, risro
from bfi_cli.kernels.risro_varx import SparseStage, risro_varx, sparse_varx
from bfi_cli.kernels.variable_projection import project_inputs

ORDER = 4


def low_rank(rank: int, *, p1: int = 8, p2: int = 6, seed: int = 0, noise: float = 0.0, rows: int = 5):
    """Return (A, y, T, X) with y = T b + A(X) + noise and `rows` times as many rows as X has freedom."""
    rng = np.random.default_rng(seed)
    n = rows * rank * (p1 + p2 - rank)
    A, T = rng.standard_normal((n, p1, p2)), rng.standard_normal((n, 3))
    X = rng.standard_normal((p1, rank)) @ rng.standard_normal((rank, p2))
    b = rng.standard_normal(3)
    return A, T @ b + np.tensordot(A, X) + noise * rng.standard_normal(n), T, X


def off(T, A, y):
    """Return A and y with the columns of T projected out."""
    Q = np.linalg.qr(T)[0]
    return A - np.tensordot(Q, np.tensordot(Q.T, A, axes=1), axes=1), y - Q @ (Q.T @ y)


def near(X, rank: int, *, distance: float, seed: int = 1) -> Factors:
    """Return the leading factors of X moved by `distance` times its norm."""
    moved = X + distance * np.linalg.norm(X) / np.sqrt(X.size) * np.random.default_rng(seed).standard_normal(X.shape)
    U, values, Vt = np.linalg.svd(moved)
    return Factors(left=U[:, :rank] * values[:rank], right=Vt[:rank].T)


@pytest.mark.parametrize("rank", [1, 2, 3, 6])
@pytest.mark.parametrize("rows", [3, 12])
def test_noise_free_low_rank_is_recovered_exactly(rank, rows):
    A, y, T, X = low_rank(rank, rows=rows)
    found = risro(*off(T, A, y), rank=rank)
    assert found.termination is Termination.CONVERGED
    np.testing.assert_allclose(found.factors.X, X, atol=1e-9)


def test_recovery_with_fewer_rows_than_entries_starts_from_the_spectral_guess():
    A, y, _, X = low_rank(2, p1=15, p2=14, rows=3)
    y = np.tensordot(A, X)
    assert len(y) < X.size
    np.testing.assert_allclose(risro(A, y, rank=2).factors.X, X, atol=1e-9)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_convergence_is_quadratic_without_noise(rank):
    A, y, T, X = low_rank(rank)
    start = near(X, rank, distance=0.3)
    errors = [
        np.linalg.norm(risro(*off(T, A, y), rank=rank, initial=start, max_iterations=n, fixed=True).factors.X - X)
        for n in (1, 2, 3, 4, 5)
    ]
    before = np.linalg.norm(start.X - X)
    seen = [(a, b) for a, b in zip([before, *errors], errors, strict=False) if b > 1e-10]
    assert len(seen) >= 2
    assert all(b < 2.0 * a**2 for a, b in seen)
    assert errors[-1] < 1e-11 * np.linalg.norm(X) * 10


@pytest.mark.parametrize("rank", [1, 2])
def test_residual_is_orthogonal_to_the_tangent_space(rank):
    A, y, T, _ = low_rank(rank, noise=0.3)
    found = risro(*off(T, A, y), rank=rank, tolerance=1e-13)
    left, right = found.factors.left, found.factors.right
    residual = y - np.tensordot(A, found.factors.X)
    residual -= T @ np.linalg.lstsq(T, residual, rcond=None)[0]
    gradient = np.tensordot(residual, A, axes=1)
    scale = 1e-9 * np.linalg.norm(A) * np.linalg.norm(y)
    assert found.misfit == pytest.approx(np.linalg.norm(residual))
    assert np.abs(T.T @ residual).max() < scale
    assert np.abs(gradient @ right).max() < scale * np.linalg.norm(right)
    assert np.abs(gradient.T @ left).max() < scale * np.linalg.norm(left)


@settings(max_examples=15)
@given(rank=st.integers(1, 3), scale=st.floats(1e-3, 1e3), seed=st.integers(0, 99))
def test_scaled_rotated_and_permuted_data_give_the_same_iterates(rank, scale, seed):
    A, y, T, X = low_rank(rank, noise=0.2)
    rng = np.random.default_rng(seed)
    P, Q = (np.linalg.qr(rng.standard_normal((n, n)))[0] for n in X.shape)
    rows = rng.permutation(len(y))
    start = near(X, rank, distance=0.1)
    moved = Factors(left=scale * P @ start.left, right=Q @ start.right)
    steps = {"rank": rank, "max_iterations": 3, "fixed": True}
    plain = risro(*off(T, A, y), initial=start, **steps).factors.X
    turned = risro(*off(T[rows], (P @ A @ Q.T)[rows], scale * y[rows]), initial=moved, **steps).factors.X
    np.testing.assert_allclose(turned, scale * P @ plain @ Q.T, atol=1e-9 * scale)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_iterates_are_those_of_the_published_sketch(rank):
    A, y, T, X = low_rank(rank, noise=0.2)
    start = near(X, rank, distance=0.5)
    U, V = np.linalg.qr(start.left)[0], np.linalg.qr(start.right)[0]
    for n, expected in enumerate(plain_risro(A, y, T, U=U, V=V, steps=6), start=1):
        found = risro(*off(T, A, y), rank=rank, initial=start, max_iterations=n, fixed=True)
        assert found.termination is Termination.FIXED
        assert found.iterations == n
        np.testing.assert_allclose(found.factors.X, expected, atol=1e-10)


def test_orthogonal_data_lose_the_rank():
    A = np.zeros((4, 2, 2))
    A[:2, 0, 1], A[2:, 1, 0] = 1.0, 1.0
    start = Factors(left=np.array([[1.0], [0.0]]), right=np.array([[1.0], [0.0]]))
    found = risro(A, np.ones(4), rank=1, initial=start)
    assert (found.termination, found.iterations, found.condition_number) == (Termination.RANK_LOST, 1, np.inf)


def test_iteration_limit_is_data():
    A, y, T, X = low_rank(1, noise=1.0)
    found = risro(*off(T, A, y), rank=1, initial=near(X, 1, distance=1.0), max_iterations=1)
    assert found.termination is Termination.MAX_ITERATIONS


@dataclass(frozen=True)
class Fake:
    X: np.ndarray
    misfit: float


def moving(*misfits: float):
    """Return the ending of an iteration that keeps moving, with these misfits."""
    found = iter([Fake(np.array([float(n)]), misfit) for n, misfit in enumerate(misfits, start=1)])
    start = Fake(np.zeros(1), misfits[0])
    return iterate(lambda _: next(found), start, scale=1.0, settings=StoppingRule(max_iterations=len(misfits)))


@pytest.mark.parametrize(
    ("misfits", "termination", "best"),
    [
        ((0.5, 0.3, 0.2), Termination.MAX_ITERATIONS, 3),
        ((0.5, 0.2, 0.3), Termination.MAX_ITERATIONS, 2),
        ((0.5, 0.2, 1e7), Termination.DIVERGED, 2),
        ((0.5, 0.2, np.nan), Termination.DIVERGED, 2),
        ((0.5, 0.2, 1e-16), Termination.CONVERGED, 3),
        ((0.5, 0.2, *[0.2] * 20), Termination.STAGNATED, 2),
    ],
)
def test_the_best_iterate_is_returned_with_the_reason(misfits, termination, best):
    last, _, reached = moving(*misfits)
    assert reached is termination
    assert last.X.item() == best


@pytest.mark.parametrize(("tremble", "termination"), [(1e-6, Termination.CONVERGED), (1e-4, Termination.STAGNATED)])
def test_a_trembling_estimate_of_constant_misfit_has_converged(tremble, termination):
    _, iterations, reached = iterate(
        lambda state: Fake(2.0 - state.X, 0.5),
        Fake(np.array([1.0 + tremble]), 0.5),
        scale=1.0,
        settings=StoppingRule(),
    )
    assert reached is termination
    assert iterations < 12


@pytest.mark.parametrize(("rank", "cut"), [(0, 0), (7, 0), (1, 1)])
def test_refusals(rank, cut):
    A, y, _, _ = low_rank(1)
    with pytest.raises(ValueError, match="rank must lie in" if not cut else r"y \(n,\)"):
        risro(A, y[cut:], rank=rank)


def test_least_squares_of_a_deficient_matrix_is_a_least_squares_solution():
    rng = np.random.default_rng(0)
    S = rng.standard_normal((30, 4))[:, [0, 1, 2, 2, 3]]
    S[:, 4] = 0.0
    y = rng.standard_normal(30)
    x, _ = least_squares(S, y)
    np.testing.assert_allclose(S @ x, S @ np.linalg.lstsq(S, y, rcond=None)[0], atol=1e-12)
    assert x[4] == 0.0


def dictionary(t):
    """Return seven signals (n_samples, 1, 7): two biases, two drifts, three sinusoids, each with its onset."""

    def after(onset, signal):
        return np.where(t >= onset, signal, 0.0)

    signals = [
        after(13.0, 1.0),
        after(25.0, 1.0),
        after(8.0, 0.2 * (t - 8.0)),
        after(30.0, 0.1 * (t - 30.0)),
        after(6.0, np.sin(2 * np.pi * 1.15 * t)),
        after(10.0, np.cos(2 * np.pi * 0.4 * t)),
        after(17.0, np.sin(2 * np.pi * 2.25 * t)),
    ]
    return np.stack(signals, axis=1)[:, None, :]


Z = np.array([4.0, 0.0, -2.0, 0.0, 1.0, 0.0, 3.0])


def varx(*, n: int = 500, noise: float = 0.0, seed: int = 0, z=Z):
    """Return (u, y, theta, K): a random stable VARX of order 4 with the fault theta z on its output."""
    rng = np.random.default_rng(seed)
    radius, angle = rng.uniform(0.3, 0.9, 2), rng.uniform(0.3, 2.5, 2)
    poles = radius * np.exp(1j * angle)
    K = -np.real(np.poly(np.concatenate([poles, poles.conj()])))[1:]
    B = rng.standard_normal(ORDER)
    u = np.sign(rng.standard_normal(n)) + 0.3 * rng.standard_normal(n)
    drive = lfilter(np.r_[0.0, B], [1.0], u) + 0.5 + noise * rng.standard_normal(n)
    theta = dictionary(0.1 * np.arange(n))
    y = lfilter([1.0], np.r_[1.0, -K], drive) + theta[:, 0] @ z
    return u[:, None], y[:, None], theta, K


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("corner", ["free", "imposed"])
def test_noise_free_varx_and_faults_are_recovered(corner, seed):
    u, y, theta, K = varx(seed=seed)
    found = risro_varx(compress(u, y, theta, order=ORDER), corner=corner)
    assert found.termination is Termination.CONVERGED
    np.testing.assert_allclose(found.z, Z, atol=1e-8)
    np.testing.assert_allclose(found.K, K, atol=1e-8)
    assert found.corner == pytest.approx(1.0, abs=1e-8)


def test_steps_on_the_factor_are_steps_on_all_rows_and_those_of_the_plain_algorithm():
    u, y, theta, K = varx(noise=0.05, n=400)
    data = compress(u, y, theta, order=ORDER)
    z0, K0 = 0.8 * Z + 0.1, 0.9 * K
    start = Factors(left=np.append(z0, 1.0)[:, None], right=np.append(K0, 1.0)[:, None])
    T = np.hstack([np.ones((len(y) - ORDER, 1)), lagged(u, range(1, ORDER + 1))])
    A, rest = covariates(y[:, 0], theta[:, 0], ORDER), y[ORDER:, 0]
    U, V = (x / np.linalg.norm(x) for x in (start.left, start.right))
    for n, plain in enumerate(plain_risro(A, rest, T, U=U, V=V, steps=5), start=1):
        fast = risro_varx(data, initial=(z0, K0), corner="free", settings=StoppingRule(max_iterations=n, fixed=True))
        explicit = risro(*off(T, A, rest), rank=1, initial=start, max_iterations=n, fixed=True).factors.X
        np.testing.assert_allclose(explicit, plain, atol=1e-8)
        np.testing.assert_allclose(fast.z, plain[:-1, -1], atol=1e-8)
        np.testing.assert_allclose(fast.K, plain[-1, :-1], atol=1e-8)
        assert fast.corner == pytest.approx(plain[-1, -1], abs=1e-8)


@pytest.mark.parametrize("feedthrough", [False, True])
def test_imposed_corner_is_a_stationary_point_of_the_prediction_error(feedthrough):
    u, y, theta, _ = varx(noise=0.1)
    found = risro_varx(
        compress(u, y, theta, order=ORDER, feedthrough=feedthrough), settings=StoppingRule(tolerance=1e-12)
    )
    corrected = y - theta @ found.z
    past = lagged(corrected, range(1, ORDER + 1))
    inputs = lagged(u, range(1 - feedthrough, ORDER + 1), first=ORDER)
    base = np.hstack([np.ones_like(past[:, :1]), inputs])
    error = corrected[ORDER:, 0] - past @ found.K
    error -= base @ np.linalg.lstsq(base, error, rcond=None)[0]
    atoms = lagged(theta[:, 0], range(1, ORDER + 1)).reshape(len(error), ORDER, -1)
    signatures = theta[ORDER:, 0] - np.einsum("kij,i->kj", atoms, found.K)
    regressors = np.hstack([base, past, signatures])
    cosines = regressors.T @ error / np.linalg.norm(regressors, axis=0) / np.linalg.norm(error)
    assert np.linalg.norm(error) == pytest.approx(found.misfit)
    assert np.abs(cosines).max() < 1e-8


def test_imposed_corner_does_not_depend_on_the_start():
    u, y, theta, K = varx(noise=0.05)
    data = compress(u, y, theta, order=ORDER)
    found = [risro_varx(data, initial=start).z for start in (None, (0 * Z, K), (Z + 1.0, 0.5 * K))]
    np.testing.assert_allclose(found[1:], [found[0]] * 2, atol=1e-6)


def test_a_fault_free_record_has_magnitudes_of_its_noise():
    u, y, theta, K = varx(noise=0.05, z=0 * Z)
    found = risro_varx(compress(u, y, theta, order=ORDER))
    assert found.termination is Termination.CONVERGED
    assert np.abs(found.z).max() < 0.5
    np.testing.assert_allclose(found.K, K, atol=0.1)


def test_one_factor_serves_every_magnitude():
    u, y, theta, K = varx(z=0 * Z)
    whole = compress(u, y, theta, order=ORDER)
    found = risro_varx(with_fault(whole, 3.0 * Z))
    np.testing.assert_allclose(found.z, 3.0 * Z, atol=1e-8)
    np.testing.assert_allclose(found.K, K, atol=1e-8)


def test_an_atom_outside_the_record_has_magnitude_zero():
    u, y, theta, _ = varx()
    with_dead = np.concatenate([theta[:, :, :2], np.zeros_like(theta[:, :, :1]), theta[:, :, 2:]], axis=2)
    z = np.insert(Z, 2, 0.0)
    for start in (None, (1.1 * z + np.eye(8)[2], np.zeros(ORDER))):
        found = risro_varx(compress(u, y, with_dead, order=ORDER), initial=start)
        np.testing.assert_allclose(found.z, z, atol=1e-8)


@pytest.mark.parametrize("corner", ["free", "imposed"])
def test_equal_atoms_share_their_magnitude(corner):
    u, y, theta, K = varx(noise=0.02)
    found = risro_varx(compress(u, y, theta[:, :, [0, 1, 2, 3, 4, 5, 6, 0]], order=ORDER), corner=corner)
    assert found.z[0] == pytest.approx(found.z[7])
    np.testing.assert_allclose(found.z[:7] + found.z[7] * np.eye(7)[0], Z, atol=0.1)
    np.testing.assert_allclose(found.K, K, atol=0.05)


@pytest.mark.parametrize("corner", ["free", "imposed"])
def test_without_atoms_it_is_a_plain_varx(corner):
    u, y, theta, K = varx(z=0 * Z)
    found = risro_varx(compress(u, y, theta[:, :, :0], order=ORDER), corner=corner)
    np.testing.assert_allclose(found.K, K, atol=1e-8)
    assert found.z.shape == (0,)


def several(n_y, *, noise=0.0, seed=0, n=400):
    """Return (u, y, theta, K, z) of a random predictor of order 2 with two atoms on each of its outputs."""
    rng = np.random.default_rng(seed)
    plant, z = made(rng, n_y=n_y), rng.uniform(1.0, 3.0, 2 * n_y)
    u, y = plant.fly(n, rng, noise_sd=noise)
    theta = made_dictionary(n, n_y=n_y, n_atoms=2 * n_y)
    return u, y + theta @ z, theta, plant.K, z


@pytest.mark.parametrize("n_y", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_noise_free_faults_of_several_outputs_are_recovered(n_y, seed):
    u, y, theta, K, z = several(n_y, seed=seed)
    found = risro_varx(compress(u, y, theta, order=2))
    assert found.termination is Termination.CONVERGED
    np.testing.assert_allclose(found.z, z, atol=1e-10)
    np.testing.assert_allclose(found.K, K, atol=1e-10)


def test_one_fault_on_two_outputs_has_one_magnitude():
    u, y, theta, K, z = several(2)
    both = np.concatenate([theta[:, :, :3], theta[:, :, :1] + theta[:, :, 3:]], axis=2)
    found = risro_varx(compress(u, y - theta @ z + both @ z, both, order=2))
    np.testing.assert_allclose(found.z, z, atol=1e-10)
    np.testing.assert_allclose(found.K, K, atol=1e-10)


def test_order_and_units_of_outputs_do_not_matter():
    u, y, theta, _, _ = several(3, noise=[0.1, 0.3, 0.2])
    found, turned, unit = risro_varx(compress(u, y, theta, order=2)), [2, 0, 1], np.array([1e3, 0.02, 57.3])
    other = risro_varx(compress(u, (y * unit)[:, turned], (theta * unit[:, None])[:, turned], order=2))
    np.testing.assert_allclose(other.z, found.z, rtol=1e-8)
    there = found.K * unit[:, None] / unit
    np.testing.assert_allclose(other.K, there[:, turned][:, :, turned], rtol=1e-6, atol=1e-8)
    assert other.misfit == pytest.approx(found.misfit)


def test_several_outputs_end_at_a_minimum_of_the_whitened_error():
    u, y, theta, _, z = several(2, noise=0.1)
    found = risro_varx(compress(u, y, theta, order=2), settings=StoppingRule(tolerance=1e-12))
    plain = explicit_error(u, y, theta, 0 * z, order=2, feedthrough=False)
    whiten = np.linalg.inv(np.linalg.qr(plain)[1])

    def misfit(z):
        return np.linalg.norm(explicit_error(u, y, theta, z, order=2, feedthrough=False) @ whiten)

    assert misfit(found.z) == pytest.approx(found.misfit)
    for move in 1e-3 * np.vstack([np.eye(len(z)), -np.eye(len(z))]):
        assert misfit(found.z + move) > found.misfit


def test_the_stage_finds_what_is_active_in_several_outputs_whatever_their_units():
    u, y, theta, _, z = several(3, noise=[0.1, 0.3, 0.2])
    active = np.array([3.0, 0.0, 0.0, 2.0, 0.0, 0.0])
    y, unit, found = y - theta @ (z - active), np.array([1e3, 0.02, 57.3]), []
    for scale in (np.ones(3), unit):
        data = compress(u, y * scale, theta * scale[:, None], order=2)
        problem, whole = project_inputs(data, 2), risro_varx(data)
        found.append(sparse_varx(problem, whole, n_atoms=6, stage=SparseStage(kind="exp-l0"), price=20.0))
    for one, other in zip(*found, strict=True):
        assert one.supports == other.supports
        assert one.supports[-1] == (0, 3)
        np.testing.assert_allclose(one.z, active, atol=0.3)
        np.testing.assert_allclose(other.z, one.z, rtol=1e-6, atol=1e-8)


def test_as_published_makes_fifty_steps():
    u, y, theta, _ = varx(noise=0.02)
    found = risro_varx(compress(u, y, theta, order=ORDER), as_published=True)
    assert (found.iterations, found.termination) == (50, Termination.FIXED)
    assert found.corner != 1.0


def test_the_published_stage_acts_after_every_step_but_the_last_and_only_as_published():
    u, y, theta, _ = varx(noise=0.02)
    data = compress(u, y, theta, order=ORDER)
    for updates in (0, 1, 2):
        stage = SparseStage(kind="exp-l0", updates=updates, r=1.0)
        found = risro_varx(data, as_published=True, sparse=stage)
        assert found.updates == updates * 49
        assert np.allclose(found.z, risro_varx(data, as_published=True).z, atol=1e-6) is (updates == 0)
        np.testing.assert_array_equal(risro_varx(data, sparse=stage).z, risro_varx(data).z)


def test_the_published_stage_depends_on_the_unit_of_a_magnitude():
    u, y, theta, _ = varx(noise=0.02)
    unit = np.array([10.0, 1.0, 0.1, 1.0, 5.0, 1.0, 1.0])
    stage = SparseStage(kind="exp-l0")
    z, other = (
        risro_varx(compress(u, y, x, order=ORDER), sparse=stage, as_published=True).z for x in (theta, theta * unit)
    )
    assert not np.allclose(other * unit, z, atol=1e-7)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_stage_finds_the_support_from_either_start_and_leaves_its_magnitudes(noise):
    u, y, theta, _ = varx(noise=noise)
    data = compress(u, y, theta, order=ORDER)
    problem = project_inputs(data, ORDER, floor=1e-10)
    for whole in (risro_varx(data), None):
        visits = sparse_varx(problem, whole, n_atoms=7, stage=SparseStage(kind="exp-l0"), price=14.0)
        assert len(visits) == (1 if whole is None else 2)
        assert tuple(np.flatnonzero(Z)) in {support for went in visits for support in went.supports}
        assert max(np.abs(went.z[Z == 0.0]).max() for went in visits) < 0.1


def test_more_atoms_than_the_rows_can_carry_have_no_stage():
    rng = np.random.default_rng(0)
    u, y, theta = rng.standard_normal((40, 1)), rng.standard_normal((40, 1)), rng.standard_normal((40, 1, 40))
    problem = project_inputs(compress(u, y, theta, order=2), 2)
    assert sparse_varx(problem, None, n_atoms=40, stage=SparseStage(kind="exp-l0"), price=14.0) == ()


def test_a_decomposition_that_does_not_converge_has_a_substitute(monkeypatch):
    rng = np.random.default_rng(0)
    S = rng.standard_normal((30, 6)) @ np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1e-15])
    S[:, 4] = S[:, 0] + S[:, 1]
    y = rng.standard_normal(30)
    expected = S @ least_squares(S, y)[0]

    def fail(*_given, **_settings):
        raise np.linalg.LinAlgError("SVD did not converge in Linear Least Squares")

    monkeypatch.setattr(np.linalg, "lstsq", fail)
    np.testing.assert_allclose(S @ least_squares(S, y)[0], expected, atol=1e-9)


@pytest.mark.parametrize("order", [2, 6, 12])
@pytest.mark.parametrize("seed", range(5))
def test_many_noisy_atoms_have_a_start_whose_decomposition_always_ends(order, seed):
    """Forty steps in 300 samples: the unconstrained least squares is hardly or not at all determined."""
    rng = np.random.default_rng(seed)
    n, onsets = 300, np.linspace(15, 280, 40).round()
    theta = (np.arange(n)[:, None] >= onsets).astype(float)[:, None, :]
    u = np.repeat(rng.standard_normal((30, 1)), 10, axis=0)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u, axis=0) + 3.0 * theta[:, :, 20] + 0.5 * rng.standard_normal((n, 1))
    found = risro_varx(compress(u, y, theta, order=order))
    assert np.isfinite([*found.z, *found.K, found.misfit]).all()
    assert found.misfit < np.linalg.norm(y)


def test_varx_refusals():
    rng = np.random.default_rng(0)
    u, y, theta = rng.standard_normal((30, 1)), rng.standard_normal((30, 2)), rng.standard_normal((30, 2, 2))
    with pytest.raises(ValueError, match="the published form has one output, got 2; impose the corner"):
        risro_varx(compress(u, y, theta, order=2), as_published=True)
    with pytest.raises(ValueError, match="5 rows are fewer than the 8 unknowns"):
        risro_varx(compress(u[:7], y[:7, :1], theta[:7, :1], order=2))
