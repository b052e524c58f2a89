"""RISRO on the compressed data against algorithm 3 written out plainly: 50 steps, one thread, same start and corner."""

from __future__ import annotations

import runpy
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from threadpoolctl import threadpool_limits

from bfi_cli.kernels.lagged import compress
from bfi_cli.kernels.risro_varx import risro_varx

pytestmark = pytest.mark.benchmarks

plain_varx = runpy.run_path(str(Path(__file__).parents[1] / "kernels" / "plain_risro.py"))["plain_varx"]

DT, ROUNDS = 0.1, 5
K = -np.poly([0.9 * np.exp(0.3j), 0.9 * np.exp(-0.3j), 0.6, 0.3]).real[1:]
Z = np.array([4.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0])


def record(n: int):
    """Return (u, y, theta) with a bias, a drift and five sinusoids of onsets spread over the record."""
    rng = np.random.default_rng(0)
    t, onset = np.arange(n) * DT, np.ceil(n / np.array([2.3, 4.0, 5.0, 3.0, 6.0, 5.5, 4.3])) * DT
    frequency = np.array([0.0, 0.0, 1.15, 1.125, 0.7, 0.4, 2.25])
    theta = np.cos(2 * np.pi * frequency * t[:, None])
    theta[:, 1] = 0.23 * (t - onset[1]) * 100.0 / t[-1]
    theta *= t[:, None] >= onset
    u = np.sign(lfilter([1.0], [1.0, -0.95], rng.standard_normal(n)))
    drive = lfilter([0.0, 0.5, -0.3, 0.2, 0.1], [1.0], u) + 0.01 * rng.standard_normal(n)
    y = lfilter([1.0], np.r_[1.0, -K], drive) + theta @ Z
    return u[:, None], y[:, None], theta[:, None]


def best_of(rounds: int, run):
    """Return the shortest time of `rounds` warm runs, and what the last returned."""
    result, seconds = run(), []
    for _ in range(rounds):
        start = time.perf_counter()
        result = run()
        seconds.append(time.perf_counter() - start)
    return min(seconds), result


@pytest.mark.parametrize(("n", "order", "bar", "rounds"), [(3172, 4, 4, 5), (3172, 45, 2.5, 5), (300_000, 4, 15, 1)])
def test_fifty_steps(n, order, bar, rounds, capsys):
    u, y, theta = record(n)
    with threadpool_limits(1):
        nearby = risro_varx(compress(u, y, theta, order=order))
        start = nearby.z + 0.3, 0.98 * nearby.K
        compressed, _ = best_of(ROUNDS, lambda: compress(u, y, theta, order=order))
        fast, found = best_of(
            ROUNDS, lambda: risro_varx(compress(u, y, theta, order=order), initial=start, as_published=True)
        )
        plain, z = best_of(rounds, lambda: plain_varx(u, y, theta, order=order, start=start))
    np.testing.assert_allclose(found.z, z, atol=1e-8)
    with capsys.disabled():
        print(
            f"\nN = {n}, order {order}: plain {plain * 1e3:.1f} ms, fast {fast * 1e3:.1f} ms "
            f"(compress {compressed * 1e3:.1f} ms), ratio {plain / fast:.1f} (bar {bar}), "
            f"z differs by {np.abs(found.z - z).max():.1e}"
        )


def test_memory_of_a_million_samples(capsys):
    peaks = {}
    for n in (10_000, 1_000_000):
        u, y, theta = record(n)
        tracemalloc.start()
        found = risro_varx(compress(u, y, theta, order=4))
        peaks[n] = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        np.testing.assert_allclose(found.K, K, atol=0.05)
    assert peaks[1_000_000] < 1.01 * peaks[10_000]
    with capsys.disabled():
        print(f"\nworking memory in MB beyond the record, by samples: {peaks}")
