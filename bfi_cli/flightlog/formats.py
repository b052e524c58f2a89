"""The formats of logs: which a file is of, by its first bytes, and its reader, which is imported when it is used."""

from __future__ import annotations

import codecs
import hashlib
import os
import re
from collections.abc import Callable, Collection
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import LogError, reason_of
from ..files import HDF5, MCAP
from .raw import RawLog, ReadRequest, require_size

if TYPE_CHECKING:
    import mmap

    from ..notes import Note
    from .topics import Recorder, Topic

MATLAB = (b"MATLAB 5.0 MAT-file", b"MATLAB 7.0 MAT-file")
FOREIGN = {b"PK\x03\x04": "a zip archive or spreadsheet", b"\x1f\x8b": "gzip data", b"TDSh": "the index of a TDMS file"}
IGC_HEAD = re.compile(rb"(?:\xef\xbb\xbf)?A[A-Za-z0-9]{3}[^\n]*\n")
IGC_RECORD = re.compile(rb"\n(?:H[FOP][A-Z0-9]{3}|B\d{13}[NS]\d{8}[EW][AV])")
ULOG2CSV = ("timestamp,", "timestamp;")  # the first column of a file of `ulog2csv`
# Of MAVLink's packets: the first byte of both versions, and the flag of version 2 for 13 bytes of signature at the end.
V1, V2, SIGNED = 0xFE, 0xFD, 1
ARRIVAL = 8  # bytes of the time of arrival, microseconds since 1970, most significant first
YEARS = (946_684_800_000_000, 4_102_444_800_000_000)  # 2000 to 2100


def is_hdf5(head: bytes) -> bool:
    """Say whether the first bytes of a file are those of HDF5, behind a block of the user's or without one."""
    return any(head.startswith(HDF5, at) for at in (0, 512, 1024, 2048))


def is_ulog(head: bytes) -> bool:
    """Say whether the first bytes of a file are those of a ULog."""
    return head.startswith(b"ULog\x01\x12\x35")


def is_dataflash(head: bytes) -> bool:
    """Say whether the first bytes of a file are those of a DataFlash log."""
    return head.startswith(b"\xa3\x95\x80")


def is_tlog(head: bytes) -> bool:
    """Say whether the first bytes of a file are two packets of MAVLink, each behind a time of arrival."""
    first = packet_length(head, 0)
    return first is not None and packet_length(head, first) is not None


def packet_length(data: bytes | mmap.mmap, at: int) -> int | None:
    """Return the number of bytes of arrival time and packet at `at`, None where no packet begins there."""
    head = data[at : at + ARRIVAL + 10]
    if len(head) < ARRIVAL + 10 or not YEARS[0] < int.from_bytes(head[:ARRIVAL], "big") < YEARS[1]:
        return None
    kind, size = head[ARRIVAL], head[ARRIVAL + 1]
    if kind == V1:
        return ARRIVAL + 6 + size + 2
    return ARRIVAL + 10 + size + 2 + (13 if head[ARRIVAL + 2] & SIGNED else 0) if kind == V2 else None


def is_igc(head: bytes) -> bool:
    """Say whether the first bytes of a file are those of an IGC file."""
    return IGC_HEAD.match(head) is not None and IGC_RECORD.search(head) is not None


