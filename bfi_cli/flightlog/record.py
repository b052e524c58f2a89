"""A flight log in memory: named channels in SI units on one time axis, and its annotations."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..epoch import Epoch
from ..errors import LogError
from ..faults import Fault
from ..faults.filters import Filter
from ..kernels.quantisation import find_quantum, quantum_of_plateaus
from ..notes import Note
from ..quantities.channels import meant_channel, unit_of
from ..quantities.text import instant

if TYPE_CHECKING:
    from ..faults.ordinary import Occurrence

FloatArray = NDArray[np.float64]

# Suffix of the dataset or column with a channel's signal before a fault was injected.
CLEAN = "_clean"
LARGEST_VALUE = 1e30  # in SI units: nothing beyond it is a measurement, and its square is a finite number


def frozen_array(values: object) -> FloatArray:
    """Return a read-only float64 copy of `values`."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def nothing_between(path: str, span: tuple[float, float], ends: tuple[float, float]) -> LogError:
    """Return the error of a window without samples in a log that runs between `ends`, s."""
    low, high, first, last = map(instant, (*span, *ends))
    return LogError(
        f"{path}: no samples between {low} s and {high} s, the log runs from {first} s to {last} s; change --from/--to"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel:
    """One measured signal.

    Attributes
    ----------
    name : standard name ("tas"), or the name in the file where no alias is known.
    values : (n_samples,) read-only, in `unit`.
    unit : SI or radians ("m/s"), "" where the file states none.
    source : the name in the file.
    source_unit : the unit stated in the file (or by the user), None where none was.
    own_rate_hz : rate of a signal with a separate clock in the file, None where the clock is that of the log.
    own_step : in which it was recorded, of a signal that was low-passed to the clock of the log; None elsewhere.
    derived_from : the channels that it follows from; () of one that the file holds.
    """

    name: str
    values: FloatArray
    unit: str
    source: str
    source_unit: str | None = None
    own_rate_hz: float | None = None
    own_step: float | None = None
    derived_from: tuple[str, ...] = ()
    # The steps in which it was recorded, after their first use.
    _steps: dict[str, float | None] = field(init=False, repr=False, default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Number of values."""
        return int(self.values.size)

    @property
    def step(self) -> float | None:
        """The step of which all differences of its values are multiples, None where there is none."""
        if "of differences" not in self._steps:
            self._steps["of differences"] = find_quantum(self.values[np.isfinite(self.values)])
        return self._steps["of differences"]

    def plateau_step(self, rate_hz: float) -> float | None:
        """Return the step of the levels at which it rests, behind a recorder's low-pass too; None where none shows."""
        if self.own_step is not None:
            return self.own_step
        if "of plateaus" not in self._steps:
            self._steps["of plateaus"] = quantum_of_plateaus(self.values, rate_hz)
        return self._steps["of plateaus"]

    def between(self, rows: slice) -> FloatArray:
        """Return the values of these rows."""
        return self.values[rows]

    def taken(self, keep: slice | NDArray[np.bool_]) -> Channel:
        """Return the channel restricted to the samples of a slice, or where `keep` is true."""
        return replace(self, values=frozen_array(self.values[keep]))


class StoredChannel(Channel):
    """A channel of a large file, read when its values are needed and kept in memory only while they are in use.

    Parameters
    ----------
    read : returns the values of rows of the file, in `unit`, read-only.
    rows : the rows of the file that are the channel.
    values : in place of `read` and `rows`, where they were computed from a stored channel.
    """

    __slots__ = ("_held", "_in_use", "_read", "_rows")
    _held: FloatArray | None
    _in_use: Callable[[], FloatArray | None]
    _read: Callable[[slice], FloatArray]
    _rows: slice

    def __init__(
        self,
        *,
        read: Callable[[slice], FloatArray] | None = None,
        rows: slice = slice(0, 0),
        values: FloatArray | None = None,
        **stated: Any,
    ) -> None:
        stated = {
            "source_unit": None,
            "own_rate_hz": None,
            "own_step": None,
            "derived_from": (),
            "_steps": {},
            **stated,
        }
        for key, value in {**stated, "_held": values, "_in_use": lambda: None, "_read": read, "_rows": rows}.items():
            object.__setattr__(self, key, value)

    @property
    def values(self) -> FloatArray:
        """(n_samples,) read from the file unless they are still in use."""
        values = self._in_use() if self._held is None else self._held
        if values is None:
            values = self._read(self._rows)
            object.__setattr__(self, "_in_use", weakref.ref(values))
        return values

    @property
    def is_stored(self) -> bool:
        """Whether the values are still in the file."""
        return self._held is None

    @property
    def n_samples(self) -> int:
        """Number of values."""
        return int(self._rows.stop - self._rows.start) if self._held is None else int(self._held.size)

    def between(self, rows: slice) -> FloatArray:
        """Return the values of these rows, without reading the others."""
        return self._read(self._in_file(rows)) if self._held is None else self._held[rows]

    def taken(self, keep: slice | NDArray[np.bool_]) -> Channel:
        """Return the channel restricted to the samples of a slice, still unread, or where `keep` is true."""
        if not isinstance(keep, slice) or self._held is not None:
            return replace(self, values=frozen_array(self.values[keep]))
        names = ("name", "unit", "source", "source_unit", "own_rate_hz", "own_step")
        stated = {key: getattr(self, key) for key in names}
        return StoredChannel(**stated, read=self._read, rows=self._in_file(keep))

    def _in_file(self, rows: slice) -> slice:
        start, stop, _ = rows.indices(self.n_samples)
        return slice(self._rows.start + start, self._rows.start + stop)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """One signal of a file: (n_samples,) values in the file's own unit, None where it states none.

    Without values it says what a column was taken for: `channel` is its name in the log, None where it is left out.

    Attributes
    ----------
    channel : the standard name that the format states, "" of none; None where it follows from `source`.
    time_s : (n_samples,) times of a signal with a separate clock; empty where all signals of the file share one axis.
        Either all signals of a file have such times, or none.
    rate_hz : of a signal with a separate rate, None for the rate of the file.
    step : in which a signal was recorded that went through a low-pass since, None of one that did not, or without one.
    turn : a full turn in the unit of an angle that wraps around, None for other signals.
    epoch : from which `time_s` counts, or the values of a time axis; None of one that no clock has set.
    why : the channel is that, in words, "" where its name alone tells it; unit_from : where the unit is stated.
    read : of a signal that is still in its file (`values` is empty), returns the values of rows; rows : its rows there.
    """

    source: str
    values: FloatArray = field(default_factory=lambda: np.empty(0))
    unit: str | None = None
    channel: str | None = None
    time_s: FloatArray = field(default_factory=lambda: np.empty(0))
    rate_hz: float | None = None
    step: float | None = None
    turn: float | None = None
    epoch: Epoch | None = None
    why: str = ""
    unit_from: str = "the file"
    read: Callable[[slice], FloatArray] | None = None
    rows: slice = field(default_factory=lambda: slice(0, 0))

    def here(self) -> Track:
        """Return the signal with its values in memory."""
        return self if self.read is None else replace(self, values=self.read(self.rows), read=None)

    def part(self, rows: slice) -> Track:
        """Return some of its rows."""
        if self.read is None:
            return replace(self, values=self.values[rows])
        return replace(self, rows=slice(self.rows.start + rows.start, self.rows.start + rows.stop))


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A labelled part of the flight, times on the log's own axis."""

    label: str
    start_s: float
    stop_s: float
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Injected faults, their onsets on the log's time axis, the signal of each faulty channel without them, and the
    ordinary causes that were made.
    """

    faults: tuple[Fault, ...] = ()
    clean: Mapping[str, FloatArray] = field(default_factory=dict)
    ordinary: tuple[Occurrence, ...] = ()


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
    filters : the low-pass filters that the log went through, recorder first; None where nothing is known of them.
    epoch : from which the times count, None where the file has no clock.
    sha256 : of the file, "" for a log made in memory.
    notes : what the reader, or resampling, decided, as sentences for the user.
    left_out : by name in the file why an array is no channel; see `raw.RawLog`.
    columns : of the file, those that are left out last; () for a log made in memory.
    earlier : fault-free logs of this aircraft, whose motion follows the same model; earlier_weights : the standard
        deviation of this log's prediction error over that of each earlier log; () for 1.
    """

    path: str
    time_s: FloatArray
    channels: Mapping[str, Channel]
    truth: Truth | None = None
    segments: tuple[Segment, ...] = ()
    filters: tuple[Filter, ...] | None = None
    epoch: Epoch | None = None
    sha256: str = ""
    notes: tuple[Note, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    columns: tuple[Track, ...] = ()
    earlier: tuple[FlightLog, ...] = ()
    earlier_weights: tuple[float, ...] = ()
    _rate_hz: list[float] = field(init=False, repr=False, default_factory=list)  # `rate_hz`, after its first use
    # What `phases.find_phases` returns, by the channels that it does without, after its first use.
    phases: dict[frozenset[str], Any] = field(init=False, repr=False, default_factory=dict)

    @property
    def n_samples(self) -> int:
        return int(self.time_s.size)

    @property
    def rate_hz(self) -> float:
        """Sampling rate from the median time step, free of the time axis's rounding."""
        if not self._rate_hz:
            self._rate_hz.append(float(f"{1.0 / float(np.median(np.diff(self.time_s), overwrite_input=True)):.10g}"))
        return self._rate_hz[0]

    @property
    def span_s(self) -> tuple[float, float]:
        """Times of the first sample, and of the one that would follow the last."""
        return float(self.time_s[0]), float(self.time_s[-1]) + 1.0 / self.rate_hz

    def ends(self, from_s: float | None = None, to_s: float | None = None) -> tuple[float, float]:
        """Return first and last time, s, of a window; None for those of the log."""
        first, last = float(self.time_s[0]), float(self.time_s[-1])
        return first if from_s is None else from_s, last if to_s is None else to_s

    def channel(self, name: str) -> Channel:
        """Return a channel by its standard name, or by its name in the file.

        Raises
        ------
        LogError : the log has no such channel.
        """
        if (channel := self.find(name)) is not None:
            return channel
        has = ", ".join(sorted(self.channels))
        if name in self.left_out:
            why, semicolon, advice = self.left_out[name].partition("; ")
            raise LogError(f"{self.path}: '{name}' {why} and is left out; the log has: {has}{semicolon}{advice}")
        meant = meant_channel(name, self.channels)
        advice = f"map one with --channel {name}=NAME" if meant is None else f"did you mean '{meant}'?"
        raise LogError(f"{self.path}: no channel '{name}'; the log has: {has}; {advice}")

    def find(self, name: str) -> Channel | None:
        """Return a channel by its standard name, or by its name in the file; None where there is none."""
        by_source = (channel for channel in self.channels.values() if channel.source == name)
        return self.channels.get(name) or next(by_source, None)

    def independent(self, names: Collection[str]) -> tuple[str, ...]:
        """Return those of some channels that the log has and that follow from no other of them."""
        here = (name for name in names if name in self.channels)
        return tuple(name for name in here if set(names).isdisjoint(self.channels[name].derived_from))

    def unit_of(self, name: str) -> str:
        """Return the unit of a channel of the log, else of the standard channel of that name, "" of any other."""
        return self.channels[name].unit if name in self.channels else unit_of(name)

    def signals(self, names: Sequence[str]) -> FloatArray:
        """Return (n_samples, len(names)) of channel values; a view for a single channel."""
        if len(names) == 1:
            return self.channel(names[0]).values[:, None]
        signals = np.empty((self.n_samples, len(names)))
        for i, name in enumerate(names):  # a large log has one channel at a time in memory
            signals[:, i] = self.channel(name).values
        return signals

    def window(self, from_s: float | None, to_s: float | None) -> FlightLog:
        """Return the samples with from_s <= time < to_s (to_s inclusive where it is the last sample)."""
        if from_s is None and to_s is None:
            return self
        start = self.time_s[0] if from_s is None else from_s
        stop = np.inf if to_s is None else to_s
        near = 1e-6 / self.rate_hz
        first, end = np.searchsorted(self.time_s, (start - near, stop - near)).tolist()
        if end - first < 2:
            raise nothing_between(self.path, (start, stop), (self.time_s[0], self.time_s[-1]))
        return self if (first, end) == (0, self.n_samples) else self.take(slice(first, end))

    def take(self, rows: slice | NDArray[np.bool_]) -> FlightLog:
        """Return the log restricted to a slice of its samples, or to those where a mask is true."""
        channels = {name: channel.taken(rows) for name, channel in self.channels.items()}
        clean = {name: frozen_array(values[rows]) for name, values in (self.truth.clean if self.truth else {}).items()}
        truth = self.truth and replace(self.truth, clean=clean)
        return replace(self, time_s=frozen_array(self.time_s[rows]), channels=channels, truth=truth)

    def with_values(self, values: Mapping[str, object]) -> FlightLog:
        """Return the log with other values of some channels, (n_samples,) each; clean signals stay."""
        changed = {name: replace(self.channels[name], values=frozen_array(new)) for name, new in values.items()}
        return replace(self, channels={**self.channels, **changed})

    def plus(self, changes: Mapping[str, FloatArray]) -> FlightLog:
        """Return the log with changes of some channels, (n_samples,) each, added to them; clean signals stay."""
        return self.with_values({name: self.channels[name].values + change for name, change in changes.items()})

    def changed(self, change: Callable[[str, FloatArray], FloatArray], **more: Any) -> FlightLog:
        """Return the log with `change(name, values)` in place of the values of every channel and every clean signal."""

        def of(channel: Channel) -> Channel:
            values = channel.values
            new = change(channel.name, values)
            return channel if new is values else replace(channel, values=new)

        channels = {name: of(channel) for name, channel in self.channels.items()}
        clean = {name: change(name, values) for name, values in (self.truth.clean if self.truth else {}).items()}
        return replace(self, channels=channels, truth=self.truth and replace(self.truth, clean=clean), **more)
