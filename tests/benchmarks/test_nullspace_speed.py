"""The updated criterion against a fresh decomposition of every window: 200 samples, one thread, the same numbers."""

from __future__ import annotations

import time

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from bfi_cli.aircraft.catalogue import B747
from bfi_cli.aircraft.model import response
from bfi_cli.kernels.nullspace import TOLERANCE, criteria

pytestmark = pytest.mark.benchmarks

N, WIDTH, ROUNDS, BAR = 600, 200, 3, 5


def record(n_inputs: int):
    """Return (y, u) with a failure of the angle of attack in the middle; the inputs move on their own."""
    rng = np.random.default_rng(0)
    u = np.zeros((N, len(B747.inputs)))
    u[:, rng.permutation(len(B747.inputs))[:n_inputs]] = 0.05 * rng.standard_normal((N, n_inputs))
    y = response(B747, u, rate_hz=50.0, rule="euler")
    y[N // 2 :, 0] *= 0.9
    return y, u


def fresh(y, u, *, full: bool):
    """Return the criteria of the whole windows, each by a decomposition of its own.

    The full one gives the null space N and |Y N|; the thin one the row space V of Z and |Y - Y V V'|, the same number.
    """
    found = np.full(y.shape, np.nan)
    rows = np.hstack([y[:-1], u[:-1], u[1:], y[1:]])
    peaks = np.maximum.accumulate(np.abs(rows), axis=0)
    n_z = rows.shape[1] - y.shape[1]
    for i in range(WIDTH, N):
        window = rows[i - WIDTH : i] / np.where(peaks[i - 1] > 0.0, peaks[i - 1], 1.0)
        Z, Y = window[:, :n_z].T, window[:, n_z:].T
        _, values, V = np.linalg.svd(Z, full_matrices=full)
        rank = np.count_nonzero(values > TOLERANCE * values[0])
        rest = Y @ V[rank:].T if full else Y - (Y @ V[:rank].T) @ V[:rank]
        found[i] = np.linalg.norm(rest, axis=1) / np.sqrt(WIDTH)
    return found


def best_of(rounds: int, run):
    """Return the shortest processor time of `rounds` warm runs, and what the last returned."""
    result, seconds = run(), []
    for _ in range(rounds):
        start = time.process_time()
        result = run()
        seconds.append(time.process_time() - start)
    return min(seconds), result


@pytest.mark.parametrize("n_inputs", [2, 9])
def test_update_against_fresh(n_inputs, capsys):
    y, u = record(n_inputs)
    with threadpool_limits(1):
        fast, found = best_of(ROUNDS, lambda: criteria(y, u, width=WIDTH))
        thin, expected = best_of(ROUNDS, lambda: fresh(y, u, full=False))
        full, printed = best_of(1, lambda: fresh(y, u, full=True))
    np.testing.assert_allclose(found.channel[WIDTH:], expected[WIDTH:], atol=1e-8)
    np.testing.assert_allclose(found.channel[WIDTH:], printed[WIDTH:], atol=1e-8)
    each, thin, full = fast / (N - 1) * 1e6, thin / (N - WIDTH) * 1e6, full / (N - WIDTH) * 1e6
    with capsys.disabled():
        print(
            f"\nwindow {WIDTH}, {n_inputs} moving inputs, per sample: update {each:.0f} us, thin SVD {thin:.0f} us "
            f"(ratio {thin / each:.1f}), full SVD {full:.0f} us (ratio {full / each:.1f}); bar {BAR}; they differ by "
            f"{np.nanmax(np.abs(found.channel - expected)[WIDTH:]):.1e}"
        )
