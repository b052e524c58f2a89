"""`bfi report`, run as a user runs it."""

import io
import json
from pathlib import Path

import pytest
from made_results import fault_result

from bfi_cli.commands import run_command
from bfi_cli.model.result import identify_document
from bfi_cli.serialization import to_json

ROOT = Path(__file__).parents[2]
SWEEP = """
record: {model: citation, rate_hz: 10, duration_s: 30}
dictionary: {relative_to: window, channel: tas, atoms: [{shape: bias, onset_s: 8}, {shape: drift, onset_s: 5}]}
active: [1]
trials: 1
identify: {conditioning: {rate_hz: none}, method: risro, model: {order: 4}}
"""


@pytest.fixture
def stored(tmp_path, provenance):
    path = tmp_path / "result.json"
    path.write_text(to_json(identify_document(fault_result(), provenance)) + "\n", "utf-8")
    return path


@pytest.mark.usefixtures("undrawn")
def test_draws_all_files_and_prints_the_document(stored, tmp_path, capsys):
    assert run_command(["report", str(stored), "--out", str(tmp_path / "again"), "--json", "--series"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == json.loads(stored.read_text("utf-8"))
    assert err == ""
    assert (tmp_path / "again" / "result.json").read_bytes() == stored.read_bytes()
    page = (tmp_path / "again" / "report.html").read_text("utf-8")
    assert "4.00 m/s too high from 13.8 s (size, 95 %: 3.99 to 4.02)" in page


def test_json_alone_writes_nothing(stored, tmp_path, capsys):
    before = {path: path.read_bytes() for path in tmp_path.rglob("*")}
    assert run_command(["report", str(stored), "--json", "--units", "aviation"]) == 0
    assert json.loads(capsys.readouterr().out)["faults"] == json.loads(stored.read_text("utf-8"))["faults"]
    assert {path: path.read_bytes() for path in tmp_path.rglob("*")} == before


@pytest.mark.usefixtures("undrawn")
def test_reads_standard_input_and_writes_to_the_working_folder(stored, tmp_path, capsys, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr("sys.stdin", io.StringIO(stored.read_text("utf-8")))
    assert run_command(["report", "-"]) == 0
    assert (tmp_path / "here" / "report.html").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_terminal_gets_the_tables(stored, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert run_command(["report", str(stored), "--out", str(tmp_path)]) == 0
    assert "FAULT  true airspeed reads 4.00 m/s too high" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "x.json: not JSON (Expecting property name enclosed"),
        (b"[]", "x.json: not a result of this program, it has no 'kind'"),
        (b'{"kind": "audit", "schema": 1}', "x.json: kind is 'audit', known: calibration, compare, convert,"),
        (b'{"kind": [], "schema": 1}', "x.json: kind is '[]', known: "),
        (b'{"kind": "start-time", "schema": 9}', "x.json: schema is 9, this program reads 4"),
        (b'{"kind": "start-time", "schema": 2}', "x.json: no key 'provenance'"),
        (b'{"kind": "identify", "schema": 9}', "x.json: schema is 9, this program reads 4"),
        (b"\xff\xfe\x00", "x.json: not a text file"),
        (None, "x.json: no such file or directory"),
    ],
)
def test_what_it_cannot_read_is_named_in_one_line(content, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        (tmp_path / "x.json").write_bytes(content)
    assert run_command(["report", "x.json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(message)
    assert err.count("\n") == 1


@pytest.mark.slow
def test_every_kind_of_document_is_drawn(bfi, tmp_path):
    """The other kinds are drawn in the tests of their own commands."""
    log, folder = ROOT / "data" / "citation_bias.h5", tmp_path
    (folder / "sweep.yaml").write_text(SWEEP)
    quick = ("--length", 16, "--step", 4, "--rate", 10, "--order", 4, "--shape", "bias")
    commands = {
        "info": ("info", log),
        "convert": ("convert", log, "-o", folder / "c.csv", "--rate", 20),
        "inject": ("inject", log, "--fault", "drift,channel=tas,magnitude=2,onset_s=3", "-o", folder / "i.h5"),
        "simulate": ("simulate", "citation", "-o", folder / "s.h5", "--duration", 5),
        "calibration": ("calibrate", log, "-o", folder / "t.json", *quick),
        "montecarlo": ("montecarlo", "-c", folder / "sweep.yaml"),
    }
    for kind, argv in commands.items():
        made = bfi(*argv, "--json")
        assert (made.code, made.stderr) == (0, "")
        path = folder / f"{kind}.json"
        path.write_text(made.stdout)
        assert json.loads(made.stdout)["kind"] == kind
        drawn = bfi("report", path, "--out", folder / kind, "--json")
        assert (drawn.code, drawn.stderr) == (0, "")
        assert json.loads(drawn.stdout) == json.loads(made.stdout)
        stored = "summary.json" if kind == "montecarlo" else "result.json"
        assert {"report.html", stored} < {file.name for file in (folder / kind).iterdir()}
    assert "drift on tas, magnitude 2 m/s^2, from 3 s" in (folder / "inject" / "report.html").read_text("utf-8")
