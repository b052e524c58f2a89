"""Stretches in which one channel is noisier than beside them, and no other: what eddies do to an airspeed.

Turbulence stirs load and attitude as well and begins for good; a wake, a slipstream or a formation disturbs the
airspeed alone, while it is crossed. The level of each second is that of the second differences of its samples, so that
courses, steps and readings that stay wrong raise none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..flightlog import FlightLog
from ..flightlog.phases import Phase
from ..kernels import BoolArray, FloatArray, IntArray
from ..kernels.runs import within
from .parity.record import over_seconds, seconds_of_samples
from .parity.windows import flight_stretches
from .result import Event, OrdinaryEvent
from .tables import AIRSPEED_ROWS, ORDINARY, ROWS

# Lengths of a stretch, and of the flight on each side that is as calm as the rest, s.
LENGTHS_S, CALM_S = (20, 30, 45, 60, 90, 120), 30
QUIETEST = 0.2  # of its median, below which a level is rounding
# Log density from which on eddies are told: of 14 healthy flights of six aircraft they reach 21, without the SR22T 15
# (tests/measurements/test_told_levels.py).
TOLD = 40.0
# Sensors that no airspeed moves: what stirs them too is turbulence or a manoeuvre.
OTHERS = (*(row.channel for name, row in ROWS.items() if name not in (*AIRSPEED_ROWS, "sat")), "roll")


def noisy_events(log: FlightLog, phases: Sequence[Phase], events: Sequence[Event]) -> Iterator[OrdinaryEvent]:
    """Yield the stretches of flight in which the channel of an ordinary cause alone is noisier, the surest first.

    Parameters
    ----------
    events : that stand. What is declared of the channel is what disturbs it there.
    """
    recorded = [name for name, channel in log.channels.items() if not channel.derived_from]
    seconds, n = seconds_of_samples(log)
    start_s = log.time_s[np.searchsorted(seconds, np.arange(n))]
    flies = within(start_s, flight_stretches(phases))
    for cause, row in ORDINARY.items():
        name = next((name for name in row.noisy if name in recorded), "")
        if not name:
            continue
        others = [_levels(log, other, seconds, flies=flies) for other in OTHERS if other in recorded]
        for first, end, ratio, gain in _noisy(_levels(log, name, seconds, flies=flies), others):
            from_s, to_s = float(start_s[first]), float(start_s[end])
            about = [
                event for event in events if name in event.channels and from_s - CALM_S < event.onset_s < to_s + CALM_S
            ]
            if all(event.state != "declared" for event in about):
                yield OrdinaryEvent(
                    cause=cause,
                    from_s=from_s,
                    to_s=to_s,
                    magnitude=ratio,
                    unit=row.unit,
                    ci95=None,
                    looks_like=about[0].fault if about else "",
                    evidence={"gain": gain},
                )


def _levels(log: FlightLog, name: str, seconds: IntArray, *, flies: BoolArray) -> FloatArray:
    """Return by second the logarithm of a channel's noise in flight beside its median, NaN where it has none."""
    differences = np.diff(log.channels[name].values, n=2, prepend=np.nan, append=np.nan)
    level = np.where(flies, over_seconds(differences**2, seconds, flies.size, log.rate_hz), np.nan)
    moving = level[level > 0.0]
    usual = float(np.median(moving)) if moving.size else 1.0
    return 0.5 * np.log(np.maximum(level / usual, QUIETEST**2))


def _noisy(levels: FloatArray, others: Sequence[FloatArray]) -> list[tuple[int, int, float, float]]:
    """Return first second, end, ratio of the noise and log density of what is noisy by itself, the surest first."""
    stretches = []
    for n in (n for n in LENGTHS_S if n + 2 * CALM_S < levels.size):
        inside, before, after = _parts(levels, n)
        rises = alone = inside - np.maximum(before, after)
        for other in others:
            inside, before, after = _parts(other, n)
            alone = alone - np.fmax(inside - 0.5 * (before + after), 0.0)
        variances = np.exp(2.0 * np.fmax(alone, 0.0))
        gains = 0.5 * n * (variances - 1.0 - np.log(variances))
        stretches += [
            (int(k) + CALM_S, int(k) + CALM_S + n, float(np.exp(rises[k])), float(gains[k]))
            for k in np.flatnonzero(gains > TOLD)
        ]
    stretches.sort(key=lambda stretch: -stretch[3])
    apart: list[tuple[int, int, float, float]] = []
    for stretch in stretches:
        if all(stretch[0] >= end + CALM_S or stretch[1] + CALM_S <= first for first, end, _, _ in apart):
            apart.append(stretch)
    return apart


def _parts(levels: FloatArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mean level of every stretch of n seconds, and of what lies before and after it."""
    inside = sliding_window_view(levels, n).mean(axis=-1)[CALM_S : levels.size - n - CALM_S + 1]
    beside = sliding_window_view(levels, CALM_S).mean(axis=-1)
    return inside, beside[: inside.size], beside[CALM_S + n :]
