"""`convert --corrected` and `diagnose --events-csv`: what other programs get of a diagnosis."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_diagnoses import PART, Diagnoses

from bfi_cli.flight import Event
from bfi_cli.flight.corrected import corrected_log
from bfi_cli.flight.report import events_csv
from bfi_cli.flightlog import Channel, FlightLog, read_log
from bfi_cli.flightlog.record import frozen_array

DRIFT = "drift,channel=tas,magnitude=0.1,onset_s=430"
T = np.arange(0.0, 100.0, 0.1)


def log_of(**values: np.ndarray) -> FlightLog:
    units = {"tas": "m/s", "altitude": "m", "aoa": "rad"}
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=units.get(name, ""), source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(T), channels=channels)


def event(**more: Any) -> Event:
    """Return a drift of the true airspeed of 0.5 m/s^2 from 40 s, seen until 80 s."""
    settings: dict[str, Any] = {
        "fault": "tas",
        "among": ("tas",),
        "channels": ("tas",),
        "state": "declared",
        "kind": "slow",
        "stages": ("parity",),
        "shape": "drift",
        "constant_s": None,
        "frequency_hz": None,
        "magnitude": 0.5,
        "unit": "m/s^2",
        "sd": 0.1,
        "ci95": (0.3, 0.7),
        "effect": {"tas": 20.0},
        "beyond_tolerance": True,
        "onset_s": 40.0,
        "onset_ci95": (39.0, 41.0),
        "offset_s": None,
        "seen_until_s": 80.0,
        "window_s": (20.0, 80.0),
        "statistic": 30.0,
        "threshold": 10.0,
        "p_value": 1e-4,
        "evidence": {},
        "note": "",
        "repeat": "",
    }
    return Event(**{**settings, **more})


TAS = 100.0 + np.sin(T)
COURSE = 0.5 * np.maximum(T - 40.0, 0.0)


def test_what_an_event_says_is_taken_away_and_beyond_it_nothing_is_known() -> None:
    log = corrected_log(log_of(tas=TAS + COURSE, aoa=0.0 * T), [event()])
    until = T < 80.0
    np.testing.assert_allclose(log.channels["tas"].values[until], TAS[until], atol=1e-9)
    assert np.isnan(log.channels["tas"].values[~until]).all()
    np.testing.assert_array_equal(log.channels["tas_measured"].values, TAS + COURSE)
    np.testing.assert_array_equal(log.channels["event_1_tas"].values, T >= 40.0)
    np.testing.assert_array_equal(log.channels["aoa"].values, 0.0)
    assert "aoa_measured" not in log.channels
    # Before the onset not a bit is changed.
    np.testing.assert_array_equal(log.channels["tas"].values[T < 40.0], TAS[T < 40.0])


def test_two_faults_of_one_channel_are_taken_away_together() -> None:
    bias = event(shape="offset", magnitude=3.0, unit="m/s", onset_s=0.0, offset_s=200.0)
    drift = event(offset_s=70.0)
    measured = TAS + 3.0 + np.where(T < 70.0, COURSE, 0.0)
    log = corrected_log(log_of(tas=measured), [drift, bias])
    np.testing.assert_allclose(log.channels["tas"].values, TAS, atol=1e-9)
    assert {"event_1_tas", "event_2_tas"} <= log.channels.keys()


def test_a_held_line_leaves_its_channels_empty_while_it_is_held() -> None:
    held = event(fault="pitot_blocked", shape="held", magnitude=None, stages=("holds",), offset_s=60.0)
    log = corrected_log(log_of(tas=TAS), [held])
    np.testing.assert_array_equal(np.isnan(log.channels["tas"].values), (T >= 40.0) & (T < 60.0))


def test_what_is_suspected_is_flagged_and_not_corrected() -> None:
    log = corrected_log(log_of(tas=TAS), [event(state="suspected")])
    assert log.channels["tas"].values is not None
    np.testing.assert_array_equal(log.channels["tas"].values, TAS)
    assert set(log.channels) == {"tas", "event_1_tas"}


def test_a_loss_of_impact_pressure_is_given_back() -> None:
    """At one height and temperature the airspeed goes with the root of the impact pressure, in slow flight."""
    slow = log_of(tas=30.0 + 0.0 * T, altitude=0.0 * T)
    loss = 0.005 * np.maximum(T - 40.0, 0.0)
    icing = event(fault="pitot_icing", magnitude=0.005, unit="1/s", offset_s=90.0)
    measured = replace(slow.channels["tas"], values=frozen_array(30.0 * np.sqrt(1.0 - np.where(T < 90.0, loss, 0.0))))
    log = corrected_log(replace(slow, channels={**slow.channels, "tas": measured}), [icing])
    np.testing.assert_allclose(log.channels["tas"].values, 30.0, rtol=1e-3)


def test_the_list_of_events_begins_with_its_header_and_goes_by_time() -> None:
    lasting = event(fault='a "b", c\x1b', channels=("tas", "cas"), ci95=None, magnitude=None)
    rows = list(csv.DictReader(events_csv([event(onset_s=50.0, offset_s=60.0), lasting]).decode().splitlines()))
    assert [one["time"] for one in rows] == ["40.0", "50.0"]
    assert (rows[0]["end"], rows[0]["magnitude"], rows[0]["low"], rows[0]["channels"]) == ("", "", "", "tas cas")
    assert rows[0]["event"] == r'a "b", c\x1b'
    wanted = {"end": "60.0", "magnitude": "0.5", "unit": "m/s^2", "low": "0.3", "high": "0.7", "p_value": "0.0001"}
    assert {key: rows[1][key] for key in wanted} == wanted


@pytest.mark.slow
def test_a_diagnosis_in_other_programs(journey: FlightLog, diagnoses: Diagnoses, tmp_path: Path) -> None:
    """The log without its fault is what was flown; the list is written again, and over no other file."""
    bfi, log, listed, out = diagnoses.bfi, diagnoses.log(DRIFT), tmp_path / "events.csv", tmp_path / "clean.h5"
    for part in (("--from", 400, "--to", 480), PART):
        outcome = bfi("diagnose", log, *part, "--workers", 1, "--json", "--events-csv", listed)
        assert outcome.code == 0, outcome.stderr
    (row,) = csv.DictReader(listed.read_text().splitlines())
    assert (row["event"], row["state"], float(row["magnitude"])) == ("tas", "declared", pytest.approx(0.1, rel=0.02))
    stored = tmp_path / "result.json"
    stored.write_text(outcome.stdout)
    assert bfi("convert", log, "--corrected", stored, "--from", 240, "--to", 700, "-o", out).code == 0
    clean = read_log(out)
    flown = np.interp(clean.time_s, journey.time_s, journey.channels["tas"].values)
    known = np.isfinite(clean.channels["tas"].values)
    assert np.abs(clean.channels["tas_measured"].values - flown).max() > 20.0
    assert np.abs(clean.channels["tas"].values - flown)[known].max() < 1.0
    assert known[clean.time_s < 600.0].all()
    other = bfi("convert", diagnoses.log(""), "--corrected", stored, "-o", tmp_path / "no.h5")
    assert (other.code, (tmp_path / "no.h5").exists()) == (2, False)
    assert "the diagnosis of another log than" in other.stderr


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ("[]", "not a diagnosis; give the result.json of bfi diagnose"),
        ("{", "not JSON"),
        ('{"kind": "detect"}', "not a diagnosis"),
        ('{"kind": "diagnose", "schema": 3}', "no key 'provenance'"),
        ('{"kind": "diagnose", "schema": 3, "provenance": {"log_sha256": "SHA"}}', "damaged, KeyError('events')"),
        (
            '{"kind": "diagnose", "schema": 3, "provenance": {"log_sha256": "SHA"}, "events": [], '
            '"plausibility": [{"fixed": true, "what": "unit", "channels": ["tas"]}]}',
            "--fix-units changed tas; state their units with --unit",
        ),
    ],
)
def test_what_is_no_diagnosis_of_the_log_corrects_nothing(
    bfi: Callable, tmp_path: Path, document: str, message: str
) -> None:
    log = Path(__file__).parents[2] / "data" / "citation_bias.csv"
    path = tmp_path / "r.json"
    path.write_text(document.replace("SHA", read_log(log).sha256))
    outcome = bfi("convert", log, "--corrected", path, "-o", tmp_path / "out.csv")
    assert (outcome.code, outcome.stdout, (tmp_path / "out.csv").exists()) == (2, "", False)
    assert message in outcome.stderr
    assert json.dumps(str(path))[1:-1] in outcome.stderr


def test_a_reading_that_lags_is_taken_off():
    """The error of 5 (1 - exp(-t / 3)) m/s from 40 s on."""
    lag = event(shape="lagged_bias", constant_s=3.0, magnitude=5.0, unit="m/s", effect={"tas": 5.0}, offset_s=80.0)
    faulty = np.where(T < 80.0, 100.0 - 5.0 * np.expm1(-np.maximum(T - 40.0, 0.0) / 3.0), 100.0)
    corrected = corrected_log(log_of(tas=TAS + faulty - 100.0), [lag])
    np.testing.assert_allclose(corrected.channels["tas"].values[T < 80.0], TAS[T < 80.0], atol=1e-9)
