"""ArduPilot DataFlash logs (.bin): messages whose formats are described in the file itself, by FMT messages.

The layout is that of ArduPilot's AP_Logger (LogStructure.h): two bytes that begin a message, its type, its values. A
message is valid if the next message begins right after it; the bytes between valid messages are counted as damaged.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..notes import Note
from .axis import boot_starts
from .messages import Places, require_tables, table_of
from .topics import Topic, fields_of, notes_on

BEGIN = b"\xa3\x95"
FMT, FMT_LENGTH = 0x80, 89  # type and bytes of the message that describes a format
# Numpy type and scale of numbers by their format letter, and the bytes of fields that are no numbers.
_PLAIN = "b:<i1 B:<u1 M:<u1 h:<i2 H:<u2 i:<i4 I:<u4 q:<i8 Q:<u8 g:<f2 f:<f4 d:<f8"
NUMBERS = {
    **{letter: (kind, 1.0) for letter, _, kind in (entry.partition(":") for entry in _PLAIN.split())},
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
}
OTHERS = {"a": 64, "n": 4, "N": 16, "Z": 64}
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
# Fields that state which of several sensors, or which core of the estimator, sent a message.
INSTANCES = ("I", "Instance", "C")


@dataclass(frozen=True, slots=True)
class _Format:
    """A kind of message: its name, its length in bytes, and format letter and offset of its numbers by field name."""

    name: str
    length: int
    fields: Mapping[str, tuple[str, int]]


def read_dataflash_parameters(path: str) -> dict[str, float]:
    """Return the parameters of a DataFlash log by name, each as it was last."""
    parameters = {}
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        formats, messages, _ = _messages(data, {"PARM"})
        for kind, places in messages.items():
            letter, at = formats[kind].fields.get("Value", ("", 0))
            if letter != "f":
                continue
            for start in places.starts:
                # The name stands before the value.
                name = data[start + at - OTHERS["N"] : start + at].split(b"\0")[0].decode("latin-1")
                parameters[name] = float(struct.unpack_from("<f", data, start + at)[0])
    return parameters


def read_dataflash_topics(path: str, more: Collection[str] = ()) -> tuple[list[Topic], list[Note]]:
    """Return the messages of a DataFlash log that have channels, or are named in `more`, and notes on the file.

    Raises
    ------
    LogError : memory does not hold the messages.
    """
    names = {*fields_of("ardupilot"), *more}
    topics: list[Topic] = []
    starts: list[NDArray[np.intp]] = []
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        formats, messages, damaged = _messages(data, names)
        require_tables(path, ((len(places.starts), len(formats[kind].fields)) for kind, places in messages.items()))
        for kind, places in messages.items():
            for topic, begins in _topics(data, formats[kind], places):
                topics.append(topic)
                starts.append(begins)
    # Where in the file the first message of each boot begins.
    at = np.concatenate([np.zeros(0, dtype=np.intp), *starts])
    order = np.argsort(at)
    time_s = np.concatenate([np.zeros(0), *(topic.time_s for topic in topics)])[order]
    first = at[order][boot_starts(time_s)] if at.size else at
    if len(first) > 1:
        numbers = (np.searchsorted(first, at, side="right") - 1 for at in starts)
        topics = [replace(topic, boot=number) for topic, number in zip(topics, numbers, strict=True)]
    return topics, notes_on(damaged)


def _topics(data: mmap.mmap, form: _Format, places: Places) -> list[tuple[Topic, NDArray[np.intp]]]:
    """Return the messages of a kind as a topic for each of its senders, and where in the file each message begins."""
    clock = next((name for name in CLOCKS if name in form.fields), None)
    if clock is None or not places.starts:
        return []
    types = {name: (NUMBERS[letter][0], at) for name, (letter, at) in form.fields.items()}
    table = table_of(data, places, types, form.length)
    fields = {
        name: NUMBERS[letter][1] * table[name].astype(np.float64)
        for name, (letter, _) in form.fields.items()
        if name not in CLOCKS
    }
    time_s = CLOCKS[clock] * table[clock].astype(np.float64)
    every = Topic(name=form.name, instance=0, time_s=time_s, fields=fields)
    at = np.asarray(places.starts).astype(np.intp)
    sender = next((name for name in INSTANCES if form.fields.get(name, ("", 0))[0] == "B"), None)
    if sender is None:
        return [(every, at)]
    sent = ((which, table[sender] == which) for which in np.unique(table[sender]))
    return [(replace(every.part(of), instance=int(which)), at[of]) for which, of in sent]


def _messages(data: mmap.mmap, names: set[str]) -> tuple[dict[int, _Format], dict[int, Places], int]:
    """Return formats by message type, places of the messages in `names`, and the number of damaged bytes."""
    lengths, formats, messages = {FMT: FMT_LENGTH}, dict[int, _Format](), dict[int, Places]()
    at, end, damaged = 0, len(data), 0
    while at < end:
        length = lengths.get(data[at + 2]) if at + 2 < end and data[at : at + 2] == BEGIN else None
        stop = at + (length or 0)
        if length is None or stop > end or (stop + 2 <= end and data[stop : stop + 2] != BEGIN):
            following = data.find(BEGIN, at + 1)
            stop = end if following < 0 else following
            damaged += stop - at
        elif (kind := data[at + 2]) == FMT:
            described, message_format = data[at + 3], _format(data[at:stop])
            if message_format is not None and described not in lengths:
                lengths[described], formats[described] = message_format.length, message_format
                if message_format.name in names:
                    messages[described] = Places()
        elif kind in messages:
            messages[kind].add(at, length)
        at = stop
    return formats, messages, damaged


def _format(message: bytes) -> _Format | None:
    """Return the format that a FMT message describes, None where it contradicts itself."""
    texts = struct.unpack_from("4s16s64s", message, 5)
    name, letters, labels = (text.split(b"\0")[0].decode("latin-1") for text in texts)
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
    return _Format(name, message[4], fields) if at == message[4] else None
