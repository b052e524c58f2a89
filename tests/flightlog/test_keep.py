"""`--keep NAME`: a channel of another number of samples, spread evenly over the log."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log

N, RATE_HZ = 400, 20.0
TIME_S = 5.0 + np.arange(N) / RATE_HZ


def course(time_s: np.ndarray) -> np.ndarray:
    return 100.0 + 2.0 * np.sin(0.5 * time_s)


def columns() -> dict[str, np.ndarray]:
    return {
        "time": TIME_S,
        "elevator": 0.01 * np.sin(TIME_S),
        "tas": course(TIME_S),
        "mach": course(TIME_S[::4]) / 300.0,
    }


def h5(path: Path) -> str:
    with h5py.File(path / "log.h5", "w") as file:
        for name, values in columns().items():
            file[name] = values
    return str(path / "log.h5")


def mat(path: Path) -> str:
    savemat(path / "log.mat", columns())
    return str(path / "log.mat")


@pytest.mark.parametrize("written", [h5, mat])
def test_a_channel_at_a_quarter_of_the_rate_comes_back_sample_for_sample_and_straight_between(written, tmp_path: Path):
    path = written(tmp_path)
    assert "mach" not in read_log(path).channels
    log = read_log(path, keep=["mach"])
    kept = log.channels["mach"].values
    np.testing.assert_allclose(kept[::4], course(TIME_S[::4]) / 300.0, rtol=1e-12)
    np.testing.assert_allclose(kept[:-4], course(TIME_S[:-4]) / 300.0, rtol=1e-4)
    assert any("'mach' has 100 samples, the time axis 400" in one.text for one in log.notes)


def test_one_of_the_right_length_is_left_as_it_is(tmp_path: Path):
    path = h5(tmp_path)
    np.testing.assert_array_equal(read_log(path, keep=["tas"]).channels["tas"].values, course(TIME_S))


def test_one_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(LogError, match="--keep match: no such channel; the log has: elevator, mach, tas"):
        read_log(h5(tmp_path), keep=["match"])


def test_on_the_command_line_and_where_the_channel_is_asked_for(bfi, tmp_path: Path):
    path = h5(tmp_path)
    refused = bfi("identify", path, "--input", "mach", "-d", "thesis")
    assert (refused.code, "--keep mach" in refused.stderr) == (3, True)
    assert "mach" in bfi("info", path, "--keep", "mach").stdout
