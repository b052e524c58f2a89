"""Write a flight log as HDF5 or CSV, whole or not at all."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..encoding import SHOWN
from ..errors import ConfigError
from ..files import ATTRIBUTE, MARK, OWNER, aside
from .annotations import faults_to_json, segments_to_json
from .record import FlightLog, FloatArray
from .text import CLEAN, FAULTS, SEGMENTS

if TYPE_CHECKING:
    import h5py

__all__ = ["write_log"]


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

    # Made in memory: on a full disk the HDF5 library prints tracebacks and ends the process.
    with h5py.File(path, "w", driver="core", backing_store=False) as file:
        file.attrs[ATTRIBUTE] = OWNER
        _dataset(file, "time", log.time_s, unit="s")
        for name, channel in log.channels.items():
            _dataset(file, _link_name(name), channel.values, unit=channel.unit)
        if log.segments:
            file.attrs["segments"] = segments_to_json(log.segments)
        if log.truth is not None:
            truth = file.create_group("truth")
            truth.attrs["faults"] = faults_to_json(log.truth.faults)
            for name, clean in log.truth.clean.items():
                _dataset(truth, _link_name(name) + CLEAN, clean, unit=_unit_of(log, name))
        file.flush()
        path.write_bytes(file.id.get_file_image())


def _dataset(node: h5py.Group, name: str, values: FloatArray, *, unit: str) -> None:
    node.create_dataset(name, data=values, compression="gzip", compression_opts=1, shuffle=True)
    node[name].attrs["units"] = unit


def _link_name(name: str) -> str:
    """Return a name HDF5 takes: no path, not the name of the group of the truth."""
    plain = name.replace("/", "_").replace("\0", "_")
    return f"{plain}_" if plain in ("", ".", "..", "time", "truth") else plain


def _unit_of(log: FlightLog, name: str) -> str:
    return log.channels[name].unit if name in log.channels else ""


def _write_csv(log: FlightLog, path: Path) -> None:
    columns = dict(_csv_columns(log))
    with open(path, "w", encoding="utf-8", errors=SHOWN, newline="") as file:
        file.write(f"{MARK}\n")
        if log.segments:
            file.write(f"{SEGMENTS}{segments_to_json(log.segments)}\n")
        if log.truth is not None:
            file.write(f"{FAULTS}{faults_to_json(log.truth.faults)}\n")
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(columns)
        file.write(header.getvalue())
        for row in np.column_stack(list(columns.values())).tolist():
            file.write(",".join(map(repr, row)) + "\n")


def _csv_columns(log: FlightLog) -> Iterator[tuple[str, FloatArray]]:
    yield "time [s]", log.time_s
    for name, channel in log.channels.items():
        yield _header(name, channel.unit), channel.values
    if log.truth is not None:
        for name, clean in log.truth.clean.items():
            yield _header(name + CLEAN, _unit_of(log, name)), clean


def _header(name: str, unit: str) -> str:
    plain = re.sub(r"[\s\"#;]+", " ", name).strip()
    return f"{plain} [{unit}]" if unit else plain
