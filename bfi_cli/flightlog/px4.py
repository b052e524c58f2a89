"""PX4 logs: ULog, whose message formats are described in the file itself, and the CSV files of `ulog2csv`.

The layout of a ULog is that of the PX4 User Guide, "ULog File Format": a header, then messages of a size, a type and a
body. We read it ourselves, because a stranger's file may claim anything: sizes are checked before memory is taken, and
after damage reading goes on at the next synchronisation message.

`ulog2csv` writes a file per topic, LOG_TOPIC_INSTANCE.csv. Its first column, `timestamp`, identifies such a file; only
the file's name tells the topic, since two topics can have the same columns. Times are microseconds since the autopilot
started.
"""

from __future__ import annotations

import itertools
import mmap
import re
import struct
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import LogError
from ..notes import Note
from .formats import topic_files
from .messages import Places, require_tables, table_of
from .raw import RawLog, ReadRequest, choose_group, require_few
from .text import read_csv
from .topics import Topic, fields_of, log_of_topics, notes_on, topics_of

HEADER = 16  # bytes: the magic, a version, the time of the start
SYNC = b"\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_SIZED = "int8:<i1 uint8:<u1 int16:<i2 uint16:<u2 int32:<i4 uint32:<u4 int64:<i8 uint64:<u8"
TYPES = {f"{name}_t": kind for name, _, kind in (entry.partition(":") for entry in _SIZED.split())}
TYPES |= {"bool": "<u1", "char": "<u1", "float": "<f4", "double": "<f8"}
# "float[3] xyz": type, count where it is an array, and name.
FIELD = re.compile(r"\s*(\w+)(?:\[(\d{1,5})\])? (\w+)\s*", re.ASCII)
KNOWN = frozenset(b"BFIMPQARDLCSO")
DATA, FORMAT, ADDED, FLAGS, DROPOUT, PARAMETER = b"DFABOP"
LONGEST = 0xFFFF  # bytes of a message
DEEPEST = 8  # formats inside each other; PX4 nests one
APPENDED = 1  # the only incompatible flag that is known: data after the end, at the offsets of the flags
MICROSECOND = 1e-6  # of the time stamps


@dataclass(frozen=True, slots=True)
class _Layout:
    """Numpy type and offset of each number of a topic by its name, and the fewest and most bytes of a message."""

    fields: dict[str, tuple[str, int]]
    least: int
    most: int


@dataclass(slots=True)
class _Stream:
    """What was read of a file so far.

    Attributes
    ----------
    formats : by the name of the format, type, count (0 for no array) and name of each field.
    topics, layouts, messages : by the number of a topic, its name and instance, its layout, where its messages are.
    dropouts, dropped_ms, damaged : number and duration of dropouts that the log states, and of damaged bytes.
    parameters : of the autopilot by name, as they were last.
    """

    formats: dict[str, list[tuple[str, int, str]]] = field(default_factory=dict)
    topics: dict[int, tuple[str, int]] = field(default_factory=dict)
    layouts: dict[int, _Layout | None] = field(default_factory=dict)
    messages: dict[int, Places] = field(default_factory=dict)
    dropouts: int = 0
    dropped_ms: int = 0
    damaged: int = 0
    parameters: dict[str, float] = field(default_factory=dict)


def read_ulog_parameters(path: str) -> dict[str, float]:
    """Return the parameters of a ULog by name, each as it was last.

    Raises
    ------
    LogError : its flags are those of a later kind of ULog.
    """
    stream = _Stream()
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for begin, end in _parts(path, data):
            _read_messages(data, begin, end, stream, set())
    return stream.parameters


def read_ulog_topics(path: str, more: Collection[str] = ()) -> tuple[list[Topic], list[Note]]:
    """Return the topics of a ULog that have channels, or that are named in `more`, and notes on the file.

    Raises
    ------
    LogError : the header is cut off, its flags are those of a later kind of ULog, or memory does not hold its messages.
    """
    names, stream = {*fields_of("px4"), *more}, _Stream()
    with open(path, "rb") as file:
        if len(file.read(HEADER)) < HEADER:
            raise LogError(f"{path}: damaged or truncated ULog, its header is cut off; copy it from the vehicle again")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            for begin, end in _parts(path, data):
                _read_messages(data, begin, end, stream, names)
            require_few(path, len(stream.topics), "topics")
            topics, empty = _tables(path, data, stream)
    lost = Note.limit(f"the autopilot lost data {stream.dropouts} times, {stream.dropped_ms / 1000:.3g} s in all")
    return topics, [lost] * bool(stream.dropouts) + notes_on(stream.damaged, empty)


