"""Signals in stretches and in an array answer as their samples do, and so does every factor that is made of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.kernels import atom_signals as module
from bfi_cli.kernels.atom_signals import AtomSignals, Stretch, Tail, signal_of
from bfi_cli.kernels.lagged import SegmentFactors, compress, compress_beside, constants_and_signals, exponents_of

N, STEP_S, ORDER = 1500, 0.01, 5
WAVE = 2j * np.pi * 0.5


def made(n_outputs: int = 2) -> AtomSignals:
    """Return signals of every form: steps, lines, waves, exponentials, sharp parts, ends, and one that is zero."""
    rng = np.random.default_rng(1)

    def lasting(start: int, tail: Tail, stop: int = N) -> tuple[Stretch, ...]:
        return (Stretch(start=start, stop=stop, made=tail, origin_s=-start * STEP_S),)

    atoms = (
        lasting(100, Tail(level=1.0)),
        lasting(200, Tail(rate=1.0)),
        lasting(300, Tail(amplitude=1j, exponent=WAVE), 1100),
        lasting(300, Tail(amplitude=1.0, exponent=WAVE)),
        lasting(500, Tail(level=1.0, amplitude=-1.0, exponent=-1.0 / 0.5)),
        lasting(400, Tail(amplitude=0.5 + 1j, exponent=-0.3 + 3.0 * WAVE)),
        (
            Stretch(start=700, stop=750, made=rng.standard_normal(50)),
            Stretch(start=750, stop=1200, made=Tail(level=2.0)),
            Stretch(start=1200, stop=1210, made=rng.standard_normal(10)),
        ),
        (Stretch(start=0, stop=900, made=Tail(level=2.0, rate=0.1), origin_s=4.0),),
        signal_of(np.where(np.arange(N) > 1300, rng.standard_normal(N), 0.0)),
        lasting(50, Tail()),
    )
    outputs = tuple(j % n_outputs for j in range(len(atoms)))
    return AtomSignals(n_samples=N, n_outputs=n_outputs, step_s=STEP_S, outputs=outputs, atoms=atoms)


HELD = pytest.mark.parametrize("held", [lambda one: one, lambda one: AtomSignals.sampled(np.asarray(one))])


def record(n_outputs: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.standard_normal((N, 1)), rng.standard_normal((N, n_outputs)).cumsum(axis=0), rng.uniform(0.5, 2.0, N)


def alike(R: np.ndarray, others: np.ndarray) -> None:
    """Assert that rows have the same inner products, relative to the norms of the columns."""
    norms = np.linalg.norm(others, axis=0)
    norms[norms == 0.0] = 1.0
    np.testing.assert_allclose((R / norms).T @ (R / norms), (others / norms).T @ (others / norms), rtol=0, atol=1e-12)


@HELD
def test_a_part_a_sum_a_multiple_and_a_replacement_are_those_of_the_samples(held):
    signals = held(made())
    whole, z = np.asarray(signals), np.arange(1.0, 11.0)
    assert signals.shape == whole.shape
    np.testing.assert_array_equal(signals.between(333, 777), whole[333:777])
    np.testing.assert_allclose(signals.combined(z, 90, 1234), (whole @ z)[90:1234], atol=1e-12)
    np.testing.assert_allclose(np.asarray(signals.scaled(z)), whole * z, atol=1e-12)
    np.testing.assert_allclose(np.asarray(signals.over(np.array([2.0, 0.5]))), whole / [[2.0], [0.5]], atol=1e-12)
    np.testing.assert_array_equal(np.asarray(signals.of([3, 1]).joined(signals.of([6]))), whole[:, :, [3, 1, 6]])
    np.testing.assert_array_equal(np.asarray(signals.of(range(2, 5))), whole[:, :, 2:5])
    # An atom keeps its own output, so that it takes that of the one it replaces.
    replaced = np.asarray(signals.replaced([0, 1], signals.of([2, 3])))
    np.testing.assert_array_equal(replaced[:, :, :2], whole[:, :, 2:4])
    np.testing.assert_array_equal(replaced[:, :, 2:], whole[:, :, 2:])


@HELD
@pytest.mark.parametrize("at_once", [64, 262_144])
def test_extremes_and_powers_are_those_of_the_samples(monkeypatch: pytest.MonkeyPatch, at_once: int, held):
    monkeypatch.setattr(module, "AT_ONCE", at_once)
    monkeypatch.setattr(module, "SQUARED", at_once)
    signals, whole = held(made()), np.asarray(made())
    np.testing.assert_allclose(signals.peaks(), np.abs(whole).max(axis=0), rtol=1e-14)
    np.testing.assert_allclose(signals.travels(), np.ptp(whole, axis=0), rtol=1e-14)
    np.testing.assert_allclose(signals.powers(), np.sqrt((whole**2).sum(axis=1).mean(axis=0)), rtol=1e-12)
    assert signals.acting() == tuple(map(tuple, np.argwhere(np.any(whole, axis=0)).tolist()))
    assert signals.active_rows(600) == tuple(np.count_nonzero(whole[600:], axis=(0, 1)))


def test_filtered_signals_are_those_of_the_samples():
    K, signals = 0.3 * np.random.default_rng(3).standard_normal((3, 2, 2)), made()
    whole = np.asarray(signals)
    expected = whole.copy()
    for lag in range(1, 4):
        expected[lag:] -= np.einsum("io,koj->kij", K[lag - 1], whole[:-lag])
    filtered = np.asarray(signals.filtered(K)).sum(axis=1).reshape(N, -1, 2).transpose(0, 2, 1)
    np.testing.assert_allclose(filtered[3:], expected[3:], atol=1e-12)


@pytest.mark.parametrize("rows", [77, 500, 8192])
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("feedthrough", [False, True])
def test_the_factor_of_stretches_is_that_of_their_samples(
    rows: int, weighted: bool, feedthrough: bool, monkeypatch: pytest.MonkeyPatch
):
    """Segments and blocks of any length, none of which divides the record's, and again from what is known."""
    u, y, weights = record()
    signals = made()
    given = {"order": ORDER, "feedthrough": feedthrough, "weights": weights if weighted else None}
    monkeypatch.setattr("bfi_cli.kernels.lagged.BLOCK_ROWS", 97)
    whole = compress(u, y, np.asarray(signals), **given)
    monkeypatch.setattr("bfi_cli.kernels.lagged.BLOCK_ROWS", 89)
    segments = SegmentFactors(u=u, y=y, step_s=STEP_S, exponents=exponents_of(signals), rows=rows, **given)
    for _ in range(2):
        pieces = compress(u, y, signals, segments=segments, **given)
        assert pieces.columns == whole.columns
        assert pieces.n_rows == whole.n_rows
        alike(pieces.R, whole.R)
    later = replace(signals, atoms=tuple(_later(stretches, 37) for stretches in signals.atoms))
    alike(
        compress(u, y, later, segments=segments, **given).R,
        compress(u, y, np.asarray(later), **given).R,
    )


