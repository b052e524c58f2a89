"""Phases: the same for every aircraft but for scale, parts that never overlap, and the flights as they were flown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.flightlog import Channel, FlightLog, read_log
from bfi_cli.flightlog.phases import (
    HOVER,
    MANOEUVRES,
    NO_AIRSPEED,
    PARTS,
    TRANSITION,
    Phase,
    airborne_stretches,
    find_phases,
    note_on_rotors,
    phases_of,
)
from bfi_cli.flightlog.record import frozen_array

G = 9.8
UNITS = {"cas": "m/s", "altitude": "m", "altitude_rate": "m/s", "normal_acc": "m/s^2", "gear": "1"}
# Times in V / g, speeds in V, heights in V^2 / g: at rest, take-off, climb, cruise, descent, landing, at rest.
KNOTS = [0.0, 60.0, 63.0, 90.0, 200.0, 240.0, 246.0, 330.0]
SPEEDS = [0.0, 0.0, 0.65, 1.0, 1.0, 0.7, 0.0, 0.0]
HEIGHT_KNOTS, HEIGHTS = [0.0, 64.0, 100.0, 180.0, 240.0, 330.0], [0.0, 0.0, 3.0, 3.0, 0.0, 0.0]


HOLLOW = 0.0, 700.0, 700.0, 400.0, 400.0, 700.0, 700.0, 0.0  # m of a flight that descends, and climbs again


def log_of(time_s: np.ndarray, channels: Mapping[str, np.ndarray]) -> FlightLog:
    made = {
        name: Channel(name=name, values=frozen_array(values), unit=UNITS.get(name, "rad"), source=name)
        for name, values in channels.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=made)


def flight(speed: float, *, rate_hz: float = 5.0) -> dict[str, np.ndarray]:
    """Return the signals of a flight at a cruising speed, m/s, `time` among them."""
    time_s = np.arange(0.0, 330.0 * speed / G, 1.0 / rate_hz)
    own = time_s * G / speed
    height = speed**2 / G * np.interp(own, HEIGHT_KNOTS, HEIGHTS)
    return {
        "time": time_s,
        "cas": speed * np.interp(own, KNOTS, SPEEDS),
        "altitude": 100.0 + height,
        "pitch": np.zeros(time_s.size),
        "roll": np.zeros(time_s.size),
        "aoa": np.full(time_s.size, 0.05),
        "normal_acc": np.zeros(time_s.size),
    }


def phases(signals: Mapping[str, np.ndarray], *names: str) -> tuple[Phase, ...]:
    chosen = names or tuple(name for name in signals if name != "time")
    return phases_of(log_of(signals["time"], {name: signals[name] for name in chosen}))


def named(found: tuple[Phase, ...], name: str) -> list[tuple[float, float]]:
    return [(one.from_s, one.to_s) for one in found if one.phase == name]


def cruising(duration_s: float = 600.0, *, speed: float = 100.0, rate_hz: float = 5.0) -> dict[str, np.ndarray]:
    """Return the signals of straight and level flight."""
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    level = np.zeros(time_s.size)
    return {
        "time": time_s,
        "cas": level + speed,
        "altitude": level + 3000.0,
        "pitch": level + 0.05,
        "roll": level.copy(),
        "aoa": level + 0.05,
        "normal_acc": level.copy(),
    }


# Speeds at which no limit in feet is the lesser one, so that all scales with V.
@pytest.mark.parametrize("speed", [15.0, 25.0, 45.0])
def test_an_aircraft_of_another_size_flies_the_same_phases_in_its_own_units(speed: float) -> None:
    own, other = phases(flight(30.0, rate_hz=20.0)), phases(flight(speed, rate_hz=20.0))
    assert [one.phase for one in own] == [one.phase for one in other]
    # The airspeed is smoothed over five seconds, whatever the aircraft: up to 3 V / g of the slowest.
    for one, same in zip(own, other, strict=True):
        assert one.from_s / 30.0 * G == pytest.approx(same.from_s / speed * G, abs=3.0)


@pytest.mark.parametrize("speed", [13.0, 50.0, 100.0, 230.0])
def test_a_whole_flight(speed: float) -> None:
    found = phases(flight(speed))
    scale_s = speed / G
    assert [one.phase for one in found] == [
        *("ground", "take-off", "climb", "cruise", "descent", "approach", "landing", "ground"),
    ]
    _, _, climb, cruise, descent, approach, landing, _ = found
    assert climb.to_s == pytest.approx(100.0 * scale_s, abs=2.5 * scale_s)
    assert cruise.to_s == pytest.approx(180.0 * scale_s, abs=2.5 * scale_s)
    # The descent is 3 V^2 / g in 60 V / g; the approach begins V^2 / g or 305 m above the field.
    share = min(1.0, 305.0 / (speed**2 / G)) / 3.0
    assert descent.to_s == approach.from_s == pytest.approx((240.0 - 60.0 * share) * scale_s, abs=scale_s)
    assert landing.from_s == pytest.approx(240.0 * scale_s, abs=2.0 * scale_s)


def test_the_sampling_rate_does_not_matter() -> None:
    """To a few samples of the slower log."""
    fast, slow = phases(flight(60.0, rate_hz=50.0)), phases(flight(60.0, rate_hz=1.0))
    assert [one.phase for one in fast] == [one.phase for one in slow]
    assert [one.from_s for one in fast] == pytest.approx([one.from_s for one in slow], abs=4.0)


def test_the_rate_of_the_altitude_says_what_the_altitude_says() -> None:
    signals = flight(80.0)
    signals["altitude_rate"] = np.gradient(signals["altitude"], signals["time"])
    by_height, by_rate = phases(signals, "cas", "altitude"), phases(signals, "cas", "altitude_rate")
    assert [one.phase for one in by_height] == [one.phase for one in by_rate]
    assert [one.from_s for one in by_height] == pytest.approx([one.from_s for one in by_rate], abs=2.0)


def test_attitude_and_incidence_say_what_the_altitude_says() -> None:
    signals = flight(80.0)
    rate = np.gradient(signals["altitude"], signals["time"])
    signals["pitch"] = signals["aoa"] + np.arcsin(rate / np.maximum(signals["cas"], 40.0))
    names = [one.phase for one in phases(signals, "cas", "pitch", "aoa")]
    assert names == [one.phase for one in phases(signals, "cas", "altitude")]


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(2, 400),
    rate_hz=st.sampled_from([0.2, 1.0, 25.0]),
    speed=st.sampled_from([0.0, 12.0, 60.0, 300.0]),
    names=st.sets(
        st.sampled_from(["altitude", "altitude_rate", "pitch", "roll", "aoa", "normal_acc", "gear", "flaps"])
    ),
)
def test_parts_follow_each_other_over_the_whole_log_whatever_it_holds(
    seed: int, size: int, rate_hz: float, speed: float, names: set[str]
) -> None:
    rng = np.random.default_rng(seed)
    time_s = 7.0 + np.arange(size) / rate_hz
    walk = np.cumsum(rng.normal(size=(size, len(names))), axis=0) * 10.0 ** rng.integers(-2, 3, size=len(names))
    cas = np.abs(speed * (1.0 + 0.1 * np.cumsum(rng.normal(size=size))))
    walk[rng.random(walk.shape) < 0.05] = np.nan
    log = log_of(time_s, {"cas": cas, **dict(zip(sorted(names), walk.T, strict=True))})
    found = phases_of(log)
    parts = [one for one in found if one.phase in PARTS]
    assert {one.phase for one in found} <= {*PARTS, *MANOEUVRES}
    assert list(found) == sorted(found, key=lambda one: one.from_s)
    assert all(one.from_s < one.to_s for one in found)
    ends = [one.to_s for one in parts]
    assert [one.from_s for one in parts] == [time_s[0], *ends[:-1]]
    assert ends[-1] == pytest.approx(time_s[-1] + 1.0 / rate_hz, abs=1e-3)


def test_a_log_is_not_changed() -> None:
    signals = flight(50.0)
    before = {name: values.copy() for name, values in signals.items()}
    phases(signals)
    assert all(np.array_equal(before[name], values) for name, values in signals.items())


def test_without_an_airspeed_nothing_is_said() -> None:
    assert phases(flight(50.0), "altitude", "pitch", "roll") == ()


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_log_on_the_ground_is_ground(noise: float) -> None:
    time_s = np.arange(0.0, 100.0, 0.1)
    cas = noise * np.random.default_rng(0).normal(size=time_s.size)
    assert [(one.phase, one.from_s, one.to_s) for one in phases({"time": time_s, "cas": cas})] == [
        ("ground", 0.0, 100.0)
    ]


def test_without_an_altitude_a_flight_is_a_flight() -> None:
    found = phases(flight(50.0), "cas")
    assert [one.phase for one in found] == ["ground", "take-off", "flight", "landing", "ground"]


def test_where_the_airspeed_is_lost_there_is_no_phase() -> None:
    signals = cruising()
    signals["cas"][1000:1500] = np.nan
    assert named(phases(signals), "cruise") == [
        (0.0, pytest.approx(200.0, abs=1.1)),
        (pytest.approx(300.0, abs=1.1), 600.0),
    ]


def test_a_window_in_flight_knows_no_ground() -> None:
    log = log_of(flight(60.0)["time"], {name: v for name, v in flight(60.0).items() if name != "time"})
    inside = phases_of(log.window(700.0, 900.0))
    assert {one.phase for one in inside} == {"cruise"}


def test_a_phugoid_is_no_climb() -> None:
    """Speed and height are exchanged: V^2 / 2 + g h stays, period pi sqrt(2) V / g."""
    signals = cruising(speed=90.0)
    swing = 10.0 * np.sin(2 * np.pi * signals["time"] / (np.pi * np.sqrt(2.0) * 90.0 / G))
    signals["cas"] = signals["cas"] + swing
    signals["altitude"] = signals["altitude"] - (signals["cas"] ** 2 - 90.0**2) / (2 * G)
    assert [one.phase for one in phases(signals)] == ["cruise"]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("seconds", "turns"), [(60.0, 1), (4.0, 0)])
def test_a_turn_changes_the_heading(side: float, seconds: float, turns: int) -> None:
    """At 30 degrees and 100 m/s by 3.2 degrees per second."""
    signals = cruising()
    signals["roll"][(signals["time"] >= 100.0) & (signals["time"] < 100.0 + seconds)] = side * np.radians(30.0)
    found = named(phases(signals), "turn")
    assert found == [(pytest.approx(100.0, abs=4.0), pytest.approx(100.0 + seconds, abs=4.0))] * turns


def parabola(signals: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the signals with a pull-up at 295 s, 20 s without weight and a pull-out, as for passengers."""
    t, load = signals["time"], np.ones(signals["time"].size)
    load[(t >= 290.0) & (t < 300.0)] = load[(t >= 320.0) & (t < 330.0)] = 1.8
    load[(t >= 300.0) & (t < 320.0)] = 0.0
    return {**signals, "normal_acc": G * (load - 1.0)}


