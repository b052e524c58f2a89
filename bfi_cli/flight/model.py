"""The flight model of one log: measurements, loadings, and the noise that each level makes of them.

One linear Gaussian state-space model a second apart. Its states are motion, air, aircraft and instruments; every
recorded channel is a row (`tables.ROWS`), and a channel that the log lacks is a row that is missing. Rows are linear
about courses of smoothed channels (`tables.Coefficients`), so that a channel that errs can be replaced and the rows
made again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import (
    GAMMA,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_SPEED_OF_SOUND,
    G,
    channels_of,
    constant_wind,
    ground_speed_of,
    isa_temperature,
    pressure_at,
    speed_of_sound,
)
from ..kernels import BoolArray, FloatArray
from ..kernels.bounded_filter import Coupling, Transition
from ..kernels.runs import greatest_of_neighbours, median_of_neighbours, runs
from .seconds import Seconds, filled, rate_of, smoothed, spread, temperature_of
from .tables import AIRSPEED_ROWS, LEVELS, ROWS, STATES, Coefficients

# Share of the airspeed that nine tenths of a flight keep below, above which an aircraft flies: 1.3 stall speeds of an
# aircraft that cruises at 2.2 of them. Ground speed and height say so as well, so that a lost airspeed lands no
# aircraft.
FLYING, SHARE = 0.58, 0.9
SETTLED_S = 15.0  # half the stretch of which most must be flown
SHORTEST_FLIGHT_S = 60.0
# Bank beyond which lift, load and pitch are no linear functions of the states, rad.
STEEP = 1.2
# Rows with less of the flight are left out, for a level has to be told from it.
LEAST_RECORDED = 0.05
# Seconds of smoothing: of the airspeed about which rows are linear, of what is slow beside it, of the load.
AIRSPEED_S, SLOW_S, LOAD_S = 9, 61, 5
# What a channel may change by in a second of flight; beyond, a lag is no first-order one, m/s^2, m/s, rad/s.
FASTEST: Mapping[str, float] = {
    **dict.fromkeys(("tas", "cas", "mach"), 5.0),
    **dict.fromkeys(("velocity_north", "velocity_east", "ground_speed"), 15.0),
    "altitude": 60.0,
    "gps_altitude": 60.0,
    "altitude_rate": 20.0,
    "pitch": 0.3,
    "aoa": 0.3,
    "normal_acc": 20.0,
    "sat": 1.0,
}
LAG_S = 0.3  # of a channel by which the samples of one second are apart, beside what a lag's own state holds
# By how much a minute may be calmer or rougher than the flight's median; less than the calmest is rounding.
CALMEST, ROUGHEST, GUSTIEST = 0.7, 5.0, 40.0
GUSTS_S = 301
LEAST_GUST = 0.08  # m/s, about the rounding of an airspeed
# Acceleration, m/s^2, of an airspeed that is widened by what is recorded of it: half of what an aircraft can do.
MOST_ACCELERATION = 6.0
# Share of a rate of pitch, at most rad/s, that goes into what moves with it before the rows see it.
PITCHING, MOST_PITCHING = {"climb_rate": 0.5, "pitch": 0.5, "aoa": 0.3, "normal_acc": 0.3}, 0.2
# An airspeed's standard deviation by which a height rests on a static port in the lift, share of the port's own.
PORT = 0.01
BANKED = 0.15  # share of g times bank^2 by which the load errs, where bank and pitch are of another instant
# Time constant of a vertical speed indicator, s: an instantaneous one settles within 1 to 3 s, a plain one in 6 to 9.
VERTICAL_SPEED_S = 1.5
COARSEST_MACH = 0.6  # m/s of airspeed, standard deviation of its steps of 2 m/s beyond which it measures no airspeed
KNOB_PA = 5.0  # change of a recorded setting that is none of its rounding: a click is 34 or 100 Pa
START_SLOPE = (0.01, 0.25)  # rad per load factor, between which wings lie


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Share:
    """What a level makes of a variance: level^2 times (n,) `weight`, of a row where `is_row` and else of a state."""

    level: str
    is_row: bool
    index: int
    weight: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """What is taken from the flight as recorded, and kept when a channel of it is replaced.

    Attributes
    ----------
    wind : m/s to the north and to the east, constant, where a ground speed and a heading tell it, but no track.
    """

    middle_speed: float
    middle_load: float
    middle_height: float
    zero_lift: float
    lift_slope: float
    heading_offset: float
    wind: tuple[float, float]
    airborne: BoolArray
    shares: tuple[Share, ...]
    fixed_R: FloatArray
    fixed_Q: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightModel:
    """The flight model of a log.

    Attributes
    ----------
    seconds : that it is of; frame : what stays when channels are replaced.
    rows, states : names, in the order of the arrays.
    y : (n, n_rows) measurements, NaN where there are none and on the ground; Z : (n, n_rows, n_states) loadings.
    coefficients : about which it is linear.
    start : (n_states,) at take-off.
    knob : (n,) where a recorded setting of the altimeter changes.
    """

    seconds: Seconds
    frame: Frame
    rows: tuple[str, ...]
    states: tuple[str, ...]
    y: FloatArray
    Z: FloatArray
    coefficients: Coefficients
    start: FloatArray
    knob: BoolArray

    @property
    def n(self) -> int:
        return len(self.y)

    def row(self, name: str) -> int:
        return self.rows.index(name)

    def state(self, name: str) -> int:
        return self.states.index(name)

    @property
    def time_s(self) -> FloatArray:
        return self.seconds.time_s

    def second(self, at_s: float) -> int:
        """Return the first second that ends after a time."""
        return int(np.searchsorted(self.time_s, at_s - 0.5, side="right"))

    def transition(self) -> Transition:
        """Return the transition of the states within a second."""
        decay = np.array([np.exp(-1.0 / STATES[name].memory_s) for name in self.states])
        has, couplings = self.states.index, [("height", "climb", 1.0), ("climb", "climb_rate", 1.0)]
        if "shown_climb" in self.states:
            keeps = float(np.exp(-1.0 / VERTICAL_SPEED_S))
            decay[has("shown_climb")] = keeps
            couplings.append(("shown_climb", "climb", 1.0 - keeps))
        return Transition(
            decay=decay,
            couplings=tuple(Coupling(to=has(to), source=has(source), value=value) for to, source, value in couplings),
        )

    def noise(self, levels: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Return (n, n_rows) and (n, n_states) variances of the rows and of what moves the states, at some levels."""
        R, Q = self.frame.fixed_R.copy(), self.frame.fixed_Q.copy()
        for share in self.frame.shares:
            (R if share.is_row else Q)[:, share.index] += levels[share.level] ** 2 * share.weight
        return R, Q

    @property
    def levels(self) -> dict[str, float]:
        """The typical levels of those that it uses."""
        return {share.level: LEVELS[share.level].typical for share in self.frame.shares}

    def start_covariance(self) -> FloatArray:
        return np.diag([STATES[name].start ** 2 for name in self.states])

    def about_seconds(self, seconds: Seconds, part: slice) -> FlightModel:
        """Return the model of a part of the flight, of other seconds than recorded, linear about these."""
        return _model(seconds, replace(self.frame, airborne=self.frame.airborne[part]), self.rows)


