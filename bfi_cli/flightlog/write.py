"""Write a flight log as HDF5 or CSV, whole or not at all."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConfigError
from ..files import ATTRIBUTE, MARK, OWNER, aside
from ..filters import filters_to_json
from ..printable import SHOWN, printable
from .record import CLEAN, FlightLog, FloatArray, Truth, faults_to_json, segments_to_json
from .text import FAULTS, FILTERS, SEGMENTS

if TYPE_CHECKING:
    import h5py


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a log; the suffix tells the format, and reading it back gives the same numbers.

    Channels are written under their names in `log`, with units, segments and the truth of injected faults.

    Parameters
    ----------
    path : ends in .h5, .hdf5 or .csv; an existing file is replaced only when the new one is complete, a missing folder
        is made.

    Raises
    ------
    ConfigError : another suffix, or the file cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in (".h5", ".hdf5", ".csv"):
        raise ConfigError(f"{target}: no format with the suffix '{target.suffix}'; name the file .h5 or .csv")
    with aside(target.parent, place=target, option="--output") as new:
        (_write_csv if suffix == ".csv" else _write_hdf5)(log, new / target.name)


def _write_hdf5(log: FlightLog, path: Path) -> None:
    import h5py

    def add(node: h5py.Group, name: str, values: FloatArray, unit: str) -> None:
        node.create_dataset(name, data=values, compression="gzip", compression_opts=1, shuffle=True)
        node[name].attrs["units"] = unit

    def link_name(name: str) -> str:
        """Return a name HDF5 takes: no path, not the name of the group of the truth."""
        link = name.replace("/", "_").replace("\0", "_")
        return f"{link}_" if link in ("", ".", "..", "time", "truth") else link

    names = _names(log, link_name)
    # Made in memory: on a full disk the HDF5 library prints tracebacks and ends the process.
    with h5py.File(path, "w", driver="core", backing_store=False) as file:
        file.attrs[ATTRIBUTE] = OWNER
        add(file, "time", log.time_s, "s")
        for name, channel in log.channels.items():
            add(file, names[name], channel.values, channel.unit)
        if log.filters is not None:
            file.attrs["filters"] = filters_to_json(log.filters)
        if log.segments:
            file.attrs["segments"] = segments_to_json(log.segments)
        if log.truth is not None:
            truth = file.create_group("truth")
            truth.attrs["faults"] = _faults(log.truth, names)
            for name, clean in log.truth.clean.items():
                add(truth, names[name] + CLEAN, clean, log.channels[name].unit if name in log.channels else "")
        file.flush()
        path.write_bytes(file.id.get_file_image())


def _write_csv(log: FlightLog, path: Path) -> None:
    # On one line, printable, no comment, quote or other delimiter.
    names = _names(log, lambda name: printable(re.sub(r"[\s\"#;]+", " ", name).strip()) or "_")
    columns = {"time [s]": log.time_s}
    signals = [(name, names[name], channel.values) for name, channel in log.channels.items()]
    signals += [(name, names[name] + CLEAN, clean) for name, clean in (log.truth.clean if log.truth else {}).items()]
    for name, title, values in signals:
        unit = log.channels[name].unit if name in log.channels else ""
        columns[f"{title} [{unit}]" if unit else title] = values
    with open(path, "w", encoding="utf-8", errors=SHOWN, newline="") as file:
        file.write(f"{MARK}\n")
        if log.filters is not None:
            file.write(f"{FILTERS}{filters_to_json(log.filters)}\n")
        if log.segments:
            file.write(f"{SEGMENTS}{segments_to_json(log.segments)}\n")
        if log.truth is not None:
            file.write(f"{FAULTS}{_faults(log.truth, names)}\n")
        csv.writer(file, lineterminator="\n").writerow(columns)
        for row in np.column_stack(list(columns.values())).tolist():
            file.write(",".join(map(repr, row)) + "\n")


def _names(log: FlightLog, allowed: Callable[[str], str]) -> dict[str, str]:
    """Return the name of each channel in the file; underscores tell those apart that would be alike there."""
    names: dict[str, str] = {}
    for name in (*log.channels, *(log.truth.clean if log.truth else ())):
        if name not in names:
            new = allowed(name)
            while new in names.values():
                new += "_"
            names[name] = new
    return names


def _faults(truth: Truth, names: Mapping[str, str]) -> str:
    return faults_to_json([replace(fault, channel=names.get(fault.channel, fault.channel)) for fault in truth.faults])
