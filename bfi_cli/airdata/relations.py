"""What the channels of a flight imply of each other: one row a relation, of which every analysis takes what it needs.

Plausibility takes the rows with a `tolerance` or a `least`, for errors that last throughout a flight; parity those with
a `name`, which an air-data computer keeps sample by sample, for errors that begin in it.

Tolerances are of the medians of pieces of a flight, in which gusts and manoeuvres have no part: of rounding and of the
recovery of a probe (1 % of what a temperature rises by, half a percent of the airspeed) within one air-data computer,
CS/FAR 25.1323(b) for an indicated airspeed, the coldest and hottest air of an altitude (35 K of the standard one), the
range of altimeter settings (950 to 1050 hPa), and the mounting of vanes and accelerometers (a degree, three degrees).
Those of `cas` by Mach number, of `q_impact` and of `aoa` had to be widened for flights that were recorded
(docs/theory.md, 15.9).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from .airspeed import (
    HIGHEST,
    LOWEST,
    PRESSURES,
    SEA_LEVEL_SPEED_OF_SOUND,
    FloatArray,
    G,
    altitude_of,
    calibrated_airspeed,
    impact_pressure_of_cas,
    impact_pressure_of_mach,
    isa_temperature,
    mach_number,
    pressure_at,
    speed_of_sound,
    static_temperature,
    total_temperature,
)
from .motion import EARTH_RADIUS, KINEMATICS, longitudinal_acceleration, normal_acceleration, vane_angle
from .system import COLDEST, HOTTEST, SENSORS

Values = Mapping[str, FloatArray]
Make = Callable[["State"], FloatArray]

# rad; a vane that flaps or a nose that points straight up is no flight that these relations know.
STEEPEST = 1.4
# DOMAIN [K, m/s, 1, m, Pa]: by channel, between which its equations hold, up to just below Mach 1.
DOMAIN: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys(("tat", "sat"), (COLDEST, HOTTEST)),
    **dict.fromkeys(("cas", "ias"), (0.0, SEA_LEVEL_SPEED_OF_SOUND)),
    "tas": (0.0, 400.0),
    "mach": (0.0, 1.0),
    "altitude": (LOWEST, HIGHEST),
    "p_static": (PRESSURES[0], PRESSURES[1]),
    "q_impact": (0.0, 90_000.0),
    "p_total": (PRESSURES[0], PRESSURES[1] + 90_000.0),
}
# What an airspeed is made of beside its own line.
AIR = frozenset(("p_static", "altitude", "tat", "sat"))
LINES = frozenset(("static port", "pitot line"))
# SUBSONIC [static pressure]: impact pressure of just below Mach 1, which has 0.893.
SUBSONIC = 0.89
# CS/FAR 25.1323(b), m/s: 5 kt of an indicated airspeed, of which a tenth in slow flight with flaps.
INDICATED = (2.6, 0.1)
DEGREE = np.pi / 180.0
AIRSPEED = "airspeed"  # whichever of them
# LEAST_CORRELATION: a quarter of it squared; with less, a channel says next to nothing of the others. Pieces of the
# two recorded Citations in which the channel should move by its tolerance have less in at most a seventh of the cases.
LEAST_CORRELATION = 0.5
# A scale that is off by more than this makes an error of half of what the channel shows. Those of both Citations lie
# within 0.75 and 1.25.
LARGEST_SCALE = 1.5
# rad, above that of zero lift: in cruise, of the six degrees that `parity.credibility` takes for typical.
TYPICAL_ANGLE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Channels once a second, in flight, with their rates, as they are or changed.

    Attributes
    ----------
    values : (n,) by standard name, in its SI unit, NaN where a second has none.
    rates : (n,) their derivatives, per second of the log's axis.
    time_s : (n,) on that axis.
    """

    values: Values
    rates: Values
    time_s: FloatArray

    def without(self, names: Collection[str]) -> State:
        """Return the rest without some channels."""
        values, rates = (
            {name: quantity for name, quantity in every.items() if name not in names}
            for every in (self.values, self.rates)
        )
        return replace(self, values=values, rates=rates)

    @property
    def zeros(self) -> FloatArray:
        """A channel that is 0 throughout."""
        return np.zeros_like(next(iter(self.values.values())))

    def of(self, name: str) -> FloatArray:
        """Return a channel, 0 where it is missing."""
        return self.values.get(name, self.zeros)

    def rate(self, name: str) -> FloatArray:
        """Return the rate of a channel, 0 where it is missing."""
        return self.rates.get(name, self.zeros)


