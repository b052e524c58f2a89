"""Sensors that fail by themselves: a vane that rests, a probe and an accelerometer that step; what is no fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight
from made_logs import made_log

from bfi_cli.airdata import G, channels_of, isa_temperature, pressure_at, speed_of_sound, static_temperature
from bfi_cli.flight.parity import Record, record_of
from bfi_cli.flight.parity.frozen import frozen_sensors, without_frozen
from bfi_cli.flight.parity.sensors import (
    accelerometer_steps,
    airspeed_steps,
    altimeter_steps,
    altitude_step_within,
    pitch_steps,
    probe_steps,
)
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.phases import Phase
from bfi_cli.flightlog.record import frozen_array

N, RATE_HZ, ONSET_S = 1000, 4.0, 400.0
FLIGHT = [Phase(phase="cruise", from_s=0.0, to_s=float(N))]
UNITS = {"altitude": "m", **dict.fromkeys(("aoa", "pitch", "roll"), "rad"), "normal_acc": "m/s^2"}
UNITS |= {"altitude_rate": "m/s"}


def attitudes(step: float = 0.0) -> FlightLog:
    """Return the log of an aircraft that climbs, descends and banks; `step` of the vane's record, rad."""
    t = np.arange(round(N * RATE_HZ)) / RATE_HZ
    rng = np.random.default_rng(2)
    slope, roll = 0.04 * np.sin(0.05 * t) + 0.02 * np.sin(0.21 * t), 0.3 * np.sin(0.013 * t)
    aoa = 0.06 + 0.02 * np.sin(0.08 * t)
    lift = (100.0 * np.gradient(slope, t) + G * np.cos(slope)) / np.cos(roll)
    pitch = np.arcsin(np.cos(aoa) * np.sin(slope) + np.sin(aoa) * np.cos(slope) * np.cos(roll))
    noise = 0.0 if step else 2e-4 * rng.standard_normal(t.size)
    return made_log(
        t,
        UNITS,
        tas=np.full(t.size, 100.0),
        altitude_rate=100.0 * np.sin(slope),
        aoa=np.round((aoa + noise) / step) * step if step else aoa + noise,
        pitch=pitch,
        roll=roll,
        normal_acc=lift - G + 0.1 * rng.standard_normal(t.size),
        altitude=2000.0 + np.cumsum(100.0 * np.sin(slope)) / RATE_HZ,
    )


def with_values(log: FlightLog, name: str, values: np.ndarray) -> FlightLog:
    return replace(log, channels={**log.channels, name: replace(log.channels[name], values=values)})


@pytest.mark.parametrize("until_s", [None, 520.0])
def test_a_vane_that_rests_while_the_aircraft_moves_is_frozen_and_missing(until_s: float | None):
    log = attitudes()
    aoa = log.channels["aoa"].values.copy()
    rests = (log.time_s >= ONSET_S) & (log.time_s < (until_s or np.inf))
    aoa[rests] = aoa[rests][0]
    log = with_values(log, "aoa", aoa)
    (found,) = frozen_sensors(log, record_of(log), FLIGHT)
    assert (found.fault, found.shape, found.among) == ("aoa", "frozen", ("aoa",))
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.offset_s == (None if until_s is None else pytest.approx(until_s, abs=0.5))
    gone = ~np.isfinite(without_frozen(log, [found]).channels["aoa"].values)
    assert gone[rests].all()
    assert np.count_nonzero(gone & ~rests) <= 3.0 * RATE_HZ


def test_a_coarse_vane_that_often_rests_is_not_frozen():
    log = attitudes(step=np.radians(2.0))
    assert frozen_sensors(log, record_of(log), FLIGHT) == ()


def test_a_vane_that_rests_where_nothing_moves_is_not_frozen():
    log = attitudes()
    still = (log.time_s >= ONSET_S) & (log.time_s < ONSET_S + 100.0)
    for name in ("aoa", "pitch", "roll", "altitude_rate"):
        values = log.channels[name].values.copy()
        values[still] = 0.02 if name in ("aoa", "pitch") else 0.0
        log = with_values(log, name, values)
    assert frozen_sensors(log, record_of(log), FLIGHT) == ()


