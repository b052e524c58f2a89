"""The rate of an analysis, and the one filter that brings everything there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.errors import LogError
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.low_pass import WHITE, Lowpass
from bfi_cli.model.preprocessing import signals as module
from bfi_cli.model.preprocessing.signals import (
    SAMPLES_PER_EDGE,
    NativeSignals,
    Signals,
    candidate_orders,
    choose_rate,
    decimate_native,
    is_exact,
)

CITATION = MODELS["citation"]
BIAS = Fault(shape="bias", channel="tas", onset_s=13.8)
SINE = Fault(shape="sine", channel="tas", onset_s=0.2, frequency_hz=2.25)


def flown(*, seconds: float, rate_hz: float = 100.0, noise_sd: float = 0.02, seed: int = 0) -> FlightLog:
    """Fly the Citation without a fault."""
    return simulate(
        CITATION,
        manoeuvre("3211", time_axis(duration_s=seconds, rate_hz=rate_hz)),
        rng=np.random.default_rng(seed),
        rate_hz=rate_hz,
        noise_sd={"tas": noise_sd},
    )


def record(*, seconds: float = 30.0, rate_hz: float = 100.0, noise_sd: float = 0.02, faults=(BIAS,), seed=0) -> Signals:
    """Fly the Citation; the dictionary holds `faults`, none is in the record."""
    log = flown(seconds=seconds, rate_hz=rate_hz, noise_sd=noise_sd, seed=seed)
    theta = np.stack([unit_signal(fault, log.time_s, window_start_s=0.0) for fault in faults], axis=1)
    return Signals(
        path="made.h5",
        rate_hz=rate_hz,
        factor=1,
        time_s=log.time_s,
        u=log.signals(["elevator"]),
        y=log.signals(["tas"]),
        theta=theta[:, None, :],
    )


def native(*, seconds: float = 30.0) -> NativeSignals:
    """Fly the Citation; the dictionary holds BIAS, which is not in the record."""
    log = replace(flown(seconds=seconds), path="made.h5")
    return NativeSignals(log=log, inputs=("elevator",), outputs=("tas",), faults=(BIAS,), seen=(0,))


def with_tas(signals: NativeSignals, tas: np.ndarray) -> NativeSignals:
    log = signals.log
    channel = replace(log.channel("tas"), values=frozen_array(tas))
    return replace(signals, log=replace(log, channels={**log.channels, "tas": channel}))


def recorder(x: np.ndarray, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    """Low-pass as a recorder does, without transient at the start."""
    return signal.sosfiltfilt(signal.butter(6, cutoff_hz, fs=rate_hz, output="sos"), x, axis=0)


def sampled(log: Signals, rows: slice) -> np.ndarray:
    """Return some samples of the signals of a dictionary."""
    return np.asarray(log.theta)[rows]


@pytest.mark.parametrize(
    ("made", "faults", "rate_hz", "reason"),
    [
        ({}, (BIAS,), 10.0, "rigid-body"),
        ({}, (BIAS, SINE), 10.0, "rigid-body"),
        ({"seconds": 200.0, "rate_hz": 20.0}, (BIAS,), 20.0 / 6, "rigid-body"),
        ({"seconds": 200.0, "rate_hz": 20.0}, (BIAS, SINE), 10.0, "2.25 Hz is the fastest oscillation"),
        ({"seconds": 2000.0, "rate_hz": 10.0}, (BIAS,), 1.0, "rigid-body"),
        ({"seconds": 60.0, "rate_hz": 8.0}, (BIAS,), 8.0, "the log's own rate; 10 Hz suits rigid-body"),
        ({"seconds": 5.0}, (BIAS,), 20.0, "window of 5 s"),
        ({"noise_sd": 0.0}, (BIAS, SINE), 100.0, "to round-off"),
    ],
)
def test_the_chosen_rate(made, faults, rate_hz, reason):
    log = record(faults=faults, **made)
    factor, why = choose_rate(log, faults, exact=is_exact(log))
    assert log.rate_hz / factor == pytest.approx(rate_hz)
    assert reason in why


def test_a_log_low_passed_by_its_recorder_runs_near_its_bandwidth():
    """1.3 Hz, then 10 Hz: about 2 Hz, for the rest of the band is empty."""
    fast = record(seconds=120.0, noise_sd=0.05)
    slow = {name: recorder(getattr(fast, name), 1.3, 100.0)[::10] for name in ("u", "y")}
    log = replace(fast, rate_hz=10.0, time_s=fast.time_s[::10], theta=sampled(fast, slice(None, None, 10)), **slow)
    factor, why = choose_rate(log, (BIAS,), exact=False)
    assert 1.5 <= log.rate_hz / factor <= 3.4
    assert "low-passed" in why


@pytest.mark.parametrize(("purpose", "rate_hz", "order"), [("estimate", 10.0 / 3.0, 8), ("scan", 2.0, 6)])
def test_a_known_recorder_fixes_rate_and_order(purpose, rate_hz, order):
    fast = record(seconds=120.0, noise_sd=0.05)
    slow = {name: getattr(fast, name)[::10] for name in ("u", "y", "time_s")}
    log = replace(fast, rate_hz=10.0, theta=sampled(fast, slice(None, None, 10)), **slow)
    factor, _ = choose_rate(log, (BIAS,), exact=False, recorder_hz=0.75, purpose=purpose)
    assert log.rate_hz / factor == pytest.approx(rate_hz)
    assert candidate_orders(Config(), rate_hz, 0.75) == (order,)
    assert candidate_orders(merge(Config(), {"model.orders": [2, 4]}), rate_hz, 0.75) == (2, 4)
    assert candidate_orders(merge(Config(), {"model.order": 5}), rate_hz, 0.75) == (5,)
    assert candidate_orders(Config(), rate_hz, 0.75, order) == (order,)
    assert candidate_orders(Config(), rate_hz, 0.75, order - 1) == Config().model.orders
    assert candidate_orders(Config(), rate_hz, None) == Config().model.orders


def test_a_chosen_rate_leaves_no_more_rows_than_one_model_is_fitted_to(monkeypatch: pytest.MonkeyPatch):
    """What a recorder's edge would give is lowered; a rate that is asked for is not."""
    log = record(seconds=120.0, noise_sd=0.05)
    monkeypatch.setattr(module, "ESTIMATED", 100)
    factor, why = choose_rate(log, (BIAS,), exact=False, recorder_hz=0.75)
    assert (factor, "100 rows" in why) == (120, True)
    assert choose_rate(log, (BIAS,), exact=False, asked=20.0) == (5, "asked for")


