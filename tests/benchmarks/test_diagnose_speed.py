"""`bfi diagnose` on a recorded flight of 80 minutes at 10 Hz: a whole process, from outside.

Seconds and memory are those of the command and all of its workers: the wall clock, the processor seconds of all, and
the largest sum of what they hold at one time, each page that several share counted in parts.
"""

from __future__ import annotations

import os
import resource
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.benchmarks

FLIGHT, WORKERS = "citation_20180312_f1.h5", 2
SECONDS, MEGABYTES, FIRST_S = 30.0, 500.0, 1.0
EVERY_S = 0.05


def held(session: int) -> float:
    """Return the megabytes that all processes of a session hold."""
    kilobytes = 0.0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if os.getsid(int(folder.name)) == session:
                lines = (folder / "smaps_rollup").read_text().splitlines()
                kilobytes += sum(float(line.split()[1]) for line in lines if line.startswith("Pss:"))
        except OSError:  # over since
            continue
    return kilobytes / 1024.0


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="memory is read from /proc")
def test_a_whole_flight(flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["diagnose", str(flights / FLIGHT), "--workers", str(WORKERS), "--out", str(tmp_path), "--progress"]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    ours, theirs = os.openpty()  # progress is drawn on a terminal as it comes
    process = subprocess.Popen(
        [sys.executable, "-m", "bfi_cli", *words],
        env={**os.environ, "OMP_NUM_THREADS": "1", "TERM": "xterm"},
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        start_new_session=True,
    )
    said, first_s, most = b"", None, 0.0
    while process.poll() is None:
        if select.select([ours], [], [], EVERY_S)[0]:
            said += os.read(ours, 1 << 16)
            first_s = first_s or time.perf_counter() - start
        most = max(most, held(process.pid))
    wall_s, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    assert process.returncode == 0, said.decode()
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    os.close(ours)
    os.close(theirs)
    with capsys.disabled():
        print(f"\n{FLIGHT}, {WORKERS} workers: {wall_s:.1f} s (bar {SECONDS:g} s), {used_s:.1f} s of processors")
        first = "none" if first_s is None else f"{first_s:.2f} s"
        print(f"  {most:.0f} MB at most (bar {MEGABYTES:g} MB), first progress after {first} (bar {FIRST_S:g} s)")