@dataclass(frozen=True, slots=True, eq=False)
class Relation:
    """What a channel should read by others.

    Attributes
    ----------
    name : under which parity has it, of relations of one name the first that a log has; "" where no computer keeps it
        sample by sample.
    reading, expected : from the channels, (n,) what it reads and what it should.
    needs : the channels that it takes, the one that is read first; beside : those that it takes where they are known.
    tolerance, share : by which the medians of both may differ, in the channel's unit and of what is expected.
    least : standard deviation of what is expected in a piece, from which the reading should follow it; None where the
        level alone counts. `tolerance` is None where the motion alone does.
    has_scale : whether it follows one to one; timed : whether it takes the rate of a channel by the time axis.
    worth : what one unit of the reading counts in `unit`, in which parity has it.
    residual : of the parity scan that compares the same channels, "" where credibility makes nothing of how the reading
        moves through a flight, in parts of it.
    accuses : the channels that may be wrong where that fails, the likeliest first; confirms : those that are right
        where it holds; words : what it holds them against.
    """

    reading: Make
    expected: Make
    _: KW_ONLY
    name: str = ""
    needs: tuple[str, ...]
    beside: tuple[str, ...] = ()
    tolerance: float | None = None
    share: float = 0.0
    least: float | None = None
    has_scale: bool = True
    timed: bool = False
    worth: tuple[float, str] = (1.0, "")
    residual: str = ""
    accuses: tuple[str, ...] = ()
    confirms: tuple[str, ...] = ()
    words: str = ""

    @property
    def lasts(self) -> bool:
        """Whether it tells of errors that are there throughout a flight."""
        return self.tolerance is not None or self.least is not None

    def channels(self, known: Collection[str]) -> tuple[str, ...]:
        """Return the channels of the log that have a part in it."""
        return (*self.needs, *(name for name in self.beside if name in known))


def _within(values: FloatArray, low: float, high: float | FloatArray) -> FloatArray:
    """Return the values between two bounds, NaN beyond: no equation holds there."""
    return np.where((values >= low) & (values <= high), values, np.nan)


def _known(state: State, name: str) -> FloatArray:
    """Return a channel within its domain."""
    return _within(state.values[name], *DOMAIN[name])


def _pressure(state: State, name: str) -> FloatArray:
    return _known(state, name) if name == "p_static" else pressure_at(_within(state.values[name], LOWEST, HIGHEST))


def mach_by(state: State, name: str, static: str) -> FloatArray:
    """Return the Mach number of a calibrated airspeed at the pressure of another channel."""
    pressure = _pressure(state, static)
    impact = impact_pressure_of_cas(_known(state, name))
    return mach_number(_within(impact, 0.0, SUBSONIC * np.nan_to_num(pressure, nan=1.0)), pressure)


def standard_temperature(state: State, static: str) -> FloatArray:
    """Return the temperature of the standard atmosphere at the altitude or static pressure of a channel."""
    return isa_temperature(altitude_of(_pressure(state, static)))


def _tas_of(mach: FloatArray, state: State, heats: Sequence[str]) -> FloatArray:
    """Return the true airspeed at the mean of the readings of one temperature: their rounding is most of its noise."""
    mach = _within(mach, *DOMAIN["mach"])
    kelvin = [static_temperature(_known(state, name), mach) if name == "tat" else _known(state, name) for name in heats]
    return np.asarray(mach * speed_of_sound(sum(kelvin) / len(kelvin)))


def _true_airspeed(state: State, name: str, static: str) -> FloatArray:
    """Return the true airspeed of a calibrated one, in standard air where no temperature is recorded."""
    mach = mach_by(state, name, static)
    heat = next((channel for channel in ("sat", "tat") if channel in state.values), None)
    known = np.full(mach.shape, np.nan) if heat is None else _tas_of(mach, state, (heat,))
    standard = mach * speed_of_sound(standard_temperature(state, static))
    return np.where(np.isfinite(known), known, standard)


def _cas_of_mach(state: State, static: str) -> FloatArray:
    impact = impact_pressure_of_mach(_known(state, "mach"), _pressure(state, static))
    return calibrated_airspeed(_within(impact, *DOMAIN["q_impact"]))


def _standard_air(state: State) -> FloatArray:
    return isa_temperature(_known(state, "altitude"))


