"""Flights of JSBSim: signs and units against equations that nobody of theirs wrote, seeds, and what is refused."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli import library
from bfi_cli.aircraft import MODELS, STICK, Dryden, FlightPlan, deviations, find_model, simulate, time_axis
from bfi_cli.airdata import (
    G,
    altitude_of,
    calibrated_airspeed,
    kinematic_acceleration,
    mach_number,
    mach_of_tas,
    total_temperature,
)
from bfi_cli.commands import run_command
from bfi_cli.faults.ordinary import Making, Occurrence
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.jsbsim import flight, process
from bfi_cli.jsbsim.channels import FLOWN
from bfi_cli.jsbsim.ordinary import SIMULATED
from bfi_cli.quantities.channels import INPUTS, STANDARD

needs_jsbsim = pytest.mark.skipif(importlib.util.find_spec("jsbsim") is None, reason="the extra jsbsim")
RATE = 50.0
AIRCRAFT = ("c172p", pytest.param("f16", marks=pytest.mark.slow))


def flown(
    name: str, *, course: str = "3211", throttle: float = 0.1, duration_s: float = 20.0, seed: int = 0, **given: object
) -> FlightLog:
    plan = FlightPlan(**{key: given.pop(key) for key in ("tas_m_s", "altitude_m", "wind_m_s", "tour") if key in given})
    model = find_model(f"jsbsim:{name}", plan)
    time_s = time_axis(duration_s=duration_s, rate_hz=RATE)
    u = deviations(model, course, time_s, amplitude=STICK, start_s=2.0, step_s=1.0, throttle=throttle)
    return simulate(model, u, rng=np.random.default_rng(seed), rate_hz=RATE, **given)


def signals(log: FlightLog) -> dict[str, np.ndarray]:
    return {name: channel.values for name, channel in log.channels.items()}


def slope(values: np.ndarray) -> np.ndarray:
    return (values[2:] - values[:-2]) * RATE / 2.0


@pytest.fixture(scope="module", params=AIRCRAFT)
def log(request: pytest.FixtureRequest) -> FlightLog:
    pytest.importorskip("jsbsim")
    return flown(request.param)


def test_channels_are_standard_ones_in_si(log: FlightLog):
    assert {name: STANDARD[name].unit for name in log.channels} == {
        name: channel.unit for name, channel in log.channels.items()
    }
    assert set(INPUTS) & set(log.channels) == {"elevator", "aileron", "rudder", "throttle"}


def test_airspeeds_follow_from_pressures_and_temperature(log: FlightLog):
    """JSBSim's own constants of air differ in the fifth digit."""
    one = signals(log)
    q_impact = one["p_total"] - one["p_static"]
    np.testing.assert_allclose(one["cas"], calibrated_airspeed(q_impact), rtol=1e-3)
    np.testing.assert_allclose(one["mach"], mach_number(q_impact, one["p_static"]), rtol=1e-3)
    np.testing.assert_allclose(one["mach"], mach_of_tas(one["tas"], one["tat"]), rtol=1e-3)
    np.testing.assert_allclose(one["tat"], total_temperature(one["sat"], one["mach"]), rtol=1e-4)
    np.testing.assert_allclose(one["altitude"], altitude_of(one["p_static"]), rtol=0, atol=0.5)


def test_altitude_grows_by_its_rate(log: FlightLog):
    one = signals(log)
    # The pressure altitude is geopotential: (R / (R + h))^2 of the geometric one, 0.9995 here.
    np.testing.assert_allclose(slope(one["altitude"]), one["altitude_rate"][1:-1], rtol=2e-3, atol=0.02)


def test_level_flight_feels_no_upward_acceleration_beyond_gravity(log: FlightLog):
    one = signals(log)
    level = slice(0, int(1.5 * RATE))
    pitch = one["pitch"][level]
    # g cos(pitch) - g by the attitude, and 0.3 % of the earth's rotation and curvature.
    np.testing.assert_allclose(one["normal_acc"][level], G * (np.cos(pitch) - 1.0), rtol=0, atol=0.06)
    np.testing.assert_allclose(one["longitudinal_acc"][level], G * np.sin(pitch), rtol=0, atol=0.02)
    assert np.abs(one["lateral_acc"][level]).max() < 0.1


def test_accelerometers_give_the_rate_of_the_airspeed(log: FlightLog):
    one = signals(log)
    felt = kinematic_acceleration(*(one[n] for n in ("longitudinal_acc", "normal_acc", "aoa", "pitch", "roll")))
    # The jumps of the stick aside; 1 % of g is what the earth's rotation and the sideslip leave.
    error = slope(one["tas"]) - felt[1:-1]
    assert np.quantile(np.abs(error), 0.98) < 0.01 * G


