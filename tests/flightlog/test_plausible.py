"""Values that cannot be are asked about; those of aircraft are not."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_logs import made_log, write_text
from noted import texts

from bfi_cli.flightlog import FlightLog, inspect_log, read_log
from bfi_cli.flightlog.plausible import IN_FLIGHT, LIMITS, doubts_about, impossible_median, sentence_of_impossible
from bfi_cli.quantities.channels import STANDARD

TIME_S = np.arange(200) / 10.0
DATA = Path(__file__).parents[2] / "data"


def stated(units: dict[str, str], **signals: np.ndarray) -> FlightLog:
    """Return a log whose file states the units."""
    log = made_log(TIME_S, units, **signals)
    channels = {name: replace(channel, source_unit=channel.unit) for name, channel in log.channels.items()}
    return replace(log, channels=channels)


@pytest.mark.parametrize("name", LIMITS)
def test_a_channel_is_asked_about_beyond_its_limit_and_not_for_a_spike(name: str):
    limit, unit = LIMITS[name][0], {name: STANDARD[name].unit}
    beyond, within = stated(unit, **{name: 0 * TIME_S + 1.01 * limit}), 0 * TIME_S + 0.99 * limit
    (question,) = doubts_about(beyond, [name])
    assert f"'{name}' reaches {1.01 * limit:.3g} {STANDARD[name].unit}" in question.text
    assert f"--unit {beyond.channels[name].source}=UNIT" in question.text
    within[[7, 90]] = -3.0 * limit, np.nan
    assert doubts_about(stated(unit, **{name: within}), [name]) == ()
    assert doubts_about(stated(unit, **{name: np.nan * TIME_S}), [name]) == ()
    assert doubts_about(stated(unit, **{name: within}), ["no such"]) == ()


@pytest.mark.parametrize("name", IN_FLIGHT)
def test_a_median_that_no_flight_has_is_impossible_and_a_fault_that_begins_is_not(name: str):
    low, high = IN_FLIGHT[name]
    inside, beyond = 0.5 * (low + high) + 0.0 * TIME_S, high + 0.1 * (high - low) + 0.0 * TIME_S
    assert impossible_median(name, inside) is None
    assert impossible_median(name, beyond) == pytest.approx(beyond[0])
    assert impossible_median(name, np.where(TIME_S < 5.0, inside, beyond)) is None
    assert impossible_median(name, np.nan * TIME_S) is None
    assert sentence_of_impossible(name, beyond[0]).startswith(f"'{name}' is not used: its median in flight is ")


def test_a_channel_without_a_range_is_never_impossible():
    assert impossible_median("elevator", 1e3 + TIME_S) is None


def test_air_of_20_kelvin_is_asked_about():
    log = stated({"sat": "K"}, sat=20.0 + TIME_S)
    assert "is it in degC?" in doubts_about(log, ["sat"])[0].text


def test_the_recordings_of_the_repository_raise_no_question():
    for path in sorted(DATA.glob("*.h5")):
        log = read_log(path)
        assert doubts_about(log, list(log.channels)) == ()
        assert texts(inspect_log(log).notes) == texts(log.notes)


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
def test_info_and_identify_ask(bfi: Callable, tmp_path: Path):
    rng = np.random.default_rng(0)
    elevator, tas = 3.0 * np.sign(np.sin(TIME_S)), 450.0 + rng.standard_normal(TIME_S.size)
    rows = "\n".join(f"{t:.1f},{a:.4f},{e:.1f}" for t, a, e in zip(TIME_S, tas, elevator, strict=True))
    path = write_text(tmp_path / "a.csv", f"time,tas,elevator [rad]\n{rows}\n")
    for command in (("info", path), ("identify", path, "-d", "airdata"), ("start-time", path, "--shape", "bias")):
        outcome = bfi(*command, "--json")
        assert outcome.code == 0
        notes = texts(json.loads(outcome.stdout)["notes"])
        assert any(note.startswith("'elevator' reaches 3 rad") for note in notes)
        assert any(note.startswith("'tas' reaches 45") for note in notes)
        assert any("unit is stated for tas" in note or "no unit for tas (m/s)" in note for note in notes)
