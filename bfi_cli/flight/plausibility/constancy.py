"""Whether an error of a channel is the same from the first sample on, or begins during the flight.

Of what a relation is off by, a constant error and one that changes at an unknown time (by a step, a drift, or a ramp
that ends) are compared by their likelihoods. The noise is an AR(1) process of unknown size and correlation, under each
at its best. An error that changes is constant only as far as it is there before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...kernels import FloatArray
from ...kernels.change_scan import steps_and_ramps, whitened

# Samples on which the rivals are compared, onsets that are tried, evenly between the ends, and durations of ramps as
# parts of the record: how finely a course is known, which the likelihood of one that is near hardly asks.
MOST_COMPARED, ONSETS, DURATIONS = 400, 48, (1.0 / 2.0, 1.0 / 4.0, 1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0)
# LEAST_NOISE: least standard deviation of the noise, as a share of the relation's tolerance.
LEAST_NOISE = 0.02
# LEAST_LEFT: share of a course's squared length that is left beside a constant: it is rounding else.
LEAST_LEFT = 1e-6
# THROUGHOUT, MOSTLY: share of the samples before a change in which a constant error is beyond the tolerance; or,
# where these are few and the air is rough, of its whole size.
THROUGHOUT, MOSTLY = 0.9, 0.5


@dataclass(frozen=True, slots=True)
class ConstantPart:
    """What of an error is there from the first sample on, as a share of the whole, and the standard deviation of it."""

    share: float
    sd: float


def constant_part(
    difference: FloatArray, constant: FloatArray, time_s: FloatArray, *, tolerance: float
) -> ConstantPart | None:
    """Return the part of an error that is there from the first sample on, None where the error begins later.

    A change is one that is larger than the tolerance, within which healthy channels differ now more and now less; its
    onset, and a parameter more, have to gain what they cost (BIC).

    Parameters
    ----------
    difference : (n,) what a relation is off by, NaN where it is not known.
    constant : (n,) what an error of the whole size, in every sample, makes of it.
    time_s : (n,) seconds, increasing.
    tolerance : what the relation may be off by while its channels are right; with none that is finite nothing tells
        when an error begins, and it is taken to be constant.
    """
    if not np.isfinite(tolerance):
        return ConstantPart(1.0, np.inf)
    known = np.flatnonzero(np.isfinite(difference) & np.isfinite(constant))
    known = known[:: max(1, -(-known.size // MOST_COMPARED))]
    n, time_s = known.size, time_s[known]
    onsets_s = np.linspace(time_s[0], time_s[-1], ONSETS + 2)[1:-1]
    columns = (difference[known], constant[known], _courses(time_s, onsets_s))
    white, log_det = whitened(np.column_stack(columns), time_s)
    y, whole, courses = white[:, :, 0], white[:, :, 1], white[:, :, 2:]

    def likelihood(squares: FloatArray) -> FloatArray:
        variance = np.maximum(squares / n, (LEAST_NOISE * tolerance) ** 2)
        return np.asarray(-0.5 * (n * np.log(variance) + squares / variance + log_det))

    # 1. A constant error, at every correlation of the noise.
    power = np.sum(whole**2, axis=1, keepdims=True)
    amount = np.sum(whole * y, axis=1, keepdims=True) / power
    squares = np.sum((y - amount * whole) ** 2, axis=1, keepdims=True)
    throughout = likelihood(squares)
    k = int(throughout.argmax())
    sd = float(np.sqrt(squares[k, 0] / (n * power[k, 0])))
    # 2. One that changes: the constant and a course, whose products lose no digit that counts.
    yy, wy = (np.einsum("ri,ri->r", signal, y)[:, None] for signal in (y, whole))
    wc, cy = (np.einsum("ri,rij->rj", signal, courses) for signal in (whole, y))
    cc = np.einsum("rij,rij->rj", courses, courses)
    left = power * cc - wc**2
    is_known = left > LEAST_LEFT * power * cc
    amount = (cc * wy - wc * cy) / np.where(is_known, left, np.inf)
    size = (cy - amount * wc) / cc
    squares = np.maximum(yy - 2.0 * amount * wy + amount**2 * power - size**2 * cc, 0.0)
    changing = np.where(is_known & (np.abs(size) > tolerance), likelihood(squares), -np.inf)
    cost = np.log(courses.shape[2]) + 0.5 * np.log(n)
    if float(changing.max()) - cost <= float(throughout[k, 0]):
        return ConstantPart(1.0, sd)
    # 3. What it is before it changes.
    onset_s = onsets_s[int(changing.max(axis=0).argmax()) % ONSETS]
    whole_size = float(np.median(columns[1]))
    before = columns[0][time_s < onset_s] * np.sign(whole_size)
    size = float(np.median(before))
    is_throughout = float(np.quantile(before, 1.0 - THROUGHOUT)) > tolerance
    if size <= tolerance or not (is_throughout or size > MOSTLY * abs(whole_size)):
        return None
    return ConstantPart(1.0 if abs(size - abs(whole_size)) <= tolerance else min(size / abs(whole_size), 1.0), sd)


def _courses(time_s: FloatArray, onsets_s: FloatArray) -> FloatArray:
    """Return (n, n_courses) steps, drifts and ramps that end, each of the size of 1 where it is largest."""
    steps, since = steps_and_ramps(time_s, onsets_s)
    length_s = float(time_s[-1] - time_s[0])
    ramps = [np.minimum(since / (share * length_s), 1.0) for share in DURATIONS]
    drifts = since / (time_s[-1] - onsets_s)
    return np.concatenate([steps, drifts, *ramps], axis=1)
