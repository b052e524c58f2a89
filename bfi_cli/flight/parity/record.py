"""The channels of a log once a second, and the faults that its sensors and pressure lines may have."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...airdata import (
    DEPENDS_ON,
    HIGHEST,
    IMPACT_SOURCES,
    KINEMATICS,
    LOWEST,
    PRESSURES,
    SEA_LEVEL_PRESSURE,
    SONIC_RATIO,
    STATIC_SOURCES,
    AirData,
    air_data_of,
    altitude_of,
    channels_of,
    ground_velocity,
    isa_temperature,
    kinematic_acceleration,
)
from ...airdata.relations import State
from ...flightlog import FlightLog
from ...flightlog.derived import pressures_of
from ...kernels import FloatArray, IntArray
from ...kernels.runs import block_means, bridged
from .sampled import quanta_of

STEP_S = 1.0  # faults of interest last tens of seconds; a sample per second holds all that tells them
LONGEST_GAP_S = 3.0  # bridged by a straight line before an acceleration is integrated
STATIC_LEAK = "static_leak"
LINES = {"q_impact": "p_total", STATIC_LEAK: "p_static"}  # the pressure that a fault of a line changes
USED = (
    *("tas", "cas", "ias", "mach", "q_impact", "p_total", "p_static", "altitude", "tat", "sat", "aoa", "pitch", "roll"),
    *("normal_acc", "longitudinal_acc", "altitude_rate"),
    *("velocity_north", "velocity_east", "latitude", "longitude"),
    *("flaps", "gear"),  # what moves the lift at an angle of attack
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """The error of a channel by the steps in which it was recorded.

    The error of a signal that moves by a part d of a step has the correlation 1 - 6 d (1 - d) with what it was: that of
    a channel at rest stays, which looks like a fault where it moves on.

    Attributes
    ----------
    sd : (n,) standard deviation of the mean of a second, in the unit of the channel.
    moved : (n,) steps that it has travelled since the start.
    """

    sd: FloatArray
    moved: FloatArray

    def factor(self) -> FloatArray:
        """Return (n, n) L with covariance L L'."""
        keeps = np.exp(-6.0 * np.diff(self.moved, prepend=-np.inf))
        new = np.sqrt(1.0 - keeps**2)
        apart = np.maximum(self.moved[:, None] - self.moved, 0.0)
        return np.asarray(np.tril(np.exp(-6.0 * apart)) * new * self.sd[:, None])