def test_a_parabola_shows_in_the_load() -> None:
    signals = parabola(cruising())
    assert named(phases(signals), "parabola") == [(pytest.approx(290.0, abs=4.0), pytest.approx(330.0, abs=4.0))]


def test_a_parabola_shows_in_the_pitch() -> None:
    signals = cruising()
    signals["pitch"] = np.interp(signals["time"], [290.0, 300.0, 320.0, 330.0], [0.05, 0.9, -0.8, 0.05])
    ((from_s, to_s),) = named(phases(signals, "cas", "altitude", "pitch"), "parabola")
    assert 290.0 < from_s < 297.0
    assert 323.0 < to_s < 330.0


def stalled(signals: dict[str, np.ndarray], *, drop: float) -> dict[str, np.ndarray]:
    """Return the signals slowed to 15 degrees of incidence at 300 s, where the nose falls by `drop`, rad."""
    knots = [200.0, 280.0, 300.0, 304.0, 330.0]
    incidence = np.interp(signals["time"], knots, [0.05, 0.2, np.radians(15.0), 0.1, 0.05])
    pitch = incidence.copy()
    fallen = (signals["time"] > 300.0) & (signals["time"] < 330.0)
    pitch[fallen] = np.interp(signals["time"][fallen], knots[2:], [np.radians(15.0), np.radians(15.0) - drop, 0.05])
    if drop == 0.0:
        held = signals["time"] > 300.0
        incidence[held] = pitch[held] = np.radians(15.0)
    speed = np.interp(signals["time"], knots, [100.0, 60.0, 50.0, 55.0, 100.0])
    return {**signals, "aoa": incidence, "pitch": pitch, "cas": speed if drop else np.minimum(speed, 100.0)}


