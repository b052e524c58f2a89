"""How relations between channels hold throughout a flight, against the seconds of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...airdata.relations import LARGEST_SCALE, LEAST_CORRELATION, Relation, State
from ...flightlog import FlightLog
from ...flightlog.record import LARGEST_VALUE
from ...flightlog.signs import BORNE, FASTEST, METRES_PER_SECOND, MOVING, WALK
from ...kernels import BoolArray, FloatArray, IntArray
from ...kernels.runs import block_means, runs
from ...quantities.channels import STANDARD

if TYPE_CHECKING:
    from .changes import Change

# Pieces of a flight in each of which a relation fails that fails throughout; what begins during a flight is a fault
# with an onset, which the analyses find. Slopes need longer pieces than medians.
PIECES, LONG_PIECES, LEAST_PER_PIECE = 8, 4, 3
FEWEST_TOLD = 2  # longer pieces that tell of the motion: in one alone it may be gusts
# HOLDING: share of the pieces in which a relation that holds does hold.
HOLDING = 0.75
# LARGE, BETTER [tolerances, 1]: what is expected shows a factor from here on; how much better another unit has to fit.
LARGE, BETTER = 2.0, 3.0
# So alike they tell a scale, however little what is expected moves.
ALIKE = 0.9


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


def known_seconds(relations: Sequence[Relation], seconds: State) -> dict[Relation, IntArray]:
    """Return the relations that a log tells of, with the seconds (8, m) in which all of their channels are known."""
    usable = {}
    for relation in relations:
        if not relation.lasts or not set(relation.needs) <= seconds.values.keys():
            continue
        channels = relation.channels(seconds.values)
        known = np.flatnonzero(np.all([np.isfinite(seconds.values[name]) for name in channels], axis=0))
        rows = known[: known.size // PIECES * PIECES].reshape(PIECES, -1)
        if rows.shape[1] >= LEAST_PER_PIECE:
            usable[relation] = rows
    return usable


def misfit_of(relation: Relation, rows: IntArray, state: State) -> Misfit:
    """Return how a relation holds.

    Parameters
    ----------
    rows : (8, m) the seconds in which all of its channels are known, see `known_seconds`.
    """
    reading, expected = sides_of(relation, rows, state)
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
        moments = _motion(relation, reading, expected, known)
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


def sides_of(relation: Relation, rows: IntArray, state: State) -> tuple[FloatArray, FloatArray]:
    """Return (8, m) what a relation reads and what it should, in the seconds `rows`."""
    with np.errstate(all="ignore"):
        return relation.reading(state)[rows], relation.expected(state)[rows]


def _motion(
    relation: Relation, reading: FloatArray, expected: FloatArray, known: BoolArray
) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Return by longer piece correlation and slope, whether they tell anything, and whether the reading follows."""
    least = relation.least or 0.0
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
    if relation.has_scale:
        with np.errstate(all="ignore"):  # of what does not move at all
            follows &= (correlation * slope <= LARGEST_SCALE) & (correlation <= LARGEST_SCALE * slope)
    return correlation, slope, is_informative | lost, follows


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
