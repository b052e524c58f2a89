"""Two logs of one flight: the shift between their clocks, and the difference of their channels at common times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import ConfigError, LogError
from ..flightlog.axis import LATEST
from ..flightlog.raw import require_memory
from ..flightlog.record import FlightLog, frozen_array
from ..kernels import FloatArray
from ..quantities.text import instant

# A step of more than so many typical steps is a gap, in which nothing is interpolated.
GAP = 5.0
# Finest grid of the search for the shift; a parabola through three points of it resolves a tenth of a step and less.
SEARCH_HZ = 5.0
# Share of the shorter log that must lie within the other, so that two similar halves of flights are not matched.
LEAST_OVERLAP = 0.5
# Share of the variance of the first log that the best shift may leave in the median channel; with more the logs show
# different flights. Two flights of one Citation leave 0.47 and more, a flight and itself resampled 1e-7, an airspeed
# that has drifted by 40 m/s 0.11.
MOST_LEFT = 0.25
# Least such share, that of rounding, so that no channel that agrees exactly outweighs all others.
LEAST_LEFT = 1e-9


def shifted(log: FlightLog, shift_s: float) -> FlightLog:
    """Return the log with its times later by `shift_s`.

    Raises
    ------
    ConfigError : the times become those of no flight, or so large that rounding makes neighbours equal.
    """
    time_s = log.time_s + shift_s
    if np.abs(time_s).max() > LATEST or not np.all(np.diff(time_s) > 0.0):
        raise ConfigError(
            f"--align: times of {log.path} become those of no flight, {time_s[0]:.6g} s to {time_s[-1]:.6g} s; give a "
            "smaller shift, or --align auto"
        )
    return replace(log, time_s=frozen_array(time_s))


def values_at(log: FlightLog, name: str, time_s: FloatArray) -> FloatArray:
    """Return a channel at other times, (n,), in straight lines between its samples; NaN outside and within gaps."""
    known = np.isfinite(log.channels[name].values)
    t, values = log.time_s[known], log.channels[name].values[known]
    if t.size < 2:
        return np.full(time_s.shape, np.nan)
    after = np.clip(np.searchsorted(t, time_s), 1, t.size - 1)
    inside = (time_s >= t[0]) & (time_s <= t[-1]) & (t[after] - t[after - 1] <= GAP / log.rate_hz)
    return np.where(inside, np.interp(time_s, t, values), np.nan)


def difference(first: FlightLog, second: FlightLog, name: str) -> tuple[FloatArray, FloatArray]:
    """Return the common times, (n,), of the log with the lower rate, and the second channel less the first at these.

    Raises
    ------
    LogError : the logs share no time.
    """
    low, high = (end(log.time_s[i] for log in (first, second)) for end, i in ((max, 0), (min, -1)))
    slow = first if first.rate_hz <= second.rate_hz else second
    time_s = slow.time_s[(slow.time_s >= low) & (slow.time_s <= high)]
    if time_s.size < 2:
        here, there = (f"{instant(log.time_s[0])} to {instant(log.time_s[-1])} s" for log in (second, first))
        raise LogError(
            f"{second.path}: shares no time with {first.path}, {here} and {there}; give "
            "--align S, seconds to add, or --align auto"
        )
    return time_s, values_at(second, name, time_s) - values_at(first, name, time_s)


def time_shift(first: FlightLog, second: FlightLog, names: Sequence[str]) -> float:
    """Return the seconds to add to the times of the second log, so that its channels match those of the first.

    This is the maximum likelihood estimate for differences that are a constant and noise of unknown variance in each
    channel: it minimises the sum of the logarithms of the variances of the differences over the overlap, in which a
    channel that errs in one of the logs has little weight beside channels that agree.

    Parameters
    ----------
    names : channels of both.

    Raises
    ------
    LogError : no channel moves, or the logs show different flights, or are longer than memory holds.
    """
    step = 1.0 / min(first.rate_hz, second.rate_hz, SEARCH_HZ)
    n_first, n_second = (int((log.time_s[-1] - log.time_s[0]) / step) + 1 for log in (first, second))
    # Two signals with their marks of what is known, their spectra, and the shares by lag of each channel.
    n_bytes = 8.0 * (n_first + n_second) * (8 + len(names))
    require_memory(second.path, n_bytes, f"shifts against {first.path}", "give --align S, seconds to add")
    from scipy.fft import irfft, next_fast_len, rfft  # a quarter of a second of imports that a log alone does not need

    n = next_fast_len(n_first + n_second, real=True)
    lags = np.arange(-(n_second - 1), n_first)

    def against(a: FloatArray, b: FloatArray) -> FloatArray:
        """Return the sums of a(k + lag) b(k) over k, by lag."""
        return np.asarray(irfft(rfft(a, n) * np.conj(rfft(b, n)), n))[lags]

    left: list[FloatArray] = []
    for name in names:
        a, b = (
            values_at(log, name, log.time_s[0] + step * np.arange(m))
            for log, m in ((first, n_first), (second, n_second))
        )
        spread = float(np.nanstd(a)) if np.isfinite(a).any() else 0.0
        if spread <= 1e-9 * float(np.nanmax(np.abs(a), initial=0.0)) or not np.isfinite(b).any():
            continue
        middle = float(np.nanmean(a))
        (in_a, a), (in_b, b) = (
            (np.isfinite(values).astype(float), np.nan_to_num((values - middle) / spread)) for values in (a, b)
        )
        count = np.maximum(np.round(against(in_a, in_b)), 0.0)
        mean = (against(a, in_b) - against(in_a, b)) / np.maximum(count, 1.0)
        square = (against(a * a, in_b) + against(in_a, b * b) - 2.0 * against(a, b)) / np.maximum(count, 1.0)
        enough = count >= LEAST_OVERLAP * min(in_a.sum(), in_b.sum())
        left.append(np.where(enough, np.maximum(square - mean**2, LEAST_LEFT), np.inf))
    shares = np.array(left).reshape(-1, lags.size)
    best = int(np.argmin(np.log(shares).sum(axis=0)))
    if not left or not np.median(shares[:, best]) <= MOST_LEFT:
        raise LogError(
            f"{second.path}: no shift of its time makes {', '.join(names) or 'its channels'} those of {first.path}; "
            "give --align S, seconds to add, or --channel NAME that both have"
        )
    near = (shares / shares[:, [best]]).sum(axis=0)
    before, here, after = (near[min(max(best + i, 0), lags.size - 1)] for i in (-1, 0, 1))
    bend = before - 2.0 * here + after
    vertex = 0.5 * (before - after) / bend if np.isfinite(bend) and bend > 0.0 else 0.0
    return float(first.time_s[0] - second.time_s[0] + step * (lags[best] + vertex))
