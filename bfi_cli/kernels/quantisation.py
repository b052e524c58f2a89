"""The quantisation step of a signal that was low-passed afterwards: the levels on which it rests lie on a grid."""

from __future__ import annotations

import numpy as np

from . import FloatArray

# s; a signal that rests this long has left a recorder's low-pass of 0.4 Hz and more behind it.
PLATEAU_S = 0.9
# Rest is a travel below this share of the median step between samples, and within the rounding of float32.
REST, ROUNDING = 0.05, 4.0 * float(np.finfo(np.float32).eps)
# Of jumps between neighbouring plateaus. On two recorded flights an altitude has 240 to 330 of them, a calibrated
# airspeed in cruise 40 to 75, a temperature about ten in two minutes. A few jumps tell a grid only where all lie on it.
FEWEST_JUMPS, MANY_JUMPS = 6, 20
# Jumps larger than this many median jumps say more of the rounding than of the grid.
LARGEST_JUMP = 12.0
# Mean cosine of the jumps' phases on the grid from which it is one: 1 on the grid, 0 for jumps of any size. The quanta
# of the two flights have 0.87 and above.
LEAST_COHERENCE, LEAST_OF_FEW = 0.8, 0.97
GRID_POINTS = 3000  # quanta that are tried, mostly less than a part in 1000 apart


def quantum_of_plateaus(x: FloatArray, rate_hz: float) -> float | None:
    """Return the step of the grid on which the levels of a signal lie where it rests, None where none is seen.

    Parameters
    ----------
    x : (n_samples,), samples that are not finite are left out.
    rate_hz : of the samples.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    x = x[np.isfinite(x)]
    size = max(2, round(PLATEAU_S * rate_hz))
    moves = np.abs(np.diff(x))
    moves = moves[moves > 0.0]
    if x.size < 4 * size or not moves.size:
        return None
    rest = max(REST * float(np.median(moves)), ROUNDING * float(np.abs(x).max()))
    rests = maximum_filter1d(x, size) - minimum_filter1d(x, size) <= rest
    edges = np.flatnonzero(np.diff(rests.astype(np.int8), prepend=0, append=0))
    levels = x[(edges[::2] + edges[1::2]) // 2]
    jumps = np.abs(np.diff(levels))
    jumps = jumps[jumps > 4.0 * rest]
    if jumps.size < FEWEST_JUMPS:
        return None
    middle = float(np.median(jumps))
    jumps = jumps[jumps <= LARGEST_JUMP * middle]
    low = max(5.0 * rest, 0.3 * float(np.quantile(jumps, 0.02)))
    if low >= middle:
        return None
    steps = np.geomspace(low, 1.05 * middle, GRID_POINTS)
    coherence = np.cos(2.0 * np.pi * jumps / steps[:, None]).mean(axis=1)
    # A half of the quantum is a grid of all jumps as well: the largest step that is nearly as good is the quantum.
    best = float(coherence.max())
    if best < (LEAST_COHERENCE if jumps.size >= MANY_JUMPS else LEAST_OF_FEW):
        return None
    last = int(np.flatnonzero(coherence > 0.9 * best)[-1])
    first = last
    while first and coherence[first - 1] > 0.9 * best:
        first -= 1
    rough = float(steps[first + int(np.argmax(coherence[first : last + 1]))])
    count = np.round(jumps / rough)
    near = (count > 0.0) & (np.abs(jumps - count * rough) < 0.2 * rough)
    return float(count[near] @ jumps[near] / (count[near] @ count[near]))
