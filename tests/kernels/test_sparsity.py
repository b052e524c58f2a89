"""The pseudo-measurement stage: its fixed points are those of its objective; then theorems of the published one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.kernels.risro_varx import SparseStage, penalty_constants, pseudo_norm, published_updates, sparse_supports
from bfi_cli.kernels.variable_projection import ProjectedRegression

KINDS = ("l1", "lp", "exp-l0")
magnitudes = st.lists(st.floats(-5, 5).filter(lambda x: abs(x) > 0.05), min_size=1, max_size=7).map(np.array)
each_kind = pytest.mark.parametrize("kind", KINDS)


PRICE = 14.0
each_stage = pytest.mark.parametrize("kind", KINDS)


def orthogonal(z: np.ndarray) -> ProjectedRegression:
    """Return a regression whose signatures are orthonormal, whose sigma is 1, and whose least squares are `z`."""
    n = z.size
    theta, y = np.zeros((n + 2, 2, n)), np.zeros((n + 2, 2, 1))
    theta[:n, 0], y[:n, 0, 0], y[n, 1, 0] = np.eye(n), z, 1.0
    signals = tuple((0, j) for j in range(n))
    return ProjectedRegression(theta=theta, y=y, signals=signals, n_rows=10**15, n_base=1, floor=1.0)


def correlated(seed: int, *, unit: float = 1.0, units: np.ndarray | float = 1.0, noise: float = 0.3, m: int = 200):
    """Return a regression of order 2 with eight atoms, two of them active, in given units, and the truth."""
    rng = np.random.default_rng(seed)
    n, K = 8, np.array([0.7, -0.2])
    z = np.zeros(n)
    z[[1, 4]] = 3.0, -2.0
    theta = rng.standard_normal((m, n)) @ (np.eye(n) + 0.5 * np.eye(n, k=1))
    lags = np.stack([np.roll(theta, i, axis=0) for i in range(3)], axis=1)
    past = rng.standard_normal((m, 2))
    now = past @ K + lags[:, 0] @ z + noise * rng.standard_normal(m)
    y = np.column_stack([now, past + lags[:, 1:] @ z])[:, :, None]
    signals = tuple((0, j) for j in range(n))
    problem = ProjectedRegression(
        theta=lags * units, y=y * unit, signals=signals, n_rows=m, n_base=1, floor=1e-10 * unit
    )
    return problem, z * unit / units


def followed(problem: ProjectedRegression, stage: SparseStage, *, guarded: bool = False, price: float = PRICE):
    """Follow the stage from no fault and the predictor of that."""
    y, n = problem.y[:, :, 0], len(problem.signals)
    K = np.linalg.lstsq(y[:, 1:], y[:, 0])[0]
    return sparse_supports(problem, np.zeros(n), K, stage=stage, price=price, guarded=guarded)


@each_stage
@pytest.mark.parametrize("guarded", [False, True])
def test_for_orthogonal_signatures_it_is_the_hard_threshold_of_the_criterion(kind, guarded):
    near = 0.3 if kind == "l1" else 0.03  # the steps of l1 are short beside its threshold, and end where they are
    z = np.sqrt(PRICE) * np.array([0.3, -0.6, 1.0 - near, -1.0 - near, 1.5, 3.0])
    went = followed(orthogonal(z), SparseStage(kind=kind), guarded=guarded)
    assert went.converged
    assert went.supports[-1] == tuple(np.flatnonzero(np.abs(z) > np.sqrt(PRICE)))


@each_stage
def test_what_survives_obeys_the_equation_of_the_fixed_point(kind):
    z = np.array([4.5, -6.0, 12.0])
    shape, R, least = penalty_constants(SparseStage(kind=kind), PRICE)
    went = followed(orthogonal(z), SparseStage(kind=kind))
    x = np.abs(went.z)
    slope = shape * np.exp(-shape * x) if kind == "exp-l0" else shape * x ** (shape - 1.0)
    np.testing.assert_allclose(x + slope / (2.0 * R), np.abs(z), atol=0.1)
    assert x.min() > least


@each_stage
@given(price=st.floats(2.0, 60.0))
def test_the_smallest_magnitude_that_survives_is_the_square_root_of_the_price(kind, price):
    """The derivation: the least over x of x + rho'(x) / (2 R) is sqrt(price), at the least survivor."""
    shape, R, least = penalty_constants(SparseStage(kind=kind), price)
    x = np.linspace(1e-4, 3.0 * np.sqrt(price), 20001)
    slope = shape * np.exp(-shape * x) if kind == "exp-l0" else shape * x ** (shape - 1.0)
    total = x + slope / (2.0 * R)
    assert total.min() == pytest.approx(np.sqrt(price), rel=1e-3)
    assert x[total.argmin()] == pytest.approx(least, abs=2e-3 * np.sqrt(price))


