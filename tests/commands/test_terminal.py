"""Answers on a real terminal of any width, in a pipe, and on streams that do not take them."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Callable
from itertools import cycle
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIAS, FAULTS = ROOT / "data" / "citation_bias.h5", ROOT / "tests" / "two_entries.yaml"
# Colours only: nothing that moves the cursor, which an answer has no use for.
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# What the terminal shows is looked at here, not the choice of a model or its resolution, which cost most of the time.
QUICK = ("--rate", "4", "--order", "2")
IDENTIFY = ("identify", BIAS, "-d", FAULTS, *QUICK)
LINE = f"bfi {' '.join(map(str, IDENTIFY))}"


def environment(**variables: str) -> dict[str, str]:
    kept = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "PYTHONUTF8")}
    return {**kept, "TERM": "xterm-256color", "PYTHONPATH": str(ROOT), **variables}


def on_terminal(columns: int, *argv: object) -> list[str]:
    """Run the command on a pseudo-terminal of so many columns and return its lines without colours."""
    screen, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    program = [sys.executable, "-m", "bfi_cli", *map(str, argv)]
    with subprocess.Popen(
        program, stdin=terminal, stdout=terminal, stderr=subprocess.PIPE, env=environment(), cwd=ROOT
    ) as process:
        os.close(terminal)
        shown = b""
        try:
            while part := os.read(screen, 65536):
                shown += part
        except OSError:  # how a terminal says that nobody writes to it any more
            pass
        os.close(screen)
        assert process.stderr is not None
        assert (process.wait(), process.stderr.read()) == (0, b"")
    return COLOUR.sub("", shown.decode()).splitlines()


def in_shell(line: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        ["sh", "-c", line.replace("bfi", f"{sys.executable} -m bfi_cli", 1)],
        capture_output=True,
        env=environment(**variables),
        cwd=cwd,
        check=False,
    )


@pytest.fixture
def stored(bfi: Callable, unscanned: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the answer of `LINE` as a file, which `bfi report` prints again."""
    path = tmp_path_factory.mktemp("stored") / "result.json"
    path.write_text(bfi(*IDENTIFY, "--json", "--series").stdout)
    return path


@pytest.fixture
def failing(bfi: Callable, tmp_path: Path) -> Path:
    """Return a log whose angle of attack steps at 12 s."""
    clean, log = tmp_path / "clean.h5", tmp_path / "failing.h5"
    noise = ("--noise", "aoa=0.0005", "--noise", "pitch=0.0005", "--noise", "pitch_rate=0.0002")
    assert bfi("simulate", "b747", "-o", clean, "--duration", 20, *noise).code == 0
    assert bfi("inject", clean, "--fault", "bias,channel=aoa,magnitude=0.02,onset_s=12", "-o", log).code == 0
    return log


# Three scenarios with every column of a table of rates and errors.
SWEEP = f"""
record: {{model: citation, rate_hz: 4, duration_s: 32}}
dictionary: {FAULTS}
active: [0, 1, 2]
magnitudes: {{low: 1, high: 10}}
trials: 1
identify: {{conditioning: {{rate_hz: none}}, model: {{order: 2}}, method: risro}}
"""
START_TIME, DETECT = (
    ("start-time", BIAS, "--rate", "10", "--order", "4", "--shape", "bias"),
    ("detect", "FAILING", "--train", "0:8"),
)


def not_pasted(lines: list[str]) -> list[str]:
    """Return the lines without advice, a command that the terminal folds so that it can be pasted."""
    return [line for line in lines if not line.startswith("To decide")]


@pytest.mark.slow
def test_fault_channel_and_onset_stand_in_one_line_that_fits():
    lines = on_terminal(40, *IDENTIFY, "-v")
    assert max(map(len, not_pasted(lines))) <= 40
    assert any(re.match(r" bias_13\.8 +tas +13\.8", line) for line in lines)
    assert "\x1b" not in "".join(lines)


