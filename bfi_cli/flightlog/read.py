"""Read a flight log of any supported format into standard channels, SI units and one time axis."""

from __future__ import annotations

import difflib
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..channels import STANDARD, NameMatch, match_name
from ..errors import ConfigError, LogError
from ..units import si_unit, to_si
from .filling import with_filled, with_single_samples
from .phases import airborne_stretches
from .plausible import RIGHT, time_scale
from .quality import is_uniform
from .rates import boot_starts
from .raw import RawColumn, RawLog, Span, TimeOf, different_length
from .record import Channel, FlightLog, FloatArray, StoredChannel, Truth, frozen_array
from .recorder import with_seen_recorder
from .tlog import is_tlog

HDF5 = b"\x89HDF\r\n\x1a\n"
MATLAB = (b"MATLAB 5.0 MAT-file", b"MATLAB 7.0 MAT-file")
ULOG, DATAFLASH, TDMS = b"ULog\x01\x12\x35", b"\xa3\x95\x80", b"TDSm"
FOREIGN = {b"PK\x03\x04": "a zip archive or spreadsheet", b"\x1f\x8b": "gzip data", b"TDSh": "the index of a TDMS file"}
# Seconds. The largest honest times count from 1904 or 1970, 4e9 s; in ms or us without their unit they are beyond this.
LATEST = 1e12
# Of a time axis without a unit: s, and Hz of a flight log, and what its steps may be counted in beside seconds.
LONGEST_STEP, FASTEST_LOG = 5.0, 1000.0
TIME_UNITS = {"ms": 1e-3, "us": 1e-6}
# s between samples. In more an aircraft turns around and climbs or sinks by its approach: nothing follows from that.
SLOWEST_S = 30.0
# Decimals of a rounded time axis, s, and how large they may be beside its step: a missing sample is then a larger jump
# than rounding makes. With fewer times a line tells nothing.
DECIMALS, MOST_ROUNDED, FEWEST_TIMES = (0.1, 0.01, 0.001, 1e-4, 1e-5, 1e-6), 0.65, 20
# Hz. Above every flight recorder; audio is at 2e5.
FASTEST = 1e9


