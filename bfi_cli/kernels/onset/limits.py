"""How large a fault could be at every onset without being declared, from the likelihood profile over its magnitude.

A fault m added to a record, and analysed without a fault term, leaves the residual sum of squares that the record
itself has at the magnitude -m. So the profile of the record at hand tells what the statistic of a fault of any size
would be, the adaptation of the model to that fault included: dynamics that nearly integrate absorb a slow drift of any
size, and the profile is flat there, where a standard deviation from the curvature at its minimum is not.
"""

from __future__ import annotations

import numpy as np

from .. import TINY, FloatArray, IntArray
from .profile import log_ratio, minimise
from .scan import Profile, Scan, in_blocks, in_units, magnitude_bound, stack_onsets, tabulate
from .waveform import Waveform

# Magnitudes tried, relative to the one that a parabola through the minimum gives; between them the root of the
# deviance, which is nearly linear in the magnitude, is interpolated.
GRID = np.array([0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.2, 3.5, 6.0, 12.0, 30.0, 100.0])
# Distances from the minimum in its standard deviations, times the root of the deviance asked for.
BESIDE = np.array([0.0, 0.5, 1.0, 1.5, 2.5])
# Faults larger than an error are counted up to so many times as large: what hides a larger one hides these as well.
SPAN = 10.0
# Logarithm of the largest likelihood ratio that is told from larger ones.
LARGEST_EXPONENT = 500.0


def profile_with_deviances(
    scan: Scan, waveform: Waveform, onsets: IntArray, magnitudes: FloatArray
) -> tuple[Profile, FloatArray]:
    """Return the exact profile of a shape, and the statistic by which a record disagrees with faults of +m and of -m.

    Parameters
    ----------
    onsets : (n_onsets,) samples.
    magnitudes : (n_magnitudes, n_onsets), m in the unit of the shape.

    Returns
    -------
    profile : over the onsets.
    deviances : (2, n_magnitudes, n_onsets) n_rows log(RSS(+m) / RSS(0)), and of -m.
    """
    tables, m = tabulate(scan, waveform.samples), magnitudes * waveform.unit
    bound = magnitude_bound(scan, waveform, scan.n_samples - onsets)

    def block_profile(block: slice) -> FloatArray:
        stack = stack_onsets(scan, tables, onsets[block])
        return np.concatenate(
            [minimise(stack, bound[block]), *(log_ratio(stack, sign * m[:, block]) for sign in (1.0, -1.0))]
        )

    minimum, plus, minus = np.split(in_blocks(scan, len(onsets), block_profile), [3, 3 + len(m)])
    return in_units(scan, waveform, onsets, minimum), scan.n_rows * np.stack([plus, minus])


def deviances(scan: Scan, waveform: Waveform, onsets: IntArray, magnitudes: FloatArray) -> FloatArray:
    """Return the second of `profile_with_deviances` alone."""
    tables, m = tabulate(scan, waveform.samples), magnitudes * waveform.unit

    def block_ratios(block: slice) -> FloatArray:
        stack = stack_onsets(scan, tables, onsets[block])
        return np.array([log_ratio(stack, sign * m[:, block]) for sign in (1.0, -1.0)])

    return scan.n_rows * in_blocks(scan, len(onsets), block_ratios)