@pytest.mark.parametrize("channels", [("aoa", "pitch", "altitude"), ("pitch", "altitude")])
def test_in_a_stall_the_nose_falls(channels: tuple[str, ...]) -> None:
    """The angle of attack is recorded, or what pitch and path leave."""
    ((from_s, to_s),) = named(phases(stalled(cruising(), drop=0.3), "cas", *channels), "stall")
    assert 280.0 < from_s < 300.0 < to_s < 330.0


def test_slow_flight_is_no_stall_and_no_ground() -> None:
    found = phases(stalled(cruising(1200.0), drop=0.0))
    assert {one.phase for one in found} == {"cruise"}


def test_an_airspeed_of_zero_on_high_is_no_ground() -> None:
    """A pitot tube shows nothing in a deep stall; the altitude tells it from a landing."""
    signals = flight(50.0)
    high = (signals["time"] > 700.0) & (signals["time"] < 730.0)
    signals["cas"][high] = 0.0
    assert len(named(phases(signals), "ground")) == 2
    assert len(named(phases(signals, "cas"), "ground")) == 3


def test_two_circuits_have_two_landings() -> None:
    once = flight(50.0)
    twice = {name: np.concatenate([values, values]) for name, values in once.items()}
    twice["time"] = np.arange(twice["time"].size) / 5.0
    found = phases(twice)
    assert [len(named(found, name)) for name in ("take-off", "approach", "landing")] == [2, 2, 2]


