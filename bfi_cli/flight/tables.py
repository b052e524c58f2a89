"""What the flight model is made of, as tables: its states, its rows, its levels, and the ordinary causes of a jump.

A row of a table is all there is to an addition: a measurement is a `Row` whose states exist, an ordinary cause a
`Cause` whose jumps are of states, and `tests/flight/test_tables.py` holds every one to what the others keep.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..airdata import G
from ..kernels import FloatArray

Loads = Mapping[str, FloatArray | float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coefficients:
    """Courses about which the rows are linear, (n,) each, from smoothed channels.

    Attributes
    ----------
    airspeed, slow_airspeed : true airspeed over 9 s and over a minute, m/s.
    cas_share : calibrated over true airspeed; cas_by_height : what a metre adds to the calibrated one, m/s.
    load_factor : lift over dynamic pressure, 1 in the flight's median.
    lift_slope : angle of attack at a load factor of 1 above that of zero lift, rad, a constant.
    height, middle : pressure altitude, and its median, m.
    heading, track, bank : rad; cos_bank.
    steady_heading : without what gusts from the side make of it, rad.
    position_m : height by which a static port errs whose error is that share of the lift, m.
    rates : by row the rate of change of its own channel, per second.
    """

    airspeed: FloatArray
    slow_airspeed: FloatArray
    cas_share: FloatArray
    cas_by_height: FloatArray
    load_factor: FloatArray
    lift_slope: float
    height: FloatArray
    middle: float
    heading: FloatArray
    steady_heading: FloatArray
    track: FloatArray
    bank: FloatArray
    cos_bank: FloatArray
    position_m: FloatArray
    rates: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """A standard deviation that a flight tells, or other flights do.

    Attributes
    ----------
    typical : median over aircraft; lowest, highest : what it is kept between.
    fitted : whether the flight's own likelihood moves it: seconds say nothing of what walks within minutes.
    """

    typical: float
    lowest: float
    highest: float
    fitted: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state of the flight model.

    Attributes
    ----------
    start : standard deviation at take-off.
    memory_s : infinite for a random walk.
    level : the standard deviation of a process with a memory, of a walk that after a second; "" where it rests.
    climb_level : of a walk that after a metre of climb or descent, "" for none.
    widened : by which course a level is multiplied: "activity", "gusts" or "turns"; "" for none.
    """

    start: float
    memory_s: float = np.inf
    level: str = ""
    climb_level: str = ""
    widened: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What a recorded channel measures: a linear function of the states.

    Attributes
    ----------
    channel : that is measured.
    level : of its noise.
    widened : as of a state.
    loads : coefficients by state.
    plausible : the largest error of an instrument that still works, in the channel's unit: no fault is larger.
    """

    channel: str
    level: str
    widened: str = ""
    plausible: float
    loads: Callable[[Coefficients], Loads]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An ordinary cause of a sudden change.

    Attributes
    ----------
    jumps : by state the standard deviation of a jump; {} of one that is told by what is recorded alone.
    needs : rows of which one is recorded, () for any; unless : a channel that would show it, "" for none.
    noisy : channels of which the first that is recorded is noisier while it lasts, and no other is; () for none.
    text : what happened, as a report says it.
    is_sought : whether it is looked for where no finder proposes a fault: what happens at once, and now and then.
    """

    jumps: Mapping[str, float]
    text: str
    unit: str = ""
    needs: tuple[str, ...] = ()
    unless: str = ""
    noisy: tuple[str, ...] = ()
    is_sought: bool = False


