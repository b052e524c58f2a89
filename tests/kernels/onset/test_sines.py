"""Sines at few onsets: their inner products, their statistic, and the frequency that they find."""

from __future__ import annotations

import numpy as np
import pytest
from plain_onset import random_record, record, signal
from scipy.signal import lfilter

from bfi_cli.kernels.onset import frequency as sines
from bfi_cli.kernels.onset import waveform as shapes
from bfi_cli.kernels.onset.frequency import (
    Sines,
    frequency_grid,
    promised,
    scan_frequency,
    screen_at,
    screen_grid,
    screen_sines,
    sine_onsets,
)
from bfi_cli.kernels.onset.profile import peaks
from bfi_cli.kernels.onset.scan import default_onsets, prepare_scan, scan_shape, tabulate

KINDS = ("white", "faulty", "spiky", "drifting", "smooth", "noise-free", "weighted", "two outputs")
# Statistic of a sine that stands out of any noise.
CLEAR = 50.0


def made(kind, seed, n=300):
    """Return the scan of a random record of a kind, of a random order."""
    rng = np.random.default_rng(seed)
    order = int(rng.choice([1, 2, 4, 8, 12]))
    (u, y), weights = random_record(n, rng), None
    if kind == "faulty":
        size, frequency = 10 ** rng.uniform(-1.5, 1.0), rng.uniform(3 / n, 0.2)
        sine, onset = shapes.sine(n, angle=2 * np.pi * frequency), int(rng.integers(n // 4, 3 * n // 4))
        y[:, 0] += size * y.std() * signal(sine, onset)
    elif kind == "spiky":
        y[:, 0] += y.std() * np.where(rng.random(n) < 0.02, rng.standard_t(2, n), 0.0)
    elif kind == "drifting":
        y[:, 0] = np.cumsum(y[:, 0] - y.mean())
    elif kind == "smooth":
        y[:, 0] = lfilter([0.05], np.poly([0.8, 0.8, 0.8]).real, y[:, 0] - y.mean())
    elif kind == "noise-free":
        u, y = record(n, seed=seed, noise=0.0)
    elif kind == "weighted":
        weights = np.exp(lfilter([0.3], [1.0, -0.95], rng.standard_normal(n)))
    elif kind == "two outputs":
        y = np.hstack([y, lfilter([0.3], [1.0, -0.8], y, axis=0) + 0.1 * y.std() * rng.standard_normal((n, 1))])
    return prepare_scan(u, y, order=order, weights=weights, channel=y.shape[1] - 1)


@pytest.mark.first_rows(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_inner_products_are_those_of_the_tables(kind, seed):
    scan = made(kind, seed)
    frequencies, onset = np.array([0.007, 0.061, 0.31]), default_onsets(scan)[::7]
    of_sines = Sines(scan, 2 * np.pi * frequencies)
    for k, frequency in enumerate(frequencies):
        C, S = of_sines.inner_products(np.full(len(onset), k), onset)
        P, G = tabulate(scan, shapes.sine(scan.n_samples, angle=2 * np.pi * frequency).samples)
        at = onset + scan.order
        for i, a in enumerate(scan.degrees):
            expected = P[a][scan.n_base :, at - i]
            np.testing.assert_allclose(C[:, i], expected, rtol=0.0, atol=1e-11 * np.abs(P[0]).max())
            for j in range(i, scan.order + 1):
                product = G[a, scan.degrees[j], j - i]
                np.testing.assert_allclose(S[i, j], product[at - i], rtol=0.0, atol=1e-10 * np.abs(product).max())


@pytest.mark.first_rows(4)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_screened_statistic_is_at_most_the_exact_one(kind, seed):
    scan = made(kind, seed, n=120)
    frequencies = np.random.default_rng(seed).uniform(2.5 / scan.n_samples, 0.4, 4)
    for frequency, screened in zip(frequencies, screen_sines(scan, frequencies), strict=True):
        onsets = sine_onsets(scan, frequency, 6)
        exact = scan_shape(scan, shapes.sine(scan.n_samples, angle=2 * np.pi * frequency), onsets).statistic
        assert 0.0 <= screened <= exact.max() * (1.0 + 1e-6) + 1e-6


@pytest.mark.first_rows(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_no_sine_has_more_than_it_promises(kind, seed):
    scan = made(kind, seed, n=200)
    frequencies = np.random.default_rng(seed).uniform(2.5 / scan.n_samples, 0.4, 4)
    for frequency, promise in zip(frequencies, promised(scan, frequencies), strict=True):
        onsets = default_onsets(scan)
        onsets = onsets[onsets <= scan.n_samples - 2.0 / frequency]
        exact = scan_shape(scan, shapes.sine(scan.n_samples, angle=2 * np.pi * frequency), onsets).statistic.max()
        assert exact <= promise


@pytest.mark.parametrize("onset", [80, 150, 220])
def test_a_clear_sine_has_most_of_what_it_promises(onset):
    frequency, (u, y) = 0.11, record(300)
    y[:, 0] += 0.02 * y.std() * signal(shapes.sine(300, angle=2 * np.pi * frequency), onset)
    scan = prepare_scan(u, y, order=4)
    (promise,) = promised(scan, np.array([frequency]))
    exact = scan_shape(scan, shapes.sine(300, angle=2 * np.pi * frequency)).statistic.max()
    assert 0.8 * promise < exact <= promise


@pytest.mark.first_rows(8)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_the_highest_peak_at_few_onsets_is_that_at_all(kind, seed, monkeypatch):
    scan = made(kind, seed)
    grid = frequency_grid(scan, (3.0 / scan.n_samples, 0.2))
    few = screen_sines(scan, grid)
    monkeypatch.setattr(sines, "MOST_ONSETS", scan.n_samples)
    every = screen_sines(scan, grid)
    assert (few <= every * (1.0 + 1e-9)).all()
    assert few.max() > (0.999 if every.max() > CLEAR else 0.8) * every.max()


@pytest.mark.parametrize("spike", [120, 170, 400])
def test_onsets_before_a_spike_are_among_the_most_promising(spike):
    """The lagged copies of a sine are free in the samples after its onset: there they explain whatever stands out."""
    u, y = record(500)
    y[spike, 0] += 30.0 * y.std()
    scan = prepare_scan(u, y, order=4)
    kept = Sines(scan, np.array([0.05])).most_promising(0, default_onsets(scan))
    assert len(kept) == sines.MOST_ONSETS
    assert {*range(spike - scan.order, spike)} <= {*kept.tolist()}


def test_a_frequency_of_a_long_record_is_found():
    n, frequency = 2000, 0.1234
    u, y = record(n)
    y[:, 0] += 0.2 * signal(shapes.sine(n, angle=2 * np.pi * frequency), 1100)
    scan = prepare_scan(u, y, order=4)
    assert scan_frequency(scan, (3.0 / n, 0.2)) == pytest.approx(frequency, abs=0.1 / 900)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_units_change_no_peak(scale):
    u, y = record(300)
    found = []
    for of_u, of_y in ((u, y), (5.0 + scale * u, scale * y - 3.0)):
        scan = prepare_scan(of_u, of_y, order=4)
        found.append(screen_grid(scan, frequency_grid(scan, (0.01, 0.2))))
    assert peaks(found[1], 8).tolist() == peaks(found[0], 8).tolist()
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_progress_of_a_long_record_never_falls_and_ends_at_1():
    seen = []
    scan = prepare_scan(*record(1500), order=4)
    scan_frequency(scan, (3.0 / 1500, 0.2), seen.append)
    assert len(seen) > 20
    assert seen[0] < 0.1
    assert (np.diff(seen) >= 0.0).all()
    assert seen[-1] == 1.0


def test_a_sine_that_fits_nowhere_is_asked_for_at_no_onset():
    scan = prepare_scan(*record(300), order=4)
    none = sine_onsets(scan, 1.0 / 300, 6)
    assert not none.size
    assert screen_at(scan, np.array([1.0 / 300, 0.1]), [none, none]).tolist() == [0.0, 0.0]
    assert sine_onsets(scan, 0.25, 6).max() == 300 - 8
