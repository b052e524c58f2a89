"""Which rate an analysis runs at, and the one filter that brings inputs, outputs and dictionary there alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import LogError
from .faults import Fault
from .kernels.decimation import WHITE, Lowpass, decimate, lost_samples
from .kernels.lagged import compress

__all__ = ["Choice", "Conditioned", "Record", "choose_factor", "condition", "is_exact", "lowest_rate"]

FloatArray = NDArray[np.float64]

FASTEST_HZ = 20.0
SLOWEST_HZ = 1.0
SAMPLES_WANTED = 600
FEWEST_SAMPLES = 100
ENOUGH_SAMPLES = 200
SAMPLES_PER_CYCLE = 4.0
EMPTY_BAND = 1e-3
TIE = 1e-6
EXACT = 1e-8
EXACT_ORDER = 4
EXACT_SAMPLES = 5000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """The analysed window at the log's own rate, in SI units.

    Attributes
    ----------
    path : of the log, for messages.
    time_s : (n_samples,), u : (n_samples, n_inputs), y : (n_samples, n_outputs),
    theta : (n_samples, n_outputs, n_atoms).
    """

    path: str
    rate_hz: float
    time_s: FloatArray
    u: FloatArray
    y: FloatArray
    theta: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conditioned:
    """A record filtered and decimated by `factor`; the same arrays at `rate_hz`."""

    rate_hz: float
    factor: int
    time_s: FloatArray
    u: FloatArray
    y: FloatArray
    theta: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A decimation factor and the sentence that says why."""

    factor: int
    reason: str


def condition(record: Record, factor: int, lowpass: Lowpass = WHITE) -> Conditioned:
    """Return the record filtered and decimated, every signal alike; factor 1 leaves it as it is.

    Raises
    ------
    LogError : the window is shorter than the filter.
    """
    try:
        u, y, theta = (decimate(x, factor, lowpass) for x in (record.u, record.y, record.theta))
    except ValueError as problem:
        raise LogError(f"{record.path}: {problem}; give a higher --rate or a longer window") from None
    start = lost_samples(factor, lowpass)[0] if factor > 1 else 0
    return Conditioned(
        rate_hz=record.rate_hz / factor,
        factor=factor,
        time_s=record.time_s[start::factor][: len(y)],
        u=u,
        y=y,
        theta=theta,
    )


def choose_factor(record: Record, faults: Sequence[Fault], *, exact: bool) -> Choice:
    """Choose a rate for rigid-body dynamics, the window's length and the dictionary's bandwidth (METHOD section 4).

    Parameters
    ----------
    record : the window.
    faults : the dictionary.
    exact : see `is_exact`; decimation would only add a remainder to a record without noise.
    """
    if exact:
        return Choice(factor=1, reason="the log's own rate, where a VARX explains the record to round-off")
    duration = len(record.time_s) / record.rate_hz
    rate = float(np.clip(SAMPLES_WANTED / duration, SLOWEST_HZ, FASTEST_HZ))
    reason = f"{rate:.3g} Hz suits rigid-body dynamics in a window of {duration:.3g} s"
    factor = int(np.floor(record.rate_hz / rate + TIE))
    empty = _empty_from(record)
    if empty is not None and empty < rate:
        reason = f"the log carries next to nothing above {empty:.2g} Hz, as if low-passed by its recorder"
        factor = int(np.ceil(record.rate_hz / empty - TIE))
    fastest = _fastest(faults)
    if factor * SAMPLES_PER_CYCLE * fastest > record.rate_hz * (1 + TIE):
        reason = f"{fastest:g} Hz is the fastest oscillation of the dictionary"
        factor = int(np.floor(record.rate_hz / (SAMPLES_PER_CYCLE * fastest) + TIE))
    factor = int(np.clip(factor, 1, max(1, len(record.time_s) // FEWEST_SAMPLES)))
    return Choice(factor=factor, reason=reason if factor > 1 else f"the log's own rate; {reason}")


def lowest_rate(record: Record, faults: Sequence[Fault]) -> float:
    """Return the lowest rate that still resolves the dictionary and leaves samples enough."""
    duration = len(record.time_s) / record.rate_hz
    return max(SLOWEST_HZ, SAMPLES_PER_CYCLE * _fastest(faults), ENOUGH_SAMPLES / duration)


def _fastest(faults: Sequence[Fault]) -> float:
    return max((fault.frequency_hz or 0.0 for fault in faults), default=0.0)


def is_exact(record: Record) -> bool:
    """Say whether a low-order VARX with free fault terms leaves nothing but round-off at the log's own rate."""
    part = slice(0, EXACT_SAMPLES)
    y, u, theta = record.y[part], record.u[part], record.theta[part]
    if len(y) < 20 * EXACT_ORDER or np.any(np.ptp(y, axis=0) == 0.0):
        return False
    scale = np.ptp(y, axis=0)
    moving = np.ptp(u, axis=0) > 0.0
    data = compress(
        (u - u.mean(axis=0))[:, moving],
        (y - y.mean(axis=0)) / scale,
        theta / scale[:, None],
        order=EXACT_ORDER,
        feedthrough=True,
    )
    outputs = data.columns.y
    left = np.linalg.norm(data.R[outputs.start :, outputs], axis=0) / np.sqrt(data.n_rows)
    return bool(np.all(left < EXACT)) and data.R.shape[0] > outputs.start


def _empty_from(record: Record) -> float | None:
    """Return the frequency above which the outputs carry next to nothing, None where they do up to Nyquist.

    The spectrum of the differenced output falls by 30 dB and more within two octaves only behind a filter.
    """
    if len(record.y) < 3:  # one step has no spectrum
        return None
    edges = []
    for output in record.y.T:
        f, power = _spectrum(np.diff(output), record.rate_hz)
        above = np.maximum.accumulate(power[::-1])[::-1]
        reference = [np.median(power[(f >= edge / 4) & (f <= edge / 2)]) if edge > 8 * f[1] else 0.0 for edge in f]
        empty = np.flatnonzero(above < EMPTY_BAND * np.array(reference))
        if empty.size == 0:
            return None
        edges.append(float(f[empty[0]]))
    return max(edges, default=None)


def _spectrum(x: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Averaged periodograms of half-overlapping Hann segments (Welch), up to a factor."""
    n = min(len(x), 1024)
    segments = np.lib.stride_tricks.sliding_window_view(x, n)[:: max(1, n // 2)]
    centred = segments - segments.mean(axis=1, keepdims=True)
    power = np.mean(np.abs(np.fft.rfft(centred * np.hanning(n), axis=1)) ** 2, axis=0)
    return np.asarray(np.fft.rfftfreq(n, 1.0 / rate_hz)), np.asarray(power)
