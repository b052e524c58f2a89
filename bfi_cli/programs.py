"""Programs in processes of their own that never outlive this one: started, read and ended."""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import guard

GUARD = str(Path(guard.__file__))
# Seconds in which a guard must start a program, and end it: hundredths, but on a machine that is out of memory.
PATIENCE_S = 60.0
KEPT_BYTES = 4096  # of the end of stderr: its last line is shown
PIECE = 65_536  # bytes read at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a program ended.

    Attributes
    ----------
    code : exit code, 128 plus the number of the signal that ended it; None where it was ended because of the limits.
    stdout : what it wrote, `too_long` where it wrote more than may be.
    last_line : of stderr, "" where it wrote none.
    """

    code: int | None
    stdout: bytes
    too_long: bool
    last_line: str


@contextlib.contextmanager
def guarded(words: Sequence[str], **streams: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Start a program; it ends with all that it started when the block does, or this process, of whatever cause.

    Yields the process that guards it, whose exit code is the program's.

    Parameters
    ----------
    words : program and arguments.
    streams : arguments of `subprocess.Popen`: `cwd`, `env`, `stdout`, `stderr`.

    Raises
    ------
    OSError : the program does not start.
    """
    ours, theirs = socket.socketpair()
    with ours:
        with theirs:
            process = subprocess.Popen(
                # Isolated, without site-packages: nothing of the caller's environment changes what runs.
                [sys.executable, "-I", "-S", GUARD, str(theirs.fileno()), *words],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                **streams,
            )
        try:
            ours.settimeout(PATIENCE_S)
            started = ours.recv(16)
            if started.strip() not in (b"0", b""):
                number = int(started)
                raise OSError(number, os.strerror(number))
            yield process
        finally:
            with contextlib.suppress(OSError):
                ours.shutdown(socket.SHUT_RDWR)
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()


def run_program(words: Sequence[str], *, folder: Path, timeout_s: float, most_bytes: int) -> Ended:
    """Run a program to its end, until it takes longer than `timeout_s` or writes more than `most_bytes` to stdout.

    Raises
    ------
    OSError : it does not start.
    """
    written = {1: bytearray(), 2: bytearray()}
    with guarded(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        until = time.monotonic() + timeout_s
        with selectors.DefaultSelector() as streams:
            for number, stream in ((1, process.stdout), (2, process.stderr)):
                assert stream is not None
                streams.register(stream, selectors.EVENT_READ, number)
            while streams.get_map() and len(written[1]) <= most_bytes:
                left = until - time.monotonic()
                ready = streams.select(max(left, 0.0))
                if not ready and left <= 0.0:
                    break
                for key, _ in ready:
                    piece = os.read(key.fd, PIECE)
                    if not piece:
                        streams.unregister(key.fileobj)
                    written[key.data] += piece
                del written[2][:-KEPT_BYTES]
        too_long = len(written[1]) > most_bytes
        code = None
        if not too_long:
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = process.wait(max(until - time.monotonic(), 0.0))
    lines = bytes(written[2]).decode("utf-8", "replace").split("\n")
    last_line = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return Ended(code=code, stdout=bytes(written[1]), too_long=too_long, last_line=last_line)
