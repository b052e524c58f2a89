"""The sampling rate of an analysis: so low that few lags span the dynamics, high enough for the dictionary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ...config import Config
from ...errors import LogError
from ...faults import Fault
from ...kernels.lagged import compress
from .regression import EXACT
from .signals import NativeSignals, Signals

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
    if len(y) <= (EXACT_ORDER + 1) * len(signals.theta.acting()):  # so many terms fit any rows
        return False
    theta = signals.theta.array[part]
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
    if len(signals.u) < 3:  # one step has no spectrum
        return None
    n, edges = min(len(signals.u) - 1, 1024), []
    f = np.fft.rfftfreq(n, 1.0 / signals.rate_hz)
    for values in signals.u.T:
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
