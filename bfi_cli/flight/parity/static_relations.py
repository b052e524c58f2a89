"""Channels that follow from each other sample by sample: an air-data computer, or a second sensor, that disagrees.

A fault of a pressure or of the temperature moves every channel that is computed from it alike and leaves these
relations alone; an error of one channel (its computation, its transmission, its own sensor) breaks those that it
stands in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from operator import itemgetter

import numpy as np

from ...airdata import SENSORS
from ...airdata import relations as table
from ...airdata.relations import AIR, DOMAIN, State, mach_by, standard_temperature
from ...airdata.relations import Relation as Row
from ...faults.shapes import SHAPES
from ...flightlog import FlightLog
from ...flightlog.phases import Phase, airborne
from ...kernels import BoolArray, FloatArray
from ...kernels.change_scan import ChangeScan, scan_changes, steps_and_ramps
from ...quantities.channels import REPEATED, STANDARD, match_name, quantity_of
from .finding import CHI_SQUARE, Bound, Finding, Hidden, squares_by_onset
from .sampled import Blocks, quanta_of, unit_of
from .stuck import stuck_errors

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
# RESTS, RESTING [quanta, 1]: largest move between blocks of a channel at rest, share of blocks at rest. Set
# on two recorded flights with altitudes in steps of 25 ft, which then make no change (docs/theory.md, 15.5).
RESTS, RESTING = 0.01, 0.25
# Twice the loss in log-likelihood up to which another channel explains the relations as well: ten to one.
AS_GOOD = 4.6
# AVERAGED [quanta]: rounding that a comparison of channels keeps: a change lies between two means, which average most.
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
# An indicated airspeed is not corrected for the position of the ports: an error of the static pressure in proportion to
# impact pressure and coefficient of lift goes with V0^2 / V, V0 its median. Of that coefficient, to 1: in handbooks of
# light aircraft the difference from the calibrated airspeed changes by 0.1 to 0.4 m/s per m/s.
POSITION_ERROR = 0.1
# SLOWEST [V0]: speed below which an aircraft does not fly.
SLOWEST = 0.3
# `FOLLOWS` in units of other relations, about what 1 m/s of airspeed is worth.
WORTH = {"m/s": 1.0, "K": 1.0, "m": 10.0, "Pa": 100.0, "rad": 0.02, "1": 0.003}
# Channels of which `FOLLOWS` is made.
FOLLOWED = frozenset(("cas", "ias", "mach", "altitude", "p_static", "tas"))
# Headings turn by a whole round, which is no difference; altimeters have a knob each.
COMPARED = frozenset(REPEATED) - {"yaw", "baro_altitude"}


@dataclass(frozen=True, slots=True)
class Balance:
    """A channel less what others make of it: 0, or smooth in the flight, while every channel is right.

    Attributes
    ----------
    name, unit : of the relation.
    channel, others : its two sides; `value` makes the one of the others.
    scale : what one unit of the channel counts in `unit`.
    declares : whether a change of it is a fault; else it only tells channels apart.
    twins : whether its sides are two sensors of one quantity.
    """

    name: str
    unit: str
    channel: str
    others: tuple[str, ...]
    value: Callable[[Values], FloatArray | float]
    scale: float = 1.0
    declares: bool = True
    twins: bool = False

    @property
    def needs(self) -> tuple[str, ...]:
        return (self.channel, *self.others)

    @property
    def words(self) -> str:
        """What it compares."""
        channel = self.channel if self.scale == 1.0 else f"{self.scale:g} {self.unit} x {self.channel}"
        *most, last = self.others
        return f"{channel} against that of {', '.join(most)}{' and ' if most else ''}{last}"

    def bounds(self, channel: str) -> Bound:
        """Return what it bounds of a channel: the error, or, where others come from one of its sensors, less."""
        others = frozenset[str]().union(*(_sensors(name) for name in self.needs if name != channel))
        return "disagreement" if _sensors(channel) & others else "error"

    def of(self, values: Values) -> FloatArray:
        """Return the relation, in `unit`."""
        return np.asarray(self.scale * (values[self.channel] - self.value(values)))


def _comparison(row: Row) -> Balance:
    """Return a row of the table that an air-data computer keeps as a comparison of quantities."""
    channel, *others = row.needs
    scale, unit = row.worth
    return Balance(
        row.name, unit or STANDARD[channel].unit, channel, tuple(others), lambda v: row.expected(_state(v)), scale=scale
    )


def _state(values: Values) -> State:
    return State(values=values, rates={}, time_s=np.empty(0))


def _relations(log: FlightLog) -> tuple[list[Balance], list[str]]:
    """Return the relations between the channels of a log, and what is missing for others."""
    sensors = _by_quantity(log)
    static = next((name for name in ("altitude", "p_static") if name in sensors), "altitude")
    heats = tuple(name for name in ("tat", "sat") if name in sensors) or ("tat",)
    known: dict[str, Balance] = {}
    for row in table.RELATIONS:
        if row.name and {*row.needs} <= sensors.keys():
            known.setdefault(row.name, _comparison(row))
    if len(heats) == 1 and {"tas", static, *heats} <= sensors.keys():
        known["lapse"] = Balance(
            "lapse", "K", heats[0], (static,), lambda v: standard_temperature(_state(v), static), declares=False
        )
    is_there = {name: name in sensors for name in ("tas", "mach", "cas")}
    is_there |= {"altitude": static in sensors, "tat or sat": heats[0] in sensors}
    is_there["mach, or cas and altitude"] = "mach" in sensors or (
        not {"cas", "ias"}.isdisjoint(sensors) and static in sensors
    )
    missing = []
    for what, parts in (
        ("the computation of tas is not checked", ("tas", "tat or sat", "mach, or cas and altitude")),
        ("mach, cas and altitude are not compared", ("mach", "cas", "altitude")),
    ):
        if lacks := [part for part in parts if not is_there[part]]:
            missing.append(f"{what}: the log lacks {', '.join(lacks)}")
    expanded = [relation for base in known.values() for relation in _sensor_relations(base, sensors)]
    return [*_second_sensors(log), *expanded], missing


def _by_quantity(log: FlightLog) -> dict[str, list[str]]:
    """Return the channels that read each quantity of the relations, in its unit, the plain name first."""
    here = log.independent([name for name in log.channels if _quantity(name) in DOMAIN])
    sensors = {name: [name] for name in here if name in STANDARD and _quantity(name) == name}
    for name in sorted(here):
        quantity = _quantity(name)
        if name != quantity and (unit_of(log, name) or "1") == STANDARD[quantity].unit:
            sensors.setdefault(quantity, []).append(name)
    return sensors


def _sensor_relations(relation: Balance, sensors: Mapping[str, list[str]]) -> list[Balance]:
    """Return a relation between quantities for their first sensors, their second ones, and so on.

    Two air-data computers are thus each held against their own channels; a quantity that is measured less often gives
    its first sensor.
    """
    expanded = []
    for k in range(max(len(sensors[quantity]) for quantity in relation.needs)):
        chosen = {quantity: names[k] if k < len(names) else names[0] for quantity, names in sensors.items()}

        def value(values: Values, chosen: Mapping[str, str] = chosen) -> FloatArray | float:
            return relation.value({quantity: values[name] for quantity, name in chosen.items() if name in values})

        expanded.append(
            replace(
                relation,
                name=relation.name if k == 0 else f"{relation.name}, sensor {k + 1}",
                channel=chosen[relation.channel],
                others=tuple(chosen[quantity] for quantity in relation.others),
                value=value,
            )
        )
    return expanded


def _second_sensors(log: FlightLog) -> list[Balance]:
    """Return the differences of channels that measure the same quantity: tas and tas_2, of two air-data computers."""
    sensors: dict[str, list[str]] = {}
    for name in log.channels:
        if (quantity := _quantity(name)) in COMPARED:
            sensors.setdefault(quantity, []).append(name)
    pairs = []
    for quantity, names in sensors.items():
        for first, other in combinations(names, 2):
            unit = unit_of(log, first)
            if unit == unit_of(log, other):
                unit = unit if unit in WORTH else STANDARD[quantity].unit
                pairs.append(Balance(f"{first} - {other}", unit, first, (other,), itemgetter(other), twins=True))
    return pairs


def _quantity(channel: str) -> str:
    """Return the standard name of what a channel measures, of a second sensor too; its own name where it has none."""
    match = match_name(channel)
    return channel if match is None else quantity_of(match.name)


def _sensors(channel: str) -> frozenset[str]:
    """Return the sensors of a channel; a second one of a quantity may have those of the first."""
    quantity = _quantity(channel)
    return SENSORS.get(quantity, frozenset({quantity}))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelationSeries:
    """A relation through a log, in flight, once a second.

    Attributes
    ----------
    time_s : (n,) seconds, values : (n,) in the unit of the relation.
    nuisances : (n, 5) constant, Mach, altitude, and their rates: what a healthy relation may follow; of an indicated
        airspeed (n, 6) its position error too.
    sizes : (5,) or (6,) standard deviations of the coefficients, infinite for the constant.
    effects : by channel, (n,) what one unit of its error adds to the relation.
    noise_sd : the least noise: recorded steps, or what pieces of 20 s show.
    resting_step : what the steps of all channels that mostly rest within one make of it together.
    readings : (n,) of the two sensors, where it is their difference, and of the air about them; else empty.
    """

    relation: Balance
    time_s: FloatArray
    values: FloatArray
    nuisances: FloatArray
    sizes: FloatArray
    effects: Mapping[str, FloatArray]
    noise_sd: float
    resting_step: float
    readings: Mapping[str, FloatArray] = field(default_factory=dict)

    def between(self, from_s: float, to_s: float, *, shows: str | None = None) -> RelationSeries:
        """Return the part in a window, its nuisances about their means there.

        Parameters
        ----------
        shows : a channel, to leave out where its effect is not known.
        """
        inside = (self.time_s >= from_s) & (self.time_s < to_s)
        if shows is not None:
            inside &= np.isfinite(self.effects[shows])
        nuisances = self.nuisances[inside]
        nuisances[:, 1:] -= nuisances[:, 1:].sum(axis=0) / max(1, len(nuisances))
        return replace(
            self,
            time_s=self.time_s[inside],
            values=self.values[inside],
            nuisances=nuisances,
            effects={name: effect[inside] for name, effect in self.effects.items()},
            readings={name: reading[inside] for name, reading in self.readings.items()},
        )

    def scan(self, candidates: FloatArray, *, declared_at: float = np.inf) -> ChangeScan:
        """Return how much better each of these changes, (n, n_candidates), explains the relation than none."""
        return scan_changes(
            self.values,
            self.time_s,
            self.nuisances,
            candidates,
            floor=self.noise_sd,
            sizes=self.sizes,
            declared_at=declared_at,
        )


Series = tuple[tuple[RelationSeries, ...], tuple[str, ...]]  # of a whole log, and what was not compared


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationAnswer:
    """What one relation says of a window.

    Attributes
    ----------
    channels : that stand in it.
    statistic, threshold : twice the gain in log-likelihood of the best change, and what it takes.
    effect : largest error of the relation in the window under the best change; `least_effect` what it takes.
    declares : whether a change of it is a fault.
    """

    name: str
    channels: tuple[str, ...]
    statistic: float
    threshold: float
    effect: float
    least_effect: float
    declares: bool

    @property
    def changes(self) -> bool:
        """Whether the relation is broken in the window: both statistic and size are asked for."""
        return self.statistic >= self.threshold and self.effect >= self.least_effect


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticRelations:
    """What the static relations of a log say of a window.

    Attributes
    ----------
    findings : none or one, the change that the relations show best.
    relations : of every relation that the log has.
    limits : by channel and shape, what a change of it could not have been.
    """

    findings: tuple[Finding, ...]
    relations: tuple[RelationAnswer, ...]
    limits: tuple[Hidden, ...]


_Stuck = tuple[float, Finding]  # twice the negative log-likelihood, but for a constant, and the sensor that is stuck


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scanned:
    """A relation in a window.

    Attributes
    ----------
    effects : by channel, what one unit of its error adds to the relation.
    reach : (n_candidates,) the largest value of each candidate in the window, of size 1.
    stuck : its sensors as stuck ones, the likeliest first; empty where no step or ramp is as bad.
    """

    series: RelationSeries
    scan: ChangeScan
    effects: Mapping[str, float]
    reach: FloatArray
    stuck: tuple[_Stuck, ...]

    @property
    def least(self) -> FloatArray:
        """Sizes of the candidates from which on a change is told.

        Where a channel rests, what rounding takes away may follow any course of at most half a step.
        """
        leverage = np.where(np.isfinite(self.scan.leverage), self.scan.leverage, 0.0)
        return np.maximum(LEAST_STEPS * self.series.noise_sd / self.reach, 0.5 * self.series.resting_step * leverage)

    @property
    def hidden(self) -> FloatArray:
        """Largest sizes of the candidates that, added to the window, may not be told."""
        return np.maximum(self.scan.hidden, np.abs(self.scan.amplitude) + self.least)

    def not_overruled(self, changed: Sequence[_Scanned]) -> tuple[_Stuck, ...]:
        """Return what is stuck, without a sensor whose twin is at odds with a third channel while it is not itself."""
        at_odds = [relation.effects.keys() for relation in changed if relation.effects.keys() & self.effects.keys()]
        return tuple(stuck for stuck in self.stuck if all(stuck[1].fault in channels for channels in at_odds))

    @property
    def best(self) -> int:
        """The candidate that explains it best among those that are large enough, of all where none is."""
        large = np.abs(self.scan.amplitude) >= self.least
        statistic = self.scan.statistic
        return int(np.argmax(np.where(large, statistic, -1.0) if large.any() else statistic))

    @property
    def answer(self) -> RelationAnswer:
        best, reached = self.best, self.reach[self.best]
        statistic, effect = float(self.scan.statistic[best]), abs(float(self.scan.amplitude[best] * reached))
        least_effect = float(self.least[best] * reached)
        if self.stuck:
            _, stuck = self.stuck[0]
            statistic, effect = stuck.statistic, abs(stuck.effect[stuck.fault] * self.effects[stuck.fault])
            least_effect = LEAST_STEPS * self.series.noise_sd
        return RelationAnswer(
            name=self.series.relation.name,
            channels=tuple(self.effects),
            statistic=statistic,
            threshold=THRESHOLD,
            effect=effect,
            least_effect=least_effect,
            declares=self.series.relation.declares,
        )


def relation_series(log: FlightLog, phases: Sequence[Phase] | None = None) -> Series:
    """Return the relations of a whole log, for `find_static` on many of its windows, and what was not compared.

    Parameters
    ----------
    phases : of the log, None to find them.
    """
    relations, missing = _relations(log)
    if not relations:
        return (), tuple(missing)
    names = sorted({name for relation in relations for name in relation.needs})
    flies = airborne(log, log.time_s, phases)
    if not flies.any():
        return (), ("no relation is checked: the log shows no flight",)
    blocks = Blocks.of(log.time_s[flies], BLOCK_S)
    values: dict[str, FloatArray] = {}
    first = {quantity: sensors[0] for quantity, sensors in _by_quantity(log).items()}
    main = {quantity: name for quantity, name in first.items() if quantity in FOLLOWED}
    about = {quantity: name for quantity, name in first.items() if quantity in AIR}
    for name in {*names, *main.values(), *about.values()}:
        low, high = DOMAIN.get(_quantity(name), (-np.inf, np.inf))
        x = blocks.mean(log.channels[name].values[flies])
        values[name] = np.where((x >= low) & (x <= high), x, np.nan)
    follows = _follows({quantity: values[name] for quantity, name in main.items()}, blocks.time_s)
    quanta, series = quanta_of(log, names), []
    resting = {name: step for name, step in quanta.items() if _rests(values[name], step)}
    # A temperature changes on its own; the steps of the others change with the flight that a relation may follow.
    resting |= {name: AVERAGED * step for name, step in resting.items() if _quantity(name) in ("tat", "sat")}
    for relation in relations:
        made = relation.of(values)
        kept = np.isfinite(made) & np.isfinite(follows).all(axis=1)
        if not kept.any():
            missing.append(f"{relation.words}: no sample in flight has all of {', '.join(relation.needs)}")
            continue
        effects = {name: _effect(relation, values, name)[kept] for name in relation.needs}
        typical = {name: float(np.nanmedian(np.abs(effect))) for name, effect in effects.items()}
        time_s, made = blocks.time_s[kept], made[kept]
        read_as = about | {name: name for name in relation.needs}
        nuisances, sizes = follows[kept], list(FOLLOWS)
        if "ias" in map(_quantity, relation.needs) and not relation.twins:
            nuisances, sizes = _with_position_error(nuisances), [*FOLLOWS, POSITION_ERROR]
        steps = sum((typical[name] * quanta[name]) ** 2 / 12.0 for name in effects if name in quanta)
        unexplained = np.sqrt(max(0.0, _noise_about_lines(made, time_s) ** 2 - steps))
        unexplained *= UNSEEN_STEPS if effects.keys() - quanta.keys() else 1.0
        numbers = float(np.finfo(np.float32).eps) * sum(
            float(np.nanmedian(np.abs(effect * values[name][kept]))) for name, effect in effects.items()
        )
        series.append(
            RelationSeries(
                relation=relation,
                time_s=time_s,
                values=made,
                nuisances=nuisances,
                sizes=np.array([np.inf, *(WORTH[relation.unit] * size for size in sizes)]),
                effects=effects,
                noise_sd=max(float(np.hypot(np.sqrt(steps), unexplained)), numbers),
                resting_step=sum(typical[name] * step for name, step in resting.items() if name in effects),
                readings={read: values[name][kept] for read, name in read_as.items()} if relation.twins else {},
            )
        )
    return tuple(series), tuple(missing)


def _rests(x: FloatArray, step: float) -> bool:
    """Say whether a channel mostly stays within a step from block to block."""
    moved = np.abs(np.diff(x))
    return bool(np.mean(moved[np.isfinite(moved)] < RESTS * step) > RESTING)


def _follows(values: Values, time_s: FloatArray) -> FloatArray:
    """Return (n, 5) constant, airspeed in m/s, altitude and the rates of both, 0 for what the log does not have."""
    none = np.zeros(len(time_s))
    height = values.get("altitude", none)
    # Not tas where there is another: a relation that follows its steps has lost its own noise.
    if "altitude" in values and ("cas" in values or ("ias" in values and "mach" not in values)):
        speed = 340.0 * mach_by(_state(values), "cas" if "cas" in values else "ias", "altitude")
    else:
        speed = 340.0 * values["mach"] if "mach" in values else values.get("tas", none)
    rates = (np.gradient(x, time_s) if len(time_s) > 1 else none for x in (speed, height))
    return np.column_stack([np.ones(len(time_s)), speed, height, *rates])


def _with_position_error(follows: FloatArray) -> FloatArray:
    """Return (n, 6) `_follows`, and what a static pressure that errs with the coefficient of lift makes of airspeed."""
    typical = max(float(np.median(follows[:, 1])), 1e-9)
    return np.column_stack([follows, typical**2 / np.maximum(follows[:, 1], SLOWEST * typical)])


def _effect(relation: Balance, values: Values, name: str) -> FloatArray:
    """Return what one unit of a channel's error adds to a relation, by a difference."""
    known = np.abs(values[name][np.isfinite(values[name])])
    size = 1e-4 * max(float(np.median(known)) if known.size else 0.0, 1e-6)
    # Downwards, away from Mach 1, where there is room.
    step = np.where(values[name] > 2.0 * size, -size, size)
    return np.asarray((relation.of({**values, name: values[name] + step}) - relation.of(values)) / step)


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


