"""Fixtures that more than one test file uses."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

from bfi_cli.commands import run_command

threadpool_limits(1)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell's background job ignores interruptions, and so would every program that a test starts and interrupts.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command line returned and printed."""

    code: int
    stdout: str
    stderr: str


@pytest.fixture
def bfi(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Run the command line in this process: `bfi("info", path)`."""

    def run(*argv: object) -> Outcome:
        words = [str(word) for word in argv]
        monkeypatch.setattr("sys.argv", ["bfi", *words])
        capsys.readouterr()
        code = run_command(words)
        printed = capsys.readouterr()
        return Outcome(code, printed.out, printed.err)

    return run


@pytest.fixture(scope="session")
def flights() -> Path:
    """Return the folder of recorded flights that lies beside the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "flights"
    if not folder.is_dir() and os.environ.get("CI") != "true":
        pytest.skip(f"the recorded flights are not at {folder}")
    return folder
