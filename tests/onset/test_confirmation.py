"""What other channels of a log explain is suspected, not declared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import Channel
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.identify.from_scan import identify_from_scan
from bfi_cli.onset import find_onset
from bfi_cli.verdicts import KINDS

BIAS = Fault(shape="bias", channel="tas", magnitude=1.0, onset_s=15.6)


def with_channel(log, name, values):
    """Return the log with an acceleration that a scan of the elevator alone does not look at."""
    noise = 0.01 * np.random.default_rng(3).standard_normal(log.n_samples)
    channel = Channel(name=name, values=frozen_array(values + noise), unit="m/s^2", source=name)
    return replace(log, channels={**log.channels, name: channel})


def test_a_step_that_another_channel_has_is_suspected(flown, settings):
    log = flown(BIAS)
    result = find_onset(
        with_channel(log, "longitudinal_acc", unit_signal(BIAS, log.time_s, window_start_s=0.0)), settings()
    )
    assert (result.decision, result.faults) == ("inconclusive", ())
    (bias,) = (one for one in result.candidates if one.shape == "bias")
    assert bias.state == "suspected"
    assert "longitudinal_acc" in (bias.note or "")
    assert result.notes[0] == bias.note


def test_a_step_that_no_other_channel_has_is_declared(flown, settings):
    log = flown(BIAS)
    result = find_onset(with_channel(log, "longitudinal_acc", np.zeros(log.n_samples)), settings())
    (fault,) = result.faults
    assert fault.estimate.magnitude == pytest.approx(1.0, abs=0.1)


def test_all_trusted_inputs_without_a_dictionary_and_without_a_fault(flown):
    log = flown()
    config = merge(
        Config(),
        {
            "inputs": ("auto",),
            "conditioning.rate_hz": 10.0,
            "model.order": 4,
            "start_time.calibration": "gaussian",
            "start_time.shapes": ("bias", "drift"),
        },
    )
    result, _ = identify_from_scan(log, config)
    assert set(result.verdicts) == set(KINDS)
    assert result.model.inputs[0] == "elevator"