def test_a_static_line_blocked_low_over_a_field_is_no_landing_where_satellites_see_flight() -> None:
    """Airspeed and altitude rest together, as on the ground: they share the line."""
    signals = flight(50.0)
    own, low = signals["time"] * G / 50.0, 105.0
    dip = np.interp(own, [90.0, 130.0, 140.0, 150.0, 190.0], [900.0, 400.0, low, 400.0, 900.0])
    signals["gps_altitude"] = np.fmin(signals["altitude"], dip)
    signals["ground_speed"] = signals["cas"].copy()
    blocked = (own > 140.0) & (own < 165.0)
    signals["altitude"] = np.where(blocked, low, signals["gps_altitude"])
    signals["cas"] = np.where(blocked, 0.0, signals["cas"])
    kept = {name: values for name, values in signals.items() if name != "normal_acc"}
    assert len(named(phases(kept), "landing")) == 1
    assert len(named(phases(kept), NO_AIRSPEED)) == 1
    with_pressures = tuple(name for name in kept if name not in ("gps_altitude", "ground_speed", "time"))
    assert len(named(phases(kept, *with_pressures), "landing")) == 2


@pytest.mark.parametrize("channel", ["gear", "flaps"])
def test_an_approach_begins_where_gear_or_flaps_come_out_for_good(channel: str) -> None:
    signals = flight(50.0)
    own = signals["time"] * G / 50.0
    signals[channel] = np.where((own < 66.0) | (own > 205.0), 1.0, 0.0)
    assert named(phases(signals), "approach")[0][0] == pytest.approx(205.0 * 50.0 / G, abs=1.0)


