"""A flight log in memory: named channels in SI units on one time axis, its annotations, and faults added to it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DictionaryError, LogError, first_line
from ..faults import Fault, active_samples, fault_from_dict, fault_to_dict
from ..filters import Filter, recorded_signal, response_of
from ..kernels.low_pass import Response

__all__ = ["CLEAN", "Channel", "FlightLog", "Segment", "Truth", "faults_from_json", "faults_to_json", "frozen_array"]
__all__ += ["inject", "nothing_between", "segments_from_json", "segments_to_json"]

FloatArray = NDArray[np.float64]

# Ends the name, in a file, of the clean signal of a channel with an injected fault.
CLEAN = "_clean"


def frozen_array(values: object) -> FloatArray:
    """Return a read-only float64 copy of `values`."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def nothing_between(path: str, span: tuple[float, float], ends: tuple[float, float]) -> LogError:
    """Return the error of a window without samples in a log that runs between `ends`, s."""
    return LogError(
        f"{path}: no samples between {span[0]:g} s and {span[1]:g} s, the log runs from {ends[0]:g} s to "
        f"{ends[1]:g} s; change --from/--to"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """One measured signal.

    Attributes
    ----------
    name : standard name ("tas"), or the file's own where no alias is known.
    values : (n_samples,) read-only, in `unit`.
    unit : SI or radians ("m/s"), "" where the file states none.
    source : the name in the file.
    source_unit : the unit stated in the file (or by the user), None where none was.
    own_rate_hz : of the signal in the file, where it has a clock of its own; None where it has that of the log.
    """

    name: str
    values: FloatArray
    unit: str
    source: str
    source_unit: str | None = None
    own_rate_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A labelled part of the flight, times on the log's own axis."""

    label: str
    start_s: float
    stop_s: float
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Injected faults (their onsets on the log's own time axis) and the clean signal of every faulty channel."""

    faults: tuple[Fault, ...]
    clean: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightLog:
    """A flight log.

    Attributes
    ----------
    path : where it was read from, for messages.
    time_s : (n_samples,) seconds, strictly as stored (not necessarily uniform; see `quality`).
    channels : by standard name.
    truth : injected faults, None where the file carries none.
    segments : labelled parts of the flight.
    filters : the low-pass filters it went through, recorder first; None where nothing is known of them.
    sha256 : of the file, "" for a log made in memory.
    notes : what the reader, or resampling, decided, as sentences for the user.
    """

    path: str
    time_s: FloatArray
    channels: Mapping[str, Channel]
    truth: Truth | None = None
    segments: tuple[Segment, ...] = ()
    filters: tuple[Filter, ...] | None = None
    sha256: str = ""
    notes: tuple[str, ...] = ()

    @property
    def n_samples(self) -> int:
        return int(self.time_s.size)

    @property
    def rate_hz(self) -> float:
        """Sampling rate from the median time step, free of the time axis's rounding."""
        return float(f"{1.0 / float(np.median(np.diff(self.time_s))):.10g}")

    def channel(self, name: str) -> Channel:
        """Return a channel by its standard name, or by its name in the file.

        Raises
        ------
        LogError : there is none.
        """
        if name in self.channels:
            return self.channels[name]
        for channel in self.channels.values():
            if channel.source == name:
                return channel
        has = ", ".join(sorted(self.channels))
        for note in self.notes:
            if note.startswith(f"'{name}' ") and "left out" in note:
                raise LogError(f"{self.path}: {note.partition(';')[0]}; the log has: {has}")
        raise LogError(f"{self.path}: no channel '{name}'; the log has: {has}; map one with --channel {name}=NAME")

    def signals(self, names: Sequence[str]) -> FloatArray:
        """Return (n_samples, len(names)) of channel values."""
        return np.column_stack([self.channel(name).values for name in names])

    def window(self, from_s: float | None, to_s: float | None) -> FlightLog:
        """Return the samples with from_s <= time < to_s (to_s inclusive where it is the last sample)."""
        if from_s is None and to_s is None:
            return self
        start = self.time_s[0] if from_s is None else from_s
        stop = np.inf if to_s is None else to_s
        step = 1.0 / self.rate_hz
        keep = (self.time_s >= start - 1e-6 * step) & (self.time_s < stop - 1e-6 * step)
        if np.count_nonzero(keep) < 2:
            raise nothing_between(self.path, (start, stop), (self.time_s[0], self.time_s[-1]))
        return self.take(keep)

    def take(self, keep: NDArray[np.bool_]) -> FlightLog:
        """Return the log restricted to the samples where `keep` is true."""
        channels = {name: replace(c, values=frozen_array(c.values[keep])) for name, c in self.channels.items()}
        truth = self.truth
        if truth is not None:
            truth = replace(truth, clean={name: frozen_array(values[keep]) for name, values in truth.clean.items()})
        return replace(self, time_s=frozen_array(self.time_s[keep]), channels=channels, truth=truth)


def inject(log: FlightLog, faults: Sequence[Fault], *, response: Response | None = None) -> FlightLog:
    """Return `log` with `faults` added to their channels, in that order, and the truth extended by them.

    Times of the faults are on the log's own time axis; a `phase_reference` of "window" counts from its first sample.
    Faults that the log carries already stay in its truth; a clean signal is that before the first fault.
    `notes` names a fault that has neither onset nor end in the log.

    Parameters
    ----------
    response : through which the faults go; None for that of the filters that the log went through, as a fault of the
        aircraft would have, `bfi_cli.kernels.low_pass.IDENTITY` for none.

    Raises
    ------
    LogError : the log has no such channel.
    DictionaryError : a fault is zero at every sample of the log, or its signal cannot be made.
    """
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1])
    through = response_of(log.filters or (), log.rate_hz) if response is None else response
    for declared in faults:
        channel = log.channel(declared.channel)
        fault = replace(declared, channel=channel.name)
        if fault.phase_reference != "onset" and fault.frequency_hz is not None:
            # Counted from the onset, so that the truth stays true where the log is cut.
            phase = fault.phase_rad + 2.0 * math.pi * fault.frequency_hz * (fault.onset_s - start_s)
            fault = replace(fault, phase_reference="onset", phase_rad=phase % (2.0 * math.pi))
        name = fault.name or fault.shape
        added = fault.magnitude * recorded_signal(fault, log.time_s, through, window_start_s=start_s)
        if not np.any(added):
            until = "" if fault.offset_s is None else f" until {fault.offset_s:g} s"
            raise DictionaryError(
                f"{log.path}: fault '{name}': never active in the log, got magnitude {fault.magnitude:g} from "
                f"{fault.onset_s:g} s{until}, the log runs from {start_s:g} s to {stop_s:g} s; "
                "change onset, offset or magnitude"
            )
        before, notes = log.truth or Truth(faults=()), log.notes
        if active_samples(fault, log.time_s).all():
            notes += (
                f"fault '{name}' on {fault.channel} acts at every sample of the log; "
                "with neither onset nor end in it, it can pass for the aircraft's own motion",
            )
        faulty = replace(channel, values=frozen_array(channel.values + added))
        truth = Truth(faults=(*before.faults, fault), clean={channel.name: channel.values, **before.clean})
        channels = {**log.channels, channel.name: faulty}
        log = replace(log, channels=channels, truth=truth, sha256="", notes=notes)
    return log


