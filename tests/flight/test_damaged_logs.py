"""Flights of which channels are missing, frozen, full of gaps or impossible: an answer that says so, never a crash."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bfi_cli.config import Config
from bfi_cli.errors import LogError
from bfi_cli.flight import DiagnoseResult, diagnose_flight
from bfi_cli.flightlog import FlightLog, write_log
from bfi_cli.flightlog.record import frozen_array

CONFIG = Config.model_validate({"window": {"from_s": 400.0, "to_s": 560.0}})
AIRSPEEDS = ("tas", "cas", "mach")
GROUND = ("velocity_north", "velocity_east")
# By channel that is missing, what the answer says of it.
COSTS = {
    "altitude": "no p_static or altitude: the lift does not bound the airspeed",
    "tas": "the computation of tas is not checked: the log lacks tas",
    "cas": "mach, cas and altitude are not compared: the log lacks cas",
    "mach": "mach, cas and altitude are not compared: the log lacks mach",
    "aoa": "no aoa: the climb angle does not bound pitch and angle of attack",
    "pitch": "no pitch: the climb angle does not bound pitch and angle of attack",
    "roll": "no roll: the inertial acceleration does not bound the airspeed",
    "normal_acc": "no normal_acc: the lift does not bound the airspeed and the angle of attack",
    "longitudinal_acc": "no longitudinal_acc: the inertial acceleration does not bound the airspeed",
    "velocity_north": "no velocity_north: the ground speed does not bound the airspeed",
    "velocity_east": "no velocity_east: the ground speed does not bound the airspeed",
    "elevator": "no elevator: windows of 120 s were not scanned for steps and oscillations",
}
# These have others that stand for them.
REPLACED = ("altitude_rate", "tat", "sat")


def diagnosed(log: FlightLog) -> DiagnoseResult:
    return diagnose_flight(log, CONFIG)


def lacking(log: FlightLog, *names: str) -> FlightLog:
    return replace(log, channels={name: one for name, one in log.channels.items() if name not in ("elevator", *names)})


def altered(log: FlightLog, names: tuple[str, ...], value: float, from_s: float, to_s: float) -> FlightLog:
    """Return a log, without its elevator, with one value in some channels between two times."""
    inside = (log.time_s >= from_s) & (log.time_s < to_s)
    changed = {
        name: replace(log.channels[name], values=frozen_array(np.where(inside, value, log.channels[name].values)))
        for name in names
    }
    return lacking(replace(log, channels={**log.channels, **changed}))


@pytest.fixture(scope="module")
def cruise(journey: FlightLog) -> FlightLog:
    """Return the cruise of the journey alone, of which less is read."""
    return journey.window(320.0, 640.0)


@pytest.fixture(scope="module")
def diagnosed_without(cruise: FlightLog) -> Callable[[str], DiagnoseResult]:
    """Return what is said of the flight without a channel, each asked for once."""
    return cache(lambda name: diagnosed(lacking(cruise, name)))


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("name", [*COSTS, *REPLACED])
def test_what_a_missing_channel_costs(diagnosed_without: Callable[[str], DiagnoseResult], name: str):
    result = diagnosed_without(name)
    assert result.events == ()
    if name in COSTS:
        assert any(sentence.startswith(COSTS[name]) for sentence in result.missing), result.missing
    else:
        assert not any(name in sentence for sentence in result.missing)


def test_every_channel_has_a_row(journey: FlightLog):
    assert {*COSTS, *REPLACED} == journey.channels.keys()


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("name", [name for name in COSTS if name not in ("elevator", "tas", "cas", "mach")])
def test_a_frozen_channel_is_named_and_as_good_as_missing(
    cruise: FlightLog, diagnosed_without: Callable[[str], DiagnoseResult], name: str
):
    value = float(cruise.channels[name].values[400])
    frozen = diagnosed(altered(cruise, (name,), value, 0.0, np.inf))
    missing = diagnosed_without(name)
    said = f"'{name}' is not used: it holds one value through the whole log"
    assert frozen.missing[0] == said
    assert frozen.missing[1:] == missing.missing
    assert frozen.limits == missing.limits


@pytest.mark.slow
def test_a_channel_without_a_number_is_no_frozen_one(cruise: FlightLog):
    result = diagnosed(altered(cruise, ("aoa",), np.nan, 0.0, np.inf))
    assert result.missing[0] == "'aoa' is not used: it holds no number through the whole log"


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("names", "value", "from_s", "to_s"),
    [
        (GROUND, np.nan, 450.0, 500.0),
        (("aoa",), np.nan, 430.0, 480.0),
        (("tas",), np.nan, 450.0, 460.0),
        (("altitude",), np.nan, 430.0, 480.0),
        (("cas",), 400.0, 450.0, 451.0),
        (("mach",), 3.0, 450.0, 480.0),
        (("cas",), -50.0, 450.0, 480.0),
        (("altitude",), 1e5, 450.0, 451.0),
        (("altitude",), -2e4, 450.0, 480.0),
    ],
)
def test_gaps_and_impossible_values(
    cruise: FlightLog, names: tuple[str, ...], value: float, from_s: float, to_s: float
):
    result = diagnosed(altered(cruise, names, value, from_s, to_s))
    # Whatever is left of the flight is healthy: only a channel that is wrong may be named.
    assert {event.fault for event in result.events} <= {*names}
    assert result.windows


@pytest.mark.slow
def test_gps_that_comes_and_goes_is_not_used(cruise: FlightLog):
    log = lacking(cruise)
    gaps = np.floor(log.time_s / 7.0) % 2 == 0
    channels = {
        name: replace(log.channels[name], values=frozen_array(np.where(gaps, np.nan, log.channels[name].values)))
        for name in GROUND
    }
    result = diagnosed(replace(log, channels={**log.channels, **channels}))
    assert result.events == ()
    assert all("ground_speed" not in look.residuals for look in result.windows)


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("keep", [("tas",), ("mach",), ("tas", "altitude"), ("tas", *GROUND)])
def test_an_airspeed_that_nothing_bounds_is_said(cruise: FlightLog, keep: tuple[str, ...]):
    result = diagnosed(replace(cruise, channels={name: cruise.channels[name] for name in keep}))
    assert "no slow fault was looked for: nothing bounds the airspeed" in result.missing
    assert (result.decision, result.verdicts["slow"]) == ("inconclusive", "inconclusive")
    assert "a slow fault of any size could be there unseen" in result.summary


def test_relations_alone_do_not_clear_the_pitot_line(cruise: FlightLog):
    """Mach number, temperature and both airspeeds agree exactly, whatever ice does to the line they share."""
    names = ("tas", "cas", "mach", "altitude", "tat", "sat")
    result = diagnosed(replace(cruise, channels={name: cruise.channels[name] for name in names}))
    exact = [one for one in result.limits if one.shape == "drift" and one.fault in ("tas", "cas", "mach")]
    assert {(one.fault, one.bounds) for one in exact} == {(name, "disagreement") for name in ("tas", "cas", "mach")}
    assert all(one.within_tolerance for one in exact if not one.grows_on)
    assert result.unwatched == ((400.0, 560.0, "nothing bounds a slow fault of the pitot line that begins there"),)
    assert result.verdicts["slow"] == "inconclusive"
    assert "a slow fault of any size could be there unseen" in result.summary


def test_an_airspeed_that_the_attitude_bounds_less_than_its_relations_is_watched(cruise: FlightLog):
    names = ("tas", "cas", "altitude", "tat", "aoa", "pitch", "roll")
    result = diagnosed(replace(cruise, channels={name: cruise.channels[name] for name in names}))
    assert not any("cas" in why for _, _, why in result.unwatched)


@pytest.mark.slow
def test_one_airspeed_bounds_its_line_as_itself(cruise: FlightLog):
    names = ("tas", "altitude", "altitude_rate", *GROUND)
    result = diagnosed(replace(cruise, channels={name: cruise.channels[name] for name in names}))
    limits = {one.fault: one for one in result.limits if one.shape == "drift" and one.holds_in == 0.95}
    assert limits["pitot_icing"].effect == pytest.approx(limits["tas"].effect)
    # A relative loss of impact pressure is half as large, relative, in airspeed, here of about 105 m/s.
    assert limits["pitot_icing"].excluded_above == pytest.approx(2.0 * limits["tas"].excluded_above / 105.0, rel=0.1)


def thinned(log: FlightLog, step: int) -> FlightLog:
    channels = {name: replace(one, values=frozen_array(one.values[::step])) for name, one in log.channels.items()}
    return replace(log, time_s=frozen_array(log.time_s[::step]), channels=channels)


@pytest.mark.slow
@pytest.mark.parametrize("step", [10, 25])
def test_a_slow_log(cruise: FlightLog, step: int):
    result = diagnosed(lacking(thinned(cruise, step)))
    assert result.events == ()
    assert result.windows


@pytest.mark.parametrize(("from_s", "to_s"), [(400.0, 430.0), (400.0, 455.0), (0.0, 20.0)])
def test_a_log_without_a_minute_of_flight(journey: FlightLog, from_s: float, to_s: float):
    result = diagnose_flight(lacking(journey).window(from_s, to_s), Config())
    assert result.windows == ()
    assert "no slow fault was looked for: no 60 s of flight between take-off and landing" in result.missing
    assert result.decision == "inconclusive"


def change(**channels: float) -> Callable[[FlightLog], FlightLog]:
    def apply(log: FlightLog) -> FlightLog:
        for name, value in channels.items():
            log = altered(log, (name,), value, 0.0, np.inf)
        return log

    return apply


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda log: lacking(log, *AIRSPEEDS),
            "no airspeed and no impact pressure that changes; the log has: altitude,",
        ),
        (change(tas=0.0, cas=0.0, mach=0.0), "no airspeed and no impact pressure that changes"),
        (change(tas=np.nan, cas=np.nan, mach=np.nan), "no airspeed and no impact pressure that changes"),
    ],
)
def test_a_log_that_cannot_be_used(cruise: FlightLog, make: Callable[[FlightLog], FlightLog], said: str):
    with pytest.raises(LogError, match=said):
        diagnosed(make(cruise))


def test_a_log_of_the_ground(journey: FlightLog):
    """Taxiing, at a walk, with every channel there."""
    rng = np.random.default_rng(0)
    log = lacking(journey)
    slow = replace(log.channels["tas"], values=frozen_array(1.0 + 0.1 * rng.standard_normal(log.n_samples)))
    with pytest.raises(LogError, match="no part of the log is in flight between take-off and landing; give a log of"):
        diagnose_flight(lacking(replace(log, channels={**log.channels, "tas": slow}), "cas", "mach"), Config())


@pytest.fixture(scope="module")
def few(journey: FlightLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of two channels: what is refused is refused whatever else was recorded."""
    path = tmp_path_factory.mktemp("few") / "few.h5"
    write_log(replace(journey, channels={name: journey.channels[name] for name in ("altitude", "tas")}), path)
    return path


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (("--tolerance", "xyz=3"), 2, "--tolerance: 'xyz' is no channel, the log has: altitude"),
        (("--from", "5000"), 3, "no samples between 5000 s and"),
        (("--to", "-5"), 3, "the log runs from 0 s to 959.8 s; change --from/--to"),
        (("--from", "5", "--to", "4"), 2, "--from/--to: to_s must be after from_s (5 s), got 4 s"),
        (("--false-alarm", "0"), 2, "--false-alarm: must be greater than 0, got 0"),
        (("--workers", "0"), 2, "--workers: "),
        (("--calibration", "absent.json"), 2, "absent.json: cannot be read, no such file or directory; check the path"),
    ],
)
def test_options(bfi: Callable, few: Path, options: tuple[str, ...], code: int, said: str):
    outcome = bfi("diagnose", few, *options, "--json")
    assert (outcome.code, outcome.stdout) == (code, "")
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("time,tas\n", "not JSON"),
        ({"kind": "diagnose"}, "kind is 'diagnose', not 'calibration'; give a file of bfi calibrate"),
        ({"kind": "calibration", "schema": 1, "tables": []}, "holds no air data; run bfi calibrate again on flights"),
        ({"kind": "calibration", "air_data": {"zero_lift_rad": "x"}}, "air_data.zero_lift_rad: not a number, got 'x'"),
        ([], "not a mapping, got []"),
    ],
)
def test_calibrations(bfi: Callable, few: Path, tmp_path: Path, content: Any, said: str):
    path = tmp_path / "c.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    outcome = bfi("diagnose", few, "--calibration", path, "--json")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1