def test_attitude_turns_by_the_rates(log: FlightLog):
    one = signals(log)
    turning = one["pitch_rate"] * np.cos(one["roll"]) - one["yaw_rate"] * np.sin(one["roll"])
    np.testing.assert_allclose(slope(one["pitch"]), turning[1:-1], rtol=0, atol=5e-3)


def test_a_positive_elevator_pitches_down(log: FlightLog):
    one = signals(log)
    before, during = int(1.8 * RATE), int(3.0 * RATE)
    assert one["elevator"][during] > one["elevator"][before]
    assert one["pitch_rate"][during] < -0.005


def test_ground_velocity_is_airspeed_in_calm_air(log: FlightLog):
    one = signals(log)
    over_ground = np.hypot(np.hypot(one["velocity_north"], one["velocity_east"]), one["altitude_rate"])
    np.testing.assert_allclose(over_ground, one["tas"], rtol=1e-4)


@pytest.mark.slow
@needs_jsbsim
def test_a_steady_wind_adds_to_the_ground_velocity_alone():
    calm, windy = (signals(flown("c172p", duration_s=5.0, wind_m_s=wind)) for wind in ((0.0, 0.0), (7.0, -3.0)))
    np.testing.assert_allclose(windy["velocity_north"] - calm["velocity_north"], 7.0, rtol=1e-12)
    np.testing.assert_allclose(windy["velocity_east"] - calm["velocity_east"], -3.0, rtol=1e-12)
    np.testing.assert_array_equal(windy["tas"], calm["tas"])


@pytest.mark.slow
@needs_jsbsim
def test_the_flight_begins_where_it_is_asked_to():
    log = flown("737", duration_s=2.0, tas_m_s=200.0, altitude_m=8000.0)
    assert log.channel("tas").values[0] == pytest.approx(200.0, rel=2e-3)
    assert log.channel("altitude").values[0] == pytest.approx(8000.0, abs=15.0)


@pytest.mark.slow
@needs_jsbsim
def test_the_same_seed_gives_the_same_log_and_another_one_other_gusts():
    given = {"turbulence": Dryden(sigma_m_s=1.0), "noise_sd": {"tas": 0.1}, "duration_s": 4.0}
    one, same, other = (signals(flown("c172p", seed=seed, **given)) for seed in (1, 1, 2))
    for name, values in one.items():
        np.testing.assert_array_equal(values, same[name])
    assert np.ptp(one["aoa"] - other["aoa"]) > 0.01


@pytest.mark.slow
@needs_jsbsim
def test_noise_leaves_the_flight_as_it_is():
    clean, noisy = (signals(flown("c172p", duration_s=4.0, noise_sd={"tas": sd})) for sd in (0.0, 0.1))
    assert np.std(noisy["tas"] - clean["tas"]) == pytest.approx(0.1, rel=0.2)
    for name in set(clean) - {"tas"}:
        np.testing.assert_array_equal(noisy[name], clean[name])


@pytest.mark.slow
@needs_jsbsim
def test_gusts_have_their_intensity():
    """The airspeed less the motion over the ground along the heading is the gust, with the sign of a headwind."""
    one = signals(flown("737", course="none", throttle=0.0, duration_s=90.0, turbulence=Dryden(sigma_m_s=0.5)))
    along = one["velocity_north"] * np.cos(one["yaw"]) + one["velocity_east"] * np.sin(one["yaw"])
    # 90 s are 14 scale lengths over twice the airspeed: the standard deviation is known to a quarter, two of them.
    assert np.std(one["tas"] - along) == pytest.approx(0.5, rel=0.5)


@pytest.mark.slow
@needs_jsbsim
def test_a_tour_climbs_and_turns_both_ways():
    one = signals(flown("c172p", course="none", throttle=0.0, duration_s=262.0, tour=True))
    assert np.ptp(one["altitude"]) > 50.0
    assert one["roll"].max() > 0.25
    assert one["roll"].min() < -0.25
    assert np.abs(one["sideslip"]).max() < 0.2


@pytest.mark.slow
@needs_jsbsim
def test_a_control_at_its_stop_is_a_note():
    notes = {
        size: texts(flown("c172p", course="doublet", throttle=size, duration_s=24.0).notes) for size in (0.01, 0.9)
    }
    assert notes == {0.01: (), 0.9: ("throttle is held at its stop",)}


@pytest.mark.slow
def test_a_flight_tells_the_process_that_waits_how_far_it_is(tmp_path: Path):
    """Two roads to one number: what is told to one end is read at the other, from a process that takes a while."""
    told: list[float] = []
    code = "import sys, time; time.sleep(0.5); sys.exit(7)"
    report = flight._written_to(tmp_path / FLOWN)
    for k in range(1000):
        report(k / 1000)
    with subprocess.Popen([sys.executable, "-c", code]) as waited_for:
        assert process._wait(waited_for, tmp_path / FLOWN, told.append) == 7
    assert set(told) == {0.99}


