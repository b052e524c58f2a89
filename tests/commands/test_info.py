"""`bfi info` on small real files."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from noted import texts

from bfi_cli.quantities.channels import STANDARD

T = np.arange(0.0, 60.0, 0.1)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.h5"
    tas = 90.0 + 3.0 * np.sin(2 * np.pi * T / 20.0) + 0.1 * np.random.default_rng(0).normal(size=T.size)
    with h5py.File(path, "w") as file:
        file["time"] = T
        file["vtas"] = tas[(np.arange(T.size) // 10) * 10] * 3600 / 1852
        file["vtas"].attrs["units"] = "kt"
        file["de"] = 0.02 * np.sign(np.sin(2 * np.pi * T / 5.0))
        file["de"].attrs["units"] = "rad"
        file["aoa"] = np.where(T < 1.0, np.nan, 0.1)
        file.attrs["segments"] = '[{"label": "phugoid [1]", "t_start": 10, "t_end": 50, "note": ""}]'
    return path


def test_the_document_of_the_contract(bfi, log: Path):
    outcome = bfi("info", log, "--json")
    document = json.loads(outcome.stdout)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert (document["kind"], document["schema"]) == ("info", 4)
    assert (document["rate_hz"], document["gaps"], document["log"]["n_samples"]) == (10.0, [], 600)
    channels = {channel["name"]: channel for channel in document["channels"]}
    assert set(channels["tas"]) >= {"name", "unit", "source", "n_nan", "held_fraction", "quantum", "min", "max"}
    assert channels["tas"]["unit"] == "m/s"
    assert channels["tas"]["source"] == "vtas"
    assert channels["tas"]["held_fraction"] == pytest.approx(0.9, abs=0.01)
    assert channels["aoa"]["n_nan"] == 10
    assert document["windows"][0]["channel"] == "elevator"
    assert document["segments"] == [{"label": "phugoid [1]", "start_s": 10, "stop_s": 50, "note": ""}]
    assert texts(document["notes"]) == [
        "no unit is stated for aoa (rad): the one in brackets is assumed, give another with --unit NAME=UNIT"
    ]
    assert document["provenance"]["command"] == f"bfi info {log} --json"
    assert len(document["provenance"]["log_sha256"]) == 64


OPTIONS = ("--channel", "tas=speed", "--unit", "speed=kt", "--sample-rate", 10, "--from", 5, "--to", 50)
CONFIGURATION = """
channels: {tas: speed}
units: {speed: kt}
shown_units: aviation
sample_rate_hz: 10
window: {from_s: 5, to_s: 50}
dictionary: thesis
detect: {false_alarm: 0.05}
"""


@pytest.mark.parametrize("command", ["info", "plot"])
def test_a_configuration_says_the_same_as_options_and_the_command_line_wins(bfi, tmp_path: Path, command: str):
    rows = "".join(f"{160 + np.sin(t):.3f},{0.02 * np.sign(np.sin(t)):.2f}\n" for t in T)
    (tmp_path / "log.csv").write_text(f"speed,elevator [rad]\n{rows}")
    (tmp_path / "c.yaml").write_text(CONFIGURATION)
    spoken = bfi(command, tmp_path / "log.csv", *OPTIONS, "--units", "aviation", "--json")
    written = bfi(command, tmp_path / "log.csv", "-c", tmp_path / "c.yaml", "--json")
    assert (spoken.code, spoken.stderr, written.code, written.stderr) == (0, "", 0, "")
    documents = [json.loads(one.stdout) for one in (spoken, written)]
    origins = [one.pop("provenance") for one in documents]
    assert documents[0] == documents[1]
    assert [one["config_sha256"] is None for one in origins] == [True, False]
    longer = json.loads(bfi(command, tmp_path / "log.csv", "-c", tmp_path / "c.yaml", "--to", 55, "--json").stdout)
    del longer["provenance"]
    assert longer != documents[1]
    if command == "info":
        assert "kt" in bfi("info", tmp_path / "log.csv", "-c", tmp_path / "c.yaml").stdout
    wrong = bfi(command, tmp_path / "log.csv", "-c", tmp_path / "c.yaml", "--out", tmp_path / "c.yaml")
    assert wrong.code == 2


def test_absent_is_null_and_never_nan(bfi, log: Path):
    text = bfi("info", log, "--json").stdout
    assert "NaN" not in text
    assert json.loads(text)["channels"][0]["quantum"] is None


def test_a_terminal_gets_tables(bfi, log: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "dumb")
    outcome = bfi("info", log)
    assert outcome.code == 0
    words = " ".join(outcome.stdout.split())  # a long path wraps the line
    for text in ("600 samples at 10 Hz", "vtas", "90 %, 1 Hz", "Windows to analyse", "phugoid [1]", "Note no unit"):
        assert text in words
    assert json.loads(bfi("info", log, "--json").stdout)["kind"] == "info"


def test_a_window_a_unit_and_a_channel(bfi, log: Path):
    outcome = bfi("info", log, "--from", 10, "--to", 20, "--unit", "vtas=m/s", "--channel", "pitch=aoa", "--json")
    document = json.loads(outcome.stdout)
    assert document["log"]["n_samples"] == 100
    channels = {channel["name"]: channel for channel in document["channels"]}
    assert channels["tas"]["max"] > 150.0
    assert channels["pitch"]["source"] == "aoa"
    assert set(channels) <= set(STANDARD)


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        (["absent.h5"], 3, "absent.h5: no such file; give the path of a log"),
        (["LOG", "--group", "x"], 3, "no group 'x'"),
        (["LOG", "--unit", "tas"], 2, "expected NAME=UNIT, got 'tas'"),
        (["LOG", "--channel", "tas=a", "--channel", "tas=b"], 2, "'tas' is given twice"),
        (["LOG", "--unit", "tas=knotz"], 2, "--unit tas=knotz: unknown unit 'knotz'; did you mean 'knot'?"),
        (["LOG", "--from", "100"], 3, "no samples between 100 s"),
        ([], 2, "LOG"),
    ],
)
def test_what_the_user_can_mend_is_one_line(bfi, log: Path, argv: list[str], code: int, message: str):
    outcome = bfi("info", *(str(log) if word == "LOG" else word for word in argv))
    assert outcome.code == code
    assert outcome.stdout == ""
    assert message in outcome.stderr
    assert outcome.stderr.count("\n") == 1


def test_phases_and_ranked_windows(bfi, log: Path, tmp_path: Path):
    document = json.loads(bfi("info", log, "--json").stdout)
    assert document["phases"] == [{"phase": "flight", "from_s": 0.0, "to_s": 60.0}]
    assert sorted(one["rank"] for one in document["windows"]) == list(range(1, len(document["windows"]) + 1))
    assert "Phases of the flight" in bfi("info", log, "--out", tmp_path / "out").stdout
    assert {"phases.png", "phases.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}
    rows = (tmp_path / "out" / "phases.csv").read_text().splitlines()
    assert rows[1:] == ["phase,from_s,to_s", "flight,0.0,60.0"]


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["citation_20180312_f1.h5", "sim_ae4320_de3211_1.h5", "de3211_1.mat"])
def test_recorded_flights(bfi, flights: Path, name: str):
    document = json.loads(bfi("info", flights / name, "--json").stdout)
    assert document["windows"]
    assert document["uniform"]


@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        (T, "time step uniform"),
        (T[np.abs(T - 20.0) > 1.0], "time step uniform but for 1 gap"),
        (T[(np.abs(T - 20.0) > 1.0) & (np.abs(T - 40.0) > 0.5)], "time step uniform but for 2 gaps"),
        (T + 0.01 * np.pi * (np.arange(T.size) % 5 == 0), "time step not uniform, off by up to 31.4 %"),
    ],
)
def test_the_time_step_is_described_as_it_is(bfi, tmp_path: Path, time_s: np.ndarray, words: str):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["tas"] = time_s, 90.0 + np.sin(time_s)
    first = " ".join(bfi("info", tmp_path / "a.h5").stdout.split("Channels")[0].split())
    assert first.endswith(words)


def test_every_column_of_the_file_is_explained(bfi, tmp_path: Path):
    path = tmp_path / "flight.csv"
    rows = "".join(f"{k / 10},{100 + k % 7},{90 + k % 5},{k % 3},{1 + k % 2},{k},text,2.5\n" for k in range(60))
    path.write_text("time,vtas,tas_2,de [deg],nz [g],TAS,ident,aoa\n" + rows)
    document = json.loads(bfi("info", path, "--explain", "--unit", "vtas=kt", "--json").stdout)
    told = {one["column"]: (one["channel"], one["unit"], one["unit_from"], one["why"]) for one in document["explain"]}
    assert told == {
        "time": ("time", "s", "assumed", "the standard name"),
        "vtas": ("vtas", "kt", "--unit", "is a second tas; 'TAS' is used for it"),
        "TAS": ("tas", "m/s", "assumed", "the standard name but for case"),
        "tas_2": ("tas_2", "m/s", "assumed", "the standard name"),
        "de": ("elevator", "deg", "the file", "an alias"),
        "nz": (
            "normal_acc",
            "g",
            "the file",
            "an alias; it has the weight in it, upward: its median in level flight is 14.7 m/s^2; normal_acc is it "
            "less gravity",
        ),
        "aoa": ("aoa", "rad", "assumed", "the standard name"),
        "ident": (None, None, None, "left out, as it holds text"),
    }
    assert "Columns of the file" in bfi("info", path, "--explain").stdout
    assert "explain" not in json.loads(bfi("info", path, "--json").stdout)


def test_an_altitude_that_follows_the_knob_is_explained_as_what_it_is(bfi, tmp_path: Path):
    path, t = tmp_path / "flight.csv", np.arange(600)
    setting = 101_300.0 + 500.0 * (t > 300)
    altitude = 1000.0 + 3.0 * np.sin(t / 9.0) + 0.083 * (setting - 101_300.0)
    columns = {
        "time [s]": t,
        "altitude [m]": altitude,
        "baro_setting [Pa]": setting,
        "tas [m/s]": 60.0 + np.sin(t / 7.0),
    }
    rows = "\n".join(",".join(f"{column[k]:.3f}" for column in columns.values()) for k in t)
    path.write_text(",".join(columns) + "\n" + rows)
    told = {one["column"]: one for one in json.loads(bfi("info", path, "--explain", "--json").stdout)["explain"]}
    assert told["altitude"]["channel"] == "baro_altitude"
    assert told["altitude"]["why"] == "the standard name of altitude, but see the notes"
