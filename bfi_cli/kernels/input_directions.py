"""The directions in which inputs move, their moments between samples, and which columns are needed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import FloatArray

BoolArray = NDArray[np.bool_]

# A channel that moves less, relative to its extent, shows round-off only.
STILL = 1e-9
# A column of which those before it leave less, relative to its norm, depends on them: above the round-off of filtering.
DEPENDENT = 1e-6
# A direction with a smaller share of the largest singular value is weak: inputs that move together differ by noise.
TOGETHER = 0.01


def directions(u: FloatArray, healthy: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return (n_samples, k) signals that span the inputs, the strongest first, and which hardly stand out of the noise.

    Surfaces that move together are logged one by one, each with its own noise: their mean is more precise than each of
    them, and their differences are noise. Inputs that rest in the healthy time stay as they are.

    Parameters
    ----------
    u : (n_samples, n_inputs); healthy : (n_samples,) the healthy time.
    """
    moved = u - u[healthy].mean(axis=0)
    spread, extent = moved[healthy].std(axis=0), np.abs(moved).max(axis=0, initial=0.0)
    rest = np.flatnonzero((spread <= STILL * extent) & (extent > 0.0))
    moving = np.flatnonzero(spread > STILL * extent)
    scaled = moved[:, moving] / spread[moving]
    _, values, V = np.linalg.svd(np.linalg.qr(scaled[healthy], mode="r"), full_matrices=False)
    signals = np.hstack([scaled @ V.T, moved[:, rest]])
    weak = np.append(values <= TOGETHER * values.max(initial=0.0), np.zeros(len(rest), dtype=bool))
    seen = np.abs(signals).max(axis=0, initial=0.0) > DEPENDENT
    return signals[:, seen], weak[seen]


def moments(u: FloatArray, factor: int) -> FloatArray:
    """Return (n_samples, k or 2 k): mean and first moment of each input over the last `factor` samples."""
    if factor == 1 or not u.shape[1]:
        return u
    held = np.vstack([np.repeat(u[:1], factor - 1, axis=0), u])
    windows = np.lib.stride_tricks.sliding_window_view(held, factor, axis=0)
    arms = (np.arange(factor) - 0.5 * (factor - 1)) / factor
    return np.hstack([windows.mean(axis=2), windows @ arms / factor])


def independent(u: FloatArray) -> NDArray[np.intp]:
    """Return which columns of u move and are no combination of those before them."""
    centred = u - u.mean(axis=0) if len(u) else u
    kept: list[int] = []
    for j, size in enumerate(np.ptp(u, axis=0) if u.shape[1] else ()):
        basis = np.linalg.qr(centred[:, kept])[0] if kept else np.zeros((len(u), 0))
        left = centred[:, j] - basis @ (basis.T @ centred[:, j])
        if size > 0.0 and np.linalg.norm(left) > DEPENDENT * np.linalg.norm(centred[:, j]):
            kept.append(j)
    return np.array(kept, dtype=np.intp)