@pytest.mark.slow
@needs_jsbsim
def test_the_command_is_silent_and_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """This aircraft writes a table into the folder it is started in, and all of them write to stdout."""
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "bfi_cli", "simulate", "jsbsim:global5000", "-o", "log.h5", "--duration", "2"]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert json.loads(done.stdout)["kind"] == "simulate"
    assert done.stderr == ""
    assert [path.name for path in tmp_path.iterdir()] == ["log.h5"]


@needs_jsbsim
@pytest.mark.slow
def test_the_command_writes_the_librarys_log(tmp_path: Path):
    out = tmp_path / "c172p.h5"
    options = ["--start", "2", "--duration", "13", "--rate", f"{RATE:g}", "--throttle", "0.1", "--wind", "4", "-2"]
    options += ["--seed", "3", "--noise", "tas=0.1", "--turbulence", "0.5", "--tas", "50", "--altitude", "1000"]
    assert run_command(["simulate", "jsbsim:c172p", "-o", str(out), *options]) == 0
    plan = {"wind_m_s": (4.0, -2.0), "tas_m_s": 50.0, "altitude_m": 1000.0}
    gusts = Dryden(sigma_m_s=0.5)
    expected = flown("c172p", duration_s=13.0, seed=3, noise_sd={"tas": 0.1}, turbulence=gusts, **plan)
    written = read_log(out)
    for name, channel in expected.channels.items():
        np.testing.assert_array_equal(written.channel(name).values, channel.values)


