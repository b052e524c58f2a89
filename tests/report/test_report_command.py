"""`bfi report`, run as a user runs it."""

import io
import json

import pytest
from made_results import fault_result

from bfi_cli.commands import _run
from bfi_cli.identify.document import identify_document
from bfi_cli.serialization import to_json


@pytest.fixture
def stored(tmp_path, provenance):
    path = tmp_path / "result.json"
    path.write_text(to_json(identify_document(fault_result(), provenance)) + "\n", "utf-8")
    return path


def test_draws_all_files_and_prints_the_document(stored, tmp_path, capsys):
    assert _run(["report", str(stored), "--out", str(tmp_path / "again"), "--json", "--series"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == json.loads(stored.read_text("utf-8"))
    assert err == ""
    assert (tmp_path / "again" / "result.json").read_bytes() == stored.read_bytes()
    assert "4.00 m/s (95 % interval 3.99 to 4.02)" in (tmp_path / "again" / "report.html").read_text("utf-8")


def test_reads_standard_input_and_writes_to_the_working_folder(stored, tmp_path, capsys, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr("sys.stdin", io.StringIO(stored.read_text("utf-8")))
    assert _run(["report", "-"]) == 0
    assert (tmp_path / "here" / "report.html").exists()


def test_a_terminal_gets_the_tables(stored, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert _run(["report", str(stored), "--out", str(tmp_path)]) == 0
    assert "Fault: a bias of 4.00 m/s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "x.json: not JSON (Expecting property name enclosed"),
        (b"[]", "x.json: not a result of this program, it has no 'kind'"),
        (b'{"kind": "audit", "schema": 1}', "x.json: kind is 'audit', known: calibration, convert, detect,"),
        (b'{"kind": [], "schema": 1}', "x.json: kind is '[]', known: "),
        (b'{"kind": "start-time", "schema": 9}', "x.json: schema is 9, this program reads 1"),
        (b'{"kind": "start-time", "schema": 1}', "x.json: no key 'provenance'"),
        (b'{"kind": "identify", "schema": 9}', "x.json: schema is 9, this program reads 1"),
        (b"\xff\xfe\x00", "x.json: not a text file"),
        (None, "x.json: no such file or directory"),
    ],
)
def test_what_it_cannot_read_is_named_in_one_line(content, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        (tmp_path / "x.json").write_bytes(content)
    assert _run(["report", "x.json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(message)
    assert err.count("\n") == 1
