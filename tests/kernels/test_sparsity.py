"""The pseudo-measurement stage: what can be proved of one update and of many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.kernels.sparsity import SparseStage, apply_sparsity, pseudo_norm

KINDS = ("l1", "lp", "exp-l0")
magnitudes = st.lists(st.floats(-5, 5).filter(lambda x: abs(x) > 0.05), min_size=1, max_size=7).map(np.array)
each_kind = pytest.mark.parametrize("kind", KINDS)


@each_kind
@settings(max_examples=25, deadline=None)
@given(z=magnitudes)
def test_gradient_is_that_of_the_norm(kind, z):
    stage, step = SparseStage(kind=kind, alpha=0.7), 1e-6
    gradient = pseudo_norm(z, stage)[1]
    for j, direction in enumerate(np.eye(z.size)):
        ahead, behind = (pseudo_norm(z + sign * step * direction, stage)[0] for sign in (1, -1))
        assert (ahead - behind) / (2 * step) == pytest.approx(gradient[j], rel=1e-4, abs=1e-7)


@each_kind
@settings(max_examples=25, deadline=None)
@given(z=magnitudes)
def test_a_small_update_lowers_the_norm_it_claims_to_measure(kind, z):
    stage = SparseStage(kind=kind, r=1e5)
    after, made = apply_sparsity(z, stage)
    assert made == 1
    assert pseudo_norm(after, stage)[0] < pseudo_norm(z, stage)[0]


@settings(max_examples=25, deadline=None)
@given(z=magnitudes, r=st.floats(0.1, 100), p0=st.floats(0.1, 10))
def test_one_l1_update_shrinks_the_signed_sum_by_a_known_factor(z, r, p0):
    after, _ = apply_sparsity(z, SparseStage(kind="l1", r=r, p0=p0))
    expected = np.abs(z).sum() * r / (p0 * z.size + r)
    assert np.sign(z) @ after == pytest.approx(expected)


@each_kind
@settings(max_examples=25, deadline=None)
@given(z=magnitudes, seed=st.integers(0, 9), factor=st.floats(0.01, 100))
def test_equivariance_to_sign_order_and_unit(kind, z, seed, factor):
    stage = SparseStage(kind=kind, updates=3)
    scales = np.linspace(0.5, 2.0, z.size)
    after = apply_sparsity(z, stage, scales=scales)[0]
    places = np.random.default_rng(seed).permutation(z.size)
    np.testing.assert_allclose(apply_sparsity(-z, stage, scales=scales)[0], -after, atol=1e-12)
    np.testing.assert_allclose(apply_sparsity(z[places], stage, scales=scales[places])[0], after[places], atol=1e-9)
    np.testing.assert_allclose(apply_sparsity(z * factor, stage, scales=scales / factor)[0], after * factor, rtol=1e-6)


@each_kind
def test_zero_stays_zero_and_no_update_is_counted_for_it(kind):
    stage = SparseStage(kind=kind, updates=4)
    z, made = apply_sparsity(np.zeros(3), stage)
    assert (made, z.any()) == (0, False)
    after, made = apply_sparsity(np.array([2.0, 0.0]), stage)
    assert after[1] == 0.0
    assert made == 4


@each_kind
@pytest.mark.parametrize("updates", range(4))
def test_updates_are_counted(kind, updates):
    assert apply_sparsity(np.array([3.0, -2.0, 1.0]), SparseStage(kind=kind, updates=updates))[1] == updates


@settings(max_examples=25, deadline=None)
@given(z=magnitudes, updates=st.integers(1, 6))
def test_many_l1_updates_are_one_of_so_much_less_variance(z, updates):
    weak = 1e4
    many = apply_sparsity(z, SparseStage(kind="l1", r=weak, updates=updates))[0]
    np.testing.assert_array_equal(np.sign(many), np.sign(z))
    np.testing.assert_allclose(many, apply_sparsity(z, SparseStage(kind="l1", r=weak / updates))[0], rtol=1e-9)


def test_published_settings_push_a_true_zero_off_zero_and_back_across():
    stage = SparseStage(kind="exp-l0", alpha=1.0, r=10.0, p0=1.0)
    z = np.array([9.0, 6.0, 1e-9])
    first = apply_sparsity(z, stage)[0]
    second = apply_sparsity(first, stage)[0]
    assert first[2] < -0.05
    assert second[2] > first[2] + 0.05


def test_nothing_to_do():
    z = np.array([1.0, 2.0])
    assert apply_sparsity(z, SparseStage())[1] == 0
    assert apply_sparsity(np.empty(0), SparseStage(kind="l1"))[1] == 0
    np.testing.assert_array_equal(apply_sparsity(z, SparseStage(kind="l1", updates=0))[0], z)


@pytest.mark.parametrize("bad", [{"kind": "l2"}, {"alpha": 0.0}, {"r": -1.0}, {"p": 1.5}, {"updates": -1}])
def test_refusals(bad):
    with pytest.raises(ValueError, match=r"kind must be one of|need alpha > 0"):
        SparseStage(**bad)
