"""Low-pass filters: those that recorders and conversions have, which one a record shows, and the one that decimates.

The edge of every kind of a recorder is where its gain is one half (-6 dB). The filter of a decimation acts alike on
inputs, outputs and dictionary.

A channel that rests on one level of its quantisation and then on the next is a step; what the log shows of it is the
step response of everything between the quantisation and the recorded sample. The jumps fall anywhere between two
samples, so that their average, aligned at the half crossing, shows the response on a grid finer than the log's.

Where no jumps show it the spectra of all channels do: that of an aircraft's motion falls about as a power of the
frequency; behind a low-pass it falls off a cliff, in every channel at the same frequency. A spectrum says nothing of
the phase, and the edge that it gives depends on the kind of filter that is assumed: it is right to some 20 % with the
right kind and wrong by up to 100 % with another.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from . import EPS, TINY, FloatArray
from .runs import mean_of_stretches, travel

Kind = Literal["gaussian", "fir", "butterworth", "causal", "sinc"]

# Those a recorder may have; a sinc is what a conversion to a lower rate uses.
RECORDERS: tuple[Kind, ...] = ("gaussian", "fir", "butterworth", "causal")
# Gain 1/2 of exp(-2 pi^2 sd^2 f^2) at the edge.
GAUSSIAN_SD = float(np.sqrt(np.log(2.0) / 2.0) / np.pi)
# Windowed sinc: half-length in periods of the edge, and the Kaiser window's beta, a stop band 50 dB down.
FIR_PERIODS, FIR_BETA = 1.3, 5.0
# ZERO_PHASE_ORDER, CAUSAL_ORDER: order of the pair that runs forwards and backwards, and of the filter that delays.
ZERO_PHASE_ORDER, CAUSAL_ORDER = 4, 2
# Gain 1/2 of a Butterworth filter of order 2 lies at 3^(1/4) of its -3 dB frequency.
CAUSAL_EDGE = 3.0**0.25
# Taps smaller than this share of the largest are dropped at both ends.
SMALLEST_TAP = 1e-5
# An edge above this share of the sampling rate leaves the samples as they are.
HIGHEST_EDGE = 0.45


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """A finite impulse response of unit gain at zero frequency.

    Attributes
    ----------
    taps : (n_taps,).
    before : taps that act before the input does, 0 for a causal filter; after : those that act later.
    """

    taps: FloatArray
    before: int

    @property
    def after(self) -> int:
        """Taps that act after the input."""
        return len(self.taps) - 1 - self.before

    @property
    def changes_nothing(self) -> bool:
        """Whether the output is the input."""
        return len(self.taps) == 1

    def gain(self, cycles: float) -> float:
        """Return the amplitude of the output of a sine of amplitude 1, of so many cycles a sample."""
        return float(np.abs(self.taps @ np.exp(-2j * np.pi * cycles * np.arange(len(self.taps)))))

    def then(self, other: Response) -> Response:
        """Return the response of this filter followed by another at the same rate."""
        return Response(taps=np.convolve(self.taps, other.taps), before=self.before + other.before)

    def filtered(self, x: FloatArray) -> FloatArray:
        """Return the (n - n_taps + 1, ...) output of x (n, ...) where the response has full support.

        Its first row belongs to row `after` of x.
        """
        if self.changes_nothing:
            return x.copy()
        flat = x.reshape(len(x), -1)
        columns = [np.convolve(column, self.taps, mode="valid") for column in flat.T]
        out = np.stack(columns, axis=1) if columns else np.zeros((len(x) - len(self.taps) + 1, 0))
        return np.asarray(out.reshape(len(out), *x.shape[1:]), dtype=np.float64)


IDENTITY = Response(taps=np.ones(1), before=0)


def low_pass(kind: Kind, edge_hz: float, rate_hz: float) -> Response:
    """Return the response of a filter on samples taken at a rate.

    Parameters
    ----------
    edge_hz : frequency of gain one half.
    rate_hz : of the samples.
    """
    if edge_hz >= HIGHEST_EDGE * rate_hz:
        return IDENTITY
    period = rate_hz / edge_hz
    match kind:
        case "gaussian":
            half = int(np.ceil(5.0 * GAUSSIAN_SD * period))
            return _trimmed(np.exp(-0.5 * (np.arange(-half, half + 1) / (GAUSSIAN_SD * period)) ** 2), half)
        case "fir":
            half = max(1, round(FIR_PERIODS * period))
            lag = np.arange(-half, half + 1)
            return _trimmed(np.sinc(2.0 * lag / period) * np.kaiser(2 * half + 1, FIR_BETA), half)
        case "butterworth":
            from scipy.signal import butter, sosfiltfilt

            impulse = np.zeros(1 + 2 * int(np.ceil(8.0 * period)))
            half = len(impulse) // 2
            impulse[half] = 1.0
            sos = butter(ZERO_PHASE_ORDER, edge_hz, fs=rate_hz, output="sos")
            return _trimmed(sosfiltfilt(sos, impulse, padtype=None), half)
        case "sinc":
            # The low-pass of a conversion to a rate of `edge_hz` over half its cutoff, see `SHARP`.
            half = round(SHARP.half_width * SHARP.cutoff * period / 2.0)
            lag = np.arange(-half, half + 1)
            return _trimmed(np.sinc(2.0 * lag / period) * np.kaiser(2 * half + 1, KAISER_BETA), half)
        case "causal":
            from scipy.signal import butter, sosfilt

            impulse = np.zeros(int(np.ceil(8.0 * period)))
            impulse[0] = 1.0
            # The bilinear transform takes a frequency f to tan(pi f / rate).
            cutoff = np.arctan(np.tan(np.pi * edge_hz / rate_hz) / CAUSAL_EDGE) * rate_hz / np.pi
            sos = butter(CAUSAL_ORDER, cutoff, fs=rate_hz, output="sos")
            return _trimmed(sosfilt(sos, impulse), 0)


def decimated(response: Response, factor: int) -> Response:
    """Return the response at a lower rate to what starts at one of its samples and stays between two of them.

    Exact for steps that start at a sample of the lower rate.
    """
    if factor == 1 or response.changes_nothing:
        return response
    step = np.concatenate([[0.0], np.cumsum(response.taps)])
    first = -int(np.ceil(response.before / factor))
    last = int(np.ceil(response.after / factor))
    ends = np.clip(np.arange(first - 1, last + 1) * factor + response.before + 1, 0, len(response.taps))
    return _trimmed(np.diff(step[ends]), -first)


def _trimmed(taps: FloatArray, before: int) -> Response:
    """Return a response of unit gain without negligible taps at its ends, taps of zero delay kept."""
    kept = np.flatnonzero(np.abs(taps) > SMALLEST_TAP * np.abs(taps).max())
    first, last = min(int(kept[0]), before), max(int(kept[-1]), before)
    taps = np.asarray(taps[first : last + 1], dtype=np.float64)
    return Response(taps=taps / taps.sum(), before=before - first)


Phase = Literal["linear-phase", "causal"]

# KAISER_BETA: shape of the window (Kaiser 1974), a stop band 63 dB down.
KAISER_BETA = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lowpass:
    """A windowed-sinc low-pass in front of a decimation.

    Attributes
    ----------
    half_width : taps on each side of the centre, in samples of the decimated signal.
    cutoff : -6 dB frequency over the new Nyquist frequency.
    kind : "linear-phase" (symmetric, its delay removed) or "causal" (minimum phase, same magnitude).
    """

    half_width: int
    cutoff: float
    kind: Phase = "linear-phase"


# Little aliasing: for resampling a log.
SHARP = Lowpass(half_width=8, cutoff=0.8)
# Half the power at the new Nyquist frequency, so that white noise stays white after the decimation: an empty band below
# Nyquist lets a VARX predict its own noise, which costs order and hides faults. Short, so that few samples are lost.
WHITE = Lowpass(half_width=2, cutoff=1.2)


@lru_cache(maxsize=32)
def lowpass_taps(factor: int, lowpass: Lowpass = SHARP) -> FloatArray:
    """Return the (n_taps,) low-pass taps in front of a decimation by `factor`, of unit gain at zero frequency.

    The array is shared between calls and cannot be written to.
    """
    if factor < 1:
        raise ValueError(f"factor must be at least 1, got {factor}")
    half = lowpass.half_width * factor if factor > 1 else 0
    taps = np.sinc(np.arange(-half, half + 1) * lowpass.cutoff / factor) * np.kaiser(2 * half + 1, KAISER_BETA)
    if lowpass.kind == "causal" and factor > 1:
        from scipy.signal import minimum_phase  # half a second of imports that the default does not need

        taps = minimum_phase(taps, half=False)
    taps = np.asarray(taps / taps.sum(), dtype=np.float64)
    taps.flags.writeable = False
    return taps


def lost_samples(factor: int, lowpass: Lowpass = SHARP) -> tuple[int, int]:
    """Return how many samples at the start and at the end have no full filter support."""
    n = lowpass_taps(factor, lowpass).size - 1
    return (n // 2, n // 2) if lowpass.kind == "linear-phase" else (n, 0)


def decimate(x: FloatArray, factor: int, lowpass: Lowpass = SHARP) -> FloatArray:
    """Low-pass filter `x` along axis 0 and keep every `factor`-th sample, where the filter has full support.

    Row i of the result belongs to input row `lost_samples(factor)[0] + i * factor`: nothing is padded, so a linear
    difference equation that `x` obeys is obeyed by the filtered signal up to the ends.

    Parameters
    ----------
    x : (n_samples, ...).
    factor : at least 1; 1 returns a copy.

    Raises
    ------
    ValueError : `x` is shorter than the filter.
    """
    x = np.asarray(x, dtype=np.float64)
    if factor == 1:
        return x.copy()
    n_taps = 2 * lowpass.half_width * factor + 1
    if x.shape[0] < n_taps:
        raise ValueError(f"{x.shape[0]} samples are fewer than the {n_taps} taps of the decimation by {factor}")
    taps = lowpass_taps(factor, lowpass)
    columns = np.ascontiguousarray(x.reshape(x.shape[0], -1).T)
    windows = np.lib.stride_tricks.sliding_window_view(columns, taps.size, axis=1)[:, ::factor]
    out = np.einsum("crt,t->cr", windows, taps[::-1], optimize=False)
    return np.ascontiguousarray(out.T).reshape(out.shape[1], *x.shape[1:])


# Levels must be flat to this share of the jump for this long on both sides of the transition.
FLAT, PLATEAU_S = 0.02, 0.8
# Transitions of at most these half-lengths, s: recorders with edges from 0.4 Hz up.
TRANSITIONS_S = (1.0, 1.8)
# One quantum: within this share of the channel's median jump. Fewer isolated jumps than these of one channel are
# manoeuvres, which are steps too, rather than a quantisation; on the flights at hand there are hundreds.
ALIKE, FEWEST_JUMPS = 0.1, 40
MOST_ALIKE_SHARE = 0.8
# Channels with the most jumps that are looked at: what a second one says differs by a per cent.
MOST_CHANNELS = 2
# Mean deviation of the averaged response from that of a kind of filter up to which the kind is taken to be known. The
# Gaussian of the flights at hand leaves 0.001 to 0.002, the other kinds 0.01 and more.
MISFIT = 0.01
# No further kind is tried, which takes half a second, where one is as near as NEAR, or the first, a Gaussian, as far as
# FAR: the others are up to 0.05 from the nearest Gaussian.
NEAR, FAR = 0.003, 0.1
# Edges tried first, as a share of the sampling rate, 10 % apart; the best of them is then refined to a part in 1000.
EDGES = np.geomspace(0.03, HIGHEST_EDGE, 30)
REFINED, COARSE = 1e-3, 3
# Larger values are no measurements, and their differences no numbers.
LARGEST = 1e100
# A jump between two samples is complete this many samples after its half crossing where there is no filter.
COMPLETE = 0.6
# Steps per sample of the grid on which a kind's own step response is made, and phases of its jumps.
FINE = 20


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
    jumps = []
    for values in channels:
        jumps_by_width = (_jumps(values, rate_hz, width_s) for width_s in TRANSITIONS_S)
        jumps += [first] if (first := next(filter(None, jumps_by_width), None)) else []
    most = sorted(jumps, key=lambda jump: -jump[2])[:MOST_CHANNELS]
    estimates = [_nearest_kind(*jump, rate_hz) for jump in most]
    known = [estimate for estimate in estimates if estimate.misfit < MISFIT]
    return min(known, key=lambda estimate: estimate.misfit / np.sqrt(estimate.n_jumps), default=None)


def _jumps(values: FloatArray, rate_hz: float, width_s: float) -> tuple[FloatArray, FloatArray, int] | None:
    """Return time after the half crossing, in samples, and level from 0 to 1, of all samples around all jumps."""
    plateau, half = max(2, round(PLATEAU_S * rate_hz)), round((width_s + PLATEAU_S) * rate_hz)
    n = 2 * half + 2 - plateau  # from the start of one plateau to that of the other
    if half == 0 or len(values) < n + plateau or not np.abs(values).max() < LARGEST:
        return None
    moved = travel(values, plateau)
    mean = mean_of_stretches(values, plateau)
    before, jump = mean[:-n], mean[n:] - mean[:-n]
    isolated = np.maximum(moved[:-n], moved[n:]) < FLAT * np.abs(jump)
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
    from .compiled import part_of_scipy

    optimize = part_of_scipy("optimize", "_optimize", "scipy.optimize")
    grid, response = _averaged(delay, level)
    if np.interp(COMPLETE, grid, response) > 1.0 - FLAT and np.interp(-COMPLETE, grid, response) < FLAT:
        return RecorderEstimate(kind=None, edge_hz=None, misfit=0.0, n_jumps=n_jumps)
    nearest = RecorderEstimate(kind=None, edge_hz=None, misfit=np.inf, n_jumps=n_jumps)
    for kind in RECORDERS:
        around = EDGES[np.clip(_nearest_edge(kind, grid, response) + np.array([-1, 1]), 0, len(EDGES) - 1)]
        edge, misfit, *_ = optimize.fminbound(
            _misfit, *around, args=(kind, grid, response), xtol=REFINED * around[0], full_output=True
        )
        if misfit < nearest.misfit:
            edge_hz = float(edge * rate_hz)
            nearest = RecorderEstimate(kind=kind, edge_hz=edge_hz, misfit=float(misfit), n_jumps=n_jumps)
        if not NEAR <= nearest.misfit <= FAR:
            break
    return nearest


def _nearest_edge(kind: Kind, grid: FloatArray, response: FloatArray) -> int:
    """Return which of the edges leaves the least misfit, sought about the best of every third: it has one minimum."""
    misfits = {k: _misfit(EDGES[k], kind, grid, response) for k in range(0, len(EDGES), COARSE)}
    best = min(misfits, key=misfits.__getitem__)
    beside = range(max(0, best - COARSE + 1), min(len(EDGES), best + COARSE))
    misfits |= {k: _misfit(EDGES[k], kind, grid, response) for k in beside if k not in misfits}
    return min(misfits, key=misfits.__getitem__)


def _averaged(delay: FloatArray, level: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean delays and median levels of bins of half a sample; a jump to and fro between two is an outlier."""
    bins = np.floor(2.0 * delay).astype(int)
    order = np.argsort(bins, kind="stable")
    starts = np.flatnonzero(np.diff(bins[order], prepend=bins[order[0]] - 1))
    groups = [group for group in np.split(order, starts[1:]) if len(group) >= 0.2 * len(order) / len(starts)]
    return np.array([delay[group].mean() for group in groups]), np.array([np.median(level[group]) for group in groups])


