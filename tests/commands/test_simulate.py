"""`bfi simulate` on the real command."""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli import aircraft
from bfi_cli.commands import run_command
from bfi_cli.flightlog import read_log

SHORT = ["--duration", "3", "--rate", "50"]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "flight.h5"


def simulate(out: Path, *options: str, model: str = "citation") -> None:
    assert run_command(["simulate", model, "-o", str(out), *options]) == 0


def test_the_defaults_are_those_of_the_library(out: Path):
    simulate(out)
    expected = aircraft.simulate(
        aircraft.MODELS["citation"],
        aircraft.manoeuvre("3211", aircraft.time_axis()),
        rng=np.random.default_rng(0),
    )
    log = read_log(out)
    assert log.n_samples == 3172
    assert set(log.channels) == {"elevator", "tas", "aoa", "pitch", "pitch_rate"}
    np.testing.assert_array_equal(log.time_s, expected.time_s)
    for name, channel in expected.channels.items():
        np.testing.assert_array_equal(log.channel(name).values, channel.values)
        assert log.channel(name).unit == channel.unit


def test_every_option_reaches_the_library(out: Path):
    simulate(
        out,
        *("--manoeuvre", "doublet", "--amplitude", "0.02", "--start", "0.5", "--step", "0.4", *SHORT),
        *("--noise", "tas=0.05", "--noise", "aoa=0.001", "--quantum", "tas=0.03", "--turbulence", "0.7"),
        *("--discretisation", "bilinear", "--seed", "11"),
    )
    time_s = aircraft.time_axis(duration_s=3.0, rate_hz=50.0)
    expected = aircraft.simulate(
        aircraft.MODELS["citation"],
        aircraft.manoeuvre("doublet", time_s, amplitude_rad=0.02, start_s=0.5, step_s=0.4),
        rng=np.random.default_rng(11),
        rate_hz=50.0,
        discretisation="bilinear",
        turbulence=aircraft.Dryden(sigma_m_s=0.7),
        noise_sd={"tas": 0.05, "aoa": 0.001},
        quantum={"tas": 0.03},
    )
    log = read_log(out)
    for name, channel in expected.channels.items():
        np.testing.assert_array_equal(log.channel(name).values, channel.values)


def test_the_short_period_model_has_two_outputs(out: Path):
    simulate(out, *SHORT, model="citation-short-period")
    assert set(read_log(out).channels) == {"elevator", "aoa", "pitch_rate"}


def test_a_model_of_a_file_flies_as_the_one_of_the_program(tmp_path: Path):
    file = Path(__file__).parents[2] / "configs" / "citation_model.yaml"
    noisy = ["--noise", "tas=0.01", "--turbulence", "0.5", *SHORT]
    simulate(tmp_path / "ours.h5", *noisy)
    assert run_command(["simulate", "--model", str(file), "-o", str(tmp_path / "file.h5"), *noisy]) == 0
    assert (tmp_path / "ours.h5").read_bytes() == (tmp_path / "file.h5").read_bytes()


def test_the_same_seed_gives_the_same_file_and_another_seed_another(tmp_path: Path):
    noisy = ["--noise", "tas=0.01", "--turbulence", "0.5", *SHORT]
    files = [tmp_path / name for name in ("one.h5", "same.h5", "other.h5")]
    for file, seed in zip(files, ("3", "3", "4"), strict=True):
        simulate(file, *noisy, "--seed", seed)
    one, same, other = (file.read_bytes() for file in files)
    assert one == same
    assert one != other


def test_the_document_of_the_contract_goes_to_stdout(out: Path, capsys: pytest.CaptureFixture[str]):
    simulate(out, *SHORT, "--seed", "5", "--json")
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert captured.err == ""
    assert {key: document[key] for key in ("kind", "schema", "path", "n_samples", "truth", "notes")} == {
        "kind": "simulate",
        "schema": 4,
        "path": str(out),
        "n_samples": 150,
        "truth": None,
        "notes": [],
    }
    assert document["rate_hz"] == pytest.approx(50.0, rel=1e-9)
    assert {"name": "tas", "unit": "m/s"} in document["channels"]
    assert document["provenance"]["seed"] == 5


def on_a_terminal(*arguments: str) -> str:
    """Run the command with a terminal as stdout and return what it shows."""
    screen, tty = os.openpty()
    with open(tty, "w") as stdout, contextlib.redirect_stdout(stdout):
        assert run_command(list(arguments)) == 0
    shown = os.read(screen, 4096).decode()
    os.close(screen)
    return shown


def test_a_terminal_gets_one_line(out: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "300")
    channels = "elevator [rad], tas [m/s], aoa [rad], pitch [rad], pitch_rate [rad/s]"
    shown = on_a_terminal("simulate", "citation", "-o", str(out), *SHORT)
    assert shown == f"{out}: 150 samples at 50 Hz: {channels}\r\n"