# Typical of four light aircraft and a small jet, chosen by hand and not yet medians over aircraft, and ranges within
# which a flight may differ. What walks within minutes is not fitted: the likelihood of one-second innovations buys
# walks in which every slow fault hides.
LEVELS: Mapping[str, Level] = {
    # noise of rows
    "altitude": Level(typical=0.5, lowest=0.3, highest=5.0),
    "altitude_rate": Level(typical=0.4, lowest=0.15, highest=3.0),
    "gps_altitude": Level(typical=1.0, lowest=0.5, highest=10.0),
    "normal_acc": Level(typical=0.3, lowest=0.05, highest=2.0),
    "tas": Level(typical=0.3, lowest=0.1, highest=3.0),
    "cas": Level(typical=0.2, lowest=0.05, highest=3.0),
    "mach": Level(typical=0.3, lowest=0.1, highest=3.0),
    "velocity": Level(typical=0.4, lowest=0.15, highest=3.0),
    "pitch": Level(typical=0.003, lowest=0.001, highest=0.03),
    "aoa": Level(typical=0.002, lowest=0.0007, highest=0.03),
    "sat": Level(typical=0.2, lowest=0.05, highest=2.0),
    # what moves within seconds
    "vertical_acceleration": Level(typical=0.4, lowest=0.1, highest=2.0),
    "airspeed": Level(typical=0.5, lowest=0.1, highest=0.8),
    "gust": Level(typical=0.5, lowest=0.1, highest=2.0),
    "vertical_air": Level(typical=0.5, lowest=0.15, highest=1.0),
    "wind_gust": Level(typical=0.5, lowest=0.1, highest=2.0),
    "vane_gust": Level(typical=0.004, lowest=0.001, highest=0.02),
    "vane_drift": Level(typical=0.002, lowest=0.0005, highest=0.004),
    # what walks within minutes, after a second or a metre
    "wind": Level(typical=0.05, lowest=0.03, highest=0.06, fitted=False),
    "wind_shear": Level(typical=0.05, lowest=0.02, highest=0.08, fitted=False),
    "gps_offset": Level(typical=0.1, lowest=0.03, highest=0.25, fitted=False),
    "gps_offset_climb": Level(typical=0.1, lowest=0.05, highest=0.3, fitted=False),
    "gps_scale": Level(typical=5e-5, lowest=5e-5, highest=5e-5, fitted=False),
    "pitch_error": Level(typical=2e-4, lowest=1e-4, highest=3e-4, fitted=False),
    "zero_lift": Level(typical=1.5e-4, lowest=1e-4, highest=2e-4, fitted=False),
    "lift_slope": Level(typical=1e-5, lowest=1e-5, highest=1e-5, fitted=False),
    "heading_error": Level(typical=1e-3, lowest=5e-4, highest=2e-3, fitted=False),
    "load_bias": Level(typical=0.003, lowest=0.001, highest=0.006, fitted=False),
    "temperature": Level(typical=0.01, lowest=0.003, highest=0.05, fitted=False),
    "temperature_climb": Level(typical=0.01, lowest=0.003, highest=0.05, fitted=False),
    "airspeed_scale": Level(typical=5e-5, lowest=5e-5, highest=5e-5, fitted=False),
    "airspeed_scale_climb": Level(typical=5e-5, lowest=5e-5, highest=5e-5, fitted=False),
    "position_error": Level(typical=2e-4, lowest=2e-4, highest=2e-4, fitted=False),
    "lag": Level(typical=0.02, lowest=0.02, highest=0.02, fitted=False),
}

STATES: Mapping[str, State] = {
    # motion
    "height": State(start=50.0),
    "climb": State(start=5.0),
    "climb_rate": State(start=1.0, memory_s=60.0, level="vertical_acceleration", widened="activity"),
    "airspeed": State(start=20.0, level="airspeed", widened="activity"),
    "gust": State(start=1.0, memory_s=8.0, level="gust", widened="gusts"),
    "vertical_air": State(start=1.0, memory_s=60.0, level="vertical_air"),
    "shown_climb": State(start=5.0),
    # air
    "wind_north": State(start=15.0, level="wind", climb_level="wind_shear"),
    "wind_east": State(start=15.0, level="wind", climb_level="wind_shear"),
    "gust_north": State(start=1.0, memory_s=25.0, level="wind_gust", widened="activity"),
    "gust_east": State(start=1.0, memory_s=25.0, level="wind_gust", widened="activity"),
    "warmth": State(start=15.0, level="temperature", climb_level="temperature_climb"),
    # aircraft
    "zero_lift": State(start=0.1, level="zero_lift"),
    "lift_slope": State(start=0.03, level="lift_slope"),
    "vane_gust": State(start=0.005, memory_s=5.0, level="vane_gust", widened="activity"),
    "vane_drift": State(start=0.005, memory_s=60.0, level="vane_drift"),
    # instruments
    "gps_offset": State(start=150.0, level="gps_offset", climb_level="gps_offset_climb"),
    "gps_scale": State(start=0.05, level="gps_scale"),
    "setting": State(start=1.0),
    "pitch_error": State(start=0.02, level="pitch_error", widened="turns"),
    "erection": State(start=0.01, memory_s=80.0),  # of a gyro horizon: time constants lie between 30 and 200 s
    "heading_error": State(start=0.1, level="heading_error", widened="turns"),
    "deviation_sine": State(start=0.05),
    "deviation_cosine": State(start=0.05),
    "climb_bias": State(start=0.2),
    "load_bias": State(start=0.3, level="load_bias", widened="turns"),
    "tas_scale": State(start=0.04, level="airspeed_scale"),
    "cas_scale": State(start=0.04, level="airspeed_scale", climb_level="airspeed_scale_climb"),
    "mach_scale": State(start=0.04, level="airspeed_scale", climb_level="airspeed_scale_climb"),
    "position_error": State(start=0.02, level="position_error"),
    "lag_altitude": State(start=0.7, level="lag"),
    "lag_airspeed": State(start=0.7, level="lag"),
    "lag_velocity": State(start=0.7, level="lag"),
    "lag_pitch": State(start=0.7, level="lag"),
}


