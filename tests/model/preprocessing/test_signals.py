"""Signals of a dictionary made in blocks are those made at once, whatever the block, the filter and the fault."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bfi_cli.faults import Fault
from bfi_cli.faults.filters import recorded_signal
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.low_pass import IDENTITY, SHARP, WHITE, decimate, low_pass
from bfi_cli.model.preprocessing import signals
from bfi_cli.model.preprocessing.signals import NativeSignals

RATE_HZ = 20.0
TIME_S = 300.0 + np.arange(3000) / RATE_HZ
FAULTS = (
    Fault(shape="bias", channel="tas", onset_s=390.0, offset_s=400.0),
    Fault(shape="drift", channel="tas", onset_s=300.0, slope=0.1),
    Fault(shape="sine", channel="cas", onset_s=449.0, frequency_hz=0.3, phase_reference="window"),
    Fault(shape="lagged_bias", channel="tas", onset_s=340.02, time_constant_s=2.0),
)


def on_log(time_s: np.ndarray, outputs: tuple[str, ...], **entries: Any) -> NativeSignals:
    """Return what makes the signals of entries on a log of which only the times count."""
    log = FlightLog(path="made", time_s=frozen_array(time_s), channels={})
    return NativeSignals(log=log, inputs=(), outputs=outputs, window_start_s=time_s[0], **entries)


def shown(fault: Fault, time_s: np.ndarray, response=IDENTITY) -> NativeSignals:
    """Return what makes the signals of a fault on a log that went through filters."""
    return on_log(time_s, ("tas",), faults=(fault,), seen=(0,), response=response)


@pytest.mark.parametrize("block", [50, 777, 1000, 10_000])
@pytest.mark.parametrize("factor", [1, 4, 7])
@pytest.mark.parametrize("lowpass", [WHITE, SHARP, replace(WHITE, kind="causal")], ids=["white", "sharp", "causal"])
@pytest.mark.parametrize("response", [IDENTITY, low_pass("gaussian", 0.75, RATE_HZ)], ids=["none", "recorder"])
def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch, block: int, factor: int, lowpass, response):
    monkeypatch.setattr(signals, "BLOCK", block)
    for fault in FAULTS:
        whole = recorded_signal(fault, TIME_S, response, window_start_s=TIME_S[0])
        made, largest = shown(fault, TIME_S, response).signal_of(fault, factor, lowpass)
        np.testing.assert_allclose(made, decimate(whole, factor, lowpass), rtol=1e-9, atol=1e-9)
        # Of a tail that is evaluated the amplitude, which no sample need have.
        assert largest == pytest.approx(np.abs(whole).max(), rel=1e-3 if fault.frequency_hz else 1e-9)


MORE = (
    *FAULTS,
    Fault(shape="cosine", channel="tas", onset_s=320.0, frequency_hz=0.7, phase_rad=0.4),
    Fault(shape="sine", channel="tas", onset_s=310.0, offset_s=420.0, frequency_hz=0.05, phase_reference="window"),
    Fault(shape="ramp_hold", channel="tas", onset_s=333.3, duration_s=7.0),
    Fault(shape="ramp_hold", channel="tas", onset_s=350.0, offset_s=353.0, duration_s=7.0, slope=-0.3),
    Fault(shape="decaying_bias", channel="tas", onset_s=301.0, time_constant_s=9.0),
    Fault(shape="decaying_bias", channel="tas", onset_s=330.0, time_constant_s=1e-4),
    Fault(shape="bias", channel="tas", onset_s=200.0),
    Fault(shape="drift", channel="tas", onset_s=1000.0),
)


@pytest.mark.parametrize("factor", [1, 4, 7])
@pytest.mark.parametrize("lowpass", [WHITE, SHARP, replace(WHITE, kind="causal")], ids=["white", "sharp", "causal"])
@pytest.mark.parametrize("response", [IDENTITY, low_pass("causal", 0.75, RATE_HZ)], ids=["none", "recorder"])
@pytest.mark.parametrize("fault", MORE, ids=lambda fault: f"{fault.shape}-{fault.onset_s:g}")
def test_a_tail_that_is_evaluated_is_the_one_that_is_filtered(
    monkeypatch: pytest.MonkeyPatch, fault: Fault, factor: int, lowpass, response
):
    filtered, largest = shown(fault, TIME_S, response).signal_of(fault, factor, lowpass)
    monkeypatch.setattr(signals, "BLOCK", 1000)
    evaluated, bound = shown(fault, TIME_S, response).signal_of(fault, factor, lowpass)
    np.testing.assert_allclose(evaluated, filtered, rtol=1e-10, atol=1e-10 * max(largest, 1.0))
    rel = 0.02 if fault.frequency_hz else 1e-9  # of the highest of 28 samples of a period
    assert bound == pytest.approx(largest, rel=rel)


def test_an_uneven_clock_is_not_evaluated(monkeypatch: pytest.MonkeyPatch):
    """Times that are off by a hundredth of a step: what is filtered is what the signal is there."""
    time_s = TIME_S + np.random.default_rng(0).uniform(-5e-4, 5e-4, TIME_S.size)
    fault = FAULTS[2]
    whole = decimate(recorded_signal(fault, time_s, IDENTITY, window_start_s=time_s[0]), 4, WHITE)
    monkeypatch.setattr(signals, "BLOCK", 1000)
    np.testing.assert_allclose(shown(fault, time_s).signal_of(fault, 4, WHITE)[0], whole, rtol=0, atol=1e-12)


def test_all_entries_stand_on_their_outputs_and_those_not_seen_are_zero():
    made = on_log(TIME_S, ("cas", "tas"), faults=FAULTS, seen=(0, 2))
    native = made.theta_between(slice(None))
    assert native.shape == (3000, 2, 4)
    np.testing.assert_array_equal(np.any(native, axis=0), [[False, False, True, False], [True, False, False, False]])
    np.testing.assert_array_equal(made.theta_between(slice(1500, 2000)), native[1500:2000])
    decimated, largest = made.theta_decimated(5, WHITE)
    np.testing.assert_allclose(decimated, decimate(native, 5, WHITE), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(largest, np.abs(native).max(axis=(0, 1)))
    resampled, same = replace(made, resampled={j: native[:, :, j] for j in made.seen}).theta_decimated(5, WHITE)
    np.testing.assert_allclose(resampled, decimated, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(same, largest)


def test_a_window_shorter_than_the_filter_is_refused():
    with pytest.raises(ValueError, match="fewer than"):
        shown(FAULTS[1], TIME_S[:20]).signal_of(FAULTS[1], 20, WHITE)
