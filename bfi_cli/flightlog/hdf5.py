"""HDF5 logs, and MATLAB v7.3 files, which are HDF5 with arrays on their side and structs as groups."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import LogError
from ..faults import Fault
from .annotations import faults_from_json, segments_from_json
from .raw import RawColumn, RawLog, choose_group, is_signal, numeric
from .record import Segment

if TYPE_CHECKING:
    import h5py

__all__ = ["read_hdf5"]

TRUTH = "truth"
CLEAN = "_clean"
DEEPEST_COMPRESSION = 10_000


def read_hdf5(path: str, *, group: str | None = None) -> RawLog:
    """Read an HDF5 or MATLAB v7.3 log.

    Raises
    ------
    LogError : truncated or damaged, no signals, no such group.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return _read(path, file, group)
    except LogError:
        raise
    except Exception as error:  # a damaged file can make the HDF5 library raise anything
        detail = " ".join(str(error).split())
        raise LogError(f"{path}: damaged or truncated HDF5 file, {detail}; copy or export it again") from None


def _read(path: str, file: h5py.File, group: str | None) -> RawLog:
    chosen = choose_group(path, group, _groups(file), has_signals=any(_signals(file)))
    node = file if chosen is None else file[chosen]
    columns = [_column(path, name, data) for name, data in _signals(node)]
    clean = dict(_clean(path, file))
    rate = node.attrs.get("sample_rate_hz", file.attrs.get("sample_rate_hz"))
    return RawLog(
        columns=[column for column in columns if column is not None],
        sample_rate_hz=None if rate is None else float(np.ravel(rate)[0]),
        segments=_segments(path, node) or _segments(path, file),
        faults=_faults(path, file),
        clean=clean,
        notes=tuple(_left_out(node)),
    )


def _groups(file: h5py.File) -> list[str]:
    import h5py

    return [
        name
        for name, node in file.items()
        if isinstance(node, h5py.Group) and name != TRUTH and not name.startswith("#") and "data" not in node
    ]


def _signals(node: h5py.Group) -> Iterator[tuple[str, h5py.Dataset]]:
    """Yield name and dataset of every signal: a dataset itself, or a struct with the field `data`."""
    import h5py

    for name, child in node.items():
        data = child.get("data") if isinstance(child, h5py.Group) and name != TRUTH else child
        if (
            isinstance(data, h5py.Dataset)
            and data.dtype.kind in "fiub"
            and is_signal(data.shape)
            and not _is_char(data)
        ):
            yield name, data


def _is_char(data: h5py.Dataset) -> bool:
    return _text(data.attrs.get("MATLAB_class")) == "char"


def _left_out(node: h5py.Group) -> Iterator[str]:
    import h5py

    kept = {name for name, _ in _signals(node)}
    for name, child in node.items():
        if name not in kept and name != TRUTH and isinstance(child, h5py.Dataset):
            yield f"'{name}' is no signal (shape {child.shape}, {child.dtype}) and is left out"


def _column(path: str, name: str, data: h5py.Dataset) -> RawColumn | None:
    if data.size > DEEPEST_COMPRESSION * Path(path).stat().st_size:
        raise LogError(f"{path}: '{name}' claims {data.size} samples, more than the file can hold; export it again")
    values = numeric(data[()])
    return None if values is None else RawColumn(source=name, values=values, unit=_unit(data))


def _unit(data: h5py.Dataset) -> str | None:
    stated = data.attrs.get("units", data.attrs.get("unit"))
    if stated is None and data.name.endswith("/data") and "units" in data.parent:
        codes = data.parent["units"][()]
        if data.parent["units"].attrs.get("MATLAB_empty"):
            return None
        stated = "".join(chr(int(code)) for code in np.ravel(codes)[:80])
    return _text(stated) or None


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if isinstance(value, np.ndarray):
        return _text(value.ravel()[0]) if value.size else ""
    return "" if value is None else str(value)


def _segments(path: str, node: h5py.Group) -> tuple[Segment, ...]:
    if "segments" not in node.attrs:
        return ()
    return segments_from_json(_text(node.attrs["segments"]), where=f"{path}: segments")


def _faults(path: str, file: h5py.File) -> tuple[Fault, ...] | None:
    if TRUTH not in file:
        return None
    return faults_from_json(_text(file[TRUTH].attrs.get("faults", "[]")), where=f"{path}: /truth faults")


def _clean(path: str, file: h5py.File) -> Iterator[tuple[str, RawColumn]]:
    if TRUTH not in file:
        return
    for name, data in _signals(file[TRUTH]):
        column = _column(path, name, data)
        if column is not None and name.endswith(CLEAN):
            yield name.removesuffix(CLEAN), column
