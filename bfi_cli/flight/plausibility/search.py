"""Which channel is to blame where relations fail throughout a flight, and what would make all of them fit.

Relations are held against a whole log once a second, in flight.

Whether an error is the same from the first sample on, or begins during the flight: of what a relation is off by, a
constant error and one that changes at an unknown time (by a step, a drift, or a ramp that ends) are compared by their
likelihoods. The noise is an AR(1) process of unknown size and correlation, under each at its best. An error that
changes is constant only as far as it is there before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...airdata.relations import Relation, State
from ...kernels import FloatArray, IntArray
from .changes import Change, named_changes
from .misfits import ALIKE, Misfit, misfit_of, sides_of

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


def constant_part(
    difference: FloatArray, constant: FloatArray, time_s: FloatArray, *, tolerance: float
) -> tuple[float, float] | None:
    """Return what of an error is there from the first sample on, as a share of the whole, and the deviation of that.

    None where the error begins later. A change is one that is larger than the tolerance, within which healthy channels
    differ now more and now less; its onset, and a parameter more, have to gain what they cost (BIC).

    Parameters
    ----------
    difference : (n,) what a relation is off by, NaN where it is not known.
    constant : (n,) what an error of the whole size, in every sample, makes of it.
    time_s : (n,) seconds, increasing.
    tolerance : what the relation may be off by while its channels are right; with none that is finite nothing tells
        when an error begins, and it is taken to be constant.
    """
    if not np.isfinite(tolerance):
        return 1.0, np.inf
    from ...kernels.change_scan import steps_and_ramps, whitened

    known = np.flatnonzero(np.isfinite(difference) & np.isfinite(constant))
    known = known[:: max(1, -(-known.size // MOST_COMPARED))]
    n, time_s = known.size, time_s[known]
    onsets_s = np.linspace(time_s[0], time_s[-1], ONSETS + 2)[1:-1]
    # Steps, drifts and ramps that end, each of the size of 1 where it is largest.
    steps, since_s = steps_and_ramps(time_s, onsets_s)
    ramps = [np.minimum(since_s / (share * float(time_s[-1] - time_s[0])), 1.0) for share in DURATIONS]
    columns = (difference[known], constant[known], steps, since_s / (time_s[-1] - onsets_s), *ramps)
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
        return 1.0, sd
    # 3. What it is before it changes.
    onset_s = onsets_s[int(changing.max(axis=0).argmax()) % ONSETS]
    whole_size = float(np.median(columns[1]))
    before = columns[0][time_s < onset_s] * np.sign(whole_size)
    size = float(np.median(before))
    is_throughout = float(np.quantile(before, 1.0 - THROUGHOUT)) > tolerance
    if size <= tolerance or not (is_throughout or size > MOSTLY * abs(whole_size)):
        return None
    return 1.0 if abs(size - abs(whole_size)) <= tolerance else min(size / abs(whole_size), 1.0), sd


SIMPLER = float(np.log(2.0))  # of the cost, that a scale must be better by: its misfit in one relation half as large
# SOLVED, MOST_STEPS: share of a relation's residual that its solution leaves; iterations of the secant to there.
SOLVED, MOST_STEPS = 1e-3, 6
MOST_FINDINGS = 3
FEWEST_CLOCKED = 2  # relations that tell the time, of which one alone may have a wrong channel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blame:
    """A change that makes relations fit which fail without it, and the others that would do the same.

    Attributes
    ----------
    explains : the relations; misfit : of the first of them with the change, over what it expects.
    share_sd : standard deviation of the size of an offset or a scale, as a share of it; infinite where nothing tells.
    """

    change: Change
    rivals: tuple[Change, ...]
    explains: tuple[Relation, ...]
    misfit: float
    share_sd: float = np.inf


def blames(known: Mapping[Relation, IntArray], state: State, stated: Mapping[str, str | None]) -> list[Blame]:
    """Return what explains the relations that fail throughout a flight, what explains most of them first.

    A change is to blame that makes relations hold which fail, and lets none fail that holds. Of changes that explain
    the same, one that has a name (a unit, a sign) is likelier than a size that fits whatever it is, one channel than
    several, and the unit of a channel that states none likelier than a stated one; what is left are rivals. What
    the unit of a channel would explain that states another is named, and the channel stays as it is. What fails by an
    error that begins during the flight is left to the analyses.

    Parameters
    ----------
    known : the relations with the seconds in which the log tells of them.
    stated : the units that the log states, None where it does not.
    """
    to_blame, known = list[Blame](), dict(known)
    while len(to_blame) < MOST_FINDINGS:
        before = {relation: misfit_of(relation, rows, state) for relation, rows in known.items()}
        failing = [relation for relation, misfit in before.items() if misfit.fails]
        if not failing:
            break
        blame = _blame(known, before, state, failing, stated)
        if blame is None:
            break
        if blame.change.is_constant:
            part = _constant_part(blame.explains[0], known[blame.explains[0]], blame.change, state)
            if part is None:
                known = {relation: rows for relation, rows in known.items() if relation not in blame.explains}
                continue
            share, sd = part
            changes = [rival.part(share) for rival in (blame.change, *blame.rivals)]
            blame = replace(blame, change=changes[0], rivals=tuple(changes[1:]), share_sd=sd / abs(share))
        to_blame.append(blame)
        if blame.change.doubts_unit(stated):
            untold = [relation for relation in failing if _is_touched(relation, blame.change, state)]
            known = {relation: rows for relation, rows in known.items() if relation not in untold}
            continue
        state = blame.change.of(state)
    return to_blame


def _is_touched(relation: Relation, change: Change, state: State) -> bool:
    """Return whether a relation takes a channel that is changed, or a rate by a clock that is."""
    if change.what == "clock":
        return relation.timed
    return not set(change.channels).isdisjoint(relation.channels(state.values))


def _constant_part(relation: Relation, rows: IntArray, change: Change, state: State) -> tuple[float, float] | None:
    """Return what of an offset or a scale is there from the first sample on, None where it begins later."""
    with np.errstate(all="ignore"):
        difference, left = (np.subtract(*sides_of(relation, rows, case)).ravel() for case in (state, change.of(state)))
        constant = difference - left
    tolerance = misfit_of(relation, rows, state).tolerance
    return constant_part(difference, constant, state.time_s[rows.ravel()], tolerance=tolerance)


def _blame(
    known: Mapping[Relation, IntArray],
    before: Mapping[Relation, Misfit],
    state: State,
    failing: Sequence[Relation],
    stated: Mapping[str, str | None],
) -> Blame | None:
    suspects = tuple(dict.fromkeys(name for relation in failing for name in relation.channels(state.values)))
    explanations: list[tuple[tuple[float, ...], Blame]] = []
    for change in (*named_changes(suspects, state.values, stated), *_sized(suspects, failing, known, state)):
        changed = change.of(state)
        touched = [relation for relation in known if _is_touched(relation, change, state)]
        explained: list[Relation] = []
        cost, left = 0.0, 0.0
        # What fails now first: most changes mend none of it.
        for relation in sorted(touched, key=lambda relation: not before[relation].fails):
            was = before[relation]
            if not was.fails and not explained:
                break
            after = misfit_of(relation, known[relation], changed)
            if was.explained_by(after, change):
                left = left if explained or not after.size else abs(after.difference) / after.size
                explained.append(relation)
            elif (was.holds and not after.holds) or (after.fails and not was.fails):
                explained.clear()
                break
            cost += np.log(max(after.cost, SOLVED) / max(was.cost, SOLVED))
        if explained and (change.what != "clock" or len(explained) >= FEWEST_CLOCKED):
            # In level flight a scale fits as well as an offset, which is simpler.
            cost += SIMPLER * (change.what == "scale")
            order = (-len(explained), change.rank, change.doubts_unit(stated), len(change.channels) > 1, cost)
            explanations.append((order, Blame(change=change, rivals=(), explains=tuple(explained), misfit=left)))
    if not explanations:
        return None
    explanations.sort(key=lambda explanation: explanation[0])
    best, blame = explanations[0]
    as_likely = [other.change for rank, other in explanations if rank[:4] == best[:4]]
    rivals = {change.channels: change for change in reversed(as_likely)}
    rivals.pop(blame.change.channels)
    return replace(blame, rivals=tuple(rivals.values()))


def _sized(
    suspects: Sequence[str], failing: Sequence[Relation], known: Mapping[Relation, IntArray], state: State
) -> Iterator[Change]:
    """Yield the offsets and scales of single channels, and the clocks, that make relations hold that fail."""
    for name, relation in product(suspects, failing):
        if name in relation.channels(state.values) and relation.tolerance is not None:
            sized = (_solved(relation, known[relation], name, state, is_scale=is_scale) for is_scale in (False, True))
            yield from (change for change in sized if change is not None)
    for relation in failing:
        misfit = misfit_of(relation, known[relation], state)
        alike = misfit.is_informative & (np.abs(misfit.correlation) >= ALIKE) & (misfit.slope > 0.0)
        if misfit.is_wrong and relation.has_scale and alike.any():
            slope = float(np.median((np.sign(misfit.correlation) * misfit.slope)[alike]))
            yield Change(what="scale", channels=(relation.needs[0],), factor=1.0 / slope)
            if relation.timed:
                yield Change(what="clock", channels=(), factor=1.0 / slope)


def _solved(relation: Relation, rows: IntArray, name: str, state: State, *, is_scale: bool) -> Change | None:
    """Return the offset or scale of a channel at which a relation's median difference is nothing; None for none."""

    def change(size: float) -> Change:
        if is_scale:
            return Change(what="scale", channels=(name,), factor=1.0 + size)
        return Change(what="offset", channels=(name,), offset=size)

    def left(size: float) -> float:
        return misfit_of(relation, rows, change(size).of(state)).difference

    typical = float(np.nanmedian(np.abs(state.values[name]))) or 1.0
    last, size = 0.0, 0.01 * (1.0 if is_scale else typical)
    was, now = left(last), left(size)
    goal = SOLVED * abs(was)
    for _ in range(MOST_STEPS):
        if not np.isfinite(now) or not np.isfinite(was) or now == was:
            return None
        if abs(now) <= goal:
            return change(size)
        last, size, was = size, size - now * (size - last) / (now - was), now
        now = left(size)
    return change(size) if np.isfinite(now) and abs(now) <= 10.0 * goal else None
