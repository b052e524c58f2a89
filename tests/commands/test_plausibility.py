"""What every command says first of a log whose channels cannot be true together."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import pytest
from made_journeys import made_journey

from bfi_cli.flightlog import write_log
from bfi_cli.flightlog.record import frozen_array

KNOT = 1852.0 / 3600.0
PART = ("--from", 240, "--to", 330, "--rate", 2, "--order", 2)
STATE = "state the unit with --unit tas=kt: tas looks like kt"
LOGS = {
    "knots": lambda values: values / KNOT,
    "offset": lambda values: values + 10.0,
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a journey whose true airspeed is in knots, and of one that reads 10 m/s too much.

    The knots are not stated; in a further log they are said to be m/s.
    """
    folder, journey = tmp_path_factory.mktemp("logs"), made_journey(rate_hz=2.0)
    for name, change in LOGS.items():
        tas = replace(journey.channels["tas"], values=frozen_array(change(journey.channels["tas"].values)))
        write_log(replace(journey, channels={**journey.channels, "tas": tas}), folder / f"{name}.h5")
        if name == "knots":
            write_log(replace(journey, channels={**journey.channels, "tas": tas}), folder / "stated.h5")
            with h5py.File(folder / "knots.h5", "a") as file:
                del file["tas"].attrs["units"]
    return folder


@pytest.mark.slow
def test_the_first_line_says_what_to_state(bfi: Callable, logs: Path):
    assert " ".join(bfi("info", logs / "knots.h5").stdout.split()).startswith(STATE)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    "words", [("start-time", "--shape", "bias"), ("start-time",), ("identify",)], ids=lambda words: " ".join(words)
)
def test_no_verdict_is_given_while_channels_contradict_each_other(bfi: Callable, logs: Path, words: tuple[str, ...]):
    command, *options = words
    document = json.loads(bfi(command, logs / "knots.h5", *options, *PART, "--json").stdout)
    (one,) = document["plausibility"]
    assert (one["channels"], one["what"], one["unit"], one["fixed"]) == (["tas"], "unit", "kt", False)
    assert (document["decision"], set(document["verdicts"].values())) == ("inconclusive", {"inconclusive"})
    assert document["summary"].startswith(STATE)
    assert document["faults"] == []


@pytest.mark.slow
def test_beside_a_constant_error_a_fault_that_begins_in_the_window_stays_declared(
    bfi: Callable, logs: Path, tmp_path: Path
):
    step, log = "bias,channel=tas,magnitude=20,onset_s=290", tmp_path / "both.h5"
    assert bfi("inject", logs / "offset.h5", "--fault", step, "-o", log).code == 0
    document = json.loads(bfi("start-time", log, *PART, "--json").stdout)
    assert [one["what"] for one in document["plausibility"]] == ["offset"]
    assert (document["decision"], document["faults"][0]["shape"]) == ("fault", "bias")
    assert document["summary"].startswith(document["plausibility"][0]["advice"])
    assert "no_fault" not in document["verdicts"].values()


def test_a_unit_that_is_certain_is_fixed_when_asked(bfi: Callable, logs: Path):
    document = json.loads(bfi("info", logs / "knots.h5", "--fix-units", "--json").stdout)
    assert [one["fixed"] for one in document["plausibility"]] == [True]
    assert any(note["text"].startswith("--fix-units: tas") for note in document["notes"])
    (tas,) = [one for one in document["channels"] if one["name"] == "tas"]
    assert tas["max"] < 130.0


def test_a_log_that_is_refused_says_what_to_state(bfi: Callable, logs: Path):
    refused = bfi("start-time", logs / "knots.h5", "--output", "lift_speed", "--from", 20, "--to", 60)
    assert refused.code == 3
    assert len(refused.stderr.splitlines()) == 1
    assert f"; first {STATE}" in refused.stderr


@pytest.mark.slow
def test_a_constant_error_is_told_beside_and_is_no_fault_of_the_flight(bfi: Callable, logs: Path):
    outcome = bfi("diagnose", logs / "offset.h5", "--from", 240, "--to", 420, "--workers", 1, "--json")
    document = json.loads(outcome.stdout)
    assert not [one for one in document["events"] if one["channels"] == ["tas"]]
    assert document["decision"] == "inconclusive"  # more than any mounting makes
    (beside,) = document["plausibility"]
    assert (beside["channels"], beside["what"], beside["fixed"]) == (["tas"], "offset", True)
    low, high = beside["offset_ci95"]
    assert low < beside["offset"] < high
    assert beside["offset"] == pytest.approx(-10.0, abs=0.1)
    assert document["summary"].startswith("check tas: tas is 10 m/s above ")


def test_a_stated_unit_is_kept_whatever_arithmetic_thinks_of_it(bfi: Callable, logs: Path):
    thought = "tas is stated in m/s and looks like kt: x 0.514 agrees with "
    document = json.loads(bfi("info", logs / "stated.h5", "--json").stdout)
    (doubt,) = document["plausibility"]
    assert (doubt["advice"], doubt["is_stated"], doubt["fixed"]) == ("kept as stated", True, False)
    assert doubt["text"].startswith(thought)
    given = json.loads(bfi("info", logs / "knots.h5", "--unit", "tas=m/s", "--fix-units", "--json").stdout)
    assert [(one["is_stated"], one["fixed"]) for one in given["plausibility"]] == [(True, False)]


@pytest.mark.slow
def test_a_stated_unit_that_arithmetic_doubts_is_a_note_of_an_answer(bfi: Callable, logs: Path):
    document = json.loads(bfi("start-time", logs / "stated.h5", "--shape", "bias", *PART, "--json").stdout)
    assert not document["summary"].startswith("state")
    assert [note["text"] for note in document["notes"] if "kept as stated" in note["text"]] != []