def _airspeed(c: Coefficients, share: FloatArray | float) -> dict[str, FloatArray | float]:
    return {
        "airspeed": share,
        "gust": share,
        "position_error": share * c.position_m * G / c.airspeed,
        "lag_airspeed": -share * c.rates["tas"],
    }


def _along(c: Coefficients) -> Loads:
    """Ground speed along the track, to first order in the wind across it."""
    cosine, sine = np.cos(c.track), np.sin(c.track)
    return {
        "airspeed": 1.0,
        "tas_scale": -c.slow_airspeed,
        "wind_north": cosine,
        "wind_east": sine,
        "gust_north": cosine,
        "gust_east": sine,
        "lag_velocity": -c.rates["ground_speed"],
    }


# Errors of heading and airspeed act about the steady heading: about the recorded one, a deviation of the compass by 0.4
# rad and a scale of 1.1 would cancel what gusts make of it, and a front with it.
def _north(c: Coefficients) -> Loads:
    cosine, sine = np.cos(c.steady_heading), np.sin(c.steady_heading)
    return {
        "airspeed": np.cos(c.heading),
        "tas_scale": -c.slow_airspeed * cosine,
        "wind_north": 1.0,
        "gust_north": 1.0,
        "heading_error": -c.slow_airspeed * sine,
        "deviation_sine": -c.slow_airspeed * sine**2,
        "deviation_cosine": -c.slow_airspeed * sine * cosine,
        "lag_velocity": -c.rates["velocity_north"],
    }


def _east(c: Coefficients) -> Loads:
    cosine, sine = np.cos(c.steady_heading), np.sin(c.steady_heading)
    return {
        "airspeed": np.sin(c.heading),
        "tas_scale": -c.slow_airspeed * sine,
        "wind_east": 1.0,
        "gust_east": 1.0,
        "heading_error": c.slow_airspeed * cosine,
        "deviation_sine": c.slow_airspeed * sine * cosine,
        "deviation_cosine": c.slow_airspeed * cosine**2,
        "lag_velocity": -c.rates["velocity_east"],
    }


def _lift(c: Coefficients) -> dict[str, FloatArray | float]:
    """Angle of attack: what the wing needs for its load, which falls with the square of the airspeed."""
    by_speed = -2.0 * c.lift_slope * c.load_factor / c.airspeed
    return {
        "zero_lift": 1.0,
        "vane_gust": 1.0,
        "vane_drift": 1.0,
        "lift_slope": c.load_factor,
        "airspeed": by_speed,
        "gust": by_speed,
    }


def _pitch(c: Coefficients) -> Loads:
    lift = {name: c.cos_bank * load for name, load in _lift(c).items()}
    climb = 1.0 / c.airspeed
    return {
        **lift,
        "climb": climb,
        "vertical_air": -climb,
        "pitch_error": 1.0,
        "erection": 1.0,
        "lag_pitch": -c.rates["pitch"],
    }


def _height(c: Coefficients) -> Loads:
    return {"height": 1.0, "setting": 1.0, "position_error": c.position_m, "lag_altitude": -c.rates["altitude"]}


