"""Logs of the F-16: steady in trim, consistent with kinematics, and what the command says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.aircraft import MODELS, Dryden, Flown, find_model, manoeuvre, simulate, time_axis
from bfi_cli.commands import run_command
from bfi_cli.errors import ConfigError
from bfi_cli.flightlog import FlightLog, read_log

F16 = MODELS["f16"]
G = 32.17 * 0.3048
RATE = 50.0
CHANNELS = {
    "elevator": "rad",
    "aileron": "rad",
    "rudder": "rad",
    "throttle": "1",
    "tas": "m/s",
    "aoa": "rad",
    "sideslip": "rad",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
    "roll_rate": "rad/s",
    "pitch_rate": "rad/s",
    "yaw_rate": "rad/s",
    "altitude": "m",
    "longitudinal_acc": "m/s^2",
    "lateral_acc": "m/s^2",
    "normal_acc": "m/s^2",
}


def flown(name: str = "doublet", *, duration_s: float = 5.0, rate_hz: float = RATE, **settings: object) -> FlightLog:
    time_s = time_axis(duration_s=duration_s, rate_hz=rate_hz)
    given = {"rng": np.random.default_rng(0), **settings}
    return simulate(F16, manoeuvre(name, time_s), rate_hz=rate_hz, **given)


@pytest.fixture(scope="module")
def doublet() -> FlightLog:
    return flown()


def test_channels_and_units(doublet: FlightLog):
    assert {name: channel.unit for name, channel in doublet.channels.items()} == CHANNELS


def test_without_a_manoeuvre_the_aircraft_stays_in_trim():
    log = flown("none", duration_s=2.0)
    for name in CHANNELS:
        values = log.channel(name).values
        np.testing.assert_allclose(values, values[0], rtol=1e-9, atol=1e-9)
    assert log.channel("tas").values[0] == 125.0
    assert log.channel("altitude").values[0] == 3000.0
    felt = log.signals(["longitudinal_acc", "lateral_acc", "normal_acc"])
    lift = felt[:, 2] + G
    np.testing.assert_allclose(np.hypot(np.linalg.norm(felt[:, :2], axis=1), lift), G, rtol=1e-9)
    assert (lift > 0.0).all()


def test_the_manoeuvre_is_flown_by_the_elevator_alone(doublet: FlightLog):
    trimmed = flown("none", duration_s=0.1)
    deflection = doublet.channel("elevator").values - trimmed.channel("elevator").values[0]
    np.testing.assert_allclose(deflection, manoeuvre("doublet", doublet.time_s), rtol=0, atol=1e-15)
    for name in ("aileron", "rudder", "throttle"):
        assert np.ptp(doublet.channel(name).values) == 0.0


def test_a_positive_elevator_pitches_down(doublet: FlightLog):
    at = int(0.8 * RATE)
    assert doublet.channel("elevator").values[at] > doublet.channel("elevator").values[0]
    assert doublet.channel("pitch_rate").values[at] < 0.0


def test_the_signals_agree_with_kinematics(doublet: FlightLog):
    """dV/dt from specific forces, dh/dt = V sin(climb angle), d(pitch)/dt from the rates; by central differences."""
    one = {name: doublet.channel(name).values for name in CHANNELS}
    sin_a, cos_a = np.sin(one["aoa"]), np.cos(one["aoa"])
    climb = np.sin(one["pitch"]) * cos_a - np.cos(one["pitch"]) * np.cos(one["roll"]) * sin_a
    along = one["longitudinal_acc"] * cos_a - (one["normal_acc"] + G) * sin_a - G * climb
    turning = one["pitch_rate"] * np.cos(one["roll"]) - one["yaw_rate"] * np.sin(one["roll"])
    steps = np.abs(np.diff(one["elevator"])) > 0.0
    smooth = ~(steps[1:] | steps[:-1])
    for name, rate, within in (("tas", along, 2e-3), ("altitude", one["tas"] * climb, 2e-3), ("pitch", turning, 1e-4)):
        by_difference = (one[name][2:] - one[name][:-2]) * RATE / 2.0
        np.testing.assert_allclose(by_difference[smooth], rate[1:-1][smooth], rtol=0, atol=within)


def test_another_rate_is_the_same_flight(doublet: FlightLog):
    slow = flown(rate_hz=10.0)
    names = ["tas", "aoa", "pitch", "pitch_rate", "altitude"]
    np.testing.assert_allclose(slow.signals(names), doublet.signals(names)[::5], rtol=1e-6, atol=1e-6)


def test_noise_and_quantum_are_those_asked_for(doublet: FlightLog):
    noisy = flown(noise_sd={"tas": 0.05}, quantum={"altitude": 0.5})
    assert np.std(noisy.channel("tas").values - doublet.channel("tas").values) == pytest.approx(0.05, rel=0.2)
    np.testing.assert_allclose(noisy.channel("altitude").values % 0.5, 0.0, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(noisy.channel("aoa").values, doublet.channel("aoa").values)


def test_deflections_beyond_a_stop_are_held_there():
    result = F16.fly(np.array([[0.6, 0.0, 0.0, 2.0]] * 3), RATE)
    assert isinstance(result, Flown)
    np.testing.assert_allclose(result.inputs[:, [0, 3]], [[np.radians(25.0), 1.0]] * 3, rtol=1e-12)
    assert texts(result.notes) == ("elevator is held at its stop", "throttle is held at its stop")


def test_all_inputs_may_move():
    deviations = np.zeros((50, 4))
    deviations[10:20, 1], deviations[20:30, 2] = 0.02, 0.02
    log = simulate(F16, deviations, rng=np.random.default_rng(0), rate_hz=RATE)
    assert log.channel("roll_rate").values[15] < -0.01
    assert np.abs(log.channel("lateral_acc").values[20:30]).min() > 0.02


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"turbulence": Dryden(sigma_m_s=1.0)}, "f16: turbulence: not modelled, got 1 m/s; leave it out"),
        ({"discretisation": "bilinear"}, "f16: discretisation: held inputs only, got 'bilinear'; leave it out"),
        ({"noise_sd": {"mach": 0.1}}, "f16: noise: no output 'mach'; the model has: tas, aoa, sideslip, roll"),
    ],
)
def test_what_is_not_modelled_is_refused(settings: dict[str, object], message: str):
    with pytest.raises(ConfigError, match=message):
        flown(**settings)


def test_leaving_the_tables_is_refused():
    time_s = time_axis(duration_s=10.0, rate_hz=RATE)
    with pytest.raises(ConfigError, match=r"f16: aoa leaves the tables, -10 to 45 degrees, at .* smaller --amplitude"):
        simulate(F16, manoeuvre("3211", time_s, amplitude_rad=0.2), rng=np.random.default_rng(0), rate_hz=RATE)


def test_the_command_writes_the_librarys_log(tmp_path: Path):
    out = tmp_path / "f16.h5"
    options = ["--manoeuvre", "doublet", "--duration", "2", "--rate", f"{RATE:g}", "--seed", "3", "--noise", "tas=0.05"]
    assert run_command(["simulate", "f16", "-o", str(out), *options]) == 0
    expected = flown(duration_s=2.0, rng=np.random.default_rng(3), noise_sd={"tas": 0.05})
    log = read_log(out)
    for name, channel in expected.channels.items():
        np.testing.assert_array_equal(log.channel(name).values, channel.values)


def test_the_command_refuses_turbulence_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "f16.h5"
    assert run_command(["simulate", "f16", "-o", str(out), "--turbulence", "1"]) == 2
    assert capsys.readouterr().err == "f16: turbulence: not modelled, got 1 m/s; leave it out\n"
    assert not out.exists()


def test_the_catalogue_knows_it():
    assert find_model("f16") is F16
