"""Low-pass and decimate: the one filter that acts alike on inputs, outputs and dictionary (METHOD section 4)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["decimate", "lowpass_taps", "lost_samples"]

FloatArray = NDArray[np.float64]
Kind = Literal["linear-phase", "causal"]

HALF_WIDTH = 8
CUTOFF = 0.8


def lowpass_taps(factor: int, *, kind: Kind = "linear-phase") -> FloatArray:
    """Return the low-pass taps in front of a decimation by `factor`, of unit gain at zero frequency.

    Parameters
    ----------
    factor : the decimation factor, 1 for no filter.
    kind : "linear-phase" (symmetric, delay removed by `decimate`) or "causal" (minimum phase).

    Returns
    -------
    (n_taps,) taps.
    """
    if factor < 1:
        raise ValueError(f"factor must be at least 1, got {factor}")
    if factor == 1:
        return np.ones(1)
    taps = signal.firwin(2 * HALF_WIDTH * factor + 1, CUTOFF / factor, window=("kaiser", 6.0))
    if kind == "causal":
        taps = signal.minimum_phase(taps, half=False)
    return np.asarray(taps / taps.sum(), dtype=np.float64)


def lost_samples(factor: int, *, kind: Kind = "linear-phase") -> tuple[int, int]:
    """Return how many samples at the start and at the end have no full filter support."""
    n = lowpass_taps(factor, kind=kind).size - 1
    return (n // 2, n // 2) if kind == "linear-phase" else (n, 0)


def decimate(x: FloatArray, factor: int, *, kind: Kind = "linear-phase") -> FloatArray:
    """Low-pass filter `x` along axis 0 and keep every `factor`-th sample, where the filter has full support.

    Row i of the result belongs to input row `lost_samples(factor)[0] + i * factor`: nothing is padded, so a linear
    difference equation that `x` obeys is obeyed by the filtered signal up to the end.

    Parameters
    ----------
    x : (n_samples, ...).
    factor : at least 1.

    Raises
    ------
    ValueError : `x` is shorter than the filter.
    """
    x = np.asarray(x, dtype=np.float64)
    if factor == 1:
        return x.copy()
    taps = lowpass_taps(factor, kind=kind)
    if x.shape[0] < taps.size:
        raise ValueError(f"{x.shape[0]} samples are fewer than the {taps.size} taps of the decimation by {factor}")
    shape = (-1,) + (1,) * (x.ndim - 1)
    return np.ascontiguousarray(signal.fftconvolve(x, taps.reshape(shape), mode="valid", axes=0)[::factor])
