"""Whether vane, accelerometers and ground speed follow the flight at all, before anything is concluded from them.

Each is held against what other sensors say it should read, piece by piece and with a constant of its own in every
piece, so that an offset is no matter here. With errors on both sides the scale of the channel lies between the slope of
the channel over what it should read and the inverse of the opposite slope (Frisch, *Statistical Confluence Analysis*,
1934). A channel is not credible where it fails in every third of the flight: what begins during the flight is a fault
with an onset, which other analyses find.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...airdata import EARTH_RADIUS, G
from ...airdata import relations as table
from ...airdata.relations import AIRSPEED, LARGEST_SCALE, LEAST_CORRELATION, Relation, State
from ...decision.implausible import Implausible
from ...flightlog import FlightLog
from ...flightlog.phases import Phase
from ...kernels import TWO_SIDED_95, BoolArray, FloatArray
from ...model.preprocessing.defaults import AIRSPEED_LEAST, FIXED
from .lines import RENEWED_S, renewed_every_s
from .record import STEP_S, Record
from .windows import Window, configuration_changes, flight_stretches, within

# Length of a piece, V / g (a phugoid takes 4.4), and its bounds, s.
PIECE, SHORTEST_PIECE_S, LONGEST_PIECE_S = 12.0, 30.0, 120.0
SMOOTHED_S = 5  # gusts and what one sensor shows some tenths of a second later than another
FEWEST_KNOWN = 0.7  # of the seconds of a piece
# A channel fails in every third of the flight, in so many of its pieces, of at least so many altogether: of the pieces
# of both Citations at most a fifth are wrong.
THIRDS, FAILING, FEWEST_PIECES = 3, 2.0 / 3.0, 5
# MOVES: share of its tolerance by which a channel should move in a piece that tells something.
MOVES = 0.5
# m/s, of the vertical gusts of moderate turbulence (MIL-F-8785C: a tenth of a wind of 30 kt at 20 ft): a vane shows
# them, and pitch minus flight path does not.
GUSTS = 1.5
# m/s, of the difference of two rounded positions a second apart: half of the largest noise that the residual of the
# ground speed knows.
COARSE = 1.0


GROUND_SPEED = ("ground_speed", "velocity_north", "velocity_east", "latitude", "longitude")
# Channels that change what is expected by a few percent: without them the rest is compared.
SLIGHT = {"aoa", "longitudinal_acc"}


def _track(state: State) -> FloatArray:
    """Return (n, 2) of the unit vector along the track: what a steady wind adds to a ground speed follows it."""
    velocity = np.column_stack([state.values["velocity_north"], state.values["velocity_east"]])
    speed = np.linalg.norm(velocity, axis=1)
    return np.asarray(velocity / np.where(speed > 0.0, speed, np.nan)[:, None])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Agreement:
    """How a channel follows what it should read, over the pieces of a flight in which that moves enough to tell.

    Attributes
    ----------
    moments : (n_pieces, 3) means of the square of the reference, of the product, of the square of the reading.
    gusts : standard deviation of what gusts may add to one of both and not to the other.
    """

    relation: Relation
    moments: FloatArray
    gusts: float

    @property
    def correlation(self) -> float:
        """Correlation over all pieces."""
        return float(_correlation(self.moments.sum(axis=0)))

    @property
    def scale(self) -> float:
        """Slope of the reading over the reference, of all pieces: errors of the reference lower it."""
        return float(_slope(self.moments.sum(axis=0)))

    @property
    def scale_sd(self) -> float:
        """Standard deviation of the slope, by leaving out one piece at a time."""
        n = len(self.moments)
        slopes = _slope(self.moments.sum(axis=0) - self.moments)
        return float(np.sqrt((n - 1) / n * np.sum((slopes - slopes.mean()) ** 2)))

    @property
    def by_gusts(self) -> bool:
        """Whether gusts may be all that the reference moves more than the reading does."""
        reference, _, reading = self.moments.mean(axis=0)
        return bool(reading < reference <= reading + self.gusts**2)

    @property
    def fails(self) -> bool:
        """Whether the reading does not follow, or in another scale, in every third of the flight."""
        wrong = self._are_wrong(self.moments)
        if len(wrong) < FEWEST_PIECES or not self._are_wrong(self.moments.sum(axis=0)):
            return False
        return all(bool(np.mean(third) >= FAILING) for third in np.array_split(wrong, THIRDS))

    @property
    def holds(self) -> bool:
        """Whether the reading follows in most pieces, so that none of what stands in the relation fails throughout."""
        wrong = self._are_wrong(self.moments)
        return bool(len(wrong)) and float(np.mean(wrong)) < 0.5

    def _are_wrong(self, moments: FloatArray) -> BoolArray:
        """Return (...,) where the moments (..., 3) of pieces say that the reading does not follow."""
        lost = ~(_correlation(moments) >= LEAST_CORRELATION)
        reference, product, reading = np.moveaxis(moments, -1, 0)
        scaled = (product > LARGEST_SCALE * reference) | (LARGEST_SCALE * reading < product)
        return np.asarray(lost | (scaled & self.relation.has_scale))


def _correlation(moments: FloatArray) -> FloatArray:
    reference, product, reading = np.moveaxis(moments, -1, 0)
    power = reference * reading
    return np.asarray(np.divide(product, np.sqrt(power), out=np.zeros(power.shape), where=power > 0.0))


def _slope(moments: FloatArray) -> FloatArray:
    reference, product, _ = np.moveaxis(moments, -1, 0)
    return np.asarray(np.divide(product, reference, out=np.zeros(reference.shape), where=reference > 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Credibility:
    """What of a flight is not credible.

    Attributes
    ----------
    findings : on channels that do not follow the flight.
    sentences : on each, and on what cannot be compared.
    unusable : residuals of the parity scan whose channels do not agree, though each agrees with others.
    """

    findings: tuple[Implausible, ...]
    sentences: tuple[str, ...]
    unusable: tuple[str, ...]

    @property
    def unused(self) -> tuple[str, ...]:
        """The channels that are not used."""
        return tuple(name for finding in self.findings for name in finding.channels)


def agreements(record: Record, phases: Sequence[Phase], *, without: Sequence[Window] = ()) -> tuple[Agreement, ...]:
    """Return how channels follow each other in flight with flaps and gear at rest, of every relation that is told.

    Parameters
    ----------
    without : stretches that are left out, such as those in which a pressure line is held.
    """
    moved = configuration_changes(phases, record)
    stretches = flight_stretches(phases)
    used = within(record.time_s, stretches) & ~within(record.time_s, (*moved, *without))
    state = record.state
    return tuple(
        _agreement(row, state, used, stretches)
        for row in table.RELATIONS
        if row.residual and {*row.needs, *(name for name in row.beside if name not in SLIGHT)} <= state.values.keys()
    )


def _agreement(relation: Relation, state: State, used: BoolArray, stretches: Sequence[Window]) -> Agreement:
    speeds = state.values["tas"][used] if "tas" in state.values else np.empty(0)
    # An airspeed that is lost for most of the flight tells no speed either.
    speed = float(np.nanmedian(speeds)) if np.isfinite(speeds).any() else 0.0
    speed = speed if speed > 0.0 else np.inf
    piece_s = float(np.clip(PIECE * speed / G, SHORTEST_PIECE_S, LONGEST_PIECE_S))
    reference, reading = (
        _smoothed(np.where(used, make(state), np.nan)) for make in (relation.expected, relation.reading)
    )
    n_seconds = len(state.time_s)
    beside = _track(state) if "velocity_north" in relation.needs else np.empty((n_seconds, 0))
    least = FIXED.get(relation.needs[0], AIRSPEED_LEAST)
    moments = []
    for first, last in stretches:
        for start in np.arange(first, last - piece_s + 1e-6, piece_s):
            piece = within(state.time_s, [(start, start + piece_s)])
            known = piece & np.isfinite(reference + reading) & np.isfinite(beside).all(axis=1)
            n = int(np.count_nonzero(known))
            if n < FEWEST_KNOWN * piece_s:
                continue
            design = np.column_stack([np.ones(n), beside[known]])
            both = np.column_stack([reference[known], reading[known]])
            x, y = (both - design @ np.linalg.lstsq(design, both, rcond=None)[0]).T
            if x @ x >= n * (MOVES * least) ** 2:
                moments.append((x @ x / n, x @ y / n, y @ y / n))
    gusts = GUSTS / speed if relation.residual == "climb" else 0.0
    return Agreement(relation=relation, moments=np.array(moments).reshape(-1, 3), gusts=gusts)


def _smoothed(values: FloatArray) -> FloatArray:
    """Return running means; NaN where a sample is missing, and at the ends."""
    smooth = np.full(values.shape, np.nan)
    if len(values) >= SMOOTHED_S:
        half = SMOOTHED_S // 2
        smooth[half : len(values) - half] = np.lib.stride_tricks.sliding_window_view(values, SMOOTHED_S).mean(axis=1)
    return smooth


def coarse_positions(log: FlightLog) -> str:
    """Return why no ground speed can be made of the positions of a log, "" where one can, or needs not."""
    names = ("latitude", "longitude")
    if not {*names} <= log.channels.keys() or {"velocity_north", "velocity_east"} <= log.channels.keys():
        return ""
    metres = EARTH_RADIUS * max(log.channels[name].step or 0.0 for name in names)
    seconds = max(renewed_every_s(log, name) for name in names)
    if metres / np.sqrt(6.0) <= COARSE * STEP_S and seconds <= max(RENEWED_S, 1.5 / log.rate_hz):
        return ""
    how = f"in steps of {metres:.2g} m" if seconds <= RENEWED_S else f"anew every {seconds:.2g} s only"
    return f"latitude and longitude are recorded {how}: no ground speed was made of them"


def credibility_of(record: Record, phases: Sequence[Phase], *, without: Sequence[Window] = ()) -> Credibility:
    """Return the channels that do not follow the flight, by the relations that fail throughout it.

    A channel that another relation confirms is not accused. Where each of those that could be wrong is confirmed, gusts
    or a sensor's place make the difference: the relation is not used, and no channel is named.

    Parameters
    ----------
    without : stretches that are left out, such as those in which a pressure line is held.
    """
    every = agreements(record, phases, without=without)
    holding = [agreement for agreement in every if agreement.holds]
    suspects: dict[str, list[Agreement]] = {}
    findings: list[Implausible] = []
    sentences: list[str] = []
    unusable: list[str] = []
    for agreement in every:
        if not agreement.fails:
            continue
        # The lift says that a vane follows, not in what scale.
        follows, relation = agreement.correlation >= LEAST_CORRELATION, agreement.relation
        telling = [other.relation for other in holding if other.relation.has_scale or not follows]
        confirmed = {name for other in telling for name in other.confirms}
        left = [name for name in relation.accuses if name not in confirmed]
        if not left:
            unusable.append(relation.residual)
            sentences.append(
                f"{relation.accuses[0]} does not agree with {relation.words}, and others confirm both: "
                "they are not compared"
            )
        for name in left:
            suspects.setdefault(name, []).append(agreement)
    while suspects:
        # What explains most of what fails is named, and explains that.
        name = max(suspects, key=lambda key: (len(suspects[key]), key == AIRSPEED))
        failing = suspects.pop(name)
        rivals = tuple(
            (record.airspeed or "tas") if other == AIRSPEED else other
            for other in suspects
            if {*failing} <= {*suspects[other]}
        )
        rest = {other: [each for each in accusing if each not in failing] for other, accusing in suspects.items()}
        suspects = {other: accusing for other, accusing in rest.items() if accusing}
        if name == AIRSPEED:  # which the analyses are for that follow
            continue
        findings.append(_finding(name, rivals, failing))
        sentences.append(findings[-1].text)
    return Credibility(findings=tuple(findings), sentences=tuple(sentences), unusable=tuple(unusable))


def _finding(name: str, rivals: tuple[str, ...], failing: Sequence[Agreement]) -> Implausible:
    words = " and ".join(
        f"{agreement.relation.words} ({f'scale {agreement.scale:.2f}, ' if agreement.relation.has_scale else ''}"
        f"correlation {agreement.correlation:.2f})"
        for agreement in failing
    )
    scaled = next((agreement for agreement in failing if agreement.relation.has_scale), None)
    factor, factor_ci95 = 1.0, None
    if scaled is not None and scaled.scale > 0.0:
        half = TWO_SIDED_95 * scaled.scale_sd
        factor, ends = 1.0 / scaled.scale, (scaled.scale + half, scaled.scale - half)
        factor_ci95 = (1.0 / ends[0], 1.0 / ends[1]) if ends[1] > 0.0 else None
    doubt = ""
    if rivals:
        doubt = f", or {' or '.join(rivals)} does not follow the others"
    elif all(agreement.by_gusts for agreement in failing):
        doubt = ", though gusts could hide that it does"
    return Implausible(
        channels=GROUND_SPEED if name == "ground_speed" else (name,),
        what="unrelated",
        unit="",
        factor=factor,
        offset=0.0,
        agrees_with=(),
        relative_misfit=1.0 - min(agreement.correlation for agreement in failing),
        rivals=rivals,
        text=f"'{name}' does not follow {words}{doubt}: it was not used",
        advice=f"check {name}",
        factor_ci95=factor_ci95,
        fixed=True,
    )