def _tables(path: str, data: mmap.mmap, stream: _Stream) -> tuple[list[Topic], list[str]]:
    """Return the topics with messages, and the names of those without."""
    read = [
        (number, layout, places)
        for number, places in stream.messages.items()
        if (layout := stream.layouts[number]) is not None
    ]
    require_tables(path, ((len(places.starts), len(layout.fields)) for _, layout, places in read))
    topics, empty = [], []
    for number, layout, places in read:
        name, instance = stream.topics[number]
        if not places.starts:
            empty.append(name)
            continue
        table = table_of(data, places, layout.fields, layout.most)
        time_s = MICROSECOND * table["timestamp"].astype(np.float64)
        fields = {field: table[field] for field in layout.fields if field != "timestamp"}
        topics.append(Topic(name=name, instance=instance, time_s=time_s, fields=fields))
    return topics, empty


def _parts(path: str, data: mmap.mmap) -> list[tuple[int, int]]:
    """Return where each part with messages begins and ends: the whole file, or its original and its appended parts."""
    size, kind = struct.unpack_from("<HB", data, HEADER) if len(data) >= HEADER + 3 else (0, 0)
    if kind != FLAGS or size < 40 or len(data) < HEADER + 3 + 40:
        return [(HEADER, len(data))]
    unknown = [flag for i, flag in enumerate(data[HEADER + 11 : HEADER + 19]) if flag & ~(APPENDED if i == 0 else 0)]
    if unknown:
        raise LogError(f"{path}: a ULog of a later kind (unknown flags {unknown}); convert it to CSV with ulog2csv")
    offsets = [offset for offset in struct.unpack_from("<3Q", data, HEADER + 19) if HEADER < offset < len(data)]
    bounds = [HEADER, *sorted(set(offsets)), len(data)]
    return list(itertools.pairwise(bounds))


def _read_messages(data: mmap.mmap, begin: int, end: int, stream: _Stream, names: set[str]) -> None:
    """Read messages from `begin` to `end`; of topics that are not named only the format is kept."""
    at, head = begin, struct.Struct("<HB")
    while at + 3 <= end:
        size, kind = head.unpack_from(data, at)
        stop = at + 3 + size
        if stop > end or kind not in KNOWN or not _read_one(data, at + 3, size, kind, stream, names):
            following = data.find(SYNC, at + 1, end)
            stop = end if following < 0 else following
            stream.damaged += stop - at
        at = stop
    stream.damaged += end - at


def _read_one(data: mmap.mmap, at: int, size: int, kind: int, stream: _Stream, names: set[str]) -> bool:
    """Read the body of a message; return whether it is sound."""
    if kind == DATA:
        if size < 2:
            return False
        number = data[at] + 256 * data[at + 1]
        layout = stream.layouts.get(number)
        if layout is None:
            return number in stream.topics  # of a format that is not known, or of no topic at all
        if not layout.least <= size - 2 <= layout.most:
            return False
        if number in stream.messages:
            stream.messages[number].add(at + 2, size - 2)
        return True
    if kind == FORMAT:
        name, colon, text = data[at : at + size].decode("latin-1").partition(":")
        fields = [FIELD.fullmatch(field) for field in text.split(";") if field.strip()]
        if not colon or None in fields:
            return False
        stream.formats[name] = [(field[1], int(field[2] or 0), field[3]) for field in fields if field is not None]
    elif kind == ADDED:
        if size < 4:
            return False
        instance, number = struct.unpack_from("<BH", data, at)
        name = data[at + 3 : at + size].decode("latin-1").rstrip("\0")
        layout = _layout(name, stream.formats)
        if number in stream.topics and stream.topics[number] != (name, instance):
            return False
        stream.topics[number], stream.layouts[number] = (name, instance), layout
        if name in names and layout is not None:
            stream.messages.setdefault(number, Places())
    elif kind == PARAMETER and size > 5 and size == 1 + data[at] + 4:
        # The length of "float NAME" or "int32_t NAME", that text, and the value in four bytes.
        form, _, name = data[at + 1 : at + size - 4].decode("latin-1").partition(" ")
        if form in ("float", "int32_t"):
            (value,) = struct.unpack_from("<f" if form == "float" else "<i", data, at + size - 4)
            stream.parameters[name] = float(value)
    elif kind == DROPOUT and size >= 2:
        stream.dropouts += 1
        stream.dropped_ms += data[at] + 256 * data[at + 1]
    return True


