"""`bfi info` and `bfi diagnose` on many logs: what a call on each alone says, on any number of workers, once."""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from made_fleet import flight, make_fleet

from bfi_cli import flightlog
from bfi_cli.serialization import without_series

ROOT = Path(__file__).resolve().parents[2]
HERE = ("--workers", 1)
# The figures of a report are those of one log, and looked at there.
pytestmark = pytest.mark.usefixtures("undrawn")


def without_origin(document: dict) -> dict:
    """Return a document without its series and what tells one run from another."""
    told = {key: document["provenance"][key] for key in ("command", "date")}
    assert all(told.values())
    return {**without_series(document), "provenance": {**document["provenance"], **dict.fromkeys(told)}}


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        assert next(file) == "# written by bfi\n"
        return list(csv.DictReader(file))


@pytest.fixture
def no_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write tables as CSV, whatever is installed."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)


@pytest.mark.parametrize("kind", ["info", "diagnose"])
def test_each_log_is_answered_as_alone(kind: str, bfi: Callable, tmp_path: Path):
    paths = make_fleet(tmp_path / "logs", 2)
    outcome = bfi(kind, tmp_path / "logs", *HERE, "--json", "--jsonl", tmp_path / "all.jsonl")
    assert outcome.code == 0
    assert outcome.stderr == f"bfi {kind}: 1 of 3 logs could not be read\n"
    documents = json.loads(outcome.stdout)
    assert documents == [json.loads(line) for line in (tmp_path / "all.jsonl").read_text().splitlines()]
    assert [one["log"]["path"] for one in documents] == list(map(str, paths))
    unread = documents.pop(0)
    alone = bfi(kind, paths[0], "--json")
    assert (unread["kind"], unread["error"] + "\n") == ("unread", alone.stderr)
    for path, document in zip(paths[1:], documents, strict=True):
        alone = json.loads(bfi(kind, path, "--json").stdout)
        assert without_origin(document) == without_origin(alone)


def test_a_line_for_each_log_those_that_need_a_reader_first(bfi: Callable, tmp_path: Path):
    make_fleet(tmp_path, 1)
    (tmp_path / "with_fault.csv").write_text(flight(lost=True))
    lines = bfi("diagnose", tmp_path, *HERE).stdout.splitlines()
    assert len(lines) == 3
    assert re.match(r"\S*/with_fault\.csv +fault +true airspeed drops out at 60", lines[0])
    assert re.match(r"\S*/flight_0\.csv +cannot tell +.*; still possible: a slow error of any size$", lines[1])
    assert re.match(r"\S*/broken_0\.csv +not read +\S*/broken_0\.csv: no header line", lines[-1])


@pytest.mark.usefixtures("no_pyarrow")
def test_what_is_written(bfi: Callable, tmp_path: Path):
    make_fleet(tmp_path / "logs", 2)
    out = tmp_path / "out"
    assert bfi("info", tmp_path / "logs", *HERE, "--out", out).code == 0
    assert {path.name for path in out.iterdir()} == {
        *("flight_0", "flight_1", "flights.csv", "channels.csv", "index.html", "summary.json", "store.jsonl")
    }
    assert {"result.json", "report.html"} <= {path.name for path in (out / "flight_0").iterdir()}
    flights = table(out / "flights.csv")
    assert [Path(row["log"]).name for row in flights] == ["broken_0.csv", "flight_0.csv", "flight_1.csv"]
    assert "no header line" in flights[0]["error"]
    assert flights[0]["n_samples"] == ""
    assert [row["n_samples"] for row in flights[1:]] == ["400", "400"]
    assert {row["name"] for row in table(out / "channels.csv")} == {"tas", "altitude", "pitch"}
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["kind"], summary["n_logs"], summary["n_unread"]) == ("fleet", 3, 1)


@pytest.mark.usefixtures("no_pyarrow")
def test_the_page_of_a_fleet_fetches_nothing_and_shows_no_markup_of_a_log(bfi: Callable, tmp_path: Path):
    odd = tmp_path / "logs" / "<b>&amp;.csv"
    make_fleet(tmp_path / "logs", 1)
    odd.write_text(flight())
    assert bfi("info", tmp_path / "logs", *HERE, "--out", tmp_path / "out").code == 0
    page = (tmp_path / "out" / "index.html").read_text()
    assert "&lt;b&gt;&amp;amp;.csv" in page
    assert "<b>" not in page
    assert re.findall(r'(?:src|href)="([^"]*)"', page) == ["_b__amp_/report.html", "flight_0/report.html"]
    for link in ("_b__amp_", "flight_0"):
        assert (tmp_path / "out" / link / "report.html").is_file()