@pytest.mark.first_rows(7)
@needs_jsbsim
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["jsbsim:c172"], "jsbsim: no such aircraft, got 'c172'; did you mean 'c172x' or "),
        (["jsbsim:zzz"], "jsbsim: no such aircraft, got 'zzz'; known: 737, "),
        (
            ["jsbsim:c172p", "--tas", "200"],
            "jsbsim:c172p: does not trim in level flight at 200 m/s and 1500 m; change --tas or leave it out\n",
        ),
        (["jsbsim:SGS"], "jsbsim:SGS: has no engine to fly level with; give another"),
        (["jsbsim:L17"], "jsbsim:L17: JSBSim cannot fly this aircraft, "),
        (
            ["jsbsim:c172p", "--altitude", "nan"],
            "jsbsim:c172p: the altitude must lie above 0 and up to 20000 m, got nan m; change it\n",
        ),
        (
            ["jsbsim:c172p", "--wind", "inf", "0"],
            "jsbsim:c172p: airspeed and wind must be numbers, got None and (inf, ",
        ),
        (["jsbsim:../c172p"], "jsbsim: no such aircraft, got '../c172p'; did you mean 'c172p' or "),
        (["jsbsim:c172p", "--amplitude", "1.2"], "jsbsim:c172p: amplitude: more than the travel of the elevator, 1 to"),
        (
            ["jsbsim:c172p", "--throttle", "-2", "--duration", "60"],
            "jsbsim:c172p: throttle: more than the travel of the throttle, 1 to either side, got -2; give a smaller",
        ),
        (["jsbsim:c172p", "--amplitude", "1", "--step", "5"], "jsbsim:c172p: leaves normal flight at "),
        (["jsbsim:c172p", "--noise", "foo=1"], "jsbsim:c172p: noise: no output 'foo'; the model has: tas, cas, "),
        (["jsbsim:c172p", "--discretisation", "euler"], "jsbsim:c172p: discretisation: held inputs only, got 'euler'"),
        (["jsbsim:p51d"], "jsbsim:p51d: does not trim in level flight at 1500 m at any of 20 to 240 m/s; give --tas"),
    ],
)
def test_what_cannot_be_flown_is_one_line(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "log.h5"
    assert run_command(["simulate", *options, "-o", str(out)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(message)
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["citation", "--tas", "90"], "citation: a linear model flies straight from its own trim, in still air; leave"),
        (["b747", "--manoeuvre", "tour"], "b747: a linear model flies straight from its own trim, in still air; leave"),
        (["f16", "--wind", "3", "0"], "f16: flies straight, in still air; leave out --wind, --ordinary and the tour"),
        (["f16", "--tas", "20"], "f16: no steady flight at 20 m/s and 3000 m; change the airspeed"),
        (
            ["citation", "--throttle", "0.1"],
            "citation: throttle: no such input, it has: elevator; leave out --throttle",
        ),
        (["jsbsim"], "simulate: no such model, got 'jsbsim'; did you mean 'jsbsim:NAME'?"),
    ],
)
def test_what_a_model_cannot_do_is_refused(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert run_command(["simulate", *options, "-o", str(tmp_path / "log.h5")]) == 2
    assert capsys.readouterr().err.startswith(message)


@pytest.mark.slow
def test_without_the_extra_the_line_says_what_to_install(tmp_path: Path):
    """In a process of its own, to which the package is hidden."""
    code = (
        "import importlib.util as u; found = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'jsbsim' else found(name, *rest)\n"
        "from bfi_cli.commands import run_command\n"
        "raise SystemExit(run_command(['simulate', 'jsbsim:c172p', '-o', 'log.h5']))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "jsbsim: needs the package jsbsim, which is not installed; pip install 'bfi-cli[jsbsim]'\n"


def test_the_f16_starts_where_it_is_asked_to():
    model = find_model("f16", FlightPlan(tas_m_s=150.0, altitude_m=2000.0))
    log = simulate(model, np.zeros(10), rng=np.random.default_rng(0), rate_hz=RATE)
    assert log.channel("tas").values[0] == 150.0
    assert log.channel("altitude").values[0] == 2000.0


def test_the_help_says_how_far_a_stick_is_moved(capsys: pytest.CaptureFixture[str]):
    assert run_command(["simulate", "--help"]) == 0
    assert f"of jsbsim {STICK:g}" in " ".join(capsys.readouterr().out.split())


def test_the_throttle_moves_after_the_manoeuvre():
    time_s = time_axis(duration_s=30.0, rate_hz=RATE)
    u = deviations(MODELS["f16"], "3211", time_s, amplitude=0.02, start_s=2.0, step_s=1.0, throttle=0.1)
    np.testing.assert_array_equal(u[:, 1:3], 0.0)
    moves = time_s[np.flatnonzero(np.diff(u[:, 3])) + 1]
    np.testing.assert_allclose(moves, [12.0, 17.0, 22.0], rtol=1e-12)
    assert np.abs(u[:, 0]).max() == 0.02


CAUSE_S = 20.0


@cache
def ordinary_flight(cause: str, size: float = 0.0) -> FlightLog:
    """Return three minutes of a tour with an ordinary cause from `CAUSE_S` on, "" for none."""
    made = (Occurrence(cause=cause, at_s=CAUSE_S, size=size),) if cause else ()
    settings = {"manoeuvre": "tour", "duration_s": 180.0, "rate_hz": 5.0, "ordinary": made}
    return library.simulate("jsbsim:c172p", **settings)


@needs_jsbsim
@pytest.mark.slow
@pytest.mark.parametrize(("cause", "making"), SIMULATED.items())
def test_an_ordinary_cause_acts_from_its_time_on_and_is_in_the_truth(cause: str, making: Making):
    calm, log = ordinary_flight(""), ordinary_flight(cause, making.size)
    before, after = log.time_s < CAUSE_S, log.time_s > CAUSE_S + 40.0
    for name, channel in calm.channels.items():  # but for round-off in JSBSim's sum of the winds
        np.testing.assert_allclose(log.channel(name).values[before], channel.values[before], rtol=1e-6, atol=1e-6)
    assert log.truth is not None
    assert log.truth.ordinary == (Occurrence(cause=cause, at_s=CAUSE_S, size=making.size),)
    assert np.ptp(log.channel("tas").values[after] - calm.channel("tas").values[after]) > 0.01


@needs_jsbsim
@pytest.mark.slow
def test_each_ordinary_cause_is_what_its_name_says():
    logs = {cause: ordinary_flight(cause, making.size) for cause, making in SIMULATED.items()}
    calm, after = ordinary_flight(""), ordinary_flight("").time_s > CAUSE_S + 40.0

    def moved(cause: str, channel: str) -> np.ndarray:
        return (logs[cause].channel(channel).values - calm.channel(channel).values)[after]

    assert np.median(moved("flaps", "aoa")) < -0.005  # less of it for the same lift
    held = logs["altitude_held"].channel("altitude").values[(calm.time_s > 60.0) & (calm.time_s < CAUSE_S + 120.0)]
    assert np.ptp(held) < 2.0 < np.ptp(calm.channel("altitude").values)
    landed = logs["on_ground"]
    assert np.ptp(landed.channel("altitude").values[-50:]) < 0.5
    assert np.hypot(*(landed.channel(f"velocity_{side}").values[-1] for side in ("north", "east"))) < 20.0
    assert np.std(np.diff(logs["gusts"].channel("tas").values[after])) > 0.05
    assert np.median(moved("wind", "velocity_north")) == pytest.approx(SIMULATED["wind"].size, abs=2.0)
    climbed = calm.channel("altitude").values[after] - calm.channel("altitude").values[~after][-1]
    assert np.corrcoef(climbed, moved("wind_shear", "velocity_north"))[0, 1] > 0.8
