"""What the entries of a dictionary add to the outputs of a log, in pieces: a day at 100 Hz does not fit at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..dictionary import signals
from ..faults import Fault, tail_of
from ..filters import recorded_signal
from ..kernels.decimation import Lowpass, decimate, lost_samples, lowpass_taps
from ..kernels.low_pass import Response

__all__ = ["FaultSignals", "decimated_fault"]

FloatArray = NDArray[np.float64]

# Samples of the log that are made at once: 8 MB, and more than any window has that is not a flight of hours.
BLOCK = 1_000_000
# Of a step of the log, by which its times may lie beside even ones where a filtered signal is made from a formula.
EVEN = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaultSignals:
    """The signals of all entries at the log's own rate; those that are not `seen` are zero.

    Attributes
    ----------
    faults : every entry, times on the axis of `time_s`; seen : indices of those that act in the window.
    outputs : names; time_s : (n_samples,).
    window_start_s : what `phase_reference: window` counts from.
    response : of the filters that the log went through.
    of_readings : by index, (n_samples,) the signals of entries that are a share of what the log shows.
    resampled : (n_samples, n_outputs, n_faults) where the log was resampled and they with it, else None.
    """

    faults: Sequence[Fault]
    seen: Sequence[int]
    outputs: Sequence[str]
    time_s: FloatArray
    window_start_s: float
    response: Response
    of_readings: Mapping[int, FloatArray] = field(default_factory=dict)
    resampled: FloatArray | None = None

    def between(self, rows: slice) -> FloatArray:
        """Return (n_rows, n_outputs, n_faults) of these samples."""
        if self.resampled is not None:
            return self.resampled[rows]
        time_s = self.time_s[rows]
        theta = np.zeros((len(time_s), len(self.outputs), len(self.faults)))
        stated = [j for j in self.seen if j not in self.of_readings]
        theta[:, :, stated] = signals(
            [self.faults[j] for j in stated],
            time_s,
            list(self.outputs),
            window_start_s=self.window_start_s,
            response=self.response,
        )
        for j, signal in self.of_readings.items():
            theta[:, self.outputs.index(self.faults[j].channel), j] = signal[rows]
        return theta

    def with_others(self, faults: Mapping[int, Fault], of_readings: Mapping[int, FloatArray]) -> FaultSignals:
        """Return the signals with other faults in place of some entries.

        Parameters
        ----------
        faults : by index; of_readings : (n_samples,) the signals of those that are a share of what the log shows.
        """
        entries = list(faults)
        made = replace(
            self,
            faults=tuple(faults.get(j, fault) for j, fault in enumerate(self.faults)),
            of_readings={**self.of_readings, **of_readings},
        )
        if self.resampled is None:
            return made
        own = replace(made, seen=tuple(entries), of_readings=of_readings, resampled=None).between(slice(None))
        resampled = self.resampled.copy()
        resampled[:, :, entries] = own[:, :, entries]
        return replace(made, resampled=resampled)

    def decimated(self, factor: int, lowpass: Lowpass) -> tuple[FloatArray, FloatArray]:
        """Return (n_rows, n_outputs, n_faults), filtered and decimated, and (n_faults,) the largest native values.

        Raises
        ------
        ValueError : the window is shorter than the filter.
        """
        if self.resampled is not None:
            return decimate(self.resampled, factor, lowpass), np.abs(self.resampled).max(axis=(0, 1), initial=0.0)
        n_rows = len(decimate(np.empty((len(self.time_s), 0)), factor, lowpass))
        theta, largest = np.zeros((n_rows, len(self.outputs), len(self.faults))), np.zeros(len(self.faults))
        for j in self.seen:
            fault = self.faults[j]
            if j in self.of_readings:
                signal = self.of_readings[j]
                column, largest[j] = decimate(signal, factor, lowpass), np.max(np.abs(signal), initial=0.0)
            else:
                column, largest[j] = decimated_fault(
                    fault, self.time_s, factor, lowpass, window_start_s=self.window_start_s, response=self.response
                )
            theta[:, self.outputs.index(fault.channel), j] = column
        return theta, largest


def decimated_fault(
    fault: Fault,
    time_s: FloatArray,
    factor: int,
    lowpass: Lowpass,
    *,
    window_start_s: float,
    response: Response,
) -> tuple[FloatArray, float]:
    """Return (n_rows,) the signal of a fault as the log shows it, decimated, and its largest native value.

    In a record of more than a block, what is far from the fault's onset, bends and end is not filtered but evaluated:
    a filter makes of a line or an exponential another one. There the largest value of an oscillation is its amplitude.

    Raises
    ------
    ValueError : there are fewer samples than the filter has taps.
    """
    tail = tail_of(fault, window_start_s=window_start_s) if len(time_s) > BLOCK and _is_even(time_s, factor) else None
    if tail is None:
        return _in_blocks(fault, time_s, factor, lowpass, window_start_s=window_start_s, response=response)
    form, since_s, holds_s = tail
    own, delay = lowpass_taps(factor, lowpass), lost_samples(factor, lowpass)[0] if factor > 1 else 0
    n_taps, taps = own.size, np.convolve(response.taps, own)
    n_rows, step_s = (len(time_s) - n_taps) // factor + 1, float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    try:
        first = n_taps - 1 - delay + response.before
        filtered = form.filtered(taps, step_s * np.arange(first, first - taps.size, -1, dtype=np.float64))
        recorded = form.filtered(
            response.taps, step_s * np.arange(response.before, -response.after - 1, -1, dtype=np.float64)
        )
    except ValueError:
        return _in_blocks(fault, time_s, factor, lowpass, window_start_s=window_start_s, response=response)
    # The first and the last time that a row holds something of, and a sample more for rounding.
    first_s = time_s[::factor][:n_rows] - (response.after + 1) * step_s
    last_s = time_s[n_taps - 1 :: factor][:n_rows] + (response.before + 1) * step_s
    stop_s = np.inf if fault.offset_s is None else fault.offset_s
    edges = [
        np.searchsorted(last_s, fault.onset_s),
        np.searchsorted(first_s, min(holds_s, stop_s)),
        np.searchsorted(last_s, stop_s),
        np.searchsorted(first_s, stop_s),
    ]
    begin, settled, ending, over = np.maximum.accumulate(edges).tolist()
    column, largest = np.zeros(n_rows), 0.0
    for rows in (slice(begin, settled), slice(ending, over)):
        if rows.start < rows.stop:
            part = time_s[rows.start * factor : (rows.stop - 1) * factor + n_taps]
            made = _in_blocks(fault, part, factor, lowpass, window_start_s=window_start_s, response=response)
            column[rows], largest = made[0], max(largest, made[1])
    if settled < ending:
        column[settled:ending] = filtered.at(time_s[delay::factor][settled:ending] - since_s)
        last = -1 if ending == n_rows else (ending - 1) * factor + n_taps - 1
        ends_s = np.array([time_s[settled * factor], time_s[last]]) - since_s
        oscillates = complex(form.exponent).imag != 0.0
        largest = max(largest, abs(recorded.amplitude) if oscillates else float(np.max(np.abs(recorded.at(ends_s)))))
    return column, largest


def _is_even(time_s: FloatArray, factor: int) -> bool:
    """Say whether times, of which those of the decimated samples are looked at, have even steps."""
    some = time_s[::factor]
    even = np.linspace(some[0], some[-1], len(some))
    rounding = 4.0 * float(np.spacing(np.abs(some[[0, -1]]).max()))
    step_s = (some[-1] - some[0]) / ((len(some) - 1) * factor)
    return bool(np.max(np.abs(some - even)) <= max(EVEN * step_s, rounding))


def _in_blocks(
    fault: Fault, time_s: FloatArray, factor: int, lowpass: Lowpass, *, window_start_s: float, response: Response
) -> tuple[FloatArray, float]:
    """Return the same, every sample made and filtered, block by block."""
    reach = sum(lost_samples(factor, lowpass)) if factor > 1 else 0
    step = max(1, BLOCK // factor) * factor
    pieces, largest = [], 0.0
    for start in range(0, max(len(time_s) - reach, 1), step):
        part = time_s[start : start + step + reach]
        # Nothing of a fault shows before its onset by more than the response of the filters reaches.
        if len(part) > max(reach, 1) and part[-1] + (response.before + 1) * (part[-1] - part[-2]) < fault.onset_s:
            pieces.append(np.zeros((min(len(part), step - factor + 1 + reach) - reach - 1) // factor + 1))
            continue
        signal = recorded_signal(fault, part, response, window_start_s=window_start_s)
        largest = max(largest, float(np.max(np.abs(signal), initial=0.0)))
        pieces.append(decimate(signal[: step - factor + 1 + reach], factor, lowpass))
    return np.concatenate(pieces), largest
