"""The scan over all onsets against one solve per onset: 3172 samples, one thread, best of a few runs.

The solves per onset are timed on a random sample of onsets and scaled to all of them.
"""

from __future__ import annotations

import runpy
import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from bfi_cli.kernels.lagged import compress
from bfi_cli.kernels.onset import waveform as shapes
from bfi_cli.kernels.onset.frequency import (
    frequency_grid,
    scan_frequency,
    scan_frequency_ends,
    screen_grid,
)
from bfi_cli.kernels.onset.pairs import scan_ends
from bfi_cli.kernels.onset.scan import default_onsets, prepare_scan, scan_shape
from bfi_cli.kernels.risro_varx import risro_varx

pytestmark = pytest.mark.benchmarks

KERNELS = Path(__file__).parents[1] / "kernels"
plain = runpy.run_path(str(KERNELS / "plain_onset.py"))
plain_varx = runpy.run_path(str(KERNELS / "plain_risro.py"))["plain_varx"]

N, ONSET, STEP_S, ROUNDS, SAMPLE = 3172, 1500, 0.1, 7, 12
SHAPES = {
    "bias": shapes.bias(N),
    "drift": shapes.drift(N, step_s=STEP_S),
    "sine": shapes.sine(N, angle=2 * np.pi * 0.05),
}


def faulty_record(waveform, *, end=None):
    """Return (u, y) that carries the fault from sample 1500 on."""
    u, y = plain["record"](N)
    y[:, 0] += 0.5 * plain["signal"](waveform, ONSET, end)
    return u, y


def best_of(rounds, run):
    """Return the shortest time of `rounds` runs."""
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def per_onset(solve, onsets):
    """Return the seconds that a solve for every onset takes, from a random sample of them, each the best of two."""
    sample = np.random.default_rng(0).choice(onsets, SAMPLE, replace=False)
    return np.mean([best_of(2, lambda onset=onset: solve(onset)) for onset in sample]) * len(onsets)


@pytest.mark.parametrize("order", [4, 10])
@pytest.mark.parametrize("name", SHAPES)
def test_all_onsets(name, order, capsys):
    waveform = SHAPES[name]
    u, y = faulty_record(waveform)
    centred = y - y.mean()

    def compressed(onset):
        theta = plain["signal"](waveform, onset)[:, None, None]
        return compress(u, centred, theta, order=order, feedthrough=True)

    def thesis(onset):
        theta = plain["signal"](waveform, onset)[:, None, None]
        plain_varx(u, centred, theta, order=order, start=(np.array([0.5]), np.full(order, 1.0 / order)))

    def newton(onset):
        plain["gauss_newton"](u, y, plain["signal"](waveform, onset), order=order)

    with threadpool_limits(1):
        scan = best_of(ROUNDS, lambda: scan_shape(prepare_scan(u, y, order=order), waveform))
        onsets = default_onsets(prepare_scan(u, y, order=order))
        baselines = {
            "RISRO as the thesis writes it, 50 steps": (per_onset(thesis, onsets), 500),
            "RISRO compressed, 50 steps": (
                per_onset(lambda onset: risro_varx(compressed(onset), as_published=True), onsets),
                500,
            ),
            "RISRO compressed, own stopping": (per_onset(lambda onset: risro_varx(compressed(onset)), onsets), 500),
            "Gauss-Newton least squares": (per_onset(newton, onsets), 50),
        }
    with capsys.disabled():
        print(f"\n{name}, order {order}, {len(onsets)} onsets: scan {scan * 1e3:.0f} ms (bar 300 ms at order 4)")
        for what, (seconds, bar) in baselines.items():
            print(f"  {what}: {seconds:.1f} s for all onsets, ratio {seconds / scan:.0f} (bar {bar})")


@pytest.mark.parametrize("order", [4, 10])
@pytest.mark.parametrize("name", SHAPES)
def test_start_and_end(name, order, capsys):
    u, y = faulty_record(SHAPES[name], end=1900)
    with threadpool_limits(1):
        seconds = best_of(3, lambda: scan_ends(prepare_scan(u, y, order=order), SHAPES[name]))
    with capsys.disabled():
        print(f"\n{name}, order {order}: start and end {seconds:.2f} s (bar 2 s)")


@pytest.mark.parametrize("n", [240, 600])
def test_unknown_frequency(n, capsys):
    u, y = plain["record"](n)
    y[:, 0] += 0.5 * plain["signal"](shapes.sine(n, angle=2 * np.pi * 0.0713), n // 3, 2 * n // 3)
    band = (3.0 / n, 0.2)
    with threadpool_limits(1):
        scan = prepare_scan(u, y, order=4)
        to_end, both = (best_of(3, lambda run=run: run(scan, band)) for run in (scan_frequency, scan_frequency_ends))
    with capsys.disabled():
        print(f"\n{n} samples, order 4: frequency and onset {to_end:.2f} s, with the end too {both:.2f} s")


@pytest.mark.parametrize("order", [2, 12])
def test_grid_of_frequencies_of_a_long_record(order, capsys):
    n = 6000
    with threadpool_limits(1):
        scan = prepare_scan(*plain["record"](n), order=order)
        grid = frequency_grid(scan, (3.0 / n, 0.2))
        seconds = best_of(1, lambda: screen_grid(scan, grid))
    with capsys.disabled():
        print(f"\n{n} samples, order {order}: grid of frequencies {seconds:.1f} s")
