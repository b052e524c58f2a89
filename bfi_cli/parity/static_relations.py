"""Channels that follow from each other sample by sample: an air-data computer, or a second sensor, that disagrees.

A fault of a pressure or of the temperature moves every channel that is computed from it alike and leaves these
relations alone; an error of one channel (its computation, its transmission, its own sensor) breaks those that it
stands in.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..airdata import (
    SEA_LEVEL_SPEED_OF_SOUND,
    SENSORS,
    altitude_of,
    calibrated_airspeed,
    impact_pressure_of_cas,
    mach_number,
    pressure_at,
    speed_of_sound,
    static_temperature,
)
from ..channels import match_name
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels.change_scan import ChangeScan, scan_changes, steps_and_ramps
from ..kernels.normal import CHI_SQUARE_95
from .finding import Finding, Limit
from .sampled import Blocks, airborne, quanta_of, unit_of

__all__ = ["RelationAnswer", "RelationSeries", "StaticRelations", "find_static", "relation_series"]

FloatArray = NDArray[np.float64]
Values = Mapping[str, FloatArray]

# s of which one mean of a relation is taken: what is sought lasts longer, and channels are tenths of a second apart.
BLOCK_S = 1.0
# Onsets lie this far from the ends of a window: a change needs both sides.
MARGIN_S = 8.0
# Drifts are excluded that begin so long before that, as in the parity scan: 20 s before the end of a window.
LATE_S = 12.0
FEWEST_BLOCKS = 40  # of a window; with fewer the two sides of a change say nothing of the noise's correlation
# Twice the gain in log-likelihood. In 1554 windows of 120 and 240 s of two recorded flights, 10 s apart, the largest of
# what is large enough (`LEAST_STEPS`) is 17; an error of 0.1 m/s of tas has 50 and more.
THRESHOLD = 25.0
# A change is declared where the largest error that it makes is this many times the least noise: a quantity that rests
# at the edge between two steps of a quantisation changes by a whole one, 12^0.5 standard deviations.
LEAST_STEPS = 3.5
# Of a step, by which a channel that rests within one moves from block to block at most, and of the blocks that do. Set
# on two recorded flights with altitudes in steps of 25 ft, which then make no change (docs/theory.md, 15.5).
RESTS, RESTING = 0.01, 0.25
# Twice the loss in log-likelihood up to which another channel explains the relations as well: ten to one.
AS_GOOD = 4.6
# Of a step of one quantisation, in a comparison of channels: a change lies between two means, which average most of it.
# With 1 in place of 0.5 a tenth of the errors of tas of 0.1 m/s was named with tat, with 0.5 a hundredth, none wrong.
AVERAGED = 0.5
# Pieces of this length about a line show the noise of a relation that no recorded step explains.
PIECE_S = 20.0
# Where some channel does not show its steps, what the known ones do not explain of that noise counts so many times: the
# steps of a temperature that rests for a minute have 3 times the standard deviation of pieces of 20 s.
UNSEEN_STEPS = 3.0
# Beside a constant a relation may follow the flight: corrections for the position of the ports that one channel has and
# another has not (mach against cas on the recorded Citation: 0.4 m/s between 90 and 160 m/s), and channels that are
# some tenths of a second apart. Standard deviations of the coefficients, of a relation in m/s: per m/s of Mach x 340, m
# of altitude, m/s^2 and m/s of climb.
FOLLOWS = (0.05, 2e-4, 0.1, 0.02)
# The same in units of other relations, about what 1 m/s of airspeed is worth.
WORTH = {"m/s": 1.0, "K": 1.0, "m": 10.0, "Pa": 100.0, "rad": 0.02, "1": 0.003}
# K, m/s, m: beyond what any flight has that these relations are for.
DOMAIN: dict[str, tuple[float, float]] = {
    "tat": (150.0, 400.0),
    "sat": (150.0, 400.0),
    "tas": (0.0, 400.0),
    "mach": (0.0, 1.0),
}
DOMAIN |= {"cas": (0.0, SEA_LEVEL_SPEED_OF_SOUND), "altitude": (-5_000.0, 20_000.0), "p_static": (5_475.0, 177_000.0)}
DOMAIN |= {"q_impact": (0.0, 90_000.0), "p_total": (5_475.0, 267_000.0), "ias": (0.0, SEA_LEVEL_SPEED_OF_SOUND)}
# Quantities that an aircraft measures more than once with sensors that should agree; two elevators are two surfaces.
REPEATED: tuple[str, ...] = (
    "tas",
    "cas",
    "ias",
    "mach",
    "altitude",
    "tat",
    "sat",
    "p_static",
    "p_total",
    "q_impact",
    "pitch",
    "roll",
)
REPEATED += ("aoa",)
NUMBERED = re.compile(r"[_ ]?(?:\d+|left|right|backup|standby)$", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Relation:
    """A quantity that is 0, or smooth in the flight, while every channel is right.

    Attributes
    ----------
    words : what it compares.
    declares : whether a change of it is a fault; else it only tells channels apart.
    """

    name: str
    words: str
    unit: str
    needs: tuple[str, ...]
    make: Callable[[Values], FloatArray]
    declares: bool = True


def _mach(values: Values, impact: str = "cas", static: str = "altitude") -> FloatArray:
    p_static = pressure_at(values[static]) if static == "altitude" else values[static]
    q_impact = impact_pressure_of_cas(values[impact]) if impact == "cas" else values[impact]
    ratio = np.where(q_impact < 0.89 * p_static, q_impact, np.nan)  # 0.893 is Mach 1
    return mach_number(ratio, p_static)


def _relations(has: Mapping[str, object]) -> tuple[list[_Relation], list[str]]:
    """Return the relations between the standard channels of a log, and what is missing for others."""
    found, missing = [], []
    static = next((name for name in ("altitude", "p_static") if name in has), None)
    heats = tuple(name for name in ("tat", "sat") if name in has)
    pressures = "cas" in has and static is not None

    def temperature(v: Values, mach: FloatArray) -> FloatArray:
        # The mean of two readings of one temperature: their quantisation is most of the noise.
        each = [static_temperature(v[name], mach) if name == "tat" else v[name] for name in heats]
        return np.asarray(sum(each) / len(each))

    if "tas" in has and heats and "mach" in has:
        needs, words = ("tas", "mach", *heats), f"tas against that of mach and {' and '.join(heats)}"
        found.append(
            _Relation(
                name="tas",
                words=words,
                unit="m/s",
                needs=needs,
                make=lambda v: v["tas"] - v["mach"] * speed_of_sound(temperature(v, v["mach"])),
            )
        )
    elif "tas" in has and heats and pressures and static:

        def tas_of_pressures(v: Values) -> FloatArray:
            mach = _mach(v, static=static)
            return v["tas"] - mach * speed_of_sound(temperature(v, mach))

        needs, words = ("tas", "cas", static, *heats), f"tas against that of cas, {static} and {' and '.join(heats)}"
        found.append(_Relation(name="tas", words=words, unit="m/s", needs=needs, make=tas_of_pressures))
    else:
        lacks = [
            what
            for what, absent in (
                ("tas", "tas" not in has),
                ("tat or sat", not heats),
                ("mach, or cas and altitude", "mach" not in has and not pressures),
            )
            if absent
        ]
        missing.append(f"the computation of tas is not checked: the log lacks {', '.join(lacks)}")
    if "mach" in has and pressures and static:
        found.append(
            _Relation(
                name="mach",
                words=f"340 m/s x mach against that of cas and {static}",
                unit="m/s",
                needs=("mach", "cas", static),
                make=lambda v: 340.0 * (v["mach"] - _mach(v, static=static)),
            )
        )
    else:
        lacks = [
            what
            for what, absent in (("mach", "mach" not in has), ("cas", "cas" not in has), ("altitude", static is None))
            if absent
        ]
        missing.append(f"mach, cas and altitude are not compared: the log lacks {', '.join(lacks)}")
    if "sat" in has and "tat" in has and "mach" in has:
        found.append(
            _Relation(
                name="sat",
                words="sat against that of tat and mach",
                unit="K",
                needs=("sat", "tat", "mach"),
                make=lambda v: v["sat"] - static_temperature(v["tat"], v["mach"]),
            )
        )
    elif len(heats) == 1 and "tas" in has and static:
        found.append(
            _Relation(
                name="lapse",
                words=f"{heats[0]} against the altitude",
                unit="K",
                needs=heats,
                make=lambda v: v[heats[0]],
                declares=False,
            )
        )
    if "altitude" in has and "p_static" in has:
        found.append(
            _Relation(
                name="altitude",
                words="altitude against that of p_static",
                unit="m",
                needs=("altitude", "p_static"),
                make=lambda v: v["altitude"] - altitude_of(v["p_static"]),
            )
        )
    if "cas" in has and "q_impact" in has:
        found.append(
            _Relation(
                name="cas",
                words="cas against that of q_impact",
                unit="m/s",
                needs=("cas", "q_impact"),
                make=lambda v: v["cas"] - calibrated_airspeed(v["q_impact"]),
            )
        )
    if {"p_total", "p_static", "q_impact"} <= has.keys():
        found.append(
            _Relation(
                name="p_total",
                words="p_total against p_static and q_impact",
                unit="Pa",
                needs=("p_total", "p_static", "q_impact"),
                make=lambda v: v["p_total"] - v["p_static"] - v["q_impact"],
            )
        )
    if "ias" in has and "cas" in has:
        found.append(_difference("ias", "cas", "m/s"))
    return found, missing


def _difference(one: str, other: str, unit: str) -> _Relation:
    return _Relation(
        name=f"{one} - {other}",
        words=f"{one} against {other}",
        unit=unit,
        needs=(one, other),
        make=lambda v: v[one] - v[other],
    )


def _second_sensors(log: FlightLog) -> list[_Relation]:
    """Return the differences of channels that measure the same quantity: tas and tas_2, of two air-data computers."""
    sensors: dict[str, list[str]] = {}
    for name in log.channels:
        match = match_name(name) or match_name(NUMBERED.sub("", name))
        if match is not None and match.name in REPEATED:
            sensors.setdefault(match.name, []).append(name)
    pairs = []
    for quantity, names in sensors.items():
        for i, one in enumerate(names):
            for other in names[i + 1 :]:
                if unit_of(log, one) == unit_of(log, other):
                    unit = unit_of(log, one)
                    pairs.append(_difference(one, other, unit if unit in WORTH else unit_of(log, quantity)))
    return pairs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelationSeries:
    """A relation through a log, in flight, once a second.

    Attributes
    ----------
    name, words, unit : of the relation; `declares` is false where it only tells channels apart.
    time_s : (n,) seconds, values : (n,) in `unit`.
    nuisances : (n, 5) constant, Mach, altitude, and their rates: what a healthy relation may follow.
    sizes : (5,) standard deviations of the coefficients, infinite for the constant.
    effects : by channel, (n,) what one unit of its error adds to the relation.
    noise_sd : the least noise: recorded steps, or what pieces of 20 s show.
    resting_step : what the steps of all channels that mostly rest within one make of it together.
    """

    name: str
    words: str
    unit: str
    declares: bool
    time_s: FloatArray
    values: FloatArray
    nuisances: FloatArray
    sizes: FloatArray
    effects: Mapping[str, FloatArray]
    noise_sd: float
    resting_step: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationAnswer:
    """What one relation says of a window.

    Attributes
    ----------
    name, words, unit : of the relation, `channels` that stand in it.
    statistic, threshold : twice the gain in log-likelihood of the best change, and what it takes.
    effect : largest error of the relation in the window under the best change, in `unit`; `least_effect` what it takes.
    healthy_sd : of the relation without a change, beside what it may follow, in `unit`.
    """

    name: str
    words: str
    unit: str
    channels: tuple[str, ...]
    statistic: float
    threshold: float
    effect: float
    least_effect: float
    healthy_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticRelations:
    """What the static relations of a log say of a window.

    Attributes
    ----------
    findings : none or one, the change that the relations show best.
    relations : of every relation that the log has.
    limits : by channel and shape, what a change of it could not have been.
    missing : sentences on what was not compared, and why.
    """

    findings: tuple[Finding, ...]
    relations: tuple[RelationAnswer, ...]
    limits: tuple[Limit, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scanned:
    """A relation in a window.

    Attributes
    ----------
    effects : by channel, what one unit of its error adds to the relation.
    reach : (n_candidates,) the largest value of each candidate in the window, of size 1.
    best : the candidate that explains it best among those that are large enough, of all where none is.
    """

    series: RelationSeries
    scan: ChangeScan
    effects: Mapping[str, float]
    reach: FloatArray

    @property
    def by_rounding(self) -> FloatArray:
        """Sizes of the candidates that the steps of the record make at most.

        Where a channel rests, what rounding takes away may follow any course of at most half a step.
        """
        leverage = np.where(np.isfinite(self.scan.leverage), self.scan.leverage, 0.0)
        return 0.5 * self.series.resting_step * leverage

    @property
    def least(self) -> FloatArray:
        """Sizes of the candidates from which on a change is told."""
        return np.maximum(LEAST_STEPS * self.series.noise_sd / self.reach, self.by_rounding)

    @property
    def hidden(self) -> FloatArray:
        """Largest sizes of the candidates that, added to the window, may not be told."""
        return np.maximum(self.scan.hidden, np.abs(self.scan.amplitude) + self.least)

    @property
    def best(self) -> int:
        large = np.abs(self.scan.amplitude) >= self.least
        statistic = self.scan.statistic
        return int(np.argmax(np.where(large, statistic, -1.0) if large.any() else statistic))


def relation_series(log: FlightLog) -> tuple[tuple[RelationSeries, ...], tuple[str, ...]]:
    """Return the relations of a whole log, for `find_static` on many of its windows, and what was not compared."""
    relations, missing = _relations(log.channels)
    relations = _second_sensors(log) + relations
    if not relations:
        return (), tuple(missing)
    names = sorted({name for one in relations for name in one.needs})
    flies = airborne(log, log.time_s)
    if not flies.any():
        return (), ("no relation is checked: the log shows no flight",)
    blocks = Blocks.of(log.time_s[flies], BLOCK_S)
    wanted = {*names, *(name for name in ("cas", "mach", "altitude", "p_static", "tas") if name in log.channels)}
    values = {name: _possible(name, blocks.mean(log.channels[name].values[flies])) for name in wanted}
    follows = _follows(values, blocks.time_s)
    quanta, series = quanta_of(log, names), []
    resting = {name: step for name, step in quanta.items() if _rests(values[name], step)}
    # A temperature changes on its own; the steps of the others change with the flight that a relation may follow.
    resting |= {name: AVERAGED * step for name, step in resting.items() if name in ("tat", "sat")}
    for one in relations:
        part = {name: values[name] for name in one.needs}
        made = one.make(part)
        kept = np.isfinite(made) & np.isfinite(follows).all(axis=1)
        if not kept.any():
            missing.append(f"{one.words}: no sample in flight has all of {', '.join(one.needs)}")
            continue
        effects = {name: _effect(one, part, name)[kept] for name in one.needs}
        steps = sum(
            (np.nanmedian(np.abs(effects[name])) * quanta[name]) ** 2 / 12.0 for name in effects if name in quanta
        )
        time_s, made = blocks.time_s[kept], made[kept]
        numbers = float(np.finfo(np.float32).eps) * sum(
            float(np.nanmedian(np.abs(effect * part[name][kept]))) for name, effect in effects.items()
        )
        seen = _noise_about_lines(made, time_s)
        unexplained = np.sqrt(max(0.0, seen**2 - steps)) * (UNSEEN_STEPS if effects.keys() - quanta.keys() else 1.0)
        noise = max(float(np.hypot(np.sqrt(steps), unexplained)), numbers)
        series.append(
            RelationSeries(
                name=one.name,
                words=one.words,
                unit=one.unit,
                declares=one.declares,
                time_s=time_s,
                values=made,
                nuisances=follows[kept],
                sizes=np.array([np.inf, *(WORTH[one.unit] * size for size in FOLLOWS)]),
                effects=effects,
                noise_sd=noise,
                resting_step=sum(
                    float(np.nanmedian(np.abs(effects[name]))) * step
                    for name, step in resting.items()
                    if name in effects
                ),
            )
        )
    return tuple(series), tuple(missing)


def _rests(x: FloatArray, step: float) -> bool:
    """Say whether a channel mostly stays within a step from block to block."""
    moved = np.abs(np.diff(x))
    return bool(np.mean(moved[np.isfinite(moved)] < RESTS * step) > RESTING)


def _possible(name: str, x: FloatArray) -> FloatArray:
    low, high = DOMAIN.get(name, (-np.inf, np.inf))
    return np.where((x >= low) & (x <= high), x, np.nan)


def _follows(values: Values, time_s: FloatArray) -> FloatArray:
    """Return (n, 5) constant, airspeed in m/s, altitude and the rates of both, 0 for what the log does not have."""
    none = np.zeros(len(time_s))
    height = next((values[name] for name in ("altitude",) if name in values), none)
    if "cas" in values and "altitude" in values:
        speed = 340.0 * _mach(values)
    else:
        speed = next(
            (factor * values[name] for name, factor in (("mach", 340.0), ("tas", 1.0)) if name in values), none
        )
    if len(time_s) < 2:
        return np.column_stack([np.ones(len(time_s)), speed, height, none, none])
    rates = (np.gradient(x, time_s) for x in (speed, height))
    return np.column_stack([np.ones(len(time_s)), speed, height, *rates])


def _effect(relation: _Relation, part: Values, name: str) -> FloatArray:
    """Return what one unit of a channel's error adds to a relation, by a difference."""
    known = np.abs(part[name][np.isfinite(part[name])])
    size = 1e-4 * max(float(np.median(known)) if known.size else 0.0, 1e-6)
    # Downwards, away from Mach 1, where there is room.
    step = np.where(part[name] > 2.0 * size, -size, size)
    return np.asarray((relation.make({**part, name: part[name] + step}) - relation.make(part)) / step)