@pytest.fixture
def narrow(bfi: Callable, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Run a command that takes its stdout for a terminal of 40 columns, and return its lines without colours."""
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setenv("TERM", "xterm-256color")

    def run(*argv: object) -> list[str]:
        monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
        outcome = bfi(*argv)
        assert outcome.code == 0
        return COLOUR.sub("", outcome.stdout).splitlines()

    return run


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("argv", "kept"),
    [(START_TIME, r" bias +tas +13\.8"), (DETECT, r" aoa +12 s +12\.\d+ s")],
    ids=["start-time", "detect"],
)
def test_of_a_scan_and_of_a_detection_too(failing: Path, narrow: Callable, argv: tuple[object, ...], kept: str):
    lines = narrow(*(failing if word == "FAILING" else word for word in argv), "-v")
    assert max(map(len, not_pasted(lines))) <= 40
    assert any(re.match(kept, line) for line in lines)


@pytest.mark.parametrize(
    "argv",
    [
        ("info", BIAS),
        ("dictionary", FAULTS, BIAS, *QUICK),
        ("diagnosability", BIAS, "-d", FAULTS, *QUICK),
        ("reproduce", "list"),
        ("calibrate", BIAS, "-o", "OUT", "--length", "16", "--step", "8", *QUICK, "--shape", "bias"),
        ("montecarlo", "-c", "SWEEP"),
        pytest.param(
            ("montecarlo", "-c", ROOT / "configs" / "montecarlo_thesis.yaml", "--trials", "1"), marks=pytest.mark.slow
        ),
    ],
    ids=lambda argv: argv[0],
)
def test_no_line_is_wider_than_a_narrow_terminal(narrow: Callable, argv: tuple[object, ...], tmp_path: Path):
    paths = {"OUT": tmp_path / "t.json", "SWEEP": tmp_path / "sweep.yaml"}
    paths["SWEEP"].write_text(SWEEP)
    lines = narrow(*(paths.get(str(word), word) for word in argv))
    assert lines
    assert max(map(len, lines)) <= 40


@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize(("variables", "columns"), [({}, 120), ({"COLUMNS": "60", "FORCE_COLOR": "1"}, 60)])
def test_a_pipe_gets_the_table_plain(
    variables: dict[str, str], columns: int, bfi: Callable, monkeypatch: pytest.MonkeyPatch
):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    done = bfi(*IDENTIFY)
    text = done.stdout
    assert (done.code, done.stderr) == (0, "")
    assert text.startswith("FAULT  true airspeed reads 4.00")
    assert "\x1b" not in text
    assert 0.8 * columns < max(map(len, text.splitlines())) <= columns


@pytest.mark.usefixtures("unscanned")
def test_json_holds_the_series_when_asked(bfi: Callable):
    short, long = (json.loads(bfi(*IDENTIFY, "--json", *more).stdout) for more in ((), ("--series",)))
    assert set(long) - set(short) == {"series"}


NAME = b"fl\xffight.h5"
COMMANDS = (
    ("info {log} --json", 0),
    ("convert {log} -o {new}.csv", 0),
    ("inject {log} --fault bias,channel=tas,magnitude=1,onset_s=3 -o {new}.h5 --json", 0),
    ("identify {log} -d {faults} -c {config} --out {new}", 0),
    ("report {new}/result.json", 0),
    ("identify {log}x", 3),
    ("identify {log} -d {log}x", 2),
)


@pytest.mark.slow
def test_names_that_are_no_text(tmp_path: Path):
    names = {
        "log": NAME, "new": b"n\xff", "faults": b"d\xff.yaml", "config": b"c\xff.yaml",
    }  # fmt: skip
    folder = os.fsencode(tmp_path)
    for source, name in ((BIAS, "log"), (FAULTS, "faults")):
        Path(os.fsdecode(os.path.join(folder, names[name]))).write_bytes(source.read_bytes())
    Path(os.fsdecode(os.path.join(folder, names["config"]))).write_text(
        "seed: 1\nmodel: {order: 2}\nconditioning: {rate_hz: 4}\n"
    )
    for (line, code), encoding in zip(COMMANDS, cycle(("ascii", "utf-8")), strict=False):
        words = line.format(**{key: os.fsdecode(name) for key, name in names.items()})
        done = in_shell(f"bfi {words}", tmp_path, PYTHONIOENCODING=encoding)
        assert done.returncode == code, done.stderr
        said = done.stdout.decode(encoding) + done.stderr.decode(encoding)
        assert "--json" not in line or json.loads(done.stdout)
        assert done.stderr.count(b"\n") == (code != 0)
        assert "\\xff" in said or "report" in line or "--out" in line
    stored = Path(os.fsdecode(os.path.join(folder, names["new"])))
    document = json.loads((stored / "result.json").read_text("utf-8"))
    assert document["log"]["path"] == r"fl\xffight.h5"
    assert r"fl\xffight.h5" in (stored / "report.html").read_text("utf-8")


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("streams", "code", "line"),
    [
        (">/dev/full", 2, b"stdout: cannot be written, no space left on device; free some space, or write elsewhere\n"),
        (">&- 2>&- <&-", 2, b""),
        (">&-", 2, b"stdout: cannot be written, bad file descriptor; free some space, or write elsewhere\n"),
        (">/dev/full 2>/dev/full", 2, b""),
        ("2>/dev/full", 0, b""),
        ("2>&-", 0, b""),
    ],
)
def test_streams_that_take_nothing(streams: str, code: int, line: bytes, tmp_path: Path, stored: Path):
    """A line, and an answer of kilobytes; where the disk alone is full, one that is longer than any buffer."""
    long = f"bfi report {stored} --json --series" if "/dev/full" in streams else "bfi reproduce list --json"
    for words in ("bfi --help", long):
        done = in_shell(f"{words} {streams}", tmp_path, TMPDIR=str(tmp_path))
        assert (done.returncode, done.stderr) == (code, line)
        assert list(tmp_path.iterdir()) == []


def limited(line: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[bytes]:
    """Run a line that may write files of a kilobyte or two; a compiled module would be cut there, and stay."""
    return in_shell(f"ulimit -f 2; exec {line}", cwd, PYTHONDONTWRITEBYTECODE="1", **variables)


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_long_answer_is_printed_whole_or_refused(unbuffered: str, tmp_path: Path, stored: Path):
    command = f"bfi report {stored} --json --series > answer.json"
    done = limited(command, tmp_path, PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 2
    assert done.stderr == b"stdout: cannot be written, file too large; free some space, or write elsewhere\n"


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    "line",
    [
        "bfi convert {log} -o new.h5",
        "bfi convert {log} -o new.csv",
        f"{LINE} --out new",
    ],
)
def test_a_disk_that_fills_up_leaves_nothing(line: str, tmp_path: Path):
    """A limit on the size of a file stands for the disk: a kilobyte or two."""
    done = limited(line.format(log=BIAS), tmp_path)
    assert done.returncode == 2
    assert re.fullmatch(rb"new.*: cannot be written, file too large; give another --out(put)?\n", done.stderr)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("home", ["/dev/null", ""])
def test_a_home_that_cannot_be_written_is_no_news(home: str, tmp_path: Path):
    elsewhere = dict.fromkeys(("XDG_CACHE_HOME", "XDG_CONFIG_HOME"), f"{home}/x")
    done = in_shell(f"bfi plot {BIAS} --out {tmp_path}", ROOT, HOME=home, **elsewhere)
    assert (done.returncode, done.stderr) == (0, b"")