def find_static(log: FlightLog, from_s: float, to_s: float, *, series: Series | None = None) -> StaticRelations:
    """Return the channel that disagrees with the others in a window, from some time on, if there is one.

    Parameters
    ----------
    log : the whole log rather than the window, which shows its noise and steps better.
    series : of the same log by `relation_series`, where many windows are looked at; None to make them.
    """
    every, _ = relation_series(log) if series is None else series
    scanned: list[_Scanned] = []
    onsets_s = np.arange(np.ceil(from_s + MARGIN_S), to_s - MARGIN_S + 1e-9, BLOCK_S)
    reach = np.concatenate([np.ones(onsets_s.size), to_s - onsets_s])
    for part in (whole.between(from_s, to_s) for whole in every):
        if len(part.time_s) < FEWEST_BLOCKS or not onsets_s.size:
            continue
        candidates = np.hstack(steps_and_ramps(part.time_s, onsets_s))
        scan = part.scan(candidates, declared_at=THRESHOLD)
        effects = {name: float(np.nanmedian(effect)) for name, effect in part.effects.items()}
        effects = {name: effect for name, effect in effects.items() if effect}  # at rest a temperature has none
        stuck = tuple(_stuck_sensors(part, onsets_s, candidates, effects))
        scanned.append(_Scanned(series=part, scan=scan, effects=effects, reach=reach, stuck=stuck))
    changed = [relation for relation in scanned if relation.answer.declares and relation.answer.changes]
    scanned = [replace(relation, stuck=relation.not_overruled(changed)) for relation in scanned]
    answers = tuple(relation.answer for relation in scanned)
    # What is stuck its twin tells for certain; a step or a ramp of another relation may be no more than like it.
    declared = [
        (bool(scanned[i].stuck), answer.statistic, i)
        for i, answer in enumerate(answers)
        if answer.declares and answer.changes
    ]
    findings: tuple[Finding, ...] = ()
    if declared:
        strongest = scanned[max(declared)[-1]]
        if strongest.stuck:
            loss, finding = strongest.stuck[0]
            among = dict.fromkeys(other.fault for its_loss, other in strongest.stuck if its_loss <= loss + AS_GOOD)
            evidence = {answer.name: answer.statistic for answer in answers}
            findings = (replace(finding, among=tuple(among), evidence=evidence),)
        else:
            findings = (_finding(log, scanned, strongest, onsets_s),)
    # Beside a change that is told no second one is looked for.
    limits = () if findings else _limits(log, scanned, onsets_s, (from_s, to_s))
    return StaticRelations(findings=findings, relations=answers, limits=limits)