def _noise_about_lines(x: FloatArray, time_s: FloatArray) -> float:
    """Return the median standard deviation about a line of pieces of a relation."""
    edges = np.flatnonzero(np.diff(np.floor((time_s - time_s[0]) / PIECE_S)) > 0) + 1
    sds = []
    for piece, at in zip(np.split(x, edges), np.split(time_s, edges), strict=True):
        if len(piece) >= 0.5 * PIECE_S / BLOCK_S and len(piece) > 2:
            line = np.column_stack([np.ones(len(at)), at - at.mean()])
            rest = piece - line @ np.linalg.lstsq(line, piece, rcond=None)[0]
            sds.append(float(np.sqrt(rest @ rest / (len(piece) - 2))))
    return float(np.median(sds)) if sds else 0.0


def find_static(
    log: FlightLog,
    from_s: float,
    to_s: float,
    *,
    series: tuple[tuple[RelationSeries, ...], tuple[str, ...]] | None = None,
) -> StaticRelations:
    """Return the channel that disagrees with the others in a window, from some time on, if there is one.

    Parameters
    ----------
    log : the whole log rather than the window, which shows its noise and steps better.
    series : of the same log by `relation_series`, where many windows are looked at; None to make them.
    """
    every, missing = relation_series(log) if series is None else series
    said: list[str] = list(missing)
    scanned: list[_Scanned] = []
    onsets_s = np.arange(np.ceil(from_s + MARGIN_S), to_s - MARGIN_S + 1e-9, BLOCK_S)
    for one in every:
        inside = (one.time_s >= from_s) & (one.time_s < to_s)
        n = int(np.count_nonzero(inside))
        if n < FEWEST_BLOCKS or not onsets_s.size:
            said.append(f"{one.words}: {n} s of flight in the window, at least {FEWEST_BLOCKS} are needed")
            continue
        time_s = one.time_s[inside]
        candidates = np.hstack(steps_and_ramps(time_s, onsets_s))
        nuisances = one.nuisances[inside]
        nuisances = np.column_stack([nuisances[:, 0], nuisances[:, 1:] - nuisances[:, 1:].mean(axis=0)])
        scan = scan_changes(
            one.values[inside],
            time_s,
            nuisances,
            candidates,
            floor=one.noise_sd,
            sizes=one.sizes,
            declared_at=THRESHOLD,
        )
        effects = {name: float(np.nanmedian(effect[inside])) for name, effect in one.effects.items()}
        effects = {name: effect for name, effect in effects.items() if effect}  # at rest a temperature has none
        reach = np.concatenate([np.ones(onsets_s.size), to_s - onsets_s])
        scanned.append(_Scanned(series=one, scan=scan, effects=effects, reach=reach))
    answers = tuple(_answer(one) for one in scanned)
    declared = [
        (answer.statistic, i)
        for i, (answer, one) in enumerate(zip(answers, scanned, strict=True))
        if one.series.declares and answer.statistic >= answer.threshold and answer.effect >= answer.least_effect
    ]
    findings: tuple[Finding, ...] = ()
    if declared:
        findings = (_finding(log, scanned, scanned[max(declared)[1]], onsets_s),)
    # Beside a change that is told no second one is looked for.
    limits = () if findings else _limits(log, scanned, onsets_s)
    return StaticRelations(findings=findings, relations=answers, limits=limits, missing=tuple(dict.fromkeys(said)))