def with_airspeeds(sizes: dict[str, float], *, within_s: float = 0.0, until_s: float = np.inf) -> FlightLog:
    """Return the log of 100 m/s by airspeeds that change by some m/s from `ONSET_S` on."""
    log = attitudes()
    grown = np.clip((log.time_s - ONSET_S + 0.5 / RATE_HZ) / max(within_s, 1e-6), 0.0, 1.0)
    shift = np.where(log.time_s < until_s, grown, 0.0)
    channels = {
        name: replace(log.channels["tas"], name=name, values=frozen_array(100.0 + size * shift))
        for name, size in sizes.items()
    }
    return replace(log, channels={**log.channels, **channels})


@pytest.mark.parametrize(
    ("sizes", "fault", "among"),
    [
        ({"tas": -40.0}, "tas", ("tas", "pitot_icing")),
        ({"tas": 31.0}, "tas", ("tas",)),  # 3 g over a second are 29.4 m/s
        ({"tas": -40.0, "cas": 0.0}, "tas", ("tas",)),
        ({"tas": 0.0, "cas": 40.0}, "cas", ("cas",)),
        ({"tas": -40.0, "cas": -40.0}, "pitot_icing", ("pitot_icing",)),
        ({"tas": 40.0, "cas": 40.0}, "q_impact", ("q_impact",)),
    ],
)
def test_an_airspeed_that_steps_faster_than_any_flight_is_named(
    sizes: dict[str, float], fault: str, among: tuple[str, ...]
):
    (finding,) = airspeed_steps(with_airspeeds(sizes), FLIGHT)
    assert (finding.fault, finding.among, finding.shape) == (fault, among, "bias")
    assert finding.onset_ci95[0] <= ONSET_S <= finding.onset_ci95[1]
    assert finding.effect == {name: pytest.approx(size, abs=0.1) for name, size in sizes.items() if size}
    size = max(sizes.values(), key=abs)
    share = (1.0 + size / 100.0) ** 2 - 1.0
    assert finding.magnitude == pytest.approx(
        {"pitot_icing": -share, "q_impact": share}.get(fault, size), abs=1e-2 * abs(size)
    )


@pytest.mark.parametrize(
    "log",
    [
        with_airspeeds({"tas": -28.0}),  # a gust and a deceleration
        with_airspeeds({"tas": -80.0}, within_s=4.0),
        with_airspeeds({"tas": -80.0}, until_s=ONSET_S + 1.0),  # a spike
        with_airspeeds({"tas": -80.0}, within_s=20.0, until_s=ONSET_S + 50.0),  # the end of a slower loss
    ],
)
def test_what_a_flight_may_do_and_what_lasts_a_second_is_no_step_of_an_airspeed(log: FlightLog):
    assert airspeed_steps(log, FLIGHT) == ()


def test_what_an_airspeed_gains_in_a_gap_of_the_record_is_no_step_of_it():
    log = with_airspeeds({"tas": 40.0, "cas": 40.0}, within_s=9.0)
    kept = (log.time_s < ONSET_S) | (log.time_s >= ONSET_S + 9.0)
    channels = {name: replace(each, values=frozen_array(each.values[kept])) for name, each in log.channels.items()}
    assert airspeed_steps(replace(log, time_s=frozen_array(log.time_s[kept]), channels=channels), FLIGHT) == ()


@pytest.mark.parametrize("sizes", [{"tas": -60.0}, {"tas": 40.0}, {"tas": -100.0, "cas": -100.0}])
def test_a_step_of_an_airspeed_ends_where_it_comes_back(sizes: dict[str, float]):
    (finding,) = airspeed_steps(with_airspeeds(sizes, until_s=ONSET_S + 30.0), FLIGHT)
    assert finding.offset_s == pytest.approx(ONSET_S + 30.0, abs=1.0 / RATE_HZ)
    assert finding.effect == {name: pytest.approx(size, abs=0.1) for name, size in sizes.items()}


def test_a_return_from_nothing_is_no_share_of_it():
    log = with_airspeeds({"tas": -100.0, "cas": -100.0}, until_s=ONSET_S + 30.0)
    for name in ("tas", "cas"):  # 60 of the 100 m/s come back
        values = log.channels[name].values
        log = with_values(log, name, np.where(log.time_s >= ONSET_S + 30.0, values - 60.0, values))
    (finding,) = airspeed_steps(log, FLIGHT)
    assert finding.fault == "pitot_icing"
    assert finding.magnitude == pytest.approx(1.0)
    assert finding.sd is not None
    assert finding.sd > 0.0


