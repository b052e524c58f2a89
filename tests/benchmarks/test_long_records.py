"""A day at 100 Hz: time and peak memory of a command, both measured from outside of it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

pytestmark = pytest.mark.benchmarks

N, RATE_HZ, BLOCK = 8_640_000, 100.0, 1_000_000
OTHERS = ("pitch", "roll", "cas", "longitudinal_acc", "normal_acc", "pitch_rate", "throttle", "aoa", "altitude")
COMMANDS = {
    "info": ("info", "--json"),
    # Bars on a machine that does nothing else: 10 s, then 60 s and 1 GB.
    "identify, 7 entries, 4 Hz": ("identify", "-d", "thesis", "--json"),
}


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of a day."""
    path = tmp_path_factory.mktemp("day") / "day.h5"
    write_day(path)
    return path


def write_day(path: Path) -> None:
    """Write a log of 11 channels, 830 MB: an airspeed that answers steps of an elevator, and a step of 4 m/s."""
    rng = np.random.default_rng(0)
    with h5py.File(path, "w") as file:
        for name in ("time", "tas", "elevator", *OTHERS):
            file.create_dataset(name, shape=(N,), dtype=np.float64)
        level = 0.0
        for start in range(0, N, BLOCK):
            k = np.arange(start, min(start + BLOCK, N))
            file["time"][start : k[-1] + 1] = k / RATE_HZ
            elevator = 0.03 * rng.integers(-1, 2, -(-len(k) // 200)).repeat(200)[: len(k)]
            file["elevator"][start : k[-1] + 1] = elevator
            slow = np.cumsum(elevator) / RATE_HZ
            # About its mean over ten seconds, so that it does not wander off over a day.
            slow += level - np.linspace(0.0, slow[-1] + level, len(k))
            noise = 0.05 * rng.standard_normal(len(k))
            file["tas"][start : k[-1] + 1] = 100.0 + slow + noise + 4.0 * (k >= 1000)
            for i, name in enumerate(OTHERS):
                file[name][start : k[-1] + 1] = np.sin(k / RATE_HZ / (i + 3)) + 0.01 * rng.standard_normal(len(k))


@pytest.mark.parametrize("label", COMMANDS)
def test_a_day_at_100_hz(day: Path, label: str):
    command, *options = COMMANDS[label]
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "bfi_cli", command, str(day), *options], stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    elapsed = time.perf_counter() - start
    cpu = usage.ru_utime + usage.ru_stime
    print(f"\n{label}: {elapsed:.0f} s ({cpu:.0f} s of one core), {usage.ru_maxrss / 1e3:.0f} MB")
    assert process.returncode == 0
