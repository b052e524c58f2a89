"""What other channels of a log explain, or what may be nothing by its own interval, is suspected, not declared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.decision import KINDS
from bfi_cli.decision.calibration import CalibrationTable, save_tables
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import find_onset
from bfi_cli.model.onset.scan_record import prepare_record
from bfi_cli.serialization import provenance

BIAS = Fault(shape="bias", channel="tas", magnitude=1.0, onset_s=15.6)


def with_channel(log, name, values):
    """Return the log with an acceleration that a scan of the elevator alone does not look at."""
    noise = 0.01 * np.random.default_rng(3).standard_normal(log.n_samples)
    channel = Channel(name=name, values=frozen_array(values + noise), unit="m/s^2", source=name)
    return replace(log, channels={**log.channels, name: channel})


def test_a_step_that_another_channel_has_is_suspected(flown, settings):
    log = flown(BIAS)
    result = find_onset(
        with_channel(log, "longitudinal_acc", unit_signal(BIAS, log.time_s, window_start_s=0.0)),
        settings(shapes=("bias",)),
    )
    assert (result.decision, result.faults) == ("inconclusive", ())
    (bias,) = (one for one in result.candidates if one.shape == "bias")
    assert bias.state == "suspected"
    assert "longitudinal_acc" in (bias.note or "")
    assert texts(result.notes)[0] == bias.note


def test_a_step_that_no_other_channel_has_is_declared(flown, settings):
    log = flown(BIAS)
    result = find_onset(with_channel(log, "longitudinal_acc", np.zeros(log.n_samples)), settings(shapes=("bias",)))
    (fault,) = result.faults
    assert fault.magnitude == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_all_trusted_inputs_without_a_dictionary_and_without_a_fault(flown):
    log = flown()
    config = merge(
        Config(),
        {
            "inputs": ("auto",),
            "conditioning.rate_hz": 10.0,
            "model.order": 4,
            "start_time.calibration": "gaussian",
            "start_time.shapes": ("bias",),
        },
    )
    result, _ = identify(log, None, config)
    assert set(result.verdicts) == set(KINDS)
    assert result.model.inputs[0] == "elevator"


@pytest.mark.parametrize("seed", [1, 4])
def test_what_the_scan_finds_with_an_interval_that_holds_zero_is_suspected(tmp_path: Path, seed: int):
    """Wind that wanders passes a threshold that is far too low; an integrating model makes as much without a fault."""
    rng, time_s = np.random.default_rng(seed), np.arange(200) / 2.0
    elevator = 0.05 * np.sign(np.sin(0.9 * time_s) + np.sin(0.37 * time_s))
    wind = np.cumsum(0.3 * elevator + 0.1 * rng.standard_normal(200)) + 0.05 * rng.standard_normal(200)
    channels = {
        name: Channel(name=name, values=frozen_array(values), unit=unit, source=name)
        for name, values, unit in (("tas", 100.0 + wind, "m/s"), ("elevator", elevator, "rad"))
    }
    log = FlightLog(path="made", time_s=frozen_array(time_s), channels=channels, filters=())
    asked = {"conditioning.rate_hz": "none", "model.order": 4, "start_time.shapes": ("drift",)}
    made = prepare_record(log, merge(Config(), asked)).settings
    table = CalibrationTable(settings=made, statistics={"drift": np.linspace(1.0, 4.0, 30)}, logs=())
    (tmp_path / "low.json").write_text(save_tables([table], provenance(log_sha256="")))
    result = find_onset(log, merge(Config(), {**asked, "start_time.calibration": str(tmp_path / "low.json")}))
    assert result.statistic > result.threshold
    assert (result.decision, result.faults) == ("inconclusive", ())
    drift = next(one for one in result.candidates if one.shape == "drift")
    assert drift.state == "suspected"
    assert "interval" in (drift.note or "")
    assert "contains zero" in (drift.note or "")
    assert texts(result.notes)[0] == drift.note
