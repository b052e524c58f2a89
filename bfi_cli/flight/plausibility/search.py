"""Which channel is to blame where relations fail throughout a flight, and what would make all of them fit.

Relations are held against a whole log once a second, in flight.

Whether an error is the same from the first sample on, or begins during the flight: of what a relation is off by, a
constant error and one that changes at an unknown time (by a step, a drift, or a ramp that ends) are compared by their
likelihoods. The noise is an AR(1) process of unknown size and correlation, under each at its best. An error that
changes is constant only as far as it is there before.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...airdata.relations import LARGEST_SCALE, LEAST_CORRELATION, Relation, State
from ...flightlog import FlightLog
from ...flightlog.record import LARGEST_VALUE
from ...flightlog.signs import BORNE, FASTEST, METRES_PER_SECOND, MOVING, WALK
from ...kernels import BoolArray, FloatArray, IntArray
from ...kernels.runs import block_means, runs
from ...quantities.channels import STANDARD
from .changes import Change, named_changes

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


# Pieces of a flight in each of which a relation fails that fails throughout; what begins during a flight is a fault
# with an onset, which the analyses find. Slopes need longer pieces than medians.
PIECES, LONG_PIECES, LEAST_PER_PIECE = 8, 4, 3
FEWEST_TOLD = 2  # longer pieces that tell of the motion: in one alone it may be gusts
SIMPLER = float(np.log(2.0))  # of the cost, that a scale must be better by: its misfit in one relation half as large
# HOLDING: share of the pieces in which a relation that holds does hold.
HOLDING = 0.75
# LARGE, BETTER [tolerances, 1]: what is expected shows a factor from here on; how much better another unit has to fit.
LARGE, BETTER = 2.0, 3.0
# So alike they tell a scale, however little what is expected moves.
ALIKE = 0.9
# SOLVED, MOST_STEPS: share of a relation's residual that its solution leaves; iterations of the secant to there.
SOLVED, MOST_STEPS = 1e-3, 6
MOST_FINDINGS = 3
FEWEST_CLOCKED = 2  # relations that tell the time, of which one alone may have a wrong channel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Misfit:
    """How a relation holds.

    Attributes
    ----------
    levels : (8,) by piece the median difference over its tolerance, 0 where none is stated.
    correlation, slope : (4,) by longer piece, of the reading and what is expected, 0 and 1 where that is not told.
    is_informative, follows : (4,) whether what is expected moves enough to tell, and whether the reading follows it.
    difference, size : medians over the flight of the difference and of the size of what is expected.
    tolerance : of the levels.
    """

    levels: FloatArray
    correlation: FloatArray
    slope: FloatArray
    is_informative: BoolArray
    follows: BoolArray
    difference: float
    size: float
    tolerance: float

    @property
    def is_wrong(self) -> bool:
        """Whether the reading follows in no piece that is informative."""
        return bool(self.is_informative.sum() >= FEWEST_TOLD and not self.follows[self.is_informative].any())

    @property
    def fails(self) -> bool:
        """Whether it fails throughout the flight."""
        return self.is_wrong or bool(np.all(np.abs(self.levels) > 1.0))

    @property
    def holds(self) -> bool:
        """Whether it holds in most of the flight."""
        return not self.is_wrong and float(np.mean(np.abs(self.levels) <= 1.0)) >= HOLDING

    @property
    def cost(self) -> float:
        """What is left of it, in tolerances."""
        return float(np.sqrt(np.mean(np.minimum(np.abs(self.levels), 1e6) ** 2)))

    def explained_by(self, after: Misfit, change: Change) -> bool:
        """Return whether it fails, and holds after a change, which what is compared is large enough to show.

        What is made small fits whatever is near to nothing.
        """
        if not self.fails or not after.holds:
            return False
        if self.is_wrong:
            return float(np.mean(after.follows[self.is_informative])) >= HOLDING
        if change.what == "offset":
            return True
        shown = after.size >= LARGE * after.tolerance or bool(after.follows.mean() >= HOLDING)
        return shown and (change.what != "unit" or self.cost >= BETTER * after.cost)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownRelation:
    """A relation of the log with the seconds (8, m) in which all of its channels are known."""

    relation: Relation
    channels: tuple[str, ...]
    rows: IntArray

    def is_touched_by(self, change: Change) -> bool:
        """Return whether it takes a channel that is changed, or a rate by a clock that is."""
        return self.relation.timed if change.what == "clock" else not set(change.channels).isdisjoint(self.channels)

    def misfit(self, state: State) -> Misfit:
        """Return how it holds."""
        relation = self.relation
        reading, expected = self._sides(state)
        with np.errstate(all="ignore"):
            difference = reading - expected
        known = np.isfinite(difference)
        difference[~known] = np.inf
        size = np.median(np.abs(np.where(known, expected, 0.0)), axis=1)
        levels, tolerance = np.zeros(PIECES), np.full(PIECES, np.inf)
        if relation.tolerance is not None:
            tolerance = relation.tolerance + relation.share * size
            levels = np.median(difference, axis=1) / tolerance
        moments = (np.zeros(LONG_PIECES), np.ones(LONG_PIECES), *np.zeros((2, LONG_PIECES), dtype=bool))
        if relation.least is not None:
            moments = self._motion(reading, expected, known)
        return Misfit(
            levels=levels,
            correlation=moments[0],
            slope=moments[1],
            is_informative=moments[2],
            follows=moments[3],
            difference=float(np.median(difference)),
            size=float(np.median(size)),
            tolerance=float(np.median(tolerance)),
        )

    def _sides(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return (8, m) what the relation reads and what it should."""
        with np.errstate(all="ignore"):
            return self.relation.reading(state)[self.rows], self.relation.expected(state)[self.rows]

    def constant_part(self, change: Change, state: State) -> tuple[float, float] | None:
        """Return what of an offset or a scale is there from the first sample on, None where it begins later."""
        with np.errstate(all="ignore"):
            difference, left = (np.subtract(*self._sides(case)).ravel() for case in (state, change.of(state)))
            constant = difference - left
        tolerance = self.misfit(state).tolerance
        return constant_part(difference, constant, state.time_s[self.rows.ravel()], tolerance=tolerance)

    def _motion(
        self, reading: FloatArray, expected: FloatArray, known: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
        """Return by longer piece correlation and slope, whether they tell anything, and whether the reading follows."""
        least = self.relation.least or 0.0
        n = known.size // LONG_PIECES
        known, (x, y) = known.reshape(LONG_PIECES, n), (side.reshape(LONG_PIECES, n) for side in (reading, expected))
        count = np.maximum(known.sum(axis=1, keepdims=True), 1)
        x, y = (np.where(known, side, 0.0) for side in (x, y))
        x, y = (np.where(known, side - side.sum(axis=1, keepdims=True) / count, 0.0) for side in (x, y))
        xx, xy, yy = ((side * other).sum(axis=1) / count[:, 0] for side, other in ((x, x), (x, y), (y, y)))
        with np.errstate(all="ignore"):
            correlation = np.nan_to_num(xy / np.sqrt(xx * yy))
            slope = np.nan_to_num(np.sqrt(xx / yy), nan=1.0)
        is_informative = (yy >= least**2) | ((np.abs(correlation) >= ALIKE) & (xx >= least**2))
        lost = 2 * known.sum(axis=1) < n
        follows = (correlation >= LEAST_CORRELATION) & ~lost
        if self.relation.has_scale:
            with np.errstate(all="ignore"):  # of what does not move at all
                follows &= (correlation * slope <= LARGEST_SCALE) & (correlation <= LARGEST_SCALE * slope)
        return correlation, slope, is_informative | lost, follows


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
    explains: tuple[KnownRelation, ...]
    misfit: float
    share_sd: float = np.inf


def known_relations(relations: Sequence[Relation], seconds: State) -> list[KnownRelation]:
    """Return the relations that a log tells of, with the seconds in which it does."""
    usable = []
    for relation in relations:
        if not relation.lasts or not set(relation.needs) <= seconds.values.keys():
            continue
        channels = relation.channels(seconds.values)
        known = np.flatnonzero(np.all([np.isfinite(seconds.values[name]) for name in channels], axis=0))
        rows = known[: known.size // PIECES * PIECES].reshape(PIECES, -1)
        if rows.shape[1] >= LEAST_PER_PIECE:
            usable.append(KnownRelation(relation=relation, channels=channels, rows=rows))
    return usable


def blames(relations: Sequence[KnownRelation], state: State, stated: Mapping[str, str | None]) -> list[Blame]:
    """Return what explains the relations that fail throughout a flight, what explains most of them first.

    A change is to blame that makes relations hold which fail, and lets none fail that holds. Of changes that explain
    the same, one that has a name (a unit, a sign) is likelier than a size that fits whatever it is, one channel than
    several, and the unit of a channel that states none likelier than a stated one; what is left are rivals. What
    the unit of a channel would explain that states another is named, and the channel stays as it is. What fails by an
    error that begins during the flight is left to the analyses.

    Parameters
    ----------
    stated : the units that the log states, None where it does not.
    """
    to_blame = list[Blame]()
    relations = list(relations)
    while len(to_blame) < MOST_FINDINGS:
        before = [relation.misfit(state) for relation in relations]
        failing = [relation for relation, misfit in zip(relations, before, strict=True) if misfit.fails]
        if not failing:
            break
        blame = _blame(relations, before, state, failing, stated)
        if blame is None:
            break
        if blame.change.is_constant:
            part = blame.explains[0].constant_part(blame.change, state)
            if part is None:
                relations = [relation for relation in relations if relation not in blame.explains]
                continue
            share, sd = part
            changes = [rival.part(share) for rival in (blame.change, *blame.rivals)]
            blame = replace(blame, change=changes[0], rivals=tuple(changes[1:]), share_sd=sd / abs(share))
        to_blame.append(blame)
        if blame.change.doubts_unit(stated):
            known = [known for known, misfit in zip(relations, before, strict=True) if misfit.fails]
            relations = [
                relation for relation in relations if relation not in known or not relation.is_touched_by(blame.change)
            ]
            continue
        state = blame.change.of(state)
    return to_blame


def _blame(
    relations: Sequence[KnownRelation],
    before: Sequence[Misfit],
    state: State,
    failing: Sequence[KnownRelation],
    stated: Mapping[str, str | None],
) -> Blame | None:
    suspects = tuple(dict.fromkeys(name for relation in failing for name in relation.channels))
    explanations: list[tuple[tuple[float, ...], Blame]] = []
    for change in (*named_changes(suspects, state.values, stated), *_sized(suspects, failing, state)):
        changed = change.of(state)
        touched = [k for k, relation in enumerate(relations) if relation.is_touched_by(change)]
        explained: list[KnownRelation] = []
        cost, left = 0.0, 0.0
        # What fails now first: most changes mend none of it.
        for k in sorted(touched, key=lambda k: not before[k].fails):
            was = before[k]
            if not was.fails and not explained:
                break
            after = relations[k].misfit(changed)
            if was.explained_by(after, change):
                left = left if explained or not after.size else abs(after.difference) / after.size
                explained.append(relations[k])
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


def _sized(suspects: Sequence[str], failing: Sequence[KnownRelation], state: State) -> Iterator[Change]:
    """Yield the offsets and scales of single channels, and the clocks, that make relations hold that fail."""
    for name, relation in product(suspects, failing):
        if name in relation.channels and relation.relation.tolerance is not None:
            sized = (_solved(relation, name, state, is_scale=is_scale) for is_scale in (False, True))
            yield from (change for change in sized if change is not None)
    for relation in failing:
        misfit = relation.misfit(state)
        alike = misfit.is_informative & (np.abs(misfit.correlation) >= ALIKE) & (misfit.slope > 0.0)
        if misfit.is_wrong and relation.relation.has_scale and alike.any():
            slope = float(np.median((np.sign(misfit.correlation) * misfit.slope)[alike]))
            yield Change(what="scale", channels=(relation.relation.needs[0],), factor=1.0 / slope)
            if relation.relation.timed:
                yield Change(what="clock", channels=(), factor=1.0 / slope)


def _solved(known: KnownRelation, name: str, state: State, *, is_scale: bool) -> Change | None:
    """Return the offset or scale of a channel at which a relation's median difference is nothing; None for none."""

    def change(size: float) -> Change:
        if is_scale:
            return Change(what="scale", channels=(name,), factor=1.0 + size)
        return Change(what="offset", channels=(name,), offset=size)

    def left(size: float) -> float:
        return known.misfit(change(size).of(state)).difference

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


# Samples of a large log that are looked at, from its middle: three hours at 100 Hz take a tenth of a second.
LOOKED_AT = 1_000_000
# Seconds on which every hypothesis is tried: a hundred for the median of each of eight pieces of a flight.
MOST_TRIED = 800
FEWEST = 100  # parts of a log that is shorter than so many seconds
# A speed that reads no more than a walk says that nothing flies.
SPEEDS = ("tas", "cas", "ias", "mach", "ground_speed")
# Seconds of take-off and landing, beside what is not flown, in which vanes and pressures settle.
SETTLING = 10
# An angle beyond is none in radians, from -pi to 2 pi with a turn to spare for rounding.
ONE_TURN = 6.4


def seconds_of(log: FlightLog, names: Collection[str]) -> State | None:
    """Return channels of a log once a second, in flight; None where nothing tells that it flies."""
    middle = max(0, (log.n_samples - LOOKED_AT) // 2)
    rows = slice(middle, middle + LOOKED_AT)
    time_s = log.time_s[rows]
    # A short log, whose clock may run too slowly, is cut into parts of a second.
    width_s = float(np.clip((time_s[-1] - time_s[0]) / FEWEST, (time_s[-1] - time_s[0]) / time_s.size, 1.0))
    bins = np.floor((time_s - time_s[0]) / width_s + 1e-6)
    first = np.flatnonzero(np.diff(bins, prepend=-1.0))
    if first.size < 3:
        return None
    block = np.cumsum(np.diff(bins, prepend=-1.0) > 0.0) - 1
    every = {
        name: block_means(_continuous(name, log.channels[name].between(rows)), block, first.size)
        for name in log.independent(names)
        if log.channels[name].unit in ("", "1", STANDARD[name].unit)
    }
    flown = _flown(every)
    if flown is None or not flown.any():
        return None
    at_s = width_s * bins[first]
    rates = {name: np.gradient(values, at_s) for name, values in every.items()}
    # Even steps through what is flown, so that pieces of it are pieces of the flight.
    kept = np.flatnonzero(flown)
    kept = kept[:: max(1, -(-kept.size // MOST_TRIED))]
    return State(
        values={name: _as_slow(values)[kept] for name, values in every.items()},
        rates={name: values[kept] for name, values in rates.items()},
        time_s=time_s[0] + at_s[kept],
    )


def _continuous(name: str, values: FloatArray) -> FloatArray:
    """Return the values without jumps by a whole turn, of headings; NaN where they are no measurements."""
    values = np.where(np.abs(values) < LARGEST_VALUE, values, np.nan)
    if name != "yaw" or not np.isfinite(values).any():
        return values
    period = 360.0 if np.nanmax(np.abs(values)) > ONE_TURN else 2.0 * np.pi
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)
    return values


def _as_slow(values: FloatArray) -> FloatArray:
    """Return means over as long as a rate is one of, by the differences between the seconds beside: weights 1, 2, 1."""
    slow = values.copy()
    slow[1:-1] = 0.25 * (values[:-2] + 2.0 * values[1:-1] + values[2:])
    return slow


def _flown(values: Mapping[str, FloatArray]) -> BoolArray | None:
    """Return (n_seconds,) where most of the speeds say that the aircraft flies; None where no speed says anything.

    Each is taken in parts of its own cruise, so that their units do not matter.
    """
    shares = []
    north, east = (values.get(name) for name in ("velocity_north", "velocity_east"))
    ground = {} if north is None or east is None else {"ground_speed": np.hypot(north, east)}
    for name, values_of in ({**values, **ground}).items():
        if name not in SPEEDS or not np.isfinite(values_of).any():
            continue
        speed = np.abs(values_of)
        known = speed[np.isfinite(speed)]
        cruise = float(np.median(known[known >= MOVING * np.quantile(known, FASTEST)]))
        flies = cruise * METRES_PER_SECOND.get(name, 1.0) > WALK
        shares.append(np.nan_to_num(speed) / cruise if flies else np.zeros(speed.size))
    if not shares:
        return None
    flown: BoolArray = np.median(shares, axis=0) >= BORNE
    for low, high in runs(~flown):
        flown[max(0, low - SETTLING) : high + SETTLING] = False
    return flown
