"""Another rate: smooth signals are reproduced, fast ones removed, every channel treated alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_logs import made_log
from noted import texts

from bfi_cli.errors import BfiError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log, require_usable, resample, resample_with
from bfi_cli.flightlog.quality import is_uniform
from bfi_cli.flightlog.record import Channel, frozen_array
from bfi_cli.kernels.low_pass import decimate

RATE = 50.0
T = 7.0 + np.arange(0.0, 120.0, 1.0 / RATE)


def smooth(t: np.ndarray, rate: float = 10.0) -> np.ndarray:
    """Return a sine at 2 % of the Nyquist frequency of `rate`, where the ripple of the low-pass is below 1e-4."""
    frequency = 0.01 * rate
    return 80.0 + np.sin(2.0 * np.pi * frequency * t + 0.3)


@given(rate=st.floats(2.0, 50.0))
def test_a_slow_sine_is_reproduced_at_any_rate(rate: float):
    log = resample(made_log(T, tas=smooth(T, rate)), rate)
    assert log.rate_hz == pytest.approx(rate, rel=1.1e-3)
    assert is_uniform(log.time_s)
    assert log.time_s[0] - T[0] <= 11.0 / rate
    assert T[-1] - log.time_s[-1] <= 12.0 / rate
    np.testing.assert_allclose(log.channels["tas"].values, smooth(log.time_s, rate), rtol=0, atol=1e-4)


@pytest.mark.parametrize("rate", [10.0, 7.0])
def test_a_constant_stays_and_what_is_above_the_new_nyquist_goes(rate: float):
    log = resample(made_log(T, one=np.ones(T.size), fast=np.sin(2 * np.pi * 0.65 * rate * T)), rate)
    np.testing.assert_allclose(log.channels["one"].values, 1.0, rtol=0, atol=1e-12)
    assert np.abs(log.channels["fast"].values).max() < 2e-3


def test_a_whole_factor_is_the_kernel_and_its_time():
    x = np.random.default_rng(0).normal(size=T.size)
    log = resample(made_log(T, tas=x), 10.0)
    np.testing.assert_allclose(log.channels["tas"].values, decimate(x, 5), rtol=0, atol=1e-12)
    impulse = np.zeros(T.size)
    impulse[1000] = 1.0
    peak = resample(made_log(T, tas=impulse), 10.0)
    assert peak.time_s[np.argmax(peak.channels["tas"].values)] == pytest.approx(T[1000])


def test_the_same_rate_changes_nothing():
    log = made_log(T, tas=np.random.default_rng(0).normal(size=T.size))
    same = resample(log, RATE)
    np.testing.assert_array_equal(same.channels["tas"].values, log.channels["tas"].values)
    np.testing.assert_array_equal(same.time_s, log.time_s)


@settings(max_examples=15)
@given(jitter=st.floats(0.05, 0.3), rate=st.sampled_from([10.0, 7.0, 50.0, 2.0]), seed=st.integers(0, 99))
def test_an_uneven_axis_gives_the_same_signal_on_a_uniform_one(jitter: float, rate: float, seed: int):
    uneven = T + jitter / RATE * np.random.default_rng(seed).uniform(-1, 1, T.size)
    log = resample(made_log(uneven, tas=smooth(uneven, rate)), rate)
    require_usable(log, ["tas"])
    np.testing.assert_allclose(log.channels["tas"].values, smooth(log.time_s, rate), rtol=0, atol=1e-4)


@pytest.mark.parametrize(("period", "phase", "rate"), [(50, 0, 1.0), (50, 13, 1.0), (5, 2, 2.0), (10, 9, 5.0)])
def test_a_held_channel_is_sampled_once_per_hold_and_stays_in_step(period: int, phase: int, rate: float):
    tick = np.floor((np.arange(T.size) - phase) / period) * period + phase
    renewed = T[0] + tick / RATE
    log = resample(made_log(T, held=smooth(renewed, rate), free=smooth(T, rate)), rate)
    require_usable(log, ["held", "free"])
    np.testing.assert_allclose(log.channels["held"].values, smooth(log.time_s, rate), rtol=0, atol=1e-4)
    np.testing.assert_allclose(log.channels["free"].values, log.channels["held"].values, rtol=0, atol=1e-4)


def test_a_window_too_short_to_show_the_clock_has_that_of_the_log():
    renewed = T[0] + np.floor((np.arange(T.size) - 3) / 50) * 50 / RATE + 3 / RATE
    log = made_log(T, tas=smooth(renewed, 10.0))
    cut = resample(log, 10.0, from_s=40.0, to_s=45.0)
    whole = resample(log, 10.0).window(40.0, 45.0)
    np.testing.assert_allclose(cut.channels["tas"].values, whole.channels["tas"].values, rtol=0, atol=0.02)


def test_a_rate_above_that_of_a_held_channel_is_a_note():
    held = smooth(T)[(np.arange(T.size) // 50) * 50]
    log = resample(made_log(T, tas=held), 10.0)
    assert texts(log.notes) == ("'tas' has new values at 1 Hz only; at 10 Hz those between are interpolated",)


@settings(max_examples=15)
@given(rate=st.sampled_from([10.0, 7.0]), magnitude=st.floats(-5.0, 5.0).filter(lambda z: abs(z) > 0.1))
def test_the_clean_signal_goes_the_same_way(rate: float, magnitude: float):
    clean = made_log(T, tas=np.random.default_rng(0).normal(size=T.size))
    fault = Fault(shape="bias", channel="tas", magnitude=magnitude, onset_s=50.0)
    log = resample(inject(clean, [fault]), rate)
    expected = resample(clean, rate).channels["tas"].values
    assert log.truth is not None
    assert log.truth.faults == (fault,)
    np.testing.assert_array_equal(log.truth.clean["tas"], expected)
    late = log.time_s > 50.0 + 11.0 / rate
    np.testing.assert_allclose((log.channels["tas"].values - expected)[late], magnitude, rtol=1e-3)


@pytest.mark.parametrize("rate", [10.0, 7.0])
def test_the_samples_around_a_window_serve_the_filter(rate: float):
    log = made_log(T, tas=smooth(T) + np.random.default_rng(0).normal(size=T.size))
    cut = resample(log, rate, from_s=40.0, to_s=60.0)
    assert cut.time_s[0] - 40.0 <= 1.001 / rate
    assert 60.0 - cut.time_s[-1] <= 1.001 / rate
    assert cut.n_samples == pytest.approx(20.0 * rate, abs=1)
    if rate == 10.0:
        whole = resample(log, rate).window(40.0, 60.0)
        np.testing.assert_allclose(cut.channels["tas"].values, whole.channels["tas"].values, rtol=0, atol=1e-12)


@pytest.mark.parametrize("rate", [10.0, 7.0])
def test_nan_stays_where_the_filter_sees_it(rate: float):
    tas = smooth(T)
    tas[3000] = np.nan
    log = resample(made_log(T, tas=tas, cas=smooth(T), empty=np.full(T.size, np.nan)), rate)
    bad = np.isnan(log.channels["tas"].values)
    assert bad[np.abs(log.time_s - T[3000]) < 8.0 / rate].all()
    assert not bad[np.abs(log.time_s - T[3000]) > 12.0 / rate].any()
    assert np.isfinite(log.channels["cas"].values).all()
    assert np.isnan(log.channels["empty"].values).all()


@pytest.mark.parametrize(
    ("keep", "rate", "message"),
    [
        (np.delete(np.arange(T.size), slice(2000, 2100)), 10.0, "gap of 2.02 s from 46.98 s to 49 s; choose a window"),
        (np.arange(T.size), 60.0, "recorded at 50 Hz, it cannot be resampled to 60 Hz; give --rate 50 or less"),
        (np.arange(T.size), 0.0, "--rate: must be a positive number, got 0 Hz"),
        (np.arange(T.size), np.nan, "--rate: must be a positive number, got nan Hz"),
        (np.arange(T.size), 0.005, "120 s long, shorter than one step at 0.005 Hz; give a higher --rate"),
        (np.arange(T.size), 0.1, "6000 samples are fewer than the 8001 taps"),
        (np.arange(100), 7.0, "100 samples are fewer than the filter of the resampling by 7/50 needs"),
    ],
)
def test_what_cannot_be_resampled_is_one_line(keep: np.ndarray, rate: float, message: str):
    with pytest.raises(BfiError) as caught:
        resample(made_log(T[keep], tas=smooth(T[keep])), rate)
    assert message in str(caught.value)


def test_a_gap_outside_the_window_does_not_matter():
    keep = np.delete(np.arange(T.size), slice(2000, 2100))
    log = resample(made_log(T[keep], tas=smooth(T[keep])), 10.0, from_s=60.0, to_s=80.0)
    np.testing.assert_allclose(log.channels["tas"].values, smooth(log.time_s), rtol=0, atol=1e-4)


@pytest.mark.realdata
@pytest.mark.parametrize("rate", [1.0, 2.0, 3.0])
def test_a_recorded_flight(flights: Path, rate: float):
    log = read_log(flights / "citation_20180312_f1.h5")
    slow = resample(log, rate, from_s=3225.0, to_s=3440.0)
    tas = np.interp(slow.time_s, log.time_s, log.channels["tas"].values)
    assert np.abs(slow.channels["tas"].values - tas).max() < 1.0
    require_usable(slow, ["tas", "elevator"])


@pytest.mark.parametrize("rate_hz", [100.0, 10.0, 12.7])
@pytest.mark.parametrize("uneven", [False, True])
def test_signals_beside_the_log_go_through_the_filter_of_its_channels(rate_hz, uneven):
    """Each is resampled as it would be as a channel of the log."""
    time_s = np.arange(3000) / 100.0
    if uneven:
        time_s = time_s + 1e-3 * np.random.default_rng(0).uniform(-1.0, 1.0, time_s.size)
    steps = np.stack([time_s >= 13.8, np.zeros(time_s.size), np.maximum(time_s - 9.0, 0.0)], axis=1).reshape(-1, 3, 1)
    waves = np.sin(np.outer(time_s, [1.0, 7.0, 20.0])).reshape(-1, 3, 1)
    extra = np.concatenate([steps, waves], axis=2)
    values = {f"c{i}{j}": extra[:, i, j] for i in range(3) for j in range(2)}
    channels = {name: Channel(name=name, values=frozen_array(x), unit="", source=name) for name, x in values.items()}
    log = FlightLog(path="made.h5", time_s=frozen_array(time_s), channels=channels)
    resampled, carried = resample_with(log, extra, rate_hz, from_s=5.0, to_s=25.0)
    assert carried.shape == (resampled.n_samples, 3, 2)
    for i in range(3):
        for j in range(2):
            np.testing.assert_allclose(carried[:, i, j], resampled.channel(f"c{i}{j}").values, rtol=0, atol=1e-12)
    alone = resample(log, rate_hz, from_s=5.0, to_s=25.0)
    np.testing.assert_array_equal(alone.time_s, resampled.time_s)