def _later(stretches: tuple[Stretch, ...], shift: int) -> tuple[Stretch, ...]:
    moved = []
    for one in stretches:
        start, stop = one.start + shift, min(one.stop + shift, N)
        samples = one.made if isinstance(one.made, Tail) else one.made[: stop - start]
        moved.append(replace(one, start=start, stop=stop, made=samples, origin_s=one.origin_s - shift * STEP_S))
    return tuple(moved)


@pytest.mark.parametrize(("start", "stop"), [(5, 1500), (64, 1472), (17, 18), (63, 65), (128, 256)])
def test_segments_taken_together_are_the_rows_at_once(start: int, stop: int):
    u, y, weights = record()
    given = {"u": u, "y": y, "weights": weights, "order": ORDER, "feedthrough": True, "step_s": STEP_S}
    exponents = exponents_of(made())
    together = SegmentFactors(exponents=exponents, rows=16, **given).factor(start, stop)
    alike(together, SegmentFactors(exponents=exponents, rows=4096, **given).factor(start, stop))


@HELD
@pytest.mark.parametrize("n_outputs", [1, 2])
def test_the_factor_of_signals_holds_their_inner_products(n_outputs: int, held):
    signals = held(made(n_outputs))
    whole = np.asarray(signals).reshape(N * n_outputs, -1)
    alike(np.hstack(constants_and_signals(signals)), np.hstack([np.kron(np.ones((N, 1)), np.eye(n_outputs)), whole]))


def test_signals_beside_a_record_have_their_inner_products_with_it():
    u, y, weights = record(1)
    signals = made(1)
    segments = SegmentFactors(
        u=u,
        y=y,
        weights=weights,
        order=ORDER,
        feedthrough=True,
        step_s=STEP_S,
        exponents=exponents_of(signals),
        rows=123,
    )
    data, beside = compress_beside(signals.of([0, 4]), signals, segments=segments)
    whole = compress(u, y, np.asarray(signals), order=ORDER, feedthrough=True, weights=weights)
    own = compress(u, y, np.asarray(signals.of([0, 4])), order=ORDER, feedthrough=True, weights=weights)
    alike(data.R, own.R)
    now = np.zeros((len(whole.R), 10))
    now[:, [atom for _, atom in whole.columns.signals]] = whole.R[:, whole.columns.theta]
    expected = np.hstack([whole.R[:, whole.columns.ones], whole.R[:, whole.columns.y], now])
    alike(np.hstack([data.R[:, data.columns.ones], data.R[:, data.columns.y], beside]), expected)
