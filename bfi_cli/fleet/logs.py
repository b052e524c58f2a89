"""Which logs a fleet has: files, folders and lists by name, each with the folder of its results."""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import ConfigError, LogError, reason_of
from ..files import DOCUMENTS, is_ours
from ..flightlog import is_log_folder

# Endings of the files of a folder that are taken for logs; a file that is given by its name may have any.
ENDINGS = (".bin", ".csv", ".dat", ".h5", ".hdf5", ".igc", ".log", ".mat", ".mcap", ".tdms", ".tlog", ".txt", ".ulg")
# Hexadecimal digits of the path's digest behind a name that several logs have: one in 16 million logs meets another.
DIGITS = 6
# The line in which a Garmin states its aircraft, and the keys that may name it, the surest first.
HEADER, STATED = b"#airframe_info", ("aircraft_ident", "tail_number", "system_id")
HEADER_BYTES = 4096
# Columns of a list with a header.
LOG, AIRCRAFT = "log", "aircraft"


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetLog:
    """A log of a fleet.

    Attributes
    ----------
    path : as the log is opened.
    folder : name of the folder of its results.
    aircraft : that the list states, or the log, "" where none does.
    """

    path: str
    folder: str
    aircraft: str = ""


def is_fleet(paths: Sequence[str]) -> bool:
    """Return whether paths are those of several logs: more than one, or a folder that is no log itself."""
    return len(paths) > 1 or any(os.path.isdir(path) and not is_log_folder(path) for path in paths)


def logs_of(paths: Sequence[str], *, recursive: bool = False, listed: str | None = None) -> tuple[FleetLog, ...]:
    """Return the logs of a fleet in the order in which they are named, those of a folder by name, each once.

    Parameters
    ----------
    paths : files, and folders, of which the files are logs whose ending is that of one; a folder as `ulog2csv` writes
        it is a log itself. Folders of our own results are left out.
    recursive : take the logs of the folders within too.
    listed : file of a path a line, or CSV with a column `log`, and `aircraft` where it is known; "-" is stdin. Paths
        count from the folder of the file.

    Raises
    ------
    ConfigError : the list cannot be read, or has no column `log`.
    LogError : there is no log, or a folder cannot be read.
    """
    aircraft: dict[str, str] = {}
    named = [(path, "") for path in paths] + ([] if listed is None else list(_listed(listed)))
    for path, name in named:
        for log in _logs_at(path, recursive):
            aircraft[log] = aircraft.get(log) or name
    if not aircraft:
        where = ", ".join([*paths, *([] if listed is None else [listed])])
        further = "" if recursive else ", or --recursive to search the folders within"
        raise LogError(f"{where}: no logs are there (files that end with {', '.join(ENDINGS)}); give logs{further}")
    folders = _folders(aircraft)
    stated = {path: name or aircraft_in(path) for path, name in aircraft.items()}
    return tuple(FleetLog(path=path, folder=folders[path], aircraft=stated[path]) for path in aircraft)


def aircraft_in(path: str) -> str:
    """Return the aircraft that the header of a log states, "" where it states none."""
    if not os.path.isfile(path):  # a pipe would wait
        return ""
    try:
        with open(path, "rb") as file:
            head = file.readline(HEADER_BYTES) if file.read(len(HEADER)) == HEADER else b""
    except OSError:
        return ""
    words = dict(re.findall(r'(\w+)="([^"]*)"', head.decode("utf-8", "replace")))
    return next((words[key].strip() for key in STATED if words.get(key, "").strip()), "")


def _logs_at(path: str, recursive: bool) -> Iterator[str]:
    """Yield the log at a path, or those in the folder there."""
    if not os.path.isdir(path) or is_log_folder(path):
        yield path
        return
    try:
        entries = sorted(os.scandir(path), key=lambda entry: entry.name)
    except OSError as error:
        raise LogError(f"{path}: cannot be read, {reason_of(error)}; give the path of a log") from None
    if any(is_ours(Path(path) / name) for name in DOCUMENTS):
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if entry.is_dir():
            if is_log_folder(entry.path):
                yield entry.path
            elif recursive and not entry.is_symlink():  # a link to a folder above would never end
                yield from _logs_at(entry.path, recursive)
        elif entry.name.lower().endswith(ENDINGS):
            yield entry.path


def _listed(path: str) -> Iterator[tuple[str, str]]:
    """Yield path and aircraft of the lines of a list.

    Raises
    ------
    ConfigError : see `logs_of`.
    """
    try:
        text = sys.stdin.read() if path == "-" else Path(path).read_text("utf-8-sig")
    except (OSError, ValueError) as error:
        what = "not a text file" if isinstance(error, ValueError) else reason_of(error)
        raise ConfigError(f"--list {path}: {what}; give a text file with the path of a log on each line") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    heads = [head.strip().lower() for head in next(csv.reader(lines[:1]), [])]
    folder = "" if path == "-" else os.path.dirname(path)
    if heads == [LOG] or len(heads) > 1:
        if LOG not in heads:
            raise ConfigError(
                f"--list {path}: no column '{LOG}', the first line is '{lines[0][:60]}'; name one of its columns {LOG}"
            )
        for row in csv.reader(io.StringIO("\n".join(lines[1:]))):
            cells = dict(zip(heads, map(str.strip, row), strict=False))
            if cells.get(LOG):
                yield os.path.join(folder, cells[LOG]), cells.get(AIRCRAFT, "")
    else:
        for line in lines:
            yield os.path.join(folder, line.strip()), ""


def _folders(paths: Iterable[str]) -> dict[str, str]:
    """Return by path the name of a folder: the log's without its ending, with a digest where several have it."""
    names = {path: _plain_name(path) for path in paths}
    # Systems whose names of files have no case are common.
    taken = Counter(name.lower() for name in names.values())
    return {
        path: name
        if taken[name.lower()] == 1
        else f"{name}-{hashlib.sha256(path.encode('utf-8', 'surrogateescape')).hexdigest()[:DIGITS]}"
        for path, name in names.items()
    }


def _plain_name(path: str) -> str:
    """Return the name of a log as a folder of any system may have it."""
    name = os.path.basename(os.path.abspath(path))
    stem, ending = os.path.splitext(name)
    name = stem if ending.lower() in ENDINGS else name
    return re.sub(r"[^\w.+ -]", "_", name, flags=re.ASCII).strip(" .")[:100] or "log"
