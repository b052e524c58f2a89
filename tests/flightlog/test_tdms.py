"""TDMS logs written by npTDMS: what was written is what is read, in SI units and on one time axis."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_tdms import START, waveform, write_tdms
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log

nptdms = pytest.importorskip("nptdms")

N = 600
T = np.arange(N) / 10.0
TAS, ELEVATOR = 100.0 + np.sin(T), 0.02 * np.cos(3.0 * T)
NOON_S = 43_200.25


def write(path: Path, *objects: object) -> Path:
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(list(objects))
    return path


@pytest.mark.parametrize("segments", [1, 7])
def test_the_numbers_that_were_written(segments: int, tmp_path: Path):
    log = read_log(write_tdms(tmp_path / "flight.bin", TAS, ELEVATOR, segments=segments))
    np.testing.assert_allclose(log.channels["tas"].values, TAS, rtol=1e-14)
    np.testing.assert_allclose(log.channels["elevator"].values, ELEVATOR, rtol=1e-14, atol=1e-17)
    np.testing.assert_allclose(log.time_s, NOON_S + T, rtol=0, atol=1e-9)
    assert log.channels["tas"].source_unit == "kt"
    assert log.channels["tas"].source == "TAS"
    assert "time counts from midnight of 2024-05-01 UTC" in texts(log.notes)


def test_scaled_numbers_are_the_ones_after_scaling(tmp_path: Path):
    counts = np.arange(N, dtype=np.int16)
    scaling = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 3.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "wf_increment": 0.1,
    }
    log = read_log(write(tmp_path / "a", nptdms.ChannelObject("g", "tas (m/s)", counts, properties=scaling)))
    np.testing.assert_array_equal(log.channels["tas"].values, 3.0 + 0.5 * counts)
    assert log.time_s[0] == 0.0


def test_a_channel_of_time_goes_before_waveforms(tmp_path: Path):
    path = write(
        tmp_path / "a",
        nptdms.ChannelObject("g", "Time", 1e3 * (5.0 + T), properties={"unit_string": "ms"}),
        waveform("g", "tas", TAS, "m/s", 7.0),
    )
    np.testing.assert_allclose(read_log(path).time_s, 5.0 + T, atol=1e-9)


def test_moments_are_a_time_axis_from_midnight(tmp_path: Path):
    moments = START + np.round(1e6 * T).astype("timedelta64[us]")
    path = write(
        tmp_path / "a",
        nptdms.ChannelObject("g", "stamp", moments),
        nptdms.ChannelObject("g", "tas", TAS, properties={"NI_UnitDescription": "m/s"}),
    )
    log = read_log(path)
    np.testing.assert_allclose(log.time_s, NOON_S + T, atol=1e-6)
    assert set(log.channels) == {"tas"}
    assert log.channels["tas"].source_unit == "m/s"


def test_waveforms_of_several_rates_and_groups_are_one_log(tmp_path: Path):
    """The heading, five times as fast, passes the end of its range; over the jump nothing is averaged."""
    fast = np.arange(5 * N) / 50.0
    heading = (350.0 + fast) % 360.0
    path = write(
        tmp_path / "a",
        waveform("air", "tas", TAS, "m/s", 10.0),
        waveform("attitude", "heading", heading, "deg", 50.0),
        waveform("wind", "wind_north", np.arange(60.0), "m/s", 1.0),
    )
    log = read_log(path)
    np.testing.assert_allclose(log.channels["tas"].values, TAS, atol=1e-9)
    np.testing.assert_allclose(log.time_s, NOON_S + T, atol=1e-9)
    error = log.channels["yaw"].values - np.deg2rad(350.0 + T)
    np.testing.assert_allclose(((error + np.pi) % (2.0 * np.pi) - np.pi)[5:-5], 0.0, atol=1e-9)
    assert log.channels["yaw"].own_rate_hz == pytest.approx(50.0)
    assert log.channels["wind_north"].own_rate_hz == pytest.approx(1.0)
    assert set(read_log(path, group="air").channels) == {"tas"}


def test_waveforms_that_start_on_two_days_keep_their_distance(tmp_path: Path):
    eve = np.datetime64("2024-05-01T23:59:50")
    path = write(
        tmp_path / "a",
        waveform("g", "tas", TAS, "m/s", 10.0, eve),
        waveform("g", "pitch", 0.1 * np.sin(T + 20.0), "rad", 10.0, eve + np.timedelta64(20, "s")),
    )
    log = read_log(path)
    np.testing.assert_allclose(log.time_s[[0, -1]], 86_390.0 + T[[0, -1]], atol=1e-6)
    late = log.time_s >= 86_410.0
    assert np.isnan(log.channels["pitch"].values[~late]).all()
    np.testing.assert_allclose(
        log.channels["pitch"].values[late], 0.1 * np.sin(log.time_s[late] - 86_390.0), rtol=0, atol=1e-6
    )


def test_groups_without_clocks_are_asked_for(tmp_path: Path):
    path = write(tmp_path / "a", nptdms.ChannelObject("one", "tas", TAS), nptdms.ChannelObject("two", "tas", TAS))
    with pytest.raises(LogError, match="several groups: one, two; give one of them with --group"):
        read_log(path)
    assert read_log(path, group="two", sample_rate_hz=10.0).rate_hz == pytest.approx(10.0)
    with pytest.raises(LogError, match="no group 'three'; the file has: one, two"):
        read_log(path, group="three")


def test_a_stated_rate_counts_time(tmp_path: Path):
    path = write(
        tmp_path / "a",
        nptdms.GroupObject("g", properties={"sample_rate_hz": 20.0}),
        nptdms.ChannelObject("g", "tas", TAS),
    )
    assert read_log(path).rate_hz == pytest.approx(20.0)


def test_what_is_no_signal_is_named(tmp_path: Path):
    path = write(
        tmp_path / "a",
        waveform("g", "tas", TAS, "m/s", 10.0),
        nptdms.ChannelObject("g", "remark", ["take-off", "landing"]),
        nptdms.ChannelObject("g", "calibration", np.arange(3.0)),
        nptdms.ChannelObject("g", "spare", np.empty(0)),
    )
    notes = texts(read_log(path).notes)
    assert "'remark' holds text and is left out" in notes
    assert "'spare' is empty and is left out" in notes
    assert "'calibration' has no wf_increment beside channels that have one and is left out" in notes


@pytest.mark.parametrize("step", [0.0, -0.1, np.nan, np.inf, 1e-300, 1e300])
def test_a_waveform_of_no_step_has_no_clock(step: float, tmp_path: Path):
    path = write(tmp_path / "a", nptdms.ChannelObject("g", "tas", TAS, properties={"wf_increment": step}))
    with pytest.raises(LogError, match="no time axis"):
        read_log(path)


def test_a_file_that_is_cut_off_is_read_up_to_there(tmp_path: Path):
    whole = write_tdms(tmp_path / "a", TAS, ELEVATOR, segments=4).read_bytes()
    (tmp_path / "b").write_bytes(whole[: int(0.9 * len(whole))])
    log = read_log(tmp_path / "b")
    assert 450 <= log.n_samples < N
    np.testing.assert_allclose(log.channels["tas"].values, TAS[: log.n_samples], rtol=1e-14)
    np.testing.assert_allclose(log.channels["elevator"].values, ELEVATOR[: log.n_samples], rtol=1e-14, atol=1e-17)
    assert any("is cut off" in note for note in texts(log.notes))


def test_a_file_that_is_cut_off_in_its_first_segment_is_refused(tmp_path: Path):
    whole = write_tdms(tmp_path / "a", TAS, ELEVATOR, text=True).read_bytes()
    (tmp_path / "b").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(LogError, match="is cut off before the end of its first channels; copy it again"):
        read_log(tmp_path / "b")


def test_an_index_file_beside_the_log_is_not_read(tmp_path: Path):
    path = write_tdms(tmp_path / "flight.tdms", TAS, ELEVATOR)
    (tmp_path / "flight.tdms_index").write_bytes(b"TDSh" + bytes(200))
    assert read_log(path).n_samples == N
    with pytest.raises(LogError, match="the index of a TDMS file cannot be read"):
        read_log(tmp_path / "flight.tdms_index")


def test_without_the_extra_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = write_tdms(tmp_path / "a", TAS, ELEVATOR)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(LogError, match=r"npTDMS is not installed; pip install 'bfi-cli\[tdms\]'"):
        read_log(path)


@given(data=st.data())
def test_a_damaged_tdms_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "damaged.tdms"
    whole = bytearray(write_tdms(path, TAS[:60], ELEVATOR[:60], segments=2, text=data.draw(st.booleans())).read_bytes())
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    with contextlib.suppress(LogError):
        assert read_log(path).n_samples >= 2
