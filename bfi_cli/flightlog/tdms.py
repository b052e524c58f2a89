"""TDMS logs of LabVIEW: channels in groups, each with a waveform clock, or a group with a channel of time.

The package npTDMS parses the file (extra `tdms`). Channel names are matched by
`bfi_cli.quantities.channels`, as for HDF5 and CSV; units and clocks are properties of the channels.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..epoch import DAY_S, Epoch
from ..errors import LogError
from ..notes import Note
from ..quantities.channels import match_name
from .raw import (
    BESIDE_TIME,
    FloatArray,
    RawLog,
    ReadRequest,
    choose_group,
    number_of,
    parsing,
    rate_of,
    require_few,
    require_memory,
)
from .record import Track

# Properties in which LabVIEW and DIAdem state a unit, the more usual first.
UNITS = ("unit_string", "NI_UnitDescription", "units", "unit")
# Hz and s: a clock beyond these limits is a damaged or an empty property.
FASTEST, SLOWEST_S = 1e6, 1e4


@dataclass(frozen=True, slots=True)
class _Clock:
    """Time of a waveform: its first sample, s from midnight of `day` (since 1970) if that is known, and its step, s."""

    start_s: float
    step_s: float
    day: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Signal:
    """A channel of numbers: `source` is its name in the log, `clock` None without a waveform, `is_moment` of dates."""

    source: str
    group: str
    values: FloatArray
    unit: str | None
    clock: _Clock | None
    is_moment: bool

    @property
    def is_time(self) -> bool:
        match = match_name(self.source)
        return self.is_moment or (match is not None and match.name == "time")


def read_tdms(path: str, asked: ReadRequest) -> RawLog:
    """Read a TDMS file.

    A group with a channel of time has that time axis. Otherwise channels have the clocks of their waveforms
    (`wf_increment`, `wf_start_time`, `wf_start_offset`), and several groups are one log; channels of different clocks
    are resampled to one time base.

    Raises
    ------
    LogError : npTDMS is not installed; damaged, no signals, no such group, more than memory holds.
    """
    try:
        import nptdms
    except ImportError:
        raise LogError(f"{path}: a TDMS file, and npTDMS is not installed; pip install 'bfi-cli[tdms]'") from None
    for name in ("nptdms", *nptdms.log.log_manager.loggers):
        logging.getLogger(name).setLevel(logging.ERROR)
    # An open file, since with a path npTDMS also reads the index file beside it, which may be a stranger's.
    quiet = np.errstate(all="ignore")
    with parsing(path, "TDMS file"), open(path, "rb") as file, quiet, nptdms.TdmsFile.open(file) as tdms:
        signals, stated_rate, left_out = _signals(path, tdms, asked.group)
        is_cut = bool(tdms.file_status.incomplete_final_segment)
    notes, has_time = list[Note](), any(signal.is_time for signal in signals)
    if not has_time and any(signal.clock is not None for signal in signals):
        untimed = [signal.source for signal in signals if signal.clock is None]
        left_out |= dict.fromkeys(untimed, "has no wf_increment beside channels that have one")
        signals = [signal for signal in signals if signal.clock is not None]
    if is_cut:
        notes.append(Note.limit("the file is cut off before its end: samples are missing there; copy it again"))
    if is_cut and len({signal.group if has_time or signal.clock is None else signal.clock for signal in signals}) == 1:
        # Channels of one clock end where the shortest does.
        shortest, longest = (which(signal.values.size for signal in signals) for which in (min, max))
        if shortest < longest:
            signals = [replace(signal, values=signal.values[:shortest]) for signal in signals]
            notes.append(Note.limit(f"of {longest} samples {shortest} are there of every channel and are read"))
    made = RawLog(columns=[Track(source=signal.source, values=signal.values, unit=signal.unit) for signal in signals])
    if has_time:
        made = _with_time(signals)
    elif all(signal.clock is not None for signal in signals):
        day = min(
            (signal.clock.day for signal in signals if signal.clock and signal.clock.day is not None), default=None
        )
        epoch = None if day is None else Epoch(since_1970_s=DAY_S * day, is_utc=True)
        times = [_times(signal, day) for signal in signals]
        if len({(signal.clock, signal.values.size) for signal in signals}) > 1:
            columns = [
                replace(column, time_s=time_s, epoch=epoch) for column, time_s in zip(made.columns, times, strict=True)
            ]
        else:
            columns = [Track(source="time", values=times[0], unit="s", channel="time", epoch=epoch), *made.columns]
        made = RawLog(columns=columns)
    left_out = {**left_out, **made.left_out}
    return replace(made, sample_rate_hz=stated_rate, notes=(*notes, *made.notes), left_out=left_out)


def _signals(path: str, tdms: Any, wanted: str | None) -> tuple[list[_Signal], float | None, dict[str, str]]:
    """Return the signals of the wanted group, or of all groups of one log, the rate stated, and what is left out."""
    channels = [channel for group in tdms.groups() for channel in group.channels()]
    require_few(path, len(channels), "channels")
    why = {"V": "is empty", "O": "holds text", "U": "holds text", "S": "holds text", "c": "holds complex numbers"}
    why |= dict.fromkeys("fiubM", "")
    unlike, numbers = [], []
    for channel in channels:
        reason = why.get(np.dtype(channel.dtype).kind if len(channel) else "V", "holds no numbers")
        if reason or not channel.name:
            unlike.append((channel, reason if channel.name else "has no name"))
        else:
            numbers.append(channel)
    if channels and not numbers and tdms.file_status.incomplete_final_segment:
        raise LogError(f"{path}: the TDMS file is cut off before the end of its first channels; copy it again")
    groups = list(dict.fromkeys(channel.group_name for channel in numbers))
    waveforms = all(_clock(channel.properties) is not None for channel in numbers)
    chosen = None
    if wanted is not None or not groups or (len(groups) > 1 and not waveforms):
        chosen = choose_group(path, wanted, groups, has_signals=False)
    numbers = [channel for channel in numbers if chosen is None or channel.group_name == chosen]
    need = 8 * sum(len(channel) for channel in numbers)
    require_memory(path, need, "its channels", "export fewer of them, or a part of the flight")
    names = [channel.name for channel in numbers]
    signals = []
    for channel in numbers:
        values = np.asarray(channel[:])
        if is_moment := values.dtype.kind == "M":  # seconds since 1970
            values = np.where(np.isnat(values), np.nan, 1e-6 * values.astype("datetime64[us]").astype(np.int64))
        units = (channel.properties.get(name) for name in UNITS)
        unit = next((text.strip() for text in units if isinstance(text, str) and text.strip()), None)
        signals.append(
            _Signal(
                source=channel.name if names.count(channel.name) == 1 else f"{channel.group_name}/{channel.name}",
                group=channel.group_name,
                values=values.astype(np.float64),
                unit="s" if is_moment else unit,
                clock=None if is_moment else _clock(channel.properties),
                is_moment=is_moment,
            )
        )
    stated = [tdms.properties, *(group.properties for group in tdms.groups() if group.name in (chosen, *groups[:1]))]
    rate = next(
        (rate_of(path, properties["sample_rate_hz"]) for properties in stated if "sample_rate_hz" in properties), None
    )
    left_out = {channel.name: reason for channel, reason in unlike if chosen is None or channel.group_name == chosen}
    return signals, rate, left_out


def _clock(properties: Mapping[str, Any]) -> _Clock | None:
    """Return the clock of a channel, None where it is no waveform."""
    step_s, offset_s = number_of(properties.get("wf_increment")), number_of(properties.get("wf_start_offset", 0.0))
    if step_s is None or offset_s is None or not (1.0 / FASTEST <= step_s <= SLOWEST_S and abs(offset_s) <= 1e12):
        return None
    start = properties.get("wf_start_time")
    # A start at LabVIEW's epoch, 1904, was never set.
    if not isinstance(start, np.datetime64) or np.isnat(start) or start < np.datetime64("1970-01-02"):
        return _Clock(offset_s, step_s, None)
    day = start.astype("datetime64[D]")
    return _Clock(offset_s + float((start - day) / np.timedelta64(1, "us")) * 1e-6, step_s, int(day.astype(np.int64)))


def _times(signal: _Signal, day: int | None) -> FloatArray:
    """Return the times of a waveform, counted from midnight of `day` where that is given."""
    clock = signal.clock
    assert clock is not None
    days = 0 if day is None or clock.day is None else clock.day - day
    return DAY_S * days + clock.start_s + clock.step_s * np.arange(signal.values.size, dtype=np.float64)


def _with_time(signals: Sequence[_Signal]) -> RawLog:
    """Return the log; a channel of dates becomes the time axis, from midnight of its first day, unless there is one."""
    has_axis = any(signal.is_time and not signal.is_moment for signal in signals)
    kept, left_out = [], {}
    for signal in signals:
        if not signal.is_moment:
            kept.append(Track(source=signal.source, values=signal.values, unit=signal.unit))
        elif has_axis:
            left_out[signal.source] = BESIDE_TIME
        else:
            has_axis = True
            known = signal.values[np.isfinite(signal.values)]
            first = float(np.floor(known[0] / DAY_S) * DAY_S) if known.size else 0.0
            epoch = Epoch(since_1970_s=first, is_utc=True) if known.size else None
            values = signal.values - first
            kept.append(Track(source=signal.source, values=values, unit="s", channel="time", epoch=epoch))
    return RawLog(columns=kept, left_out=left_out)