def test_a_suspect_is_not_used() -> None:
    signals = parabola(cruising())
    log = log_of(signals["time"], {name: values for name, values in signals.items() if name != "time"})
    assert named(phases_of(log, suspects=["normal_acc"]), "parabola") == []
    assert [one.phase for one in phases_of(log, suspects=["altitude", "pitch", "normal_acc"])] == ["flight"]


def share(found: list[tuple[float, float]], start_s: float, stop_s: float) -> float:
    """Return how much of a stretch the found ones cover."""
    return sum(max(0.0, min(b, stop_s) - max(a, start_s)) for a, b in found) / (stop_s - start_s)


@pytest.mark.realdata
def test_the_segments_of_a_recorded_flight(flights: Path) -> None:
    log = read_log(flights / "citation_20190312_123416.h5")
    found, segments = phases_of(log), {one.label: one for one in log.segments}
    ((from_s, to_s),) = named(found, "parabola")
    assert (from_s, to_s) == (
        pytest.approx(segments["parabola_0g"].start_s, abs=10.0),
        pytest.approx(segments["parabola_0g"].stop_s, abs=10.0),
    )
    ((from_s, to_s),) = named(found, "stall")
    assert segments["stall_approach_and_manual"].start_s < from_s < to_s < segments["stall_approach_and_manual"].stop_s
    assert share(named(found, "cruise"), segments["phugoid"].start_s, segments["phugoid"].stop_s) == 1.0
    assert [len(named(found, name)) for name in ("take-off", "approach", "landing", "ground")] == [1, 1, 1, 2]


@pytest.mark.realdata
def test_a_recorded_flight_that_ends_in_the_air(flights: Path) -> None:
    log = read_log(flights / "citation_20180312_f1.h5")
    found, segments = phases_of(log), {one.label: one for one in log.segments}
    assert [len(named(found, name)) for name in ("take-off", "approach", "landing", "ground")] == [1, 0, 0, 1]
    for label in ("quiet_autopilot", "phugoid"):
        assert share(named(found, "cruise"), segments[label].start_s, segments[label].stop_s) == 1.0


@pytest.mark.realdata
def test_the_flight_of_a_training_aircraft(flights: Path) -> None:
    """Three practised stalls, the last down to an airspeed of zero, and two circuits after the first landing."""
    found = phases_of(read_log(flights / "reader_samples" / "g1000_c172.csv"))
    assert [len(named(found, name)) for name in ("stall", "landing", "take-off")] == [3, 3, 3]
    assert all(50_500.0 < from_s < 50_850.0 for from_s, _ in named(found, "stall"))


@pytest.mark.realdata
def test_the_flight_of_a_drone(flights: Path) -> None:
    found = phases_of(read_log(flights / "px4_flight3"))
    names = [one.phase for one in found if one.phase in PARTS]
    assert (names[:3], names[-3:]) == (["ground", "take-off", "climb"], ["approach", "landing", "ground"])
    assert named(found, "take-off")[0][1] == pytest.approx(1118.5, abs=2.0)


@pytest.mark.parametrize("value", [1e31, 1e200, np.finfo(float).max, np.inf])
def test_what_no_instrument_shows_is_as_good_as_missing(value: float) -> None:
    signals = flight(50.0)
    time_s = signals.pop("time")
    for name in signals:
        damaged = {**signals, name: np.where(time_s == time_s[700], value, signals[name])}
        missing = {**signals, name: np.where(time_s == time_s[700], np.nan, signals[name])}
        assert phases_of(log_of(time_s, damaged)) == phases_of(log_of(time_s, missing))
        assert isinstance(phases_of(log_of(time_s, {**signals, name: np.full(time_s.shape, value)})), tuple)


