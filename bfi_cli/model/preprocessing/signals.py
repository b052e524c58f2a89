"""Signals of a window and of a dictionary, made in pieces, and the rate at which an analysis takes them.

Those of a day at 100 Hz do not fit at once. The rate is so low that few lags span the dynamics, and high enough for
the dictionary.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ...config import Config
from ...dictionary import signals
from ...errors import LogError
from ...faults import Fault, tail_of
from ...faults.filters import recorded_signal, recorded_signals
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.atom_signals import LONGEST_REACH, acting
from ...kernels.lagged import compress
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
    theta: FloatArray
    scaling: tuple[int, ...] = ()
    slopes: Mapping[int, FloatArray] = field(default_factory=dict)
    earlier: tuple[Signals, ...] = ()
    weight: float = 1.0

    @property
    def each_input(self) -> Iterable[FloatArray]:
        """(n_samples,) of each input."""
        return self.u.T


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
    def each_input(self) -> Iterable[FloatArray]:
        """(n_samples,) of each input, one after the other, for memory."""
        return (self.log.channel(name).values for name in self.inputs)

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
            theta=self.theta_between(rows),
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

    def theta_decimated(self, factor: int, lowpass: Lowpass) -> tuple[FloatArray, FloatArray]:
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
            acts_on, filtered = [outputs[j] for j in group], decimate(made, factor, lowpass)
            if len(self.outputs) == 1 and len(group) == len(self.faults):
                theta[:, 0, :] = filtered  # by lists, as below, it takes as long as the filter
            else:
                theta[:, acts_on, group] = filtered
            largest[group] = np.max(np.abs(made), axis=0, initial=0.0)
        return theta, largest

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


Purpose = Literal["estimate", "scan", "detect"]

# Rigid-body modes lie below 2 Hz; at 100 Hz a few lags span hundredths of a second and turn white noise of 0.01 m/s
# into a drift, at 5 to 10 Hz they do not. 600 samples are 10 Hz in a minute and 5 Hz in two.
FASTEST_HZ = 10.0
SLOWEST_HZ = 1.0
SAMPLES_WANTED = 600
# The largest default order takes 64 samples of one input and one output: leave more than that.
FEWEST_SAMPLES = 100
# Behind a recorder's low-pass the rate follows its edge, for an estimate and for a scan, and the order spans this
# time: 3.3 Hz and order 8, 2 Hz and order 6 on flights recorded with an edge of 0.75 Hz. There a fixed order found more
# faults than one chosen together with them, whose choice the fault itself moves; rates above and below found fewer
# (docs/theory.md, 7.3). The rate of a detection is that of a scan, or a tenth above it at most (docs/theory.md, 11.4).
SAMPLES_PER_EDGE = {"estimate": 4.5, "scan": 2.67, "detect": 2.94}
MEMORY_S = 2.6
# Twice what Nyquist asks for: the low-pass of the analysis has lost half the power at the new Nyquist frequency.
SAMPLES_PER_CYCLE = 4.0
# A recorder's low-pass takes 30 dB and more within two octaves; the spectrum of an aircraft in gusts falls by less.
EMPTY_BAND = 1e-3
# Rates and frequencies that differ by less are the same.
TIE = 1e-6
# Prediction error over the output's range: double precision leaves 1e-10 and less, single precision 1e-7 and more.
EXACT = 1e-8
EXACT_ORDER = 4  # states of the longitudinal motion
EXACT_SAMPLES = 5000  # more tell no more and take time
FIRST_SAMPLES = 500  # that nearly all measured records fail in; the speed only
SEGMENTS = 1000  # of a spectrum, transformed at once, for memory
# Rows of the longest record that is searched for onsets: five and a half hours at the slowest rate. No linear model
# holds longer, and a search takes minutes. ESTIMATED: rows of the longest record whose onsets are stated: an hour at
# 100 Hz, a day at 4 Hz, over which the signals of a dictionary fit in memory.
MOST_ROWS, ESTIMATED = 20_000, 360_000


def choose_rate(
    signals: Signals | NativeSignals,
    faults: Sequence[Fault],
    *,
    exact: bool,
    asked: float | str = "auto",
    recorder_hz: float | None = None,
    fastest_hz: float = FASTEST_HZ,
    purpose: Purpose = "estimate",
) -> tuple[int, str]:
    """Return the decimation factor that suits the recorder, the aircraft, the window and the dictionary, and why.

    The outputs have no say in it, since one of them may be faulty.

    Parameters
    ----------
    signals : at the log's own rate.
    faults : the dictionary.
    exact : see `is_exact`; decimation would only add a remainder to a record without noise.
    asked : a rate in Hz, "none" for the log's own, or "auto".
    recorder_hz : edge of the recorder's low-pass, None where it has none or none is known.
    fastest_hz : the highest rate to choose.
    purpose : an estimate needs more of what is left above the edge than a scan; a detection has a rate at most.
    """
    if asked == "none":
        return 1, "the log's own rate, as asked for"
    if not isinstance(asked, str):
        return max(1, round(signals.rate_hz / asked)), "asked for"
    if exact and len(signals.time_s) <= ESTIMATED:
        return 1, "the log's own rate, where a VARX explains the record to round-off"
    duration = len(signals.time_s) / signals.rate_hz
    rate = float(np.clip(SAMPLES_WANTED / duration, SLOWEST_HZ, fastest_hz))
    reason = f"{rate:.3g} Hz suits rigid-body dynamics in a window of {duration:.3g} s"
    factor = int(np.floor(signals.rate_hz / rate + TIE))
    wanted = SAMPLES_PER_EDGE[purpose] * (recorder_hz or np.inf)
    if wanted < signals.rate_hz:
        # What a detection excludes holds up to that rate and not above.
        nearest = np.ceil(signals.rate_hz / wanted - TIE) if purpose == "detect" else round(signals.rate_hz / wanted)
        factor = max(1, int(nearest))
        reason = f"the recorder's low-pass leaves little above {signals.rate_hz / factor / 2.0:.3g} Hz"
    elif (empty := _empty_from(signals)) is not None and empty < rate:
        reason = f"the log carries next to nothing above {empty:.2g} Hz, as if low-passed by its recorder"
        factor = int(np.ceil(signals.rate_hz / empty - TIE))
    fastest = max((fault.frequency_hz or 0.0 for fault in faults), default=0.0)
    if factor * SAMPLES_PER_CYCLE * fastest > signals.rate_hz * (1 + TIE):
        reason = f"{fastest:g} Hz is the fastest oscillation of the dictionary"
        factor = int(np.floor(signals.rate_hz / (SAMPLES_PER_CYCLE * fastest) + TIE))
    if (longest := -(-len(signals.time_s) // ESTIMATED)) > max(factor, 1):
        factor, reason = longest, f"one model is fitted to {ESTIMATED} rows at most"
    factor = int(np.clip(factor, 1, max(1, len(signals.time_s) // FEWEST_SAMPLES)))
    return factor, reason if factor > 1 else f"the log's own rate; {reason}"


def require_one_model(path: str, duration_s: float, rate_hz: float, *, purpose: Purpose = "scan") -> None:
    """Refuse a record that is too long for one model: for a search of onsets, or for stated ones.

    Raises
    ------
    LogError : it is.
    """
    searched = purpose == "scan"
    most, n_rows = MOST_ROWS if searched else ESTIMATED, round(duration_s * rate_hz)
    if n_rows > most:
        why = "to search with one model" if searched else "for one model"
        lower = "" if searched else "leave out --rate or give a lower one, "
        raise LogError(
            f"{path}: {n_rows} rows at {rate_hz:.4g} Hz are too many {why} (at most {most}); "
            f"{lower}choose a part with --from/--to, or give bfi diagnose for the whole record"
        )


def slowest_rate_hz(rate_hz: float, asked: float | str) -> float:
    """Return the lowest rate that `choose_rate` may choose for a log of some rate."""
    if asked == "none":
        return rate_hz
    return min(rate_hz, SLOWEST_HZ) if isinstance(asked, str) else asked


def candidate_orders(
    config: Config, rate_hz: float, recorder_hz: float | None, longest: float = np.inf
) -> tuple[int, ...]:
    """Return the orders to choose from: as configured, and one alone behind a recorder's low-pass by default.

    A window that is too short for that one, with rows up to order `longest`, chooses among all.
    """
    if isinstance(config.model.order, int):
        return (config.model.order,)
    orders = config.model.orders
    if recorder_hz is None or "orders" in config.model.model_fields_set:
        return orders
    fixed = min(orders, key=lambda order: abs(order - MEMORY_S * rate_hz))
    return (fixed,) if fixed <= longest else orders


def is_exact(signals: Signals) -> bool:
    """Say whether a low-order VARX with free fault terms leaves nothing but round-off at the log's own rate."""
    part = slice(0, EXACT_SAMPLES)
    y, u = signals.y[part], signals.u[part]
    if len(y) < 20 * EXACT_ORDER or np.any(np.ptp(y, axis=0) == 0.0):
        return False
    if len(y) <= (EXACT_ORDER + 1) * len(acting(signals.theta)):  # so many terms fit any rows
        return False
    theta = signals.theta[part]
    scale = np.ptp(y, axis=0)
    moving = np.ptp(u, axis=0) > 0.0
    u, y, theta = (u - u.mean(axis=0))[:, moving], (y - y.mean(axis=0)) / scale, theta / scale[:, None]
    most = EXACT * np.sqrt(len(y) - EXACT_ORDER)
    # What the first rows leave of all their terms the whole leaves at least, and fewer entries act in them.
    for rows in (slice(FIRST_SAMPLES), slice(None)):
        data = compress(u[rows], y[rows], theta[rows], order=EXACT_ORDER, feedthrough=True)
        outputs = data.columns.y
        if np.any(np.linalg.norm(data.R[outputs.start :, outputs], axis=0) >= most):
            return False
    return bool(data.R.shape[0] > outputs.start)


