"""Whatever ends a command, no process that it started stays: workers, programs of others, and what these started."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOG = ROOT / "data" / "citation_bias.h5"
LIMIT_S = 120.0  # of waiting for a condition, on a machine with much else to do
HUNDREDTH = 0.01

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to see other processes")

WORK = """
import sys, time
from pathlib import Path
from bfi_cli.engine import in_order

def work(k):
    time.sleep(600)

if __name__ == "__main__":
    list(in_order(work, range(8), workers=2, chunk=1))
"""
SENDING = """
import sys
from pathlib import Path
from bfi_cli.engine import in_order

def work(k):
    return bytes(30_000_000)  # longer sent than made

if __name__ == "__main__":
    for _ in in_order(work, range(1000), workers=2, chunk=1):
        Path(sys.argv[1]).touch()
"""
IGNORED = """
import signal
signal.signal(signal.SIGHUP, signal.SIG_IGN)
from bfi_cli.commands import main
main()
"""
# A program that starts another in the background, and one that leaves its group and its parent behind. Both are
# there within milliseconds, however busy the machine is.
STARTS_OTHERS = """#!/bin/sh
sleep {seconds} &
setsid sh -c 'sleep {seconds} &'
touch {started}
sleep {seconds}
"""


def processes() -> dict[int, int]:
    """Return the parent of every process that runs; what has ended and waits for its parent counts as ended."""
    found = {}
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            try:
                state, parent = (path / "stat").read_text().rpartition(")")[2].split()[:2]
            except (OSError, ValueError):
                continue
            if state not in "ZX":
                found[int(path.name)] = int(parent)
    return found


def below(ancestor: int) -> set[int]:
    """Return the processes that descend from one."""
    parents, found = processes(), {ancestor}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {ancestor}


def wait_for(condition: Callable[[], object], what: str) -> None:
    until = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < until, what
        time.sleep(HUNDREDTH)


def lines_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def start(*words: object) -> subprocess.Popen[bytes]:
    """Start Python with words; a hangup ends it, also where these tests run under `nohup`, whose programs ignore it."""
    return subprocess.Popen(
        [sys.executable, *map(str, words)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    """End what a test started, even where it fails."""
    found: list[subprocess.Popen[bytes]] = []
    yield found
    for process in found:
        for pid in (*below(process.pid), process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_their_parent(number: int, started: list, tmp_path: Path):
    (tmp_path / "work.py").write_text(WORK)
    process = start(tmp_path / "work.py")
    started.append(process)

    def workers() -> list[int]:
        return [pid for pid in below(process.pid) if "spawn_main" in lines_of(pid)]

    wait_for(lambda: len(workers()) == 2, "two workers")
    others = below(process.pid)
    process.send_signal(number)
    wait_for(lambda: process.poll() is not None, "the end of the parent")
    wait_for(lambda: not others & {*processes()}, "the end of its workers")


def test_workers_that_send_end_with_their_parent(started: list, tmp_path: Path):
    (tmp_path / "work.py").write_text(SENDING)
    mark = tmp_path / "first"
    process = start(tmp_path / "work.py", mark)
    started.append(process)
    wait_for(mark.exists, "the first result")
    others = below(process.pid)
    process.send_signal(signal.SIGINT)
    wait_for(lambda: process.poll() is not None, "the end of the parent")
    wait_for(lambda: not others & {*processes()}, "the end of its workers")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGKILL])
def test_a_command_on_many_logs_leaves_no_worker(number: int, started: list, tmp_path: Path):
    for k in range(60):
        (tmp_path / f"{k}.h5").symlink_to(LOG)
    out = tmp_path / "out"
    process = start("-m", "bfi_cli", "info", tmp_path, "--workers", 2, "--out", out)
    started.append(process)
    wait_for(lambda: (out / "0" / "result.json").exists(), "the first answer")
    others = below(process.pid)
    assert len(others) >= 2
    process.send_signal(number)
    wait_for(lambda: process.poll() is not None, "the end of the command")
    assert process.returncode == (-number if number == signal.SIGKILL else 128 + number)
    wait_for(lambda: not others & {*processes()}, "the end of its workers")


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("number", [signal.SIGKILL, None, signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_programs_of_others_end_with_all_that_they_started(number: int | None, started: list, tmp_path: Path):
    """None is the end of the time that they have."""
    program, mark = tmp_path / "program", tmp_path / "started"
    seconds = f"600.{os.getpid()}{number or 0:02d}"  # a number that no other test has
    program.write_text(STARTS_OTHERS.format(started=mark, seconds=seconds))
    program.chmod(0o755)
    limit = 600 if number is not None else 5
    only = ("--only", "mine", "--program", f"mine={program}", "--timeout", limit)
    process = start("-m", "bfi_cli", "compare", LOG, *only)
    started.append(process)
    wait_for(mark.exists, "the program")

    def sleepers() -> set[int]:
        return {pid for pid in processes() if seconds in lines_of(pid)}

    wait_for(lambda: len(sleepers()) == 3, "what the program starts")
    if number is not None:
        process.send_signal(number)
    wait_for(lambda: process.poll() is not None, "the end of the command")
    wait_for(lambda: not sleepers(), "the end of the program and all that it started")


@pytest.mark.slow
def test_what_nohup_ignores_stays_ignored(started: list, tmp_path: Path):
    for k in range(6):
        (tmp_path / f"{k}.h5").symlink_to(LOG)
    out = tmp_path / "out"
    process = start("-c", IGNORED, "info", tmp_path, "--workers", 1, "--out", out)
    started.append(process)
    wait_for(lambda: (out / "0" / "result.json").exists(), "the first answer")
    process.send_signal(signal.SIGHUP)
    wait_for(lambda: process.poll() is not None, "the end of the command")
    assert process.returncode == 0
    assert (out / "index.html").exists()