def computed(speed: float = 100.0) -> dict[str, np.ndarray]:
    """Return the signals of a flight of an aircraft with an air-data computer, its ground speed and engines."""
    signals = flight(speed, rate_hz=2.0)
    swaying = np.where(signals["cas"] > 0.6 * speed, np.sin(0.3 * signals["time"]), 0.01)
    return {
        **signals,
        "tas": 1.1 * signals["cas"],
        "mach": signals["cas"] / 340.0,
        "roll": 0.05 * swaying,
        "ground_speed": 1.05 * signals["cas"],
        "n1_left": np.where(signals["cas"] > 0.5 * speed, 80.0, 30.0),
    }


def in_all(signals: Mapping[str, np.ndarray]) -> FlightLog:
    return log_of(signals["time"], {name: values for name, values in signals.items() if name != "time"})


# V / g is 10.2 s: a climb to 1020 s, cruise to 1837 s, touch-down at 2449 s.
@pytest.mark.parametrize("wrong", ["cas", "tas", "mach"])
@pytest.mark.parametrize("share", [0.2, 0.0, np.nan])
def test_no_airspeed_alone_decides_whether_the_aircraft_flies(wrong: str, share: float) -> None:
    """One that fails in cruise to the end of the log changes no phase, and is told where it says something."""
    signals = computed()
    healthy, without = find_phases(in_all(signals))
    assert without == ()
    signals[wrong] = np.where(signals["time"] > 1500.0, share, 1.0) * signals[wrong]
    phases, disagreements = find_phases(in_all(signals))
    assert [one.phase for one in phases] == [one.phase for one in healthy]
    # The smoothing of an airspeed, and what is a little before the end of another.
    assert [one.from_s for one in phases] == pytest.approx([one.from_s for one in healthy], abs=15.0)
    if np.isnan(share):
        assert disagreements == ()
        return
    (one,) = disagreements
    assert (one.channel, one.says, one.alone, one.certain) == (wrong, "ground", True, True)
    assert one.from_s == pytest.approx(1500.0, abs=4.0)
    right = {"cas": 100.0, "tas": 110.0, "mach": 100.0 / 340.0}[wrong]
    assert one.error == pytest.approx((share - 1.0) * right, rel=0.05)


def test_an_airspeed_that_stays_after_the_landing_is_told() -> None:
    signals = computed()
    signals["cas"] = np.maximum(signals["cas"], np.where(signals["time"] > 1500.0, 90.0, 0.0))
    phases, disagreements = find_phases(in_all(signals))
    assert [one.phase for one in phases][-3:] == ["approach", "landing", "ground"]
    assert [(one.channel, one.says) for one in disagreements] == [("cas", "flight")]


def test_what_passes_over_the_ground_at_the_speed_of_flight_has_not_landed() -> None:
    """A tube that is blocked high reads nothing in the descent; two heights say how low that is, and no more."""
    signals = flight(50.0)
    own = signals["time"] * G / 50.0
    signals["altitude"] = 100.0 + np.interp(own, [64.0, 100.0, 120.0, 130.0, 155.0, 165.0, 190.0, 240.0], [*HOLLOW])
    signals["gps_altitude"] = signals["altitude"].copy()
    signals["ground_speed"] = signals["cas"] + np.sin(own)
    signals["cas"] = np.where((own > 130.0) & (own < 155.0), 0.0, signals["cas"])
    signals["tas"] = signals["cas"].copy()
    assert len(named(phases(signals), "landing")) == 1
    assert len(named(phases(signals), NO_AIRSPEED)) == 1
    frozen = {**signals, "ground_speed": np.full(own.size, 50.0)}
    assert len(named(phases(frozen), "landing")) == 2


