"""Read a flight log of any supported format into standard channels, SI units and one time axis."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..epoch import Epoch, epoch_since_1970
from ..errors import ConfigError, LogError
from ..notes import Note
from ..quantities.channels import STANDARD, match_name, meant_channel, si_unit, to_si
from ..quantities.text import instant
from .axis import FEWEST_TIMES, LATEST, axis_of, boot_starts
from .derived import with_quantities
from .formats import digest_of_log, read_columns
from .phases import airborne_stretches
from .plausible import NORMAL, RIGHT, Convention, assumed_units, sentence_of, time_scale, with_conventions
from .quality import with_seen_recorder
from .rates import on_one_clock
from .raw import (
    RawLog,
    ReadRequest,
    by_precedence,
    different_length,
    fits,
    most_common,
    time_column,
    unit_of,
    unit_source,
    unlike_time,
    why_matched,
)
from .record import Channel, FlightLog, FloatArray, StoredChannel, Track, Truth, frozen_array
from .resampling import with_filled, with_short_gaps

# Longest step, s, and highest rate, Hz, of a time axis without a unit, and its units beside seconds.
LONGEST_STEP, FASTEST_LOG = 5.0, 1000.0
TIME_UNITS = {"ms": 1e-3, "us": 1e-6}
# Longest step of a usable log, s: in more an aircraft turns around, or flies its whole approach.
SLOWEST_S = 30.0
# Highest rate of a time axis, Hz: vibrations are recorded at 1e5 Hz.
FASTEST_CLOCK = 1e6
# Limit of sample_rate_hz, Hz; audio has 2e5.
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
    columns: Sequence[str] = (),
    keep: Sequence[str] = (),
    fill_s: float | None = None,
    boot: int | None = None,
) -> FlightLog:
    """Read a flight log; the content of the file, not its name, decides the format.

    Of two columns for one standard name a mapped column wins, then a column of exactly that name, then the first; the
    other keeps its name in the file.

    Parameters
    ----------
    path : HDF5 (also of FlightDataAccessor), CSV (also in the layouts of recorders), IGC, MATLAB v5 or v7.3, PX4 ULog,
        ArduPilot DataFlash, MAVLink tlog, TDMS and MCAP (with the extras `tdms` and `mcap`), or a folder of files of
        `ulog2csv`.
    group : HDF5 or TDMS group or MATLAB struct that holds the channels, or the log of several in a folder; may be left
        out where there is just one, or where the groups of a TDMS have clocks.
    channel_map : standard name -> name in the file, for names that are not known.
    unit_map : name in the file, or standard name -> its unit, for channels that state none or a wrong one.
    from_s, to_s : the window that is wanted, on the log's time axis. The log may come back longer, so cut it with
        `FlightLog.window`: samples outside are left unread only in a large HDF5 log.
    sample_rate_hz : from which time is counted in a log without a time axis, in place of the rate that its file states.
    columns : names of the columns of a table of numbers without a header line.
    keep : channels of another number of samples than the time axis, which count as even over the same time.
    fill_s : stretches of NaN of up to this length, s, are interpolated; by default none.
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
    name = str(path)
    asked = ReadRequest(
        group=group,
        channel_map=channel_map or {},
        unit_map=unit_map or {},
        span=(from_s, to_s),
        sample_rate_hz=sample_rate_hz,
        columns=tuple(columns),
        keep=tuple(keep),
    )
    log = with_short_gaps(_log_of_boot(name, read_columns(name, asked), asked, digest_of_log(name), boot))
    if not os.path.isdir(name):
        log = with_seen_recorder(log)
    log = with_quantities(log, asked.channel_map)
    return log if fill_s is None else with_filled(log, fill_s)


def _log_of_boot(path: str, raw: RawLog, asked: ReadRequest, sha256: str, boot: int | None) -> FlightLog:
    """Return the log of a file, or of one of its boots where the clock starts again: number `boot`, or the longest."""
    boots = _boots(path, raw, asked)
    if boot is not None and not 1 <= boot <= len(boots):
        raise LogError(f"{path}: --boot {boot}: the log has {len(boots)}; give one of them, or leave it out")
    logs = [_assemble(path, part, asked, sha256) for part in boots]
    if len(logs) == 1:
        return logs[0]
    flown = [sum(to_s - from_s for from_s, to_s in airborne_stretches(log)) for log in logs]
    lengths = [float(log.time_s[-1] - log.time_s[0]) for log in logs]
    chosen = max(range(len(logs)), key=lambda k: (flown[k], lengths[k])) if boot is None else boot - 1
    others = ", ".join(
        f"{k + 1} ({instant(log.time_s[0])} to {instant(log.time_s[-1])} s, {flown[k]:.0f} s of it in flight)"
        for k, log in enumerate(logs)
        if k != chosen
    )
    why = "as asked for" if boot is not None else "the longest in flight" if flown[chosen] else "the longest"
    note = Note.method(
        f"the clock of the log starts again: boot {chosen + 1} of {len(logs)} is read, {why}; not read: {others}; "
        "--boot N reads another"
    )
    return replace(logs[chosen], notes=(note, *logs[chosen].notes))