def hidden_sizes(
    series: Series, channel: str, window: tuple[float, float], courses: Callable[[FloatArray], FloatArray]
) -> dict[Bound, FloatArray]:
    """Return by what a relation bounds (n_courses,) the largest errors of a channel that none would have told.

    Parameters
    ----------
    courses : from times (n,), (n, n_courses) an error of size 1 at these.
    """
    hidden: dict[Bound, FloatArray] = {}
    for whole in series[0]:
        part, relation = whole.between(*window), whole.relation
        effect = float(np.nanmedian(part.effects[channel])) if channel in part.effects and len(part.time_s) else 0.0
        if not (relation.declares and effect and len(part.time_s) >= FEWEST_BLOCKS):
            continue
        candidates = courses(part.time_s)
        scanned = _Scanned(
            series=part,
            scan=part.scan(candidates, declared_at=THRESHOLD),
            effects={channel: effect},
            reach=np.ones(candidates.shape[1]),
            stuck=(),
        )
        bounds, sizes = relation.bounds(channel), scanned.hidden / abs(effect)
        hidden[bounds] = np.minimum(hidden.get(bounds, sizes), sizes)
    return hidden


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationOscillation:
    """An oscillation that a relation shows throughout a window: its frequency, Hz, and size on a channel."""

    words: str
    frequency_hz: float
    size: float
    sd: float


