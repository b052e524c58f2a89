"""Methods of other programs: an executable that reads a log file and writes its statement as JSON."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
from functools import partial
from pathlib import Path

from ...errors import ConfigError, reason_of
from ...flightlog import write_log
from ...printable import shortened
from ...serialization import from_plain
from .peers import Peer, Problem
from .result import Statement

# Limit of a statement, bytes: a thousand times one with a dozen faults.
MOST_BYTES = 2_000_000


def program_peer(path: str, timeout_s: float) -> Peer:
    """Return the method of an executable."""
    return Peer(summary=f"program {shortened(path, 60)}", state=partial(_run, path=path, timeout_s=timeout_s))


def _run(problem: Problem, *, path: str, timeout_s: float) -> Statement:
    """Run an executable on the window, written to a file of its own without the injected truth.

    Raises
    ------
    ConfigError : the executable does not start, fails, does not end in time, or does not write a statement.
    """
    with tempfile.TemporaryDirectory(prefix="bfi-") as folder:
        log = Path(folder) / "log.h5"
        write_log(problem.part, log)
        with (Path(folder) / "stdout").open("w+b") as written:
            try:
                process = subprocess.Popen(
                    [str(Path(path).absolute()), str(log)],
                    stdin=subprocess.DEVNULL,
                    stdout=written,
                    stderr=subprocess.DEVNULL,
                    cwd=folder,
                    start_new_session=True,
                )
            except OSError as error:
                raise ConfigError(f"{path}: does not start, {reason_of(error)}") from None
            try:
                code = process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                raise ConfigError(f"{path}: still runs after {timeout_s:g} s; give a longer --timeout") from None
            finally:
                # Whatever it started ends with it.
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            if code:
                raise ConfigError(f"{path}: ends with exit code {code}")
            written.seek(0)
            text = written.read(MOST_BYTES)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise ConfigError(f"{path}: writes no JSON, got {text[:40]!r}") from None
    return from_plain(Statement, document, where=path)
