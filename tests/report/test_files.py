"""The files of `--out`: all of them, whole, and an old result only replaced by a whole new one."""

import csv
import json
import os
from pathlib import Path

import pytest
from made_results import fault_result

from bfi_cli.commands.identify import DRAWINGS, TABLES
from bfi_cli.errors import ConfigError
from bfi_cli.files import list_of_files, replace_files
from bfi_cli.model.report import identify_content
from bfi_cli.model.result import identify_document, identify_from_document
from bfi_cli.report.files import content_files, content_names


def identify_files(result, provenance):
    return content_files(identify_content(result), identify_document(result, provenance), provenance)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        assert next(file) == "# written by bfi\n"
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def stored(provenance, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored") / "a" / "b"
    written = replace_files(identify_files(fault_result(), provenance), folder)
    assert {"result.json", "report.html"} <= {path.name for path in written}
    return folder


@pytest.mark.slow
def test_all_files_are_written_and_nothing_else(stored):
    assert set(contents(stored)) == set(content_names(DRAWINGS, TABLES))


@pytest.mark.slow
def test_a_stored_result_draws_the_same_files(stored):
    document = json.loads((stored / "result.json").read_text("utf-8"))
    assert identify_files(*identify_from_document(document)) == contents(stored)


@pytest.mark.slow
def test_tables_hold_the_numbers(stored):
    (fault,) = table(stored / "faults.csv")
    assert (float(fault["magnitude"]), float(fault["ci95_low"]), fault["offset_s"]) == (4.003, 3.989, "")
    states = [row["state"] for row in table(stored / "candidates.csv")]
    assert states == ["declared", "not_seen", "excluded", "excluded", ""]
    series = table(stored / "series.csv")
    assert [float(row["tas_measured [m/s]"]) for row in series] == fault_result().outputs[0].measured.tolist()
    assert series[0]["tas_predicted [m/s]"] == "", "absent is an empty cell, never nan"


def test_an_interrupted_write_leaves_the_old_result(tmp_path, monkeypatch):
    replace_files({"a": b"old", "b": b"old"}, tmp_path)
    write = Path.write_bytes

    def interrupted(path, content):
        if path.name == "b":
            write(path, content[:1])
            raise KeyboardInterrupt
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        replace_files({"a": b"new", "b": b"new"}, tmp_path, force=True)
    assert contents(tmp_path) == {"a": b"old", "b": b"old"}


def test_an_interruption_while_moving_leaves_the_whole_new_result(tmp_path, monkeypatch):
    old = {"a": b"old", "b": b"old", "c": b"old"}
    replace_files(old, tmp_path)
    move, moved = os.replace, []

    def interrupted(source, target):
        move(source, target)
        moved.append(target)
        if len(moved) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        replace_files(dict.fromkeys(old, b"new"), tmp_path, force=True)
    assert contents(tmp_path) == dict.fromkeys(old, b"new")


def test_other_files_of_the_folder_are_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_bytes(b"mine")
    replace_files({"a": b"new"}, tmp_path)
    assert contents(tmp_path) == {"a": b"new", "mine.txt": b"mine"}


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(ConfigError, match=r"out: cannot be written, not a directory; give another --out$"):
        replace_files({"a": b""}, tmp_path / "out")


@pytest.mark.slow
def test_a_result_takes_away_what_the_one_before_wrote_and_nothing_else(stored, tmp_path):
    """Figures and tables of another command; not a file of the user, nor one that was changed, nor the input."""
    old = {path.name: path.read_bytes() for path in stored.iterdir()}
    replace_files(old, tmp_path)
    (tmp_path / "mine.svg").write_text("mine")
    (tmp_path / "series.csv").write_text("# written by bfi\nwith a column of mine\n")
    new = {"phases.csv": b"# written by bfi\n", "result.json": old["result.json"], "report.html": b"new"}
    replace_files(new, tmp_path, inputs=[tmp_path / "candidates.csv"])
    assert {path.name for path in tmp_path.iterdir()} == {*new, "mine.svg", "series.csv", "candidates.csv"}


def test_a_list_of_files_names_none_outside_its_folder(tmp_path):
    (tmp_path / "log.csv").write_bytes(b"mine")
    folder = tmp_path / "out"
    folder.mkdir()
    listed = list_of_files({"../log.csv": b"mine", "a--b.csv": b""})
    assert listed.count(b"--") == 2, "a comment of HTML holds no other dashes"
    (folder / "report.html").write_bytes(b"<!DOCTYPE html>" + listed)
    (folder / "result.json").write_text('{"kind": "info", "provenance": {}}')
    replace_files({"report.html": b"new"}, folder)
    assert (tmp_path / "log.csv").read_bytes() == b"mine"


@pytest.mark.slow
def test_the_report_drawn_again_beside_its_result_keeps_it(stored, tmp_path, bfi):
    for path in stored.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert bfi("report", tmp_path / "result.json").code == 0
    assert contents(tmp_path).keys() == contents(stored).keys()
