"""The phases of a flight, from the channels that a log has.

Two kinds, told apart by `PARTS`. The parts of a flight (ground, take-off, climb, cruise, descent, approach, landing)
follow each other and never overlap; manoeuvres (turn, stall, parabola) lie within them and may overlap each other.

Every speed, height and time is measured in the units that the speed V of the aircraft itself sets, as an aircraft of
another size flies the same curves in them: V, V^2/g and V/g. So a drone at 10 m/s (11 m, 1 s) and a jet at 100 m/s
(1000 m, 10 s) are asked the same questions. The names and their limits in feet are those of the Common Taxonomy Team
of CAST and ICAO, "Phase of flight: definitions and usage notes" (2013), where they are the lesser ones.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..airdata import G
from ..kernels import BoolArray, FloatArray
from ..kernels.runs import Run, block_means, bridged, joined, left_of, runs, runs_with, within
from ..notes import Note
from ..quantities.channels import quantity_of
from ..quantities.text import instant
from .record import LARGEST_VALUE, FlightLog
from .signs import (
    ABOVE_GROUND,
    AIRSPEEDS,
    HEIGHTS,
    LONG,
    METRES_PER_SECOND,
    TAXI,
    WALK,
    Says,
    SignsVerdict,
    cruise_of,
    decide,
    equivalent,
    smoothed_speed,
    speed_values,
)

# s, longer than any flight (64 days of a solar aircraft in 2022): a longer log has a wrong clock.
LONGEST_S = 6e6
# A part in flight in which every airspeed is missing or has failed.
NO_AIRSPEED = "no airspeed"
# Parts in which rotors carry a VTOL, wholly or with its wing: an airspeed below flying speed is no fault there.
HOVER, TRANSITION = "hover", "transition"
ON_WING = ("take-off", "climb", "cruise", "descent", "approach", "landing", "flight")
PARTS = ("ground", *ON_WING, HOVER, TRANSITION, NO_AIRSPEED)
MANOEUVRES = ("turn", "stall", "parabola")

# Length of the blocks whose means are used, in V / g: ten blocks for the shortest stroke of a manoeuvre.
BLOCK = 0.1
# Take-off ends, and landing begins, at the 35 ft of a runway's end, or at this share of V^2 / g.
SCREEN_M, SCREEN = 10.7, 0.05
# An approach is the last descent below 1000 ft above the field, or below V^2 / g.
APPROACH_M, APPROACH = 305.0, 1.0
# The approach begins earlier where flaps or gear are extended for the landing below this multiple of that height.
EXTENDED_BELOW = 3.0
# In a traffic pattern below that height the approach begins at this share of its greatest height.
PATTERN = 0.9
# Period of a phugoid in V / g (Lanchester: pi sqrt 2): over one period an exchange of height and speed is no climb. A
# climb or descent exceeds this sine of its angle (1.5 degrees) over a period ...
PHUGOID, STEADY = 4.44, 0.026
# ... and this share of V^2 / g in all, the height that a fifth of the speed is worth.
ENOUGH = 0.18
# A turn: bank begun and ended at these angles, rad, and a change of heading by 30 degrees in all. Two to the same
# side are one turn where they lie less than this many V / g apart.
BANKED, LEVEL, TURNED, SAME_TURN = np.radians(15.0), np.radians(7.5), np.radians(30.0), 2.0
# A parabola: a pitch beyond 30 degrees, or 0 g within 0.3; from the pull-up that leads into it to the end of the
# pull-out: until pitch and load are back within these.
STEEP, WEIGHTLESS = np.radians(30.0), 0.3
FELT = 0.5  # V / g over which the load is averaged: gusts and the noise of a small aircraft's sensor are shorter
GENTLE, NEARLY_ONE = np.radians(15.0), 0.3
# A stall: wings of aeroplanes stall at 12 to 18 degrees of incidence; and then the nose falls, by this much within so
# many V / g. Held at such an angle without that, an aircraft is in slow flight.
STALLING, NOSE_DROP, WITHIN = np.radians(12.0), np.radians(5.0), 2.0
# STALL_SPEED, LOADED: share of the cruising speed above which, and of the weight below which, no aircraft stalls.
STALL_SPEED, LOADED = 0.85, 0.5
# What an aircraft flies steadily in.
STEADY_PARTS = ("climb", "cruise", "descent", "flight")
# From screen height to screen height, with an airspeed or without.
AIRBORNE = (*STEADY_PARTS, "approach", NO_AIRSPEED)
# Seconds to both sides of a parabola: pull-up and pull-out are flown at the limits of the wing.
RECOVERY_S = 30.0
APART_S = 1.0  # of two parts that follow each other
# Thrust, in the order in which it is asked.
THRUST = ("n1_left", "n1_right", "fuel_flow_left", "fuel_flow_right", "throttle")


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A phase of the flight, times on the log's own axis, the end not within it."""

    phase: str
    from_s: float
    to_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """A stretch in which an airspeed says "ground" or "flight" and the other signs of the log the contrary.

    Attributes
    ----------
    alone : other airspeeds say the contrary too; else all of them fail together, as those of one pressure line do.
    certain : most signs say the contrary; else as many as agree with the airspeed, the altitude among them.
    error : median of the airspeed less that of the others, in its unit; None where no other tells it.
    latest_s : the latest that it began: slow flight may have gone before a failure of all airspeeds.
    least_s : from which length on a stretch is no flare, stall or difference about when.
    """

    channel: str
    from_s: float
    to_s: float
    says: Says
    alone: bool
    certain: bool
    error: float | None
    latest_s: float
    least_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Flight:
    """The signals as block means on a grid, NaN for a block without samples; None for a channel that the log lacks.

    Attributes
    ----------
    start_s, step_s : of the grid.
    cruise, scale_s, scale_m : V, V / g and V^2 / g.
    speed : the first airspeed, or another airspeed where the first is overruled.
    on_ground : (n,) by the majority of the signs; lost : (n,) in flight without a usable airspeed.
    disagreements : of an airspeed with the other signs, times on the log's axis.
    height : pressure altitude, or an integral of its rate.
    bank : roll, rad; load : in weights, 1 in level flight.
    configured : more than 0 where flaps or gear are out.
    """

    start_s: float
    step_s: float
    stop_s: float
    cruise: float
    speed: FloatArray
    on_ground: BoolArray
    lost: BoolArray
    disagreements: tuple[Disagreement, ...]
    height: FloatArray | None
    pitch: FloatArray | None
    bank: FloatArray | None
    load: FloatArray | None
    incidence: FloatArray | None
    configured: FloatArray | None

    @property
    def scale_s(self) -> float:
        return self.cruise / G

    @property
    def scale_m(self) -> float:
        return self.cruise**2 / G

    def samples(self, scales: float) -> int:
        """Return the number of steps of the grid, at least one, in `scales` times V / g."""
        return max(1, round(scales * self.scale_s / self.step_s))

    def phase(self, name: str, run: Run) -> Phase:
        """Return a run of the grid as a phase, on the log's own time."""
        from_s, to_s = (self.start_s + edge * self.step_s for edge in run)
        to_s = to_s if run[1] < self.speed.size else self.stop_s
        return Phase(phase=name, from_s=round(from_s, 3), to_s=round(to_s, 3))

    def low_stretches(self) -> list[tuple[float, float]]:
        """Return (from_s, to_s) where the aircraft is hardly above its lowest height, none where no height is known."""
        if self.height is None or not np.isfinite(self.height).any():
            return []
        height = bridged(self.height)
        parts = runs(height - height.min() < ABOVE_GROUND * self.scale_m)
        return [(phase.from_s, phase.to_s) for phase in (self.phase("ground", run) for run in parts)]