def flight_model(seconds: Seconds, *, flown: BoolArray | None = None) -> FlightModel | None:
    """Return the flight model of a log; None where nothing of it flies, or too little is recorded.

    Parameters
    ----------
    flown : (n,) seconds of which it is known that they are flown; others may be.
    """
    frame = _frame(seconds, flown)
    if not frame.airborne.any():
        return None
    model = _model(seconds, frame)
    if len(model.rows) < 2:
        return None
    return replace(model, frame=_with_noise(model))


def _height(seconds: Seconds) -> FloatArray:
    """Return the pressure altitude without gaps."""
    if "altitude" in seconds.channels:
        return filled(seconds.channels["altitude"])
    air = seconds.air
    return filled(channels_of(air.p_static, air.q_impact, air.tat)["altitude"])


def _airborne(seconds: Seconds, fast: float, height: FloatArray) -> BoolArray:
    """Return where airspeed, ground speed or height says that the aircraft flies."""
    ground = ground_speed_of(seconds.channels)
    flies = filled(seconds.channels["tas"]) > FLYING * fast
    if ground is not None:
        flies |= filled(ground) > FLYING * fast
    low, high = np.quantile(height, (0.01, 1.0))
    flies |= height > low + 0.25 * (high - low) if high - low > fast else False
    flies = smoothed(flies.astype(np.float64), 2 * round(SETTLED_S) + 1) > 0.5
    for first, end in runs(flies):
        flies[first:end] = end - first >= SHORTEST_FLIGHT_S
    return flies


