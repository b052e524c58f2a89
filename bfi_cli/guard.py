"""Run a program of others, and end it with all that it started when the caller says so, or is no more.

`python guard.py NUMBER PROGRAM ARGUMENT...`: NUMBER is that of an inherited socket, whose other end the caller holds.
Once the program runs, a 0 is sent, or the number of the error why it does not start. When the caller closes its end, or
dies of whatever cause, everything is killed. The exit code is that of the program, 128 plus the number of the signal
that ended it. This file is run by itself, on the standard library alone, so that it starts at once.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import socket
import subprocess
import sys
import threading
import time

# Number of the option of prctl(2) by which orphans below this process become its children (Linux).
PR_SET_CHILD_SUBREAPER = 36
PAUSE_S = 0.005  # between two looks at what is still there


def main(number: int, words: list[str]) -> int:
    """Return the exit code of the program."""
    with contextlib.suppress(Exception):  # a system without it: what leaves the program's group is not found
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    caller = socket.socket(fileno=number)
    try:
        program = subprocess.Popen(words, start_new_session=True)
    except OSError as error:
        caller.sendall(b"%d\n" % (error.errno or 1))
        return 127
    with contextlib.suppress(OSError):
        caller.sendall(b"0\n")
    threading.Thread(target=_end_with_caller, args=(caller, program.pid), daemon=True).start()
    code = program.wait()
    end_all(program.pid)
    return code if code >= 0 else 128 - code


def _end_with_caller(caller: socket.socket, group: int) -> None:
    with contextlib.suppress(OSError):
        while caller.recv(64):
            pass
    end_all(group)
    os._exit(128 + signal.SIGKILL)


def end_all(group: int) -> None:
    """Kill a group of processes, and what descends from this process until nothing does."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)
    while children := children_of(os.getpid()):
        for child in children:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(child, signal.SIGKILL)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        time.sleep(PAUSE_S)


def children_of(parent: int) -> list[int]:
    """Return the numbers of the processes whose parent is this one; none where the system has no /proc."""
    children = []
    with contextlib.suppress(OSError):
        for name in os.listdir("/proc"):
            if name.isdigit():
                with contextlib.suppress(OSError, ValueError, IndexError), open(f"/proc/{name}/stat", "rb") as file:
                    # The name of the program, in brackets, may hold anything; the parent is the second word after it.
                    if int(file.read().rpartition(b")")[2].split()[1]) == parent:
                        children.append(int(name))
    return children


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