def warmer(step_k: float, *, seconds: float = np.inf) -> Record:
    """Return a flight whose probe shows some kelvin more from 400 s on, with sat and tas as a computer makes them."""
    log = made_flight(seconds=N, climbs_m=100.0)
    t = log.time_s
    tat, mach = (log.channels[name].values for name in ("tat", "mach"))
    off = tat + step_k * ((t >= ONSET_S) & (t < ONSET_S + seconds))
    for name, values in (
        ("tat", off),
        ("sat", static_temperature(off, mach)),
        ("tas", mach * speed_of_sound(static_temperature(off, mach))),
    ):
        log = with_values(log, name, values)
    return record_of(log)


@pytest.mark.parametrize("step_k", [5.0, -5.0, 9.0])
def test_a_probe_that_steps_is_named_with_all_that_follows_from_it(step_k: float):
    (found,) = probe_steps(warmer(step_k), FLIGHT, ("tat", "sat", "tas", "mach", "altitude"))
    assert (found.fault, found.shape, found.channels) == ("tat", "bias", ("tat", "sat", "tas"))
    assert found.magnitude == pytest.approx(step_k, rel=0.1)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.effect["tas"] * step_k > 0.0


def test_air_that_is_layered_and_spikes_are_no_step_of_a_probe():
    names = ("tat", "sat", "tas", "mach", "altitude")
    assert probe_steps(warmer(0.0), FLIGHT, names) == ()
    assert probe_steps(warmer(5.0, seconds=4.0), FLIGHT, names) == ()
    # An inversion: 6 K within 60 m that the aircraft climbs in 6 s.
    t = np.arange(float(N)) + 0.5
    altitude = 1500.0 + 10.0 * np.clip(t - ONSET_S, 0.0, 60.0)
    sat = isa_temperature(altitude) + 0.1 * np.clip(altitude - 1530.0, 0.0, 60.0)
    record = Record(
        time_s=t, channels={"sat": sat, "altitude": altitude, "tas": np.full(N, 90.0)}, gained=None, airspeed="tas"
    )
    assert probe_steps(record, FLIGHT, ("sat", "altitude", "tas")) == ()


def test_samples_that_no_subsonic_flight_has_are_no_temperature():
    """A Mach number of 1.4 and a probe at 0 K for a second each, in a log without a static temperature."""
    record = warmer(5.0)
    channels = {name: values.copy() for name, values in record.channels.items() if name != "sat"}
    channels["mach"][100], channels["tat"][200] = 1.4, 0.0
    (found,) = probe_steps(replace(record, channels=channels), FLIGHT, ("tat", "tas", "mach", "altitude"))
    assert (found.fault, found.onset_s) == ("tat", pytest.approx(ONSET_S, abs=3.0))


@pytest.mark.parametrize("size", [0.2, -0.3])
def test_an_accelerometer_that_steps_is_named_with_its_size(size: float):
    log = attitudes()
    values = log.channels["normal_acc"].values + size * (log.time_s >= ONSET_S)
    (found,) = accelerometer_steps(record_of(with_values(log, "normal_acc", values)), FLIGHT)
    assert (found.fault, found.shape) == ("normal_acc", "bias")
    assert found.magnitude is not None
    assert found.sd is not None
    assert abs(found.magnitude - size) < 3.0 * found.sd + 0.01
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.onset_ci95[1] - found.onset_ci95[0] < 30.0


def test_a_healthy_accelerometer_and_one_that_is_off_throughout_do_not_step():
    log = attitudes()
    assert accelerometer_steps(record_of(log), FLIGHT) == ()
    off = with_values(log, "normal_acc", log.channels["normal_acc"].values + 0.5)
    assert accelerometer_steps(record_of(off), FLIGHT) == ()


def test_a_static_line_that_leaks_is_no_step_of_an_accelerometer():
    """The altitude's rate jumps and comes back: over two minutes that is an acceleration of 0.3 m/s^2."""
    log = attitudes()
    since = np.maximum(log.time_s - ONSET_S, 0.0)
    rate = log.channels["altitude_rate"].values - 36.0 * np.exp(-since / 6.0) * (log.time_s >= ONSET_S)
    assert accelerometer_steps(record_of(with_values(log, "altitude_rate", rate)), FLIGHT) == ()


