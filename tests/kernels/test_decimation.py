"""Decimation: the same linear map for every signal, so linear relations survive it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal, stats

from bfi_cli.kernels.low_pass import SHARP, WHITE, Lowpass, decimate, lost_samples, lowpass_taps

LOWPASSES = {
    "sharp": SHARP,
    "white": WHITE,
    "causal": Lowpass(half_width=2, cutoff=1.2, kind="causal"),
}
EVERY = pytest.mark.parametrize("lowpass", LOWPASSES.values(), ids=LOWPASSES)


@EVERY
@pytest.mark.parametrize("factor", [1, 2, 5, 10, 50])
def test_gain_at_zero_frequency_is_one(lowpass, factor):
    assert lowpass_taps(factor, lowpass).sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(decimate(np.full(1000, 85.0), factor, lowpass), 85.0, rtol=1e-12)


@EVERY
@given(factor=st.integers(2, 12), n=st.integers(250, 400), slope=st.floats(-5, 5))
def test_a_ramp_comes_out_at_the_times_of_the_rows(lowpass, factor, n, slope):
    """A linear-phase filter leaves a ramp alone; a causal one delays it by a constant."""
    ramp = slope * np.arange(n)
    out = decimate(ramp, factor, lowpass)
    before, after = lost_samples(factor, lowpass)
    rows = before + factor * np.arange(len(out))
    assert rows[-1] < n - after <= rows[-1] + factor
    taps = lowpass_taps(factor, lowpass)
    delay = 0.0 if lowpass.kind == "linear-phase" else float(taps @ np.arange(taps.size))
    np.testing.assert_allclose(out, slope * (rows - delay), atol=1e-9 * n)


@pytest.mark.parametrize("lowpass", [SHARP, WHITE], ids=["sharp", "white"])
def test_a_slow_sine_passes_and_keeps_its_phase(lowpass):
    factor, n = 10, 4000
    wave = np.sin(2 * np.pi * np.arange(n) / 1000)
    out = decimate(wave, factor, lowpass)
    expected = wave[lost_samples(factor, lowpass)[0] :: factor][: len(out)]
    np.testing.assert_allclose(out, expected, atol=2e-3)


def test_sharp_stops_what_would_alias():
    factor, n = 10, 4000
    for frequency in (0.07, 0.1, 0.23, 0.5):
        out = decimate(np.cos(2 * np.pi * frequency * np.arange(n)), factor, SHARP)
        assert np.abs(out).max() < 2e-3


@EVERY
def test_a_difference_equation_survives_the_filter_exactly(lowpass):
    """Filter without decimating: a VARX and its faults hold sample by sample, from the first row to the last."""
    rng = np.random.default_rng(0)
    u, theta = rng.standard_normal(600), (np.arange(600) >= 200.0).astype(float)
    y = signal.lfilter([0.0, 0.5, -0.2], [1.0, -1.6, 0.7], u)
    taps = lowpass_taps(4, lowpass)
    u_f, y_f, theta_f = (np.convolve(x, taps, mode="valid") for x in (u, y + 3.0 * theta, theta))
    yf = y_f - 3.0 * theta_f
    error = yf[2:] - 1.6 * yf[1:-1] + 0.7 * yf[:-2] - 0.5 * u_f[1:-1] + 0.2 * u_f[:-2]
    np.testing.assert_allclose(error, 0.0, atol=1e-12 * np.abs(y).max() * 10)
    for x, filtered in ((u, u_f), (y + 3.0 * theta, y_f)):
        np.testing.assert_allclose(decimate(x, 4, lowpass), filtered[::4], atol=1e-12 * np.abs(x).max())


@EVERY
@settings(max_examples=15)
@given(a=st.floats(-10, 10), b=st.floats(-10, 10), factor=st.integers(1, 9))
def test_decimation_is_linear_and_acts_channel_by_channel(lowpass, a, b, factor):
    x = np.random.default_rng(1).standard_normal((200, 2, 3))
    both = decimate(x, factor, lowpass)
    assert both.shape[1:] == (2, 3)
    one, other = (decimate(np.ascontiguousarray(x[:, i, 2]), factor, lowpass) for i in range(2))
    np.testing.assert_allclose(both[:, 0, 2], one, atol=1e-13)
    combined = decimate(a * x[:, 0, 2] + b * x[:, 1, 2], factor, lowpass)
    np.testing.assert_allclose(combined, a * one + b * other, atol=1e-12)


@pytest.mark.parametrize("factor", [2, 5, 10])
def test_white_noise_keeps_the_autocorrelation_of_the_filter(factor):
    """White passes nearly white noise: an AR of any order would predict a few percent of its variance."""
    e = np.random.default_rng(2).standard_normal(20_000 * factor)
    for lowpass, predictable in ((WHITE, False), (SHARP, True)):
        taps = lowpass_taps(factor, lowpass)
        own = np.correlate(taps, taps, mode="full")[taps.size - 1 :][::factor] / (taps @ taps)
        assert bool(2.0 * np.sum(own[1:] ** 2) > 0.1) == predictable
        out = decimate(e, factor, lowpass)
        out = out - out.mean()
        r = np.array([out[lag:] @ out[:-lag] for lag in range(1, 4)]) / (out @ out)
        np.testing.assert_allclose(r, own[1:4], atol=stats.norm.isf(1e-7) * np.sqrt(1.5 / len(out)))


def test_causal_shows_nothing_before_the_event_and_linear_phase_does():
    step = (np.arange(600) >= 300).astype(float)
    for lowpass, early in ((LOWPASSES["causal"], False), (WHITE, True)):
        out = decimate(step, 10, lowpass)
        rows = lost_samples(10, lowpass)[0] + 10 * np.arange(len(out))
        assert np.any(out[rows < 300] != 0.0) == early
        np.testing.assert_allclose(out[-5:], 1.0, rtol=1e-12)


@pytest.mark.parametrize("factor", [2, 10])
def test_causal_has_the_magnitude_of_the_symmetric_filter(factor):
    frequencies = np.linspace(0, np.pi / factor, 50)
    symmetric, causal = (
        np.abs(signal.freqz(lowpass_taps(factor, LOWPASSES[kind]), worN=frequencies)[1]) for kind in ("white", "causal")
    )
    np.testing.assert_allclose(causal, symmetric, atol=0.02)


@EVERY
def test_input_is_not_modified_nor_returned(lowpass):
    x = np.random.default_rng(3).standard_normal(300)
    copy = x.copy()
    for factor in (1, 4):
        out = decimate(x, factor, lowpass)
        out[:] = 0.0
        np.testing.assert_array_equal(x, copy)


@EVERY
def test_length_is_refused_below_the_taps_and_enough_at_them(lowpass):
    n = lowpass_taps(4, lowpass).size
    assert decimate(np.ones(n), 4, lowpass).shape == (1,)
    with pytest.raises(ValueError, match=f"{n - 1} samples are fewer than the {n} taps of the decimation by 4"):
        decimate(np.ones(n - 1), 4, lowpass)


def test_a_factor_below_one_is_refused():
    with pytest.raises(ValueError, match="factor must be at least 1, got 0"):
        lowpass_taps(0)


def test_factor_one_loses_nothing():
    assert lost_samples(1, WHITE) == (0, 0)
    assert lowpass_taps(1).tolist() == [1.0]