@dataclass(frozen=True, kw_only=True, eq=False)  # without slots, so that it keeps its air data
class Record:
    """Samples a second apart.

    Attributes
    ----------
    time_s : (n,) middles of the seconds, on the log's axis.
    channels : (n,) means by standard name, NaN where less than half of a second was recorded.
    gained : (n,) integral of the kinematic acceleration, m/s, taken at the log's rate; None where the log has none.
    airspeed : the channel that the true airspeed comes from, itself ("tas") or another; "" where there is none.
    is_inertial : whether the rate of climb is one that no pressure moves.
    rounding : by channel, of those that were recorded in steps.
    """

    time_s: FloatArray
    channels: Mapping[str, FloatArray]
    gained: FloatArray | None
    airspeed: str
    is_inertial: bool = False
    rounding: Mapping[str, Rounding] = field(default_factory=dict)

    @cached_property
    def air(self) -> AirData:
        """The pressures and the temperature that the channels stand for."""
        return air_data_of(self.channels)

    @cached_property
    def made(self) -> Mapping[str, FloatArray]:
        """The channels that follow from these."""
        return channels_of(self.air.p_static, self.air.q_impact, self.air.tat)

    @property
    def state(self) -> State:
        """The channels with their rates, as relations take them: climb in metres as they are, the impact pressure."""
        values = {**self.channels}
        if values.keys() & {*STATIC_SOURCES} and values.keys() & {*IMPACT_SOURCES}:
            values["q_impact"] = np.where(self.air.q_impact > 0.0, self.air.q_impact, np.nan)
        if "altitude_rate" in values:
            values["altitude_rate"] = self.climb_rate
        values = {name: x for name, x in values.items() if name not in ("sat", "tat")}
        rates = {name: np.gradient(x, self.time_s) for name, x in values.items()} if len(self.time_s) > 1 else {}
        return State(values=values, rates=rates, time_s=self.time_s)

    @property
    def climb_rate(self) -> FloatArray:
        """(n,) m/s in metres as they are: a pressure altitude counts those of the standard atmosphere."""
        channels = self.channels
        if not ({"tat", "sat"} & channels.keys() and "altitude" in channels and channels.keys() & {*IMPACT_SOURCES}):
            return channels["altitude_rate"]
        return np.asarray(channels["altitude_rate"] * (self.air.sat / isa_temperature(channels["altitude"])))

    @cached_property
    def slopes(self) -> dict[tuple[str, float], Any]:
        """What small faults make of its residuals, by residual and angle of zero lift (`scan.Slopes`)."""
        return {}

    @cached_property
    def _small_faults(self) -> dict[Hypothesis, tuple[Record, frozenset[str]]]:
        return {}

    def between(self, from_s: float, to_s: float) -> Record:
        """Return the seconds of a window, with the air data of these where they are known already."""
        return self.taken(slice(*np.searchsorted(self.time_s, (from_s, to_s)).tolist()))

    def taken(self, rows: slice) -> Record:
        """Return some of the seconds, see `between`."""
        part = replace(
            self,
            time_s=self.time_s[rows],
            channels={name: values[rows] for name, values in self.channels.items()},
            gained=None if self.gained is None else self.gained[rows],
            rounding={name: Rounding(sd=x.sd[rows], moved=x.moved[rows]) for name, x in self.rounding.items()},
        )
        if "air" in vars(self):
            vars(part)["air"] = self.air.taken(rows)
        return part

    def with_small(self, hypothesis: Hypothesis) -> tuple[Record, frozenset[str]]:
        """Return the record with a small constant fault, for differences, made once, and the channels that it moves."""
        if hypothesis not in self._small_faults:
            other = with_fault(self, hypothesis.fault, np.full(self.time_s.shape, hypothesis.size))
            moved = {name for name, values in other.channels.items() if values is not self.channels[name]}
            self._small_faults[hypothesis] = other, frozenset(moved)
        return self._small_faults[hypothesis]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """A fault that may be there.

    Attributes
    ----------
    fault : the standard name of the channel that errs; "q_impact" for the line of the pitot tube, "static_leak" for
        that of the static port.
    unit : of the error that grows.
    size : of a small error, for differences, in `unit`.
    """

    fault: str
    unit: str
    size: float


HYPOTHESES = (
    Hypothesis(fault="q_impact", unit="1", size=1e-4),
    Hypothesis(fault=STATIC_LEAK, unit="Pa", size=0.1),
    Hypothesis(fault="tas", unit="m/s", size=1e-2),
    Hypothesis(fault="cas", unit="m/s", size=1e-2),
    Hypothesis(fault="ias", unit="m/s", size=1e-2),
    Hypothesis(fault="mach", unit="1", size=1e-5),
    Hypothesis(fault="p_total", unit="Pa", size=1.0),
    Hypothesis(fault="aoa", unit="rad", size=1e-5),
    Hypothesis(fault="pitch", unit="rad", size=1e-5),
    Hypothesis(fault="normal_acc", unit="m/s^2", size=1e-3),
    Hypothesis(fault="altitude_rate", unit="m/s", size=1e-3),
    Hypothesis(fault="longitudinal_acc", unit="m/s^2", size=1e-3),
    Hypothesis(fault="ground_speed", unit="m/s", size=1e-2),
)
UNITS = {hypothesis.fault: hypothesis.unit for hypothesis in HYPOTHESES}