def _climb_rate(state: State, source: str) -> FloatArray:
    """Return the rate of climb in metres as they are, by the altitude or its recorded rate."""
    rate = state.rates["altitude"] if source == "altitude" else state.values["altitude_rate"]
    if "sat" not in state.values or "altitude" not in state.values:
        return rate
    warmth = _known(state, "sat") / _standard_air(state)
    return rate * np.where(np.isfinite(warmth), np.clip(warmth, 0.8, 1.2), 1.0)


def vane(state: State, source: str) -> FloatArray:
    """Return the angle of attack by attitude and climb, the altitude's or its recorded rate, in still air."""
    pitch, roll = (_within(state.of(name), -STEEPEST, STEEPEST) for name in ("pitch", "roll"))
    return vane_angle(_climb_rate(state, source), state.values["tas"], pitch, roll)


def _lift(state: State, name: str) -> FloatArray:
    """Return what the angle of attack follows, in its size: the lift over an impact pressure or a squared airspeed."""
    pressure = state.values[name] if name == "q_impact" else state.values[name] ** 2
    return TYPICAL_ANGLE * (state.of("normal_acc") + G) / G * np.nanmedian(pressure) / np.maximum(pressure, 1.0)


def load(state: State) -> FloatArray:
    """Return the normal acceleration by climb, bank and pitch."""
    ahead = state.values.get("longitudinal_acc")
    return normal_acceleration(state.rate("altitude_rate"), state.of("pitch"), state.of("roll"), ahead)


def _ground(state: State) -> FloatArray:
    return np.hypot(state.values["velocity_north"], state.values["velocity_east"])


def _moved(state: State) -> FloatArray:
    """Return the ground speed of the positions: that of a degree of latitude where it is, and of longitude there."""
    north = EARTH_RADIUS * state.rates["latitude"]
    return np.hypot(north, EARTH_RADIUS * np.cos(state.values["latitude"]) * state.rates["longitude"])


def _turning(state: State, name: str = "tas") -> FloatArray:
    """Return the rate of the heading in a coordinated turn."""
    roll, speed = _within(state.of("roll"), -STEEPEST, STEEPEST), np.abs(state.values[name])
    return G * np.tan(roll) / np.where(speed > 1.0, speed, np.nan)


def _heading_rate(state: State) -> FloatArray:
    if "yaw" in state.rates:
        return state.rates["yaw"]
    return _turning(state) if {"tas", "roll"} <= state.values.keys() else state.zeros


def _pitching(state: State) -> FloatArray:
    pitch, roll = state.of("pitch"), state.of("roll")
    return state.rates["pitch"] * np.cos(roll) + _heading_rate(state) * np.sin(roll) * np.cos(pitch)


def _rolling(state: State) -> FloatArray:
    return state.rates["roll"] - _heading_rate(state) * np.sin(state.of("pitch"))


def _yawing(state: State) -> FloatArray:
    return _turning(state) * np.cos(state.of("roll")) * np.cos(state.of("pitch"))


def _off_track(state: State) -> FloatArray:
    track = np.arctan2(state.values["velocity_east"], state.values["velocity_north"])
    return (state.values["yaw"] - track + np.pi) % (2.0 * np.pi) - np.pi


def _value(name: str) -> Make:
    return lambda state: state.values[name]


def _rate(name: str) -> Make:
    return lambda state: state.rates[name]


STATICS = ("altitude", "p_static")


def _true_airspeeds() -> Iterator[Relation]:
    """Yield what the true airspeed should be by the others and the temperature."""
    for heats in (("tat", "sat"), ("sat",), ("tat",)):

        def by_mach(state: State, heats: tuple[str, ...] = heats) -> FloatArray:
            return _tas_of(state.values["mach"], state, heats)

        tas = partial(Relation, _value("tas"), name="tas")
        lasts = len(heats) == 1  # of what lasts, both temperatures say no more than each
        yield tas(by_mach, needs=("tas", "mach", *heats), tolerance=0.5 if lasts else None, share=0.0075)
        for name, static in product(("cas", "ias"), STATICS):

            def by_pressure(
                state: State, name: str = name, static: str = static, heats: tuple[str, ...] = heats
            ) -> FloatArray:
                return _tas_of(mach_by(state, name, static), state, heats)

            tolerance, share = (0.5, 0.0075) if name == "cas" else INDICATED
            needs = ("tas", name, static, *heats)
            yield tas(by_pressure, needs=needs, tolerance=tolerance if lasts else None, share=share)