def _answer(one: _Scanned) -> RelationAnswer:
    best = one.best
    return RelationAnswer(
        name=one.series.name,
        words=one.series.words,
        unit=one.series.unit,
        channels=tuple(one.effects),
        statistic=float(one.scan.statistic[best]),
        threshold=THRESHOLD,
        effect=abs(float(one.scan.amplitude[best] * one.reach[best])),
        least_effect=float(one.least[best] * one.reach[best]),
        healthy_sd=one.scan.noise_sd,
    )


def _finding(log: FlightLog, scanned: list[_Scanned], strongest: _Scanned, onsets_s: FloatArray) -> Finding:
    """Return the fault that the strongest relation shows, named by all of them."""
    scan, effects, reach, best = strongest.scan, strongest.effects, strongest.reach, strongest.best
    shape = "bias" if best < onsets_s.size else "drift"
    onset_s = float(onsets_s[best % onsets_s.size])
    shown = [
        (
            float(one.scan.amplitude[best]),
            float(np.hypot(one.scan.sd[best], AVERAGED * one.series.noise_sd / one.reach[best])),
            one.effects,
        )
        for one in scanned
    ]

    def explained(channel: str) -> tuple[float, float, float]:
        """Return the misfit of a channel's error in all relations, its magnitude and standard deviation."""
        power = sum((parts.get(channel, 0.0) / sd) ** 2 for _, sd, parts in shown)
        if power <= 0.0:
            return np.inf, 0.0, np.inf
        size = sum(parts.get(channel, 0.0) * seen / sd**2 for seen, sd, parts in shown) / power
        misfit = sum(((seen - parts.get(channel, 0.0) * size) / sd) ** 2 for seen, sd, parts in shown)
        return misfit, size, power**-0.5

    ranked = sorted((explained(channel)[0], i, channel) for i, channel in enumerate(effects))
    among = tuple(channel for misfit, _, channel in ranked if misfit <= ranked[0][0] + AS_GOOD)
    fault = among[0]
    # The size from the relation that shows it best, whose noise alone the interval has.
    magnitude, sd = scan.amplitude[best] / effects[fault], scan.sd[best] / abs(effects[fault])
    of_shape = slice(0, onsets_s.size) if shape == "bias" else slice(onsets_s.size, None)
    near = onsets_s[scan.statistic[of_shape] >= scan.statistic[best] - CHI_SQUARE_95]
    unit = unit_of(log, fault)
    return Finding(
        fault=fault,
        among=among,
        channels=(fault,),
        stage="static relations",
        shape=shape,
        magnitude=float(magnitude),
        sd=float(sd),
        unit=_magnitude_unit(shape, unit),
        onset_s=onset_s,
        onset_ci95=(float(near[0]) - BLOCK_S, float(near[-1]) + BLOCK_S),
        statistic=float(scan.statistic[best]),
        threshold=THRESHOLD,
        effect={fault: float(abs(magnitude) * reach[best])},
        evidence={one.series.name: float(one.scan.statistic[best]) for one in scanned},
    )


