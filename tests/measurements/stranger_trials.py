"""What recorders as they are found make of strangers' flights, and what `bfi diagnose` says of these.

A flight (`stranger_flights`) is sensed by two pressure lines and a temperature, an air-data computer makes airspeeds
and altitude of them, and a recorder samples each column with a rate, lag, noise and step of its own. Faults act where
they would: on a line before the computer, on a channel before the recorder. The log is written and read again.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy import signal
from stranger_flights import RATE_HZ, flown
from threadpoolctl import threadpool_limits
from whole_flight_trials import NEAR_S, said_of

from bfi_cli.airdata import G, channels_of
from bfi_cli.errors import BfiError
from bfi_cli.flight.result import DiagnoseResult, Event
from bfi_cli.flightlog import read_log
from bfi_cli.library import diagnose
from bfi_cli.quantities.channels import FOOT

FloatArray, BoolArray = NDArray[np.float64], NDArray[np.bool_]
Signals = dict[str, FloatArray]
Line = Callable[[Signals, BoolArray], Signals]

# None of them shaped a constant: causes were sought on the first half, and the second half reports.
CAUSES = ("c182", "J3Cub", "T37", "A320")
REPORT = ("OV10", "DHC6", "B747", "MD11")
KNOT, DEGREE, INHG = 1852.0 / 3600.0, np.pi / 180.0, 3386.389
QNH_S = (200.0, 520.0)  # when the altimeter is set


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a log: `value = scale x signal + offset`, by the step of its unit.

    Attributes
    ----------
    header : name and unit as the recorder writes them; source : signal that it records.
    noise, slow : standard deviations of white noise and of an error of a minute, SI.
    lag_s : of a first-order sensor; late_s : by which it is stored late; rate_hz, None for that of the recorder.
    """

    header: str
    source: str
    scale: float = 1.0
    offset: float = 0.0
    step: float = 0.0
    noise: float = 0.0
    slow: float = 0.0
    lag_s: float = 0.0
    late_s: float = 0.0
    rate_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """A recorder: columns, rate, and what it does to them.

    Attributes
    ----------
    edge_hz : of a low-pass filter of order 4 before it samples, None for none.
    missing : share of the samples that are lost, half of them in bursts; jitter_s : of its clock.
    holds : whether a column of a lower rate repeats its value, and is empty in between otherwise.
    pitot : by which the impact pressure is wrong throughout, as a share; aoa_zero : of the vane, rad.
    """

    columns: tuple[Column, ...]
    rate_hz: float = 1.0
    edge_hz: float | None = None
    missing: float = 0.0
    jitter_s: float = 0.0
    holds: bool = True
    pitot: float = 0.0
    aoa_zero: float = 0.0
    parameters: bool = False


def _speeds(step: float, *names: str, **more: float) -> tuple[Column, ...]:
    """Return airspeeds and ground speed in knots."""
    return tuple(Column(header=f"{name} [kt]", source=name, scale=1 / KNOT, step=step, **more) for name in names)