def undeclared_magnitudes(
    scan: Scan, waveform: Waveform, profile: Profile, *, power: float, suspicion: float, doubt: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the magnitudes that would be declared, that would be suspected, and that the record does not admit.

    Parameters
    ----------
    profile : of the shape at the onsets that are asked for.
    power, suspicion : statistics that a fault needs to be declared, and to be suspected, with the wanted power.
    doubt : statistic by which the record must disagree with a magnitude to exclude it.

    Returns
    -------
    Three arrays (n_onsets,): the first magnitude from which on every larger one reaches `power`, and `suspicion`, in
    the mean of both signs, and the first from which on both signs reach `doubt` beyond the best magnitude; infinite
    where none does.
    """
    seen = np.isfinite(profile.sd)
    linear = np.where(seen, profile.sd, 0.0)
    bound = magnitude_bound(scan, waveform, scan.n_samples - profile.onsets) / waveform.unit
    first = np.where(seen, np.sqrt(power) * linear, bound)
    # Not held within the scan's bound on magnitudes: the span of a record with such a fault would be larger.
    m = GRID[:, None] * np.maximum(first, 1e-9 * bound)
    # Beside the best magnitude, which a grid would step over where a fault is in the record.
    beside = np.abs(profile.z) + BESIDE[:, None] * np.sqrt(doubt) * linear
    m = np.sort(np.vstack([m, np.maximum(beside, m[:1])]), axis=0)
    plus, minus = deviances(scan, waveform, profile.onsets, m)
    reached = 0.5 * (plus + minus)
    against = np.minimum(plus, minus) + profile.statistic
    return (
        _from_there_on(m, reached, power),
        _from_there_on(m, reached, suspicion),
        _from_there_on(m, against, doubt),
    )


def _from_there_on(m: FloatArray, deviance: FloatArray, needed: float) -> FloatArray:
    """Return the first magnitude from which on the deviance is at least `needed`, interpolated in its root."""
    root, wanted = np.sqrt(np.maximum(deviance, 0.0)), np.sqrt(needed)
    below = root < wanted
    last = len(m) - 1 - np.argmax(below[::-1], axis=0)
    every = np.arange(m.shape[1])
    none, all_ = ~below.any(axis=0), below[-1]
    k = np.minimum(last, len(m) - 2)
    low, high = root[k, every], root[k + 1, every]
    part = np.divide(wanted - low, high - low, out=np.ones_like(low), where=high > low)
    magnitude = m[k, every] + np.clip(part, 0.0, 1.0) * (m[k + 1, every] - m[k, every])
    # Below the smallest magnitude tried the root falls in proportion.
    small = m[0] * np.divide(wanted, root[0], out=np.ones_like(root[0]), where=root[0] > 0.0)
    return np.where(all_, np.inf, np.where(none, small, magnitude))


def likelihood_ratios(both_signs: FloatArray, *, dispersion: float) -> FloatArray:
    """Return (n_magnitudes, n_onsets) how much likelier a record is with a fault than without, the mean of both signs.

    Parameters
    ----------
    both_signs : (2, n_magnitudes, n_onsets) see `deviances`.
    dispersion : by which deviances are divided, 1 for white errors.
    """
    exponents = np.clip(-0.5 * both_signs / dispersion, -LARGEST_EXPONENT, LARGEST_EXPONENT)
    return np.asarray(np.exp(exponents).mean(axis=0))


def mean_ratios(errors: FloatArray, ratios: FloatArray) -> FloatArray:
    """Return the mean likelihood ratio of the faults of each size up to `SPAN` times as large, at an unknown onset.

    It is the Bayes factor of such a fault against none where onsets are equally likely, and so are equal ratios of
    sizes.

    Parameters
    ----------
    errors : (n_errors,) sizes at equal ratios.
    ratios : (n_errors, n_onsets).

    Returns
    -------
    (n_kept,) of the first errors, those whose `SPAN` is within `errors`.
    """
    log_error = np.log(errors)
    width = int(np.ceil(np.log(SPAN) / (log_error[1] - log_error[0]) - 1e-9))
    mean = ratios.mean(axis=1)
    weights = np.ones(width + 1)
    weights[[0, -1]] = 0.5  # the trapezoidal rule
    return np.convolve(mean, weights / width, mode="valid")


def excluded_error(errors: FloatArray, means: FloatArray, most: float) -> float:
    """Return the least error from which on the mean likelihood ratio is at most `most`, infinite where there is none.

    Parameters
    ----------
    errors : (n_errors,); means : (n_kept,) of the first of them, see `mean_ratios`.
    """
    above = np.flatnonzero(means > most)
    if above.size == 0:
        return float(errors[0])
    last = int(above[-1])
    if last == len(means) - 1:
        return float("inf")
    high, low = np.log(means[last]), np.log(max(float(means[last + 1]), TINY))
    part = (high - np.log(most)) / (high - low)
    return float(errors[last] * (errors[last + 1] / errors[last]) ** part)
