"""A cliff in the spectra of all channels is a recorder's; a power law, one channel, or noise are none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, firwin, lfilter, sosfiltfilt

from bfi_cli.kernels.low_pass import recorder_from_spectra

FACTOR, RATE_HZ = 10, 10.0
FINE_HZ = FACTOR * RATE_HZ


@pytest.fixture(scope="module")
def motion() -> list[np.ndarray]:
    """Return channels with spectra that fall as powers of the frequency, some with a mode, at the fine rate."""
    rng = np.random.default_rng(0)
    channels = []
    for damping, angle in ((0.02, 0.03), (0.01, 0.01), (0.05, 0.02), (0.03, 0.0), (0.002, 0.0)):
        gust = lfilter([1.0], [1.0, -0.998], rng.standard_normal(200_000))
        channels.append(lfilter([1.0], [1.0, -2 * np.exp(-damping) * np.cos(angle), np.exp(-2 * damping)], gust))
    return [channel / channel.std() for channel in channels]


def gaussian(x: np.ndarray, edge_hz: float) -> np.ndarray:
    sd_s = np.sqrt(np.log(2.0) / 2.0) / (np.pi * edge_hz)
    lag = np.arange(-int(6 * sd_s * FINE_HZ), int(6 * sd_s * FINE_HZ) + 1) / FINE_HZ
    taps = np.exp(-0.5 * (lag / sd_s) ** 2)
    return np.convolve(x, taps / taps.sum(), mode="same")


def fir(x: np.ndarray, edge_hz: float) -> np.ndarray:
    half = round(1.3 * FINE_HZ / edge_hz)
    return np.convolve(x, firwin(2 * half + 1, edge_hz, window=("kaiser", 5.0), fs=FINE_HZ), mode="same")


def butterworth(x: np.ndarray, edge_hz: float) -> np.ndarray:
    return sosfiltfilt(butter(4, edge_hz, fs=FINE_HZ, output="sos"), x)


def recorded(channels: list[np.ndarray], noise: float = 1e-5) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [channel[::FACTOR] + noise * rng.standard_normal(len(channel[::FACTOR])) for channel in channels]


@pytest.mark.parametrize("record", [gaussian, fir, butterworth])
@pytest.mark.parametrize("edge_hz", [0.75, 1.3])
def test_the_edge_is_right_for_the_right_kind(
    motion: list[np.ndarray], record: Callable[[np.ndarray, float], np.ndarray], edge_hz: float
):
    seen = recorder_from_spectra(recorded([record(one, edge_hz) for one in motion]), RATE_HZ)
    edges = {seen.kind: seen.edge_hz, **dict(seen.others)}
    assert seen.n_channels >= 3
    assert edges[record.__name__] == pytest.approx(edge_hz, rel=0.2)
    assert 0.5 * edge_hz < seen.edge_hz < 2.0 * edge_hz


def test_units_and_the_length_of_the_clock_change_nothing(motion: list[np.ndarray]):
    channels = recorded([gaussian(one, 0.75) for one in motion])
    seen = recorder_from_spectra(channels, RATE_HZ)
    other = recorder_from_spectra([300.0 - 57.3 * one for one in channels], 2.0 * RATE_HZ)
    assert (other.kind, other.n_channels) == (seen.kind, seen.n_channels)
    assert other.edge_hz == pytest.approx(2.0 * seen.edge_hz)


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3, 0.1])
def test_motion_itself_is_no_recorder(motion: list[np.ndarray], noise: float):
    assert recorder_from_spectra(recorded(motion, noise), RATE_HZ) is None
    assert recorder_from_spectra(motion, FINE_HZ) is None


def test_a_sensor_with_a_low_pass_of_its_own_is_no_recorder(motion: list[np.ndarray]):
    filtered = [gaussian(motion[0], 0.75), *motion[1:]]
    assert recorder_from_spectra(recorded(filtered), RATE_HZ) is None


def test_noise_behind_the_recorder_hides_it(motion: list[np.ndarray]):
    assert recorder_from_spectra(recorded([gaussian(one, 0.75) for one in motion], 0.1), RATE_HZ) is None


def test_channels_that_tell_nothing():
    empty = [np.zeros(5000), np.full(5000, np.nan), np.arange(5000.0), np.zeros(3), np.full(5000, 1e200), np.zeros(0)]
    assert recorder_from_spectra(empty, RATE_HZ) is None