# Each row is weighed given those above it: what no pressure moves comes first, so that an error of a line is the
# line's.
ROWS: Mapping[str, Row] = {
    row.channel: row
    for row in (
        Row(
            channel="gps_altitude",
            level="gps_altitude",
            plausible=2000.0,
            loads=lambda c: {"height": 1.0, "gps_offset": 1.0, "gps_scale": c.height - c.middle},
        ),
        Row(channel="velocity_north", level="velocity", plausible=100.0, loads=_north),
        Row(channel="velocity_east", level="velocity", plausible=100.0, loads=_east),
        Row(channel="ground_speed", level="velocity", plausible=100.0, loads=_along),
        Row(
            channel="normal_acc",
            level="normal_acc",
            widened="activity",
            plausible=10.0,
            loads=lambda c: {"climb_rate": 1.0, "load_bias": 1.0},
        ),
        Row(channel="pitch", level="pitch", widened="activity", plausible=0.6, loads=_pitch),
        Row(channel="aoa", level="aoa", widened="activity", plausible=0.5, loads=_lift),
        Row(channel="sat", level="sat", plausible=60.0, loads=lambda c: {"warmth": 1.0}),
        Row(channel="altitude", level="altitude", widened="activity", plausible=1500.0, loads=_height),
        Row(
            channel="altitude_rate",
            level="altitude_rate",
            widened="activity",
            plausible=30.0,
            loads=lambda c: {"shown_climb": 1.0, "climb_bias": 1.0},
        ),
        Row(channel="tas", level="tas", widened="gusts", plausible=100.0, loads=lambda c: _airspeed(c, 1.0)),
        Row(
            channel="cas",
            level="cas",
            widened="gusts",
            plausible=100.0,
            # Of an altitude by another setting what is made of the airspeed is another one.
            loads=lambda c: {
                **_airspeed(c, c.cas_share),
                "cas_scale": c.cas_share * c.slow_airspeed,
                "setting": -c.cas_by_height,
            },
        ),
        Row(
            channel="mach",
            level="mach",
            widened="gusts",
            plausible=0.3,
            loads=lambda c: {**_airspeed(c, 1.0), "mach_scale": c.slow_airspeed},
        ),
    )
}

ALTIMETER_SET, FLAPS, ON_GROUND = "altimeter_set", "flaps", "on_ground"
AIRSPEED_ROWS = ("tas", "cas", "mach")
# What a pilot does at any time: jumps that every hypothesis may have.
MANOEUVRE = {"airspeed": 10.0, "climb": 5.0, "climb_rate": 5.0, "gust": 5.0}
# Standard deviations of jumps: a front or a gust line, two notches of flaps, an erecting horizon, a GPS fix that is
# found again, a cold layer, and ten clicks of an altimeter's knob.
ORDINARY: Mapping[str, Cause] = {
    # A draught carries the aircraft with it: it moves the climb, and a pitch that moves alone is none.
    "wind": Cause(jumps={"wind_north": 8.0, "wind_east": 8.0}, unit="m/s", text="the wind changes", is_sought=True),
    FLAPS: Cause(
        jumps={"zero_lift": 0.05, "vane_gust": 0.05},
        unit="rad",
        text="flaps or gear move",
        needs=("pitch", "aoa"),
        is_sought=True,
    ),
    # A vertical and a directional gyro settle apart: a pitch that errs must not pay for a heading that does not. The
    # second is no error of air data: it is a rival of the others alone.
    "attitude_settles": Cause(
        jumps={"erection": 0.05}, unit="rad", text="the attitude sensor settles", needs=("pitch",), is_sought=True
    ),
    "heading_settles": Cause(
        jumps={"heading_error": 0.2}, unit="rad", text="the heading settles", needs=("velocity_north",)
    ),
    "gps_settles": Cause(
        jumps={"gps_offset": 60.0, "gps_scale": 0.02},
        unit="m",
        text="the geometric height settles",
        needs=("gps_altitude",),
    ),
    "temperature": Cause(jumps={"warmth": 8.0}, unit="K", text="the air temperature changes", needs=("sat",)),
    ALTIMETER_SET: Cause(
        jumps={"setting": 150.0},
        unit="m",
        text="the altimeter is set",
        needs=("altitude",),
        unless="baro_setting",
        is_sought=True,
    ),
    "wake": Cause(jumps={}, text="eddies disturb the airspeed alone", noisy=("tas", "cas", "ias")),
    ON_GROUND: Cause(jumps={}, text="the aircraft is on the ground"),
}