def wide_encoding(head: bytes) -> str | None:
    """Return the encoding of a text of two bytes per character from its first bytes; None for any other text."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = head[: len(head) // 2 * 2 : 2], head[1::2]
    if not even or b"\0" not in head:
        return None
    if not any(odd) and all(even):
        return "utf-16-le"
    return "utf-16-be" if not any(even) and all(odd) else None


# By the first bytes of a file, "module:function" of `bfi_cli.flightlog` that makes a RawLog of its path and what is
# asked for; these formats may have groups, of which the reader chooses one.
WITH_GROUPS: tuple[tuple[Callable[[bytes], bool], str], ...] = (
    (is_hdf5, "hdf5:read_hdf5"),
    (lambda head: head.startswith(MATLAB), "matlab:read_matlab"),
    (lambda head: head.startswith(b"TDSm"), "tdms:read_tdms"),
    (lambda head: head.startswith(MCAP), "mcap:read_mcap"),
)
# By the first bytes of a file with messages, its recorder, and "module:function" that reads the topics of given names.
MESSAGE_READERS: tuple[tuple[Callable[[bytes], bool], Recorder, str], ...] = (
    (is_ulog, "px4", "px4:read_ulog_topics"),
    (is_dataflash, "ardupilot", "dataflash:read_dataflash_topics"),
    (is_tlog, "mavlink", "tlog:read_tlog_topics"),
)


def read_columns(path: str, asked: ReadRequest) -> RawLog:
    """Return the columns of a file in the format that its first bytes show, or of a folder of files of `ulog2csv`.

    Raises
    ------
    LogError : the file cannot be read, or is none of a flight log.
    """
    if os.path.isdir(path):
        return _function("px4:read_folder")(path, asked)  # type: ignore[no-any-return]
    head = _head(path)
    for is_one, reader in WITH_GROUPS:
        if is_one(head):
            _require_no_columns(path, asked)
            return _function(reader)(path, asked)  # type: ignore[no-any-return]
    if asked.group is not None:
        raise LogError(f"{path}: no group '{asked.group}', a log of this kind has none; leave out --group")
    for is_one, recorder, reader in MESSAGE_READERS:
        if is_one(head):
            _require_no_columns(path, asked)
            return _columns_of_messages(path, recorder, _function(reader), asked)
    if is_igc(head):
        _require_no_columns(path, asked)
        return _function("igc:read_igc")(path, asked)  # type: ignore[no-any-return]
    for magic, kind in FOREIGN.items():
        if head.startswith(magic):
            raise LogError(f"{path}: {kind} cannot be read; convert it to CSV or HDF5")
    read_csv, encoding = _function("text:read_csv"), wide_encoding(head)
    if encoding is not None:
        return read_csv(path, asked, encoding)  # type: ignore[no-any-return]
    if b"\0" in head.rstrip(b"\0\r\n"):  # a recorder that lost its power leaves some at the end
        raise LogError(f"{path}: neither HDF5, MATLAB v5 or v7.3, nor text; convert it to CSV or HDF5")
    if not asked.columns and is_by_ulog2csv(path) and (topic := _function("px4:read_topic_file")(path, asked)):
        return topic  # type: ignore[no-any-return]
    return read_csv(path, asked)  # type: ignore[no-any-return]


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    return getattr(import_module(f"{__package__}.{module}"), function)  # type: ignore[no-any-return]


def _head(path: str) -> bytes:
    """Return the first bytes of a file."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise LogError(f"{path}: is a device or a pipe, not a file; write the log to a file first")
    try:
        with open(path, "rb") as file:
            head = file.read(4096)
    except FileNotFoundError:
        raise LogError(f"{path or repr(path)}: no such file; give the path of a log") from None
    except (OSError, ValueError) as error:
        raise LogError(f"{path!r}: cannot be read, {reason_of(error)}; give the path of a log") from None
    if not head:
        raise LogError(f"{path}: the file is empty; copy or export it again")
    return head


def _columns_of_messages(
    path: str,
    recorder: Recorder,
    topics_in: Callable[[str, Collection[str]], tuple[list[Topic], list[Note]]],
    asked: ReadRequest,
) -> RawLog:
    from .topics import log_of_topics, topics_of

    require_size(path, os.path.getsize(path), "cut the log")
    topics, notes = topics_in(path, topics_of(asked.sources))
    return log_of_topics(path, recorder, topics, asked, notes=notes)


def _require_no_columns(path: str, asked: ReadRequest) -> None:
    if asked.columns:
        raise LogError(
            f"{path}: --columns names those of a text without a header, this file names its own; leave it out"
        )


def digest_of_log(path: str) -> str:
    """Return the SHA-256 of the bytes of a log: a file, or names and contents of a folder of files of `ulog2csv`.

    Raises
    ------
    OSError : it cannot be read.
    """
    if not os.path.isdir(path):
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    whole = hashlib.sha256()
    for topic in topic_files(path):
        whole.update(f"{topic.name} {digest_of_log(str(topic))}\n".encode())
    return whole.hexdigest()


def is_log_folder(path: str) -> bool:
    """Return whether a path is a folder with files of `ulog2csv`, which is one log."""
    return os.path.isdir(path) and bool(topic_files(path))


def topic_files(folder: str) -> list[Path]:
    """Return the files of a folder that `ulog2csv` wrote, by name.

    Raises
    ------
    LogError : the folder cannot be read.
    """
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise LogError(f"{folder}: cannot be read, {reason_of(error)}; give the path of a log") from None
    paths = [Path(folder, name) for name in names if re.fullmatch(r".*_\d+\.csv", name, re.IGNORECASE)]
    return [path for path in paths if path.is_file() and is_by_ulog2csv(path)]


def is_by_ulog2csv(path: str | Path) -> bool:
    """Return whether a file begins as those of `ulog2csv` do."""
    try:
        with open(path, "rb") as file:
            return file.read(16).decode("latin-1").startswith(ULOG2CSV)
    except OSError:
        return False


def parameters_of(path: str) -> dict[str, float]:
    """Return the parameters that an autopilot flew with, as a ULog or a DataFlash log lists them last."""
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except (OSError, ValueError):  # a log that was made in memory
        return {}
    if is_ulog(head):
        return _function("px4:read_ulog_parameters")(path)  # type: ignore[no-any-return]
    return _function("dataflash:read_dataflash_parameters")(path) if is_dataflash(head) else {}