def _air_data() -> Iterator[Relation]:
    """Yield what pressures, temperatures and airspeeds of one air say of each other."""
    for static in STATICS:
        mach, cas_of_mach = partial(mach_by, name="cas", static=static), partial(_cas_of_mach, static=static)
        yield Relation(_value("mach"), mach, name="mach", needs=("mach", "cas", static), worth=(340.0, "m/s"))
        for name, tolerance, share in (("cas", 0.3, 0.001), ("ias", *INDICATED)):
            yield Relation(_value(name), cas_of_mach, needs=(name, "mach", static), tolerance=tolerance, share=share)
    yield Relation(
        _value("sat"),
        lambda s: static_temperature(_known(s, "tat"), _known(s, "mach")),
        name="sat",
        needs=("sat", "tat", "mach"),
    )
    yield Relation(
        _value("tat"),
        lambda s: total_temperature(_known(s, "sat"), _known(s, "mach")),
        needs=("tat", "sat", "mach"),
        tolerance=1.5,
    )
    for heat, limit in (("sat", 35.0), ("tat", 60.0)):  # K; up to Mach 0.7 the total temperature is 25 K more
        yield Relation(_value(heat), _standard_air, needs=(heat, "altitude"), tolerance=limit)
    yield Relation(
        _value("altitude"),
        lambda s: altitude_of(_known(s, "p_static")),
        name="altitude",
        needs=("altitude", "p_static"),
        tolerance=550.0,
    )
    for name in ("cas", "ias"):
        # The differential pressure of a flow sensor is no impact pressure before its tubes are corrected for: by 0.4.
        yield Relation(
            _value(name),
            lambda s: calibrated_airspeed(_known(s, "q_impact")),
            name="cas" if name == "cas" else "",
            needs=(name, "q_impact"),
            tolerance=2.6,
            share=0.4,
        )
    yield Relation(
        _value("p_total"),
        lambda s: s.values["p_static"] + s.values["q_impact"],
        name="p_total",
        needs=("p_total", "p_static", "q_impact"),
        tolerance=100.0,
    )
    tolerance, share = INDICATED
    indicated = partial(Relation, name="ias - cas", needs=("ias", "cas"))
    yield indicated(_value("ias"), _value("cas"), tolerance=tolerance, share=share)


def _attitude() -> Iterator[Relation]:
    """Yield what attitude, climb, vane and accelerations say of each other; a vane is mounted within a degree."""
    for source in ("altitude_rate", "altitude"):
        follows = ("aoa", "pitch", "altitude_rate")
        yield Relation(
            _value("aoa"),
            partial(vane, source=source),
            needs=("aoa", "pitch", "tas", source),
            beside=("roll",),
            tolerance=1.25 * DEGREE,
            least=1.5 * DEGREE,
            timed=source == "altitude",
            residual="climb" if source == "altitude_rate" else "",
            accuses=(*follows, AIRSPEED),
            confirms=follows,
            words="pitch minus flight path",
        )
    for name in ("cas", "tas", "q_impact"):
        yield Relation(
            _value("aoa"),
            partial(_lift, name=name),
            needs=("aoa", "normal_acc", name),
            least=0.7 * DEGREE,
            has_scale=False,
            residual="lift" if name == "q_impact" else "",
            accuses=("aoa", "normal_acc", AIRSPEED),
            confirms=("aoa", AIRSPEED),
            words="the lift per impact pressure",
        )
    accelerations = ("normal_acc", "altitude_rate")
    yield Relation(
        _value("normal_acc"),
        load,
        needs=("normal_acc", "pitch", "roll"),
        beside=("altitude_rate", "longitudinal_acc"),
        tolerance=0.6,
        least=0.4,
        residual="load",
        accuses=accelerations,
        confirms=accelerations,
        words="the climb and the bank",
    )
    ahead = ("longitudinal_acc", "pitch", AIRSPEED)
    yield Relation(
        _value("longitudinal_acc"),
        lambda s: longitudinal_acceleration(s.rates["tas"], *map(s.of, KINEMATICS[1:])),
        needs=("longitudinal_acc", "tas", "pitch"),
        beside=("aoa", "roll", "normal_acc"),
        tolerance=0.5,
        least=0.25,
        timed=True,
        residual="kinematics",
        accuses=ahead,
        confirms=ahead,
        words="the airspeed's rate and the pitch",
    )


