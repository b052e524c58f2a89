"""A recorder's low-pass from the spectra of all channels, where no jumps of one quantum show it.

The spectrum of an aircraft's motion falls about as a power of the frequency; behind a low-pass it falls off a cliff, in
every channel at the same frequency. A spectrum says nothing of the phase, and the edge that it gives depends on the
kind of filter that is assumed: it is right to some 20 % with the right kind and wrong by up to 100 % with another.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from . import FloatArray
from .low_pass import RECORDERS, Kind, low_pass

# Samples of a segment at most, and segments at least; the spectra are averaged over segments that overlap by half.
SEGMENT, FEWEST_SEGMENTS = 512, 8
# From so many cycles per segment, below which the window smears a steep spectrum, to a share of the sampling rate.
LOWEST_CYCLES, HIGHEST = 8.0, 0.48
PER_OCTAVE = 8  # bands in which the spectrum is averaged
# Only the band counts that stands this far, in natural logarithms of power, above the smallest value: below it there is
# noise from behind the filter. Fewer bins than these do not tell a power law from a cliff.
ABOVE_FLOOR, FEWEST_BINS = 3.5, 12
# Edges that are tried, as a share of the sampling rate, 6 % apart.
EDGES = np.geomspace(0.03, 0.44, 48)
# Mean squared deviation from a power law, in natural logarithms, above which a channel shows a cliff. Recorded flights
# behind a low-pass have 0.5 to 11, with a median of 6; a drone's without one has 0.3 at most.
CLIFF = 1.0
# Share of it that the filter leaves at most, in the mean over the channels with a cliff. Behind the Gaussian of the
# flights at hand it leaves 0.1.
EXPLAINED = 0.3
# A single channel may have a low-pass of its own, a sensor's; a recorder has all of them.
FEWEST_CHANNELS, COMMON = 3, 0.5
# F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proc. IEEE 66 (1978),
# table I; the signs are those of an angle from -pi.
BLACKMAN_HARRIS = (0.35875, 0.48829, 0.14128, 0.01168)
# Larger values are no measurements, and their squares no numbers.
LARGEST = 1e100


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectralEstimate:
    """The low-pass that explains the spectra best.

    Attributes
    ----------
    kind, edge_hz : of the likeliest.
    others : the other kinds and their edges, the likeliest first.
    n_channels : with a cliff.
    """

    kind: Kind
    edge_hz: float
    others: tuple[tuple[Kind, float], ...]
    n_channels: int


def recorder_from_spectra(channels: Iterable[FloatArray], rate_hz: float) -> SpectralEstimate | None:
    """Return the low-pass common to the channels, None where their spectra show none.

    Parameters
    ----------
    channels : each (n_samples,), at `rate_hz`.
    """
    usable = [spectrum for values in channels if (spectrum := _spectrum(values)) is not None]
    cliffs = [(n, level, without) for n, level in usable if (without := float(_off_power_law(n, level))) > CLIFF]
    if len(cliffs) < max(FEWEST_CHANNELS, COMMON * len(usable)):
        return None
    left = [
        np.minimum(_off_power_law(n, level - _gains(n)[:, :, : len(level)]) / without, 1.0)
        for n, level, without in cliffs
    ]
    mean = np.mean(left, axis=0)  # (n_kinds, n_edges)
    best = np.argsort(mean.min(axis=1))
    edges = EDGES[mean.argmin(axis=1)] * rate_hz
    if mean[best[0]].min() > EXPLAINED:
        return None
    return SpectralEstimate(
        kind=RECORDERS[best[0]],
        edge_hz=float(edges[best[0]]),
        others=tuple((RECORDERS[i], float(edges[i])) for i in best[1:]),
        n_channels=len(cliffs),
    )


def _off_power_law(n: int, level: FloatArray) -> FloatArray:
    """Return the mean squared deviation (...,) of spectra (..., n_bins) of segments of n samples from a power law."""
    frequency = _bins(n)[0][: level.shape[-1]]
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(frequency)), np.log(frequency)]))
    return np.asarray(np.mean((level - (level @ basis) @ basis.T) ** 2, axis=-1))


def _spectrum(values: FloatArray) -> tuple[int, FloatArray] | None:
    """Return samples of a segment, and (n_bins,) the logarithm of power up to where noise from behind begins."""
    n = min(SEGMENT, 2 * (len(values) - 1) // (FEWEST_SEGMENTS + 1))
    if n < 4 * LOWEST_CYCLES or not np.abs(values).max() < LARGEST or np.ptp(values) == 0.0:
        return None
    # Differences whiten a steep spectrum, so that less of it leaks to high frequencies.
    steps = np.diff(values / np.ptp(values))
    segments = np.lib.stride_tricks.sliding_window_view(steps, n)[:: n // 2]
    centred = segments - segments.mean(axis=1, keepdims=True)
    power = np.mean(np.abs(np.fft.rfft(centred * _taper(n), axis=1)) ** 2, axis=0)[1:]
    power = power / (2.0 * np.sin(np.pi * np.arange(1, len(power) + 1) / n)) ** 2
    level = np.log(np.maximum([power[member].mean() for member in _bins(n)[1]], np.finfo(float).tiny))
    high = level > level.min() + ABOVE_FLOOR
    end = len(level) if high.all() else int(np.argmin(high))
    return (n, level[:end]) if end >= FEWEST_BINS else None


def _taper(n: int) -> FloatArray:
    """Return the periodic window of Blackman and Harris with four terms.

    Its side lobes lie 92 dB down, below the noise of any recorder. scipy.signal has it too, a second of imports.
    """
    angle = np.linspace(-np.pi, np.pi, n + 1)[:-1]
    return np.asarray(sum(a * np.cos(k * angle) for k, a in enumerate(BLACKMAN_HARRIS)), dtype=np.float64)


@lru_cache(maxsize=8)
def _bins(n: int) -> tuple[FloatArray, tuple[NDArray[np.int64], ...]]:
    """Return centre and members (of the frequencies 1/n, 2/n ... per sample) of bins equally wide in the logarithm."""
    frequency = np.arange(1, n // 2 + 1) / n
    low = LOWEST_CYCLES / n
    edges = np.geomspace(low, HIGHEST, 1 + int(PER_OCTAVE * np.log2(HIGHEST / low)))
    at = np.digitize(frequency, edges)
    members = tuple(np.flatnonzero(at == k) for k in range(1, len(edges)) if np.any(at == k))
    centres = np.exp([np.log(frequency[member]).mean() for member in members])
    return np.asarray(centres, dtype=np.float64), members


@lru_cache(maxsize=8)
def _gains(n: int) -> FloatArray:
    """Return the logarithm of the power gain of every kind and edge at the centres of the bins."""
    frequency, _ = _bins(n)
    gains = np.zeros((len(RECORDERS), len(EDGES), len(frequency)))
    for i, kind in enumerate(RECORDERS):
        for j, edge in enumerate(EDGES):
            taps = low_pass(kind, float(edge), 1.0).taps
            gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency, np.arange(len(taps)))) @ taps)
            gains[i, j] = 2.0 * np.log(np.maximum(gain, np.finfo(float).eps))
    return gains
