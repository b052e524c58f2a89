"""`bfi inject` on the real command, on files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.commands import run_command
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, read_log
from bfi_cli.report.log import log_lines

BIAS = "bias,channel=tas,magnitude=4,onset_s=1.5"
SINE = "sine,channel=aoa,magnitude=0.02,frequency_hz=1.15,onset_s=1,offset_s=2,phase_reference=window,name=wobble"


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "clean.h5"
    assert run_command(["simulate", "citation", "-o", str(path), "--duration", "4", "--noise", "tas=0.01"]) == 0
    return path


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """Return a log of two channels without standard names, the second without a unit."""
    path = tmp_path / "odd.csv"
    path.write_text("time [s],probe [deg],spare\n" + "".join(f"{k},{k % 7},{k % 5}\n" for k in range(9)), "utf-8")
    return path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "faulty.h5"


def test_the_file_holds_the_faulty_channel_and_the_truth(clean: Path, out: Path):
    assert run_command(["inject", str(clean), "--fault", BIAS, "-o", str(out)]) == 0
    original, faulty = read_log(clean), read_log(out)
    assert faulty.truth is not None
    assert faulty.truth.faults == (Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=1.5),)
    np.testing.assert_array_equal(faulty.truth.clean["tas"], original.channel("tas").values)
    expected = original.channel("tas").values + np.where(original.time_s >= 1.5, 4.0, 0.0)
    np.testing.assert_array_equal(faulty.channel("tas").values, expected)
    for name in ("elevator", "aoa", "pitch", "pitch_rate"):
        np.testing.assert_array_equal(faulty.channel(name).values, original.channel(name).values)


def test_two_commands_do_the_same_as_one_with_both_faults(clean: Path, out: Path, tmp_path: Path):
    between, again = tmp_path / "between.h5", tmp_path / "again.h5"
    assert run_command(["inject", str(clean), "--fault", BIAS, "--fault", SINE, "-o", str(out)]) == 0
    assert run_command(["inject", str(clean), "--fault", BIAS, "-o", str(between)]) == 0
    assert run_command(["inject", str(between), "--fault", SINE, "-o", str(again)]) == 0
    both, steps = read_log(out), read_log(again)
    assert both.truth is not None
    assert steps.truth is not None
    assert [fault.name for fault in both.truth.faults] == [None, "wobble"]
    assert steps.truth.faults == both.truth.faults
    for name in ("tas", "aoa"):
        np.testing.assert_array_equal(steps.channel(name).values, both.channel(name).values)
        np.testing.assert_array_equal(steps.truth.clean[name], read_log(clean).channel(name).values)


def test_a_file_is_never_replaced_by_its_faulty_version(clean: Path, out: Path):
    out.write_bytes(clean.read_bytes())
    assert run_command(["inject", str(out), "--fault", BIAS, "-o", str(out), "--force"]) == 2
    assert out.read_bytes() == clean.read_bytes()


def test_the_document_of_the_contract_goes_to_stdout(clean: Path, out: Path, capsys: pytest.CaptureFixture[str]):
    assert run_command(["inject", str(clean), "--fault", SINE, "-o", str(out), "--json"]) == 0
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert captured.err == ""
    assert (document["kind"], document["schema"], document["path"]) == ("inject", 4, str(out))
    assert (document["n_samples"], texts(document["notes"])) == (400, [])
    assert document["truth"] == {
        "ordinary": [],
        "faults": [
            {
                "shape": "sine",
                "name": "wobble",
                "channel": "aoa",
                "magnitude": 0.02,
                "onset_s": 1.0,
                "offset_s": 2.0,
                "frequency_hz": 1.15,
                "phase_rad": pytest.approx(2.0 * np.pi * (1.15 % 1.0)),
                "phase_reference": "onset",
            }
        ],
    }
    assert document["provenance"]["log_sha256"] == read_log(clean).sha256


def test_a_fault_over_the_whole_log_is_a_note(clean: Path, out: Path, capsys: pytest.CaptureFixture[str]):
    assert run_command(["inject", str(clean), "--fault", "bias,channel=tas,magnitude=1", "-o", str(out), "--json"]) == 0
    [note] = texts(json.loads(capsys.readouterr().out)["notes"])
    assert note.startswith("fault 'bias' on tas acts at every sample of the log")


def test_the_lines_of_a_terminal_name_channels_faults_and_notes(clean: Path):
    log = inject(
        read_log(clean),
        [
            Fault(shape="drift", magnitude=0.3, onset_s=1.0),
            Fault(shape="bias", channel="aoa", name="vane", magnitude=0.01, offset_s=9.0),
        ],
    )
    summary, drift, bias, *notes = log_lines(log)
    assert summary.startswith(f"{clean}: 400 samples at 100 Hz: ")
    assert "tas [m/s]" in summary
    assert drift == "fault: drift on tas, magnitude 0.3 m/s^2, from 1 s"
    assert bias == "fault: vane (bias) on aoa, magnitude 0.01 rad, from 0 s until 9 s"
    assert [note.split(":")[0] for note in notes] == ["note"]


@pytest.mark.parametrize(
    ("spec", "code", "message"),
    [
        (
            "bias,channel=cas,onset_s=1",
            3,
            "{log}: no channel 'cas'; the log has: aoa, elevator, pitch, pitch_rate, tas",
        ),
        ("bias,onset_s=50", 2, "{log}: fault 'bias': never active in the log, got magnitude 1 from 50 s, the log runs"),
        ("bias,onset=1", 2, "--fault bias,onset=1: onset: unknown key"),
        ("step,onset_s=1", 2, "--fault step,onset_s=1: shape: unknown shape, got 'step'"),
    ],
)
def test_what_the_user_can_mend_is_one_line(
    spec: str, code: int, message: str, clean: Path, out: Path, capsys: pytest.CaptureFixture[str]
):
    assert run_command(["inject", str(clean), "--fault", spec, "-o", str(out)]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(message.format(log=clean))
    assert captured.err.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "size", "complaint"),
    [
        ((), "4kt", "is in rad, got '4kt'; give a unit of that kind, or none for SI"),
        (("--unit", "spare=kt"), "4deg", "is in m/s, got '4deg'; give a unit of that kind, or none for SI"),
        (
            (),
            "4kt",
            "'spare' has no unit in the log, got '4kt'; state it with --unit spare=UNIT, or leave the unit out",
        ),
    ],
)
def test_a_unit_that_a_channel_of_the_log_does_not_have_is_refused_before_anything_is_written(
    options: tuple[str, ...], size: str, complaint: str, odd: Path, out: Path, capsys: pytest.CaptureFixture[str]
):
    channel = "probe" if "rad" in complaint else "spare"
    spec = f"bias,channel={channel},magnitude={size},onset_s=1"
    assert run_command(["inject", str(odd), "--fault", spec, *options, "-o", str(out)]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", f"--fault {spec}: magnitude: {complaint}\n")
    assert not out.exists()


def test_a_unit_is_converted_to_that_of_the_channel_of_the_log(odd: Path, out: Path):
    spec = "bias,channel=probe,magnitude=2deg,onset_s=1"
    assert run_command(["inject", str(odd), "--fault", spec, "-o", str(out)]) == 0
    change = read_log(out).channel("probe").values - read_log(odd).channel("probe").values
    np.testing.assert_allclose(change[-1], np.deg2rad(2.0), rtol=1e-12)


def test_a_fault_and_an_output_are_required(clean: Path, out: Path, capsys: pytest.CaptureFixture[str]):
    assert run_command(["inject", str(clean), "-o", str(out)]) == 2
    assert "--fault" in capsys.readouterr().err
    assert run_command(["inject", str(clean), "--fault", BIAS]) == 2
    assert "-o" in capsys.readouterr().err