def _boots(path: str, raw: RawLog, asked: ReadRequest) -> Sequence[RawLog]:
    """Return the parts of a log between restarts of the clock, each on one time axis, those of one sample left out.

    Raises
    ------
    LogError : see `rates.on_one_clock`; no boot has channels.
    """
    if raw.boots:
        boots = []
        for boot in raw.boots:
            # A boot of too few messages is no log.
            with contextlib.suppress(LogError):
                boots.append(on_one_clock(path, boot, asked))
        if not boots:
            raise LogError(
                f"{path}: none of its {len(raw.boots)} boots has channels; give a log that was recorded in flight"
            )
        return boots
    if raw.faults is None:
        raw = on_one_clock(path, raw, asked)
    time = time_column(raw.columns, asked) if asked.sample_rate_hz is None else None
    if time is None:
        return (raw,)
    times = time.here().values
    seconds = 1.0 if not time.unit or si_unit(time.unit) != "s" else float(to_si(1.0, time.unit, where="")[0])
    starts = boot_starts(seconds * times)
    parts = [slice(a, b) for a, b in pairwise([*starts, times.size]) if b - a > 1]
    if len(starts) == 1 or not parts:
        return (raw,)
    return tuple(
        replace(
            raw,
            columns=[column.part(rows) for column in raw.columns],
            clean={name: column.part(rows) for name, column in raw.clean.items()},
        )
        for rows in parts
    )


def _assemble(path: str, raw: RawLog, asked: ReadRequest, sha256: str) -> FlightLog:
    """Return the log of columns: named, in SI, with a checked time axis, or one counted from the rate."""
    _check_maps(path, raw.columns, asked)
    raw = _without_unknown_units(raw, asked)
    taken, columns, notes = _named(path, raw, asked)
    if not taken.keys() - {"time"}:
        why = "".join(f", '{name}' {reason.replace(',;', ';')}" for name, reason in list(raw.left_out.items())[:3])
        raise LogError(f"{path}: no channels beside time{why}; give a log with a column or dataset for each")
    time = taken.pop("time", None)
    order, epoch = [column.source for column in raw.columns], None
    channels = dict(sorted(taken.items(), key=lambda item: order.index(item[1].source)))
    if time is None:
        rate_hz = raw.sample_rate_hz if asked.sample_rate_hz is None else asked.sample_rate_hz
        time_s = _counted_time(path, channels, raw, rate_hz)
        source = "sample_rate_hz =" if asked.sample_rate_hz is None else "--sample-rate"
        notes.append(Note.method(f"time is counted from {source} {rate_hz:g} Hz"))
    elif asked.sample_rate_hz is not None:
        raise LogError(
            f"{path}: --sample-rate {asked.sample_rate_hz:g}: it is for logs without a time axis, and the log has "
            f"'{time.source}'; leave it out"
        )
    else:
        axis = axis_of(path, time.source, time.values)
        time_s = axis.time_s
        epoch, on_epoch = _epoch_of(raw, time.source, time_s)
        notes += (*on_epoch, *axis.notes)
        if axis.rows is not None:
            alike = {name for name, channel in channels.items() if channel.n_samples == time.n_samples}
            channels |= {name: channels[name].taken(axis.rows) for name in alike}
            clean = {name: replace(track, values=track.here().values[axis.rows]) for name, track in raw.clean.items()}
            raw = replace(raw, clean=clean)
    channels, spread = _with_spread(path, channels, time_s, asked)
    notes += spread
    left_out = {**raw.left_out, **_unlike_time(path, channels, time_s.size, asked)}
    channels = {name: channel for name, channel in channels.items() if channel.source not in left_out}
    for name, why in left_out.items():
        reason, semicolon, advice = why.partition("; ")
        notes.append(Note.method(f"'{name}' {reason} and is left out{semicolon}{advice}"))
    channels, convention, on_convention = with_conventions(channels)
    notes += on_convention
    if units := assumed_units(channels.values()):
        notes.append(
            Note.advice(
                f"no unit is stated for {units}: the one in brackets is assumed, give another with --unit NAME=UNIT"
            )
        )
    log = FlightLog(
        path=path,
        time_s=time_s,
        channels=channels,
        truth=_truth(path, raw, time_s.size, convention),
        segments=raw.segments,
        filters=raw.filters,
        epoch=epoch,
        sha256=sha256,
        notes=tuple(notes),
        left_out=left_out,
        columns=_explained(columns, left_out, convention),
    )
    if time is not None and not {"time", time.source} & asked.unit_map.keys():
        _check_clock(log, time.source)
    return log


