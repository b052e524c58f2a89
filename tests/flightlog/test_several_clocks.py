"""Several time axes in one file: channels go by the one of their name or length, and come back on one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from noted import texts
from scipy.io import savemat

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log

MAIN = 5.0 + np.arange(400) / 20.0
ADC = 5.02 + np.arange(100) / 5.0
Columns = dict[str, np.ndarray]


def course(time_s: np.ndarray) -> np.ndarray:
    return 100.0 + 2.0 * np.sin(0.5 * time_s)


def h5(path: Path, columns: Columns) -> str:
    with h5py.File(path / "log.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    return str(path / "log.h5")


def mat(path: Path, columns: Columns) -> str:
    savemat(path / "log.mat", columns)
    return str(path / "log.mat")


def csv(path: Path, columns: Columns) -> str:
    longest = max(values.size for values in columns.values())
    rows = [[f"{v[k]:.9g}" if k < v.size else "" for v in columns.values()] for k in range(longest)]
    (path / "log.csv").write_text("\n".join(",".join(row) for row in [list(columns), *rows]))
    return str(path / "log.csv")


@pytest.mark.parametrize("written", [h5, mat, csv])
@pytest.mark.parametrize(("clock", "name"), [("time_adc", "adc_tas"), ("t_adc", "tas_adc"), ("adc_time", "tas")])
def test_a_channel_goes_by_the_axis_of_its_name_or_length(
    written: Callable[[Path, Columns], str], clock: str, name: str, tmp_path: Path
):
    if written is csv and name == "tas":
        pytest.skip("in a table all columns have one length")
    path = written(tmp_path, {"time": MAIN, "elevator": 0.01 * np.sin(MAIN), clock: ADC, name: course(ADC)})
    log = read_log(path)
    assert log.rate_hz == pytest.approx(5.0)
    np.testing.assert_allclose(log.channels["tas"].values, course(log.time_s), atol=1e-6)
    np.testing.assert_allclose(log.channels["elevator"].values[5:-5], 0.01 * np.sin(log.time_s)[5:-5], atol=1e-4)
    assert any(f"'{name}' by '{clock}'" in text for text in texts(log.notes))


def test_axes_of_one_length_whose_names_do_not_tell_are_named(tmp_path: Path):
    columns = {"time": MAIN, "time_a": ADC, "time_b": ADC + 0.05, "tas_a": course(ADC), "cas": course(ADC)}
    with pytest.raises(LogError, match=r"'cas' has as many samples as 'time_a' and 'time_b'.*name it cas_a or cas_b"):
        read_log(h5(tmp_path, columns))


@pytest.mark.parametrize("other", [MAIN + 1e9, MAIN[::-1], MAIN + 1e-5], ids=["elsewhere", "backwards", "the same"])
def test_what_is_no_second_time_of_the_log_changes_nothing(other: np.ndarray, tmp_path: Path):
    columns = {"time": MAIN, "gps_time": other, "tas": course(MAIN), "gps_altitude": 10.0 * MAIN}
    log = read_log(h5(tmp_path, columns))
    np.testing.assert_array_equal(log.time_s, MAIN)
    assert log.rate_hz == pytest.approx(20.0)