def _misfit(edge: float, kind: Kind, grid: FloatArray, response: FloatArray) -> float:
    """Return how far the averaged response of a kind is from the one seen, its jumps at all phases of the samples."""
    fine = low_pass(kind, edge, float(FINE))
    if fine.changes_nothing:
        return np.inf
    step = np.cumsum(fine.taps)
    k = int(np.argmax(step >= 0.5))
    before = step[k - 1] if k else 0.0
    half_crossing = k - 1 + (0.5 - before) / (step[k] - before)
    half = int(np.ceil(-grid[0])) + 2
    phase = np.arange(FINE) / FINE
    at = np.arange(-half, half + 1) + half_crossing / FINE + phase[:, None]
    level = np.interp(at, np.arange(len(step)) / FINE, step, left=0.0, right=1.0)
    last = np.argmax(level >= 0.5, axis=1) - 1
    every = np.arange(FINE)
    rise = level[every, last + 1] - level[every, last]
    delay = np.arange(level.shape[1]) - (last + (0.5 - level[every, last]) / rise)[:, None]
    bins = np.floor(2.0 * delay.ravel()).astype(int)
    bins -= bins.min()
    count = np.maximum(np.bincount(bins), 1)
    expected = np.interp(grid, np.bincount(bins, delay.ravel()) / count, np.bincount(bins, level.ravel()) / count)
    return float(np.sqrt(np.mean((expected - response) ** 2)))


