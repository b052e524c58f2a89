"""Channels that follow from each other sample by sample, and how their relations run through a flight.

A fault of a pressure or of the temperature moves every channel that is computed from it alike and leaves these
relations alone; an error of one channel (its computation, its transmission, its own sensor) breaks those that it
stands in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import combinations
from operator import itemgetter

import numpy as np

from ...airdata import SENSORS
from ...airdata import relations as table
from ...airdata.relations import AIR, DOMAIN, State, mach_by, standard_temperature
from ...airdata.relations import Relation as Row
from ...flightlog import FlightLog
from ...flightlog.phases import Phase, airborne
from ...kernels import FloatArray
from ...kernels.change_scan import ChangeScan, scan_changes
from ...quantities.channels import REPEATED, STANDARD, match_name, quantity_of
from .finding import Bound
from .sampled import Blocks, quanta_of, unit_of

Values = Mapping[str, FloatArray]

# s of which one mean of a relation is taken: what is sought lasts longer, and channels are tenths of a second apart.
BLOCK_S = 1.0
# RESTS, RESTING [quanta, 1]: largest move between blocks of a channel at rest, share of blocks at rest. Set
# on two recorded flights with altitudes in steps of 25 ft, which then make no change (docs/theory.md, 15.5).
RESTS, RESTING = 0.01, 0.25
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
SPEED, POSITION = 1, 5  # columns of the airspeed that is followed, of which the second next is the rate
# Channels of which `FOLLOWS` is made.
FOLLOWED = frozenset(("cas", "ias", "mach", "altitude", "p_static", "tas"))
# Headings turn by a whole round, which is no difference; altimeters have a knob each.
COMPARED = frozenset(REPEATED) - {"yaw", "baro_altitude"}
# LAPSE: temperature against that of the standard atmosphere. Air that changes breaks it: it only tells channels apart.
LAPSE = "lapse"


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


def _state(values: Values) -> State:
    return State(values=values, rates={}, time_s=np.empty(0))


def _relations(log: FlightLog) -> tuple[list[Balance], list[str]]:
    """Return the relations between the channels of a log, and what is missing for others."""
    sensors = _by_quantity(log)
    static = next((name for name in ("altitude", "p_static") if name in sensors), "altitude")
    heats = [name for name in ("tat", "sat") if name in sensors]
    rows: dict[str, Row] = {}
    for row in table.RELATIONS:
        if row.name and {*row.needs} <= sensors.keys():
            rows.setdefault(row.name, row)
    if len(heats) == 1 and {"tas", static} <= sensors.keys():
        air = partial(standard_temperature, static=static)
        rows[LAPSE] = Row(lambda state: state.values[heats[0]], air, name=LAPSE, needs=(heats[0], static))
    has = {*sensors, *(("altitude",) if static in sensors else ()), *(("tat or sat",) if heats else ())}
    if "mach" in has or ("altitude" in has and not has.isdisjoint(("cas", "ias"))):
        has.add("mach, or cas and altitude")
    missing = []
    for what, parts in (
        ("the computation of tas is not checked", ("tas", "tat or sat", "mach, or cas and altitude")),
        ("mach, cas and altitude are not compared", ("mach", "cas", "altitude")),
    ):
        if lacks := [part for part in parts if part not in has]:
            missing.append(f"{what}: the log lacks {', '.join(lacks)}")
    balances = [balance for row in rows.values() for balance in _balances(row, sensors)]
    return [*_second_sensors(log), *balances], missing


def _by_quantity(log: FlightLog) -> dict[str, list[str]]:
    """Return the channels that read each quantity of the relations, in its unit, the plain name first."""
    here = log.independent([name for name in log.channels if quantity_measured(name) in DOMAIN])
    sensors = {name: [name] for name in here if name in STANDARD and quantity_measured(name) == name}
    for name in sorted(here):
        quantity = quantity_measured(name)
        if name != quantity and (unit_of(log, name) or "1") == STANDARD[quantity].unit:
            sensors.setdefault(quantity, []).append(name)
    return sensors


def _balances(row: Row, sensors: Mapping[str, list[str]]) -> Iterator[Balance]:
    """Yield a row of the table for the first sensors of its quantities, for their second ones, and so on.

    Two air-data computers are thus each held against their own channels; a quantity that is measured less often gives
    its first sensor.
    """
    scale, unit = row.worth
    for k in range(max(len(sensors[quantity]) for quantity in row.needs)):
        chosen = {quantity: sensors[quantity][k if k < len(sensors[quantity]) else 0] for quantity in row.needs}

        def value(values: Values, chosen: Mapping[str, str] = chosen) -> FloatArray:
            return row.expected(_state({quantity: values[name] for quantity, name in chosen.items()}))

        channel, *others = chosen.values()
        yield Balance(
            name=row.name if k == 0 else f"{row.name}, sensor {k + 1}",
            unit=unit or STANDARD[row.needs[0]].unit,
            channel=channel,
            others=tuple(others),
            value=value,
            scale=scale,
            declares=row.name != LAPSE,
        )


def _second_sensors(log: FlightLog) -> list[Balance]:
    """Return the differences of channels that measure the same quantity: tas and tas_2, of two air-data computers."""
    sensors: dict[str, list[str]] = {}
    for name in log.channels:
        if (quantity := quantity_measured(name)) in COMPARED:
            sensors.setdefault(quantity, []).append(name)
    pairs = []
    for quantity, names in sensors.items():
        for first, other in combinations(names, 2):
            unit = unit_of(log, first)
            if unit == unit_of(log, other):
                unit = unit if unit in WORTH else STANDARD[quantity].unit
                pairs.append(Balance(f"{first} - {other}", unit, first, (other,), itemgetter(other), twins=True))
    return pairs


def quantity_measured(channel: str) -> str:
    """Return the standard name of what a channel measures, of a second sensor too; its own name where it has none."""
    match = match_name(channel)
    return channel if match is None else quantity_of(match.name)


@cache
def _sensors(channel: str) -> frozenset[str]:
    """Return the sensors of a channel; a second one of a quantity may have those of the first."""
    quantity = quantity_measured(channel)
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
    speeds : by channel, (n,) what one unit of its error adds to the airspeed that the relation may follow.
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
    speeds: Mapping[str, FloatArray] = field(default_factory=dict)
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
            speeds={name: effect[inside] for name, effect in self.speeds.items()},
            readings={name: reading[inside] for name, reading in self.readings.items()},
        )

    def without(self, channel: str, error: FloatArray) -> RelationSeries:
        """Return a relation that follows the airspeed as it was before an error of a channel, (n,)."""
        nuisances, change = self.nuisances.copy(), self.speeds[channel] * error
        speed = nuisances[:, SPEED] - change
        if nuisances.shape[1] > POSITION:
            nuisances[:, POSITION] *= nuisances[:, SPEED] / speed
        nuisances[:, SPEED] = speed
        nuisances[:, SPEED + 2] -= np.gradient(change, self.time_s)
        return replace(self, nuisances=nuisances)

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
        low, high = DOMAIN.get(quantity_measured(name), (-np.inf, np.inf))
        x = blocks.mean(log.channels[name].values[flies])
        values[name] = np.where((x >= low) & (x <= high), x, np.nan)
    followed = {quantity: values[name] for quantity, name in main.items()}
    follows = _follows(followed, blocks.time_s)
    speeds = {
        name: _difference(lambda changed: _speed(changed, blocks.time_s.size), followed, quantity)
        for quantity, name in main.items()
    }
    quanta, series = quanta_of(log, names), []
    resting = {name: step for name, step in quanta.items() if _rests(values[name], step)}
    # A temperature changes on its own; the steps of the others change with the flight that a relation may follow.
    resting |= {name: AVERAGED * step for name, step in resting.items() if quantity_measured(name) in ("tat", "sat")}
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
        if "ias" in map(quantity_measured, relation.needs) and not relation.twins:
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
                speeds={name: effect[kept] for name, effect in speeds.items() if name in effects and effect.any()},
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
    height, speed = values.get("altitude", none), _speed(values, len(time_s))
    rates = (np.gradient(x, time_s) if len(time_s) > 1 else none for x in (speed, height))
    return np.column_stack([np.ones(len(time_s)), speed, height, *rates])


def _speed(values: Values, n: int) -> FloatArray:
    """Return (n,) an airspeed that relations follow, 340 m/s times the Mach number where that is known."""
    # Not tas where there is another: a relation that follows its steps has lost its own noise.
    if "altitude" in values and ("cas" in values or ("ias" in values and "mach" not in values)):
        return np.asarray(340.0 * mach_by(_state(values), "cas" if "cas" in values else "ias", "altitude"))
    return 340.0 * values["mach"] if "mach" in values else values.get("tas", np.zeros(n))


def _with_position_error(follows: FloatArray) -> FloatArray:
    """Return (n, 6) `_follows`, and what a static pressure that errs with the coefficient of lift makes of airspeed."""
    typical = max(float(np.median(follows[:, 1])), 1e-9)
    return np.column_stack([follows, typical**2 / np.maximum(follows[:, 1], SLOWEST * typical)])


def _effect(relation: Balance, values: Values, name: str) -> FloatArray:
    """Return what one unit of a channel's error adds to a relation."""
    return _difference(relation.of, values, name)