def record_of(log: FlightLog) -> Record:
    """Return the channels of a log that the residuals need, once a second."""
    seconds, n = seconds_of_samples(log)
    expected = log.rate_hz * STEP_S
    values = {name: log.channels[name].values for name in USED if name in log.channels}
    if "altitude" in values:
        altitude = values["altitude"]
        values["altitude"] = np.where((altitude >= LOWEST) & (altitude <= HIGHEST), altitude, np.nan)
    if "altitude_rate" not in values and "altitude" in values:
        values["altitude_rate"] = np.gradient(values["altitude"], log.time_s)
    if "velocity_north" not in values and {"latitude", "longitude"} <= values.keys():
        north, east = ground_velocity(log.time_s, values["latitude"], values["longitude"])
        if "ground_speed" in log.channels:  # recorded: the positions tell its direction alone
            size = np.hypot(north, east)
            share = log.channels["ground_speed"].values / np.where(size > 0.0, size, np.nan)
            north, east = share * north, share * east
        values |= {"velocity_north": north, "velocity_east": east}
    channels = {name: over_seconds(samples, seconds, n, expected) for name, samples in values.items()}
    gained = None
    if set(KINEMATICS) <= values.keys():
        rate = kinematic_acceleration(*(values[name] for name in KINEMATICS))
        gained = over_seconds(_integral(rate, log.time_s), seconds, n, expected)
    airspeed = "tas" if "tas" in channels else ""
    if not airspeed and set(STATIC_SOURCES) & channels.keys() and set(IMPACT_SOURCES) & channels.keys():
        airspeed = next(name for name in IMPACT_SOURCES if name in channels)
        channels["tas"] = _true_airspeed(channels)
    time_s = float(log.time_s[0]) - _half(log) + STEP_S * (np.arange(n, dtype=np.float64) + 0.5)
    is_inertial = "altitude_rate" in log.channels and not pressures_of(log, "altitude_rate")
    return Record(
        time_s=time_s,
        channels=channels,
        gained=gained,
        airspeed=airspeed,
        is_inertial=is_inertial,
        rounding=roundings_of(log, [name for name in USED if name in log.channels], seconds, n),
    )


def roundings_of(log: FlightLog, names: Collection[str], seconds: IntArray, n: int) -> dict[str, Rounding]:
    """Return what the steps of channels leave of a mean over a second, of those that are recorded in steps."""
    roundings = {}
    for name, step in quanta_of(log, names).items():
        changes = np.abs(np.nan_to_num(np.diff(bridged(log.channels[name].values), prepend=np.nan))) / step
        # Between two changes of its reading it has moved on all the same.
        at = np.flatnonzero(changes > 0.0)
        travelled = np.interp(np.arange(changes.size), at, np.cumsum(changes)[at], left=0.0) if at.size else changes
        last = np.searchsorted(seconds, np.arange(n), side="right") - 1
        # Within a second a signal that crosses steps averages its error, at most over its samples.
        within = 6.0 * np.diff(travelled[last], prepend=0.0)
        counts = np.maximum(np.bincount(seconds, minlength=n), 1)
        shared = np.where(within > 1e-3, 2.0 * (within - 1.0 + np.exp(-within)) / np.maximum(within, 1e-3) ** 2, 1.0)
        sd = step / np.sqrt(12.0) * np.sqrt(np.maximum(shared, 1.0 / counts))
        roundings[name] = Rounding(sd=sd, moved=travelled[last])
    return roundings


def _true_airspeed(channels: Mapping[str, FloatArray]) -> FloatArray:
    air = air_data_of(channels)
    return channels_of(air.p_static, air.q_impact, air.tat)["tas"]


def _half(log: FlightLog) -> float:
    """Return how long before the first sample the first second begins: half a step, at most half a second."""
    return min(0.5 / log.rate_hz, 0.5 * STEP_S)


def seconds_of_samples(log: FlightLog) -> tuple[IntArray, int]:
    """Return the index of the second that each sample lies in, and how many seconds there are."""
    seconds = np.floor((log.time_s - log.time_s[0] + _half(log)) / STEP_S).astype(np.intp)
    return seconds, int(seconds[-1]) + 1


def over_seconds(values: FloatArray, seconds: IntArray, n: int, expected: float) -> FloatArray:
    """Return (n,) means of samples over seconds, NaN where less than half of the `expected` samples are finite."""
    return block_means(values, seconds, n, least=0.5 * expected)


