"""ArduPilot DataFlash: the flight that was written, damage, and a recorded log.

The numbers of the recorded log were compared once with pymavlink, which is no dependency: equal to rounding in every
field of the messages that are read.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_dataflash import airspeed, dataflash_bytes, fmt
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.dataflash import read_dataflash_topics


@pytest.fixture
def log_file(tmp_path: Path) -> Path:
    (tmp_path / "flight.csv").write_bytes(dataflash_bytes())
    return tmp_path / "flight.csv"


def test_the_flight_that_was_written(log_file: Path):
    log = read_log(log_file)
    t, inner = log.time_s, slice(4, -4)
    assert log.rate_hz == pytest.approx(10.0)
    expected = {
        "ias": [airspeed(one) for one in t],
        "pitch": 0.1 * np.sin(0.8 * t),
        "pitch_rate": 0.08 * np.cos(0.8 * t),
        "longitudinal_acc": 0.98 * np.sin(0.8 * t),
        "normal_acc": np.zeros(t.size),
        "elevator": -0.3 * np.sin(1.3 * t),
        "throttle": np.full(t.size, 0.4),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(log.channels[name].values[inner], np.asarray(values)[inner], atol=3e-3, err_msg=name)
    late = t > 12.0
    for name, value in (("velocity_north", 0.0), ("velocity_east", 25.0), ("latitude", np.deg2rad(52.0))):
        np.testing.assert_allclose(log.channels[name].values[late], value, atol=1e-5)
        assert log.channels[name].own_rate_hz == pytest.approx(5.0)
    assert log.channels["yaw"].values[50] == pytest.approx(np.deg2rad(-1.0), abs=1e-6)
    assert texts(log.notes)[0].startswith("the signals have clocks of their own")


def test_letters_and_their_scales(tmp_path: Path):
    body = fmt(9, "BARO", "QBcLIg", "TimeUS,I,Alt,x,y,z")
    for k in range(10):
        for sensor in (0, 1):
            row = struct.pack("<QBhiIe", 100_000 * k, sensor, 250 * sensor + k, 15_000_000, 7, 0.5)
            body += b"\xa3\x95\x09" + row
    (tmp_path / "a.bin").write_bytes(dataflash_bytes(()) + body)
    topics, notes = read_dataflash_topics(str(tmp_path / "a.bin"))
    assert notes == []
    assert [one.label for one in topics] == ["BARO", "BARO_1"]
    np.testing.assert_allclose(topics[1].fields["Alt"], 2.5 + 0.01 * np.arange(10))
    assert {name: values[0] for name, values in topics[0].fields.items() if name in "xyz"} == {
        "x": 1.5,
        "y": 7,
        "z": 0.5,
    }
    log = read_log(tmp_path / "a.bin", channel_map={"gear": "BARO.y"})
    assert set(log.channels["gear"].values) == {7.0}
    assert [log.channels[name].source for name in ("baro_altitude", "baro_altitude_2")] == ["BARO.Alt", "BARO_1.Alt"]
    np.testing.assert_allclose(log.channels["baro_altitude_2"].values - log.channels["altitude"].values, 2.5)


# AP_Logger's LogStructure.h: what C type a letter stands for, and how many of its units are one of the field's.
NUMBERS = {
    "b": ("b", 1.0),
    "B": ("B", 1.0),
    "M": ("B", 1.0),
    "h": ("h", 1.0),
    "H": ("H", 1.0),
    "i": ("i", 1.0),
    "I": ("I", 1.0),
    "q": ("q", 1.0),
    "Q": ("Q", 1.0),
    "g": ("e", 1.0),
    "f": ("f", 1.0),
    "d": ("d", 1.0),
    "c": ("h", 100.0),
    "C": ("H", 100.0),
    "e": ("i", 100.0),
    "E": ("I", 100.0),
    "L": ("i", 1e7),
}


@pytest.mark.parametrize("letter", NUMBERS)
def test_a_letter_is_the_number_that_was_written(letter: str, tmp_path: Path):
    """Of numbers beside the largest and the least of its type, whose bytes differ."""
    code, per_unit = NUMBERS[letter]
    n_bits = 8 * struct.calcsize("<" + code)
    if code in "efd":
        ends = (-1.5, 100.25)
    elif code.islower():
        ends = (1 - 2 ** (n_bits - 1), 2 ** (n_bits - 1) - 2)
    else:
        ends = (1, 2**n_bits - 2)
    rows = [struct.pack("<Q" + code, 100_000 * k, end) for k, end in enumerate(ends)]
    body = b"".join(b"\xa3\x95\x09" + row for row in rows)
    length = 3 + 8 + n_bits // 8
    head = struct.pack("<BB4s16s64s", 9, length, b"BARO", b"Q" + letter.encode(), b"TimeUS,Alt")
    (tmp_path / "a.bin").write_bytes(dataflash_bytes(()) + b"\xa3\x95\x80" + head + body)
    ((topic,), notes) = read_dataflash_topics(str(tmp_path / "a.bin"))
    assert notes == []
    np.testing.assert_allclose(topic.fields["Alt"], np.array(ends, dtype=float) / per_unit, rtol=1e-12)


def test_damage_is_skipped_and_said(log_file: Path):
    whole = bytearray(log_file.read_bytes())
    whole[len(whole) // 2 : len(whole) // 2 + 50] = b"\xa3\x95\x01" * 16 + b"\x00\x00"
    log_file.write_bytes(whole)
    log = read_log(log_file)
    assert any("bytes are damaged or cut off and were skipped" in note for note in texts(log.notes))
    good = np.isfinite(log.channels["ias"].values)
    np.testing.assert_allclose(log.channels["ias"].values[good], [airspeed(t) for t in log.time_s[good]], atol=0.02)


def test_a_log_without_channels_is_refused(tmp_path: Path):
    (tmp_path / "a.bin").write_bytes(dataflash_bytes(("MODE",)))
    with pytest.raises(LogError, match="no channels in its messages"):
        read_log(tmp_path / "a.bin")


@given(data=st.data())
def test_a_damaged_dataflash_log_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "damaged.bin"
    whole = bytearray(dataflash_bytes(("ARSP", "MODE")))
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    try:
        log = read_log(path)
    except LogError:
        return
    assert log.n_samples >= 2


@pytest.mark.realdata
def test_a_recorded_log(flights: Path):
    """Counts, rates and ranges as pymavlink has them; the log has no airspeed."""
    log = read_log(flights / "reader_samples" / "pilot_0004.bin")
    topics, _ = read_dataflash_topics(str(flights / "reader_samples" / "pilot_0004.bin"))
    assert {one.label: one.time_s.size for one in topics} == {"ATT": 2375, "GPS": 461, "XKF1": 2355, "XKF2": 2354}
    assert log.rate_hz == pytest.approx(25.0, rel=0.01)
    assert log.channels["pitch"].own_rate_hz == pytest.approx(25.0, rel=0.01)
    assert -0.39 < log.channels["pitch"].values.min() < -0.3