def segments_to_json(segments: Sequence[Segment]) -> str:
    """Return the JSON list of `{label, t_start, t_end, note}`."""
    return json.dumps([{"label": s.label, "t_start": s.start_s, "t_end": s.stop_s, "note": s.note} for s in segments])


def segments_from_json(text: str, *, where: str) -> tuple[Segment, ...]:
    """Read the JSON list of `{label, t_start, t_end, note}`.

    Raises
    ------
    LogError : it is not such a list.
    """
    segments = []
    for entry in _objects(text, where):
        try:
            start, stop = float(entry["t_start"]), float(entry["t_end"])
        except (KeyError, TypeError, ValueError, OverflowError):
            raise LogError(
                f"{where}: a segment needs the numbers t_start and t_end, got {str(entry)[:80]}; mend the file"
            ) from None
        label, note = str(entry.get("label", "")), str(entry.get("note", ""))
        segments.append(Segment(label=label, start_s=start, stop_s=stop, note=note))
    return tuple(segments)


def faults_to_json(faults: Sequence[Fault]) -> str:
    """Return the JSON list of fault objects, keys that are None left out."""
    objects = (fault_to_dict(fault) for fault in faults)
    return json.dumps([{key: value for key, value in entry.items() if value is not None} for entry in objects])


def faults_from_json(text: str, *, where: str) -> tuple[Fault, ...]:
    """Read a JSON list of fault objects.

    Raises
    ------
    LogError : it is not such a list, or one of them is no fault.
    """
    try:
        return tuple(fault_from_dict(entry, where=where) for entry in _objects(text, where))
    except DictionaryError as error:
        raise LogError(str(error)) from None


def _objects(text: str, where: str) -> list[dict[str, Any]]:
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LogError(f"{where}: not JSON, {first_line(error)}; mend the file") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise LogError(f"{where}: not a JSON list of objects; mend the file")
    return entries
