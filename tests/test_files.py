"""Whose a file is, and that it is replaced whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import pytest

from bfi_cli.errors import ConfigError
from bfi_cli.files import aside, check_files, is_ours, replace_files

OURS = {"kind": "identify", "schema": 1, "provenance": {}}


@pytest.mark.parametrize(
    ("name", "content", "ours"),
    [
        ("a.csv", "# written by bfi\ntime,tas\n", True),
        ("a.csv", "# written by bfi\r\ntime,tas\r\n", True),
        ("a.csv", "# written by bfi-like tools\ntime,tas\n", False),
        ("a.csv", "time,tas\n# written by bfi\n", False),
        ("a.csv", "", False),
        ("a.json", json.dumps(OURS), True),
        ("a.json", json.dumps(OURS | {"series": [0.1] * 100_000}, sort_keys=True), True),
        ("a.json", json.dumps(OURS | {"kind": "letter"}), False),
        ("a.json", json.dumps({"kind": "identify"}), False),
        ("a.html", "<!DOCTYPE html>", False),
    ],
)
def test_a_file_is_ours_when_it_says_so(name: str, content: str, ours: bool, tmp_path: Path):
    (tmp_path / name).write_text(content, newline="")
    assert is_ours(tmp_path / name) is ours


def test_an_hdf5_file_is_ours_by_its_attribute(tmp_path: Path):
    path = tmp_path / "a.h5"
    for owner in ("me", "bfi"):
        with h5py.File(path, "w") as file:
            file.attrs["written_by"] = owner
        assert is_ours(path) is (owner == "bfi")
    path.write_bytes(path.read_bytes()[:100])
    assert not is_ours(path)


def test_a_folder_of_results_is_ours_and_loses_nothing_else(tmp_path: Path):
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(ConfigError, match=r"report\.html: exists and was not written by bfi"):
        replace_files({"a.csv": b"", "report.html": b"new"}, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    (tmp_path / "result.json").write_text(json.dumps(OURS))
    replace_files({"a.csv": b"", "report.html": b"new"}, tmp_path)
    assert (tmp_path / "report.html").read_bytes() == b"new"


def test_a_link_to_nothing_is_not_replaced(tmp_path: Path):
    (tmp_path / "link.csv").symlink_to("gone.csv")
    with pytest.raises(ConfigError, match="exists and was not written by bfi"):
        check_files([tmp_path / "link.csv"])


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError()])
def test_a_failure_leaves_neither_files_nor_folders(error: BaseException, tmp_path: Path):
    kind = ConfigError if isinstance(error, OSError) else type(error)
    folder = tmp_path / "deep" / "er"

    def fail() -> None:
        with aside(folder, place=folder, option="--out") as new:
            (new / "a").write_text("half")
            raise error

    with pytest.raises(kind):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_replaced_file_keeps_its_mode_and_a_new_one_has_that_of_others(tmp_path: Path):
    (tmp_path / "a").write_text("")
    (tmp_path / "a").chmod(0o600)
    replace_files({"a": b"new", "b": b"new"}, tmp_path, force=True)
    (tmp_path / "plain").write_text("")
    modes = [(tmp_path / name).stat().st_mode for name in ("a", "b", "plain")]
    assert modes[0] & 0o777 == 0o600
    assert modes[1] == modes[2]
