"""Low-pass filters: the impulse responses of those that recorders and conversions have, and the one that decimates.

The edge of every kind of a recorder is where its gain is one half (-6 dB). The filter of a decimation acts alike on
inputs, outputs and dictionary.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from . import FloatArray

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
        return np.asarray(out.reshape(-1, *x.shape[1:]), dtype=np.float64)


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
            # The low-pass of a conversion to a rate of `edge_hz` over half its cutoff, see `decimation.SHARP`.
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
