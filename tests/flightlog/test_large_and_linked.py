"""Of a large log only what a window needs is read, and it is the same; data come from the log itself alone."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_logs import write_hdf5
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import FlightLog, hdf5, read_log, resample
from bfi_cli.flightlog.resampling import with_reach

N = 2000
RNG = np.random.default_rng(0)
TIME = 100.0 + 0.1 * np.arange(N) + 0.003 * RNG.random(N)
TAS = RNG.normal(100.0, 1.0, N)


def flight(path: Path, *, counted: bool = False, **options: object) -> Path:
    """Write a log with its truth, in small chunks, times in ms or counted from a rate."""
    with h5py.File(path, "w") as file:
        made = {"tas": TAS, "flag": TAS > 100.0, "truth/tas_clean": TAS - 1.0}
        if counted:
            file.attrs["sample_rate_hz"] = 10.0
        else:
            made["timer"] = 1000.0 * TIME[None, :]
        for name, values in made.items():
            file.create_dataset(name, data=values, **options)
        file["truth"].attrs["faults"] = '[{"shape": "bias", "channel": "tas", "magnitude": 1, "offset_s": null}]'
    return path


def same(cut: FlightLog, whole: FlightLog) -> None:
    np.testing.assert_array_equal(cut.time_s, whole.time_s)
    assert list(cut.channels) == list(whole.channels)
    for name, channel in whole.channels.items():
        np.testing.assert_array_equal(cut.channels[name].values, channel.values)
    assert cut.truth is not None
    np.testing.assert_array_equal(cut.truth.clean["tas"], whole.truth.clean["tas"])


NAMES = {"channel_map": {"time": "timer"}, "unit_map": {"timer": "ms"}}
WRITTEN = {
    "contiguous": ({}, NAMES),
    "compressed": ({"compression": "gzip", "shuffle": True}, NAMES),
    "counted": ({"counted": True, "compression": "gzip"}, {}),
}


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("options", WRITTEN)
@settings(max_examples=10)
@given(ends=st.lists(st.none() | st.floats(0.0, 320.0), min_size=2, max_size=2))
def test_a_window_of_a_large_log_is_that_of_the_whole(options, ends, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / f"{options}.h5"
    written, names = WRITTEN[options]
    if not path.exists():
        flight(path, **written)
    from_s, to_s = ends
    whole = read_log(path, **names)
    wanted = windowed(lambda: whole, from_s, to_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hdf5, "WHOLE", 0)
        cut = windowed(lambda: read_log(path, **names, from_s=from_s, to_s=to_s), from_s, to_s)
    if isinstance(wanted, str) or isinstance(cut, str):
        assert cut == wanted
    else:
        same(cut, wanted)


def windowed(read: Callable[[], FlightLog], from_s: float | None, to_s: float | None) -> FlightLog | str:
    """Return the window of a log, or the line that says why there is none."""
    try:
        return read().window(from_s, to_s)
    except LogError as error:
        return str(error)


def test_a_resampled_window_of_a_large_log_is_that_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = flight(tmp_path / "a.h5", counted=True)
    whole = resample(read_log(path), 2.0, from_s=60.0, to_s=80.0)
    monkeypatch.setattr(hdf5, "WHOLE", 0)
    from_s, to_s = with_reach(2.0, 60.0, 80.0)
    log = read_log(path, from_s=from_s, to_s=to_s)
    assert log.n_samples < 400
    same(resample(log, 2.0, from_s=60.0, to_s=80.0), whole)


def test_a_log_that_is_not_large_is_read_whole(tmp_path: Path):
    """So that filters and clocks of held channels see what lies around the window."""
    assert read_log(flight(tmp_path / "a.h5", counted=True), from_s=1.0, to_s=2.0).n_samples == N


def test_a_large_log_says_how_many_samples_were_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(hdf5, "WHOLE", 0)
    log = read_log(flight(tmp_path / "a.h5", counted=True), from_s=1.0, to_s=2.0)
    assert "of 2000 samples only 12 were read, those around the window" in texts(log.notes)


@pytest.mark.parametrize("last", [100.0, np.nan])
def test_a_large_log_whose_time_does_not_increase_is_refused(last, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(hdf5, "WHOLE", 0)
    path = write_hdf5(tmp_path / "a.h5", time=np.append(TIME[:-1], last), tas=TAS)
    with pytest.raises(LogError, match=f"'time' does not increase, got 100.* at sample 0 and {last:g} s at sample"):
        read_log(path, from_s=1.0)


def test_a_link_within_the_file_is_followed(tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", "recorded/raw", airspeed=TAS)
    with h5py.File(path, "a") as file:
        file["time"] = TIME
        file["tas"] = h5py.SoftLink("recorded/here/airspeed")
        file["recorded/here"] = h5py.SoftLink("/recorded/raw")
    np.testing.assert_array_equal(read_log(path).channels["tas"].values, TAS)


def test_a_link_to_another_file_is_refused_although_the_file_is_there(tmp_path: Path):
    write_hdf5(tmp_path / "other.h5", tas=TAS)
    path = write_hdf5(tmp_path / "a.h5", time=TIME)
    with h5py.File(path, "a") as file:
        file["tas"] = h5py.SoftLink("/elsewhere/tas")
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/")
    with pytest.raises(
        LogError, match=r"'elsewhere' is an external link to 'other.h5:/'; a log must hold its own data"
    ):
        read_log(path)


@pytest.mark.parametrize("odd", [h5py.Empty("f8"), np.void(b"abc"), [1.5, 2.5], "reference", "ragged"])
def test_attributes_of_any_type_do_not_stop_the_reader(odd, tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", time=TIME, remark=TAS)
    with h5py.File(path, "a") as file:
        rows = np.empty(1, dtype=object)
        rows[0] = TAS
        made = {"reference": (file["time"].ref, h5py.ref_dtype), "ragged": (rows, h5py.vlen_dtype(np.float64))}
        value, dtype = made[odd] if isinstance(odd, str) else (odd, None)
        for name in ("units", "MATLAB_class"):
            file["remark"].attrs.create(name, value, dtype=dtype)
    np.testing.assert_array_equal(read_log(path).channels["remark"].values, TAS)


@pytest.fixture
def left_in_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every log be one whose channels are read on demand."""
    monkeypatch.setattr(hdf5, "READ_AT_ONCE", 0)


