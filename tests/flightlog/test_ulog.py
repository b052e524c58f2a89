"""PX4 ULog, against an independent reader and against the same flight as `ulog2csv` writes it."""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_px4 import message, px4_topics, tas, ulog_bytes, write_ulog, write_ulog2csv
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.px4 import read_ulog_topics
from bfi_cli.flightlog.topics import fields_of


def test_the_ulog_and_its_csv_files_are_one_flight(tmp_path: Path):
    ours = read_log(write_ulog(tmp_path / "flight.bin", px4_topics(jitter=0.1)))
    other = read_log(write_ulog2csv(tmp_path / "folder", px4_topics(jitter=0.1)))
    np.testing.assert_array_equal(ours.time_s, other.time_s)
    assert set(ours.channels) == set(other.channels)
    for name, channel in ours.channels.items():
        np.testing.assert_array_equal(channel.values, other.channels[name].values)
        assert (channel.unit, channel.source, channel.own_rate_hz) == (
            other.channels[name].unit,
            other.channels[name].source,
            other.channels[name].own_rate_hz,
        )


def agree_with_pyulog(path: Path) -> int:
    """Compare every number of the topics we read with what pyulog reads, and return how many topics there are."""
    pyulog = pytest.importorskip("pyulog")
    theirs = {(d.name, d.multi_id): d.data for d in pyulog.ULog(str(path)).data_list}
    topics, _ = read_ulog_topics(str(path))
    assert {(one.name, one.instance) for one in topics} == {key for key in theirs if key[0] in fields_of("px4")}
    for one in topics:
        data = theirs[one.name, one.instance]
        np.testing.assert_array_equal(one.time_s, 1e-6 * data["timestamp"].astype(np.float64))
        assert set(one.fields) == {name for name in data if name != "timestamp" and "_padding" not in name}
        for name, values in one.fields.items():
            np.testing.assert_array_equal(values, data[name])
    return len(topics)


def test_an_independent_reader_finds_the_same_numbers(tmp_path: Path):
    assert agree_with_pyulog(write_ulog(tmp_path / "flight.ulg", px4_topics())) == 6


@pytest.mark.realdata
def test_a_recorded_ulog_against_an_independent_reader(flights: Path):
    path = flights / "reader_samples" / "sample_log_small.ulg"
    assert agree_with_pyulog(path) > 10
    log = read_log(path)
    assert log.channels["tas"].source == "airspeed.true_airspeed_m_s"
    assert np.nanmean(log.channels["normal_acc"].values) == pytest.approx(0.0, abs=0.3)
    assert abs(float(np.rad2deg(np.mean(log.channels["latitude"].values)))) < 90.0


def test_padding_that_is_not_in_the_data(tmp_path: Path):
    (tmp_path / "a").write_bytes(ulog_bytes(px4_topics(), padding=3))
    log = read_log(tmp_path / "a")
    np.testing.assert_allclose(log.channels["tas"].values, tas(log.time_s), atol=1e-5)


def test_formats_inside_formats_and_arrays_of_them(tmp_path: Path):
    body = message("F", b"point:float x;float y;")
    body += message("F", b"airspeed:uint64_t timestamp;point[2] at;float true_airspeed_m_s;")
    body += message("A", struct.pack("<BH", 0, 7) + b"airspeed")
    for k in range(20):
        body += message("D", struct.pack("<HQfffff", 7, 100_000 * k, 1, 2, 3, 4, 20 + k))
    (tmp_path / "a").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + body)
    topics, notes = read_ulog_topics(str(tmp_path / "a"))
    assert notes == []
    assert list(topics[0].fields) == ["at[0].x", "at[0].y", "at[1].x", "at[1].y", "true_airspeed_m_s"]
    assert topics[0].fields["at[1].x"].tolist() == [3.0] * 20
    assert read_log(tmp_path / "a", channel_map={"gear": "airspeed.at[0].y"}).channels["gear"].values[0] == 2.0


def test_appended_data_are_read_too(tmp_path: Path):
    whole = bytearray(ulog_bytes(px4_topics()))
    struct.pack_into("<B", whole, 16 + 3 + 8, 1)
    struct.pack_into("<Q", whole, 16 + 3 + 16, len(whole))
    cut = bytes(whole) + ulog_bytes({("airspeed", 0): {k: v[-1:] for k, v in px4_topics()["airspeed", 0].items()}})[59:]
    (tmp_path / "a").write_bytes(cut)
    assert read_log(tmp_path / "a").n_samples == read_log(write_ulog(tmp_path / "b", px4_topics())).n_samples


def test_a_later_kind_is_refused(tmp_path: Path):
    whole = bytearray(ulog_bytes(px4_topics()))
    whole[16 + 3 + 8] = 2
    (tmp_path / "a").write_bytes(whole)
    with pytest.raises(LogError, match="a ULog of a later kind"):
        read_log(tmp_path / "a")


def test_damage_is_skipped_to_the_next_synchronisation_and_said(tmp_path: Path):
    whole = bytearray(ulog_bytes(px4_topics()))
    whole[len(whole) // 2 : len(whole) // 2 + 30] = b"\xff" * 30
    (tmp_path / "a").write_bytes(whole)
    log = read_log(tmp_path / "a")
    assert any("bytes are damaged or cut off and were skipped" in note for note in texts(log.notes))
    np.testing.assert_allclose(log.channels["tas"].values, tas(log.time_s), atol=0.01)
    assert log.time_s[-1] > 155.0


def test_dropouts_are_said(tmp_path: Path):
    (tmp_path / "a").write_bytes(ulog_bytes(px4_topics()) + message("O", struct.pack("<H", 250)))
    assert any("lost data 1 times, 0.25 s in all" in note for note in texts(read_log(tmp_path / "a").notes))


@given(data=st.data())
def test_a_damaged_ulog_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "damaged.ulg"
    whole = bytearray(
        ulog_bytes({key: fields for key, fields in px4_topics().items() if key[0].startswith("airspeed")})
    )
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    with contextlib.suppress(LogError):
        assert read_log(path).n_samples >= 2