def find_oscillation(
    series: Series, channel: str, window: tuple[float, float], frequencies_hz: FloatArray, *, least: float
) -> RelationOscillation | None:
    """Return the oscillation of a channel that its relations show best in a window, None where none stands out.

    Parameters
    ----------
    least : size of the smallest that is wanted, in the channel's unit; a relation that varies by less is not searched.
    """
    best, statistic = None, THRESHOLD
    for whole in series[0]:
        part, relation = whole.between(*window), whole.relation
        effect = float(np.nanmedian(part.effects[channel])) if channel in part.effects and len(part.time_s) else 0.0
        if not (relation.declares and effect and len(part.time_s) >= FEWEST_BLOCKS):
            continue
        # A mean over a block flattens it.
        flattened = np.sinc(BLOCK_S * frequencies_hz)
        if np.std(part.values) < 0.5 * least * abs(effect) * float(flattened.min()):
            continue
        phases = 2.0 * np.pi * frequencies_hz * part.time_s[:, None]
        scan = part.scan(np.hstack([flattened * np.sin(phases), flattened * np.cos(phases)]))
        both, amplitudes, sds = (x.reshape(2, -1) for x in (scan.statistic, scan.amplitude, scan.sd))
        k = int(np.argmax(both.max(axis=0)))
        if both[:, k].max() > statistic:
            statistic = float(both[:, k].max())
            best = RelationOscillation(
                words=relation.words,
                frequency_hz=float(frequencies_hz[k]),
                size=float(np.hypot(*amplitudes[:, k]) / abs(effect)),
                sd=float(sds[:, k].max() / abs(effect)),
            )
    return best


