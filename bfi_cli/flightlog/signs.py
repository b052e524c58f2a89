"""Whether the aircraft flies: a vote of the independent signs of a log, and the airspeeds that contradict it.

An airspeed may be the faulty channel, so that no single airspeed decides. Signs are the airspeeds (one vote together,
since they belong to one air-data system), the ground speed, the altitude, the height of satellites beside a pressure
altitude, the motion of the attitude, that of the load, and the thrust. What is usual in flight and on the ground for
motion and thrust, the log itself tells.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from ..airdata import SEA_LEVEL_PRESSURE, ground_speed_of, isa_temperature, pressure_at
from ..kernels import BoolArray, FloatArray
from ..kernels.runs import Run, bridged, median_of_neighbours, runs
from .record import LARGEST_VALUE, FlightLog

Says = Literal["ground", "flight"]

# Airspeeds that determine the lift first: true airspeed and Mach number grow with altitude at the same lift.
AIRSPEEDS = ("cas", "ias", "tas", "mach")
METRES_PER_SECOND = {"mach": 340.0}
# Time of a running median, against gusts and the noise of a pitot tube at rest.
SMOOTHING_S = 5.0
# Below a quarter of the fastest speed, a quantile since single samples may be wrong, the aircraft does not fly: it has
# at most a sixteenth of the lift.
FASTEST, MOVING = 0.99, 0.25
# Shares of the cruising speed, the median above that: the lowest at which the wing bears the aircraft (lift-off and
# touch-down lie at half to two thirds for a jet, 55 of 95 m/s, as for a drone, 6 of 10 m/s; slow flight at two
# thirds) ...
BORNE = 0.6
# ... and the highest of taxiing; in a stall an aircraft flies at a third or a half.
TAXI = 0.3
# Below a walk nothing flies, whatever the quantiles of a log on the ground say, m/s.
WALK = 3.0
# V / g that an aircraft in flight can be without airspeed: in free fall it regains its speed after one, with the
# pull-out and the smoothing of the airspeed after three. A longer stretch without airspeed is a fault of the sensor.
LONG = 5.0
# A flight before or after a stay on the ground rises above it by this share of V^2 / g; one around a stall does not.
ABOVE_GROUND = 0.1
# What tells the height above the ground of the day, the best first: satellites tell it where no pressure does.
HEIGHTS = ("altitude", "gps_altitude")
# On the ground the pressure altitude changes by less than this share of V^2 / g, also with the weather of a day.
LOST = 0.25
# Motion and thrust vote only where flight and ground differ: the first quantile in flight exceeds the second on the
# ground, each from at least so many pieces of LONG. Not tuned: the distributions may overlap by a fifth.
LEAST_IN_FLIGHT, MOST_ON_GROUND, FEWEST_PIECES = 0.2, 0.8, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Overruled:
    """A run in which an airspeed is overruled; see `phases.Disagreement`."""

    channel: str
    run: Run
    says: Says
    alone: bool
    certain: bool
    latest: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignsVerdict:
    """Where the aircraft is on the ground; elsewhere it is in flight, but for what is `unknown`.

    Attributes
    ----------
    on_ground, unknown : (n,); no sign tells where it is unknown.
    claims : by airspeed, (n,) where it says ground.
    against : runs in which an airspeed is overruled.
    """

    on_ground: BoolArray
    unknown: BoolArray
    claims: Mapping[str, BoolArray]
    against: tuple[Overruled, ...]


def speed_values(log: FlightLog, name: str) -> FloatArray | None:
    """Return (n_samples,) a speed of the log, m/s, NaN where it is no measurement; None where the log lacks it."""
    names = (name, "velocity_north", "velocity_east")
    recorded = {key: log.channels[key].values for key in names if key in log.channels}
    values = ground_speed_of(recorded) if name == "ground_speed" else recorded.get(name)
    if values is None:
        return None
    known = np.abs(values) <= LARGEST_VALUE
    return np.where(known, values, np.nan) * METRES_PER_SECOND.get(name, 1.0) if known.any() else None


def smoothed_speed(values: FloatArray, rate_hz: float) -> FloatArray:
    """Return the median of a speed over five seconds, NaN where it is not known."""
    known = np.isfinite(values)
    if not known.any():
        return values
    n = min(round(SMOOTHING_S * rate_hz), values.size)
    # A long window is thinned: the median of 25 samples of five seconds says the same at any rate.
    step = max(1, n // 25)
    smooth = np.repeat(median_of_neighbours(bridged(values)[::step], max(1, n if step == 1 else 25)), step)
    return np.where(known, np.abs(smooth[: values.size]), np.nan)


def cruise_of(speed: FloatArray) -> float:
    """Return the cruising speed, m/s: the median of what is not slow. At `WALK` or below the log is of the ground."""
    known = speed[np.isfinite(speed)]
    if not known.size:
        return 0.0
    at, share = divmod(FASTEST * (known.size - 1), 1.0)
    slower, faster = _ordered(known, int(at), min(int(at) + 1, known.size - 1))
    known = known[known >= MOVING * (slower + share * (faster - slower))]
    return float(0.5 * sum(_ordered(known, (known.size - 1) // 2, known.size // 2)))


def _ordered(values: FloatArray, *places: int) -> list[float]:
    """Return what would stand at some places were the values sorted, and reorder them: of a day each copy is 70 MB."""
    values.partition(places)
    return [float(values[place]) for place in places]


def equivalent(name: str, speed: FloatArray, height: FloatArray | None) -> FloatArray:
    """Return the equivalent airspeed, at which the lift is the same at any altitude, in the standard atmosphere.

    Without an altitude, true airspeed and Mach number are returned as they are.
    """
    if name not in ("tas", "mach") or height is None:
        return speed
    height = np.clip(np.nan_to_num(height), -4_000.0, 19_000.0)
    pressure = pressure_at(height) / SEA_LEVEL_PRESSURE
    if name == "mach":
        return np.asarray(speed * np.sqrt(pressure))
    return np.asarray(speed * np.sqrt(pressure * isa_temperature(0.0) / isa_temperature(height)))


def decide(
    airspeeds: Mapping[str, FloatArray],
    *,
    ground_speed: FloatArray | None,
    height: FloatArray | None,
    satellites: FloatArray | None,
    levels: Sequence[FloatArray],
    moving: Sequence[Sequence[FloatArray]],
    scale_m: float,
    long: int,
) -> SignsVerdict:
    """Return where the aircraft is on the ground, by the majority of the signs.

    1. What each speed claims: ground where it is too slow to bear the aircraft and comes down to that of taxiing.
    2. Claims that differ for less than LONG, or while no speed is at rest, differ about when, not about whether: those
       of the majority count.
    3. Every run of equal claims is decided by the votes of all signs; where they are equal the satellites decide, which
       share no line with the airspeeds, by speed and height alike, then the altitude, and last the airspeeds.

    Parameters
    ----------
    airspeeds : equivalent ones by channel, the one that is used first, (n,) on a grid and NaN where they are not known,
        as the other signs, which are None or empty where there are none.
    height : pressure altitude, m, or an integral of its rate; satellites : height by satellites beside it, m.
    levels : signals that are larger in flight than on the ground; moving : groups of signals that move more.
    scale_m : V^2 / g; long : samples that are LONG.
    """
    speeds = {**airspeeds, **({} if ground_speed is None else {"ground_speed": ground_speed})}
    n = next(iter(speeds.values())).size
    cruises = {name: cruise_of(speed) for name, speed in speeds.items()}
    known = {name: np.isfinite(speed) for name, speed in speeds.items()}
    claims, common = _claims(airspeeds, speeds, cruises, long)
    table = np.array([*claims.values(), *known.values()])
    edges = [0, *(np.flatnonzero(np.any(table[:, 1:] != table[:, :-1], axis=0)) + 1).tolist(), n]
    any_known = np.any([known[name] for name in airspeeds], axis=0)
    any_claims = np.any(list(claims.values()), axis=0)
    all_ground = np.all([claims[name] | ~known[name] for name in claims], axis=0) & any_known
    all_flight = ~any_claims & any_known
    claimed = common | any_claims | ~any_known
    motions = [np.sum([_variance(values, long) for values in group], axis=0) for group in moving]
    swing = np.full(n, np.nan) if height is None else _variance(height, long)
    rests = np.any([speed < TAXI * cruises[name] for name, speed in airspeeds.items()], axis=0)
    on_ground, unknown = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    against: list[Overruled] = []
    for low, high in pairwise(edges):
        if all_flight[low]:
            continue
        run, here = slice(low, high), {name: bool(claims[name][low]) for name in airspeeds if known[name][low]}
        n_ground = sum(here.values())
        # A slow approach lies in one run with the landing: the altitude of the part in which a speed is at rest counts.
        still = np.flatnonzero(rests[run]) if n_ground else np.empty(0, dtype=int)
        core = (low + int(still[0]), low + int(still[-1]) + 1) if still.size >= long else (low, high)
        others: list[int] = []
        altitude, above = (
            _altitude_says(heights, (low, high), core, claimed, all_ground, scale_m=scale_m, long=long)
            for heights in (height, satellites)
        )
        if high - low >= long and ground_speed is not None and known["ground_speed"][low]:
            above += 1 if claims["ground_speed"][low] else -1
        if high - low >= long:
            outside = np.ones(n, dtype=bool)
            outside[run] = False
            usual = (all_ground & outside, all_flight & outside)
            altitude = altitude or _usual(swing, slice(*core), *usual, long)  # one voice, of one sensor
            others += [_usual(values, slice(*core), *usual, long) for values in (*levels, *motions)]
        votes = [np.sign(2 * n_ground - len(here)), altitude, above, *others]
        tie = (above if abs(above) == 2 else 0) or altitude or votes[0] or (2 * int(common[low]) - 1 if here else 0)
        # Heights say how low an aircraft is; nothing rolls for so long at the speed of flight.
        total = -1 if _flies_past(ground_speed, cruises, core, long) else sum(votes) or tie
        on_ground[run] = total > 0
        unknown[run] = total == 0
        if high - low >= long:
            against += _overruled((low, high), here, airspeeds, cruises, sum(votes), total, long)
    # An unknown run between two of the same kind is of that kind.
    for low, high in runs(unknown):
        if low > 0 and high < n and on_ground[low - 1] == on_ground[high]:
            on_ground[low:high], unknown[low:high] = on_ground[low - 1], False
    return SignsVerdict(on_ground=on_ground, unknown=unknown, claims=claims, against=tuple(_joined(against)))


def _flies_past(ground_speed: FloatArray | None, cruises: Mapping[str, float], run: Run, long: int) -> bool:
    """Return whether the ground passes at the speed of flight all along a run, longer than any roll, and varies."""
    if ground_speed is None or run[1] - run[0] < long:
        return False
    speeds = ground_speed[slice(*run)]
    return bool(speeds.min() > BORNE * cruises["ground_speed"] > BORNE * WALK and np.ptp(speeds) > 0.0)


def _overruled(
    run: Run,
    claims: Mapping[str, bool],
    airspeeds: Mapping[str, FloatArray],
    cruises: Mapping[str, float],
    votes: int,
    total: int,
    long: int,
) -> Iterator[Overruled]:
    """Yield the airspeeds of a run that the signs overrule.

    Parameters
    ----------
    claims : by airspeed that is known, whether it says ground; votes, total : of all signs, before and after a tie.
    """
    low, n_ground = run[0], sum(claims.values())
    for name, says_ground in claims.items():
        at_rest = low + np.flatnonzero(airspeeds[name][slice(*run)] < TAXI * cruises[name])
        # An airspeed that says flight while none is at rest may be wind, which a drone on the ground measures too.
        alone = n_ground < len(claims)
        is_wrong_on_ground = says_ground and total < 0 and (alone or at_rest.size >= long)
        if is_wrong_on_ground or (not says_ground and total > 0 and n_ground):
            yield Overruled(
                channel=name,
                run=run,
                says="ground" if says_ground else "flight",
                alone=alone,
                certain=bool(total * votes > 0),
                latest=low if alone else int(at_rest[0]),
            )


def _claims(
    airspeeds: Collection[str], speeds: Mapping[str, FloatArray], cruises: Mapping[str, float], long: int
) -> tuple[dict[str, BoolArray], BoolArray]:
    """Return where each speed says ground, and where most airspeeds do; see steps 1 and 2 of `decide`.

    In a tie of the airspeeds the first that is known decides.
    """
    claims = {name: np.zeros(speed.size, dtype=bool) for name, speed in speeds.items()}
    for name, speed in speeds.items():
        if not cruises[name] > WALK:
            claims[name] = np.isfinite(speed)
            continue
        for low, high in runs(speed < BORNE * cruises[name]):
            claims[name][low:high] = speed[low:high].min() < TAXI * cruises[name]
    votes = np.array([np.isfinite(speeds[name]) * np.where(claims[name], 1, -1) for name in airspeeds])
    first = np.take_along_axis(votes, np.argmax(votes != 0, axis=0)[None], axis=0)[0]
    total = votes.sum(axis=0)
    common = np.asarray(np.where(total == 0, first, total) > 0)
    rests = np.any([speed < TAXI * cruises[name] for name, speed in speeds.items()], axis=0)
    for claim in claims.values():
        for low, high in runs(claim != common):
            if high - low < long or not rests[low:high].any():
                claim[low:high] = common[low:high]
    return claims, common


def _altitude_says(
    height: FloatArray | None,
    run: Run,
    core: Run,
    claimed: BoolArray,
    all_ground: BoolArray,
    *,
    scale_m: float,
    long: int,
) -> int:
    """Return 1 where the altitude of a run is that of a ground, -1 where it is not, 0 where it does not tell.

    Parameters
    ----------
    core : the part of the run whose altitude counts; claimed, all_ground : (n,) where an airspeed, and all signs, say
        ground.
    """
    if height is None or not np.isfinite(heights := height[slice(*core)]).any():
        return 0
    heights = heights[np.isfinite(heights)]
    low, high = run
    # Quantiles, since an altimeter may begin at 0 and single samples may be wrong.
    lowest, highest = np.percentile(heights, (20.0, 80.0))
    if highest - lowest > LOST * scale_m:
        return -1
    # An aircraft that is slow high up has climbed to there, or descends from there: on that side nothing is higher.
    before = np.flatnonzero(claimed[:low])  # the flight right before the run, and right after it
    after = np.append(np.flatnonzero(claimed[high:]), claimed.size - high)
    sides = [height[(int(before[-1]) + 1 if before.size else 0) : low], height[high : high + int(after[0])]]
    level = float(np.median(heights))
    # A shorter side may be the roll before lift-off or after touch-down.
    longer = [side for side in sides if side.size >= long and np.isfinite(side).any()]
    rises = [float(np.nanmax(side)) - level for side in longer]
    if rises and min(rises) < ABOVE_GROUND * scale_m:
        return -1
    elsewhere = height.copy()
    elsewhere[low:high] = np.nan
    fields = elsewhere[all_ground & np.isfinite(elsewhere)]
    above = bool(fields.size) and level > float(fields.max()) + ABOVE_GROUND * scale_m
    return 1 if rises and not above else 0


def _usual(values: FloatArray, run: slice, ground: BoolArray, flight: BoolArray, long: int) -> int:
    """Return 1 where a signal is in a run as on the ground, -1 as in flight, 0 where these do not differ in the log."""
    finite = np.isfinite(values)
    here, on_ground, in_flight = values[run][finite[run]], values[ground & finite], values[flight & finite]
    if not here.size or min(on_ground.size, in_flight.size) < FEWEST_PIECES * long:
        return 0
    low, high = float(np.quantile(on_ground, MOST_ON_GROUND)), float(np.quantile(in_flight, LEAST_IN_FLIGHT))
    if not low < high:
        return 0
    return 1 if float(np.median(here)) < 0.5 * (low + high) else -1


def _variance(values: FloatArray, long: int) -> FloatArray:
    """Return (n,) the variance of a signal over its piece of `long` samples, NaN where half of that is missing."""
    number = np.arange(values.size) // long
    good = np.isfinite(values)
    count = np.bincount(number, good)
    middle = float(np.median(values[good])) if good.any() else 0.0
    kept = np.where(good, values - middle, 0.0)
    total, squares = np.bincount(number, kept), np.bincount(number, kept**2)
    variance = np.maximum(squares / np.maximum(count, 1) - (total / np.maximum(count, 1)) ** 2, 0.0)
    return np.asarray(np.where(2 * count >= long, variance, np.nan)[number])


def _joined(conflicts: Sequence[Overruled]) -> list[Overruled]:
    """Return the runs in which each channel is overruled, adjacent runs joined."""
    whole: list[Overruled] = []
    last: dict[tuple[str, Says], int] = {}
    for conflict in conflicts:
        k = last.get((conflict.channel, conflict.says))
        if k is not None and whole[k].run[1] == conflict.run[0]:
            before = whole[k]
            alone, certain = before.alone and conflict.alone, before.certain or conflict.certain
            whole[k] = replace(before, run=(before.run[0], conflict.run[1]), alone=alone, certain=certain)
        else:
            last[conflict.channel, conflict.says] = len(whole)
            whole.append(conflict)
    return whole