def _magnitude_unit(shape: str, unit: str) -> str:
    return magnitude_unit(Fault(shape=shape, channel="any", magnitude=1.0, onset_s=0.0), unit)


def _limits(log: FlightLog, scanned: list[_Scanned], onsets_s: FloatArray) -> tuple[Limit, ...]:
    """Return by channel and shape the largest change that would not have been told, at the worst of the onsets.

    A relation excludes what moves one of its sides alone: where the others share a sensor with a channel, how far that
    channel is from what they make of it, and not its error.
    """
    least: dict[tuple[str, str], Limit] = {}
    n = onsets_s.size
    half = max(1, n // 2)  # a drift that begins late in the window may be of nearly any size
    for one in scanned:
        if not one.series.declares:
            continue
        for shape, every, counted in (("bias", slice(0, n), n), ("drift", slice(n, 2 * n), half)):
            sizes, reach = one.hidden[every], one.reach[every]
            if not np.isfinite(sizes[:counted]).all():
                continue
            for channel, effect in one.effects.items():
                others = frozenset[str]().union(*(_sensors(name) for name in one.effects.keys() - {channel}))
                # Of a drift that begins later a window holds too little.
                last = n if shape == "bias" else max(half, int(np.searchsorted(onsets_s, onsets_s[-1] - LATE_S)) + 1)
                limit = Limit(
                    fault=channel,
                    shape=shape,
                    channel=channel,
                    excluded_above=float(sizes[:counted].max()) / abs(effect),
                    unit=_magnitude_unit(shape, unit_of(log, channel)),
                    effect=float((sizes * reach)[:counted].max()) / abs(effect),
                    onsets_s=tuple(onsets_s[:last].tolist()),
                    sizes=tuple((sizes[:last] / abs(effect)).tolist()),
                    bounds="disagreement" if _sensors(channel) & others else "error",
                )
                known = least.get((channel, shape))
                if known is None or limit.effect < known.effect:
                    least[channel, shape] = limit
    return tuple(least.values())


def _sensors(channel: str) -> frozenset[str]:
    """Return the sensors of a channel; a second one of a quantity may have those of the first."""
    match = match_name(channel) or match_name(NUMBERED.sub("", channel))
    name = channel if match is None else match.name
    return SENSORS.get(name, frozenset({name}))
