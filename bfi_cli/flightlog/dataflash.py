"""ArduPilot DataFlash logs (.bin): messages whose formats stand in the file itself, in FMT messages.

The layout is that of ArduPilot's AP_Logger (LogStructure.h): two bytes that begin a message, its type, its values. A
message is taken where the next one begins right after it; what is between is damaged, is skipped and counted.
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .rates import boot_starts, log_of_topics
from .raw import RawLog
from .topics import Topic, fields_of, with_ground_velocity

BEGIN = b"\xa3\x95"
FMT, FMT_LENGTH = 0x80, 89  # type and bytes of the message that describes a format
# Type and scale of the numbers by their letter, and the bytes of what is no number.
NUMBERS = {
    "b": ("<i1", 1.0),
    "B": ("<u1", 1.0),
    "M": ("<u1", 1.0),
    "h": ("<i2", 1.0),
    "H": ("<u2", 1.0),
    "i": ("<i4", 1.0),
    "I": ("<u4", 1.0),
    "q": ("<i8", 1.0),
    "Q": ("<u8", 1.0),
    "g": ("<f2", 1.0),
    "f": ("<f4", 1.0),
    "d": ("<f8", 1.0),
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
}
OTHERS = {"a": 64, "n": 4, "N": 16, "Z": 64}
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
# Fields that say which of several sensors, or which core of the filter, sent a message.
INSTANCES = ("I", "Instance", "C")


@dataclass(frozen=True, slots=True)
class _Format:
    """A kind of message: its name, bytes, and letter and offset of its numbers by their names."""

    name: str
    length: int
    fields: Mapping[str, tuple[str, int]]


def read_dataflash(path: str, *, channel_map: Mapping[str, str], unit_map: Mapping[str, str]) -> RawLog:
    """Read a DataFlash log; a field that is no channel by itself is named `message.field` in the maps.

    Raises
    ------
    LogError : no messages that are channels.
    """
    wanted = (*channel_map.values(), *unit_map)
    topics, notes = read_dataflash_topics(path, [re.sub(r"_\d+$", "", one.partition(".")[0]) for one in wanted])
    velocities = [with_ground_velocity(one) for one in topics]
    return log_of_topics(path, "ardupilot", velocities, channel_map, more=wanted, notes=notes)


def read_dataflash_topics(path: str, more: Sequence[str] = ()) -> tuple[list[Topic], list[str]]:
    """Return the messages of a DataFlash log that have channels, or are named in `more`, and sentences on the file."""
    names = {*fields_of("ardupilot"), *more}
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        formats, messages, places, damaged = _messages(data, names)
    topics: list[Topic] = []
    tables = {kind: _table(formats[kind], bodies) for kind, bodies in messages.items() if bodies}
    times = {kind: one for kind, table in tables.items() if (one := _times(formats[kind], table)) is not None}
    first = _boots(times, places)
    for kind, time_s in times.items():
        boot = None if len(first) == 1 else np.searchsorted(first, places[kind], side="right") - 1
        topics += _topics(formats[kind], tables[kind], time_s, boot)
    return topics, [f"{damaged} bytes are damaged or cut off and were skipped"] if damaged else []


def _messages(
    data: mmap.mmap, names: set[str]
) -> tuple[dict[int, _Format], dict[int, list[bytes]], dict[int, list[int]], int]:
    """Return the formats, the messages of the named ones and their places by type, and how many bytes are damaged."""
    lengths, formats = {FMT: FMT_LENGTH}, dict[int, _Format]()
    messages: dict[int, list[bytes]] = {}
    places: dict[int, list[int]] = {}
    at, end, damaged = 0, len(data), 0
    while at < end:
        length = lengths.get(data[at + 2]) if at + 2 < end and data[at : at + 2] == BEGIN else None
        stop = at + (length or 0)
        if length is None or stop > end or (stop + 2 <= end and data[stop : stop + 2] != BEGIN):
            following = data.find(BEGIN, at + 1)
            stop = end if following < 0 else following
            damaged += stop - at
        elif (kind := data[at + 2]) == FMT:
            one = _format(data[at:stop])
            if one is not None and one[0] not in lengths:
                lengths[one[0]], formats[one[0]] = one[1].length, one[1]
                if one[1].name in names:
                    messages[one[0]], places[one[0]] = [], []
        elif kind in messages:
            messages[kind].append(data[at:stop])
            places[kind].append(at)
        at = stop
    return formats, messages, places, damaged


def _format(message: bytes) -> tuple[int, _Format] | None:
    """Return type and format that a FMT message describes, None where it contradicts itself."""
    kind, length = message[3], message[4]
    name, letters, labels = (
        one.split(b"\0")[0].decode("latin-1") for one in struct.unpack_from("4s16s64s", message, 5)
    )
    columns = labels.split(",")
    at, fields = 3, {}
    if len(columns) != len(letters) or len(set(columns)) != len(columns):
        return None
    for letter, column in zip(letters, columns, strict=True):
        if letter in NUMBERS:
            fields[column] = (letter, at)
            at += int(NUMBERS[letter][0][2:])
        elif letter in OTHERS:
            at += OTHERS[letter]
        else:
            return None
    return (kind, _Format(name, length, fields)) if at == length else None


def _table(one: _Format, bodies: Sequence[bytes]) -> NDArray[np.void]:
    """Return the messages of a format as a table of their numbers."""
    kind = np.dtype(
        {
            "names": list(one.fields),
            "formats": [NUMBERS[letter][0] for letter, _ in one.fields.values()],
            "offsets": [at for _, at in one.fields.values()],
            "itemsize": one.length,
        }
    )
    return np.frombuffer(b"".join(bodies), dtype=kind)


def _times(one: _Format, table: NDArray[np.void]) -> NDArray[np.float64] | None:
    clock = next((name for name in CLOCKS if name in one.fields), None)
    return None if clock is None else CLOCKS[clock] * table[clock].astype(np.float64)


def _boots(times: Mapping[int, NDArray[np.float64]], places: Mapping[int, Sequence[int]]) -> NDArray[np.intp]:
    """Return the place in the file of the first message of each boot."""
    at = np.concatenate([np.zeros(0, dtype=np.intp), *(np.array(places[kind], dtype=np.intp) for kind in times)])
    order = np.argsort(at)
    time_s = np.concatenate([np.zeros(0), *times.values()])[order]
    return np.asarray(at[order][boot_starts(time_s)]) if at.size else np.zeros(1, dtype=np.intp)


def _topics(
    one: _Format, table: NDArray[np.void], time_s: NDArray[np.float64], boot: NDArray[np.intp] | None
) -> list[Topic]:
    """Return the messages of a format by the sensor that sent them."""
    fields = {
        name: NUMBERS[letter][1] * table[name].astype(np.float64)
        for name, (letter, _) in one.fields.items()
        if name not in CLOCKS
    }
    sender = next((name for name in INSTANCES if one.fields.get(name, ("", 0))[0] == "B"), None)
    if sender is None:
        return [Topic(name=one.name, instance=0, time_s=time_s, fields=fields, boot=boot)]
    return [
        Topic(
            name=one.name,
            instance=int(which),
            time_s=time_s[table[sender] == which],
            fields={name: values[table[sender] == which] for name, values in fields.items()},
            boot=None if boot is None else boot[table[sender] == which],
        )
        for which in np.unique(table[sender])
    ]