def _integral(rate: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the integral of a rate; NaN in gaps that are too long to bridge."""
    known = np.isfinite(rate)
    if not known.any():
        return np.full(rate.shape, np.nan)
    rate = bridged(rate, time_s)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    before = np.maximum.accumulate(np.where(known, time_s, -np.inf))
    after = np.minimum.accumulate(np.where(known, time_s, np.inf)[::-1])[::-1]
    return np.where(after - before <= LONGEST_GAP_S, integral, np.nan)


def with_fault(record: Record, fault: str, amount: FloatArray) -> Record:
    """Return a record with a fault of `amount`, (n,), in the unit of its hypothesis.

    A fault of the pitot line changes the impact pressure by that part of it, and all that follows from it; where it
    leaves subsonic flight, these are NaN. A leak of the static line changes the static pressure, and the altitude's
    rate, unless that is inertial, by how fast it does.
    """
    channels = dict(record.channels)
    if fault in LINES:
        p_static, q_impact = record.air.p_static, record.air.q_impact
        if fault == "q_impact":
            q_impact = q_impact * np.maximum(1.0 + amount, 0.0)
        else:
            p_static, q_impact = p_static + amount, np.maximum(q_impact - amount, 0.0)
        # Beyond subsonic flight there is nothing that the channels could show.
        subsonic = (p_static > PRESSURES[0]) & (p_static < PRESSURES[1])
        subsonic &= q_impact <= SONIC_RATIO * np.minimum(p_static, SEA_LEVEL_PRESSURE)
        new = channels_of(np.where(subsonic, p_static, np.nan), np.where(subsonic, q_impact, np.nan), record.air.tat)
        for name, depends in DEPENDS_ON.items():
            if name in channels and name in new and LINES[fault] in depends:
                channels[name] = channels[name] + new[name] - record.made[name]
        if fault == STATIC_LEAK and "altitude_rate" in channels and not record.is_inertial:
            rate = np.gradient(new["altitude"] - record.made["altitude"], STEP_S)
            channels["altitude_rate"] = channels["altitude_rate"] + rate
    elif fault == "ground_speed":
        north, east = channels["velocity_north"], channels["velocity_east"]
        speed = np.hypot(north, east)
        share = 1.0 + amount / np.where(speed > 0.0, speed, np.nan)
        channels |= {"velocity_north": north * share, "velocity_east": east * share}
    else:
        channels[fault] = channels[fault] + amount
        if record.airspeed == fault != "tas":
            channels["tas"] = _true_airspeed({name: samples for name, samples in channels.items() if name != "tas"})
    return replace(record, channels=channels)


def climbing(record: Record, slope: float) -> Record:
    """Return a record whose static pressure, and nothing else yet, changes by `slope`, Pa/s: its altitude's rate."""
    if "altitude_rate" not in record.channels or record.is_inertial:
        return record
    p_static = record.air.p_static
    sizes = np.where(p_static + slope > PRESSURES[0], slope, np.nan)
    rate = altitude_of(p_static + sizes) - altitude_of(p_static)
    channels = {**record.channels, "altitude_rate": record.channels["altitude_rate"] + rate}
    return replace(record, channels=channels)


def without_fault(record: Record, fault: str, amount: FloatArray) -> Record:
    """Return a record as it was before a fault of `amount`, (n,), the inverse of `with_fault`."""
    if fault == "q_impact":
        left = np.where(amount > -1.0, 1.0 + amount, np.nan)  # of what is lost whole nothing is known
        return with_fault(record, fault, 1.0 / left - 1.0)
    return with_fault(record, fault, -amount)


def hypotheses(record: Record) -> tuple[Hypothesis, ...]:
    """Return the faults that a record could show.

    With a single channel of airspeed, a fault of the pitot line and one of the channel are the same: the channel's. An
    impact pressure is the line's own. Without a static pressure what a fault of the line makes of each channel is not
    known.
    """
    recorded = {name for name in record.channels if name != "tas" or record.airspeed == "tas"}
    airspeeds = recorded & set(IMPACT_SOURCES)
    possible = recorded - {"q_impact"}
    if (len(airspeeds) > 1 or airspeeds == {"q_impact"}) and recorded & set(STATIC_SOURCES):
        possible |= {"q_impact"}
    if airspeeds and recorded & set(STATIC_SOURCES) and "altitude_rate" in recorded:
        possible |= {STATIC_LEAK}
    if {"velocity_north", "velocity_east"} <= recorded:
        possible |= {"ground_speed"}
    return tuple(hypothesis for hypothesis in HYPOTHESES if hypothesis.fault in possible)