def pitching(step_rad: float, *, within_s: float = 0.0, climbs: bool = False) -> Record:
    """Return a flight in rough air whose pitch changes by some radians from 400 s on, and its climb with it or not."""
    log, rng = attitudes(), np.random.default_rng(4)
    grown = np.clip((log.time_s - ONSET_S + 0.5 / RATE_HZ) / max(within_s, 1e-6), 0.0, 1.0)
    rough = 0.003 * rng.standard_normal(log.time_s.size)
    values = {name: log.channels[name].values for name in ("pitch", "altitude")}
    climbed = 100.0 * step_rad * np.cumsum(grown) / RATE_HZ if climbs else 0.0
    log = with_values(log, "pitch", values["pitch"] + rough + step_rad * grown)
    return record_of(with_values(log, "altitude", values["altitude"] + climbed))


@pytest.mark.parametrize("step_rad", [0.08, -0.1])
def test_a_pitch_that_steps_is_named_with_its_size(step_rad: float):
    (finding,) = pitch_steps(pitching(step_rad), FLIGHT)
    assert (finding.fault, finding.shape, finding.effect) == ("pitch", "bias", {"pitch": finding.magnitude})
    assert finding.sd is not None
    assert finding.magnitude == pytest.approx(step_rad, abs=3.0 * finding.sd)
    assert finding.onset_ci95[0] <= ONSET_S <= finding.onset_ci95[1]


@pytest.mark.parametrize(
    "record",
    [
        pitching(0.0),
        pitching(0.08, climbs=True),  # the aircraft climbs as it pitches
        pitching(0.08, within_s=6.0),  # flaps, which take seconds
    ],
)
def test_what_climbs_and_what_takes_seconds_is_no_step_of_the_pitch(record: Record):
    assert pitch_steps(record, FLIGHT) == ()


def altitude_off(step_m: float, *, seconds: float = np.inf, lag_s: float = 0.0) -> Record:
    """Return a flight whose altitude shows some metres more from 400 s on, and whose rate lags."""
    log, rng = attitudes(), np.random.default_rng(3)
    t, altitude = log.time_s, log.channels["altitude"].values
    off = altitude + step_m * ((t >= ONSET_S) & (t < ONSET_S + seconds)) + 0.3 * rng.standard_normal(t.size)
    rate = log.channels["altitude_rate"].values
    lagging = np.interp(t - lag_s, t, rate)
    return record_of(with_values(with_values(log, "altitude", off), "altitude_rate", lagging))


@pytest.mark.parametrize(("step_m", "lag_s"), [(12.0, 0.0), (-60.0, 0.0), (25.0, 2.0), (-60.0, 2.0)])
def test_an_altimeter_that_steps_is_named_with_its_size(step_m: float, lag_s: float):
    (found,) = altimeter_steps(altitude_off(step_m, lag_s=lag_s), FLIGHT, ())
    assert (found.fault, found.shape, found.effect) == ("altitude", "bias", {"altitude": found.magnitude})
    assert found.magnitude == pytest.approx(step_m, abs=3.0)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]


@pytest.mark.parametrize(("step_m", "named"), [(30.0, False), (40.0, True)])
def test_an_altimeter_steps_by_ten_times_what_its_altitude_usually_shows_beside_its_rate(step_m: float, named: bool):
    """A swing of 2 m in 12.3 s makes one of 3.3 m of means of 4 s that are 6 s apart: a standard deviation of 3.5 m."""
    t = np.arange(float(N)) + 0.5
    altitude = 2000.0 + 2.0 * np.cos(2.0 * np.pi * (t - ONSET_S) / 12.3) + step_m * (t > ONSET_S)
    channels = {"altitude": altitude, "altitude_rate": np.zeros(N), "tas": np.full(N, 100.0)}
    steps = altimeter_steps(Record(time_s=t, channels=channels, gained=None, airspeed="tas"), FLIGHT, ())
    assert [step.onset_s for step in steps] == ([pytest.approx(ONSET_S, abs=1.0)] if named else [])


