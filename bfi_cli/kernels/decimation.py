"""Low-pass and decimate: the one filter that acts alike on inputs, outputs and dictionary."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from . import FloatArray

Kind = Literal["linear-phase", "causal"]

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
    kind: Kind = "linear-phase"


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