def test_no_steepness_has_a_higher_threshold_for_its_variance():
    alpha, R, _ = penalty_constants(SparseStage(kind="exp-l0"), PRICE)
    highest = [(1.0 + np.log(a**2 / (2.0 * R))) / a for a in alpha * np.array([0.8, 0.9, 1.0, 1.1, 1.25])]
    assert int(np.argmax(highest)) == 2


@each_stage
@pytest.mark.parametrize("seed", range(5))
def test_it_ends_at_a_stationary_point_of_the_objective(kind, seed):
    """The gradient of misfit^2 / sigma^2 + sum rho / R in units of a standard deviation; K has none of it left."""
    problem, _ = correlated(seed)
    went = followed(problem, SparseStage(kind=kind))
    assert went.converged
    live = np.flatnonzero(went.z)
    z, theta, y = went.z[live], problem.theta[:, :, live], problem.y[:, :, 0]
    corrected = y - theta @ z
    G, r = np.append(1.0, -went.K) @ theta, corrected[:, 0] - corrected[:, 1:] @ went.K
    Q = np.linalg.qr(corrected[:, 1:])[0]
    off = np.linalg.qr(G - Q @ (Q.T @ G), mode="r")
    sigma2 = r @ r / (problem.n_rows - problem.n_base - problem.order - live.size)
    sd = np.sqrt(sigma2) / np.linalg.norm(off, axis=0)
    shape, R, _ = penalty_constants(SparseStage(kind=kind), PRICE)
    x = np.abs(z) / sd
    slope = shape * np.exp(-shape * x) if kind == "exp-l0" else shape * x ** (shape - 1.0)
    np.testing.assert_allclose(-2.0 * G.T @ r / sigma2 * sd + np.sign(z) * slope / R, 0.0, atol=0.25)
    np.testing.assert_allclose(corrected[:, 1:].T @ r, 0.0, atol=0.05 * np.linalg.norm(corrected[:, 1:]) * sigma2**0.5)


@pytest.mark.parametrize("seed", range(4))
def test_magnitudes_that_are_held_back_take_fewer_degrees_of_freedom(seed):
    """Of 18 rows some degrees are a good part of the variance; they are the trace of the hat matrix, K eliminated."""
    price, m = 0.5, 18
    problem, _ = correlated(seed, m=m)
    went = followed(problem, SparseStage(kind="l1"), price=price)
    assert went.converged
    live = np.flatnonzero(went.z)
    z, theta, y = went.z[live], problem.theta[:, :, live], problem.y[:, :, 0]
    corrected = y - theta @ z
    G, r = np.append(1.0, -went.K) @ theta, corrected[:, 0] - corrected[:, 1:] @ went.K
    Q = np.linalg.qr(corrected[:, 1:])[0]
    off = G - Q @ (Q.T @ G)
    A = off.T @ off
    _, R, _ = penalty_constants(SparseStage(kind="l1"), price)

    def sigma2_of(dof: float) -> float:
        return float(r @ r / (m - problem.n_base - problem.order - dof))

    dof = float(live.size)
    for _ in range(20):
        x = np.abs(z) * np.sqrt(np.diag(A) / sigma2_of(dof))
        dof = float(np.trace(np.linalg.solve(A + np.diag(np.diag(A) / (2.0 * R * x)), A)))
    sd = np.sqrt(sigma2_of(dof) / np.diag(A))
    gradient = -2.0 * G.T @ r / sigma2_of(dof) * sd + np.sign(z) / R
    assert dof < live.size - 0.5
    np.testing.assert_allclose(gradient[x > 1.0], 0.0, atol=0.02 / R)  # the last steps of the small ones are short


@pytest.mark.parametrize("kind", ["lp", "exp-l0"])
@pytest.mark.parametrize("seed", range(5))
def test_the_truth_is_among_the_supports_and_exact_without_noise(kind, seed):
    problem, z = correlated(seed)
    assert (1, 4) in followed(problem, SparseStage(kind=kind)).supports
    problem, z = correlated(seed, noise=0.0)
    went = followed(problem, SparseStage(kind=kind))
    assert (1, 4) in went.supports
    np.testing.assert_allclose(went.z, z, atol=1e-6)


@each_stage
@pytest.mark.parametrize("guarded", [False, True])
@settings(max_examples=8)
@given(seed=st.integers(0, 99), unit=st.floats(1e-3, 1e3), power=st.integers(-6, 6))
def test_supports_do_not_depend_on_the_units_of_atoms_and_channel(kind, guarded, seed, unit, power):
    units = 2.0 ** (power * np.linspace(-1.0, 1.0, 8)).round()
    stage, (one, _), (other, _) = SparseStage(kind=kind), correlated(seed), correlated(seed, unit=unit, units=units)
    here, there = followed(one, stage, guarded=guarded), followed(other, stage, guarded=guarded)
    assert here.supports == there.supports
    np.testing.assert_allclose(there.z * units / unit, here.z, rtol=1e-4, atol=1e-6)