@pytest.mark.usefixtures("no_pyarrow")
def test_a_log_that_did_not_change_is_not_analysed_again(
    bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    make_fleet(tmp_path / "logs", 3)
    command = ("info", tmp_path / "logs", *HERE, "--out", tmp_path / "out")
    analysed: list[str] = []
    read = flightlog.read_log
    monkeypatch.setattr(
        flightlog, "read_log", lambda path, **given: (analysed.append(Path(path).name), read(path, **given))[1]
    )

    def run(*more: object) -> set[str]:
        analysed.clear()
        assert bfi(*command, *more).code == 0
        return {*analysed}

    everything = {"broken_0.csv", "flight_0.csv", "flight_1.csv", "flight_2.csv"}
    assert run() == everything
    before = (tmp_path / "out" / "flights.csv").read_bytes()
    assert run("--json") == set()
    assert (tmp_path / "out" / "flights.csv").read_bytes() == before
    (tmp_path / "logs" / "flight_1.csv").write_text(flight(seed=9))
    assert run() == {"flight_1.csv"}
    shutil.rmtree(tmp_path / "out" / "flight_2")
    assert run() == {"flight_2.csv"}
    assert run("--to", 60) == everything
    assert run("--to", 60) == set()
    (tmp_path / "logs" / "flight_3.csv").write_text(flight(seed=3))
    (tmp_path / "logs" / "flight_0.csv").unlink()
    assert run("--to", 60) == {"flight_3.csv"}
    names = [Path(row["log"]).name for row in table(tmp_path / "out" / "flights.csv")]
    assert names == ["broken_0.csv", "flight_1.csv", "flight_2.csv", "flight_3.csv"]


@pytest.mark.usefixtures("no_pyarrow")
@pytest.mark.parametrize("cut", [0, 1, 40, -1])
def test_a_store_that_is_torn_anywhere_is_continued(cut: int, bfi: Callable, tmp_path: Path):
    make_fleet(tmp_path / "logs", 2)
    command = ("info", tmp_path / "logs", *HERE, "--out", tmp_path / "out")
    assert bfi(*command).code == 0
    files = ("flights.csv", "channels.csv")
    before = [(tmp_path / "out" / name).read_bytes() for name in files]
    store = tmp_path / "out" / "store.jsonl"
    whole = store.read_bytes()
    store.write_bytes(whole[: cut if cut >= 0 else len(whole) - 30])
    (tmp_path / "out" / "flight_0" / ".bfi-left").mkdir()
    assert bfi(*command, "--force").code == 0
    assert [(tmp_path / "out" / name).read_bytes() for name in files] == before
    assert len(store.read_bytes().splitlines()) == 4


@pytest.mark.parametrize(
    ("names", "options", "code"),
    [
        (("flight_0.csv", "broken_0.csv"), (), 0),
        (("broken_0.csv", "absent.csv"), (), 3),
        (("flight_0.csv", "broken_0.csv"), ("--strict",), 4),
        (("flight_0.csv", "flight_1.csv"), ("--fail-on", "fault"), 0),
        (("fault.csv", "flight_1.csv"), ("--fail-on", "fault"), 10),
        (("fault.csv", "flight_1.csv"), ("--fail-on", "fault", "--strict"), 4),
    ],
)
def test_exit_codes(
    names: tuple[str, ...],
    options: tuple[str, ...],
    code: int,
    bfi: Callable,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    make_fleet(tmp_path, 2)
    (tmp_path / "fault.csv").write_text(flight(seed=5, lost=True))
    monkeypatch.chdir(tmp_path)
    outcome = bfi("diagnose", *names, *HERE, *options)
    assert outcome.code == code
    assert len(outcome.stdout.splitlines()) == len(names)


def test_a_defect_of_ours_is_a_row_and_the_others_are_answered(
    bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    make_fleet(tmp_path, 2, broken=0)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    whole = flightlog.inspect_log

    def fails(log):
        if "flight_0" in log.path:
            raise ZeroDivisionError
        return whole(log)

    monkeypatch.setattr(flightlog, "inspect_log", fails)
    outcome = bfi("info", tmp_path / "flight_0.csv", tmp_path / "flight_1.csv", *HERE)
    assert outcome.code == 70
    assert "internal error, ZeroDivisionError; report it with" in outcome.stdout
    assert "400 samples" in outcome.stdout


@pytest.mark.usefixtures("no_pyarrow")
def test_results_beside_the_logs(bfi: Callable, tmp_path: Path):
    make_fleet(tmp_path, 2, broken=0)
    for _ in range(2):
        assert bfi("info", tmp_path, "--recursive", *HERE, "--out", tmp_path / "out").code == 0
        assert len(table(tmp_path / "out" / "flights.csv")) == 2


def test_no_log_is_written_into(bfi: Callable, tmp_path: Path):
    folder = tmp_path / "flight"
    folder.mkdir()
    (folder / "a_airspeed_0.csv").write_text("timestamp,x\n1,2\n2,3\n")
    outcome = bfi("info", folder, tmp_path / "other.csv", "--out", tmp_path, *HERE)
    assert (outcome.code, outcome.stdout) == (2, "")
    assert outcome.stderr == f"{folder}: is a log of this command; give another --out\n"
    assert {path.name for path in tmp_path.iterdir()} == {"flight"}


@pytest.mark.slow
def test_two_workers_say_the_same(bfi: Callable, tmp_path: Path):
    make_fleet(tmp_path, 2)
    alone, together = (json.loads(bfi("info", tmp_path, "--workers", n, "--json").stdout) for n in (1, 2))
    assert len(alone) == 3
    assert list(map(without_origin, alone)) == list(map(without_origin, together))


def test_on_a_terminal_a_log_has_one_line(bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    logs = tmp_path / ("long_" * 12)
    make_fleet(logs, 2)
    monkeypatch.setenv("COLUMNS", "70")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    outcome = bfi("info", logs, *HERE)
    assert outcome.code == 0
    lines = re.sub(r"\x1b\[[0-9;]*m", "", outcome.stdout).splitlines()
    assert len(lines) == 3
    assert all(len(line.rstrip()) <= 70 for line in lines)
