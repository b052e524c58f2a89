"""How long a user waits: whole processes, from the start of the interpreter to its end, median of five."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.benchmarks

ROOT = Path(__file__).parents[2]
ROUNDS = 5
IDENTIFY = ("identify", "data/citation_bias.h5", "--dictionary", "configs/thesis_dictionary.yaml", "--json")


def seconds(*words: str) -> float:
    start = time.perf_counter()
    program = [sys.executable, "-m", "bfi_cli", *words]
    subprocess.run(program, cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, check=True)
    return time.perf_counter() - start


@pytest.mark.parametrize(
    ("name", "words", "bar"),
    [
        ("bfi --help", ("--help",), 0.4),
        ("bfi --version", ("--version",), 0.4),
        ("bfi info --json", ("info", "data/citation_bias.h5", "--json"), 2.0),
        ("bfi identify --json", IDENTIFY, 2.0),
        ("bfi identify --json --out", (*IDENTIFY, "--out", "OUT"), 6.0),
    ],
)
def test_a_whole_process(
    name: str, words: tuple[str, ...], bar: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    line = [str(tmp_path) if word == "OUT" else word for word in words]
    seconds(*line)
    times = [seconds(*line) for _ in range(ROUNDS)]
    with capsys.disabled():
        print(f"\n{name}: {statistics.median(times):.2f} s, {min(times):.2f} to {max(times):.2f} s (bar {bar:g} s)")