def _smooth_airspeed(seconds: Seconds, middle: float) -> FloatArray:
    speed = filled(seconds.channels["tas"])
    about = median_of_neighbours(speed, SLOW_S)
    return np.clip(smoothed(np.clip(speed, 0.8 * about, 1.25 * about), AIRSPEED_S), 0.5 * middle, 2.0 * middle)


def _frame(seconds: Seconds, flown: BoolArray | None) -> Frame:
    """Return what is taken from the flight once; its noise follows."""
    channels = seconds.channels
    speed, height = filled(channels["tas"]), _height(seconds)
    moving = speed[speed > 3.0]
    fast = float(np.quantile(moving, SHARE)) if moving.size else 1.0
    airborne = _airborne(seconds, fast, height)
    if flown is not None:
        airborne |= flown
    middle = max(float(np.median(speed[airborne])), 0.6 * fast) if airborne.any() else fast
    frame = Frame(
        middle_speed=middle,
        middle_load=1.0,
        middle_height=float(np.median(height)),
        zero_lift=0.0,
        lift_slope=0.06,
        heading_offset=0.0,
        wind=(0.0, 0.0),
        airborne=airborne,
        shares=(),
        fixed_R=np.empty(0),
        fixed_Q=np.empty(0),
    )
    if not airborne.any():
        return frame
    load = _load_over_pressure(seconds, _smooth_airspeed(seconds, middle))
    frame = replace(frame, middle_load=float(np.median(load[airborne])))
    zero_lift, slope = _start_of_lift(seconds, frame)
    offset, wind, ground = 0.0, (0.0, 0.0), channels.get("ground_speed")
    if "yaw" in channels and ground is not None:
        through_air = _smooth_airspeed(seconds, middle) * np.exp(1j * channels["yaw"])
        known = airborne & np.isfinite(ground) & np.isfinite(through_air)
        if known.any():
            # |V h + w| is a ground speed as |v - w| is an airspeed.
            north, east = constant_wind(through_air.real[known], through_air.imag[known], ground[known])
            wind = -north, -east
    if "yaw" in channels and "velocity_north" in channels:
        track = np.arctan2(channels["velocity_east"], channels["velocity_north"])
        turned = np.exp(1j * (track - channels["yaw"]))[airborne]
        turned = turned[np.isfinite(turned)]
        offset = float(np.angle(np.mean(turned))) if turned.size else 0.0
    return replace(frame, zero_lift=zero_lift, lift_slope=slope, heading_offset=offset, wind=wind)


def _bank(seconds: Seconds) -> FloatArray:
    roll = seconds.channels.get("roll")
    return np.zeros(seconds.time_s.size) if roll is None else np.clip(filled(roll), -1.4, 1.4)


def _lift(seconds: Seconds) -> FloatArray:
    """Return the load, m/s^2: recorded, or what climb and bank ask for."""
    if "normal_acc" in seconds.channels:
        return filled(seconds.channels["normal_acc"]) + G
    climb = smoothed(rate_of(_height(seconds), 1), LOAD_S)
    return (G + rate_of(climb, LOAD_S)) / np.maximum(np.cos(_bank(seconds)), 0.3)


def _load_over_pressure(seconds: Seconds, airspeed: FloatArray) -> FloatArray:
    """Return lift over dynamic pressure, up to a constant: load over the square of the equivalent airspeed."""
    density = pressure_at(np.clip(_height(seconds), -5000.0, 20000.0)) / _temperature(seconds)
    return np.asarray(_lift(seconds) / (density * airspeed**2))


def _standard_temperature(seconds: Seconds) -> FloatArray:
    return isa_temperature(np.clip(_height(seconds), -5000.0, 20000.0))


def _temperature(seconds: Seconds) -> FloatArray:
    """Return the static temperature without gaps, the standard atmosphere's where none is recorded."""
    standard, recorded = _standard_temperature(seconds), temperature_of(seconds)
    if recorded is None:
        return standard
    likely = np.where(np.abs(recorded - standard) < 60.0, recorded, np.nan)
    return filled(likely) if np.isfinite(likely).any() else standard


