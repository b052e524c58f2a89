"""HDF5 logs, and MATLAB v7.3 files, which are HDF5 with arrays on their side and structs as groups."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError, first_line
from ..filters import Filter, filters_from_json
from ..units import to_si
from .hdf5_layout import attribute, is_text, member, members, require_readable, text, unfit
from .raw import (
    LARGEST,
    RawColumn,
    RawLog,
    Span,
    TimeOf,
    choose_group,
    different_length,
    left_out,
    rate_of,
    require_memory,
)
from .record import Segment, faults_from_json, nothing_between, segments_from_json

if TYPE_CHECKING:
    import h5py

__all__ = ["read_hdf5"]

TRUTH = "truth"
CLEAN = "_clean"
LONGEST_UNIT = 80
# Bytes up to which a log is read whole although a window would do: filters and clocks of held channels then see what
# lies around it. A day at 100 Hz in 14 channels.
WHOLE = 10**9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Signal:
    """A dataset that holds one signal, not read yet."""

    name: str
    data: h5py.Dataset
    unit: str | None

    def values(self, rows: slice) -> NDArray[np.float64]:
        """Return the samples of these rows, whichever axis they lie along."""
        place = tuple(rows if n > 1 else 0 for n in self.data.shape)
        return np.ravel(self.data[place]).astype(np.float64)

    def column(self, rows: slice) -> RawColumn:
        return RawColumn(source=self.name, values=self.values(rows), unit=self.unit)


def read_hdf5(path: str, *, group: str | None, span: Span, time_of: TimeOf) -> RawLog:
    """Read an HDF5 or MATLAB v7.3 log; a large one only between the times of `span`, in seconds.

    Parameters
    ----------
    time_of : returns the column that is the time axis, with its unit, None where there is none.

    Raises
    ------
    LogError : truncated or damaged, no signals, no such group, data in other files, more than memory should take.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return _read(path, file, group, span, time_of)
    except (LogError, MemoryError):
        raise
    except Exception as error:  # a damaged file can make the HDF5 library raise anything
        raise LogError(
            f"{path}: damaged or truncated HDF5 file, {first_line(error)}; copy or export it again"
        ) from None


def _read(path: str, file: h5py.File, group: str | None, span: Span, time_of: TimeOf) -> RawLog:
    import h5py

    root = dict(members(path, file))
    truth = root.pop(TRUTH, None)
    truth = truth if isinstance(truth, h5py.Group) else None
    signals, unlike = _signals(path, root)
    groups = [
        name
        for name, node in root.items()
        if isinstance(node, h5py.Group) and name not in signals and name not in unlike and not name.startswith("#")
    ]
    chosen = choose_group(path, group, groups, has_signals=bool(signals))
    node = file if chosen is None else root[chosen]
    if chosen is not None:
        signals, unlike = _signals(path, dict(members(path, node, (file,))))
    clean, _ = ({}, {}) if truth is None else _signals(path, dict(members(path, truth, (file,))))
    clean = {name: signal for name, signal in clean.items() if name.endswith(CLEAN)}
    rate = _rate(path, node, file)
    rows, notes = _rows(path, signals, clean, rate, span, time_of)
    return RawLog(
        columns=[signal.column(rows) for signal in signals.values()],
        sample_rate_hz=rate,
        first_sample=rows.start,
        segments=_segments(path, node) or _segments(path, file),
        filters=_filters(path, node, file),
        faults=None
        if truth is None
        else faults_from_json(text(attribute(truth, "faults")) or "[]", where=f"{path}: /truth faults"),
        clean={name.removesuffix(CLEAN): signal.column(rows) for name, signal in clean.items()},
        notes=(*notes, *(left_out(name, why) for name, why in unlike.items())),
    )


def _signals(path: str, children: Mapping[str, Any]) -> tuple[dict[str, _Signal], dict[str, str]]:
    """Return the signals of a group, and why the other datasets are none, by name.

    A signal is a dataset itself, or a struct with the field `data`.
    """
    import h5py

    signals, unlike = {}, {}
    for name, child in children.items():
        is_struct = isinstance(child, h5py.Group)
        data = member(path, child, "data") if is_struct else child
        if not isinstance(data, h5py.Dataset):
            continue
        why = unfit(data) if not (is_struct and "MATLAB_sparse" in child.attrs) else "is a sparse matrix"
        if why is None:
            unit = _unit(data) or (_unit_of_struct(path, child) if is_struct else None)
            signals[name] = _Signal(name=name, data=data, unit=unit)
        else:
            unlike[name] = why
    return signals, unlike


