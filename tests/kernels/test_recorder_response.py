"""The recorder's low-pass from jumps of one quantum: the filter that was there, or none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from bfi_cli.kernels.low_pass import recorder_from_jumps

QUANTUM, FACTOR = 0.25, 10


def jumping(n: int, seed: int = 0) -> np.ndarray:
    """Return a channel at 100 Hz that rests on one level of its quantisation and then on the next."""
    rng = np.random.default_rng(seed)
    x = np.zeros(n * FACTOR)
    x[rng.choice(len(x), n // 60, replace=False)] = rng.choice([-QUANTUM, QUANTUM], n // 60)
    return np.cumsum(x)


def gaussian(x, edge_hz):
    sd = np.sqrt(np.log(2) / 2) / np.pi / edge_hz * 100.0
    lag = np.arange(-int(6 * sd), int(6 * sd) + 1)
    taps = np.exp(-0.5 * (lag / sd) ** 2)
    return np.convolve(x, taps / taps.sum(), mode="same")


def butterworth(x, edge_hz):
    return signal.sosfiltfilt(signal.butter(4, edge_hz, fs=100.0, output="sos"), x)


def causal(x, edge_hz):
    return signal.sosfilt(signal.butter(2, edge_hz / 3**0.25, fs=100.0, output="sos"), x)


@pytest.mark.parametrize(
    ("kind", "filtered", "edge_hz"),
    [
        ("gaussian", gaussian, 0.75),
        ("gaussian", gaussian, 1.5),
        ("butterworth", butterworth, 1.3),
        ("causal", causal, 1.6),
    ],
)
def test_the_filter_that_was_there(kind, filtered, edge_hz):
    y = filtered(jumping(30_000), edge_hz)[::FACTOR]
    seen = recorder_from_jumps([y], 10.0)
    assert seen is not None
    assert seen.kind == kind
    assert seen.edge_hz == pytest.approx(edge_hz, rel=0.03)
    assert seen.n_jumps >= 40


def test_jumps_as_sharp_as_samples_say_that_there_is_none():
    seen = recorder_from_jumps([jumping(30_000)[::FACTOR]], 10.0)
    assert seen is not None
    assert (seen.kind, seen.edge_hz) == (None, None)


def test_channels_without_jumps_say_nothing():
    rng = np.random.default_rng(1)
    smooth = gaussian(np.cumsum(rng.standard_normal(100_000)), 0.75)[::FACTOR]
    assert recorder_from_jumps([smooth, np.zeros(10_000), np.full(100, np.nan)], 10.0) is None


def test_the_steps_of_a_manoeuvre_are_too_few():
    assert recorder_from_jumps([gaussian(np.repeat([0.0, 1.0, -1.0, 1.0, 0.0], 1000), 0.75)[::FACTOR]], 10.0) is None