@pytest.mark.parametrize("lacks", [(), ("altitude",), ("ground_speed", "n1_left")])
@pytest.mark.parametrize("share", [0.05, np.nan])
def test_where_every_airspeed_fails_the_aircraft_still_flies(lacks: tuple[str, ...], share: float) -> None:
    signals = {name: values for name, values in computed().items() if name not in lacks}
    for name in ("cas", "tas", "mach"):
        signals[name] = np.where(np.abs(signals["time"] - 1400.0) < 150.0, share, 1.0) * signals[name]
    phases, disagreements = find_phases(in_all(signals))
    (lost,) = named(phases, NO_AIRSPEED)
    assert lost == (pytest.approx(1250.0, abs=6.0), pytest.approx(1550.0, abs=6.0))
    assert len(named(phases, "landing")) == 1
    told = {one.channel for one in disagreements if one.certain and not one.alone}
    assert told == (set() if np.isnan(share) else {"cas", "tas", "mach"})


@pytest.mark.parametrize("seconds", [2.0, 20.0])
def test_a_short_loss_of_airspeed_on_high_is_a_stall_and_no_failure(seconds: float) -> None:
    signals = computed()
    for name in ("cas", "tas", "mach"):
        signals[name] = np.where(np.abs(signals["time"] - 1400.0) < 0.5 * seconds, 0.0, 1.0) * signals[name]
    phases, disagreements = find_phases(in_all(signals))
    assert disagreements == ()
    assert len(named(phases, "ground")) == 2


@pytest.mark.parametrize(("name", "factor"), [("tas", 1.0), ("mach", 1.0 / 340.0)])
def test_an_approach_is_no_ground_for_an_airspeed_that_grows_with_altitude(name: str, factor: float) -> None:
    """An airliner at 250 m/s in 11 km and at 70 m/s on approach: less than a third, at the same lift."""
    time_s = np.arange(0.0, 3600.0, 1.0)
    altitude = np.interp(time_s, [0.0, 2000.0, 3600.0], [11_000.0, 11_000.0, 300.0])
    speed = factor * np.interp(time_s, [0.0, 2000.0, 3600.0], [250.0, 250.0, 70.0])
    found = phases_of(log_of(time_s, {name: speed, "altitude": altitude}))
    assert {one.phase for one in found} == {"cruise", "descent"}
    assert airborne_stretches(log_of(time_s, {name: speed, "altitude": altitude})) == [(0.0, 3600.0)]


@settings(max_examples=15)
@given(
    start=st.floats(640.0, 2200.0),
    length=st.floats(20.0, 600.0),
    lacks=st.sets(st.sampled_from(["tas", "mach", "ground_speed", "n1_left", "altitude"])),
)
def test_any_part_that_begins_and_ends_in_the_air_is_in_flight(start: float, length: float, lacks: set[str]) -> None:
    signals = {name: values for name, values in computed().items() if name not in lacks}
    part = in_all(signals).window(start, min(start + length, 2400.0))
    stretch = (float(part.time_s[0]), pytest.approx(float(part.time_s[-1]) + 0.5))
    assert airborne_stretches(part) == [stretch]


@pytest.mark.realdata
def test_a_step_of_an_airspeed_changes_no_phase_of_a_recorded_flight(flights: Path) -> None:
    log = read_log(flights / "citation_20180312_f1.h5")
    stepped = np.where(log.time_s > 1500.0, -60.0, 0.0) + log.channels["cas"].values
    off = replace(log, channels={**log.channels, "cas": replace(log.channels["cas"], values=frozen_array(stepped))})
    assert find_phases(log)[1] == ()
    _, disagreements = find_phases(off)
    assert airborne_stretches(off) == [pytest.approx(stretch, abs=2.0) for stretch in airborne_stretches(log)]
    (one,) = disagreements
    assert (one.channel, one.says, one.alone) == ("cas", "ground", True)
    assert one.from_s == pytest.approx(1500.0, abs=2.0)
    assert one.error == pytest.approx(-60.0, abs=4.0)