def spans_of(phases: Sequence[Phase], kinds: Collection[str]) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the phases of some kinds, in their order."""
    return [(phase.from_s, phase.to_s) for phase in phases if phase.phase in kinds]


def note_on_rotors(phases: Sequence[Phase]) -> tuple[Note, ...]:
    """Return a note on the parts in which its rotors carry a VTOL, () without such parts."""
    parts = [phase for phase in phases if phase.phase in (HOVER, TRANSITION)]
    if not parts:
        return ()
    longest = sorted(sorted(parts, key=lambda phase: phase.from_s - phase.to_s)[:3], key=lambda phase: phase.from_s)
    named = ", ".join(f"{instant(phase.from_s)} to {instant(phase.to_s)} s" for phase in longest)
    total = sum(phase.to_s - phase.from_s for phase in parts)
    names = " and ".join(name for name in (HOVER, TRANSITION) if any(phase.phase == name for phase in parts))
    among = "" if len(parts) == len(longest) else ", the longest"
    text = (
        f"{names}, {total:.0f} s in all{among} {named}: the wing does not carry the aircraft; only flight on it counts"
    )
    return (Note.limit(text),)


def phases_of(log: FlightLog, *, suspects: Collection[str] = ()) -> tuple[Phase, ...]:
    """Return the phases of a flight in order of time, see `find_phases`."""
    return find_phases(log, suspects=suspects)[0]


def find_phases(
    log: FlightLog, *, suspects: Collection[str] = ()
) -> tuple[tuple[Phase, ...], tuple[Disagreement, ...]]:
    """Return the phases of a flight in order of time, and the airspeeds that contradict them.

    Each part comes before the manoeuvres that begin with it.

    An airspeed (or a ground speed) is needed to set the scale; a log without one has no phases. Whether the aircraft
    flies is decided by the majority of independent signs (`bfi_cli.flightlog.signs`), never by one airspeed alone. The
    altitude or its rate tells climb, cruise and descent, the end of the take-off and the beginnings of approach and
    landing; without both, all between take-off and landing is "flight". Roll gives turns, pitch and normal acceleration
    give parabolas. A stall needs pitch and the angle of attack, which without its channel is pitch less flight path
    angle.

    Parameters
    ----------
    suspects : channels that may be faulty, which are not used; an airspeed is, if there is no other.
    """
    without = frozenset(suspects)
    if without not in log.phases:
        log.phases[without] = _phases_without(log, without)
    answer: tuple[tuple[Phase, ...], tuple[Disagreement, ...]] = log.phases[without]
    return answer


def _phases_without(log: FlightLog, suspects: Collection[str]) -> tuple[tuple[Phase, ...], tuple[Disagreement, ...]]:
    if log.n_samples < 2 or log.time_s[-1] - log.time_s[0] > LONGEST_S:
        return (), ()
    sensors = _sensors(log, suspects)
    log = replace(log, channels={**log.channels, **{name: log.channels[sensor] for name, sensor in sensors.items()}})
    suspects = {*suspects, *(name for name, sensor in sensors.items() if sensor in suspects)}
    speeds = {name: values for name in AIRSPEEDS if (values := speed_values(log, name)) is not None}
    over_ground = speed_values(log, "ground_speed")
    trusted = {name: values for name, values in speeds.items() if name not in suspects}
    if over_ground is not None and (not speeds or (not trusted and "ground_speed" not in suspects)):
        trusted, over_ground = {"ground_speed": over_ground}, None
    speeds = trusted or dict(list(speeds.items())[:1])
    if not speeds:
        return (), ()
    hovering = _hovering(log)
    rotors = within(log.time_s, spans_of(hovering, (HOVER, TRANSITION)))
    for name, values in speeds.items():  # one after the other, for memory
        speeds[name] = np.where(rotors, np.nan, smoothed_speed(values, log.rate_hz))
    del values
    # The first airspeed that moves sets the scale: a tube that was left covered does not move.
    cruises = {name: cruise_of(speed) for name, speed in speeds.items()}
    first = next((name for name, cruise in cruises.items() if cruise > WALK), None)
    if first is None:
        start_s, stop_s = log.span_s
        ground = Phase(phase="ground", from_s=round(start_s, 3), to_s=round(stop_s, 3))
        return tuple(_around((ground,), hovering, (), 0.0)), ()
    ordered = {first: speeds.pop(first), **speeds}
    if over_ground is not None:
        over_ground = np.where(rotors, np.nan, smoothed_speed(over_ground, log.rate_hz))
    flight = _on_grid(log, ordered, over_ground, cruises[first], suspects)
    stages = list(_parts(flight))
    for low, high in joined([run for name, run in stages if name in (*STEADY_PARTS, "approach")], 0):
        steep = _parabolas(flight, low, high)
        stages += [("turn", run) for run in _turns(flight, low, high)]
        stages += [("parabola", run) for run in steep]
        stalls = _stalls(flight, low, high)
        stages += [("stall", run) for run in stalls if not any(run[0] < end and begin < run[1] for begin, end in steep)]
    order = (*PARTS, *MANOEUVRES)
    stages.sort(key=lambda stage: (stage[1][0], order.index(stage[0])))
    phases = tuple(flight.phase(name, run) for name, run in stages)
    if hovering:
        phases = tuple(_around(phases, hovering, flight.low_stretches(), flight.step_s))
    disagreements = (replace(run, channel=sensors.get(run.channel, run.channel)) for run in flight.disagreements)
    return phases, tuple(disagreements)


def _hovering(log: FlightLog) -> tuple[Phase, ...]:
    """Return the parts in which its rotors carry a VTOL, wholly or in part, by the channel `hover`."""
    if (state := log.find("hover")) is None:
        return ()
    step_s = 1.0 / log.rate_hz
    phases = []
    for name, mask in ((HOVER, state.values > 0.75), (TRANSITION, (state.values > 0.25) & (state.values <= 0.75))):
        for low, high in runs(mask):
            from_s, to_s = float(log.time_s[low]), float(log.time_s[high - 1]) + step_s
            phases.append(Phase(phase=name, from_s=round(from_s, 3), to_s=round(to_s, 3)))
    return tuple(phases)


def _around(
    phases: Sequence[Phase], hovering: Sequence[Phase], low: Sequence[tuple[float, float]], step_s: float
) -> list[Phase]:
    """Return the phases with the parts of flight on rotors in place of what they overlap.

    Parameters
    ----------
    low : stretches, (from_s, to_s), in which the aircraft is as low as on the ground; flight on rotors there is ground.
    step_s : length of a block of the phases; what is left of one beside the rotors belongs to the phase before.
    """
    rotors = spans_of(hovering, (HOVER, TRANSITION))
    parts = [
        replace(phase, from_s=from_s, to_s=to_s)
        for phase in phases
        for from_s, to_s in left_of([(phase.from_s, phase.to_s)], rotors)
    ]
    for part in hovering:
        aloft = left_of([(part.from_s, part.to_s)], low)
        parts += [replace(part, from_s=from_s, to_s=to_s) for from_s, to_s in aloft]
        parts += [Phase(phase="ground", from_s=a, to_s=b) for a, b in left_of([(part.from_s, part.to_s)], aloft)]
    parts.sort(key=lambda phase: (phase.from_s, (*PARTS, *MANOEUVRES).index(phase.phase)))
    whole: list[Phase] = []
    for part in parts:
        joins = part.phase == "ground" == whole[-1].phase and part.from_s <= whole[-1].to_s if whole else False
        if joins or (whole and part.phase == NO_AIRSPEED and part.to_s - part.from_s < step_s):
            part = replace(whole.pop(), to_s=part.to_s)
        whole.append(part)
    return whole


def _sensors(log: FlightLog, suspects: Collection[str]) -> dict[str, str]:
    """Return the first sensor (`tas_1`) of each quantity without a channel of its name, suspected sensors last."""
    sensors: dict[str, str] = {}
    for name in sorted(log.channels, key=lambda channel: (channel in suspects, channel)):
        if (quantity := quantity_of(name)) not in log.channels:
            sensors.setdefault(quantity, name)
    return sensors


def airborne_stretches(log: FlightLog, *, suspects: Collection[str] = ()) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches from take-off to landing in which an airspeed is known.

    Parameters
    ----------
    suspects : see `find_phases`.
    """
    return airborne_phases(phases_of(log, suspects=suspects))


