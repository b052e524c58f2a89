"""What a log is good for: rate, gaps, NaN, held samples, quantisation, excitation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUTS
from ..errors import LogError
from .excitation import Excitation, ExcitedWindow, excitation, suggest_windows
from .holds import Hold, find_hold, find_quantum, repeat_fraction
from .record import FlightLog, FloatArray, Segment

__all__ = ["ChannelReport", "LogReport", "advice_on_windows", "gap_starts", "hold_of", "inspect_log", "is_uniform"]
__all__ += ["position", "require_usable", "time_jitter", "uneven_step"]

# In SI units; no measurement, and squares of it still are numbers.
LARGEST = 1e30
# Of the median time step: what a recorder's clock may wander, and between one step and two, where a sample is missing.
UNEVEN, GAP = 0.02, 1.75
# From here on the dynamics change within a record, and a scan takes minutes: a window is worth a word.
LONG_S, MOST_NAMED = 600.0, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelReport:
    """One channel.

    Attributes
    ----------
    n_nan : samples that are NaN or infinite.
    held_fraction : fraction of samples that repeat the one before, 0 where the channel is not held.
    hold_period_s : time between two values of a held channel, None where it is not held.
    quantum : quantisation step in `unit`, None where there is none.
    min, max : over the finite samples, None where there are none.
    """

    name: str
    unit: str
    source: str
    n_nan: int
    held_fraction: float
    hold_period_s: float | None
    quantum: float | None
    min: float | None
    max: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LogReport:
    """A log as `bfi info` shows it.

    Attributes
    ----------
    jitter : largest deviation of a time step from the median, relative to it, gaps left out.
    gaps : (start_s, stop_s), the last sample before and the first after each gap.
    """

    path: str
    n_samples: int
    start_s: float
    stop_s: float
    rate_hz: float
    uniform: bool
    jitter: float
    gaps: tuple[tuple[float, float], ...]
    channels: tuple[ChannelReport, ...]
    excitation: tuple[Excitation, ...]
    windows: tuple[ExcitedWindow, ...]
    segments: tuple[Segment, ...]
    notes: tuple[str, ...]


def position(time_s: FloatArray) -> FloatArray:
    """Return (n_samples,) time in samples: (t - t[0]) over the median time step."""
    return np.asarray((time_s - time_s[0]) / np.median(np.diff(time_s)))


def gap_starts(time_s: FloatArray) -> NDArray[np.intp]:
    """Return the samples after which at least one is missing."""
    step = np.diff(time_s)
    return np.flatnonzero(step > GAP * np.median(step))


def time_jitter(time_s: FloatArray) -> float:
    """Return the largest deviation of a time step from the median step, relative to it, gaps left out."""
    relative = np.diff(position(time_s))
    return float(np.max(np.abs(relative[relative <= GAP] - 1.0), initial=0.0))


def uneven_step(time_s: FloatArray) -> int | None:
    """Return the first sample k whose step t[k] - t[k-1] is off by more than 2 % and float32 rounding, else None."""
    step = np.diff(time_s)
    median = float(np.median(step))
    single = time_s.astype(np.float32)
    rounding = 2.0 * float(np.max(np.abs(np.spacing(single)))) if np.array_equal(single, time_s) else 0.0
    bad = np.abs(step - median) > UNEVEN * median + rounding
    return int(np.argmax(bad)) + 1 if bad.any() else None


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples lie on a uniform grid."""
    return uneven_step(time_s) is None


