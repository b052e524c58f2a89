"""Reading: the same log from every format, names and units, and one line for every way a file can be broken."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_logs import write_hdf5, write_text
from noted import texts
from scipy.io import savemat

from bfi_cli.errors import BfiError, LogError
from bfi_cli.flightlog.read import read_log

TIME = np.arange(5) / 10.0
TAS = np.array([100.0, 101.5, 102.0, 101.0, 99.5])
KT = 1852.0 / 3600.0


def as_csv(path: Path) -> Path:
    rows = "\n".join(f"{t},{v}" for t, v in zip(TIME, TAS, strict=True))
    return write_text(path / "log.csv", f"# made up\ntime [s],vtas [kt]\n{rows}\n")


def as_semicolon_csv(path: Path) -> Path:
    rows = "\n".join(f"{t};{v};" for t, v in zip(TIME, TAS, strict=True))
    return write_text(path / "log.txt", f'\ufeffTime;"TAS_kt";\n\n{rows}')


def as_hdf5(path: Path) -> Path:
    write_hdf5(path / "log.h5", time=TIME, vtas=TAS)
    with h5py.File(path / "log.h5", "a") as file:
        file["vtas"].attrs["units"] = "kt"
        file["nothing"] = "text"
    return path / "log.h5"


def as_hdf5_group(path: Path) -> Path:
    write_hdf5(path / "log.dat", "flight", t=TIME, TAS_kt=TAS.astype(np.float32))
    return path / "log.dat"


def as_matlab(path: Path) -> Path:
    savemat(path / "log.mat", {"t": TIME[None, :], "tas_kt": TAS[:, None], "remark": "text", "mass": 4500.0})
    return path / "log.mat"


def as_matlab_structs(path: Path) -> Path:
    flight = {"time": {"data": TIME, "units": "s"}, "Dadc1_tas": {"data": TAS, "units": "knots", "description": "TAS"}}
    savemat(path / "log.mat", {"flightdata": flight})
    return path / "log.mat"


def as_matlab_73(path: Path) -> Path:
    with h5py.File(path / "log.mat", "w", userblock_size=512) as file:
        for name, values, unit in (("time", TIME, "s"), ("Dadc1_tas", TAS, "knots")):
            file[f"flightdata/{name}/data"] = values[None, :]
            file[f"flightdata/{name}/units"] = np.array([[ord(c)] for c in unit], dtype=np.uint16)
            file[f"flightdata/{name}/units"].attrs["MATLAB_class"] = np.bytes_("char")
    with open(path / "log.mat", "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    return path / "log.mat"


FORMATS = (as_csv, as_semicolon_csv, as_hdf5, as_hdf5_group, as_matlab, as_matlab_structs, as_matlab_73)


@pytest.mark.parametrize("write", FORMATS)
def test_every_format_gives_the_same_log(write, tmp_path: Path):
    log = read_log(write(tmp_path))
    np.testing.assert_allclose(log.time_s, TIME, rtol=0, atol=0)
    np.testing.assert_allclose(log.channels["tas"].values, TAS * KT, rtol=1e-15)
    assert list(log.channels) == ["tas"]
    assert log.channels["tas"].unit == "m/s"
    assert log.rate_hz == pytest.approx(10.0)
    assert len(log.sha256) == 64
    assert not log.channels["tas"].values.flags.writeable


@pytest.mark.parametrize("write", FORMATS)
def test_the_suffix_does_not_matter(write, tmp_path: Path):
    path = write(tmp_path)
    disguised = path.rename(tmp_path / "log.xyz")
    assert read_log(disguised).channels["tas"].values[0] == pytest.approx(100.0 * KT)


def test_a_csv_is_read_without_the_library_for_matlab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "scipy.io", None)
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert read_log(as_csv(tmp_path)).n_samples == 5


def test_time_is_counted_from_a_sample_rate(tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", tas=TAS)
    with h5py.File(path, "a") as file:
        file.attrs["sample_rate_hz"] = 20.0
    log = read_log(path)
    np.testing.assert_allclose(log.time_s, np.arange(5) / 20.0)
    assert "time is counted from sample_rate_hz = 20 Hz" in texts(log.notes)


@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_without_a_time_axis_the_most_common_length_decides(kind: str, tmp_path: Path):
    arrays = {"a_table": np.arange(7.0), "tas": 90.0 + np.arange(30.0), "pitch": np.zeros(30), "roll": np.ones(30)}
    if kind == "h5":
        path = write_hdf5(tmp_path / "a.h5", **arrays)
    else:
        path = tmp_path / "a.mat"
        savemat(path, arrays)
    log = read_log(path, sample_rate_hz=10.0)
    assert log.n_samples == 30
    assert set(log.channels) == {"tas", "pitch", "roll"}
    assert any("'a_table' has 7 samples, the time axis 30" in note for note in texts(log.notes))


def test_empty_cells_are_nan(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", "time,tas [m/s]\n0,1\n1,\n2,nan\n3,4\n"))
    np.testing.assert_array_equal(log.channels["tas"].values, [1.0, np.nan, np.nan, 4.0])


def test_segments_and_truth_of_an_hdf5_file(tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", time=TIME, tas=TAS + 1.0)
    with h5py.File(path, "a") as file:
        file.attrs["segments"] = '[{"label": "phugoid", "t_start": 0.1, "t_end": 0.3}]'
        file["truth/tas_clean"] = TAS
        file["truth/tas_clean"].attrs["units"] = "m/s"
        file["truth"].attrs["faults"] = '[{"shape": "bias", "channel": "tas", "magnitude": 1, "offset_s": null}]'
    log = read_log(path)
    assert (log.segments[0].label, log.segments[0].start_s, log.segments[0].stop_s) == ("phugoid", 0.1, 0.3)
    assert log.truth is not None
    assert (log.truth.faults[0].shape, log.truth.faults[0].magnitude) == ("bias", 1.0)
    np.testing.assert_array_equal(log.truth.clean["tas"], TAS)


def test_of_two_claims_the_mapped_then_the_exact_name_wins(tmp_path: Path):
    path = write_hdf5(tmp_path / "a.h5", time=TIME, alpha=TAS, aoa=2 * TAS, mine=3 * TAS)
    log = read_log(path)
    assert log.channels["aoa"].values[0] == 200.0
    assert log.channels["alpha"].values[0] == 100.0
    assert "'alpha' is a second aoa; 'aoa' is used for it" in texts(log.notes)
    mapped = read_log(path, channel_map={"aoa": "mine"})
    assert mapped.channels["aoa"].values[0] == 300.0
    assert mapped.channels["aoa_2"].source == "aoa"
    assert {channel.source for channel in mapped.channels.values()} == {"alpha", "aoa", "mine"}


def test_a_unit_may_be_stated_by_either_name_and_wins_over_the_file(tmp_path: Path):
    path = as_csv(tmp_path)
    for name in ("vtas", "tas"):
        assert read_log(path, unit_map={name: "km/h"}).channels["tas"].values[0] == pytest.approx(100.0 / 3.6)


def test_a_missing_unit_is_a_note_and_an_unknown_one_of_no_standard_channel_too(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", "time,tas,date [ddmmyy]\n0,1,2\n1,2,3\n"))
    assert log.channels["tas"].unit == ""
    assert log.channels["tas"].source_unit is None
    assert any(note.startswith("no unit is stated for tas (m/s)") for note in texts(log.notes))
    assert "'date' is in 'ddmmyy', an unknown unit; its values are kept as they are" in texts(log.notes)


def test_a_name_whose_unit_does_not_fit_keeps_its_own_name(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", "time,p [hPa]\n0,1\n1,2\n"))
    assert log.channels["p"].values.tolist() == [100.0, 200.0]
    assert "'p' is in 'hPa', so it is not taken for roll_rate" in texts(log.notes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("# only this\n", "no header line"),
        ("time,tas\n", "0 samples below the header"),
        ("time,tas\n0,1\n", "1 samples below the header"),
        ("0,1\n1,2\n", "no header, line 1 holds numbers"),
        (
            "time,tas\n0,1\n\n1,abc\n",
            "no channels beside time, 'tas' holds text in 1 of 2 cells, the first 'abc' in line 4",
        ),
        (
            "time,tas\n0,1\n1,2_0\n",
            "no channels beside time, 'tas' holds text in 1 of 2 cells, the first '2_0' in line 3",
        ),
        ("time,tas\n0,1\n1\n2,3\n", "line 3 has 1 values, the header names 2 channels"),
        ("time,tas\n0,1\n1,2,3\n", "line 3 has 3 values, the header names 2 channels"),
        ("tas,aoa\n0,1\n1,2\n", "no time axis, got neither a channel 'time' nor"),
        ("time\n0\n1\n2\n", "no channels"),
        ("time,tas\n0,1\n2,2\n1,3\n", "'time' does not increase at sample 2 (1 s after 2 s"),
        ("time,tas\n0,1\n0,2\n", "'time' does not increase at sample 1"),
        ("time,tas\n3,1\n2,2\n1,3\n", "2 such steps); reverse its samples"),
        ("time,tas\n0,1\n,2\n", "'time' is not a number at sample 1 (1 in all)"),
        ("time,tas [knotz]\n0,1\n1,2\n", "no channels beside time, 'tas' is in 'knotz', an unknown unit; state it"),
        ("# faults: [{]\ntime,tas\n0,1\n1,2\n", "faults: not JSON"),
        ('# faults: [{"shape": "wave"}]\ntime,tas\n0,1\n1,2\n', "wave"),
        ('# segments: [{"label": "a"}]\ntime,tas\n0,1\n1,2\n', "a segment needs the numbers t_start and t_end"),
    ],
)
def test_a_broken_csv_is_one_line(text: str, message: str, tmp_path: Path):
    path = write_text(tmp_path / "a.csv", text)
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def truncated(path: Path) -> Path:
    whole = as_hdf5(path).read_bytes()
    (path / "log.h5").write_bytes(whole[: len(whole) // 2])
    return path / "log.h5"


def several_groups(path: Path) -> Path:
    write_hdf5(path / "a.h5", "one", time=TIME, tas=TAS)
    return write_hdf5(path / "a.h5", "two", time=TIME, tas=TAS)


def binary(path: Path) -> Path:
    (path / "a.bin").write_bytes(bytes(range(256)))
    return path / "a.bin"


def ulog(path: Path) -> Path:
    (path / "a.ulg").write_bytes(b"ULog\x01\x12\x35\x00")
    return path / "a.ulg"


def broken_matlab(path: Path) -> Path:
    whole = as_matlab(path).read_bytes()
    (path / "log.mat").write_bytes(whole[:200])
    return path / "log.mat"


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (truncated, "damaged or truncated HDF5 file"),
        (broken_matlab, "damaged or truncated MATLAB file"),
        (lambda path: write_hdf5(path / "a.h5", time=TIME, tas=TAS[:4]), "'tas' has 4 samples, the time axis 5"),
        (lambda path: write_hdf5(path / "a.h5", mass=4500.0), "no signals"),
        (several_groups, "several groups: one, two; give one of them with --group"),
        (binary, "neither HDF5, MATLAB v5 or v7.3, nor text"),
        (ulog, "damaged or truncated ULog, its header is cut off"),
        (lambda path: path, "is a directory"),
        (lambda path: path / "absent.csv", "no such file"),
    ],
)
def test_what_is_no_log_is_one_line(write, message: str, tmp_path: Path):
    path = write(tmp_path)
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"group": "absent"}, "no group 'absent'; the file has: one, two"),
        ({"group": "one", "channel_map": {"cas": "taz"}}, "--channel cas=taz: no channel 'taz'; did you mean 'tas'?"),
        ({"group": "one", "channel_map": {"cas": "x"}}, "the log has: tas, time"),
        ({"group": "one", "unit_map": {"foo": "kt"}}, "--unit foo=kt: no channel 'foo'"),
        ({"group": "one", "unit_map": {"tas": "knotz"}}, "did you mean 'knot'?"),
        ({"group": "one", "unit_map": {"tas": "deg"}}, "--unit tas=deg: 'tas' is in m/s, got a unit of rad"),
    ],
)
def test_options_that_do_not_fit_the_file(options, message: str, tmp_path: Path):
    with pytest.raises(BfiError) as caught:
        read_log(several_groups(tmp_path), **options)
    assert message in str(caught.value)


def test_a_path_no_system_takes():
    with pytest.raises(LogError, match="cannot be read"):
        read_log("a\0b")


def fresh(write: Callable[[Path], Path], factory: pytest.TempPathFactory) -> Path:
    """Write the file anew into a folder of its own."""
    folder = factory.getbasetemp() / write.__name__
    folder.mkdir(exist_ok=True)
    for stale in folder.iterdir():
        stale.unlink()
    return write(folder)


def read_or_refuse(path: Path) -> None:
    try:
        log = read_log(path)
    except LogError:
        return
    assert all(channel.values.size == log.n_samples for channel in log.channels.values())


@given(
    data=st.binary(max_size=300),
    head=st.sampled_from([b"", b"time,tas\n", b"MATLAB 5.0 MAT-file", b"\x89HDF\r\n\x1a\n"]),
)
def test_arbitrary_bytes_are_read_or_refused(data: bytes, head: bytes, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "arbitrary"
    path.write_bytes(head + data)
    read_or_refuse(path)


@pytest.mark.first_rows(1)
@given(data=st.data())
@pytest.mark.parametrize("write", [as_csv, as_semicolon_csv, as_matlab, as_matlab_structs])
def test_mutated_files_are_read_or_refused(write, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = fresh(write, tmp_path_factory)
    whole = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(len(whole) // 2, len(whole)))])
    read_or_refuse(path)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("write", [as_hdf5, as_hdf5_group, as_matlab_73])
def test_mutated_hdf5_files_are_read_or_refused(write, tmp_path_factory: pytest.TempPathFactory):
    """Mutations are the same in every run: on some others the HDF5 library itself never returns."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        path = fresh(write, tmp_path_factory)
        whole = bytearray(path.read_bytes())
        for at in rng.integers(0, len(whole), rng.integers(1, 9)):
            whole[at] = rng.integers(0, 256)
        path.write_bytes(whole)
        read_or_refuse(path)


@pytest.mark.first_rows(2)
@given(data=st.data())
@pytest.mark.parametrize("write", [as_hdf5, as_hdf5_group, as_matlab_73])
def test_truncated_hdf5_files_are_refused(write, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = fresh(write, tmp_path_factory)
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(LogError):
        read_log(path)


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["citation_20180312_f1.h5", "citation_20190312_123416.h5", "sim_ae4320_de3211_1.h5"])
def test_recorded_flights(flights: Path, name: str):
    log = read_log(flights / name)
    assert {"tas", "elevator", "pitch", "pitch_rate", "aoa", "normal_acc"} <= set(log.channels)
    assert log.segments
    # The simulated one has a specific force downward as normal acceleration.
    assert len(texts(log.notes)) == name.startswith("sim_")


@pytest.mark.realdata
def test_the_matlab_original_is_the_same_flight(flights: Path):
    original, copy = read_log(flights / "de3211_1.mat"), read_log(flights / "sim_ae4320_de3211_1.h5")
    assert set(copy.channels) <= set(original.channels)
    for name, channel in copy.channels.items():
        np.testing.assert_array_equal(original.channels[name].values, channel.values)
    assert os.path.basename(original.path) == "de3211_1.mat"
