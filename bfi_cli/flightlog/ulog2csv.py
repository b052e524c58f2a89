"""PX4 logs as `ulog2csv` writes them: a CSV file per topic, LOG_TOPIC_INSTANCE.csv, whose first column is `timestamp`.

The topic stands in the name of a file only (two topics can have the same columns); that it is such a file, its header
says. Times are microseconds since the autopilot started.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from ..errors import LogError
from ..notes import Note
from .raw import Asked, RawLog, choose_group
from .text import read_csv
from .topics import Topic, fields_of, log_of_topics, notes_on, topics_of

MICROSECOND = 1e-6  # of the time stamps
HEADER = ("timestamp,", "timestamp;")


def is_topic_file(path: str | Path) -> bool:
    """Say whether a file is one of `ulog2csv`, of a topic that has channels."""
    return _starts_like_one(Path(path)) and _parts(Path(path).name) is not None


def topic_files(folder: str | Path) -> list[Path]:
    """Return the files of a folder that `ulog2csv` wrote, by name.

    Raises
    ------
    LogError : the folder cannot be read.
    """
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise LogError(f"{folder}: cannot be read, {reason}; give the path of a log") from None
    paths = [Path(folder, name) for name in names if re.fullmatch(r".*_\d+\.csv", name, re.IGNORECASE)]
    return [path for path in paths if path.is_file() and _starts_like_one(path)]


def folder_digest(folder: str | Path) -> str:
    """Return one SHA-256 of the names and contents of the files of `topic_files`."""
    whole = hashlib.sha256()
    for path in topic_files(folder):
        with open(path, "rb") as file:
            whole.update(f"{path.name} {hashlib.file_digest(file, 'sha256').hexdigest()}\n".encode())
    return whole.hexdigest()


def read_folder(folder: str, asked: Asked) -> RawLog:
    """Read the topics of one log in a folder; a field that is no channel by itself is named `topic.field` in the maps.

    Parameters
    ----------
    asked : `group` is the log, LOG in the names of the files; may be left out where there is just one.

    Raises
    ------
    LogError : no such files, several logs, a file that cannot be read, no signals.
    """
    files = topic_files(folder)
    if not files:
        raise LogError(f"{folder}: is a directory without files of ulog2csv (LOG_TOPIC_0.csv); give a log")
    named = {path: parts for path in files if (parts := _parts(path.name, asked.sources))}
    logs = list(dict.fromkeys(log for log, _, _ in named.values()))
    if not logs:
        raise LogError(f"{folder}: no topic with channels in the names of its files, got {files[0].name}; give a log")
    chosen = choose_group(folder, asked.group, logs, has_signals=False)
    topics, empty = [], []
    for path, (log, topic, instance) in named.items():
        if log == chosen:
            with open(path, "rb") as file:
                has_samples = sum(1 for _, line in zip(range(4), file, strict=False) if line.strip()) > 2
            if has_samples:
                topics.append(_topic(path, topic, instance))
            else:
                empty.append(topic)
    notes = notes_on(0, empty)
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


def read_topic_file(path: str, asked: Asked) -> RawLog:
    """Read one file of `ulog2csv`; fields that are no channel keep the name `topic.field`.

    Raises
    ------
    LogError : it cannot be read, or holds no signals.
    """
    parts = _parts(Path(path).name)
    if parts is None:
        raise LogError(f"{path}: no topic with channels in its name; name it LOG_TOPIC_0.csv")
    topic = _topic(Path(path), parts[1], parts[2])
    return log_of_topics(path, "px4", [topic], asked, more=[f"{topic.label}.{name}" for name in topic.fields])


def _starts_like_one(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            return file.read(16).decode("latin-1").startswith(HEADER)
    except OSError:
        return False


def _parts(name: str, wanted: Iterable[str] = ()) -> tuple[str, str, int] | None:
    """Return log, topic and instance of a file's name, None where it is no topic with channels or a wanted field."""
    # The longest first: actuator_controls_0 has a number of its own, wind is the end of airspeed_wind.
    for topic in sorted({*fields_of("px4"), *topics_of(wanted)}, key=len, reverse=True):
        match = re.fullmatch(rf"(?:(.*)_)?{re.escape(topic)}_(\d{{1,3}})\.csv", name, re.IGNORECASE)
        if match:
            return match[1] or "log", topic, int(match[2])
    return None


def _topic(path: Path, name: str, instance: int) -> Topic:
    columns = {column.source: column.values for column in read_csv(str(path)).columns}
    time_s = MICROSECOND * columns.pop("timestamp")
    return Topic(name=name, instance=instance, time_s=time_s, fields=columns)
