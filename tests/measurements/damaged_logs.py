"""Reading many damaged files: each batch in a process of its own, which the HDF5 library may end or never leave.

The processes import this module by its name, which a test module run by `pytest` has not.
"""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import signal
import traceback
import warnings
from pathlib import Path
from typing import Any

from bfi_cli.commands import run_command

EVERY_IDENTIFY = 10  # every tenth file is also given to `identify`
LONGEST_S = 60  # of a machine that does other work as well


def outcome(*argv: str) -> str:
    """Run a command line and return what came of it: "read", "refused", or a sentence on what should never come."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command(argv)
    lines = err.getvalue().splitlines()
    if code in (2, 3):
        return "refused" if len(lines) == 1 and not out.getvalue() else f"{len(lines)} lines of error: {lines[:3]}"
    if code != 0 or lines:
        return f"exit {code}: {lines[:3]}"
    document = json.loads(out.getvalue())
    log = document["log"]
    is_log = log["n_samples"] >= 2 and log["start_s"] < log["stop_s"] and log["rate_hz"] > 0.0
    return "read" if is_log else f"no log: {log}"


def peak_kb() -> int:
    """Return the largest memory of this program, kB; that of `getrusage` includes the one which started it."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("VmHWM")))


def work(folder: Path, first: int, stop: int, results: Any) -> None:
    """Read the files of a folder from `first` on; what is sent names each file before and its outcome after."""
    warnings.simplefilter("ignore")  # as the command itself does
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # ends the process also where the library never returns
    for k in range(first, stop):
        results.send((k, None))
        signal.alarm(LONGEST_S)
        path = str(folder / str(k))
        try:
            came = outcome("info", path, "--json")
            if came == "read" and k % EVERY_IDENTIFY == 0:
                came = outcome("identify", path, "--order", "2", "--json", "-d", str(folder / "dictionary.yaml"))
        except BaseException:
            came = traceback.format_exc()
        signal.alarm(0)
        results.send((k, came))
    results.send((None, peak_kb()))


def read_all(folder: Path, count: int) -> tuple[list[str], int]:
    """Return the outcome of every file, and the largest memory of the processes that ended by themselves, kB."""
    outcomes, largest, context = [""] * count, 0, multiprocessing.get_context("spawn")
    while "" in outcomes:
        first = outcomes.index("")
        received, sent = context.Pipe(duplex=False)
        process = context.Process(target=work, args=(folder, first, count, sent))
        process.start()
        sent.close()
        k: int | None = first
        with contextlib.suppress(EOFError):
            while k is not None:
                k, came = received.recv()
                if k is None:
                    largest = max(largest, came)
                else:
                    outcomes[k] = came or "begun"
        process.join()
        if not outcomes[first]:
            raise RuntimeError(f"the reading process ended with {process.exitcode} before its first file")
        outcomes = [f"ended by signal {-(process.exitcode or 0)}" if came == "begun" else came for came in outcomes]
    return outcomes, largest