def read_log(
    path: str | Path,
    *,
    group: str | None = None,
    channel_map: Mapping[str, str] | None = None,
    unit_map: Mapping[str, str] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    sample_rate_hz: float | None = None,
    fill_s: float | None = None,
    boot: int | None = None,
) -> FlightLog:
    """Read a flight log; the content of the file, not its name, decides the format.

    Two columns for one standard name: a mapped one wins, then one of exactly that name, then the first; the other
    keeps its own name.

    Parameters
    ----------
    path : HDF5, CSV, MATLAB v5 or v7.3, PX4 ULog, ArduPilot DataFlash, MAVLink tlog, TDMS (with the
        extra `tdms`), or a folder of files of `ulog2csv`.
    group : HDF5 or TDMS group or MATLAB struct that holds the channels, or the log of several in a folder; may be left
        out where there is just one, or where the groups of a TDMS have clocks.
    channel_map : standard name -> name in the file, for names that are not known.
    unit_map : name in the file, or standard name -> its unit, for channels that state none or a wrong one.
    from_s, to_s : the window that is wanted, on the log's time axis. The log may come back longer, so cut it with
        `FlightLog.window`: samples outside are left unread only in a large HDF5 log.
    sample_rate_hz : from which time is counted in a log without a time axis, in place of the rate that its file states.
    fill_s : stretches of NaN of up to this length are interpolated; by default none is.
    boot : which part of a log whose clock starts again, counted from 1; by default the one with the longest flight.

    Returns
    -------
    FlightLog : channels under standard names where known, in SI units and radians, read-only; `notes` says what the
        reader decided, `filters` what the file states or the log shows of the recorder's low-pass.

    Raises
    ------
    ConfigError : a unit of `unit_map` that is unknown or of another quantity.
    LogError : the file cannot be read, or has no usable time axis, channels of different length, an unknown unit, or
        data in other files; or it needs more memory than a log should; or `channel_map` names no column of it; or it
        has a time axis beside `sample_rate_hz`; or `boot` is none of its boots.
    """
    name, channel_map, unit_map = str(path), channel_map or {}, unit_map or {}
    if os.path.exists(name) and not os.path.isfile(name) and not os.path.isdir(name):
        raise LogError(f"{name}: is a device or a pipe, not a file; write the log to a file first")
    if os.path.isdir(name):
        from .ulog2csv import folder_digest, read_folder

        folder = read_folder(name, group=group, channel_map=channel_map, unit_map=unit_map)
        log = _of_boot(folder, boot, name, folder_digest(name), channel_map, unit_map, sample_rate_hz)
        return log if fill_s is None else with_filled(log, fill_s)
    try:
        with open(name, "rb") as file:
            head = file.read(4096)
    except FileNotFoundError:
        raise LogError(f"{name or repr(name)}: no such file; give the path of a log") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise LogError(f"{name!r}: cannot be read, {reason.lower()}; give the path of a log") from None
    time_of = partial(_time_column, channel_map=channel_map, unit_map=unit_map)
    raw = _read(name, head, group, (from_s, to_s), time_of, channel_map, unit_map, sample_rate_hz)
    with open(name, "rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    log = _of_boot(raw, boot, name, sha256, channel_map, unit_map, sample_rate_hz)
    log = with_seen_recorder(with_single_samples(log))
    return log if fill_s is None else with_filled(log, fill_s)


def _read(
    path: str,
    head: bytes,
    group: str | None,
    span: Span,
    time_of: TimeOf,
    channel_map: Mapping[str, str],
    unit_map: Mapping[str, str],
    sample_rate_hz: float | None,
) -> RawLog:
    """Return the columns of a file, in the format that its first bytes show."""
    if not head:
        raise LogError(f"{path}: the file is empty; copy or export it again")
    if any(head.startswith(HDF5, at) for at in (0, 512, 1024, 2048)):
        from .hdf5 import read_hdf5

        return read_hdf5(path, group=group, span=span, time_of=time_of, rate_hz=sample_rate_hz)
    if head.startswith(MATLAB):
        from .matlab import read_matlab

        return read_matlab(path, group=group)
    if head.startswith(TDMS):
        from .tdms import read_tdms

        return read_tdms(path, group=group, channel_map=channel_map, unit_map=unit_map)
    if group is not None:
        raise LogError(f"{path}: no group '{group}', a log of this kind has none; leave out --group")
    if head.startswith(ULOG):
        from .ulog import read_ulog

        return read_ulog(path, channel_map=channel_map, unit_map=unit_map)
    if head.startswith(DATAFLASH):
        from .dataflash import read_dataflash

        return read_dataflash(path, channel_map=channel_map, unit_map=unit_map)
    if is_tlog(head):
        from .tlog import read_tlog

        return read_tlog(path, channel_map=channel_map, unit_map=unit_map)
    for magic, kind in FOREIGN.items():
        if head.startswith(magic):
            raise LogError(f"{path}: {kind} cannot be read; convert it to CSV or HDF5")
    if b"\0" in head:
        raise LogError(f"{path}: neither HDF5, MATLAB v5 or v7.3, nor text; convert it to CSV or HDF5")
    from .text import read_csv
    from .ulog2csv import is_topic_file, read_topic_file

    return read_topic_file(path, channel_map=channel_map) if is_topic_file(path) else read_csv(path)


def _of_boot(
    raw: RawLog,
    boot: int | None,
    path: str,
    sha256: str,
    channel_map: Mapping[str, str],
    unit_map: Mapping[str, str],
    sample_rate_hz: float | None,
) -> FlightLog:
    """Return the log of a file; of one whose clock starts again the boot that is asked for, or that flies longest."""
    time = _time_column(raw.columns, channel_map, unit_map) if sample_rate_hz is None else None
    boots = raw.boots or _boots(raw, time)
    if boot is not None and not 1 <= boot <= len(boots):
        raise LogError(f"{path}: --boot {boot}: the log has {len(boots)}; give one of them, or leave it out")
    if len(boots) == 1:
        return _assemble(boots[0], path, sha256, channel_map, unit_map, sample_rate_hz)
    logs = [_assemble(one, path, sha256, channel_map, unit_map, sample_rate_hz) for one in boots]
    flown = [sum(to_s - from_s for from_s, to_s in airborne_stretches(log)) for log in logs]
    lengths = [float(log.time_s[-1] - log.time_s[0]) for log in logs]
    chosen = max(range(len(logs)), key=lambda k: (flown[k], lengths[k])) if boot is None else boot - 1
    others = ", ".join(
        f"{k + 1} ({log.time_s[0]:.6g} to {log.time_s[-1]:.6g} s, {flown[k]:.0f} s of it in flight)"
        for k, log in enumerate(logs)
        if k != chosen
    )
    why = "as asked for" if boot is not None else "the longest in flight" if flown[chosen] else "the longest"
    note = (
        f"the clock of the log starts again: boot {chosen + 1} of {len(logs)} is read, {why}; not read: {others}; "
        "--boot N reads another"
    )
    return replace(logs[chosen], notes=(note, *logs[chosen].notes))


def _boots(raw: RawLog, time: RawColumn | None) -> tuple[RawLog, ...]:
    """Return the columns between the restarts of the clock, those of less than two samples left out."""
    if time is None:
        return (raw,)
    times = time.values if time.read is None or time.rows is None else time.read(time.rows)
    seconds = 1.0 if not time.unit or si_unit(time.unit) != "s" else float(to_si(1.0, time.unit, where="")[0])
    starts = boot_starts(seconds * times)
    parts = [slice(a, b) for a, b in pairwise([*starts, times.size]) if b - a > 1]
    return tuple(_part(raw, one) for one in parts) if len(starts) > 1 and parts else (raw,)


def _part(raw: RawLog, rows: slice) -> RawLog:
    """Return some of the rows of a file."""

    def cut(column: RawColumn) -> RawColumn:
        if column.rows is not None:
            first = column.rows.start
            return replace(column, rows=slice(first + rows.start, first + rows.stop))
        return replace(column, values=column.values[rows])

    clean = {name: cut(column) for name, column in raw.clean.items()}
    return replace(raw, columns=[cut(column) for column in raw.columns], clean=clean)


def _assemble(
    raw: RawLog,
    path: str,
    sha256: str,
    channel_map: Mapping[str, str],
    unit_map: Mapping[str, str],
    sample_rate_hz: float | None,
) -> FlightLog:
    """Name the columns, convert them to SI and check the time axis, or count it from the rate that is given."""
    columns = {column.source: column for column in raw.columns}
    _check_maps(path, columns, channel_map, unit_map)
    taken: dict[str, Channel] = {}
    notes = list(raw.notes)
    for column, match in _by_precedence(columns, channel_map, unit_map):
        stated = column.unit if column.unit is not None else (match.unit if match else None)
        name = column.source
        own = columns[name].unit
        if own and own != stated and si_unit(own) is not None:
            notes.append(f"'{name}' is in '{own}' by the file and was read in '{stated}', as --unit asks")
        if match is not None:
            if match.rank >= 0 and not _fits(match.name, stated):
                notes.append(f"'{name}' is in '{stated}', so it is not taken for {match.name}")
            elif match.name in taken:
                notes.append(f"'{name}' is a second {match.name}; '{taken[match.name].source}' is used for it")
            else:
                name = match.name
        spare = (name if i == 1 else f"{name}_{i}" for i in range(1, len(taken) + 2))
        name = next(candidate for candidate in spare if candidate not in taken)
        if name == "time" and stated is None:
            stated, assumed = _unit_of_time(path, column)
            notes += assumed
        known = stated
        if stated is not None and si_unit(stated) is None and name not in STANDARD:
            notes.append(f"'{column.source}' is in '{stated}', an unknown unit; its values are kept as they are")
            known = None
        if column.read is not None and column.rows is not None and name == "time":
            column = replace(column, values=column.read(column.rows), read=None)
        taken[name] = _channel(path, name, column, known, stated)
    if not taken.keys() - {"time"}:
        raise LogError(f"{path}: no channels beside time; give a log with a column or dataset for each")
    time = taken.pop("time", None)
    if time is not None and sample_rate_hz is not None:
        raise LogError(
            f"{path}: --sample-rate {sample_rate_hz:g}: it is for logs without a time axis, and the log has "
            f"'{time.source}'; leave it out"
        )
    if time is not None:
        time_s, rounded = _without_rounding(_checked_time(path, time), time.source)
        notes += rounded
    else:
        rate_hz = raw.sample_rate_hz if sample_rate_hz is None else sample_rate_hz
        time_s = _counted_time(path, taken, raw, rate_hz)
        source = "sample_rate_hz =" if sample_rate_hz is None else "--sample-rate"
        notes.append(f"time is counted from {source} {rate_hz:g} Hz")
    order = [column.source for column in raw.columns]
    channels = dict(sorted(taken.items(), key=lambda item: order.index(item[1].source)))
    for channel in channels.values():
        if channel.n_samples != time_s.size:
            raise different_length(path, channel.source, channel.n_samples, time_s.size)
    bare = [name for name, channel in channels.items() if channel.source_unit is None and name in STANDARD]
    units = ", ".join(f"{name} ({STANDARD[name].unit})" for name in bare if STANDARD[name].unit != "1")
    if units:
        notes.append(
            f"no unit is stated for {units}: the one in brackets is assumed, give another with --unit NAME=UNIT"
        )
    clean = {}
    for name, column in raw.clean.items() if raw.faults is not None else ():
        values, _ = to_si(column.values, column.unit or "", where=f"{path}: truth of '{name}'")
        if values.size != time_s.size:
            raise different_length(path, f"{name}_clean", values.size, time_s.size)
        clean[name] = frozen_array(values)
    truth = None if raw.faults is None else Truth(faults=raw.faults, clean=clean)
    log = FlightLog(
        path=path,
        time_s=time_s,
        channels=channels,
        truth=truth,
        segments=raw.segments,
        filters=raw.filters,
        sha256=sha256,
        notes=tuple(notes),
    )
    if time is not None and not {"time", time.source} & unit_map.keys():
        _check_clock(log, time.source)
    return log


def _check_clock(log: FlightLog, source: str) -> None:
    """Check that the seconds of a time axis are seconds, by what an aircraft does in them.

    Raises
    ------
    LogError : they are not.
    """
    step = float(np.median(np.diff(log.time_s)))
    if step > SLOWEST_S and log.n_samples >= FEWEST_TIMES:
        fit = [unit for unit, one in TIME_UNITS.items() if 1.0 / FASTEST_LOG <= one * step <= LONGEST_STEP]
        advice = f"state its unit with --unit {source}={fit[0]}" if fit else "mend it"
        raise LogError(f"{log.path}: '{source}' has steps of {step:.6g} s, which no recorder of a flight has; {advice}")
    scale = time_scale(log)
    if scale is None:
        return
    if scale < 0.0:
        raise LogError(
            f"{log.path}: the record runs backwards: altitude and roll change {scale:.3g} times as fast as their rates "
            "say; reverse its samples"
        )
    unit = next((unit for unit, one in TIME_UNITS.items() if 1.0 / RIGHT < scale / one < RIGHT), None)
    advice = f"multiply it by {scale:.3g}" if unit is None else f"state its unit with --unit {source}={unit}"
    raise LogError(
        f"{log.path}: a second of '{source}' is {scale:.3g} s: altitude and roll change so many times as fast as their "
        f"rates say; {advice}"
    )


def _channel(path: str, name: str, column: RawColumn, unit: str | None, stated: str | None) -> Channel:
    """Return a column as a channel in SI units, read-only; one that is left in its file stays there."""
    where, read = f"{path}: '{column.source}'", column.read
    values, si = to_si(column.values, unit or "", where=where)
    values.setflags(write=False)
    if read is None or column.rows is None:
        return Channel(
            name=name,
            values=values,
            unit=si,
            source=column.source,
            source_unit=stated,
            own_rate_hz=column.rate_hz,
        )

    def in_si(rows: slice) -> FloatArray:
        part = read(rows)
        part = to_si(part, unit, where=where)[0] if unit and si_unit(unit) != unit else part
        part.setflags(write=False)
        return part

    return StoredChannel(name=name, read=in_si, rows=column.rows, unit=si, source=column.source, source_unit=stated)


def _time_column(
    columns: Sequence[RawColumn], channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> RawColumn | None:
    """Return the column that `_assemble` takes for the time axis, with its unit; None where there is none."""
    for column, match in _by_precedence({column.source: column for column in columns}, channel_map, unit_map):
        if match is not None and match.name == "time":
            stated = column.unit if column.unit is not None else match.unit
            if match.rank < 0 or _fits("time", stated):
                return replace(column, unit=stated)
    return None


def _check_maps(
    path: str, columns: Mapping[str, RawColumn], channel_map: Mapping[str, str], unit_map: Mapping[str, str]
) -> None:
    """Check that the columns the user names exist, and that the units fit them."""
    has = ", ".join(sorted(columns))
    for name, source in channel_map.items():
        if source not in columns:
            close = difflib.get_close_matches(source, columns, n=1)
            hint = f"did you mean '{close[0]}'?" if close else f"the log has: {has}"
            raise LogError(f"{path}: --channel {name}={source}: no channel '{source}'; {hint}")
    names = {*columns, *channel_map, *(m.name for m in map(match_name, columns) if m)}
    for name, unit in unit_map.items():
        where = f"--unit {name}={unit}"
        if name not in names:
            raise LogError(f"{path}: {where}: no channel '{name}'; the log has: {has}")
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
        if column.channel is not None:
            match = NameMatch(name=column.channel, unit=None, rank=0)
        if source in wanted:
            match = NameMatch(name=wanted[source], unit=match.unit if match else None, rank=-1)
        given = unit_map.get(source) or (unit_map.get(match.name) if match else None)
        paired.append((replace(column, unit=given) if given else column, match))
    return sorted(paired, key=lambda pair: pair[1].rank if pair[1] else 9)


def _fits(name: str, unit: str | None) -> bool:
    """Say whether a unit can be that of a standard channel, as far as the unit is known."""
    known = si_unit(unit) if unit else None
    return known is None or known in (STANDARD[name].unit, "1") or STANDARD[name].unit == "1"


def _unit_of_time(path: str, time: RawColumn) -> tuple[str | None, tuple[str, ...]]:
    """Return the unit of a time axis that states none, as its step tells it, and a note where that is not seconds.

    Raises
    ------
    LogError : the step suits two units.
    """
    step = np.abs(np.diff(time.values))
    step = step[np.isfinite(step) & (step > 0.0)]
    typical = float(np.median(step)) if step.size else 0.0
    if typical <= LONGEST_STEP:
        return None, ()
    fit = [unit for unit, one in TIME_UNITS.items() if 1.0 / FASTEST_LOG <= one * typical <= LONGEST_STEP]
    if len(fit) != 1:
        suits = " and ".join(f"{unit} ({1.0 / (TIME_UNITS[unit] * typical):.4g} Hz)" for unit in fit)
        raise LogError(
            f"{path}: '{time.source}' states no unit, and its steps of {typical:.6g} suit {suits or 'no flight'}; "
            f"state it with --unit {time.source}={fit[0] if fit else 's'}"
        )
    rate = 1.0 / (TIME_UNITS[fit[0]] * typical)
    return fit[0], (
        f"'{time.source}' states no unit; its steps of {typical:.6g} are taken for {fit[0]} ({rate:.4g} Hz), give "
        f"another with --unit {time.source}=UNIT",
    )


def _checked_time(path: str, channel: Channel) -> FloatArray:
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


def _without_rounding(time_s: FloatArray, source: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the even times that a time axis of few decimals stands for, and a note; others as they are.

    The straight line through the times is taken where no time is further from it than rounding to their decimals
    explains.
    """
    if time_s.size < FEWEST_TIMES or is_uniform(time_s):
        return time_s, ()
    from_start = time_s - time_s[0]
    quantum = next(
        (one for one in DECIMALS if np.max(np.abs(from_start / one - np.round(from_start / one))) < 1e-3), None
    )
    count = np.arange(time_s.size) - 0.5 * (time_s.size - 1)
    step = float(count @ from_start / (count @ count))
    if quantum is None or quantum > MOST_ROUNDED * step:
        return time_s, ()
    line = from_start.mean() + step * count
    # Rounding to the nearest or down; half a quantum more for the line through rounded times.
    if np.ptp(from_start - line) > 1.5 * quantum:
        return time_s, ()
    note = f"the times of '{source}' are rounded to {quantum:g} s; their even steps of {step:.6g} s are taken"
    return frozen_array(time_s[0] + line), (note,)


def _counted_time(path: str, channels: Mapping[str, Channel], raw: RawLog, rate_hz: float | None) -> FloatArray:
    if rate_hz is None:
        raise LogError(
            f"{path}: no time axis, got neither a channel 'time' nor an attribute sample_rate_hz; the log has: "
            f"{', '.join(sorted(channels))}; map one with --channel time=NAME, or give --sample-rate HZ"
        )
    samples = raw.first_sample + np.arange(next(iter(channels.values())).n_samples)
    if not (0.0 < rate_hz <= FASTEST) or samples[-1] / rate_hz > LATEST:
        raise LogError(f"{path}: sample_rate_hz is no rate of a recorder, got {rate_hz:g} Hz; mend it")
    return frozen_array(samples / rate_hz)