def test_a_slow_approach_is_flight_by_every_airspeed() -> None:
    """Of two airspeeds of one approach one lies above and one below three fifths of what it is in cruise."""
    signals, speed = flight(100.0), 100.0
    units = signals["time"] * G / speed
    signals["cas"] = speed * np.interp(
        units, [0.0, 60.0, 63.0, 90.0, 228.0, 233.0, 240.0, 246.0], [*SPEEDS[:5], 0.61, 0.61, 0.0]
    )
    signals["ias"] = signals["cas"] * np.interp(units, [200.0, 228.0], [1.05, 1.0])
    signals["altitude"] = 100.0 + speed**2 / G * np.interp(
        units, [64.0, 100.0, 180.0, 233.0, 240.0], [0.0, 3.0, 3.0, 0.15, 0.0]
    )
    phases, disagreements = find_phases(
        log_of(signals["time"], {name: signals[name] for name in ("cas", "ias", "altitude")})
    )
    assert disagreements == ()
    ((landed_s, _),) = named(phases, "landing")
    assert landed_s == pytest.approx(240.0 * speed / G, abs=30.0)


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name", ["citation_20190312_123416.h5", "px4_flight3", "reader_samples/g1000_c172.csv", "sr22t_220417_135002.h5"]
)
def test_no_airspeed_of_a_healthy_flight_disagrees(flights: Path, name: str) -> None:
    assert find_phases(read_log(flights / name))[1] == ()


@pytest.mark.realdata
def test_the_landing_of_a_flight_without_airspeed_in_its_middle_is_a_landing(flights: Path) -> None:
    """What is left is faster in the mean, so that the approach is slow: the part at rest tells whether it landed."""
    log = read_log(flights / "citation_20190312_123416.h5")
    lost = (log.time_s >= 1500.0) & (log.time_s < 4000.0)
    gone = {name: np.where(lost, np.nan, log.channels[name].values) for name in ("tas", "cas", "mach", "latitude")}
    channels = {name: replace(log.channels[name], values=frozen_array(values)) for name, values in gone.items()}
    phases, disagreements = find_phases(replace(log, channels={**log.channels, **channels}))
    assert not disagreements
    assert [one.phase for one in phases][-2:] == ["landing", "ground"]


def test_a_clock_that_jumps_by_years_is_no_flight():
    time_s = np.arange(300) / 10.0
    time_s[-1] = 1e9
    channel = Channel(name="tas", values=frozen_array(100.0 + np.sin(time_s)), unit="m/s", source="tas")
    assert phases_of(FlightLog(path="made", time_s=frozen_array(time_s), channels={"tas": channel})) == ()


def test_a_hover_is_no_flight_on_the_wing_and_accuses_no_airspeed():
    """A VTOL climbs and lands on its rotors: the wing's flight between is what is analysed."""
    signals = cruising(600.0, speed=20.0)
    t = signals["time"]
    on_wing = (t >= 130.0) & (t < 430.0)
    signals["cas"] = np.where(on_wing, signals["cas"], 1.0)
    signals["altitude"] = np.interp(t, [0.0, 30.0, 60.0, 500.0, 530.0, 600.0], [0.0, 0.0, 60.0, 60.0, 0.0, 0.0])
    hover = np.where((t >= 120.0) & (t < 440.0), np.where(on_wing, 0.0, 0.5), 1.0)
    log = log_of(t, {name: signals[name] for name in ("cas", "altitude", "pitch", "roll")} | {"hover": hover})
    phases, disagreements = find_phases(log)
    assert [one.phase for one in phases] == ["ground", HOVER, TRANSITION, "cruise", TRANSITION, HOVER, "ground"]
    assert disagreements == ()
    assert airborne_stretches(log) == [(130.0, pytest.approx(430.0, abs=0.5))]
    (note,) = note_on_rotors(phases)
    assert note.text.startswith("hover and transition, 196 s in all, the longest 32")
