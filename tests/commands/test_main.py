"""The command line as a whole: exit codes, which stream carries what, interruptions, defects, closed pipes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from noted import texts

from bfi_cli import __version__, flightlog
from bfi_cli.commands import COMMANDS

ROOT = Path(__file__).parents[2]
LOG = ROOT / "data" / "citation_bias.h5"
CLEAN = ROOT / "data" / "citation_clean.h5"
FAULTS = ROOT / "tests" / "two_entries.yaml"
QUICK = ("--rate", 4, "--order", 2)
IDENTIFY = ("identify", LOG, "-d", FAULTS, *QUICK)


def on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make stdout and stderr terminals of 120 columns."""
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "dumb")


def fails(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def read_log(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(flightlog, "read_log", read_log)


def python(*argv: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *map(str, argv)], capture_output=True, text=True, cwd=ROOT, check=False)


def test_version(bfi: Callable):
    outcome = bfi("--version")
    assert (outcome.code, outcome.stdout, outcome.stderr) == (0, f"bfi, version {__version__}\n", "")


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_lists_every_command_in_the_order_of_the_work(bfi: Callable, flag: str):
    outcome = bfi(flag)
    places = [outcome.stdout.index(f"\n  {name} ") for name in COMMANDS]
    assert (outcome.code, outcome.stderr) == (0, "")
    assert places == sorted(places)


def test_no_command_is_a_usage_error_that_shows_the_help(bfi: Callable):
    outcome = bfi()
    assert (outcome.code, outcome.stdout) == (2, "")
    assert outcome.stderr == bfi("--help").stdout


def test_the_package_runs_as_a_module():
    done = python("-m", "bfi_cli", "--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"bfi, version {__version__}\n", "")


@pytest.mark.usefixtures("unscanned")
def test_a_pipe_gets_the_table_and_nothing_else(bfi: Callable):
    outcome = bfi(*IDENTIFY)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert outcome.stdout.startswith("FAULT  true airspeed reads 4.00")


@pytest.mark.usefixtures("undrawn", "unscanned")
def test_a_terminal_gets_tables_on_stdout_and_notes_on_stderr(
    bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    on_a_terminal(monkeypatch)
    outcome = bfi(*IDENTIFY, "--out", tmp_path / "out")
    assert outcome.code == 0
    assert outcome.stdout.startswith("FAULT  true airspeed reads 4.00")
    assert "bias_13.8" in outcome.stdout
    assert outcome.stderr.endswith(f"\nwrote {tmp_path / 'out' / 'report.html'}\n")


@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("line", [("info", LOG), IDENTIFY], ids=["info", "identify"])
def test_json_on_a_terminal(bfi: Callable, line: tuple[object, ...], monkeypatch: pytest.MonkeyPatch):
    on_a_terminal(monkeypatch)
    assert not bfi(*line).stdout.startswith("{")
    assert json.loads(bfi(*line, "--json").stdout)["kind"] == line[0]


@pytest.mark.first_rows(5)
@pytest.mark.parametrize(
    ("log", "options", "code"),
    [
        (LOG, [], 0),
        (LOG, ["--fail-on", "fault"], 10),
        (CLEAN, ["--fail-on", "fault"], 0),
        (CLEAN, ["--strict"], 4),
        (CLEAN, ["--strict", "--require", "abrupt"], 0),
        (LOG, ["--strict", "--fail-on", "fault"], 10),
    ],
)
def test_exit_codes_of_an_answer(
    bfi: Callable, request: pytest.FixtureRequest, log: Path, options: list[str], code: int
):
    if "--require" not in options:
        request.getfixturevalue("unscanned")
    outcome = bfi("identify", log, "-d", FAULTS, *QUICK, *options, "--json")
    assert (outcome.code, outcome.stderr) == (code, "")
    quiet = "no_fault" if "--require" in options else "inconclusive"
    assert json.loads(outcome.stdout)["decision"] == ("fault" if log == LOG else quiet)


@pytest.fixture
def unanswerable(tmp_path: Path) -> list[object]:
    """Return the words for a question the log cannot answer: a drift over all of it, or the aircraft?"""
    path = tmp_path / "whole.yaml"
    path.write_text("atoms:\n  - {shape: drift, onset_s: 0}\n")
    return [CLEAN, "-d", path, *QUICK]


@pytest.mark.usefixtures("unscanned")
def test_no_trustworthy_answer_is_an_exit_code_with_strict_only(bfi: Callable, unanswerable: list[object]):
    plain, strict = (bfi("identify", *unanswerable, "--json", *more) for more in ((), ("--strict",)))
    assert json.loads(plain.stdout)["decision"] == "inconclusive"
    assert (plain.code, strict.code) == (0, 4)
    assert any("this window cannot tell" in note for note in texts(json.loads(strict.stdout)["notes"]))


def test_a_defect_of_ours_is_one_line_and_a_crash_file(bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    fails(monkeypatch, ZeroDivisionError("on\npurpose"))
    outcome = bfi("identify", LOG, "-d", FAULTS)
    (crash,) = tmp_path.glob("bfi-crash-*.txt")
    assert (outcome.code, outcome.stdout) == (70, "")
    assert outcome.stderr == f"bfi: internal error, ZeroDivisionError; report it with {crash}\n"
    first, second, *rest = crash.read_text().splitlines()
    assert first.startswith(f"bfi {__version__}, Python ")
    assert (second, rest[0], rest[-1]) == ("bfi identify -d", "Traceback (most recent call last):", "ZeroDivisionError")
    assert any(line.endswith("in command") for line in rest)
    assert not any(word in "\n".join(rest) for word in ("purpose", LOG.name, FAULTS.name)), "nothing of the user's"


def test_a_defect_is_one_line_where_no_crash_file_can_be_written(
    bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "absent"))
    fails(monkeypatch, ZeroDivisionError())
    outcome = bfi("identify", LOG, "-d", FAULTS)
    assert outcome.code == 70
    assert outcome.stderr == (
        "bfi: internal error, ZeroDivisionError; report it (no crash file, no such file or directory)\n"
    )


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "bfi: interrupted\n"),
        (MemoryError(), 3, "bfi: out of memory; choose a shorter window or a lower --rate\n"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_what_ends_a_run_from_outside(
    bfi: Callable, monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, line: str
):
    fails(monkeypatch, error)
    outcome = bfi("identify", LOG, "-d", FAULTS)
    assert (outcome.code, outcome.stdout, outcome.stderr) == (code, "", line)


@pytest.mark.parametrize("words", [["reproduce", "list", "--json"], ["--help"]])
def test_a_closed_pipe_is_quiet(words: list[object]):
    program = [sys.executable, "-m", "bfi_cli", *map(str, words)]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no device that is always full")
def test_a_full_disk_is_one_line():
    program = [sys.executable, "-m", "bfi_cli", "info", str(LOG)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False)
    assert done.returncode == 2
    assert done.stderr == "stdout: cannot be written, no space left on device; free some space, or write elsewhere\n"
