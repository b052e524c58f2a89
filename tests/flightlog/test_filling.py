"""Missing samples are interpolated where that is asked for; a log without time gets the rate that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_logs import made_log, write_hdf5, write_text
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, inspect_log, read_log, require_usable
from bfi_cli.flightlog.resampling import with_filled

RATE_HZ = 10.0
TIME_S = np.arange(200) / RATE_HZ
LINE = 100.0 + 3.0 * TIME_S


def holed(values: np.ndarray, *stretches: tuple[int, int]) -> np.ndarray:
    out = values.copy()
    for start, stop in stretches:
        out[start:stop] = np.nan
    return out


@pytest.mark.parametrize("start_s", [0.0, 47921.0])
@pytest.mark.parametrize("n", [1, 3, 10])
def test_a_line_is_filled_exactly_up_to_the_length_asked_for(n: int, start_s: float):
    log = made_log(start_s + TIME_S, tas=holed(LINE, (50, 50 + n), (100, 101)), elevator=LINE)
    filled = with_filled(log, n / RATE_HZ)
    np.testing.assert_allclose(filled.channels["tas"].values, LINE, rtol=1e-12)
    assert filled.channels["elevator"] is log.channels["elevator"]
    assert texts(filled.notes)[-1] == (
        f"'tas': 2 stretches of up to {n / RATE_HZ:.3g} s without samples interpolated (--fill)"
    )
    if n > 1:
        shorter = with_filled(log, (n - 0.5) / RATE_HZ).channels["tas"].values
        np.testing.assert_array_equal(np.isnan(shorter), np.isin(np.arange(200), np.arange(50, 50 + n)))


def test_the_ends_of_a_log_are_left_and_a_gap_counts_as_missing_time():
    log = made_log(TIME_S, tas=holed(LINE, (0, 2), (99, 102), (198, 200)))
    left = with_filled(log, 5.0).channels["tas"].values
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(left)), [0, 1, 198, 199])
    keep = np.ones(200, dtype=bool)
    keep[100:101] = False
    part = with_filled(log.take(keep), 0.25)  # two samples are NaN, but three are missing
    assert np.isnan(part.channels["tas"].values[99:101]).all()
    assert part.n_samples == 199


@pytest.mark.parametrize("name", ["yaw", "roll", "longitude"])
@pytest.mark.parametrize("turn", [0.05, -0.05])
def test_an_angle_takes_the_shorter_way_and_a_flag_its_last_value(turn: float, name: str):
    angle = (3.0 + turn * np.arange(200) + np.pi) % (2.0 * np.pi) - np.pi
    valid = np.repeat([1.0, 0.0], 100)
    log = made_log(TIME_S, **{name: holed(angle, (1, 8), (60, 65))}, valid_airspeed=holed(valid, (98, 102)))
    filled = with_filled(log, 1.0)
    np.testing.assert_allclose(np.exp(1j * filled.channels[name].values), np.exp(1j * angle), atol=1e-12)
    np.testing.assert_array_equal(filled.channels["valid_airspeed"].values[98:102], 1.0)


def test_the_clean_signal_of_a_fault_is_filled_alike():
    faulty = inject(made_log(TIME_S, tas=LINE), [Fault(shape="bias", channel="tas", magnitude=2.0, onset_s=5.0)])
    assert faulty.truth is not None
    channels = {"tas": replace(faulty.channels["tas"], values=holed(faulty.channels["tas"].values, (70, 73)))}
    truth = replace(faulty.truth, clean={"tas": holed(faulty.truth.clean["tas"], (70, 73))})
    filled = with_filled(replace(faulty, channels=channels, truth=truth), 0.3)
    assert filled.truth is not None
    np.testing.assert_allclose(filled.channels["tas"].values - filled.truth.clean["tas"], 2.0 * (TIME_S >= 5.0))


def test_reading_fills_more_than_half_a_second_on_request_only_and_says_so(bfi: Callable, tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", time=TIME_S, tas=holed(LINE, (50, 58), (70, 73)), elevator=np.sin(TIME_S))
    log = read_log(path)
    assert np.flatnonzero(np.isnan(log.channels["tas"].values)).tolist() == list(range(50, 58))
    assert "missing samples are interpolated: 3 of 'tas'" in texts(log.notes)
    assert not np.isnan(read_log(path, fill_s=0.8).channels["tas"].values).any()
    assert bfi("convert", path, "-o", tmp_path / "b.csv", "--fill", 0.8).code == 0
    assert not np.isnan(read_log(tmp_path / "b.csv").channels["tas"].values).any()
    (tmp_path / "c.yaml").write_text("fill_s: 0.7\n")
    refused = bfi("identify", path, "-d", "airdata", "-c", tmp_path / "c.yaml")
    assert (refused.code, "'tas' is not a number" in refused.stderr) == (3, True)
    outcome = bfi("info", path, "--fill", 0.8)
    assert "'tas': 1 stretch of up to 0.8 s without samples interpolated (--fill)" in " ".join(outcome.stdout.split())
    assert bfi("info", path, "--fill", 0).code == 2


@pytest.mark.parametrize("kind", ["csv", "h5"])
def test_a_log_without_time_gets_the_rate_asked_for(bfi: Callable, tmp_path: Path, kind: str):
    if kind == "csv":
        text = "\n".join(["tas [m/s],elevator [rad]", *(f"{x:.6f},{x:.3f}" for x in LINE)])
        path = write_text(tmp_path / "a.csv", text + "\n")
    else:
        path = write_hdf5(tmp_path / "a.h5", tas=LINE, elevator=LINE)
    with pytest.raises(LogError, match="give --sample-rate HZ"):
        read_log(path)
    log = read_log(path, sample_rate_hz=25.0)
    np.testing.assert_allclose(log.time_s, np.arange(200) / 25.0)
    assert "time is counted from --sample-rate 25 Hz" in texts(log.notes)
    assert "200 samples at 25 Hz" in " ".join(bfi("info", path, "--sample-rate", 25).stdout.split())
    if kind == "h5":
        with h5py.File(path, "a") as file:
            file.attrs["sample_rate_hz"] = "fast"  # what the file states does not matter where another is given
        assert read_log(path, sample_rate_hz=25.0).rate_hz == 25.0


def test_a_rate_is_refused_for_a_log_with_time(tmp_path: Path):
    path = write_text(tmp_path / "a.csv", "seconds,tas\n0,1\n1,2\n2,3\n")
    with pytest.raises(LogError, match=r"--sample-rate 5: it is for logs without .* has 'seconds'"):
        read_log(path, channel_map={"time": "seconds"}, sample_rate_hz=5.0)


@pytest.mark.parametrize("values", ["a few", "rising"])
def test_a_channel_that_its_file_says_is_slower_is_marked_as_held(values: str):
    """Its values need not show it: a wind hardly changes."""
    slow = np.floor(TIME_S / 5.0) if values == "a few" else LINE
    log = made_log(TIME_S, tas=LINE, wind_north=slow)
    channels = {**log.channels, "wind_north": replace(log.channels["wind_north"], own_rate_hz=1.25)}
    held = replace(log, channels=channels)
    report = {one.name: one for one in inspect_log(held).channels}
    assert report["wind_north"].hold_period_s == pytest.approx(0.8)
    assert report["tas"].hold_period_s is None
    assert [one.hold_period_s for one in inspect_log(log).channels] == [None, None]
    with pytest.raises(LogError, match=r"'wind_north' repeats .* about 1.25 Hz\); give --rate 1.25"):
        require_usable(held, ["tas", "wind_north"])
    require_usable(held, ["tas"])
    require_usable(log, ["tas", "wind_north"])