def inspect_log(log: FlightLog) -> LogReport:
    """Return what there is to know about a log before it is analysed."""
    gaps, inputs = _gaps(log), _inputs(log)
    channels = []
    for channel in log.channels.values():
        finite = channel.values[np.isfinite(channel.values)]
        hold = hold_of(log, channel.values)
        report = ChannelReport(
            name=channel.name,
            unit=channel.unit,
            source=channel.source,
            n_nan=channel.values.size - finite.size,
            held_fraction=0.0 if hold is None else repeat_fraction(finite),
            hold_period_s=None if hold is None else hold.period / log.rate_hz,
            quantum=find_quantum(finite),
            min=float(finite.min()) if finite.size else None,
            max=float(finite.max()) if finite.size else None,
        )
        channels.append(report)
    return LogReport(
        path=log.path,
        n_samples=log.n_samples,
        start_s=float(log.time_s[0]),
        stop_s=float(log.time_s[-1]),
        rate_hz=float(f"{log.rate_hz:.9g}"),
        uniform=is_uniform(log.time_s),
        jitter=time_jitter(log.time_s),
        gaps=gaps,
        channels=tuple(channels),
        excitation=tuple(excitation(log, name) for name in inputs),
        windows=suggest_windows(log, inputs, gaps),
        segments=log.segments,
        notes=log.notes,
    )


def advice_on_windows(log: FlightLog) -> str | None:
    """Return a sentence that names the windows with the most moves; None where the log is not long."""
    duration_s = float(log.time_s[-1] - log.time_s[0])
    if duration_s <= LONG_S:
        return None
    windows = suggest_windows(log, _inputs(log), _gaps(log), at_most=MOST_NAMED)
    named = [f"--from {one.start_s:.10g} --to {one.stop_s:.10g} ({one.channel})" for one in windows]
    return (
        f"the record is {duration_s / 60.0:.0f} min long; bfi info suggests {', '.join(named) or 'no window of it'}; "
        "the whole record is analysed"
    )


def _inputs(log: FlightLog) -> list[str]:
    return [name for name in INPUTS if name in log.channels]


def _gaps(log: FlightLog) -> tuple[tuple[float, float], ...]:
    return tuple((float(log.time_s[k]), float(log.time_s[k + 1])) for k in gap_starts(log.time_s))


def hold_of(log: FlightLog, values: FloatArray) -> Hold | None:
    """Return the clock of a held signal (n_samples,) of the log, NaN left out; None where it is not held."""
    finite = np.isfinite(values)
    return find_hold(values[finite], position(log.time_s)[finite])


def require_usable(log: FlightLog, names: Sequence[str], *, resampling: bool = False) -> None:
    """Check that the channels can be analysed.

    Parameters
    ----------
    names : standard names, or names in the file.
    resampling : the log is resampled afterwards, so an uneven time step and held samples do not matter.

    Raises
    ------
    LogError : a channel is missing, holds NaN or absurd values, repeats its values, or the time step is not uniform.
    """
    channels = [log.channel(name) for name in names]
    for channel in channels:
        huge = np.flatnonzero(np.isfinite(channel.values) & (np.abs(channel.values) > LARGEST))
        if huge.size:
            raise LogError(
                f"{log.path}: '{channel.name}' is no measurement at sample {huge[0]} ({log.time_s[huge[0]]:.6g} s), "
                f"got {channel.values[huge[0]]:.3g} {channel.unit}; choose a window without it with --from/--to"
            )
        bad = np.flatnonzero(~np.isfinite(channel.values))
        if bad.size:
            raise LogError(
                f"{log.path}: '{channel.name}' is not a number at sample {bad[0]} ({log.time_s[bad[0]]:.6g} s), "
                f"{bad.size} of {log.n_samples} samples in all; choose a window without them with --from/--to"
            )
    if resampling:
        return
    k = uneven_step(log.time_s)
    if k is not None:
        step = float(log.time_s[k] - log.time_s[k - 1])
        raise LogError(
            f"{log.path}: time step is not uniform: {step:.4g} s at sample {k}, {1.0 / log.rate_hz:.4g} s elsewhere; "
            "give --rate to resample, or cut the window with --from/--to"
        )
    for channel in channels:
        hold = hold_of(log, channel.values)
        if hold is not None:
            rate, repeated = f"{log.rate_hz / hold.period:.3g}", 100.0 * repeat_fraction(channel.values)
            raise LogError(
                f"{log.path}: '{channel.name}' repeats its value {repeated:.0f} % of the time (held samples, about "
                f"{rate} Hz); give --rate {rate} to decimate"
            )
