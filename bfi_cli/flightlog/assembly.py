"""From the columns of a file to a flight log: standard names, SI units, one time axis."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..channels import STANDARD, NameMatch, match_name
from ..errors import ConfigError, LogError
from ..units import si_unit, to_si
from .raw import RawColumn, RawLog, different_length
from .record import Channel, FlightLog, FloatArray, Truth, frozen_array

__all__ = ["assemble", "time_column"]

# Seconds. The largest honest times count from 1904 or 1970, 4e9 s; in ms or us without their unit they are beyond this.
LATEST = 1e12
# Hz. Above every flight recorder; audio is at 2e5.
FASTEST = 1e9


@dataclass(slots=True, kw_only=True)
class _Naming:
    """Which column became which channel, and what there is to say about it."""

    path: str
    taken: dict[str, Channel] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def assemble(
    raw: RawLog, *, path: str, sha256: str, channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> FlightLog:
    """Name the columns, convert them to SI and check the time axis.

    Two columns for one standard name: a mapped one wins, then one of exactly that name, then the first; the other
    keeps its own name.

    Raises
    ------
    ConfigError : a unit of `unit_map` that is unknown or of another quantity.
    LogError : a mapped column that does not exist, an unknown unit, no time, time not increasing, lengths that differ.
    """
    columns = {column.source: column for column in raw.columns}
    _check_maps(path, columns, channel_map, unit_map)
    naming = _Naming(path=path, notes=list(raw.notes))
    for column, match in _by_precedence(columns, channel_map, unit_map):
        _place(naming, column, match)
    if not naming.taken.keys() - {"time"}:
        raise LogError(f"{path}: no channels beside time; give a log with a column or dataset for each")
    time_s = _time(path, naming, raw)
    order = [column.source for column in raw.columns]
    channels = dict(sorted(naming.taken.items(), key=lambda item: order.index(item[1].source)))
    for channel in channels.values():
        if channel.values.size != time_s.size:
            raise different_length(path, channel.source, channel.values.size, time_s.size)
    bare = [name for name, channel in channels.items() if channel.source_unit is None and name in STANDARD]
    units = ", ".join(f"{name} ({STANDARD[name].unit})" for name in bare if STANDARD[name].unit != "1")
    if units:
        naming.notes.append(
            f"no unit is stated for {units}; these are taken, another one is stated with --unit NAME=UNIT"
        )
    clean = {}
    for name, column in raw.clean.items() if raw.faults is not None else ():
        values, _ = to_si(column.values, column.unit or "", where=f"{path}: truth of '{name}'")
        if values.size != time_s.size:
            raise different_length(path, f"{name}_clean", values.size, time_s.size)
        clean[name] = frozen_array(values)
    return FlightLog(
        path=path,
        time_s=time_s,
        channels=channels,
        truth=None if raw.faults is None else Truth(faults=raw.faults, clean=clean),
        segments=raw.segments,
        filters=raw.filters,
        sha256=sha256,
        notes=tuple(naming.notes),
    )


def time_column(
    columns: Sequence[RawColumn], channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> RawColumn | None:
    """Return the column that `assemble` takes for the time axis, with its unit; None where there is none."""
    for column, match in _by_precedence({column.source: column for column in columns}, channel_map, unit_map):
        if match is not None and match.name == "time":
            stated = column.unit if column.unit is not None else match.unit
            if match.rank < 0 or _fits("time", stated):
                return replace(column, unit=stated)
    return None


def _check_maps(
    path: str, columns: Mapping[str, RawColumn], channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> None:
    has = ", ".join(sorted(columns))
    for name, source in channel_map.items():
        if source not in columns:
            close = difflib.get_close_matches(source, columns, n=1)
            hint = f"did you mean '{close[0]}'?" if close else f"the log has: {has}"
            raise LogError(f"{path}: --channel {name}={source}: no channel '{source}'; {hint}")
    names = {*columns, *channel_map, *(m.name for m in map(match_name, columns) if m)}
    for name in unit_map:
        if name not in names:
            raise LogError(f"{path}: --unit {name}={unit_map[name]}: no channel '{name}'; the log has: {has}")
        _check_unit(name, unit_map[name])


def _check_unit(name: str, unit: str) -> None:
    """Check the unit the user gives to a channel, by its name in the file or its standard name."""
    where = f"--unit {name}={unit}"
    try:
        _, si = to_si(0.0, unit, where=where)
    except LogError as error:
        raise ConfigError(str(error)) from None
    match = match_name(name)
    if match is not None and not _fits(match.name, unit):
        expected = STANDARD[match.name].unit
        raise ConfigError(f"{where}: '{match.name}' is in {expected}, got a unit of {si}; give one like {expected}")


def _by_precedence(
    columns: Mapping[str, RawColumn], channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> list[tuple[RawColumn, NameMatch | None]]:
    """Pair columns with their standard names, the ones with the first claim on a name first."""
    wanted = {source: name for name, source in channel_map.items()}
    paired = []
    for source, column in columns.items():
        match = match_name(source)
        if source in wanted:
            match = NameMatch(name=wanted[source], unit=match.unit if match else None, rank=-1)
        given = unit_map.get(source) or (unit_map.get(match.name) if match else None)
        paired.append((replace(column, unit=given) if given else column, match))
    return sorted(paired, key=lambda pair: pair[1].rank if pair[1] else 9)


def _place(naming: _Naming, column: RawColumn, match: NameMatch | None) -> None:
    stated = column.unit if column.unit is not None else (match.unit if match else None)
    name = column.source
    if match is not None:
        if match.rank >= 0 and not _fits(match.name, stated):
            naming.notes.append(f"'{name}' is in '{stated}', so it is not taken for {match.name}")
        elif match.name in naming.taken:
            winner = naming.taken[match.name].source
            naming.notes.append(f"'{name}' is {match.name} too; '{winner}' is used")
        else:
            name = match.name
    spare = (name if i == 1 else f"{name}_{i}" for i in range(1, len(naming.taken) + 2))
    name = next(candidate for candidate in spare if candidate not in naming.taken)
    naming.taken[name] = _channel(naming, column, stated, name)


def _fits(name: str, unit: str | None) -> bool:
    known = si_unit(unit) if unit else None
    return known is None or known in (STANDARD[name].unit, "1") or STANDARD[name].unit == "1"


def _channel(naming: _Naming, column: RawColumn, stated: str | None, name: str) -> Channel:
    where = f"{naming.path}: '{column.source}'"
    if stated is not None and si_unit(stated) is None and name not in STANDARD:
        naming.notes.append(f"'{column.source}' is in '{stated}', an unknown unit; its values are kept as they are")
        values, unit = column.values, ""
    else:
        values, unit = to_si(column.values, stated or "", where=where)
    return Channel(name=name, values=frozen_array(values), unit=unit, source=column.source, source_unit=stated)


def _time(path: str, naming: _Naming, raw: RawLog) -> FloatArray:
    channel = naming.taken.pop("time", None)
    if channel is None:
        return _counted(path, naming, raw)
    time_s, source = channel.values, channel.source
    bad = np.flatnonzero(~np.isfinite(time_s))
    if bad.size:
        raise LogError(f"{path}: '{source}' is not a number at sample {bad[0]} ({bad.size} in all); mend the time axis")
    if time_s.size < 2:
        raise LogError(f"{path}: {time_s.size} samples, at least 2 are needed; give a longer log")
    late = np.flatnonzero(np.abs(time_s) > LATEST)
    if late.size:
        raise LogError(
            f"{path}: '{source}' is no time of a flight at sample {late[0]}, got {time_s[late[0]]:.6g} s; state its "
            f"unit with --unit {source}=us, or mend the time axis"
        )
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if back.size:
        k = int(back[0]) + 1
        raise LogError(
            f"{path}: '{source}' does not increase at sample {k} ({time_s[k]:.6g} s after {time_s[k - 1]:.6g} s, "
            f"{back.size} such steps); sort or mend the time axis"
        )
    return time_s


def _counted(path: str, naming: _Naming, raw: RawLog) -> FloatArray:
    rate_hz = raw.sample_rate_hz
    if rate_hz is None:
        has = ", ".join(sorted(naming.taken))
        raise LogError(
            f"{path}: no time, got neither a channel 'time' nor an attribute sample_rate_hz; the log has: {has}; "
            "map one with --channel time=NAME"
        )
    count = next(iter(naming.taken.values())).values.size
    rows = np.arange(raw.first_sample, raw.first_sample + count)
    if not (0.0 < rate_hz <= FASTEST) or rows[-1] / rate_hz > LATEST:
        raise LogError(f"{path}: sample_rate_hz is no rate of a recorder, got {rate_hz:g} Hz; mend it")
    naming.notes.append(f"time is counted from sample_rate_hz = {rate_hz:g} Hz")
    return frozen_array(rows / rate_hz)