def _epoch_of(raw: RawLog, source: str, time_s: FloatArray) -> tuple[Epoch | None, list[Note]]:
    """Return from when the time axis of the name `source` counts, and a note on it if that is of a known day."""
    stated = next(column.epoch for column in raw.columns if column.source == source)
    epoch = stated or epoch_since_1970(float(time_s[0]), float(time_s[-1]))
    if epoch is None or not epoch.is_dated or epoch.since_1970_s == 0.0:
        return epoch, []
    at = f"{epoch.date(0.0)} {epoch.time_of_day(0.0)}" if epoch.midnight_s else f"midnight of {epoch.date(0.0)}"
    return epoch, [Note.method(f"time counts from {at}{' UTC' * epoch.is_utc}")]


def _unlike_time(path: str, channels: Mapping[str, Channel], n_times: int, asked: ReadRequest) -> dict[str, str]:
    """Return by source which channels have another number of samples than the time axis, and why each is left out.

    Raises
    ------
    LogError : they are most of all channels, or one of them was asked for.
    """
    unlike = [channel for channel in channels.values() if channel.n_samples != n_times]
    for channel in unlike:
        if channel.source in asked.sources or 2 * len(unlike) > len(channels):
            raise different_length(path, channel.source, channel.n_samples, n_times)
    return {channel.source: unlike_time(channel.source, channel.n_samples, n_times) for channel in unlike}


def _truth(path: str, raw: RawLog, n_samples: int, convention: Convention | None) -> Truth | None:
    """Return the faults and clean signals of a log in SI units, None of one without.

    Raises
    ------
    LogError : a clean signal of another length.
    """
    if raw.faults is None:
        return None
    clean = {}
    for name, column in raw.clean.items():
        values, _ = to_si(column.values, column.unit or "", where=f"{path}: truth of '{name}'")
        if values.size != n_samples:
            raise different_length(path, f"{name}_clean", values.size, n_samples)
        clean[name] = convention.change(values) if name == NORMAL and convention else frozen_array(values)
    return Truth(faults=raw.faults, clean=clean, ordinary=raw.ordinary)


def _explained(
    columns: Sequence[Track], left_out: Mapping[str, str], convention: Convention | None
) -> tuple[Track, ...]:
    """Return what the columns of a file are, with the convention of the normal acceleration, those left out last."""
    kept = [column for column in columns if column.source not in left_out]
    for i, column in enumerate(kept):
        if column.channel == NORMAL and convention is not None:
            kept[i] = replace(column, why=f"{column.why}; it {sentence_of(convention)}")
    return (
        *kept,
        *(Track(source=source, why=f"left out, as it {why}", unit_from="") for source, why in left_out.items()),
    )


def _with_spread(
    path: str, channels: dict[str, Channel], time_s: FloatArray, asked: ReadRequest
) -> tuple[dict[str, Channel], list[Note]]:
    """Return the channels, those of `asked.keep` interpolated as even samples over the log, and notes on these.

    Raises
    ------
    LogError : a channel to keep is not in the log.
    """
    notes, made = list[Note](), dict(channels)
    for wanted in asked.keep:
        names = [name for name, channel in channels.items() if wanted in (name, channel.source)]
        if not names:
            raise LogError(f"{path}: --keep {wanted}: no such channel; the log has: {', '.join(sorted(channels))}")
        (name,) = names
        n, n_times = channels[name].n_samples, time_s.size
        if n == n_times:
            continue
        # Each of the n samples stands for the time of n_times / n samples of the log.
        even_s = time_s[0] + np.arange(n) * (time_s[-1] - time_s[0]) / max(n_times - 1, 1) * (n_times / n)
        values = np.interp(time_s, even_s, channels[name].values)
        made[name] = replace(channels[name], values=frozen_array(values))
        notes.append(
            Note.method(
                f"'{channels[name].source}' has {n} samples, the time axis {n_times}: they are taken as even over the "
                "log and joined by lines, as --keep asks"
            )
        )
    return made, notes