def _stuck_courses(part: RelationSeries, during: BoolArray) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield channel, shape and (n, n_stretches) what each of two sensors adds to their difference while it is stuck.

    Parameters
    ----------
    during : (n, n_stretches) where it is stuck, the whole window last.
    """
    air = {name: reading for name, reading in part.readings.items() if name in AIR}
    for channel, twin in (part.relation.needs, part.relation.needs[::-1]):
        effect, readings = part.effects[channel][:, None], part.readings[channel]
        for shape, errors in stuck_errors(_quantity(channel), readings, part.readings[twin], air, during).items():
            healthy = part.values[:, None] - effect * errors
            level = np.mean(healthy[:, :-1], axis=0, where=during[:, :-1])
            level -= np.mean(healthy[:, :-1], axis=0, where=~during[:, :-1])
            yield channel, shape, effect * errors + np.append(level, 0.0) * during


def _stuck_sensors(
    part: RelationSeries, onsets_s: FloatArray, candidates: FloatArray, effects: Mapping[str, float]
) -> list[_Stuck]:
    """Return two sensors as stuck ones, by channel and shape in the likeliest stretch, the likeliest first.

    A sensor is stuck from an onset on, or was before and is until some time, or throughout the window. It then errs by
    the whole of what its twin does, and what it keeps is what it read within the second of its onset. The hypotheses
    are compared by all that each leaves of the difference, slow or not: noise of any size that wanders would take a
    sensor that moves for one that rests.

    Parameters
    ----------
    candidates : (n, n_candidates) steps and ramps, none of which may be as likely.
    effects : by channel, what one unit of its error adds to the relation.
    """
    least, n = LEAST_STEPS * part.noise_sd, len(part.time_s)
    if not part.relation.twins or np.ptp(part.values) < least:
        return []

    def loss(squares: FloatArray) -> FloatArray:
        """Return twice the negative logarithm of the likelihood of what is left."""
        return np.asarray(n * np.log(np.maximum(squares / n, part.noise_sd**2)))

    # Steps within a second too, which move its mean by a part.
    steps, _ = np.hsplit(candidates, 2)
    within = [steps[:, 1:] + share * np.diff(-steps, axis=1) for share in (0.25, 0.5, 0.75)]
    others = np.hstack([candidates, *within])
    bound = loss(squares_by_onset(part.values, others[:, np.ptp(others, axis=0) > 0.0])[0]).min() - AS_GOOD
    rows = np.unique(np.searchsorted(part.time_s, onsets_s))
    rows = rows[(rows > 0) & (rows < n - 1)]
    after = np.arange(n)[:, None] >= rows
    during = np.hstack([after, ~after, np.ones((n, 1), dtype=bool)])
    begins = np.arange(len(rows))  # of `during`, the stretches of which the onset is in the window
    stuck = []
    for channel, shape, courses in _stuck_courses(part, during):
        losses = loss(n * np.var(part.values[:, None] - courses, axis=0))
        first, second = courses[rows, begins], courses[rows + 1, begins]
        losses[begins] += (first / np.hypot(second - first, part.noise_sd)) ** 2
        losses[~np.isfinite(losses)] = np.inf
        best = int(np.argmin(losses))
        if not losses[best] < bound:
            continue
        statistic = float(part.scan(courses[:, [best]]).statistic[0])
        sizes = np.sort(np.abs(courses[:, best]))
        # A second in which one of them begins or ends to err moves it too: what is stuck errs for longer.
        if statistic < THRESHOLD or sizes[-round(MARGIN_S / BLOCK_S)] < least:
            continue
        stuck_s = part.time_s[during[:, best]]
        near_s = part.time_s[rows[losses[begins] <= losses[best] + CHI_SQUARE]]
        first_s, last_s = (near_s[0], near_s[-1]) if best in begins else (-np.inf, stuck_s[0])
        finding = Finding(
            fault=channel,
            among=(channel,),
            channels=(channel,),
            stage="static relations",
            shape=shape,
            onset_s=float(stuck_s[0]) - 0.5 * BLOCK_S,
            onset_ci95=(float(first_s) - 1.5 * BLOCK_S, float(last_s) + 0.5 * BLOCK_S),
            offset_s=None if during[-1, best] else float(stuck_s[-1]) + 0.5 * BLOCK_S,
            statistic=statistic,
            threshold=THRESHOLD,
            effect={channel: float(sizes[-1]) / abs(effects[channel])},
        )
        stuck.append((float(losses[best]), finding))
    return sorted(stuck, key=itemgetter(0))


def _finding(log: FlightLog, scanned: list[_Scanned], strongest: _Scanned, onsets_s: FloatArray) -> Finding:
    """Return the fault that the strongest relation shows, named by all of them."""
    scan, effects, reach, best = strongest.scan, strongest.effects, strongest.reach, strongest.best
    shape = "bias" if best < onsets_s.size else "drift"
    onset_s = float(onsets_s[best % onsets_s.size])
    seen = np.array([relation.scan.amplitude[best] for relation in scanned])
    sds = np.hypot(
        [relation.scan.sd[best] for relation in scanned],
        [AVERAGED * relation.series.noise_sd / relation.reach[best] for relation in scanned],
    )

    def misfit(channel: str) -> float:
        """Return how badly an error of a channel, of the best size, explains what all relations show."""
        parts = np.array([relation.effects.get(channel, 0.0) for relation in scanned]) / sds
        power = float(parts @ parts)
        if power <= 0.0:
            return np.inf
        rest = seen / sds
        rest -= parts * (parts @ rest) / power
        return float(rest @ rest)

    # Losses of two sensors of one quantity are equal but for rounding: the first is named with its sign.
    ranked = sorted((float(f"{misfit(channel):.9g}"), i, channel) for i, channel in enumerate(effects))
    among = tuple(channel for loss, _, channel in ranked if loss <= ranked[0][0] + AS_GOOD)
    fault = among[0]
    # The size from the relation that shows it best, whose noise alone the interval has.
    magnitude, sd = scan.amplitude[best] / effects[fault], scan.sd[best] / abs(effects[fault])
    shape_onsets = slice(0, onsets_s.size) if shape == "bias" else slice(onsets_s.size, None)
    near = onsets_s[scan.statistic[shape_onsets] >= scan.statistic[best] - CHI_SQUARE]
    return Finding(
        fault=fault,
        among=among,
        channels=(fault,),
        stage="static relations",
        shape=shape,
        magnitude=float(magnitude),
        sd=float(sd),
        unit=SHAPES[shape].magnitude_unit(unit_of(log, fault), slope=None),
        onset_s=onset_s,
        onset_ci95=(float(near[0]) - BLOCK_S, float(near[-1]) + BLOCK_S),
        statistic=float(scan.statistic[best]),
        threshold=THRESHOLD,
        effect={fault: float(abs(magnitude) * reach[best])},
        rivals={channel: abs(effects[fault] / effects[channel]) for channel in among[1:]},
        evidence={relation.series.relation.name: float(relation.scan.statistic[best]) for relation in scanned},
    )


def _limits(
    log: FlightLog, scanned: list[_Scanned], onsets_s: FloatArray, window: tuple[float, float]
) -> tuple[Hidden, ...]:
    """Return by channel and shape the largest changes that would not have been told, by their onsets.

    A relation excludes what moves one of its sides alone: where the others share a sensor with a channel, how far that
    channel is from what they make of it, and not its error. Of several relations that counts which leaves the least
    error at the worst of the onsets, of a drift of those in the first half of the window.
    """
    least: dict[tuple[str, str], tuple[float, Hidden]] = {}
    n = onsets_s.size
    half = max(1, n // 2)  # a drift that begins late in the window may be of nearly any size
    for relation in scanned:
        if not relation.series.relation.declares:
            continue
        for shape, every, counted in (("bias", slice(0, n), n), ("drift", slice(n, 2 * n), half)):
            sizes, reach = relation.hidden[every], relation.reach[every]
            if not np.isfinite(sizes[:counted]).all():
                continue
            for channel, effect in relation.effects.items():
                error = float((sizes * reach)[:counted].max()) / abs(effect)
                if (channel, shape) in least and error >= least[channel, shape][0]:
                    continue
                # A window holds too little of a drift that begins later.
                last = n if shape == "bias" else max(half, int(np.searchsorted(onsets_s, onsets_s[-1] - LATE_S)) + 1)
                hidden = sizes[:last] / abs(effect)
                least[channel, shape] = (
                    error,
                    Hidden(
                        fault=channel,
                        shape=shape,
                        channel=channel,
                        unit=SHAPES[shape].magnitude_unit(unit_of(log, channel), slope=None),
                        bounds=relation.series.relation.bounds(channel),
                        window=window,
                        onsets_s=onsets_s[:last],
                        sizes=hidden,
                        declared=hidden,
                        spreads=hidden,
                    ),
                )
    return tuple(hidden for _, hidden in least.values())
