"""MCAP logs of robots and ground stations: the numbers of JSON messages are the channels, each topic has its clock.

The package mcap parses the records (extra `mcap`). We walk from record to record ourselves, each a code, a length and a
body ("MCAP Format Specification"), because the package unpacks a chunk to whatever its compressed data make: what the
chunks state is checked before the first is unpacked, and none is unpacked to more than it states. Times are those at
which messages were logged, not published.
"""

from __future__ import annotations

import json
import math
import os
import struct
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import Any, BinaryIO

import numpy as np

from ..epoch import DAY_S, Epoch
from ..errors import LogError
from ..files import MCAP
from ..quantities.channels import match_name, si_unit, split_unit
from .raw import (
    LARGEST_CHUNK,
    FloatArray,
    RawLog,
    ReadRequest,
    choose_group,
    parsing,
    require_few,
    require_memory,
    require_size,
    time_column,
)
from .record import Track

# Limit of a message, bytes: those of a flight log have some hundred, images a million.
LARGEST_MESSAGE = 10**6
# Limit of nested objects, whose names are joined by dots.
DEEPEST = 4
# Codes of records.
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 2, 3, 4, 5, 6
HEAD = struct.Struct("<BQ")  # code and length of the body
CHUNK_HEAD = struct.Struct("<QQQII")  # first and last time, size unpacked, check sum, letters of the compression
# Most bytes from one packed byte: an LZ4 length byte adds 255, a Zstandard block of four bytes repeats one byte 2^17
# times (RFC 8878, 3.1.1.2).
MOST_PACKED = {"": 1, "lz4": 255, "zstd": 2**15}


@dataclass(frozen=True, slots=True)
class _Messages:
    """The messages of a topic: times, s, and by the name of a number, which messages have it, and its values."""

    times: array[float] = field(default_factory=lambda: array("d"))
    fields: dict[str, tuple[array[int], array[float]]] = field(default_factory=dict)

    @property
    def n_values(self) -> int:
        """Number of values with those that are missing."""
        return len(self.times) * len(self.fields)

    def add(self, time_s: float, numbers: Mapping[str, float]) -> None:
        """Append a message."""
        for name, value in numbers.items():
            rows, values = self.fields.setdefault(name, (array("Q"), array("d")))
            rows.append(len(self.times))
            values.append(value)
        self.times.append(time_s)

    def column(self, name: str) -> FloatArray:
        """Return (n_messages,) the values of a number, NaN where a message lacks it."""
        rows, values = self.fields[name]
        column: FloatArray = np.full(len(self.times), np.nan)
        column[np.asarray(rows, dtype=np.intp)] = values
        return column


def read_mcap(path: str, asked: ReadRequest) -> RawLog:
    """Read the numbers in the JSON messages of all topics, or of the topic that `asked.group` names.

    Raises
    ------
    LogError : the package mcap is not installed; damaged, no such topic, no numbers, more than memory holds.
    """
    topics, left_out, units = _topics(path)
    signals = {name: topic for name, topic in topics.items() if topic.fields}
    if asked.group is not None or not signals:
        chosen = choose_group(path, asked.group and asked.group.strip("/"), list(signals), has_signals=False)
        signals = {name: topic for name, topic in signals.items() if name == chosen}
    first_s = min(min(topic.times) for topic in signals.values())
    zero_s = DAY_S * math.floor(first_s / DAY_S)
    epoch = Epoch(since_1970_s=zero_s, is_utc=True) if zero_s else None
    names = [number for topic in signals.values() for number in topic.fields]
    columns = []
    for name, topic in signals.items():
        order = np.argsort(topic.times, kind="stable")
        time_s = np.asarray(topic.times)[order] - zero_s
        for number in topic.fields:
            source, unit = split_unit(number if names.count(number) == 1 else f"{name}/{number}")
            values = topic.column(number)[order]
            column = Track(source=source, values=values, unit=unit or units.get(f"{name}/{number}"))
            if len(signals) == 1:
                columns.append(column)
            elif (match := match_name(source)) is None or match.name != "time":
                columns.append(replace(column, time_s=time_s, epoch=epoch))
    if len(signals) == 1 and time_column(columns, asked) is None:
        columns.insert(0, Track(source="time", values=time_s, unit="s", channel="time", epoch=epoch))
    return RawLog(columns=columns, left_out=left_out)


def _topics(path: str) -> tuple[dict[str, _Messages], dict[str, str], dict[str, str]]:
    """Return the messages by topic, by name why a topic is left out, and the stated units by topic and number."""
    try:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Message, Schema
    except ImportError:
        raise LogError(f"{path}: an MCAP file, and mcap is not installed; pip install 'bfi-cli[mcap]'") from None
    schemas: dict[int, bytes] = {}
    channels: dict[int, Channel] = {}
    topics: dict[str, _Messages] = {}
    left_out: dict[str, str] = {}
    units: dict[str, str] = {}
    n_fields = n_values = 0
    with parsing(path, "MCAP file"), open(path, "rb") as file:
        require_size(path, _stated_size(path, file), "export fewer topics")
        for code, body in _records(path, file):
            stream = ReadDataStream(BytesIO(body))
            if code == SCHEMA:
                schema = Schema.read(stream)
                schemas[schema.id] = schema.data
            elif code == CHANNEL:
                channel = Channel.read(stream)
                channels[channel.id] = channel
            elif code == MESSAGE:
                message = Message.read(stream, len(body))
                if (sender := channels.get(message.channel_id)) is None:
                    raise ValueError(f"a message of channel {message.channel_id}, which no record describes")
                name = sender.topic.strip("/")
                numbers = _numbers(sender.message_encoding, message.data)
                if numbers is None:
                    left_out[name] = f"has messages of '{sender.message_encoding}', not of JSON numbers,"
                    continue
                if name not in topics:
                    stated = _units(schemas.get(sender.schema_id, b""))
                    units |= {f"{name}/{field}": unit for field, unit in stated}
                topic = topics.setdefault(name, _Messages())
                n_fields, n_values = n_fields - len(topic.fields), n_values - topic.n_values
                topic.add(1e-9 * message.log_time, numbers)
                n_fields, n_values = n_fields + len(topic.fields), n_values + topic.n_values
                require_few(path, n_fields, "fields")
                require_memory(path, 8 * n_values, "its messages", "export fewer topics")
    return topics, left_out, units


