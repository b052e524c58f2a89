"""`--method mfddfd`: what it declares without being told the channel, and what it says where no sensor errs."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.model.identify import identify_faults
from bfi_cli.model.report import identify_content
from bfi_cli.quantities.text import SI

CONFIG = merge(Config(), {"method": "mfddfd", "outputs": ("tas", "pitch"), "conditioning.rate_hz": 10.0})
ONSETS = (6.0, 11.0, 16.0, 21.0)


def flown(seed: int = 0) -> FlightLog:
    time_s, rng = time_axis(duration_s=31.72, rate_hz=100.0), np.random.default_rng(seed)
    noise = {"tas": 0.02, "pitch": 0.0005}
    return simulate(find_model("citation"), manoeuvre("3211", time_s), rng=rng, rate_hz=100.0, noise_sd=noise)


def steps(*channels: str):
    atoms = [
        {"name": f"{channel}_{onset:.0f}", "shape": "bias", "channel": channel, "onset_s": onset}
        for channel in channels
        for onset in ONSETS
    ]
    return load_dictionary({"atoms": atoms})


def faulty(channel: str = "tas", magnitude: float = 2.0) -> FlightLog:
    return inject(flown(), [Fault(shape="bias", channel=channel, onset_s=16.0, magnitude=magnitude)])


@pytest.mark.parametrize(("channel", "magnitude"), [("tas", 2.0), ("pitch", 0.02)])
def test_of_entries_with_one_time_course_the_sensor_that_errs_is_named_with_its_size(channel: str, magnitude: float):
    result = identify_faults(faulty(channel, magnitude), steps("tas", "pitch"), CONFIG)
    (fault,) = result.faults
    assert fault.name == f"{channel}_16"
    assert fault.magnitude == pytest.approx(magnitude, rel=0.05)
    assert not any("acts inside the plant" in one.text for one in result.notes)


def test_a_dictionary_on_the_wrong_channel_finds_the_time_course_and_says_that_it_is_no_error_of_that_sensor():
    result = identify_faults(faulty("pitch", 0.02), steps("tas"), CONFIG)
    assert [one.name for one in result.faults] == ["tas_16"]
    (note,) = [one for one in result.notes if "no error of one sensor explains 'tas_16'" in one.text]
    assert note.kind == "limit"


def test_nothing_is_declared_in_a_healthy_flight_and_no_limit_is_claimed():
    result = identify_faults(flown(), steps("tas", "pitch"), CONFIG)
    assert (result.faults, result.decision) == ((), "inconclusive")
    assert all(one.excluded_above is None for one in result.candidates)


def test_not_more_are_declared_than_asked_for():
    log = inject(faulty(), [Fault(shape="bias", channel="tas", onset_s=6.0, magnitude=-1.0)])
    assert {one.name for one in identify_faults(log, steps("tas"), CONFIG).faults} == {"tas_6", "tas_16"}
    (one,) = identify_faults(log, steps("tas"), merge(CONFIG, {"selection.max_active": 1})).faults
    assert one.name == "tas_16"


def test_the_report_draws_no_band_and_no_limit_that_the_method_does_not_know():
    result = identify_faults(faulty(), steps("tas"), CONFIG)
    drawings = {one.name: one for one in identify_content(result, SI).drawings}
    assert "magnitudes" not in drawings
    (curve,) = [one for panel in drawings["fault"].panels for one in panel.curves if "reconstructed" in one.label][:1]
    assert (curve.label, curve.low) == ("reconstructed", None)


def test_one_of_sixty_steps_in_five_minutes_is_found():
    """The lags of a step are nearly one column, in which a norm of coefficients sees no step."""
    time_s, rng = time_axis(duration_s=300.0, rate_hz=10.0), np.random.default_rng(0)
    log = simulate(
        find_model("citation"), manoeuvre("multisine", time_s), rng=rng, rate_hz=10.0, noise_sd={"tas": 0.02}
    )
    onsets = np.linspace(10.0, 290.0, 60).round(3).tolist()
    atoms = [{"name": f"step_{j}", "shape": "bias", "onset_s": onset} for j, onset in enumerate(onsets)]
    log = inject(log, [Fault(shape="bias", channel="tas", onset_s=onsets[20], magnitude=0.5)])
    config = merge(Config(), {"method": "mfddfd", "model.order": 4})
    (fault,) = identify_faults(log, load_dictionary({"channel": "tas", "atoms": atoms}), config).faults
    assert fault.name == "step_20"
    assert fault.magnitude == pytest.approx(0.5, rel=0.1)