def _without_unknown_units(raw: RawLog, asked: ReadRequest) -> RawLog:
    """Return the log without the columns that would be standard channels but for a unit that nobody knows."""
    left_out = dict(raw.left_out)
    for column, match in by_precedence(raw.columns, asked):
        if match is None or match.rank < 0 or match.name == "time" or unit_source(column, match, asked) == "--unit":
            continue
        unit, name = unit_of(column, match, asked), column.source
        try:
            to_si(0.0, unit or "")
        except LogError as error:
            _, _, hint = str(error).partition("; ")
            left_out[name] = f"is in '{unit}', an unknown unit,; state it with --unit {name}=UNIT, {hint}"
    return replace(raw, columns=[column for column in raw.columns if column.source not in left_out], left_out=left_out)


def _named(path: str, raw: RawLog, asked: ReadRequest) -> tuple[dict[str, Channel], list[Track], list[Note]]:
    """Return the columns as channels by their names in the log, the time axis among them, what each is, and notes."""
    taken, columns, notes = dict[str, Channel](), list[Track](), list(raw.notes)
    for column, match in by_precedence(raw.columns, asked):
        name, stated, in_file = column.source, unit_of(column, match, asked), column.unit
        why, unit_from = why_matched(column, match), unit_source(column, match, asked)
        if in_file and in_file != stated and si_unit(in_file) is not None:
            notes.append(
                Note.method(f"'{name}' is in '{in_file}' by the file and was read in '{stated}', as --unit asks")
            )
        if match is not None:
            if match.rank >= 0 and not fits(match.name, stated):
                why = f"is in '{stated}', so it is not taken for {match.name}"
                notes.append(Note.method(f"'{name}' {why}"))
            elif match.name in taken:
                why = f"is a second {match.name}; '{taken[match.name].source}' is used for it"
                notes.append(Note.method(f"'{name}' {why}"))
            else:
                name = match.name
        spare = (name if i == 1 else f"{name}_{i}" for i in range(1, len(taken) + 2))
        name = next(candidate for candidate in spare if candidate not in taken)
        if name == "time" and stated is None:
            stated, assumed = _unit_of_time(path, column)
            unit_from = "its steps" if assumed else ""
            notes += assumed
        unit = stated
        if stated is not None and si_unit(stated) is None and name not in STANDARD:
            notes.append(
                Note.method(f"'{column.source}' is in '{stated}', an unknown unit; its values are kept as they are")
            )
            unit = None
        columns.append(Track(source=column.source, channel=name, why=why, unit=stated, unit_from=unit_from))
        taken[name] = _channel(path, name, column.here() if name == "time" else column, unit, stated)
    return taken, columns, notes


def _check_clock(log: FlightLog, source: str) -> None:
    """Check the unit of a time axis by its step, and by altitude and roll against their rates.

    Raises
    ------
    LogError : the step is no recorder's, the record runs backwards, or a second of the axis is no second.
    """
    step = float(np.median(np.diff(log.time_s)))
    if (step > SLOWEST_S and log.n_samples >= FEWEST_TIMES) or step < 1.0 / FASTEST_CLOCK:
        fit = _units_of(step)
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
    unit = next((unit for unit, seconds in TIME_UNITS.items() if 1.0 / RIGHT < scale / seconds < RIGHT), None)
    advice = f"multiply it by {scale:.3g}" if unit is None else f"state its unit with --unit {source}={unit}"
    raise LogError(
        f"{log.path}: a second of '{source}' is {scale:.3g} s: altitude and roll change so many times as fast as their "
        f"rates say; {advice}"
    )