# Samples of a segment at most, and segments at least; the spectra are averaged over segments that overlap by half.
SEGMENT, FEWEST_SEGMENTS = 512, 8
# From so many cycles per segment, below which the window smears a steep spectrum, to a share of the sampling rate.
LOWEST_CYCLES, HIGHEST = 8.0, 0.48
PER_OCTAVE = 8  # bands in which the spectrum is averaged
# Only the band counts that stands this far, in natural logarithms of power, above the smallest value: below it there is
# noise from behind the filter. Fewer bins than these do not tell a power law from a cliff.
ABOVE_FLOOR, FEWEST_BINS = 3.5, 12
# Edges that are tried, as a share of the sampling rate, 6 % apart.
SPECTRAL_EDGES = np.geomspace(0.03, 0.44, 48)
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
    edges = SPECTRAL_EDGES[mean.argmin(axis=1)] * rate_hz
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
    level = np.log(np.maximum([power[member].mean() for member in _bins(n)[1]], TINY))
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
    gains = np.zeros((len(RECORDERS), len(SPECTRAL_EDGES), len(frequency)))
    for i, kind in enumerate(RECORDERS):
        for j, edge in enumerate(SPECTRAL_EDGES):
            taps = low_pass(kind, float(edge), 1.0).taps
            gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency, np.arange(len(taps)))) @ taps)
            gains[i, j] = 2.0 * np.log(np.maximum(gain, EPS))
    return gains
