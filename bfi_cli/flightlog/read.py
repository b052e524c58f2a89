"""Read a flight log of any supported format into standard channels and SI units."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from ..errors import LogError
from .assembly import assemble, time_column
from .raw import RawLog, Span, TimeOf
from .record import FlightLog
from .recorder import with_seen_recorder

__all__ = ["read_log"]

HDF5 = b"\x89HDF\r\n\x1a\n"
MATLAB = (b"MATLAB 5.0 MAT-file", b"MATLAB 7.0 MAT-file")
FOREIGN = {b"ULog\x01\x12\x35": "a PX4 ULog", b"PK\x03\x04": "a zip archive or spreadsheet", b"\x1f\x8b": "gzip data"}


def read_log(
    path: str | Path,
    *,
    group: str | None = None,
    channel_map: Mapping[str, str] | None = None,
    unit_map: Mapping[str, str] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
) -> FlightLog:
    """Read a flight log; the format is told by the content of the file.

    Parameters
    ----------
    path : HDF5, CSV, MATLAB v5 or v7.3.
    group : HDF5 group or MATLAB struct that holds the channels; found by itself where there is just one.
    channel_map : standard name -> name in the file, for names that are not known.
    unit_map : name in the file, or standard name -> its unit, for channels that state none or a wrong one.
    from_s, to_s : what is wanted of the log, on its time axis. More may be returned, so cut it with `window`: only of
        an HDF5 log that is large are the samples outside left unread.

    Returns
    -------
    FlightLog : channels under standard names where known, in SI units and radians, read-only; `notes` says what the
        reader decided, `filters` what the file states or the log shows of the recorder's low-pass.

    Raises
    ------
    ConfigError : a unit of `unit_map` that is unknown or of another quantity.
    LogError : the file cannot be read, or has no usable time axis, channels of different length, or data in other
        files; or it needs more memory than a log should.
    """
    name = str(path)
    _require_file(name)
    channel_map, unit_map = channel_map or {}, unit_map or {}
    time_of = partial(time_column, channel_map=channel_map, unit_map=unit_map)
    raw = _read(name, group, (from_s, to_s), time_of)
    with open(name, "rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    log = assemble(raw, path=name, sha256=sha256, channel_map=channel_map, unit_map=unit_map)
    return with_seen_recorder(log)


def _require_file(path: str) -> None:
    if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
        raise LogError(f"{path}: is no file but a device or a pipe; write the log to a file first")
    try:
        open(path, "rb").close()
    except IsADirectoryError:
        raise LogError(f"{path}: is a directory; give a log file in it") from None
    except FileNotFoundError:
        raise LogError(f"{path or repr(path)}: no such file; give the path of a log") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"{path!r}: cannot be read, {reason.lower()}; give the path of a log") from None


def _read(path: str, group: str | None, span: Span, time_of: TimeOf) -> RawLog:
    with open(path, "rb") as file:
        head = file.read(4096)
    if not head:
        raise LogError(f"{path}: the file is empty; copy or export it again")
    if any(head.startswith(HDF5, at) for at in (0, 512, 1024, 2048)):
        from .hdf5 import read_hdf5

        return read_hdf5(path, group=group, span=span, time_of=time_of)
    if head.startswith(MATLAB):
        from .matlab import read_matlab

        return read_matlab(path, group=group)
    for magic, kind in FOREIGN.items():
        if head.startswith(magic):
            raise LogError(f"{path}: {kind} cannot be read; convert it to CSV or HDF5")
    if b"\0" in head:
        raise LogError(f"{path}: neither HDF5, MATLAB v5 or v7.3, nor text; convert it to CSV or HDF5")
    if group is not None:
        raise LogError(f"{path}: no group '{group}', a CSV log has none; leave out --group")
    from .text import read_csv

    return read_csv(path)
