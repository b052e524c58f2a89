"""Methods of other programs: an executable that reads a log file and writes its statement as JSON."""

from __future__ import annotations

import json
import tempfile
from functools import partial
from pathlib import Path

from ...errors import ConfigError, reason_of
from ...flightlog import write_log
from ...printable import shortened
from ...programs import run_program
from ...quantities.text import counted
from ...serialization import from_plain
from .peers import Peer, Problem
from .result import Statement

# Limit of a statement, bytes: a thousand times one with a dozen faults.
MOST_BYTES = 2_000_000
LINE_LETTERS = 120  # of the last line of stderr: a line of a terminal


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
        words = [str(Path(path).absolute()), str(log)]
        try:
            ended = run_program(words, folder=Path(folder), timeout_s=timeout_s, most_bytes=MOST_BYTES)
        except OSError as error:
            raise ConfigError(f"{path}: does not start, {reason_of(error)}") from None
    last = f"; its last line on stderr: {shortened(ended.last_line, LINE_LETTERS)}" if ended.last_line else ""
    if ended.too_long:
        raise ConfigError(f"{path}: writes more than {MOST_BYTES / 1e6:g} MB; a statement has some hundred bytes{last}")
    if ended.code is None:
        raise ConfigError(f"{path}: still runs after {timeout_s:g} s; give a longer --timeout{last}")
    if ended.code:
        raise ConfigError(f"{path}: ends with exit code {ended.code}{last}")
    text = ended.stdout
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise ConfigError(f"{path}: writes no JSON, got {text[:40]!r}{last}") from None
    statement = from_plain(Statement, document, where=path)
    if contradiction := _contradiction_in(statement):
        raise ConfigError(f"{path}: contradicts itself, {contradiction}")
    return statement


def _contradiction_in(statement: Statement) -> str:
    """Return what of a statement excludes another part of it, "" for nothing."""
    if statement.decision == "no_fault" and statement.suspects:
        return f"decision no_fault with {counted(len(statement.suspects), 'suspect')}; declare a fault, or none of them"
    for suspect in statement.suspects:
        if suspect.onset_s is not None and suspect.offset_s is not None and suspect.offset_s < suspect.onset_s:
            return f"{suspect.channel} ends at {suspect.offset_s:g} s, before its onset at {suspect.onset_s:g} s"
    return ""
