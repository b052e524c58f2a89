"""MATLAB v5 logs: one variable per channel, or a struct of structs with `data` and `units`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LogError
from .matlab_layout import readable_variables
from .raw import RawColumn, RawLog, choose_group, is_signal, numeric

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
            readable = readable_variables(Path(path).read_bytes())
            wanted = [name for name, known in readable.items() if known]
            variables = loadmat(path, simplify_cells=True, variable_names=wanted)
    except Exception as error:  # a damaged file can make the parser raise anything
        detail = " ".join(f"{type(error).__name__} {error}".split())
        raise LogError(f"{path}: damaged or truncated MATLAB file, {detail}; export it again") from None
    root = {name: value for name, value in variables.items() if not name.startswith("__")}
    groups = [name for name, value in root.items() if isinstance(value, Mapping) and "data" not in value]
    chosen = choose_group(path, group, groups, has_signals=any(_signals(root)))
    node = root if chosen is None else root[chosen]
    notes = [" ".join(str(warning.message).split()) for warning in caught]
    notes += [f"'{name}' is no signal and is left out" for name, known in readable.items() if name and not known]
    return RawLog(columns=list(_signals(node)), sample_rate_hz=_rate(node), notes=(*notes, *_left_out(node)))


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


def _rate(node: Mapping[str, Any]) -> float | None:
    rate = node.get("sample_rate_hz")
    return float(rate) if isinstance(rate, int | float | np.number) else None


def _left_out(node: Mapping[str, Any]) -> Iterator[str]:
    kept = {column.source for column in _signals(node)}
    for name, value in node.items():
        if name not in kept and not isinstance(value, Mapping):
            yield f"'{name}' is no signal ({type(value).__name__}) and is left out"
