"""The sampling rate of an analysis: so low that few lags span the dynamics, high enough for the dictionary."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..errors import LogError
from ..faults import Fault
from ..kernels.decimation import Lowpass
from ..kernels.lagged import compress
from ..kernels.model_selection import Penalty, full_support
from ..kernels.progress import Report, parts, shares, silent
from .regression import RegressionData, Signals, build_regression, decimate_signals

__all__ = ["SAMPLES_PER_CYCLE", "RateChoice", "choose_rate", "is_exact", "reduce_rate_for_noise"]

FloatArray = NDArray[np.float64]

# Rigid-body modes lie below 2 Hz; at 100 Hz a few lags span hundredths of a second and turn white noise of 0.01 m/s
# into a drift, at 5 to 10 Hz they do not. 600 samples are 20 Hz in the 30 s of the thesis's manoeuvre.
FASTEST_HZ = 20.0
SLOWEST_HZ = 1.0
SAMPLES_WANTED = 600
# The largest default order takes 64 samples of one input and one output: leave more than that, and three times as many
# where the rate is lowered for the noise alone.
FEWEST_SAMPLES = 100
ENOUGH_SAMPLES = 200
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
# Longitudinal motion has four states, which take fewer lags: more are preferred for the sake of the noise only.
MANY_LAGS = 8
# The fault terms of more atoms than this need not all fit into the rows: the orders are then compared without them.
MOST_ATOMS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class RateChoice:
    """A decimation factor and the sentence that says why."""

    factor: int
    reason: str


def choose_rate(signals: Signals, faults: Sequence[Fault], *, exact: bool, asked: float | str = "auto") -> RateChoice:
    """Choose the rate that suits rigid-body dynamics, the length of the window and the dictionary's frequencies.

    Parameters
    ----------
    signals : at the log's own rate.
    faults : the dictionary.
    exact : see `is_exact`; decimation would only add a remainder to a record without noise.
    asked : a rate in Hz, "none" for the log's own, or "auto".
    """
    if asked == "none":
        return RateChoice(factor=1, reason="the log's own rate, as asked for")
    if not isinstance(asked, str):
        return RateChoice(factor=max(1, round(signals.rate_hz / asked)), reason="asked for")
    if exact:
        return RateChoice(factor=1, reason="the log's own rate, where a VARX explains the record to round-off")
    duration = len(signals.time_s) / signals.rate_hz
    rate = float(np.clip(SAMPLES_WANTED / duration, SLOWEST_HZ, FASTEST_HZ))
    reason = f"{rate:.3g} Hz suits rigid-body dynamics in a window of {duration:.3g} s"
    factor = int(np.floor(signals.rate_hz / rate + TIE))
    empty = _empty_from(signals)
    if empty is not None and empty < rate:
        reason = f"the log carries next to nothing above {empty:.2g} Hz, as if low-passed by its recorder"
        factor = int(np.ceil(signals.rate_hz / empty - TIE))
    fastest = _fastest(faults)
    if factor * SAMPLES_PER_CYCLE * fastest > signals.rate_hz * (1 + TIE):
        reason = f"{fastest:g} Hz is the fastest oscillation of the dictionary"
        factor = int(np.floor(signals.rate_hz / (SAMPLES_PER_CYCLE * fastest) + TIE))
    factor = int(np.clip(factor, 1, max(1, len(signals.time_s) // FEWEST_SAMPLES)))
    return RateChoice(factor=factor, reason=reason if factor > 1 else f"the log's own rate; {reason}")


def reduce_rate_for_noise(
    signals: Signals,
    choice: RateChoice,
    faults: Mapping[int, Fault],
    config: Config,
    lowpass: Lowpass,
    report: Report = silent,
) -> tuple[RateChoice, RegressionData | None]:
    """Halve the rate while the best VARX has many lags and the frequencies of the dictionary allow a lower rate.

    Lags average the measurement noise over the time they span; at a lower rate fewer of them span that time.

    Parameters
    ----------
    signals : at the log's own rate.
    choice : the fastest rate that suits.
    faults : what is looked for, by its place in the dictionary.
    report : receives the progress.

    Returns
    -------
    The choice, and the regression at its rate where one has been built, with all these faults and all orders that the
    configuration lists.
    """
    duration = len(signals.time_s) / signals.rate_hz
    lowest = max(SLOWEST_HZ, SAMPLES_PER_CYCLE * _fastest(faults.values()), ENOUGH_SAMPLES / duration)
    orders, atoms = config.model.orders, tuple(range(len(faults))) if len(faults) <= MOST_ATOMS else ()
    while signals.rate_hz / (2 * choice.factor) >= lowest:
        factorising, trying, report = shares(report, 1, 1, 2)
        try:
            decimated = decimate_signals(signals, choice.factor, lowpass)
            regression = build_regression(decimated, tuple(faults), config, orders=orders, report=factorising)
        except LogError:
            return choice, None
        # The order with the best BIC, all faults of a small dictionary free; 0 where the rows do not suffice.
        rows = regression.n_rows
        penalty = Penalty(n_rows=rows, n_effective=float(rows), n_candidates=len(atoms), evidence=0.0, extended=False)
        fits = [
            full_support(regression.problem(order), atoms, penalty) for order, _ in parts(trying, regression.orders)
        ]
        fitted = [fit for fit in fits if fit is not None]
        lags = min(fitted, key=lambda scored: scored.criterion).fit.order if fitted else 0
        if lags < MANY_LAGS:
            return choice, regression
        reason = f"at {decimated.rate_hz:.4g} Hz a model needs {lags} lags to average the noise"
        choice = RateChoice(factor=2 * choice.factor, reason=reason)
    return choice, None


def _fastest(faults: Iterable[Fault]) -> float:
    return max((fault.frequency_hz or 0.0 for fault in faults), default=0.0)


def is_exact(signals: Signals) -> bool:
    """Say whether a low-order VARX with free fault terms leaves nothing but round-off at the log's own rate."""
    part = slice(0, EXACT_SAMPLES)
    y, u, theta = signals.y[part], signals.u[part], signals.theta[part]
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


def _empty_from(signals: Signals) -> float | None:
    """Return the frequency above which the outputs carry next to nothing, None where they do up to Nyquist.

    The spectrum of the differenced output (Welch's averaged periodograms of half-overlapping Hann segments) falls by
    30 dB and more within two octaves only behind a filter.
    """
    if len(signals.y) < 3:  # one step has no spectrum
        return None
    n, edges = min(len(signals.y) - 1, 1024), []
    f = np.fft.rfftfreq(n, 1.0 / signals.rate_hz)
    for output in signals.y.T:
        segments = np.lib.stride_tricks.sliding_window_view(np.diff(output), n)[:: max(1, n // 2)]
        centred = segments - segments.mean(axis=1, keepdims=True)
        power = np.mean(np.abs(np.fft.rfft(centred * np.hanning(n), axis=1)) ** 2, axis=0)
        above = np.maximum.accumulate(power[::-1])[::-1]
        reference = [np.median(power[(f >= edge / 4) & (f <= edge / 2)]) if edge > 8 * f[1] else 0.0 for edge in f]
        empty = np.flatnonzero(above < EMPTY_BAND * np.array(reference))
        if empty.size == 0:
            return None
        edges.append(float(f[empty[0]]))
    return max(edges, default=None)