def _difference(function: Callable[[Values], FloatArray], values: Values, name: str) -> FloatArray:
    """Return what one unit of a channel adds to what is made of it, by a difference."""
    known = np.abs(values[name][np.isfinite(values[name])])
    size = 1e-4 * max(float(np.median(known)) if known.size else 0.0, 1e-6)
    # Downwards, away from Mach 1, where there is room.
    step = np.where(values[name] > 2.0 * size, -size, size)
    return np.asarray((function({**values, name: values[name] + step}) - function(values)) / step)


def beside_line(x: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return (n, ...) what is left of signals beside the straight line over times (n,) that fits each best."""
    line = np.column_stack([np.ones(time_s.size), time_s - time_s.mean()])
    return np.asarray(x - line @ np.linalg.lstsq(line, x, rcond=None)[0])


def _noise_about_lines(x: FloatArray, time_s: FloatArray) -> float:
    """Return the median standard deviation about a line of pieces of a relation."""
    edges = np.flatnonzero(np.diff(np.floor((time_s - time_s[0]) / PIECE_S)) > 0) + 1
    sds = []
    for piece, at in zip(np.split(x, edges), np.split(time_s, edges), strict=True):
        if len(piece) >= 0.5 * PIECE_S / BLOCK_S and len(piece) > 2:
            rest = beside_line(piece, at)
            sds.append(float(np.sqrt(rest @ rest / (len(piece) - 2))))
    return float(np.median(sds)) if sds else 0.0