_ATTITUDES = tuple(
    Column(header=f"{name} [deg]", source=name, scale=1 / DEGREE, step=0.1, noise=1e-3, slow=5e-3)
    for name in ("pitch", "roll")
)
_EFIS = (
    *_speeds(0.1, "ias", "tas", noise=0.1),
    *_speeds(0.1, "ground_speed", noise=0.05, late_s=0.4),
    Column(header="track [deg]", source="track", scale=1 / DEGREE, step=0.1, noise=2e-3, late_s=0.4),
    Column(header="baro_altitude [ft]", source="baro_altitude", scale=1 / FOOT, step=1.0, noise=0.2),
    Column(header="baro_setting [inHg]", source="baro_setting", scale=1 / INHG, step=0.01),
    Column(header="gps_altitude [ft]", source="gps_altitude", scale=1 / FOOT, step=1.0, noise=0.3, slow=2.0),
    Column(header="vertical_speed [ft/min]", source="altitude_rate", scale=60 / FOOT, step=1.0, noise=0.05, lag_s=1.5),
    *_ATTITUDES,
    Column(header="yaw [deg]", source="yaw", scale=1 / DEGREE, step=0.1, noise=2e-3, slow=1e-2),
    Column(header="normal_acc [g]", source="normal_acc", scale=1 / G, step=0.01, noise=0.05),
    Column(header="oat [degC]", source="sat", offset=-273.15, step=0.5, noise=0.1, lag_s=10.0),
)
_STEAM = (
    *_speeds(1.0, "ias", noise=0.2),
    Column(header="altitude [ft]", source="altitude", scale=1 / FOOT, step=10.0, noise=0.5),
    *_speeds(1.0, "ground_speed", noise=0.1, late_s=0.8),
    Column(header="track [deg]", source="track", scale=1 / DEGREE, step=1.0, noise=5e-3, late_s=0.8),
    Column(header="gps_altitude [ft]", source="gps_altitude", scale=1 / FOOT, step=1.0, noise=0.5, slow=3.0),
    Column(header="oat [degC]", source="sat", offset=-273.15, step=1.0, lag_s=20.0),
)
_QAR = (
    *_speeds(1.0, "ground_speed", rate_hz=1.0, noise=0.05, late_s=0.2),
    Column(header="Airspeed [kt]", source="cas", scale=1 / KNOT, step=0.25, noise=0.1, rate_hz=4.0),
    Column(header="Airspeed True [kt]", source="tas", scale=1 / KNOT, step=1.0, noise=0.1, rate_hz=1.0, late_s=0.3),
    Column(header="Mach []", source="mach", step=0.001, noise=1e-4, rate_hz=1.0, late_s=0.2),
    Column(header="Altitude STD [ft]", source="altitude", scale=1 / FOOT, step=4.0, noise=0.3, rate_hz=1.0),
    Column(
        header="Vertical Speed [ft/min]", source="altitude_rate", scale=60 / FOOT, step=16.0, rate_hz=2.0, noise=0.05
    ),
    Column(header="Pitch [deg]", source="pitch", scale=1 / DEGREE, step=1.0, noise=5e-4, rate_hz=4.0),
    Column(header="Roll [deg]", source="roll", scale=1 / DEGREE, step=1.0, noise=5e-4, rate_hz=2.0),
    Column(header="Heading True [deg]", source="yaw", scale=1 / DEGREE, step=1.0, noise=2e-3, rate_hz=1.0),
    Column(header="Acceleration Normal [g]", source="load_factor", step=0.004, noise=0.02 / G, rate_hz=8.0),
    Column(
        header="Acceleration Longitudinal [g]",
        source="longitudinal_acc",
        scale=1 / G,
        step=0.002,
        noise=0.02,
        rate_hz=4.0,
    ),
    Column(header="TAT [degC]", source="tat", offset=-273.15, step=0.25, noise=0.05, lag_s=3.0, rate_hz=0.25),
    Column(header="AOA [deg]", source="aoa", scale=1 / DEGREE, step=0.35, noise=2e-3, rate_hz=2.0),
    Column(header="Flap [deg]", source="flaps", scale=30.0, step=1.0, rate_hz=0.5),
    Column(header="Elevator [deg]", source="elevator", scale=1 / DEGREE, step=0.1, noise=5e-4, rate_hz=4.0),
)
_TESTED = (
    *(
        Column(header=f"{name} [m/s]", source=name, noise=0.05, late_s=late)
        for name, late in (("tas", 0.15), ("cas", 0.0))
    ),
    *(
        Column(header=f"{name} [m/s]", source=name, noise=0.03, late_s=0.3)
        for name in ("velocity_north", "velocity_east")
    ),
    Column(header="mach [1]", source="mach", noise=2e-4, late_s=0.15),
    Column(header="altitude [m]", source="altitude", noise=0.3),
    Column(header="gps_altitude [m]", source="gps_altitude", noise=0.1, slow=1.0, late_s=0.3),
    *(Column(header=f"{name} [Pa]", source=name, noise=3.0) for name in ("p_static", "p_total")),
    *(Column(header=f"{name} [K]", source=name, noise=0.03, lag_s=1.0) for name in ("tat", "sat")),
    *(Column(header=f"{name} [rad]", source=name, noise=1e-3, late_s=0.05) for name in ("aoa", "sideslip")),
    *(
        Column(header=f"{name} [rad]", source=name, noise=2e-4, slow=1e-3, late_s=0.1)
        for name in ("pitch", "roll", "yaw")
    ),
    *(Column(header=f"{name} [rad/s]", source=name, noise=1e-3) for name in ("roll_rate", "pitch_rate", "yaw_rate")),
    *(
        Column(header=f"{name}_acc [m/s^2]", source=f"{name}_acc", noise=0.05)
        for name in ("normal", "longitudinal", "lateral")
    ),
    *(Column(header=f"{name} [rad]", source=name, noise=1e-4) for name in ("elevator",)),
)
_PX4 = (
    *(Column(header=f"{name} [m/s]", source=name, noise=0.2) for name in ("ias", "tas")),
    Column(header="altitude [m]", source="altitude", noise=0.4),
    *(
        Column(header=f"{name} [m/s]", source=name, noise=0.1, rate_hz=5.0, late_s=0.12)
        for name in ("velocity_north", "velocity_east")
    ),
    Column(header="gps_altitude [m]", source="gps_altitude", noise=0.2, slow=2.0, rate_hz=5.0, late_s=0.12),
    *(Column(header=f"{name} [rad]", source=name, noise=1e-3, slow=8e-3) for name in ("pitch", "roll", "yaw")),
    *(Column(header=f"{name} [rad/s]", source=name, noise=5e-3) for name in ("roll_rate", "pitch_rate", "yaw_rate")),
    *(
        Column(header=f"{name}_acc [m/s^2]", source=f"{name}_acc", noise=0.3)
        for name in ("normal", "longitudinal", "lateral")
    ),
)
_GLIDER = (
    *(Column(header=f"{name} [km/h]", source=name, scale=3.6, step=1.0, noise=0.15) for name in ("ias", "tas")),
    Column(header="gps_altitude [m]", source="gps_altitude", step=1.0, noise=0.4, slow=2.0),
    Column(header="ground_speed [km/h]", source="ground_speed", scale=3.6, step=1.0, noise=0.1, late_s=0.5),
    Column(header="track [deg]", source="track", scale=1 / DEGREE, step=1.0, noise=5e-3, late_s=0.5),
)
_COARSE = (
    *_speeds(1.0, "cas", noise=0.1),
    Column(header="mach [1]", source="mach", step=0.01),
    Column(header="altitude [ft]", source="altitude", scale=1 / FOOT, step=100.0, rate_hz=0.25),
    *_speeds(1.0, "ground_speed", noise=0.1),
    *(
        Column(header=f"{name} [deg]", source=name, scale=1 / DEGREE, step=1.0, slow=3e-3)
        for name in ("pitch", "roll", "yaw")
    ),
    Column(header="normal_acc [g]", source="normal_acc", scale=1 / G, step=0.1),
    Column(header="tat [degC]", source="tat", offset=-273.15, step=1.0, lag_s=3.0),
)
RECORDERS: Mapping[str, Recorder] = {
    "efis": Recorder(columns=_EFIS),
    "steam": Recorder(columns=_STEAM),
    "qar": Recorder(columns=_QAR, rate_hz=8.0, parameters=True),
    "tested": Recorder(columns=_TESTED, rate_hz=25.0, edge_hz=2.0),
    "px4": Recorder(columns=_PX4, rate_hz=10.0),
    "glider": Recorder(columns=_GLIDER),
    "missing": Recorder(columns=_EFIS, missing=0.1),
    "jitter": Recorder(columns=_EFIS, rate_hz=4.0, jitter_s=0.04),
    "coarse": Recorder(columns=_COARSE),
    "pitot_error": Recorder(columns=_EFIS, rate_hz=2.0, pitot=0.06),
    "aoa_zero": Recorder(columns=_TESTED, rate_hz=12.5, edge_hz=3.0, aoa_zero=0.05),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """A fault that was made: its name for the program, when it begins and ends, and its size."""

    fault: str
    onset_s: float
    offset_s: float | None = None
    magnitude: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A flight of a stranger through a recorder, healthy for no fault."""

    aircraft: str
    recorder: str
    seed: int = 0
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What was said of a trial; `refused` in place of it where the log could not be analysed."""

    trial: Trial
    truth: Truth | None = None
    result: DiagnoseResult | None = None
    refused: str = ""
    warned: tuple[str, ...] = field(default=())

    @property
    def declared(self) -> tuple[Event, ...]:
        """The events beyond tolerance that are declared."""
        return self._events("declared")

    @property
    def suspected(self) -> tuple[Event, ...]:
        return self._events("suspected")

    def _events(self, state: str) -> tuple[Event, ...]:
        events = () if self.result is None else self.result.events
        return tuple(event for event in events if event.state == state and event.beyond_tolerance is not False)

    @property
    def named(self) -> Literal["named", "suspected", "wrong name", "nothing"]:
        """What was said of the fault of the trial."""
        truth = self.truth
        assert truth is not None
        same = {"cas": ("cas", "ias"), "ias": ("ias", "cas")}.get(truth.fault, (truth.fault,))
        events = (*self.declared, *self.suspected)
        right = [event for event in events if {*same} & {*event.among} and _begins(event, truth.onset_s)]
        if right:
            return "named" if right[0].state == "declared" else "suspected"
        until_s = np.inf if truth.offset_s is None else truth.offset_s
        during = any(truth.onset_s - NEAR_S <= event.onset_s <= until_s + NEAR_S for event in self.declared)
        return "wrong name" if during else "nothing"

    @property
    def in_words(self) -> str:
        """What was said in a line."""
        if self.result is None:
            return self.refused
        ordinary = [(event.cause, round(event.from_s), event.looks_like) for event in self.result.ordinary]
        return f"{said_of(self.result)} {ordinary} {' '.join(self.warned)}"


def _begins(event: Event, onset_s: float) -> bool:
    low, high = event.onset_ci95
    return abs(event.onset_s - onset_s) <= NEAR_S or low <= onset_s <= high


@cache
def journey(aircraft: str, seed: int, folder: Path) -> Mapping[str, FloatArray] | str:
    """Return the truth of a flight, or why there is none."""
    return flown(aircraft, seed, folder)


def sensed(truth: Mapping[str, FloatArray], recorder: Recorder) -> Signals:
    """Return the signals of healthy sensors, with the constant errors of the recorder's aircraft."""
    made = {name: np.array(values, dtype=np.float64) for name, values in truth.items() if len(values) > 1}
    mach = np.maximum(made["mach"], 1e-4)
    made["q_impact"] = made["p_static"] * ((1.0 + 0.2 * mach**2) ** 3.5 - 1.0) * (1.0 + recorder.pitot)
    made["tat"] = made["sat"] * (1.0 + 0.2 * mach**2)
    made["aoa"] = made["aoa"] + recorder.aoa_zero
    made["ground_speed"] = np.hypot(made["velocity_north"], made["velocity_east"])
    made["track"] = np.unwrap(np.arctan2(made["velocity_east"], made["velocity_north"]))
    made["yaw"] = np.unwrap(made["yaw"])
    made["load_factor"] = (made["normal_acc"] + G) / G
    return made


def computed(made: Signals, rng: np.random.Generator) -> Signals:
    """Return the signals with what an air-data computer makes of its lines and its temperature."""
    air = channels_of(made["p_static"], np.maximum(made["q_impact"], 0.0), made["tat"])
    made = {**made, **{name: air[name] for name in ("altitude", "cas", "tas", "mach", "sat")}, "ias": air["cas"]}
    made["p_total"] = made["p_static"] + made["q_impact"]
    rate = np.gradient(made["altitude"]) * RATE_HZ
    made["altitude_rate"] = signal.lfilter([1 - 0.9], [1, -0.9], rate, zi=[0.9 * rate[0]])[0]
    time_s = np.arange(rate.size) / RATE_HZ
    clicks = np.cumsum(rng.integers(-8, 9, 2)) * 0.01
    inches = 29.92 + clicks[0] * (time_s > QNH_S[0]) + (clicks[1] - clicks[0]) * (time_s > QNH_S[1])
    made["baro_setting"] = inches * INHG
    made["baro_altitude"] = made["altitude"] + 27.3 * FOOT * (inches - 29.92) / 0.03
    return made


def recorded(made: Signals, recorder: Recorder, path: Path, rng: np.random.Generator) -> Path:
    """Write what a recorder makes of the signals."""
    n = len(made["tas"])
    time_s = np.arange(n) / RATE_HZ
    rows_s = np.arange(0.0, time_s[-1] - 1.0, 1.0 / recorder.rate_hz)
    taken_s = rows_s + recorder.jitter_s * rng.standard_normal(rows_s.size)
    cells: dict[str, FloatArray] = {}
    for column in recorder.columns:
        values = _as_sensed(made[column.source], column, recorder, rng)
        rate_hz = column.rate_hz or recorder.rate_hz
        at_s = rows_s if rate_hz >= recorder.rate_hz else np.floor(rows_s * rate_hz + 1e-6) / rate_hz
        at_s = at_s + (taken_s - rows_s) - column.late_s
        sampled = np.interp(at_s, time_s, values)
        if rate_hz >= recorder.rate_hz:
            sampled = sampled + column.noise * rng.standard_normal(rows_s.size)
        else:
            fresh = np.unique(np.floor(rows_s * rate_hz + 1e-6), return_inverse=True)[1]
            sampled = sampled + (column.noise * rng.standard_normal(fresh.max() + 1))[fresh]
        written = sampled * column.scale + column.offset
        if column.source in ("track", "yaw"):
            written = np.mod(written, 2.0 * np.pi * column.scale)
        cells[column.header] = np.round(written / column.step) * column.step if column.step else written
    kept = np.ones(rows_s.size, dtype=bool)
    if recorder.missing:
        kept = rng.random(rows_s.size) > 0.5 * recorder.missing
        for first in rng.integers(0, rows_s.size, round(0.5 * recorder.missing * rows_s.size / 8.0)):
            kept[first : first + 8] = False
    if recorder.parameters:
        return _write_parameters(path.with_suffix(".hdf5"), recorder, cells)
    clock = rows_s if not recorder.jitter_s else taken_s
    table = np.column_stack([clock, *cells.values()])[kept]
    header = ",".join(["time [s]", *cells])
    np.savetxt(path.with_suffix(".csv"), table, delimiter=",", header=header, comments="", fmt="%.7g")
    return path.with_suffix(".csv")


def _as_sensed(values: FloatArray, column: Column, recorder: Recorder, rng: np.random.Generator) -> FloatArray:
    """Return a signal with the lag of its sensor, its slow error, and behind the filter of its recorder."""
    if column.lag_s:
        keeps = float(np.exp(-1.0 / (RATE_HZ * column.lag_s)))
        values = signal.lfilter([1.0 - keeps], [1.0, -keeps], values, zi=[keeps * values[0]])[0]
    if column.slow:
        keeps = float(np.exp(-1.0 / (RATE_HZ * 60.0)))
        shocks = np.sqrt(1.0 - keeps**2) * rng.standard_normal(values.size)
        values = values + column.slow * signal.lfilter([1.0], [1.0, -keeps], shocks)
    if recorder.edge_hz is not None:
        values = signal.sosfiltfilt(signal.butter(4, recorder.edge_hz, fs=RATE_HZ, output="sos"), values)
    return np.asarray(values)


def _write_parameters(path: Path, recorder: Recorder, cells: Mapping[str, FloatArray]) -> Path:
    """Write the layout of FlightDataAccessor, each parameter at its rate."""
    with h5py.File(path, "w") as file:
        series = file.create_group("series")
        for column in recorder.columns:
            rate_hz = column.rate_hz or recorder.rate_hz
            every = round(recorder.rate_hz / rate_hz)
            name, unit = column.header.rstrip("]").split(" [")
            parameter = series.create_group("Groundspeed" if name == "ground_speed" else name)
            values = cells[column.header][::every]
            parameter["data"], parameter["mask"] = values.astype(np.float32), np.zeros(values.size, dtype=bool)
            parameter.attrs.update({"frequency": rate_hz, "supf_offset": 0.0, "units": unit})
    return path


def _blocked(line: str) -> Line:
    """Return the maker of a line that traps its pressure."""

    def make(made: Signals, on: BoolArray) -> Signals:
        first, total = int(np.argmax(on)), made["p_static"] + made["q_impact"]
        p_static = np.where(on, made["p_static"][first], made["p_static"]) if line == "static" else made["p_static"]
        total = np.where(on, total[first], total) if line == "pitot" else total
        return {**made, "p_static": p_static, "q_impact": total - p_static}

    return make


def _iced(made: Signals, on: BoolArray) -> Signals:
    """Take 0.3 % a second of the impact pressure, up to 40 %."""
    return {**made, "q_impact": made["q_impact"] * (1.0 - np.minimum(0.003 * np.cumsum(on) / RATE_HZ, 0.4))}


# Faults of a line; faults of a channel, with a step in its unit, None of 1.5 times what would have been found.
LINES: Mapping[str, Line] = {
    "pitot_blocked": _blocked("pitot"),
    "static_blocked": _blocked("static"),
    "pitot_icing": _iced,
}
STEPS: Mapping[str, float | None] = {"airspeed": None, "altitude": 100.0, "aoa": 2.5 * DEGREE}
BEGINS, LASTS_S = (0.35, 0.6), 240.0  # share of the flight, s
TIMES_FOUND = 1.5


def with_fault(trial: Trial, made: Signals, rng: np.random.Generator, least: float | None) -> tuple[Signals, Truth]:
    """Return the signals of a flight with a fault; `least` is the step of an airspeed that would have been found."""
    n = len(made["tas"])
    onset_s = float(rng.uniform(*BEGINS)) * n / RATE_HZ
    time_s = np.arange(n) / RATE_HZ
    on = (time_s >= onset_s) & (time_s < onset_s + LASTS_S)
    if trial.fault in LINES:
        until_s = None if trial.fault == "pitot_icing" else onset_s + LASTS_S
        changed = LINES[trial.fault](made, time_s >= onset_s if until_s is None else on)
        return computed(changed, rng), Truth(fault=trial.fault, onset_s=onset_s, offset_s=until_s)
    channel = airspeed_of(RECORDERS[trial.recorder]) if trial.fault == "airspeed" else trial.fault
    size = float(rng.choice([-1.0, 1.0])) * (STEPS[trial.fault] or TIMES_FOUND * (least or np.nan))
    signals = computed(made, rng)
    names = ("altitude", "baro_altitude") if channel == "altitude" else (channel,)
    stepped = {name: signals[name] + size * (time_s >= onset_s) for name in names}
    return {**signals, **stepped}, Truth(fault=channel, onset_s=onset_s, magnitude=size)


def airspeed_of(recorder: Recorder) -> str:
    """Return the first airspeed that a recorder has."""
    sources = [column.source for column in recorder.columns]
    return next(name for name in ("tas", "cas", "ias") if name in sources)


def has_sensor(trial: Trial) -> bool:
    """Return whether a recorder stores what the fault of a trial is of."""
    sources = {column.source for column in RECORDERS[trial.recorder].columns}
    return trial.fault in ("", "airspeed", "pitot_blocked", "pitot_icing") or bool(
        sources & ({"altitude", "baro_altitude"} if trial.fault in ("altitude", "static_blocked") else {trial.fault})
    )


def step_found(result: DiagnoseResult, channel: str) -> float | None:
    """Return the step of one airspeed that would have been found by an answer, None where it tells none."""
    sizes = [
        limit.seen_effect
        for limit in result.limits
        if (limit.bounds, limit.shape, limit.channel) == ("disagreement", "bias", channel)
        and limit.seen_effect is not None
    ]
    return max(sizes, default=None)


def answer_of(trial: Trial, *, flights: Path, folder: Path) -> Answer | None:
    """Return what `bfi diagnose` says of a trial, None where no step of its airspeed would have been found."""
    truth = journey(trial.aircraft, trial.seed, flights)
    if isinstance(truth, str):
        return Answer(trial=trial, refused=truth)
    recorder = RECORDERS[trial.recorder]
    least = None
    if trial.fault == "airspeed":
        healthy = answer_of(replace(trial, fault=""), flights=flights, folder=folder)
        if healthy is not None and healthy.result is not None:
            least = step_found(healthy.result, airspeed_of(recorder))
        if least is None:
            return None
    rng = np.random.default_rng([trial.seed, *trial.aircraft.encode(), *trial.recorder.encode(), *trial.fault.encode()])
    signals, fault = sensed(truth, recorder), None
    if trial.fault:
        signals, fault = with_fault(trial, signals, rng, least)
    else:
        signals = computed(signals, rng)
    path = recorded(signals, recorder, folder / f"{trial.aircraft}_{trial.seed}_{trial.recorder}_{trial.fault}", rng)
    with warnings.catch_warnings(record=True) as caught, threadpool_limits(1):
        warnings.simplefilter("always")
        try:
            result = diagnose(read_log(path))
        except BfiError as error:
            return Answer(trial=trial, truth=fault, refused=str(error))
    warned = tuple(str(warning.message) for warning in caught)
    return Answer(trial=trial, truth=fault, result=result, warned=warned)
