"""Write a flight log as HDF5, CSV or MCAP, whole or not at all."""

from __future__ import annotations

import csv
import json
import re
import struct
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConfigError
from ..files import ATTRIBUTE, MARK, MCAP, OWNER, aside
from ..printable import SHOWN, printable
from .raw import TRUTH_KEYS, annotations_of
from .record import CLEAN, FlightLog, FloatArray

if TYPE_CHECKING:
    import h5py


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a log; the suffix tells the format, and reading it back gives the same numbers.

    Channels are written under their names in `log`, with units, segments, clock and the truth of injected faults; MCAP,
    for Foxglove and PlotJuggler, has the channels and their units alone.

    Parameters
    ----------
    path : ends in .h5, .hdf5, .csv or .mcap; an existing file is replaced only when the new one is complete, a missing
        folder is made.

    Raises
    ------
    ConfigError : another suffix, or the file cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    writers = {".h5": _write_hdf5, ".hdf5": _write_hdf5, ".csv": _write_csv, ".mcap": _write_mcap}
    if suffix not in writers:
        raise ConfigError(f"{target}: no format with the suffix '{target.suffix}'; name the file .h5, .csv or .mcap")
    log = _recorded(log)
    with aside(target.parent, place=target, option="--output") as new:
        writers[suffix](log, new / target.name)


def _recorded(log: FlightLog) -> FlightLog:
    """Return the log without the channels that follow from others: who reads it derives them again."""
    derived = {name for name, channel in log.channels.items() if channel.derived_from}
    clean = {name: values for name, values in (log.truth.clean if log.truth else {}).items() if name not in derived}
    channels = {name: channel for name, channel in log.channels.items() if name not in derived}
    return replace(log, channels=channels, truth=log.truth and replace(log.truth, clean=clean))


def _write_hdf5(log: FlightLog, path: Path) -> None:
    import h5py

    def add(node: h5py.Group, name: str, values: FloatArray, unit: str) -> None:
        node.create_dataset(name, data=values, compression="gzip", compression_opts=1, shuffle=True)
        node[name].attrs["units"] = unit

    def link_name(name: str) -> str:
        """Return a name that HDF5 accepts: no path, and not that of the time axis or of the group of the truth."""
        link = name.replace("/", "_").replace("\0", "_")
        return f"{link}_" if link in ("", ".", "..", "time", "truth") else link

    names = _names(log, link_name)
    # Made in memory: on a full disk the HDF5 library prints tracebacks and ends the process.
    with h5py.File(path, "w", driver="core", backing_store=False) as file:
        file.attrs[ATTRIBUTE] = OWNER
        add(file, "time", log.time_s, "s")
        for name, channel in log.channels.items():
            add(file, names[name], channel.values, channel.unit)
        truth = None if log.truth is None else file.create_group("truth")
        for key, text in annotations_of(log, names).items():
            (truth if truth is not None and key in TRUTH_KEYS else file).attrs[key] = text
        if truth is not None and log.truth is not None:
            for name, clean in log.truth.clean.items():
                add(truth, names[name] + CLEAN, clean, log.channels[name].unit if name in log.channels else "")
        file.flush()
        path.write_bytes(file.id.get_file_image())


def _write_csv(log: FlightLog, path: Path) -> None:
    # Titles on one line, printable, without comment, quote or delimiter.
    names = _names(log, lambda name: printable(re.sub(r"[\s\"#;]+", " ", name).strip()) or "_")
    columns = {"time [s]": log.time_s}
    signals = [(name, names[name], channel.values) for name, channel in log.channels.items()]
    signals += [(name, names[name] + CLEAN, clean) for name, clean in (log.truth.clean if log.truth else {}).items()]
    for name, title, values in signals:
        unit = log.channels[name].unit if name in log.channels else ""
        columns[f"{title} [{unit}]" if unit else title] = values
    with open(path, "w", encoding="utf-8", errors=SHOWN, newline="") as file:
        file.write(f"{MARK}\n")
        file.writelines(f"# {key}: {text}\n" for key, text in annotations_of(log, names).items())
        csv.writer(file, lineterminator="\n").writerow(columns)
        for row in np.column_stack(list(columns.values())).tolist():
            file.write(",".join(map(repr, row)) + "\n")


def _write_mcap(log: FlightLog, path: Path) -> None:
    """Write a message of JSON for each sample on the topic `/log`, a missing value being left out of it.

    Records follow the specification of MCAP (mcap.dev/spec); chunks, index and checksums, which are optional, are left
    out. Times are nanoseconds since the zero of the log's axis.
    """
    if log.time_s[0] < 0.0:
        raise ConfigError(f"{log.path}: begins at {log.time_s[0]:g} s, MCAP has no time below 0; give --from 0")

    def text(words: str | bytes) -> bytes:
        data = words.encode() if isinstance(words, str) else words
        return struct.pack("<I", len(data)) + data

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(content)) + content

    names = _names(log, printable)
    fields = {names[name]: {"type": "number", "description": channel.unit} for name, channel in log.channels.items()}
    schema = json.dumps({"type": "object", "properties": fields}).encode()
    columns = np.column_stack([channel.values for channel in log.channels.values()])
    with path.open("wb") as file:
        file.write(MCAP + record(1, text("") + text(OWNER)))
        file.write(record(3, struct.pack("<H", 1) + text("log") + text("jsonschema") + text(schema)))
        file.write(record(4, struct.pack("<HH", 1, 1) + text("/log") + text("json") + text(b"")))
        moments = np.round(1e9 * log.time_s).astype(np.int64).tolist()
        for i, (moment, row) in enumerate(zip(moments, columns, strict=True)):
            known = {name: value for name, value in zip(fields, row.tolist(), strict=True) if isfinite(value)}
            head = struct.pack("<HIQQ", 1, i, moment, moment)
            file.write(record(5, head + json.dumps(known, separators=(",", ":")).encode()))
        file.write(record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MCAP)


def _names(log: FlightLog, allowed: Callable[[str], str]) -> dict[str, str]:
    """Return the name of each channel in the file; underscores are added to names that would stand twice."""
    names: dict[str, str] = {}
    for name in (*log.channels, *(log.truth.clean if log.truth else ())):
        if name not in names:
            new = allowed(name)
            while new in names.values():
                new += "_"
            names[name] = new
    return names