def _layout(name: str, formats: dict[str, list[tuple[str, int, str]]]) -> _Layout | None:
    """Return the layout of a topic's messages, None without a format, without a time, or beyond `LONGEST` bytes.

    Padding at the end need not be in the file.
    """
    fields: dict[str, tuple[str, int]] = {}

    def add(format_name: str, prefix: str, at: int, depth: int) -> int | None:
        for kind, count, field_name in formats.get(format_name, ()):
            for i in range(max(count, 1)):
                label = f"{prefix}{field_name}[{i}]" if count else f"{prefix}{field_name}"
                if kind in TYPES:
                    if not field_name.startswith("_padding"):
                        fields[label] = (TYPES[kind], at)
                    at += int(TYPES[kind][2:])
                else:
                    nested = add(kind, f"{label}.", at, depth + 1) if depth < DEEPEST and kind in formats else None
                    if nested is None:
                        return None
                    at = nested
                if at > LONGEST:
                    return None
        return at

    total = add(name, "", 0, 0)
    if total is None or fields.get("timestamp", ("", 0))[0] != "<u8":
        return None
    return _Layout(fields, max(at + int(kind[2:]) for kind, at in fields.values()), total)


def read_folder(folder: str, asked: ReadRequest) -> RawLog:
    """Read the topics of one log in a folder; `asked` names a field that is no standard channel as `topic.field`.

    Parameters
    ----------
    asked : `group` is the log, LOG in the names of the files; may be left out where the folder has a single log.

    Raises
    ------
    LogError : no such files, several logs, a file that cannot be read, no signals.
    """
    files = topic_files(folder)
    if not files:
        raise LogError(f"{folder}: is a directory without files of ulog2csv (LOG_TOPIC_0.csv); give a log")
    named = {path: parts for path in files if (parts := _told_by(path.name, asked.sources))}
    logs = list(dict.fromkeys(log for log, _, _ in named.values()))
    if not logs:
        raise LogError(f"{folder}: no topic with channels in the names of its files, got {files[0].name}; give a log")
    chosen = choose_group(folder, asked.group, logs, has_signals=False)
    topics, empty, doubts = list[Topic](), [], list[Note]()
    for path, (log, topic, instance) in named.items():
        if log == chosen:
            with open(path, "rb") as file:
                has_samples = sum(1 for _, line in zip(range(4), file, strict=False) if line.strip()) > 2
            if has_samples:
                read, more = _topic(path, topic, instance)
                topics.append(read)
                doubts += more
            else:
                empty.append(topic)
    notes = [*notes_on(0, empty), *doubts]
    unread = [path.name for path in files if path not in named and path.name.startswith(f"{chosen}_")]
    unread = [re.sub(r"_\d+\.csv$", "", name[len(str(chosen)) + 1 :], flags=re.IGNORECASE) for name in unread]
    if unread:
        notes.append(
            Note.method(
                f"topics without channels are not read: {', '.join(dict.fromkeys(unread))}; take a field of one with "
                "--channel NAME=topic.field"
            )
        )
    return log_of_topics(folder, "px4", topics, asked, notes=notes)


def read_topic_file(path: str, asked: ReadRequest) -> RawLog | None:
    """Read one file of `ulog2csv`; fields that are no standard channel keep the name `topic.field`.

    None for any other file, and for a topic without channels.

    Raises
    ------
    LogError : the file cannot be read, or holds no signals.
    """
    parts = _told_by(Path(path).name)
    if parts is None:
        return None
    topic, notes = _topic(Path(path), *parts[1:])
    return log_of_topics(
        path, "px4", [topic], asked, notes=notes, more=[f"{topic.label}.{name}" for name in topic.fields]
    )


def _told_by(name: str, wanted: Iterable[str] = ()) -> tuple[str, str, int] | None:
    """Return log, topic and instance of a file's name, None where it is no topic with channels or a wanted field."""
    # The longest first: actuator_controls_0 ends in a number too, and wind is the end of airspeed_wind.
    for topic in sorted({*fields_of("px4"), *topics_of(wanted)}, key=len, reverse=True):
        match = re.fullmatch(rf"(?:(.*)_)?{re.escape(topic)}_(\d{{1,3}})\.csv", name, re.IGNORECASE)
        if match:
            return match[1] or "log", topic, int(match[2])
    return None


def _topic(path: Path, name: str, instance: int) -> tuple[Topic, list[Note]]:
    """Return the topic of a file, and notes on what of it is left out.

    Raises
    ------
    LogError : the file cannot be read, or has no numbers as `timestamp`.
    """
    raw = read_csv(str(path), ReadRequest(channel_map={"time": "timestamp"}))
    notes = [*raw.notes, *(Note.method(f"'{name}' {why} and is left out") for name, why in raw.left_out.items())]
    columns = {column.source: column.values for column in raw.columns}
    if "timestamp" not in columns:
        raise LogError(f"{path}: 'timestamp' holds no microseconds; export the topic again")
    time_s = MICROSECOND * columns.pop("timestamp")
    topic = Topic(name=name, instance=instance, time_s=time_s, fields=columns)
    return topic, [replace(note, text=f"{path.name}: {note.text}") for note in notes]
