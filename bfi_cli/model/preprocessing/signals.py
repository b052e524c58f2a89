"""Signals of a window and of a dictionary at one rate, made in pieces: those of a day at 100 Hz do not fit at once."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...dictionary import signals
from ...errors import LogError
from ...faults import Fault, tail_of
from ...faults.filters import recorded_signal, recorded_signals
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.atom_signals import LONGEST_REACH, AtomSignals
from ...kernels.low_pass import IDENTITY, WHITE, Lowpass, Response, decimate, lost_samples, lowpass_taps

# Samples of the log that are made at once: 8 MB, and more than any window has that is not a flight of hours.
BLOCK = 1_000_000
# Of a step of the log, by which its times may lie beside even ones where a filtered signal is made from a formula.
EVEN = 1e-6
# An exponential that falls by more than this from sample to sample is made sample by sample until nothing is left of
# it, e^-64: over the lags of a model its numbers would leave double precision.
STEEPEST, GONE = 0.25, 64.0
# Samples of a log up to which its channels are filtered together.
MOST_AT_ONCE = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signals:
    """Inputs, outputs and dictionary of a window at one rate, in SI units.

    Attributes
    ----------
    path : of the log, for messages.
    factor : by which they were decimated, 1 at the log's own rate.
    time_s : (n_samples,), u : (n_samples, n_inputs), y : (n_samples, n_outputs),
    theta : (n_samples, n_outputs, n_atoms), every entry of the dictionary.
    scaling : entries whose signal is the output itself.
    slopes : by entry whose signal changes with the outputs otherwise, by how much, (n_samples, n_outputs).
    earlier : of other records of the aircraft without a fault, which have the same model but for its constant.
    weight : of the rows of one of these.
    """

    path: str
    rate_hz: float
    factor: int
    time_s: FloatArray
    u: FloatArray
    y: FloatArray
    theta: AtomSignals
    scaling: tuple[int, ...] = ()
    slopes: Mapping[int, FloatArray] = field(default_factory=dict)
    earlier: tuple[Signals, ...] = ()
    weight: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogSignal:
    """The signal of an entry that depends on what the log shows.

    Attributes
    ----------
    values : (n_samples, n_outputs).
    slopes : (n_samples, n_outputs), by how much these change with the output; None where they are the output itself.
    """

    values: FloatArray
    slopes: FloatArray | None = None

    def at(self, time_s: FloatArray, own_s: FloatArray) -> LogSignal:
        """Return it at other times, (n,), than its own; the slopes, which change slowly, are those between."""

        def between(values: FloatArray) -> FloatArray:
            return np.stack([np.interp(time_s, own_s, column) for column in values.T], axis=1)

        return LogSignal(values=between(self.values), slopes=None if self.slopes is None else between(self.slopes))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NativeSignals:
    """The window of a log and a dictionary, as `Signals` of its own rate are made of them when they are asked for.

    Attributes
    ----------
    log : the window; inputs, outputs : names of its channels.
    faults : every entry, times on the axis of the log; seen : indices of those that act in the window.
    window_start_s : what `phase_reference: window` counts from.
    response : of the filters that the log went through.
    log_signals : by index, the signals of entries that depend on what the log shows.
    resampled : by index, (n_samples, n_outputs), those that were resampled with the log.
    earlier : of other records, see `Signals`; weight : of one of these.
    """

    log: FlightLog
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    faults: tuple[Fault, ...] = ()
    seen: Sequence[int] = ()
    window_start_s: float = 0.0
    response: Response = IDENTITY
    log_signals: Mapping[int, LogSignal] = field(default_factory=dict)
    resampled: Mapping[int, FloatArray] = field(default_factory=dict)
    earlier: tuple[NativeSignals, ...] = ()
    weight: float = 1.0
    _even: dict[int, bool] = field(init=False, repr=False, default_factory=dict)  # by factor, once it is known

    @property
    def rate_hz(self) -> float:
        """Of the log."""
        return self.log.rate_hz

    @property
    def time_s(self) -> FloatArray:
        """(n_samples,)."""
        return self.log.time_s

    @property
    def u(self) -> FloatArray:
        """(n_samples, n_inputs)."""
        return self.log.signals(self.inputs)

    @property
    def y(self) -> FloatArray:
        """(n_samples, n_outputs)."""
        return self.log.signals(self.outputs)

    def between(self, rows: slice) -> Signals:
        """Return the signals of these samples."""
        none = np.empty((len(self.time_s[rows]), 0))
        return Signals(
            path=self.log.path,
            rate_hz=self.rate_hz,
            factor=1,
            time_s=self.time_s[rows],
            u=np.column_stack([none, *(self.log.channel(name).between(rows) for name in self.inputs)]),
            y=np.column_stack([self.log.channel(name).between(rows) for name in self.outputs]),
            theta=AtomSignals(self.theta_between(rows)),
            scaling=self.scaling,
            slopes={j: slopes[rows] for j, slopes in self.slopes.items()},
        )

    def theta_between(self, rows: slice) -> FloatArray:
        """Return (n_rows, n_outputs, n_faults) what the entries add in these samples; those not `seen` are zero."""
        time_s = self.time_s[rows]
        theta = np.zeros((len(time_s), len(self.outputs), len(self.faults)))
        stated = [j for j in self.seen if j not in self.given]
        theta[:, :, stated] = signals(
            [self.faults[j] for j in stated],
            time_s,
            list(self.outputs),
            window_start_s=self.window_start_s,
            response=self.response,
        )
        for j, values in self.given.items():
            theta[:, :, j] = values[rows]
        return theta

    @property
    def given(self) -> dict[int, FloatArray]:
        """By index, (n_samples, n_outputs), the signals that are known sample by sample, not from a formula."""
        return {j: signal.values for j, signal in self.log_signals.items()} | dict(self.resampled)

    @property
    def slopes(self) -> Mapping[int, FloatArray]:
        """By index, (n_samples, n_outputs), by how much the signal of a fault of a pressure line changes with them."""
        return {j: signal.slopes for j, signal in self.log_signals.items() if signal.slopes is not None}

    def slopes_at(self, factor: int, lowpass: Lowpass) -> dict[int, FloatArray]:
        """Return the slopes, which change slowly, at the samples that a decimation leaves."""
        rows = slice(lost_samples(factor, lowpass)[0], None, factor)
        return {j: slopes[rows][: self.n_rows(factor, lowpass)] for j, slopes in self.slopes.items()}

    @property
    def scaling(self) -> tuple[int, ...]:
        """Entries whose signal is the output itself."""
        return tuple(j for j, signal in self.log_signals.items() if signal.slopes is None)

    def with_faults(
        self, faults: Sequence[Fault], seen: Sequence[int], log_signals: Mapping[int, LogSignal]
    ) -> NativeSignals:
        """Return the window with other faults, those that are not `seen` zero."""
        made = replace(self, faults=tuple(faults), seen=seen, log_signals=log_signals, resampled={})
        made._even.update(self._even)
        return made

    def with_others(self, faults: Mapping[int, Fault], log_signals: Mapping[int, LogSignal]) -> NativeSignals:
        """Return the window with other faults in place of some entries.

        Parameters
        ----------
        faults : by index; log_signals : the signals of those that depend on what the log shows.
        """
        return replace(
            self,
            faults=tuple(faults.get(j, fault) for j, fault in enumerate(self.faults)),
            log_signals={**self.log_signals, **log_signals},
            resampled={j: values for j, values in self.resampled.items() if j not in faults},
        )

    def theta_decimated(self, factor: int, lowpass: Lowpass) -> tuple[AtomSignals, FloatArray]:
        """Return (n_rows, n_outputs, n_faults), filtered and decimated, and (n_faults,) the largest native values.

        Raises
        ------
        ValueError : the window is shorter than the filter.
        """
        theta = np.zeros((self.n_rows(factor, lowpass), len(self.outputs), len(self.faults)))
        largest, given = np.zeros(len(self.faults)), self.given
        outputs = {j: self.outputs.index(self.faults[j].channel) for j in self.seen}
        # Signals of a short record are made and filtered together, which takes a third of the time.
        together = [] if len(self.time_s) > BLOCK else [j for j in self.seen if j not in given]
        for j in self.seen:
            if (signal := given.get(j)) is not None:
                largest[j] = np.max(np.abs(signal[:, outputs[j]]), initial=0.0)
                theta[:, :, j] = decimate(signal, factor, lowpass)
            elif not together:
                theta[:, outputs[j], j], largest[j] = self.signal_of(self.faults[j], factor, lowpass)
        for start in range(0, len(together), size := max(1, BLOCK // len(self.time_s))):
            group = together[start : start + size]
            group_faults = [self.faults[j] for j in group]
            made = recorded_signals(group_faults, self.time_s, self.response, window_start_s=self.window_start_s)
            theta[:, [outputs[j] for j in group], group] = decimate(made, factor, lowpass)
            largest[group] = np.max(np.abs(made), axis=0, initial=0.0)
        return AtomSignals(theta), largest

    @property
    def step_s(self) -> float:
        """The mean time step."""
        return float(self.time_s[-1] - self.time_s[0]) / (len(self.time_s) - 1)

    def n_rows(self, factor: int, lowpass: Lowpass) -> int:
        """Return the number of samples that a decimation leaves."""
        return (len(self.time_s) - lowpass_taps(factor, lowpass).size) // factor + 1

    def signal_of(self, fault: Fault, factor: int, lowpass: Lowpass) -> tuple[FloatArray, float]:
        """Return (n_rows,) the signal of a fault as the log shows it, decimated, and its largest native value.

        Of a record of more than a block, what is far from the fault's onset, bends and end is not filtered but
        evaluated, where the time axis has even steps: a filter makes of a line or an exponential another one. There
        the largest value of an oscillation is its amplitude.

        Raises
        ------
        ValueError : there are fewer samples than the filter has taps.
        """
        is_long = len(self.time_s) > BLOCK and self.is_even(factor)
        tail = tail_of(fault, window_start_s=self.window_start_s) if is_long else None
        if tail is None:
            return self._in_blocks(fault, self.time_s, factor, lowpass)
        form, since_s, holds_s = tail
        decimation_taps, delay = lowpass_taps(factor, lowpass), lost_samples(factor, lowpass)[0] if factor > 1 else 0
        n_rows, step_s, time_s, response = self.n_rows(factor, lowpass), self.step_s, self.time_s, self.response
        n_taps, taps = decimation_taps.size, np.convolve(response.taps, decimation_taps)
        fall = -complex(form.exponent).real
        if fall * max(factor * step_s / STEEPEST, step_s * taps.size / LONGEST_REACH) > 1.0:
            holds_s += GONE / fall
            form = replace(form, amplitude=0.0, exponent=0.0)
        first = n_taps - 1 - delay + response.before
        filtered = form.filtered(taps, step_s * np.arange(first, first - taps.size, -1, dtype=np.float64))
        recorded = form.filtered(
            response.taps, step_s * np.arange(response.before, -response.after - 1, -1, dtype=np.float64)
        )
        # The first and the last time that a row holds something of, and a sample more for rounding.
        stop_s = np.inf if fault.offset_s is None else fault.offset_s
        earlier_s, later_s = (response.after + 1) * step_s, (response.before + 1) * step_s

        def first_row(at_s: float, offset: int, shift_s: float) -> int:
            """Return the first row of which sample `offset` is not before a time, less a shift."""
            return bisect_left(range(n_rows), at_s, key=lambda row: float(time_s[offset + row * factor]) + shift_s)

        edges = [
            first_row(fault.onset_s, n_taps - 1, later_s),
            first_row(min(holds_s, stop_s), 0, -earlier_s),
            first_row(stop_s, n_taps - 1, later_s),
            first_row(stop_s, 0, -earlier_s),
        ]
        begin, settled, ending, over = np.maximum.accumulate(edges).tolist()
        signal, largest = np.zeros(n_rows), 0.0
        for start, stop in ((begin, settled), (ending, over)):
            if start == ending and settled < ending:
                origin_s = float(time_s[0]) + delay * step_s - since_s
                signal[settled:ending] = filtered.at(factor * step_s * np.arange(settled, ending) + origin_s)
                last = -1 if ending == n_rows else (ending - 1) * factor + n_taps - 1
                ends_s = np.array([time_s[settled * factor], time_s[last]]) - since_s
                oscillates = complex(form.exponent).imag != 0.0
                largest = max(
                    largest, abs(recorded.amplitude) if oscillates else float(np.max(np.abs(recorded.at(ends_s))))
                )
            if start < stop:
                part = time_s[start * factor : (stop - 1) * factor + n_taps]
                signal[start:stop], sharpest = self._in_blocks(fault, part, factor, lowpass)
                largest = max(largest, sharpest)
        return signal, largest

    def is_even(self, factor: int) -> bool:
        """Say whether the times that are left after a decimation have even steps."""
        if factor in self._even:
            return self._even[factor]
        some = self.time_s[::factor]
        step_s = (some[-1] - some[0]) / max(len(some) - 1, 1)
        rounding = 4.0 * float(np.spacing(np.abs(some[[0, -1]]).max()))
        most = max(EVEN * step_s / factor, rounding)
        at = (np.arange(start, min(start + BLOCK, len(some))) for start in range(0, len(some), BLOCK))
        even = all(np.max(np.abs(some[rows] - (some[0] + step_s * rows))) <= most for rows in at)
        self._even[factor] = even
        return even

    def _in_blocks(self, fault: Fault, time_s: FloatArray, factor: int, lowpass: Lowpass) -> tuple[FloatArray, float]:
        """Return signal and largest value of a fault at some times, every sample made and filtered, block by block."""
        reach = sum(lost_samples(factor, lowpass)) if factor > 1 else 0
        step = max(1, BLOCK // factor) * factor
        pieces, largest, earlier = [], 0.0, self.response.before + 1
        for start in range(0, max(len(time_s) - reach, 1), step):
            part = time_s[start : start + step + reach]
            # Nothing of a fault shows before its onset by more than the response of the filters reaches.
            if len(part) > max(reach, 1) and part[-1] + earlier * (part[-1] - part[-2]) < fault.onset_s:
                pieces.append(np.zeros((min(len(part), step - factor + 1 + reach) - reach - 1) // factor + 1))
                continue
            signal = recorded_signal(fault, part, self.response, window_start_s=self.window_start_s)
            largest = max(largest, float(np.max(np.abs(signal), initial=0.0)))
            pieces.append(decimate(signal[: step - factor + 1 + reach], factor, lowpass))
        return np.concatenate(pieces), largest


def decimate_native(native: NativeSignals, factor: int, lowpass: Lowpass = WHITE) -> tuple[Signals, FloatArray]:
    """Filter and decimate all signals alike, those of the dictionary one by one.

    Returns
    -------
    The signals, and (n_faults,) the largest value of each entry's at the log's own rate.

    Raises
    ------
    LogError : the window is shorter than the filter.
    """
    try:
        u, y = (_decimated_channels(native.log, names, factor, lowpass) for names in (native.inputs, native.outputs))
    except ValueError as problem:
        raise LogError(f"{native.log.path}: {problem}; give a higher --rate or a longer window") from None
    theta, largest = native.theta_decimated(factor, lowpass)
    start = lost_samples(factor, lowpass)[0]
    signals = Signals(
        path=native.log.path,
        rate_hz=native.rate_hz / factor,
        factor=factor,
        time_s=native.time_s[start::factor][: len(y)],
        u=u,
        y=y,
        theta=theta,
        scaling=native.scaling,
        slopes=native.slopes_at(factor, lowpass),
        earlier=tuple(decimate_native(record, factor, lowpass)[0] for record in native.earlier),
        weight=native.weight,
    )
    return signals, largest


def _decimated_channels(log: FlightLog, names: Sequence[str], factor: int, lowpass: Lowpass) -> FloatArray:
    """Return (n_rows, n_channels) channels filtered and decimated.

    Those of a long log are filtered one after the other, some samples at a time, for memory.
    """
    if factor == 1 or log.n_samples <= MOST_AT_ONCE:
        return decimate(log.signals(names), factor, lowpass)
    reach, step = sum(lost_samples(factor, lowpass)), MOST_AT_ONCE // factor * factor or factor
    # Pieces overlap by the filter's reach; each gives the rows that begin in it.
    pieces = [slice(k, k + step - factor + 1 + reach) for k in range(0, log.n_samples - reach, step)]
    made = np.empty(((log.n_samples - reach - 1) // factor + 1, len(names)))
    for i, name in enumerate(names):
        channel = log.channel(name)
        made[:, i] = np.concatenate([decimate(channel.between(rows), factor, lowpass) for rows in pieces])
    return made
