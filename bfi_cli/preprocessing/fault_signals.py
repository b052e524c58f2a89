"""What the entries of a dictionary add to the outputs of a log, in pieces: a day at 100 Hz does not fit at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..dictionary import signals
from ..faults import Fault
from ..filters import recorded_signal
from ..kernels.decimation import Lowpass, decimate, lost_samples
from ..kernels.low_pass import Response

__all__ = ["FaultSignals", "decimated_fault"]

FloatArray = NDArray[np.float64]

# Samples of the log that are made at once: 8 MB, and more than any window has that is not a flight of hours.
BLOCK = 1_000_000


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

    Raises
    ------
    ValueError : there are fewer samples than the filter has taps.
    """
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
