"""Progress and interruption of the long commands: real processes whose stderr is a real pseudo-terminal."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
import pytest
from noted import texts

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import read_log, write_log
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import find_onset

pty = pytest.importorskip("pty", reason="this system has no pseudo-terminals")

ROOT = Path(__file__).parents[2]
BIAS, TWO = ROOT / "data" / "citation_bias.h5", ROOT / "data" / "citation_two_faults.h5"
FAULTS = ROOT / "tests" / "two_entries.yaml"
QUICKER = ("--rate", 4, "--order", 2)
SLOWER = ("--rate", 1, "--order", 4, "--method", "risro")
COARSE = {"conditioning.rate_hz": 4.0, "model.order": 2}
HIDDEN, SHOWN = "\x1b[?25l", "\x1b[?25h"
PATIENCE_S = 60.0


class Ended(NamedTuple):
    """How a process ended, and what it printed where."""

    code: int
    stdout: str
    terminal: str


def at_a_terminal(*argv: object, until: str | None = None, number: int = signal.SIGINT) -> Ended:
    """Run `bfi` with stderr a terminal; once it shows the text `until`, send the signal `number`."""
    with tempfile.TemporaryFile("w+") as printed:
        code, terminal = run_until(argv, printed, until, number)
        printed.seek(0)
        return Ended(code, printed.read(), terminal)


def run_until(argv: tuple[object, ...], printed: IO[str], until: str | None, number: int) -> tuple[int, str]:
    """Return the exit code and what the terminal showed; stdout goes to the file `printed`."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "bfi_cli", *map(str, argv)],
        stdin=subprocess.DEVNULL,
        stdout=printed,
        stderr=theirs,
        text=True,
        cwd=ROOT,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "200", "PYTHONPATH": str(ROOT)},
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            more = os.read(ours, 65536)
        except OSError:  # the last one that could write has closed it
            break
        if not more:
            break
        shown += more
        if until is not None and until.encode() in shown:
            process.send_signal(number)
            until = None
    os.close(ours)
    process.wait(timeout=PATIENCE_S)
    assert until is None, f"never shown: {until}\n{shown.decode()}"
    return process.returncode, shown.decode().replace("\r\n", "\n")