def test_equal_atoms_do_not_stop_it():
    problem, _ = correlated(0)
    twice = ProjectedRegression(
        theta=np.concatenate([problem.theta, problem.theta[:, :, :2]], axis=2),
        y=problem.y,
        signals=tuple((0, j) for j in range(10)),
        n_rows=problem.n_rows,
        n_base=1,
        floor=problem.floor,
    )
    for guarded in (False, True):
        went = followed(twice, SparseStage(kind="exp-l0"), guarded=guarded)
        assert np.isfinite(went.z).all()
        assert {1, 9} & set(went.supports[-1])


@each_kind
@given(z=magnitudes)
def test_gradient_is_that_of_the_norm(kind, z):
    stage, step = SparseStage(kind=kind, alpha=0.7), 1e-6
    gradient = pseudo_norm(z, stage)[1]
    for j, direction in enumerate(np.eye(z.size)):
        ahead, behind = (pseudo_norm(z + sign * step * direction, stage)[0] for sign in (1, -1))
        assert (ahead - behind) / (2 * step) == pytest.approx(gradient[j], rel=1e-4, abs=1e-7)


@each_kind
@given(z=magnitudes)
def test_a_small_update_lowers_the_norm_it_claims_to_measure(kind, z):
    stage = SparseStage(kind=kind, r=1e5)
    after, made = published_updates(z, stage)
    assert made == 1
    assert pseudo_norm(after, stage)[0] < pseudo_norm(z, stage)[0]


@given(z=magnitudes, r=st.floats(0.1, 100), p0=st.floats(0.1, 10))
def test_one_l1_update_shrinks_the_signed_sum_by_a_known_factor(z, r, p0):
    after, _ = published_updates(z, SparseStage(kind="l1", r=r, p0=p0))
    expected = np.abs(z).sum() * r / (p0 * z.size + r)
    assert np.sign(z) @ after == pytest.approx(expected)


@each_kind
@given(z=magnitudes, seed=st.integers(0, 9))
def test_the_published_stage_is_equivariant_to_sign_and_order(kind, z, seed):
    stage = SparseStage(kind=kind, updates=3)
    after = published_updates(z, stage)[0]
    places = np.random.default_rng(seed).permutation(z.size)
    np.testing.assert_allclose(published_updates(-z, stage)[0], -after, atol=1e-12)
    np.testing.assert_allclose(published_updates(z[places], stage)[0], after[places], atol=1e-9)


@each_kind
def test_zero_stays_zero_and_no_update_is_counted_for_it(kind):
    stage = SparseStage(kind=kind, updates=4)
    z, made = published_updates(np.zeros(3), stage)
    assert (made, z.any()) == (0, False)
    after, made = published_updates(np.array([2.0, 0.0]), stage)
    assert after[1] == 0.0
    assert made == 4


@each_kind
@pytest.mark.parametrize("updates", range(4))
def test_updates_are_counted(kind, updates):
    assert published_updates(np.array([3.0, -2.0, 1.0]), SparseStage(kind=kind, updates=updates))[1] == updates


@given(z=magnitudes, updates=st.integers(1, 6))
def test_many_l1_updates_are_one_of_so_much_less_variance(z, updates):
    weak = 1e4
    many = published_updates(z, SparseStage(kind="l1", r=weak, updates=updates))[0]
    np.testing.assert_array_equal(np.sign(many), np.sign(z))
    np.testing.assert_allclose(many, published_updates(z, SparseStage(kind="l1", r=weak / updates))[0], rtol=1e-9)


def test_published_settings_push_a_true_zero_off_zero_and_back_across():
    stage = SparseStage(kind="exp-l0", alpha=1.0, r=10.0, p0=1.0)
    z = np.array([9.0, 6.0, 1e-9])
    first = published_updates(z, stage)[0]
    second = published_updates(first, stage)[0]
    assert first[2] < -0.05
    assert second[2] > first[2] + 0.05


def test_nothing_to_do():
    z = np.array([1.0, 2.0])
    assert published_updates(z, SparseStage())[1] == 0
    assert published_updates(np.empty(0), SparseStage(kind="l1"))[1] == 0
    np.testing.assert_array_equal(published_updates(z, SparseStage(kind="l1", updates=0))[0], z)


@pytest.mark.parametrize("bad", [{"kind": "l2"}, {"alpha": 0.0}, {"r": -1.0}, {"p": 1.5}, {"updates": -1}, {"p0": 0.0}])
def test_refusals(bad):
    with pytest.raises(ValueError, match=r"kind must be one of|need alpha > 0"):
        SparseStage(**bad)