def _channel(path: str, name: str, column: Track, unit: str | None, stated: str | None) -> Channel:
    """Return a column as a channel in SI units, read-only; a column still in its file is not read."""
    where, read = f"{path}: '{column.source}'", column.read
    values, si = to_si(column.values, unit or "", where=where)
    values.setflags(write=False)
    if read is None:
        ends, _ = to_si(np.array([0.0, np.nan if column.step is None else column.step]), unit or "", where=where)
        return Channel(
            name=name,
            values=values,
            unit=si,
            source=column.source,
            source_unit=stated,
            own_rate_hz=column.rate_hz,
            own_step=None if column.step is None else abs(float(ends[1] - ends[0])),
        )

    def in_si(rows: slice) -> FloatArray:
        part = read(rows)
        part = to_si(part, unit, where=where)[0] if unit and si_unit(unit) != unit else part
        part.setflags(write=False)
        return part

    return StoredChannel(name=name, unit=si, source=column.source, source_unit=stated, read=in_si, rows=column.rows)


def _check_maps(path: str, columns: Sequence[Track], asked: ReadRequest) -> None:
    """Check that the columns of `--channel` and `--unit` exist, and that the units fit them."""
    import difflib

    sources = [column.source for column in columns]
    has = ", ".join(sorted(sources))
    for name, source in asked.channel_map.items():
        if source not in sources:
            meant = meant_channel(source, sources) or next(iter(difflib.get_close_matches(source, sources, n=1)), None)
            hint = f"the log has: {has}" if meant is None else f"did you mean '{meant}'?"
            raise LogError(f"{path}: --channel {name}={source}: no channel '{source}'; {hint}")
    names = {*sources, *asked.channel_map, *(m.name for m in map(match_name, sources) if m)}
    for name, unit in asked.unit_map.items():
        where = f"--unit {name}={unit}"
        if name not in names:
            raise LogError(f"{path}: {where}: no channel '{name}'; the log has: {has}")
        try:
            _, si = to_si(0.0, unit, where=where)
        except LogError as error:
            raise ConfigError(str(error)) from None
        match = match_name(name)
        if match is not None and not fits(match.name, unit):
            expected = STANDARD[match.name].unit
            raise ConfigError(f"{where}: '{match.name}' is in {expected}, got a unit of {si}; give one like {expected}")


def _units_of(step: float) -> list[str]:
    """Return the units other than seconds in which `step` can be the time step of a flight log."""
    return [unit for unit, seconds in TIME_UNITS.items() if 1.0 / FASTEST_LOG <= seconds * step <= LONGEST_STEP]


def _unit_of_time(path: str, time: Track) -> tuple[str | None, tuple[Note, ...]]:
    """Return the unit of a time axis without a stated unit, by its step, and a note where that is not seconds.

    Raises
    ------
    LogError : the step suits two units.
    """
    step = np.abs(np.diff(time.values))
    step = step[np.isfinite(step) & (step > 0.0)]
    typical = float(np.median(step)) if step.size else 0.0
    if typical <= LONGEST_STEP:
        return None, ()
    fit = _units_of(typical)
    if len(fit) != 1:
        suits = " and ".join(f"{unit} ({1.0 / (TIME_UNITS[unit] * typical):.4g} Hz)" for unit in fit)
        raise LogError(
            f"{path}: '{time.source}' states no unit, and its steps of {typical:.6g} suit {suits or 'no flight'}; "
            f"state it with --unit {time.source}={fit[0] if fit else 's'}"
        )
    rate = 1.0 / (TIME_UNITS[fit[0]] * typical)
    return fit[0], (
        Note.method(
            f"'{time.source}' states no unit; its steps of {typical:.6g} are taken for {fit[0]} ({rate:.4g} Hz), give "
            f"another with --unit {time.source}=UNIT"
        ),
    )


def _counted_time(path: str, channels: Mapping[str, Channel], raw: RawLog, rate_hz: float | None) -> FloatArray:
    if rate_hz is None:
        for name, why in raw.left_out.items():
            if (match := match_name(name)) is not None and match.name == "time":
                raise LogError(f"{path}: no time axis, '{name}' {why.rstrip(',')}; mend it, or give --sample-rate HZ")
        raise LogError(
            f"{path}: no time axis, got neither a channel 'time' nor an attribute sample_rate_hz; the log has: "
            f"{', '.join(sorted(channels))}; map one with --channel time=NAME, or give --sample-rate HZ"
        )
    samples = raw.first_sample + np.arange(most_common(channel.n_samples for channel in channels.values()))
    if not (0.0 < rate_hz <= FASTEST) or samples[-1] / rate_hz > LATEST:
        raise LogError(f"{path}: sample_rate_hz is no rate of a recorder, got {rate_hz:g} Hz; mend it")
    return frozen_array(samples / rate_hz)
