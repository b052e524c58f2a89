"""Which logs a fleet has."""

from __future__ import annotations

from pathlib import Path

import pytest

from bfi_cli.errors import ConfigError, LogError
from bfi_cli.fleet import is_fleet, logs_of

TOPIC = "timestamp,x\n1,2\n2,3\n"


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand above folders of logs."""
    names = ("b.csv", "a.H5", "notes.md", ".hidden.csv", "deep/b.csv", "deep/.git/c.csv", "deep/deeper/d.ulg")
    for name in names:
        path = tmp_path / "logs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x\n")
    topics = tmp_path / "logs" / "px4"
    topics.mkdir()
    (topics / "flight_airspeed_0.csv").write_text(TOPIC)
    done = tmp_path / "logs" / "done"
    done.mkdir()
    (done / "summary.json").write_text('{"kind": "fleet", "provenance": {}}')
    (done / "flights.csv").write_text("x\n")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("paths", "recursive", "expected"),
    [
        (["logs"], False, ["logs/a.H5", "logs/b.csv", "logs/px4"]),
        (["logs"], True, ["logs/a.H5", "logs/b.csv", "logs/deep/b.csv", "logs/deep/deeper/d.ulg", "logs/px4"]),
        (["logs/px4"], False, ["logs/px4"]),
        (["logs/notes.md", "logs/b.csv", "logs/notes.md"], False, ["logs/notes.md", "logs/b.csv"]),
        (["absent.csv", "logs/deep"], False, ["absent.csv", "logs/deep/b.csv"]),
    ],
)
def test_files_and_folders(tree: Path, paths: list[str], recursive: bool, expected: list[str]):
    assert [one.path for one in logs_of(paths, recursive=recursive)] == expected


@pytest.mark.parametrize(
    ("paths", "several"),
    [(["logs/b.csv"], False), (["absent"], False), (["logs/px4"], False), (["logs"], True), (["a", "b"], True)],
)
def test_one_log_is_no_fleet(tree: Path, paths: list[str], several: bool):
    assert is_fleet(paths) is several


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("b.csv\n\n# a comment\n deep/b.csv \n", [("logs/b.csv", ""), ("logs/deep/b.csv", "")]),
        ("\ufefflog\nb.csv\n", [("logs/b.csv", "")]),
        ("Aircraft,log,place\nN1,b.csv,x\n,a.H5\nN2,,x\n", [("logs/b.csv", "N1"), ("logs/a.H5", "")]),
        ('log,aircraft\n"a, b.csv",N1\n', [("logs/a, b.csv", "N1")]),
        ("/elsewhere/x.csv\n", [("/elsewhere/x.csv", "")]),
    ],
)
def test_a_list_counts_from_its_folder(tree: Path, text: str, expected: list[tuple[str, str]]):
    (tree / "logs" / "list.txt").write_text(text)
    assert [(one.path, one.aircraft) for one in logs_of([], listed="logs/list.txt")] == expected


def test_a_log_that_is_named_twice_is_analysed_once_and_has_the_aircraft_of_the_list(tree: Path):
    (tree / "list.csv").write_text("log,aircraft\nlogs/b.csv,N1\n")
    assert [(one.path, one.aircraft) for one in logs_of(["logs/b.csv"], listed="list.csv")] == [("logs/b.csv", "N1")]


def test_no_two_logs_have_one_folder(tree: Path):
    paths = ["b.csv", "x/b.csv", "x/B.h5", "c.csv", "a b.csv", "x/../..", "/", "\udcff.csv"]
    folders = {one.path: one.folder for one in logs_of([path for path in paths if path not in ("x/../..", "/")])}
    assert len({name.lower() for name in folders.values()}) == len(folders)
    assert (folders["c.csv"], folders["a b.csv"], folders["\udcff.csv"]) == ("c", "a b", "_")
    assert folders["b.csv"].startswith("b-")
    again = logs_of(["x/b.csv", "b.csv"])
    assert {one.folder for one in again} < {*folders.values()}


@pytest.mark.parametrize(
    ("paths", "listed", "error", "message"),
    [
        (["empty"], None, LogError, r"empty: no logs are there .*--recursive to search the folders within"),
        (["logs/done"], None, LogError, r"logs/done: no logs are there"),
        ([], "absent.txt", ConfigError, r"--list absent\.txt: no such file or directory; give a text file"),
        ([], "bytes.txt", ConfigError, r"--list bytes\.txt: not a text file; give"),
        ([], "columns.csv", ConfigError, r"--list columns\.csv: no column 'log', the first line is 'file,tail'; name"),
        ([], "nothing.txt", LogError, r"nothing\.txt: no logs are there"),
    ],
)
def test_what_is_no_list_of_logs(tree: Path, paths: list[str], listed: str | None, error: type, message: str):
    (tree / "bytes.txt").write_bytes(b"\xff\xfe\x00")
    (tree / "columns.csv").write_text("file,tail\na.csv,N1\n")
    (tree / "nothing.txt").write_text("# none\n")
    with pytest.raises(error, match=message):
        logs_of(paths, listed=listed)