def _start_of_lift(seconds: Seconds, frame: Frame) -> tuple[float, float]:
    """Return angle of zero lift and slope of the lift, of a robust line through the flight."""
    channels = seconds.channels
    if not {"aoa", "pitch"} & channels.keys():
        return 0.0, frame.lift_slope
    airspeed = _smooth_airspeed(seconds, frame.middle_speed)
    x = np.clip(_load_over_pressure(seconds, airspeed) / frame.middle_load, -1.0, 4.0)
    climb = smoothed(rate_of(_height(seconds), 1), LOAD_S)
    angle = channels["aoa"] if "aoa" in channels else channels["pitch"] - climb / airspeed
    used = frame.airborne & np.isfinite(angle) & (np.abs(_bank(seconds)) < 0.5)
    if np.count_nonzero(used) < SHORTEST_FLIGHT_S:
        return 0.0, frame.lift_slope
    X, target, weight = np.column_stack([np.ones(x.size), smoothed(x, LOAD_S)])[used], angle[used], np.ones(used.sum())
    zero_lift, slope = 0.0, frame.lift_slope
    for _ in range(8):
        zero_lift, slope = np.linalg.lstsq(X * weight[:, None], target * weight, rcond=None)[0]
        error = target - X @ np.array([zero_lift, slope])
        sd = spread(error, np.ones(error.size, dtype=bool)) + 1e-9
        weight = 1.0 / np.sqrt(1.0 + (error / (2.0 * sd)) ** 2)
    return float(zero_lift), float(np.clip(slope, *START_SLOPE))


def _coefficients(seconds: Seconds, frame: Frame) -> Coefficients:
    channels, height = seconds.channels, _height(seconds)
    airspeed = _smooth_airspeed(seconds, frame.middle_speed)
    sound = speed_of_sound(_temperature(seconds))
    p_static = pressure_at(np.clip(height, -5000.0, 20000.0))
    mach = np.clip(airspeed / sound, 0.0, 0.99)
    q_impact = p_static * ((1.0 + 0.2 * mach**2) ** 3.5 - 1.0)
    cas = channels_of(p_static, q_impact, np.full(mach.shape, 288.15))["cas"]
    square = (cas / SEA_LEVEL_SPEED_OF_SOUND) ** 2  # q = p0 ((1 + square / 5)^3.5 - 1), and dq / dh = -rho g q / p
    by_cas = GAMMA * SEA_LEVEL_PRESSURE * cas / SEA_LEVEL_SPEED_OF_SOUND**2 * (1.0 + 0.2 * square) ** 2.5
    load = np.clip(_load_over_pressure(seconds, airspeed) / frame.middle_load, -1.0, 4.0)
    load = smoothed(load, LOAD_S)
    heading = steady = track = np.zeros(height.size)
    if "velocity_north" in channels:
        track = np.unwrap(filled(np.unwrap(_bridged_angle(channels["velocity_north"], channels["velocity_east"]))))
    if "yaw" in channels:
        heading = _bridged_angle(np.cos(channels["yaw"]), np.sin(channels["yaw"])) + frame.heading_offset
        if "velocity_north" not in channels:
            north, east = airspeed * np.cos(heading) + frame.wind[0], airspeed * np.sin(heading) + frame.wind[1]
            track = np.unwrap(np.arctan2(east, north))
        steady = track + smoothed(heading - track, SLOW_S)
    rates = {}
    for name in ROWS:
        values = _measurement(name, seconds)
        if values is not None and np.isfinite(values).any():
            rates[name] = np.clip(rate_of(filled(values)), -FASTEST[name], FASTEST[name])
    # Airspeed rows share one lag: that of the fastest, so that a faulty one brings none of its own.
    rates["tas"] = np.clip(rate_of(airspeed), -FASTEST["tas"], FASTEST["tas"])
    return Coefficients(
        airspeed=airspeed,
        slow_airspeed=smoothed(airspeed, SLOW_S),
        cas_share=cas / airspeed,
        cas_by_height=-GAMMA * G / speed_of_sound(_standard_temperature(seconds)) ** 2 * q_impact / by_cas,
        load_factor=load,
        lift_slope=frame.lift_slope,
        height=height,
        middle=frame.middle_height,
        heading=heading,
        steady_heading=steady,
        track=track,
        bank=_bank(seconds),
        cos_bank=np.cos(_bank(seconds)),
        position_m=(load - 1.0) * airspeed**2 / (2.0 * G),
        rates=rates,
    )


def _bridged_angle(cosine: FloatArray, sine: FloatArray) -> FloatArray:
    """Return the angle of two components without gaps and without jumps by a turn."""
    return np.unwrap(np.arctan2(filled(sine), filled(cosine, 1.0)))