@pytest.mark.parametrize("late_s", [0.0, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("step_m", [-60.0, 40.0])
def test_a_step_as_the_climb_begins_has_its_whole_size(step_m: float, late_s: float):
    """It has no part in the fit of what follows a climb, which other climbs tell, nor in the altitude before it."""
    t, rng = np.arange(0.0, 900.0, 0.1), np.random.default_rng(4)
    climbs_s = (100.0, 250.0, ONSET_S, 600.0, 700.0)
    rate = sum(12.0 * np.clip((t - at_s) / 4.0, 0.0, 1.0) * (t < at_s + 60.0) for at_s in climbs_s)
    true = 1500.0 + 0.1 * np.cumsum(rate)
    log = attitudes()
    at = np.interp(log.time_s, t, true) + step_m * (log.time_s >= ONSET_S + late_s)
    log = with_values(log, "altitude", at + 0.1 * rng.standard_normal(at.size))
    log = with_values(log, "altitude_rate", np.interp(log.time_s, t, rate))
    (found,) = altimeter_steps(record_of(log), FLIGHT, ())
    assert found.magnitude == pytest.approx(step_m, abs=2.0 * (found.sd or 0.0))
    assert found.magnitude == pytest.approx(step_m, rel=0.03)


def test_a_rate_that_lags_a_spike_and_a_line_that_is_held_are_no_step_of_an_altimeter():
    assert altimeter_steps(altitude_off(0.0, lag_s=2.0), FLIGHT, ()) == ()
    assert altimeter_steps(altitude_off(60.0, seconds=4.0), FLIGHT, ()) == ()
    assert altimeter_steps(altitude_off(60.0), FLIGHT, [(ONSET_S - 20.0, ONSET_S + 20.0)]) == ()
    without = altitude_off(60.0)
    no_rate = {name: values for name, values in without.channels.items() if name != "altitude_rate"}
    assert altimeter_steps(replace(without, channels=no_rate), FLIGHT, ()) == ()


def test_the_rate_of_the_altitude_denies_steps_that_are_not_there():
    about = (ONSET_S - 1.0, ONSET_S + 1.0)
    assert altitude_step_within(altitude_off(0.0), FLIGHT, (), about) < 25.0
    assert altitude_step_within(altitude_off(60.0), FLIGHT, (), about) > 60.0
    assert altitude_step_within(altitude_off(0.0), FLIGHT, [(ONSET_S - 20.0, ONSET_S + 20.0)], about) == np.inf
    assert altitude_step_within(altitude_off(0.0), FLIGHT, (), (-50.0, -40.0)) == np.inf
    record = altitude_off(0.0)
    no_rate = {name: values for name, values in record.channels.items() if name != "altitude_rate"}
    assert altitude_step_within(replace(record, channels=no_rate), FLIGHT, (), about) == np.inf


def lively() -> FlightLog:
    """Return ten minutes of flight in which every channel has noise of its own."""
    log, rng = attitudes(), np.random.default_rng(5)
    for name in log.channels:
        log = with_values(log, name, log.channels[name].values + 1e-3 * rng.standard_normal(log.n_samples))
    return log


def held(log: FlightLog, *names: str, until_s: float = np.inf) -> FlightLog:
    rests = (log.time_s >= ONSET_S) & (log.time_s < until_s)
    for name in names:
        values = log.channels[name].values.copy()
        values[rests] = values[rests][0]
        log = with_values(log, name, values)
    return log


@pytest.mark.parametrize("name", ["tas", "altitude", "altitude_rate", "pitch", "normal_acc"])
@pytest.mark.parametrize("until_s", [ONSET_S + 25.0, np.inf])
def test_any_sensor_that_holds_its_reading_while_others_move_is_frozen(name: str, until_s: float):
    log = held(lively(), name, until_s=until_s)
    (found,) = frozen_sensors(log, record_of(log), FLIGHT)
    assert (found.fault, found.shape) == (name, "frozen")
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert (found.offset_s is None) == np.isinf(until_s)


@pytest.mark.parametrize(
    ("lasts_s", "repeats", "is_frozen"),
    [(3.0, 1, True), (1.5, 1, False), (3.0, 6, False)],  # a sensor of 8 Hz among samples of 50 Hz often rests
)
def test_a_sensor_whose_samples_else_differ_is_frozen_after_seconds(lasts_s: float, repeats: int, is_frozen: bool):
    t = np.arange(0.0, 60.0, 0.02)
    noise = np.random.default_rng(6).standard_normal((6, t.size))
    names = ("tas", "altitude_rate", "pitch", "roll", "aoa", "normal_acc")
    values = {name: 100.0 * (name == "tas") + 0.1 * row for name, row in zip(names, noise, strict=True)}
    values["tas"] = np.repeat(values["tas"][::repeats], repeats)[: t.size]
    rests = (t >= 30.0) & (t < 30.0 + lasts_s)
    values["tas"][rests] = values["tas"][rests][0]
    log = made_log(t, UNITS, **values)
    phases = [Phase(phase="cruise", from_s=0.0, to_s=60.0)]
    assert [finding.fault for finding in frozen_sensors(log, record_of(log), phases)] == ["tas"] * is_frozen


@pytest.mark.parametrize(
    "names",
    [
        ("altitude", "altitude_rate"),  # a blocked port holds both
        ("tas", "altitude", "altitude_rate", "aoa", "pitch", "roll", "normal_acc"),  # a recorder that hangs
        ("tas", "pitch", "normal_acc"),  # trim
    ],
)
def test_what_something_else_holds_is_not_frozen(names: tuple[str, ...]):
    log = held(lively(), *names)
    assert frozen_sensors(log, record_of(log), FLIGHT) == ()


@pytest.mark.parametrize(("rate", "names"), [(0.0, []), (0.02, ["roll"])])
def test_a_roll_that_rests_is_frozen_where_the_heading_turns(rate: float, names: list[str]):
    """An autopilot holds a coarse roll for minutes; at g tan(11 deg) / V it is no level flight."""
    log, noise = lively(), 1e-3 * np.random.default_rng(8).standard_normal((2, attitudes().n_samples))
    yaw = replace(log.channels["roll"], name="yaw", values=frozen_array(rate * log.time_s + noise[0]))
    log = held(with_values(replace(log, channels={**log.channels, "yaw": yaw}), "roll", noise[1]), "roll")
    assert [finding.fault for finding in frozen_sensors(log, record_of(log), FLIGHT)] == names


@pytest.mark.parametrize("is_tube", [True, False])
def test_a_total_pressure_that_rests_is_frozen_where_the_airspeed_shows_that_its_tube_is_open(is_tube: bool):
    log = lively()
    noise = np.random.default_rng(7).standard_normal(log.n_samples)
    static = pressure_at(log.channels["altitude"].values)
    total = static + 6000.0 + 200.0 * np.sin(0.02 * log.time_s) + noise
    kept = np.where(log.time_s >= ONSET_S, total[log.time_s >= ONSET_S][0], total)
    mach = channels_of(static, (kept if is_tube else total) - static, np.full(log.n_samples, 280.0))["mach"]
    channels = {
        name: replace(log.channels["tas"], name=name, unit=unit, values=frozen_array(values))
        for name, unit, values in (("p_static", "Pa", static), ("p_total", "Pa", kept), ("mach", "1", mach))
    }
    log = replace(log, channels={**log.channels, **channels})
    named = [finding.fault for finding in frozen_sensors(log, record_of(log), FLIGHT)]
    assert named == ([] if is_tube else ["p_total"])


def test_a_rest_of_a_sensor_that_often_rests_is_not_frozen():
    log = lively()
    values = np.round(log.channels["tas"].values + np.repeat(np.arange(log.n_samples // 50 + 1), 50)[: log.n_samples])
    log = held(with_values(log, "tas", values), "tas", until_s=ONSET_S + 25.0)
    assert frozen_sensors(log, record_of(log), FLIGHT) == ()


@pytest.mark.parametrize(("lasts_s", "names"), [(46.0, ["tas"]), (38.0, [])])
def test_a_rest_of_five_times_the_usual_is_frozen(lasts_s: float, names: list[str]):
    """Of a sensor that is renewed every eight seconds."""
    log = lively()
    renewed = np.repeat(log.channels["tas"].values[:: round(8.0 * RATE_HZ)], round(8.0 * RATE_HZ))
    log = held(with_values(log, "tas", renewed[: log.n_samples].copy()), "tas", until_s=ONSET_S + lasts_s)
    assert [finding.fault for finding in frozen_sensors(log, record_of(log), FLIGHT)] == names