@pytest.mark.parametrize("edge_hz", [0.3, 0.75, 1.1, 1.5, 2.2, 3.3, 4.4])
def test_a_detection_never_runs_above_the_rate_up_to_which_its_limits_hold(edge_hz):
    factor, _ = choose_rate(record(seconds=120.0), (), exact=False, recorder_hz=edge_hz, purpose="detect")
    rate_hz = 100.0 / factor
    assert rate_hz <= SAMPLES_PER_EDGE["detect"] * edge_hz * (1.0 + 1e-9)
    assert 100.0 / (factor - 1) > SAMPLES_PER_EDGE["detect"] * edge_hz


def test_the_dictionary_keeps_four_samples_per_cycle_whatever_the_recorder_did():
    fast = record(seconds=120.0, noise_sd=0.05)
    slow = {name: recorder(getattr(fast, name), 1.3, 100.0) for name in ("u", "y")}
    factor, _ = choose_rate(replace(fast, **slow), (BIAS, SINE), exact=False)
    assert 100.0 / factor >= 4 * 2.25


def test_a_simulation_is_exact_and_the_smallest_noise_is_not():
    assert is_exact(record(noise_sd=0.0))
    assert not is_exact(record(noise_sd=1e-4))


@pytest.mark.parametrize("magnitude", [0.1, 50.0])
def test_a_fault_of_the_dictionary_leaves_a_record_exact_and_another_does_not(magnitude):
    log = record(noise_sd=0.0)
    faulty = replace(log, y=log.y + magnitude * np.asarray(log.theta)[:, :, 0])
    assert is_exact(faulty)
    assert not is_exact(replace(faulty, theta=np.roll(faulty.theta, 7, axis=0)))