def _measurement(row: str, seconds: Seconds) -> FloatArray | None:
    """Return what a row measures, (n,); None where the log has none of it."""
    channels = seconds.channels
    if row == "altitude":
        return channels["altitude"] if "altitude" in channels else _height(seconds)
    if row == "cas":
        return channels.get(second_airspeed(seconds))
    if row == "mach":
        return _mach_as_airspeed(seconds)
    if row in ("velocity_north", "velocity_east"):
        return channels.get(row) if "yaw" in channels else None
    if row == "ground_speed":
        # Along a track; with a heading beside it the velocity is weighed by its components.
        return ground_speed_of(seconds.channels) if ("yaw" in channels) != ("velocity_north" in channels) else None
    if row == "sat":
        temperature = temperature_of(seconds)
        return None if temperature is None else temperature - _standard_temperature(seconds)
    if row == "normal_acc" and row in channels:
        pitch = filled(channels["pitch"]) if "pitch" in channels else np.zeros(seconds.time_s.size)
        return np.asarray((channels[row] + G) * np.cos(_bank(seconds)) * np.cos(pitch) - G)
    return channels.get(row)


def second_airspeed(seconds: Seconds) -> str:
    """Return the name of the indicated airspeed that is recorded beside the true one, "" where there is none."""
    if seconds.record.airspeed != "tas":
        return ""
    return next((name for name in ("cas", "ias") if name in seconds.channels), "")


def _mach_as_airspeed(seconds: Seconds) -> FloatArray | None:
    """Return the airspeed of a recorded Mach number, m/s; None where its steps are too coarse."""
    if "mach" not in seconds.channels:
        return None
    sound = speed_of_sound(_temperature(seconds))
    if "mach" in seconds.rounding and float(np.median(seconds.rounding["mach"] * sound)) > COARSEST_MACH:
        return None
    return seconds.channels["mach"] * sound


def _model(seconds: Seconds, frame: Frame, rows: tuple[str, ...] = ()) -> FlightModel:
    """Return the model of seconds; its rows are those that are recorded for long enough where none are given."""
    c = _coefficients(seconds, frame)
    enough = {name: values for name in rows or ROWS if (values := _measurement(name, seconds)) is not None}
    if not rows:
        enough = {
            name: values
            for name, values in enough.items()
            if np.isfinite(values[frame.airborne]).mean() > LEAST_RECORDED
        }
    loads = {name: ROWS[name].loads(c) for name in enough}
    needed = {"height", "climb", "climb_rate", "airspeed"} | {name for loadings in loads.values() for name in loadings}
    states = tuple(name for name in STATES if name in needed)
    rows, n = tuple(enough), seconds.time_s.size
    y, Z = np.full((n, len(rows)), np.nan), np.zeros((n, len(rows), len(states)))
    steep = np.abs(c.bank) > STEEP
    for j, name in enumerate(rows):
        values = enough[name]
        if name in ("aoa", "pitch"):  # linear about the airspeed
            values = values + loads[name]["airspeed"] * c.airspeed
        if name in ("pitch", "normal_acc"):
            values = np.where(steep, np.nan, values)
        y[:, j] = np.where(frame.airborne, values, np.nan)
        for state, load in loads[name].items():
            Z[:, j, states.index(state)] = load
    knob = np.zeros(n, dtype=bool)
    if "baro_setting" in seconds.channels:
        knob[1:] = np.abs(np.diff(filled(seconds.channels["baro_setting"]))) > KNOB_PA
    start = np.zeros(len(states))
    first = int(np.flatnonzero(frame.airborne)[0])
    for name, value in (
        ("height", c.height[first]),
        ("airspeed", c.airspeed[first]),
        ("zero_lift", frame.zero_lift),
        ("lift_slope", frame.lift_slope),
    ):
        if name in states:
            start[states.index(name)] = value
    return FlightModel(
        seconds=seconds,
        frame=frame,
        rows=rows,
        states=states,
        y=y,
        Z=Z,
        coefficients=c,
        start=start,
        knob=knob,
    )