@pytest.mark.parametrize("options", [{}, {"compression": "gzip", "chunks": True}], ids=["plain", "packed"])
def test_channels_read_on_demand_are_those_read_at_once(tmp_path: Path, monkeypatch, options: dict):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, unit in (("tas", "kt"), ("oat", "degC"), ("pitch", "rad"), ("other", "quux")):
            file.create_dataset(name, data=TAS[None, :].astype(np.float32), **options)
            file[name].attrs["units"] = unit
        file["time"] = TIME
    at_once = read_log(path)
    monkeypatch.setattr(hdf5, "READ_AT_ONCE", 0)
    log = read_log(path)
    assert texts(log.notes) == texts(at_once.notes)
    assert list(log.channels) == list(at_once.channels)
    keep = np.abs(np.arange(N) - 900) > 3
    for part, whole in (
        (log, at_once),
        (log.window(150.0, 200.0), at_once.window(150.0, 200.0)),
        (log.window(150.0, 200.0).window(160.0, 170.0), at_once.window(160.0, 170.0)),
        (log.take(keep), at_once.take(keep)),
    ):
        for name, channel in whole.channels.items():
            own = part.channels[name]
            assert (own.unit, own.source, own.source_unit) == (channel.unit, channel.source, channel.source_unit)
            assert own.n_samples == channel.n_samples
            np.testing.assert_array_equal(own.between(slice(3, 40)), channel.values[3:40])
            np.testing.assert_array_equal(own.values, channel.values)
            assert not own.values.flags.writeable


@pytest.mark.usefixtures("left_in_file")
def test_only_the_channels_that_are_asked_for_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = write_hdf5(tmp_path / "a.h5", time=TIME, tas=TAS, pitch=TAS, roll=TAS)
    log, whole = read_log(path), 0
    opened = h5py.File

    def counted(*args: object, **options: object) -> h5py.File:
        nonlocal whole
        whole += 1
        return opened(*args, **options)

    monkeypatch.setattr(h5py, "File", counted)
    first = log.channels["tas"].values
    assert log.channels["tas"].values is first
    log.window(120.0, 180.0)
    assert whole == 1
    del first
    assert log.channels["tas"].values.size == N
    assert whole == 2


@pytest.mark.usefixtures("left_in_file")
def test_a_file_that_is_damaged_after_it_was_opened_is_an_error_line(tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", time=TIME, tas=TAS)
    log = read_log(path)
    path.write_bytes(b"gone")
    with pytest.raises(LogError, match="damaged or truncated HDF5 file"):
        _ = log.channels["tas"].values


@pytest.mark.parametrize("how", ["locked", "marked"])
def test_a_file_that_another_program_writes_is_named_as_that(how: str, tmp_path: Path):
    path = tmp_path / "a.h5"
    if how == "marked":  # by a program that ended without closing it
        write = "import h5py, os, sys; file = h5py.File(sys.argv[1], 'w', libver='latest'); file.flush(); os._exit(0)"
        subprocess.run([sys.executable, "-c", write, str(path)], check=True)
    else:
        write_hdf5(path, time=TIME, tas=TAS)
    with open(path, "rb") as held:
        if how == "locked":
            fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(LogError, match=r"a\.h5: is being written by another program, .*; close it there, or mend"):
            read_log(path)


@pytest.mark.parametrize("keep", [(), ("slow",)])
def test_a_channel_of_another_length_of_a_large_log_is_left_out_or_kept(
    keep: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path, wanted = flight(tmp_path / "a.h5"), {**NAMES, "keep": keep}
    with h5py.File(path, "r+") as file:
        file["slow"] = TAS[::4]
    whole = read_log(path, **wanted).window(150.0, 200.0)
    monkeypatch.setattr(hdf5, "WHOLE", 0)
    cut = read_log(path, from_s=150.0, to_s=200.0, **wanted).window(150.0, 200.0)
    assert list(cut.channels) == list(whole.channels)
    np.testing.assert_array_equal(cut.channels["tas"].values, whole.channels["tas"].values)
    if keep:  # the clock of this log is off by up to 3 ms
        np.testing.assert_allclose(cut.channels["slow"].values, whole.channels["slow"].values, atol=0.1)
    else:
        assert any("'slow' has 500 samples, the time axis 2000, and is left out" in text for text in texts(cut.notes))