def _unit(data: h5py.Dataset) -> str | None:
    return text(attribute(data, "units")) or text(attribute(data, "unit")) or None


def _unit_of_struct(path: str, struct: h5py.Group) -> str | None:
    import h5py

    field = member(path, struct, "units")
    if not isinstance(field, h5py.Dataset) or "MATLAB_empty" in field.attrs or not field.size:
        return None
    if field.size > LONGEST_UNIT or not (is_text(field) or field.dtype.kind in "iu"):
        return None
    values = np.ravel(field[()])
    if values.dtype.kind in "iu":
        return "".join(chr(int(code)) for code in values if 0 < code <= 0xFFFF).strip() or None
    return text(values[0]).strip() or None


def _rate(path: str, *nodes: h5py.Group) -> float | None:
    stated = next((node for node in nodes if "sample_rate_hz" in node.attrs), None)
    return None if stated is None else rate_of(path, attribute(stated, "sample_rate_hz"))


def _rows(
    path: str,
    signals: Mapping[str, _Signal],
    clean: Mapping[str, _Signal],
    rate: float | None,
    span: Span,
    time_of: TimeOf,
) -> tuple[slice, tuple[str, ...]]:
    """Return the rows to read: all of them, or those of the window where all are too many; and what to say of it."""
    every = [*signals.values(), *clean.values()]
    for signal in every:
        require_readable(path, signal.name, signal.data)
    sizes = [signal.data.size for signal in every] or [0]
    is_cut = span != (None, None)
    whole = slice(0, max(sizes))
    if 8 * sum(sizes) <= (WHOLE if is_cut else LARGEST):
        return whole, ()
    if not is_cut:
        require_memory(path, len(every), max(sizes), "give --from/--to for a part of it", total=sum(sizes))
    time = time_of([RawColumn(source=s.name, values=np.empty(0), unit=s.unit) for s in signals.values()])
    n = sizes[0] if time is None else signals[time.source].data.size
    for signal in every:
        if signal.data.size != n:
            raise different_length(path, signal.name, signal.data.size, n)
    if time is None and not (rate is not None and 0.0 < rate < np.inf):
        return slice(0, 2), ()  # too few to matter: without a time axis the log is refused later, and by name

    def at(k: int) -> float:
        if time is None:
            return k / float(rate or 1.0)
        return float(to_si(signals[time.source].values(slice(k, k + 1)), time.unit or "", where=path)[0][0])

    rows = _between(path, at, n, span, "sample_rate_hz" if time is None else time.source)
    require_memory(path, len(every), rows.stop - rows.start, "shorten the window")
    return rows, (f"of {n} samples only {rows.stop - rows.start} were read, those around the window",)


def _between(path: str, at: Callable[[int], float], n: int, span: Span, source: str) -> slice:
    """Return the rows of a window and one more to either side, found by bisection of the time axis."""
    first, last = at(0), at(n - 1)
    if not first < last:
        raise LogError(
            f"{path}: '{source}' does not increase, got {first:.6g} s at sample 0 and {last:.6g} s at sample {n - 1}; "
            "sort or mend the time axis"
        )
    start = first if span[0] is None else span[0]
    stop = np.inf if span[1] is None else span[1]
    rounding = 1e-6 * (last - first) / n  # as `FlightLog.window` has it
    begin, end = (bisect_left(range(n), time_s - rounding, key=at) for time_s in (start, stop))
    if end - begin < 2:
        raise nothing_between(path, (start, stop), (first, last))
    return slice(max(begin - 1, 0), min(end + 1, n))


def _filters(path: str, *nodes: h5py.Group) -> tuple[Filter, ...] | None:
    stated = next((node for node in nodes if "filters" in node.attrs), None)
    if stated is None:
        return None
    return filters_from_json(text(attribute(stated, "filters")), where=f"{path}: filters")


def _segments(path: str, node: h5py.Group) -> tuple[Segment, ...]:
    stated = text(attribute(node, "segments"))
    return segments_from_json(stated, where=f"{path}: segments") if stated else ()
