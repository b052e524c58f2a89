"""The logs of `data/`: what they hold, and that `data/make.sh` makes them again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, manoeuvre, response, time_axis
from bfi_cli.flightlog import FlightLog, read_log

DATA = Path(__file__).parents[2] / "data"
LOGS = ("citation_clean.h5", "citation_bias.h5", "citation_two_faults.h5", "citation_bias.csv", "px4_bias.ulg")
TIME = time_axis()
BIAS = np.where(TIME >= 13.8, 4.0, 0.0)
SINE = np.where(TIME >= 6.35, 2.0 * np.sin(2.3 * np.pi * TIME), 0.0)


def tas(name: str) -> np.ndarray:
    return read_log(DATA / name).channel("tas").values


def clean_tas(log: FlightLog) -> np.ndarray:
    assert log.truth is not None
    return log.truth.clean["tas"]


@pytest.fixture(scope="module")
def remade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    script = ["sh", str(DATA / "make.sh"), str(folder)]
    subprocess.run(script, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PATH": path})
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_the_script_makes_the_stored_numbers(name: str, remade: Path):
    stored, again = read_log(DATA / name), read_log(remade / name)
    assert set(again.channels) == set(stored.channels)
    for channel in stored.channels:
        ours, theirs = again.channel(channel), stored.channel(channel)
        atol = 1e-9 if not name.endswith(".ulg") else 1e-6 * max(1.0, float(np.max(np.abs(theirs.values))))
        np.testing.assert_allclose(ours.values, theirs.values, rtol=0, atol=atol)
        assert ours.unit == theirs.unit
    assert (again.truth and again.truth.faults) == (stored.truth and stored.truth.faults)


@pytest.mark.slow
def test_the_script_leaves_nothing_else_behind(remade: Path):
    assert sorted(file.name for file in remade.iterdir()) == sorted(LOGS)


@pytest.mark.parametrize("name", LOGS)
def test_the_logs_are_small(name: str):
    assert (DATA / name).stat().st_size < (150_000 if name.endswith(".csv") else 200_000)


def test_the_clean_log_is_the_model_with_noise_on_the_airspeed_only():
    log = read_log(DATA / "citation_clean.h5")
    u = manoeuvre("3211", TIME)[:, None]
    noise = log.signals(["tas", "aoa", "pitch", "pitch_rate"]) - response(MODELS["citation"], u, rate_hz=100.0)
    np.testing.assert_allclose(noise[:, 1:], 0.0, rtol=0, atol=1e-12)
    assert np.std(noise[:, 0]) == pytest.approx(0.01, rel=0.06)  # five standard errors
    assert log.truth is None


def test_the_faulty_logs_differ_from_the_clean_one_by_their_faults():
    clean = tas("citation_clean.h5")
    np.testing.assert_allclose(tas("citation_bias.h5") - clean, BIAS, rtol=0, atol=1e-12)
    np.testing.assert_allclose(tas("citation_two_faults.h5") - clean, BIAS + SINE, rtol=0, atol=1e-10)
    for name in ("citation_bias.h5", "citation_two_faults.h5"):
        np.testing.assert_array_equal(clean_tas(read_log(DATA / name)), clean)


def test_the_text_log_has_three_columns_and_no_truth():
    log = read_log(DATA / "citation_bias.csv")
    assert (DATA / "citation_bias.csv").read_text().splitlines()[0] == "time [s],elevator [rad],tas [m/s]"
    assert log.truth is None
    np.testing.assert_array_equal(log.channel("tas").values, tas("citation_bias.h5"))


def test_the_autopilot_recorded_the_motion_and_a_bias():
    """The pitch is that of the quaternion, the elevator that of its command, the airspeed the model's and the bias."""
    log, t = read_log(DATA / "px4_bias.ulg"), time_axis(duration_s=60.0)
    motion = response(MODELS["citation"], manoeuvre("3211", t, step_s=3.0, amplitude_rad=0.05)[:, None], rate_hz=100.0)
    truth = {"tas": 100.0 + motion[:, 0] - 3.0 * (t >= 40.0 - 1e-9), "pitch": motion[:, 2], "pitch_rate": motion[:, 3]}
    for name, atol in (("tas", 0.5), ("pitch", 0.004), ("pitch_rate", 0.02)):
        error = log.channel(name).values - np.interp(log.time_s - 100.0, t, truth[name])
        assert np.max(np.abs(error)) < atol, name
