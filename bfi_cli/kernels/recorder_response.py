"""A recorder's low-pass from isolated one-quantum jumps of channels that were quantised before it.

A channel that rests on one level of its quantisation and then on the next is a step; what the log shows of it is the
step response of everything between the quantisation and the recorded sample. The jumps fall anywhere between two
samples, so that their average, aligned at the half crossing, shows the response on a grid finer than the log's.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .low_pass import HIGHEST_EDGE, RECORDERS, Kind, low_pass

# Levels must be flat to this share of the jump for this long on both sides of the transition.
FLAT, PLATEAU_S = 0.02, 0.8
# Transitions of at most these half-lengths, s: recorders with edges from 0.4 Hz up.
TRANSITIONS_S = (1.0, 1.8)
# One quantum: within this share of the channel's median jump. Fewer isolated jumps than these of one channel are
# manoeuvres, which are steps too, rather than a quantisation; on the flights at hand there are hundreds.
ALIKE, FEWEST_JUMPS = 0.1, 40
MOST_ALIKE_SHARE = 0.8
# Mean deviation of the averaged response from that of a kind of filter up to which the kind is taken to be known. The
# Gaussian of the flights at hand leaves 0.001 to 0.002, the other kinds 0.01 and more.
MISFIT = 0.01
# Edges tried first, as a share of the sampling rate, 10 % apart; the best of them is then refined to a part in 1000.
EDGES = np.geomspace(0.03, HIGHEST_EDGE, 30)
REFINED = 1e-3
# A jump between two samples is complete this many samples after its half crossing where there is no filter.
SHARP = 0.6
# Steps per sample of the grid on which a kind's own step response is made.
FINE = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderEstimate:
    """The low-pass that jumps went through.

    Attributes
    ----------
    kind, edge_hz : of the filter nearest to the averaged response; both None where the jumps are as sharp as samples.
    misfit : root-mean-square deviation from it, of a step of 1.
    n_jumps : averaged.
    """

    kind: Kind | None
    edge_hz: float | None
    misfit: float
    n_jumps: int


def recorder_from_jumps(channels: Iterable[FloatArray], rate_hz: float) -> RecorderEstimate | None:
    """Return the low-pass in front of the samples, None where no channel shows jumps of one quantum enough.

    Parameters
    ----------
    channels : each (n_samples,), at `rate_hz`.
    """
    estimates = []
    for values in channels:
        for width_s in TRANSITIONS_S:
            jumps = _jumps(values, rate_hz, width_s)
            if jumps is not None:
                estimates.append(_nearest_kind(*jumps, rate_hz))
                break
    known = [estimate for estimate in estimates if estimate.misfit < MISFIT]
    return min(known, key=lambda estimate: estimate.misfit / np.sqrt(estimate.n_jumps), default=None)


def _jumps(values: FloatArray, rate_hz: float, width_s: float) -> tuple[FloatArray, FloatArray, int] | None:
    """Return time after the half crossing, in samples, and level from 0 to 1, of all samples around all jumps."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

    plateau, half = max(2, round(PLATEAU_S * rate_hz)), round((width_s + PLATEAU_S) * rate_hz)
    n = 2 * half + 2 - plateau  # from the start of one plateau to that of the other
    if len(values) < n + plateau or not np.isfinite(values).all():
        return None
    centre = slice(plateau // 2, len(values) - plateau + plateau // 2 + 1)
    travel = (maximum_filter1d(values, plateau) - minimum_filter1d(values, plateau))[centre]
    mean = uniform_filter1d(values, plateau)[centre]
    before, jump = mean[:-n], mean[n:] - mean[:-n]
    isolated = np.maximum(travel[:-n], travel[n:]) < FLAT * np.abs(jump)
    middle, last, first = before + 0.5 * jump, values[half:][: len(before)], values[half + 1 :][: len(before)]
    at = np.flatnonzero(isolated & ((last - middle) * (first - middle) <= 0.0) & (last != first))
    if at.size < FEWEST_JUMPS:
        return None
    alike = np.abs(np.abs(jump[at]) / np.median(np.abs(jump[at])) - 1.0) < ALIKE
    at, share = at[alike], float(alike.mean())
    if at.size < FEWEST_JUMPS or share < MOST_ALIKE_SHARE:
        return None
    crossing = half + (middle[at] - last[at]) / (first[at] - last[at])
    inside = np.arange(2 * half + 2)
    level = (values[at[:, None] + inside] - before[at, None]) / jump[at, None]
    return (inside - crossing[:, None]).ravel(), level.ravel(), int(at.size)


def _nearest_kind(delay: FloatArray, level: FloatArray, n_jumps: int, rate_hz: float) -> RecorderEstimate:
    """Return the kind of filter whose step response is nearest to the averaged one."""
    from scipy.optimize import minimize_scalar

    grid, response = _averaged(delay, level)
    if np.interp(SHARP, grid, response) > 1.0 - FLAT and np.interp(-SHARP, grid, response) < FLAT:
        return RecorderEstimate(kind=None, edge_hz=None, misfit=0.0, n_jumps=n_jumps)
    nearest = RecorderEstimate(kind=None, edge_hz=None, misfit=np.inf, n_jumps=n_jumps)
    for kind in RECORDERS:
        misfits = [_misfit(edge, kind, grid, response) for edge in EDGES]
        around = EDGES[np.clip(int(np.argmin(misfits)) + np.array([-1, 1]), 0, len(EDGES) - 1)]
        refined = minimize_scalar(
            _misfit,
            bounds=around,
            args=(kind, grid, response),
            method="bounded",
            options={"xatol": REFINED * around[0]},
        )
        if refined.fun < nearest.misfit:
            edge_hz, misfit = float(refined.x * rate_hz), float(refined.fun)
            nearest = RecorderEstimate(kind=kind, edge_hz=edge_hz, misfit=misfit, n_jumps=n_jumps)
    return nearest


def _averaged(delay: FloatArray, level: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean delays and levels of bins of half a sample."""
    bins = np.floor(2.0 * delay).astype(int)
    bins -= bins.min()
    count = np.bincount(bins)
    kept = count >= 0.2 * np.median(count)
    grid = np.bincount(bins, delay)[kept] / count[kept]
    return grid, np.bincount(bins, level)[kept] / count[kept]


def _misfit(edge: float, kind: Kind, grid: FloatArray, response: FloatArray) -> float:
    """Return how far a kind's step response, aligned at its half crossing, is from the averaged one."""
    fine = low_pass(kind, edge, float(FINE))
    if fine.changes_nothing:
        return np.inf
    step = np.concatenate([np.zeros(1), np.cumsum(fine.taps)])
    k = int(np.argmax(step >= 0.5))
    half = k - 1 + (0.5 - step[k - 1]) / (step[k] - step[k - 1])
    expected = np.interp(grid, (np.arange(len(step)) - half) / FINE, step, left=0.0, right=1.0)
    return float(np.sqrt(np.mean((expected - response) ** 2)))