def _rates() -> Iterator[Relation]:
    """Yield what rates say of the channels whose rates they are."""
    needs: tuple[str, ...] = ("altitude_rate", "altitude")
    yield Relation(_value(needs[0]), _rate("altitude"), needs=needs, tolerance=1.0, least=0.75, timed=True)
    needs = ("tas_rate", "tas")
    yield Relation(_value(needs[0]), _rate("tas"), needs=needs, tolerance=0.2, least=0.15, timed=True)
    angular = partial(Relation, tolerance=DEGREE, timed=True)
    beside: tuple[str, ...] = ("roll", "yaw", "tas")
    yield angular(_value("pitch_rate"), _pitching, needs=("pitch_rate", "pitch"), beside=beside, least=0.15 * DEGREE)
    yield angular(_value("roll_rate"), _rolling, needs=("roll_rate", "roll"), beside=("pitch",), least=0.3 * DEGREE)
    yield Relation(
        _value("yaw_rate"),
        _yawing,
        needs=("yaw_rate", "roll", "tas"),
        beside=("pitch",),
        tolerance=0.25 * DEGREE,
        share=0.25,
        least=0.3 * DEGREE,
    )
    yield Relation(
        _rate("yaw"),
        lambda s: s.values["yaw_rate"] / np.cos(s.of("roll")),
        needs=("yaw", "yaw_rate"),
        beside=("roll",),
        least=0.3 * DEGREE,
        timed=True,
    )


def _over_ground() -> Iterator[Relation]:
    """Yield what the motion over ground says of the airspeed, in any wind that is flown in, and of the heading."""
    north = ("velocity_north", "velocity_east")
    in_wind = partial(Relation, tolerance=15.0, share=0.35)
    speeds = ("ground_speed", AIRSPEED)
    by_ground = partial(in_wind, _ground, accuses=speeds, confirms=speeds, words="the airspeed in a steady wind")
    # At 11 km a true airspeed is 1.7 times the calibrated one: without a height none is made of it.
    airspeeds: list[tuple[tuple[str, ...], Make]] = [(("tas",), _value("tas"))]
    for name, static in product(("cas", "ias"), ("altitude", "p_static", "gps_altitude")):
        airspeeds.append(((name, static), partial(_true_airspeed, name=name, static=static)))
    for needs, airspeed in airspeeds:
        beside = () if needs == ("tas",) else ("sat", "tat")
        yield in_wind(_value("ground_speed"), airspeed, needs=("ground_speed", *needs), beside=beside)
        residual = "ground_speed" if needs == ("tas",) else ""
        yield by_ground(airspeed, needs=(*north, *needs), beside=beside, residual=residual)
    yield Relation(_value("ground_speed"), _ground, needs=("ground_speed", *north), tolerance=1.0, share=0.05)
    moved = partial(Relation, expected=_moved, tolerance=3.0, share=0.1, timed=True)
    yield moved(_value("ground_speed"), needs=("ground_speed", "latitude", "longitude"))
    yield moved(_ground, needs=(*north, "latitude", "longitude"))
    yield Relation(_off_track, lambda state: state.zeros, needs=("yaw", *north), tolerance=0.8)


RELATIONS = (*_true_airspeeds(), *_air_data(), *_attitude(), *_rates(), *_over_ground())


def relatives(rows: Sequence[Relation]) -> dict[str, tuple[str, ...]]:
    """Return by channel of the pressure lines those whose motion over seconds is its own, by relations of such rows.

    What else a relation takes, a static pressure or a temperature, hardly moves meanwhile. "+" stands for the integral
    of a rate.
    """
    groups: list[tuple[str, ...]] = []
    for row in rows:
        pair = row.needs if len(row.needs) == 2 else tuple(name for name in row.needs if name not in AIR)
        lines = {SENSORS.get(name, frozenset()) & LINES for name in pair}
        if len(pair) == 2 and len(lines) == 1 and any(lines) and (row.name or row.timed):
            pair = (f"+{pair[0]}", pair[1]) if row.timed else pair
            joined = [group for group in groups if {*pair} & {*group}]
            groups = [group for group in groups if group not in joined]
            groups.append(tuple(dict.fromkeys(name for group in (*joined, pair) for name in group)))
    return {
        name: tuple(other for other in group if other != name) for group in groups for name in group if name in SENSORS
    }


NAMES = tuple(dict.fromkeys(name for relation in RELATIONS for name in (*relation.needs, *relation.beside)))
