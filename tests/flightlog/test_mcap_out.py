"""Logs as MCAP, for Foxglove and PlotJuggler: the bytes as of the specification, and by its own reader."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.errors import ConfigError
from bfi_cli.files import is_ours
from bfi_cli.flightlog import Channel, FlightLog, write_log
from bfi_cli.flightlog.record import frozen_array

T = np.array([0.0, 0.5, 1.25])
TAS = np.array([100.0, np.nan, 102.5])
HOSTILE = 'a"b\x1b\\'


def log_of(time_s: np.ndarray = T) -> FlightLog:
    channels = {
        name: Channel(name=name, values=frozen_array(values), unit=unit, source=name)
        for name, values, unit in (("tas", TAS, "m/s"), (HOSTILE, T, "rad"))
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels)


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record between the two magics."""
    magic = b"\x89MCAP0\r\n"
    assert data.startswith(magic)
    assert data.endswith(magic)
    at = len(magic)
    while at < len(data) - len(magic):
        kind, length = struct.unpack_from("<BQ", data, at)
        yield kind, data[at + 9 : at + 9 + length]
        at += 9 + length


def test_a_record_for_each_sample_and_nothing_for_a_missing_value(tmp_path: Path) -> None:
    write_log(log_of(), tmp_path / "log.mcap")
    found = list(records((tmp_path / "log.mcap").read_bytes()))
    assert [kind for kind, _ in found] == [1, 3, 4, 5, 5, 5, 15, 2]
    messages = [content for kind, content in found if kind == 5]
    assert [struct.unpack_from("<HIQQ", one)[1:] for one in messages] == [
        (0, 0, 0),
        (1, 500_000_000, 500_000_000),
        (2, 1_250_000_000, 1_250_000_000),
    ]
    rows = [json.loads(one[22:]) for one in messages]
    shown = 'a"b\\x1b\\'
    assert rows == [{"tas": 100.0, shown: 0.0}, {shown: 0.5}, {"tas": 102.5, shown: 1.25}]


def test_a_file_of_ours_is_known_and_another_is_not(tmp_path: Path) -> None:
    ours, other = tmp_path / "ours.mcap", tmp_path / "other.mcap"
    write_log(log_of(), ours)
    other.write_bytes(ours.read_bytes().replace(b"\x03\x00\x00\x00bfi", b"\x03\x00\x00\x00abc"))
    assert (is_ours(ours), is_ours(other)) == (True, False)


def test_times_before_zero_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="begins at -1 s, MCAP has no time below 0; give --from 0"):
        write_log(log_of(T - 1.0), tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_the_reader_of_the_format_reads_it(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    write_log(log_of(), tmp_path / "log.mcap")
    with (tmp_path / "log.mcap").open("rb") as file:
        found = list(reader.NonSeekingReader(file).iter_messages())
    schema, channel, message = found[0]
    assert (channel.topic, channel.message_encoding, schema.encoding) == ("/log", "json", "jsonschema")
    assert json.loads(schema.data)["properties"]["tas"] == {"type": "number", "description": "m/s"}
    assert [one.log_time for _, _, one in found] == [0, 500_000_000, 1_250_000_000]
    assert json.loads(message.data)["tas"] == 100.0