def test_a_terminal_gets_the_document_with_json(out: Path):
    assert json.loads(on_a_terminal("simulate", "citation", "-o", str(out), *SHORT, "--json"))["kind"] == "simulate"


def test_leaving_the_linear_range_is_a_note(out: Path, capsys: pytest.CaptureFixture[str]):
    simulate(out, "--amplitude", "0.5", "--json")
    assert any(
        "a linear model holds for about 0.1" in note for note in texts(json.loads(capsys.readouterr().out)["notes"])
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--manoeuvre", "321"], "manoeuvre: unknown, got '321'; did you mean '3211'?"),
        (["--noise", "tas"], "--noise: expected NAME=SD, got 'tas'; write --noise tas=0.01"),
        (["--noise", "tas=low"], "--noise: expected NAME=SD, got 'tas=low'; write --noise tas=0.01"),
        (["--noise", "cas=0.1"], "citation: noise: no output 'cas'; the model has: tas, aoa, pitch, pitch_rate"),
        (
            ["--quantum", "tas=1", "--quantum", "tas=2"],
            "--quantum: 'tas' is given twice, as '1' and '2'; keep one",
        ),
        (["--quantum", "tas=-1"], "citation: quantum of tas: must be 0 or more, got -1 m/s; give 0 for none"),
        (["--turbulence", "-1"], "turbulence: the intensity must be 0 or more, got -1 m/s; change it"),
        (["--turbulence", "nan"], "turbulence: the intensity must be 0 or more, got nan m/s; change it"),
        (
            ["--rate", "0"],
            "simulate: a log has 2 to 10,000,000 samples, got 31.72 s at 0 Hz; change --duration or --rate",
        ),
        (["--step", "0"], "manoeuvre: needs finite numbers and a positive step, got amplitude 0.035"),
        (["--duration", "-3"], "simulate: a log has 2 to 10,000,000 samples, got -3 s at 100 Hz; change --duration"),
        (["--manoeuvre", "none", "--amplitude", "0.1"], "--amplitude: moves nothing with --manoeuvre none; leave one"),
        (["--manoeuvre", "none", "--start", "3"], "--start: times a manoeuvre or a throttle doublet, and --manoeuvre"),
        (["--manoeuvre", "tour", "--step", "3"], "--step: times a manoeuvre or a throttle doublet, and --manoeuvre"),
        (["--amplitude", "0"], "--amplitude: moves nothing, got 0; give another size, or --manoeuvre none"),
        (["--start", "-1"], "--start: must be 0 or more, got -1 s; give when the manoeuvre begins in the log"),
        (["--start", "40"], "--start: the manoeuvre begins at 40 s, and the log ends at 31.72 s; give an earlier"),
        (
            ["--throttle", "0.1", "--duration", "8"],
            "--throttle: its doublet begins at 10.2 s, 10 steps after --start, and the log ends at 8 s; give a longer",
        ),
    ],
)
def test_what_the_user_can_mend_is_one_line_and_exit_code_2(
    options: list[str], message: str, out: Path, capsys: pytest.CaptureFixture[str]
):
    assert run_command(["simulate", "citation", "-o", str(out), *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(message)
    assert captured.err.count("\n") == 1
    assert not out.exists()


def test_more_than_a_surface_can_move_is_refused(out: Path, capsys: pytest.CaptureFixture[str]):
    assert run_command(["simulate", "f16", "-o", str(out), "--amplitude", "-0.5"]) == 2
    assert capsys.readouterr().err == (
        "f16: amplitude: more than the travel of the elevator, 0.436 rad to either side, got -0.5; "
        "give a smaller --amplitude\n"
    )


def test_a_long_flight_tells_how_far_it_is(out: Path, capsys: pytest.CaptureFixture[str]):
    told: list[float] = []
    model, time_s = aircraft.MODELS["f16"], aircraft.time_axis(duration_s=0.4, rate_hz=50.0)
    u = np.zeros((len(time_s), 4))
    aircraft.simulate(replace(model, report=told.append), u, rng=np.random.default_rng(0), rate_hz=50.0)
    np.testing.assert_allclose(told, np.arange(20) / 20.0)
    assert run_command(["simulate", "f16", "-o", str(out), "--duration", "0.4", "--progress"]) == 0
    assert "flight" in capsys.readouterr().err


def test_an_unknown_model_is_named(out: Path, capsys: pytest.CaptureFixture[str]):
    assert run_command(["simulate", "citatoin", "-o", str(out)]) == 2
    assert capsys.readouterr().err == "simulate: no such model, got 'citatoin'; did you mean 'citation'?\n"