def airborne_phases(phases: Sequence[Phase]) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches of a flight from take-off to landing, successive phases joined."""
    return joined(sorted(spans_of(phases, (*STEADY_PARTS, "approach"))), APART_S)


def airborne(log: FlightLog, time_s: FloatArray, phases: Sequence[Phase] | None = None) -> BoolArray:
    """Return (n,) whether the aircraft flies at the times `time_s`; `phases` of the log, None to find them."""
    flies = np.zeros(time_s.shape, dtype=bool)
    for from_s, to_s in airborne_stretches(log) if phases is None else airborne_phases(phases):
        flies |= (time_s >= from_s) & (time_s <= to_s)
    return flies


def flight_stretches(phases: Sequence[Phase]) -> list[tuple[float, float]]:
    """Return the stretches of flight without take-off, landing and parabolas."""
    parabolas = [(phase.from_s - RECOVERY_S, phase.to_s + RECOVERY_S) for phase in phases if phase.phase == "parabola"]
    return left_of(airborne_phases(phases), parabolas)


def _on_grid(
    log: FlightLog,
    speeds: Mapping[str, FloatArray],
    over_ground: FloatArray | None,
    cruise: float,
    suspects: Collection[str],
) -> _Flight:
    """Return the signals as means of blocks of a tenth of V / g, or as they are where the log is slower.

    Parameters
    ----------
    speeds : (n_samples,) airspeeds, the one that is used first; over_ground : ground speed; cruise : of the first.
    """
    step_s = max(BLOCK * cruise / G, 1.0 / log.rate_hz)
    block = np.floor((log.time_s - float(log.time_s[0])) / step_s + 1e-6).astype(np.intp)
    long = max(2, round(LONG * cruise / G / step_s))

    def mean(values: FloatArray) -> FloatArray:
        return bridged(block_means(values, block, int(block[-1]) + 1), most=max(1, round(0.5 / BLOCK)))

    def channel(name: str) -> FloatArray | None:
        if name in suspects or name not in log.channels:
            return None
        values = log.channels[name].values
        measured = np.abs(values) <= LARGEST_VALUE
        return mean(values if measured.all() else np.where(measured, values, np.nan)) if measured.any() else None

    means = {name: mean(values) for name, values in speeds.items()}
    speed = next(iter(means.values()))
    pitch, bank, aoa = channel("pitch"), channel("roll"), channel("aoa")
    rate, load = channel("altitude_rate"), channel("normal_acc")
    height, satellites = (*(values for name in HEIGHTS if (values := channel(name)) is not None), None, None)[:2]
    if rate is None and height is not None:
        rate = np.gradient(height, step_s) if height.size > 1 else np.zeros(1)
    elif rate is None and pitch is not None and aoa is not None:
        rate = speed * np.sin(pitch - aoa)  # in straight flight; in turns it is too small
    if height is None and rate is not None:
        height = np.where(np.isfinite(rate), np.cumsum(np.nan_to_num(rate)) * step_s, np.nan)
    attitude = [values for values in (pitch, bank) if values is not None]
    thrust = next((values for name in THRUST if (values := channel(name)) is not None), None)
    verdict = decide(
        {name: equivalent(name, values, height) for name, values in means.items()},
        ground_speed=None if over_ground is None else mean(over_ground),
        height=height,
        satellites=satellites,
        levels=[] if thrust is None else [thrust],
        moving=[group for group in (attitude, [] if load is None else [load]) if group],
        scale_m=cruise**2 / G,
        long=long,
    )
    speed, lost = _right_speed(means, verdict)
    if aoa is None and pitch is not None and rate is not None:
        path = np.arcsin(np.clip(rate / np.maximum(speed, TAXI * cruise), -1.0, 1.0))
        aoa = (pitch - path) / (1.0 if bank is None else np.maximum(np.cos(bank), 0.5))
    out = [values for name in ("flaps", "gear") if (values := channel(name)) is not None]
    start_s, stop_s = log.span_s
    return _Flight(
        start_s=start_s,
        step_s=step_s,
        stop_s=stop_s,
        cruise=cruise,
        speed=speed,
        on_ground=verdict.on_ground,
        lost=lost,
        disagreements=tuple(_disagreements(means, verdict, start_s, step_s, stop_s, least_s=long * step_s)),
        height=height,
        pitch=pitch,
        bank=bank,
        load=None if load is None else load / G + 1.0,
        incidence=aoa,
        configured=sum((_is_out(position) for position in out), np.zeros(speed.size)) if out else None,
    )


def _right_speed(means: Mapping[str, FloatArray], verdict: SignsVerdict) -> tuple[FloatArray, BoolArray]:
    """Return the first speed, replaced by another where it is missing or overruled, and where no speed is usable.

    After an airspeed was overruled it is not used again: it may err on without contradicting the others.
    """
    first, *others = means
    speed = means[first].copy()
    against = [conflict for conflict in verdict.against if conflict.channel == first]
    wrong = ~np.isfinite(speed)
    for conflict in against:
        wrong[slice(*conflict.run)] = True
    lost = wrong & ~verdict.on_ground & ~verdict.unknown
    wrong[min((conflict.run[0] for conflict in against if conflict.alone), default=speed.size) :] = True
    for name in others:
        usable = wrong & np.isfinite(means[name]) & (verdict.claims[name] == verdict.on_ground)
        ratio = _ratio(means, verdict, first, name)
        if ratio is not None:
            speed[usable] = ratio * means[name][usable]
            wrong, lost = wrong & ~usable, lost & ~usable
    speed[lost] = np.nan
    return speed, lost


def _ratio(means: Mapping[str, FloatArray], verdict: SignsVerdict, name: str, other: str) -> float | None:
    """Return the median ratio of two speeds in flight where neither is overruled; None where that is nowhere."""
    used = ~verdict.on_ground & ~verdict.unknown & np.isfinite(means[name]) & (means[other] > WALK)
    for conflict in verdict.against:
        if conflict.channel in (name, other):
            used[slice(*conflict.run)] = False
    return float(np.median(means[name][used] / means[other][used])) if used.any() else None


def _disagreements(
    means: Mapping[str, FloatArray],
    verdict: SignsVerdict,
    start_s: float,
    step_s: float,
    stop_s: float,
    *,
    least_s: float,
) -> Iterator[Disagreement]:
    """Yield the runs in which an airspeed is overruled, with its error against the first speed that is not."""
    for conflict in verdict.against:
        name, part, error = conflict.channel, slice(*conflict.run), None
        for other in means:
            ratio = _ratio(means, verdict, name, other)
            agrees = (verdict.claims[other] == verdict.on_ground)[part] & np.isfinite(means[name] - means[other])[part]
            if other != name and ratio is not None and agrees.any():
                off = np.median((means[name] - ratio * means[other])[part][agrees])
                error = float(off) / METRES_PER_SECOND.get(name, 1.0)
                break
        yield Disagreement(
            channel=name,
            from_s=round(start_s + conflict.run[0] * step_s, 3),
            to_s=round(min(start_s + conflict.run[1] * step_s, stop_s), 3),
            says=conflict.says,
            alone=conflict.alone,
            certain=conflict.certain,
            error=error,
            latest_s=round(start_s + conflict.latest * step_s, 3),
            least_s=least_s,
        )


def _is_out(values: FloatArray) -> FloatArray:
    """Return 1 where flaps or gear are beyond the middle of their travel, else 0; 0 throughout if they never move."""
    low, high = np.nanmin(values), np.nanmax(values)
    return np.asarray((values > 0.5 * (low + high)) & (high > low), dtype=np.float64)


def _parts(flight: _Flight) -> Iterator[tuple[str, Run]]:
    """Yield the parts of the flight; none where it is unknown whether the aircraft flies."""
    yield from ((NO_AIRSPEED, run) for run in runs(flight.lost))
    for first, end in runs((np.isfinite(flight.speed) | flight.on_ground) & ~flight.lost):
        last = first
        grounds: list[Run] = []
        kept = [(first + low, first + high) for low, high in runs(flight.on_ground[first:end])]
        for run, following in pairwise([*kept, (end, end)]):
            grounds.append(_to_screen(flight, run, grounds[-1][1] if grounds else first, following[0]))
        for down, up in grounds:
            if last < down:
                yield from _aloft(flight, last, down, lands=True)
            yield from _on_ground(flight, down, up, lands=down > first, departs=up < end)
            last = up
        if last < end:
            yield from _aloft(flight, last, end, lands=False)


def _to_screen(flight: _Flight, run: Run, first: int, end: int) -> Run:
    """Return the run on the ground widened by the time below screen height, or by 2 V / g without an altitude.

    The altitude may jump when the aircraft rotates, so the time ends where the aircraft stays above screen height. The
    height of the field is the median while the aircraft is slow next to that end of the run.
    """
    low, high = run
    reach, near = flight.samples(10.0), flight.samples(5.0)
    rolls = low + np.flatnonzero(flight.speed[low:high] < TAXI * flight.cruise)
    screen = min(SCREEN_M, SCREEN * flight.scale_m)
    margins = []
    for slow, way, side in (
        (rolls[:near], -1, slice(max(first, low - reach), low)),
        (rolls[-near:], 1, slice(high, min(end, high + reach))),
    ):
        heights = np.empty(0) if flight.height is None else flight.height[slow]
        heights = heights[np.isfinite(heights)]
        n = side.stop - side.start
        if flight.height is None or not heights.size or not n:
            margins.append(min(n, flight.samples(2.0)))
            continue
        below = (flight.height[side] - float(np.median(heights)) < screen)[::way]
        margins.append(int(np.flatnonzero(below)[-1]) + 1 if below.any() and not below.all() else 0)
    return max(first, low - margins[0]), min(end, high + margins[1])


def _on_ground(flight: _Flight, first: int, end: int, *, lands: bool, departs: bool) -> Iterator[tuple[str, Run]]:
    """Yield landing, ground and take-off of a stay on the ground.

    The landing ends, and the take-off begins, where the speed is that of taxiing.
    """
    taxis = first + np.flatnonzero(flight.speed[first:end] < max(TAXI * flight.cruise, WALK))
    if taxis.size:
        stop, start = int(taxis[0]) if lands else first, int(taxis[-1]) + 1 if departs else end
    elif lands or departs:
        stop = start = end if lands else first
    else:
        stop, start = first, end
    for name, run in (("landing", (first, stop)), ("ground", (stop, start)), ("take-off", (start, end))):
        if run[1] > run[0]:
            yield name, run


def _aloft(flight: _Flight, first: int, end: int, *, lands: bool) -> Iterator[tuple[str, Run]]:
    """Yield climbs, cruises and descents of a flight, and its approach where it `lands`."""
    if flight.height is None or not np.isfinite(flight.height[first:end]).any():
        yield "flight", (first, end)
        return
    height = bridged(flight.height[first:end])
    approach = _approach_start(flight, height, first) if lands else height.size
    way = _ways(flight, height[:approach])
    edges = [0, *(np.flatnonzero(np.diff(way)) + 1).tolist(), way.size]
    for low, high in pairwise(edges):
        if high > low:
            yield ("descent", "cruise", "climb")[int(way[low]) + 1], (first + low, first + high)
    if approach < height.size:
        yield "approach", (first + approach, end)


def _approach_start(flight: _Flight, height: FloatArray, first: int) -> int:
    """Return where the last descent passes the height of an approach, or where flaps or gear are extended before it."""
    above = height - height[-1]
    limit = min(APPROACH_M, APPROACH * flight.scale_m)
    high = np.flatnonzero(above > min(limit, PATTERN * float(above.max())))
    start = int(high[-1]) + 1 if high.size else 0
    if flight.configured is not None:
        out = flight.configured[first : first + height.size]
        final = np.flatnonzero(out < out[-1])
        moved = int(final[-1]) + 1 if final.size else 0
        if 0 < moved < start and above[moved] < EXTENDED_BELOW * limit and out[-1] > 0.0:
            start = moved
    return start


def _ways(flight: _Flight, height: FloatArray) -> NDArray[np.int8]:
    """Return 1 where a height climbs, -1 where it descends, 0 where it is level or oscillates."""
    n = height.size
    way = np.zeros(n, dtype=np.int8)
    if n < 2:
        return way
    half = max(1, flight.samples(PHUGOID) // 2)
    index = np.arange(n)
    low, high = np.maximum(index - half, 0), np.minimum(index + half, n - 1)
    rate = (height[high] - height[low]) / ((high - low) * flight.step_s)
    steady, least = STEADY * flight.cruise, 2 * half
    for sign in (1, -1):
        for first, end in runs_with(sign * rate > steady, sign * rate > 0.5 * steady):
            # The mean rate over a period is half of the climb's where the climb begins and where it ends.
            strong = first + np.flatnonzero(sign * rate[first:end] > 0.5 * np.median(sign * rate[first:end]))
            way[strong[0] : strong[-1] + 1] = sign
    # Short level flight between two climbs belongs to them; short climbs, and low ones, belong to level flight.
    for first, end in runs(way == 0):
        if end - first < least and first > 0 and end < n and way[first - 1] == way[end]:
            way[first:end] = way[end]
    for sign in (1, -1):
        for first, end in runs(way == sign):
            if abs(height[end - 1] - height[first]) < ENOUGH * flight.scale_m:
                way[first:end] = 0
    # Short level flight between a climb and a descent, or at an end, is no cruise either.
    for first, end in runs(way == 0):
        if end - first < least and end - first < n:
            beside = way[end] if end < n and (first == 0 or way[first - 1] == 0) else way[first - 1]
            way[first:end] = beside
    return way


def _turns(flight: _Flight, first: int, end: int) -> Iterator[Run]:
    """Yield the turns within a flight: banked to one side until the heading has changed by 30 degrees and more."""
    if flight.bank is None:
        return
    bank = np.nan_to_num(_smoothed(flight.bank[first:end], flight.samples(0.5)))
    rate = G * np.tan(np.clip(bank, -1.4, 1.4)) / np.maximum(flight.speed[first:end], TAXI * flight.cruise)
    for side in (1.0, -1.0):
        banked = runs_with(side * bank > BANKED, side * bank > LEVEL)
        for low, high in joined(banked, flight.samples(SAME_TURN) - 1):
            if side * float(rate[low:high].sum()) * flight.step_s > TURNED:
                yield first + low, first + high


def _parabolas(flight: _Flight, first: int, end: int) -> list[Run]:
    """Return the parabolas within a flight, pull-up and pull-out included."""
    n = end - first
    strong, weak = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    if flight.pitch is not None:
        pitch = np.abs(np.nan_to_num(flight.pitch[first:end]))
        strong |= pitch > STEEP
        weak |= pitch > GENTLE
    if flight.load is not None:
        load = np.nan_to_num(_smoothed(flight.load[first:end], flight.samples(FELT)), nan=1.0)
        strong |= np.abs(load) < WEIGHTLESS
        weak |= np.abs(load - 1.0) > NEARLY_ONE
    # The nose passes the horizon in between, in free fall within V / g; from a pull-up to no weight the load passes 1.
    for mask, most in ((strong, 2.0), (weak, 0.5)):
        for (_, low), (high, _) in pairwise(runs(mask)):
            if high - low < flight.samples(most):
                weak[low:high] = True
    return [(first + low, first + high) for low, high in runs_with(strong, weak)]


def _stalls(flight: _Flight, first: int, end: int) -> list[Run]:
    """Return the stalls within a flight: from the incidence at which a wing stalls until the nose has fallen."""
    if flight.incidence is None or flight.pitch is None:
        return []
    slow = flight.speed[first:end] < STALL_SPEED * flight.cruise
    loaded = True if flight.load is None else ~(flight.load[first:end] < LOADED)
    incidence = _smoothed(np.nan_to_num(flight.incidence[first:end]), flight.samples(0.2))
    reach, stalls = flight.samples(WITHIN), []
    for low, high in runs(slow & loaded & (incidence > STALLING)):
        ahead = flight.pitch[first + low : min(first + high + reach, end)]
        if not np.isfinite(ahead).all():
            continue
        # The steepest fall of the nose within reach, from the highest point before it.
        drop = np.maximum.accumulate(ahead) - ahead
        bottom = int(np.argmax(drop))
        top = low + int(np.argmax(ahead[: bottom + 1]))
        if drop[bottom] >= NOSE_DROP and high >= top - reach:
            stalls.append((first + low, first + max(low + bottom + 1, high)))
    return joined(stalls, reach - 1)


def _smoothed(values: FloatArray, n: int) -> FloatArray:
    """Return the running mean over `n` samples, odd or made so; NaN stay."""
    n |= 1
    if n == 1 or values.size < n:
        return values
    padded = np.pad(values, n // 2, mode="edge")
    return np.asarray(np.convolve(padded, np.full(n, 1.0 / n), mode="valid"))