def _stated_size(path: str, file: BinaryIO) -> int:
    """Return the bytes of the messages of a file as its records state them, chunks unpacked; nothing is unpacked.

    Raises
    ------
    LogError : a chunk is larger than `LARGEST_CHUNK`, or states more than its packed bytes can hold.
    """
    total = 0
    for code, length in _heads(file):
        if code == MESSAGE:
            total += length
        elif code == CHUNK:
            size, compression, packed = _chunk_head(file, length)
            if max(size, packed) > LARGEST_CHUNK:
                raise LogError(
                    f"{path}: a chunk of {max(size, packed) / 1e9:.2g} GB, the limit is {LARGEST_CHUNK / 1e9:.2g} GB; "
                    "export it again in smaller ones (mcap filter does)"
                )
            if size > MOST_PACKED[compression] * packed:
                raise LogError(
                    f"{path}: a chunk claims {size} bytes, more than its {packed} bytes of '{compression}' in the file "
                    "can hold; export it again"
                )
            total += size
    return total


def _records(path: str, file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Yield code and body of every schema, channel and message, also of those within chunks.

    A body is cut behind the largest message that is read. Raises `ValueError` for chunks that do not hold what they
    state.
    """
    longest = LARGEST_MESSAGE + 1000
    for code, length in _heads(file):
        if code in (SCHEMA, CHANNEL, MESSAGE):
            yield code, file.read(min(length, longest))
        elif code == CHUNK:
            size, compression, packed = _chunk_head(file, length)
            data = memoryview(_unpacked(compression, file.read(packed), size))
            at = 0
            while at < size:
                code, length = HEAD.unpack_from(data, at)
                at += HEAD.size + length
                if at > size:
                    raise ValueError("a record of a chunk is longer than the chunk")
                if code in (SCHEMA, CHANNEL, MESSAGE):
                    yield code, bytes(data[at - length : at][:longest])


def _heads(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Yield code and length of the body of every record up to the footer; the file stands at the body meanwhile.

    Raises `ValueError` for what is no record, or one that is cut off.
    """
    at, end = len(MCAP), os.fstat(file.fileno()).st_size
    code = 0
    while code != FOOTER:
        file.seek(at)
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            raise ValueError("it ends without a footer")
        code, length = HEAD.unpack(head)
        at += HEAD.size + length
        if code == 0 or at > end:
            raise ValueError("no record begins with a zero" if code == 0 else "a record is cut off")
        yield code, length


def _chunk_head(file: BinaryIO, length: int) -> tuple[int, str, int]:
    """Return of the chunk at which the file stands its size unpacked, its compression and its size in the file."""
    head = file.read(CHUNK_HEAD.size)
    _, _, size, _, letters = CHUNK_HEAD.unpack(head)
    compression = file.read(min(letters, 8)).decode("latin-1")
    packed = int.from_bytes(file.read(8), "little")
    if compression not in MOST_PACKED:
        raise ValueError(f"a chunk of an unknown compression, '{compression}'")
    if CHUNK_HEAD.size + letters + 8 + packed > length:
        raise ValueError("a chunk is longer than its record")
    return size, compression, packed


def _unpacked(compression: str, data: bytes, size: int) -> bytes:
    """Return the content of a chunk; no more than its stated size and a byte is unpacked."""
    if compression == "zstd":
        import zstandard

        whole = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True).read(size + 1)
    elif compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        whole = LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    else:
        whole = data
    if len(whole) != size:
        raise ValueError(f"a chunk states {size} bytes and holds {'more' if len(whole) > size else len(whole)}")
    return whole


def _units(schema: bytes) -> Iterator[tuple[str, str]]:
    """Yield the fields of a JSON schema that state a unit, as `unit`, `units` or the whole of their description."""
    try:
        properties = json.loads(schema or b"{}").get("properties", {})
        stated = [
            (name, [field.get(key) for key in ("unit", "units", "description")]) for name, field in properties.items()
        ]
    except (ValueError, RecursionError, AttributeError):
        return
    for name, texts in stated:
        unit = next((text for text in texts if isinstance(text, str) and si_unit(text) is not None), None)
        if unit is not None:
            yield name, unit


def _numbers(encoding: str, data: bytes) -> dict[str, float] | None:
    """Return the numbers of a message by their names, None where it is no JSON object."""
    if encoding != "json" or len(data) > LARGEST_MESSAGE:
        return None
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return dict(_opened("", message, 0)) if isinstance(message, dict) else None


def _opened(prefix: str, message: Mapping[str, Any], depth: int) -> Iterator[tuple[str, float]]:
    for name, value in message.items():
        if isinstance(value, bool | int | float):
            yield f"{prefix}{name}", float(value) if abs(value) < 1e300 else math.nan
        elif isinstance(value, dict) and depth < DEEPEST:
            yield from _opened(f"{prefix}{name}.", value, depth + 1)
