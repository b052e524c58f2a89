"""MATLAB v5 logs: one variable per channel, or a struct of structs with `data` and `units`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LogError, first_line
from .matlab_layout import unpacked_size, variables
from .raw import (
    RawColumn,
    RawLog,
    choose_group,
    is_signal,
    left_out,
    numeric,
    rate_of,
    require_bytes,
    require_few,
    unfit_kind,
)

__all__ = ["read_matlab"]


def read_matlab(path: str, *, group: str | None = None) -> RawLog:
    """Read a MATLAB v5 file.

    Raises
    ------
    LogError : truncated or damaged, no signals, no such struct.
    """
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            unlike = _unlike(path)
            wanted = [name for name, why in unlike.items() if why is None]
            loaded = loadmat(path, simplify_cells=True, variable_names=wanted)
    except (LogError, MemoryError):
        raise
    except Exception as error:  # a damaged file can make the parser raise anything
        raise LogError(f"{path}: damaged or truncated MATLAB file, {first_line(error)}; export it again") from None
    root = {name: value for name, value in loaded.items() if not name.startswith("__")}
    groups = [name for name, value in root.items() if isinstance(value, Mapping) and "data" not in value]
    chosen = choose_group(path, group, groups, has_signals=any(_signals(root)))
    node = root if chosen is None else root[chosen]
    notes = [first_line(warning.message) for warning in caught if isinstance(warning.message, Warning)]
    notes += [left_out(name, why) for name, why in unlike.items() if name and why]
    rate = rate_of(path, node["sample_rate_hz"]) if "sample_rate_hz" in node else None
    return RawLog(columns=list(_signals(node)), sample_rate_hz=rate, notes=(*notes, *_left_out(node)))


def _unlike(path: str) -> dict[str, str | None]:
    """Return why each variable of a file is no signal, None where it can be one, if all of them fit into memory."""
    require_bytes(path, Path(path).stat().st_size)
    file = Path(path).read_bytes()
    require_bytes(path, unpacked_size(file))
    found = variables(file)
    require_bytes(path, 8 * sum(variable.count for variable in found))
    require_few(path, len(found), "variables")
    return {variable.name: variable.unlike for variable in found}


def _signals(node: Mapping[str, Any]) -> Iterator[RawColumn]:
    for name, value in node.items():
        data = value.get("data") if isinstance(value, Mapping) else value
        if isinstance(data, np.ndarray) and is_signal(data.shape):
            values = numeric(data)
            if values is not None:
                yield RawColumn(source=name, values=values, unit=_unit(value))


def _unit(value: Any) -> str | None:
    unit = value.get("units", value.get("unit")) if isinstance(value, Mapping) else None
    return unit.strip() or None if isinstance(unit, str) else None


def _left_out(node: Mapping[str, Any]) -> Iterator[str]:
    kept = {column.source for column in _signals(node)}
    for name, value in node.items():
        if name not in (*kept, "sample_rate_hz") and (not isinstance(value, Mapping) or "data" in value):
            yield left_out(name, _why(value["data"] if isinstance(value, Mapping) else value))


def _why(value: Any) -> str:
    """Return why a value is no signal."""
    array = np.asarray(value) if not isinstance(value, list | Mapping) else np.empty(0, dtype=object)
    if array.dtype.kind != "O":
        return unfit_kind(array.dtype.kind, array.shape)
    parts = list(value) if isinstance(value, list | np.ndarray) else []
    is_struct = isinstance(value, Mapping) or (parts and all(isinstance(part, Mapping) for part in parts))
    return "is an array of structs" if is_struct else "is a cell array"