def _with_noise(model: FlightModel) -> Frame:
    """Return the frame with what every level makes of the variances, and what the record itself makes of them."""
    frame, c, n = model.frame, model.coefficients, model.n
    courses = {"": np.ones(n), **_widening(model)}
    fixed_R, fixed_Q, shares = np.zeros((n, len(model.rows))), np.zeros((n, len(model.states))), []
    for j, name in enumerate(model.rows):
        row = ROWS[name]
        shares.append(Share(level=row.level, is_row=True, index=j, weight=courses[row.widened] ** 2))
        moved = np.abs(c.rates[name])
        fixed_R[:, j] = (
            rounding_of(model, name) ** 2 + (LAG_S * np.minimum(moved, np.quantile(moved[frame.airborne], 0.95))) ** 2
        )
    for j, name in enumerate(model.states):
        state = STATES[name]
        weight = courses[state.widened] ** 2
        if state.level:
            kept = 1.0 if state.memory_s == np.inf else 1.0 - np.exp(-2.0 / state.memory_s)
            kept = 1.0 if name == "climb_rate" else kept  # a walk that forgets
            shares.append(Share(level=state.level, is_row=False, index=j, weight=kept * weight))
        if state.climb_level:
            climb = np.abs(rate_of(smoothed(c.height, LOAD_S), 1))
            shares.append(Share(level=state.climb_level, is_row=False, index=j, weight=climb * weight))
    rows, states = model.rows, model.states
    if "altitude" in rows:
        fixed_R[:, rows.index("altitude")] += (PORT * c.position_m) ** 2
    if "normal_acc" in rows:
        fixed_R[:, rows.index("normal_acc")] += (BANKED * G * np.minimum(c.bank**2, 1.0)) ** 2
    # What the aircraft does on purpose is seen in its channels, before the states may follow.
    acceleration = np.zeros(n)
    for name in ("tas", "cas"):
        if name in rows:
            acceleration = np.maximum(acceleration, np.abs(rate_of(filled(model.y[:, rows.index(name)]))))
    ground = ground_speed_of(model.seconds.channels)
    if ground is not None:
        acceleration = np.maximum(acceleration, np.abs(rate_of(filled(ground), LOAD_S)))
    acceleration = greatest_of_neighbours(np.minimum(acceleration, MOST_ACCELERATION), LOAD_S)
    fixed_Q[:, states.index("airspeed")] += acceleration**2
    if "pitch" in rows:
        pitching = np.abs(rate_of(filled(model.seconds.channels["pitch"])))
        pitching = greatest_of_neighbours(np.minimum(pitching, MOST_PITCHING), LOAD_S)
        for name, share in PITCHING.items():
            speed = c.airspeed if name in ("climb_rate", "normal_acc") else 1.0
            if name in states:
                fixed_Q[:, states.index(name)] += (share * pitching * speed) ** 2
            elif name in rows:
                fixed_R[:, rows.index(name)] += (share * pitching * speed) ** 2
    return replace(frame, shares=tuple(shares), fixed_R=fixed_R, fixed_Q=fixed_Q)


def rounding_of(model: FlightModel, row: str) -> FloatArray:
    """Return (n,) the standard deviation that the steps of its channel leave in a row, in its unit."""
    rounding, none = model.seconds.rounding, np.zeros(model.n)
    if row == "sat":
        return np.maximum(rounding.get("sat", none), rounding.get("tat", none))
    if row == "mach":
        return rounding.get("mach", none) * speed_of_sound(_temperature(model.seconds))
    recorded = {"cas": second_airspeed(model.seconds), "tas": model.seconds.record.airspeed}
    return rounding.get(recorded.get(row, row), none)


def _widening(model: FlightModel) -> dict[str, FloatArray]:
    """Return by how much levels are larger than in the median of the flight: with activity, gusts, turns."""
    channels, airborne, c = model.seconds.channels, model.frame.airborne, model.coefficients
    parts = []
    for name in ("normal_acc", "pitch"):
        if name in channels:
            values = filled(channels[name])
            moved = np.sqrt(np.maximum(smoothed((values - smoothed(values, LOAD_S)) ** 2, SLOW_S), 0.0))
            usual = float(np.median(moved[airborne]))
            if usual > 0.0:
                parts.append(np.log(np.clip(moved / usual, CALMEST, ROUGHEST)))
    activity = np.exp(np.mean(parts, axis=0)) if parts else np.ones(model.n)
    name = next((name for name in AIRSPEED_ROWS[::-1] if name in model.rows and name != "mach"), "tas")
    values = filled(channels[second_airspeed(model.seconds) if name == "cas" else "tas"])
    moved = median_of_neighbours(np.abs(values - smoothed(values, LOAD_S)), GUSTS_S)
    usual = max(float(np.median(moved[airborne])), LEAST_GUST, 0.003 * model.frame.middle_speed)
    gusts = np.maximum(np.clip(moved / usual, 1.0, GUSTIEST), activity)
    turns = np.sqrt(1.0 + 20.0 * np.minimum(np.abs(c.bank), 1.0))
    return {"activity": activity, "gusts": gusts, "turns": turns}
