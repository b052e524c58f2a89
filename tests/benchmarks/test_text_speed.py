"""Processor time of a CSV log of a million rows, beside pandas in the same run where that is installed."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.raw import ReadRequest
from bfi_cli.flightlog.text import read_csv

pytestmark = pytest.mark.benchmarks

N_ROWS, ROUNDS = 1_000_000, 3
BAR = 3.0  # times the processor time of pandas


def cpu_s(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


@pytest.mark.parametrize(
    ("digits", "cell"),
    [("6 decimals", "%.6f"), ("17 digits", "%.17g"), ("6 decimals, one cell in a hundred empty", "")],
)
def test_a_million_rows_of_six_columns(digits: str, cell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "log.csv"
    values = np.random.default_rng(0).normal(100.0, 10.0, (N_ROWS, 6))
    values[:, 0] = 0.01 * np.arange(N_ROWS)
    np.savetxt(path, values, delimiter=",", fmt=["%.2f", *[cell or "%.6f"] * 5], header="time,a,b,c,d,e", comments="")
    if not cell:
        rows = path.read_text().split("\n")
        rows[1:-1:100] = [row.rpartition(",")[0] + "," for row in rows[1:-1:100]]
        path.write_text("\n".join(rows))
    pandas = pytest.importorskip("pandas", reason="pandas is not installed, against which the reader is measured")
    works = {
        "pandas": lambda: pandas.read_csv(path),
        "read_csv": lambda: read_csv(str(path), ReadRequest()),
        "read_log": lambda: read_log(path),
    }
    taken = {name: statistics.median(cpu_s(work) for _ in range(ROUNDS)) for name, work in works.items()}
    with capsys.disabled():
        print(f"\n{digits}: pandas {taken['pandas']:.2f} s", end="")
        for name in ("read_csv", "read_log"):
            print(f", {name} {taken[name]:.2f} s ({taken[name] / taken['pandas']:.1f} times, bar {BAR:g})", end="")
        print()