def has_its_cursor(terminal: str) -> bool:
    return terminal.rfind(SHOWN) > terminal.rfind(HIDDEN) >= 0


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of eleven minutes whose elevator moves in two places."""
    time_s = time_axis(duration_s=660.0, rate_hz=4.0)
    elevator = np.zeros(len(time_s))
    pulses = manoeuvre("3211", time_axis(duration_s=60.0, rate_hz=4.0), step_s=2.0)
    for start_s in (100.0, 400.0):
        elevator[round(4.0 * start_s) :][: len(pulses)] = pulses
    log = simulate(MODELS["citation"], elevator, rng=np.random.default_rng(0), rate_hz=4.0, noise_sd={"tas": 0.01})
    path = tmp_path_factory.mktemp("long") / "long.csv"
    write_log(log, path)
    return path


@pytest.mark.slow
def test_a_bar_shows_the_stages_and_leaves_stdout_alone(bfi: Callable):
    words = ("start-time", BIAS, "--shape", "bias", *QUICKER, "--json")
    shown, hidden = at_a_terminal(*words), bfi(*words, "--no-progress")
    assert (shown.code, hidden.code, hidden.stderr) == (0, 0, "")
    for stage in ("scan of all onsets", "fault 1", "scan of all onsets without 1 fault", "100%"):
        assert stage in shown.terminal
    assert has_its_cursor(shown.terminal)
    one, other = json.loads(shown.stdout), json.loads(hidden.stdout)
    for document in (one, other):
        del document["provenance"]
    assert one == other


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize(
    "words", [("start-time", BIAS, "--shape", "bias", *QUICKER), ("identify", BIAS, "-d", FAULTS, *QUICKER)]
)
def test_nothing_is_shown_where_stderr_is_no_terminal_unless_asked_for(bfi: Callable, words: tuple[object, ...]):
    assert bfi(*words).stderr == ""
    assert "100%" in bfi(*words, "--progress").stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "stage"),
    [
        (("start-time", BIAS), "scan of all onsets"),
        (("start-time", BIAS), HIDDEN),
        (("start-time", BIAS, "--ends"), "scan of all onsets"),
        (("start-time", BIAS, "--method", "thesis"), "a solution for every onset"),
        (("start-time", BIAS, "--calibration", "gaussian"), "simulated records"),
        (("identify", BIAS), "scan of all onsets"),
    ],
)
def test_an_interruption_ends_the_command_at_once(tmp_path: Path, words: tuple[object, ...], stage: str):
    ended = at_a_terminal(*words, "--out", tmp_path / "out", until=stage)
    assert (ended.code, ended.stdout) == (130, "")
    assert ended.terminal.endswith("bfi: interrupted\n")
    assert has_its_cursor(ended.terminal)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_an_interrupted_search_for_many_faults(tmp_path: Path):
    path = tmp_path / "many.yaml"
    path.write_text("channel: tas\ngrids:\n  - {shape: bias, onset_s: {start: 1, stop: 30, step: 0.25}}\n")
    ended = at_a_terminal("identify", BIAS, "-d", path, until="search for the faults")
    assert (ended.code, ended.stdout) == (130, "")
    assert ended.terminal.endswith("bfi: interrupted\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("plot", TWO), ("identify", TWO, "-d", FAULTS, *QUICKER)], ids=lambda words: words[0]
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_amid_the_figures_leaves_the_old_answer(tmp_path: Path, words: tuple[object, ...], number: int):
    out = tmp_path / "out"
    out.mkdir()
    (out / "result.json").write_text("old")
    ended = at_a_terminal(*words, "--out", out, "--force", until="figures", number=number)
    assert (ended.code, ended.stdout) == (128 + number, "")
    assert has_its_cursor(ended.terminal)
    assert [path.name for path in out.iterdir()] == ["result.json"]
    assert (out / "result.json").read_text() == "old"


def stages_of(run: Callable[[Callable[[str, float], None]], object]) -> dict[str, list[float]]:
    """Return what each stage of a run told; a stage that is over does not come back."""
    told: list[tuple[str, float]] = []
    run(lambda stage, done: told.append((stage, done)))
    stages: dict[str, list[float]] = {}
    for k, (stage, done) in enumerate(told):
        assert stage not in stages or told[k - 1][0] == stage
        stages.setdefault(stage, []).append(done)
    return stages


@pytest.mark.parametrize(
    ("path", "settings"),
    [
        (BIAS, {"start_time.shapes": ("bias",), "model.order": 2}),
        (BIAS, {**COARSE, "method": "risro", "start_time.shapes": ("bias",)}),
        pytest.param(TWO, COARSE, marks=pytest.mark.slow),
        pytest.param(TWO, {**COARSE, "start_time.ends": True}, marks=pytest.mark.slow),
    ],
)
def test_every_stage_of_a_scan_grows_from_0_to_1(path: Path, settings: dict[str, object]):
    stages = stages_of(lambda progress: find_onset(read_log(path), merge(Config(), settings), progress))
    assert len(stages) > 1
    for told in stages.values():
        assert told == sorted(told)
        assert (min(told) >= 0.0, told[-1]) == (True, 1.0)


@pytest.mark.parametrize("method", ["ml", "risro"])
def test_every_stage_of_an_identification_grows_from_0_to_1(method: str):
    dictionary, config = load_dictionary(str(FAULTS)), merge(Config(), {"method": method, "model.orders": (2, 4)})
    stages = stages_of(lambda progress: identify_faults(read_log(TWO), dictionary, config, progress))
    assert len(stages) > 2
    for told in stages.values():
        assert told == sorted(told)
        assert (min(told) >= 0.0, told[-1]) == (True, 1.0)


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
def test_a_long_record_is_told_its_windows_before_it_is_analysed(bfi: Callable, long_log: Path):
    words = ("identify", long_log, "-d", FAULTS, *SLOWER, "--json")
    windows = json.loads(bfi("info", long_log, "--json").stdout)["windows"]
    named = ", ".join(f"--from {one['start_s']:g} --to {one['stop_s']:g} (elevator)" for one in windows)
    told = f"the record is 11 min long; windows to take: {named}; the whole record is analysed"
    ended = at_a_terminal(*words)
    reading, _, analysing = ended.terminal.partition(f"{told}\r\n" if f"{told}\r\n" in ended.terminal else f"{told}\n")
    assert "reading the log" in reading
    assert "the window and the dictionary" in analysing
    assert "the window and the dictionary" not in reading
    assert texts(json.loads(ended.stdout)["notes"])[0] == told
    outcome = bfi(*words)
    assert (outcome.stderr, texts(json.loads(outcome.stdout)["notes"])[0]) == ("", told)


@pytest.mark.usefixtures("unscanned")
def test_whoever_asks_for_a_window_is_told_of_no_other(bfi: Callable, long_log: Path):
    for asked in (("--from", 0), ("--to", 659)):
        document = json.loads(bfi("identify", long_log, "-d", FAULTS, *SLOWER, *asked, "--json").stdout)
        assert not any("windows to take" in note for note in texts(document["notes"]))


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["citation_20180312_f1.h5", "citation_20190312_123416.h5"])
def test_at_most_three_windows_of_a_flight_are_named(bfi: Callable, flights: Path, name: str):
    refused = bfi("identify", flights / name, "-d", FAULTS, "--json")
    assert refused.code == 3
    windows = json.loads(bfi("info", flights / name, "--json").stdout)["windows"]
    told = refused.stderr
    assert len(re.findall(r"--from [0-9]", told)) == 3
    named = [(float(first), float(last)) for first, last in re.findall(r"--from ([0-9.]+) --to ([0-9.]+) \(", told)]
    # Of a log that is read with fewer channels, phases and windows may begin elsewhere.
    assert len(named) == 3
    for first, last in named:
        assert any(first < one["stop_s"] and one["start_s"] < last for one in windows)
