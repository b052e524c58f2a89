"""A static pressure that leaves its course at once and relaxes exponentially to another one, that of a cabin.

From the onset on the line shows p + (c - p) (1 - exp(-(t - onset) / T)) of a static pressure p, which is taken to go on
as it did before, and of a cabin's c, which stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...kernels import BoolArray, FloatArray, IntArray
from .finding import as_good

# These constants were set on both recorded Citations with leaks of 1 to 20 s (docs/theory.md, 15.6), except where a
# reason is given.
# s over which a rate is taken, before the onset and after it.
RATE_BEFORE_S, RATE_AFTER_S = 5.0, 1.5
# s. Faster than the first the line jumps, and slower than the last it shows no onset; those tried are a tenth apart.
STEPS = np.geomspace(0.5, 30.0, 44)
# Time constants after the onset that are fitted, and s at least. The static pressure does not go on as it did for
# longer, nor is much left of it.
FITTED, LEAST_FITTED_S = 4.0, 5.0
# s after the onset, in which a recorder's low-pass rounds it.
ROUNDED_S = 1.0
# GAP, FEWEST: factor on the usual step beyond which two blocks have a gap between them; blocks that a fit needs.
GAP, FEWEST = 1.75, 5
# MISFIT_OF_CHANGE: share of the change of pressure by which the course may stray from the fit.
MISFIT_OF_CHANGE = 0.03
# Times the rate before the onset, by which the rate changes at least.
MORE_THAN_STOPPED = 3.0
# s around a candidate in which its onset is sought: the rate after it is a mean.
AROUND_S = 3.0
# Errors of neighbouring blocks are alike, so that a fifth of them count.
ALIKE = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """The exponential that fits best from an onset.

    Attributes
    ----------
    onset : index of the block; from_s, to_s : its interval, 95 %.
    time_constant_s : of the exponential.
    change : of the pressure, Pa; level : to which it goes, Pa; rate : of the pressure before, Pa/s.
    loss : mean square of what is left, over that of the change, in n_blocks.
    """

    onset: int
    from_s: float
    to_s: float
    time_constant_s: float
    change: float
    level: float
    rate: float
    loss: float
    n_blocks: int

    @property
    def jump(self) -> float:
        """Change of the rate, Pa/s; with a time constant too short for a rate, the change over `AROUND_S`."""
        return self.change / max(self.time_constant_s, AROUND_S)


def relaxations(
    time_s: FloatArray, pressure: FloatArray, within: BoolArray, least_jump: FloatArray
) -> list[Relaxation]:
    """Return the relaxations of a pressure, in the order of their onsets.

    Parameters
    ----------
    time_s, pressure : (n,) s and Pa.
    within : (n,) where an onset is looked for.
    least_jump : (n,) by how much the rate must change at an onset, Pa/s; nothing begins where it is not known.
    """
    if len(time_s) < 3:
        return []
    step_s = float(np.median(np.diff(time_s)))
    before, after = (max(2, round(seconds / step_s)) for seconds in (RATE_BEFORE_S, RATE_AFTER_S))
    k = np.arange(before, len(time_s) - after)
    earlier = (pressure[k] - pressure[k - before]) / (time_s[k] - time_s[k - before])
    later = (pressure[k + after] - pressure[k]) / (time_s[k + after] - time_s[k])
    jumps = np.nan_to_num(np.where(within[k], np.abs(later - earlier) / least_jump[k], 0.0))
    kept: list[Relaxation] = []
    around = max(1, round(AROUND_S / step_s))
    while jumps.size and jumps.max() >= 1.0:
        largest = int(np.argmax(jumps))
        relaxation = _best(time_s, pressure, k[max(0, largest - around) : largest + around + 1], before, least_jump)
        if relaxation is not None:
            kept.append(relaxation)
        jumps[max(0, largest - 2 * around) : largest + 2 * around + 1] = 0.0
    return sorted(kept, key=lambda relaxation: relaxation.onset)


def _best(
    time_s: FloatArray, pressure: FloatArray, onsets: IntArray, before: int, least_jump: FloatArray
) -> Relaxation | None:
    """Return the relaxation from the onset that fits best, None where it does not fit well.

    None too where the rate jumps by little more than it was: the pressure then stops, as that of a blocked port does.
    """
    fits = [fit for onset in onsets.tolist() if (fit := _fitted(time_s, pressure, onset, before)) is not None]
    if not fits:
        return None
    best = min(fits, key=lambda fit: fit.loss)
    least = max(least_jump[best.onset], MORE_THAN_STOPPED * abs(best.rate))
    if best.loss > MISFIT_OF_CHANGE**2 or abs(best.jump) < least:
        return None
    near = as_good(np.array([fit.loss for fit in fits]), best.n_blocks, ALIKE)
    step_s = float(time_s[best.onset] - time_s[best.onset - 1])
    return replace(best, from_s=fits[near[0]].from_s - step_s, to_s=fits[near[-1]].to_s + step_s)


def _fitted(time_s: FloatArray, pressure: FloatArray, onset: int, before: int) -> Relaxation | None:
    """Return the best of the exponentials from an onset, None where samples for it are missing."""
    earlier = slice(onset - before, onset + 1)
    if not np.isfinite(pressure[earlier]).all():
        return None
    since_s, steps_s = time_s - time_s[onset], np.diff(time_s)
    line = np.column_stack([np.ones(before + 1), since_s[earlier]])
    start, rate = np.linalg.lstsq(line, pressure[earlier], rcond=None)[0].tolist()
    # Last block of every exponential, without the blocks after a missing one.
    last = np.searchsorted(time_s, time_s[onset] + np.maximum(FITTED * STEPS, LEAST_FITTED_S))
    missing = np.isnan(pressure[onset - before + 1 :]) | (steps_s[onset - before :] > GAP * float(np.median(steps_s)))
    last = last[last <= onset - before + (int(np.argmax(missing)) if missing.any() else len(missing))]
    blocks = np.arange(onset, last[-1] + 1 if last.size else onset)[:, None]
    fitted = (since_s[blocks] >= ROUNDED_S) & (blocks <= last)
    count = np.count_nonzero(fitted, axis=0)
    if not np.any(count >= FEWEST):
        return None
    gone = -np.expm1(-since_s[blocks] / STEPS[: last.size])
    rest = np.where(fitted, pressure[blocks] - (1.0 - gone) * (start + rate * since_s[blocks]), 0.0)
    gone = np.where(fitted, gone, 0.0)
    level = np.einsum("ij,ij->j", gone, rest) / np.maximum(np.einsum("ij,ij->j", gone, gone), np.finfo(float).tiny)
    squares = np.sum((rest - gone * level) ** 2, axis=0) / np.maximum(count, 1)
    loss = np.where(count >= FEWEST, squares / np.maximum((level - start) ** 2, np.finfo(float).tiny), np.inf)
    k = int(np.argmin(loss))
    return Relaxation(
        onset=onset,
        from_s=float(time_s[onset]),
        to_s=float(time_s[onset]),
        time_constant_s=float(STEPS[k]),
        change=float(level[k]) - start,
        level=float(level[k]),
        rate=rate,
        loss=float(loss[k]),
        n_blocks=int(last[k]) - onset + 1,
    )