def test_exactness_does_not_depend_on_units_or_level():
    log = record(noise_sd=0.0)
    assert is_exact(replace(log, u=57.3 * log.u + 3.0, y=1.944 * log.y, theta=1.944 * log.theta))
    noisy = record(noise_sd=1e-4)
    assert not is_exact(replace(noisy, y=1e-6 * noisy.y, theta=1e-6 * noisy.theta))


@pytest.mark.parametrize(
    "change",
    [
        lambda log: replace(log, y=np.full_like(log.y, 3.0)),
        lambda log: replace(log, y=log.y[:60], u=log.u[:60], theta=sampled(log, slice(60)), time_s=log.time_s[:60]),
    ],
    ids=["still", "short"],
)
def test_a_record_that_tells_nothing_is_not_called_exact(change):
    assert not is_exact(change(record(noise_sd=0.0)))


def test_a_dictionary_as_large_as_the_record_does_not_make_it_exact():
    n, n_atoms = 200, 60
    rng = np.random.default_rng(0)
    theta = (np.arange(n)[:, None] >= 3 * np.arange(1, n_atoms + 1)).astype(float)[:, None, :]
    log = Signals(
        path="made.h5",
        rate_hz=10.0,
        factor=1,
        time_s=np.arange(n) / 10.0,
        u=rng.standard_normal((n, 1)),
        y=rng.standard_normal((n, 1)),
        theta=theta,
    )
    assert not is_exact(log)


def test_a_still_input_beside_a_moving_one_changes_nothing():
    log = record(noise_sd=0.0)
    assert is_exact(replace(log, u=np.hstack([log.u, np.zeros_like(log.u)])))


@pytest.mark.parametrize("kind", ["linear-phase", "causal"])
@pytest.mark.parametrize("factor", [1, 3, 10])
def test_every_signal_goes_through_the_same_filter(kind, factor):
    """So a fault subtracted before is a fault subtracted after, at the same times."""
    log = native()
    lowpass = Lowpass(half_width=WHITE.half_width, cutoff=WHITE.cutoff, kind=kind)
    fault = log.theta_between(slice(None))[:, 0, 0]
    faulty, _ = decimate_native(with_tas(log, log.y[:, 0] + 4.0 * fault), factor, lowpass)
    clean, _ = decimate_native(log, factor, lowpass)
    theta = np.asarray(faulty.theta)
    np.testing.assert_allclose(faulty.y - 4.0 * theta[:, :, 0], clean.y, atol=1e-10)
    assert {len(x) for x in (clean.time_s, clean.u, clean.y)} == {len(theta)}
    assert clean.rate_hz * factor == log.rate_hz
    np.testing.assert_allclose(np.diff(clean.time_s), factor / log.rate_hz, rtol=1e-9)
    assert clean.theta.shape[1:] == (1, 1)


def test_rows_keep_their_times():
    log = native()
    at, _ = decimate_native(with_tas(log, log.time_s), 10)
    np.testing.assert_allclose(at.y[:, 0], at.time_s, atol=1e-9)


def test_factor_one_leaves_the_record_as_it_is():
    log = native()
    at, _ = decimate_native(log, 1)
    for name in ("time_s", "u", "y"):
        np.testing.assert_array_equal(getattr(at, name), getattr(log, name))
    np.testing.assert_array_equal(at.theta, log.theta_between(slice(None)))


def test_a_window_shorter_than_the_filter_is_refused():
    with pytest.raises(LogError, match=r"^made\.h5: 100 samples are fewer than .* taps .*; give a higher --rate or a"):
        decimate_native(native(seconds=1.0), 50)


def test_at_least_a_hundred_samples_remain():
    for seconds in (1.5, 2.5, 9.0):
        log = record(seconds=seconds)
        assert len(log.time_s) // choose_rate(log, (BIAS,), exact=False)[0] >= 100