def _empty_from(signals: Signals | NativeSignals) -> float | None:
    """Return the frequency above which the inputs carry next to nothing, None where they do up to Nyquist.

    The spectrum of a differenced signal (Welch's averaged periodograms of half-overlapping Hann segments) falls by
    30 dB and more within two octaves only behind a filter.
    """
    if len(signals.time_s) < 3:  # one step has no spectrum
        return None
    n, edges = min(len(signals.time_s) - 1, 1024), []
    f = np.fft.rfftfreq(n, 1.0 / signals.rate_hz)
    for values in signals.each_input:
        segments = np.lib.stride_tricks.sliding_window_view(np.diff(values), n)[:: max(1, n // 2)]
        total = np.zeros(len(f))
        for start in range(0, len(segments), SEGMENTS):
            part = segments[start : start + SEGMENTS]
            centred = part - part.mean(axis=1, keepdims=True)
            total += np.sum(np.abs(np.fft.rfft(centred * np.hanning(n), axis=1)) ** 2, axis=0)
        power = total / len(segments)
        above = np.maximum.accumulate(power[::-1])[::-1]
        first, last = np.searchsorted(f, f / 4), np.searchsorted(f, f / 2, side="right")
        # No median exceeds the largest of all that follows, which leaves few of them to be taken.
        hopeful = np.flatnonzero((f > 8 * f[1]) & (above < EMPTY_BAND * above[np.minimum(first, len(f) - 1)]))
        empty = (k for k in hopeful if above[k] < EMPTY_BAND * np.median(power[first[k] : last[k]]))
        if (edge := next(empty, None)) is None:
            return None
        edges.append(float(f[edge]))
    return max(edges, default=None)
