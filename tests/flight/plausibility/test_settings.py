"""The parameter of the autopilot for a scale of the airspeed: read from the log, and what would mend the reading."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_dataflash import dataflash_bytes, fmt
from made_px4 import message, ulog_bytes

from bfi_cli.decision.implausible import Implausible
from bfi_cli.flight.plausibility.implausible import sentence_of_setting, with_setting, with_settings
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.formats import parameters_of
from bfi_cli.flightlog.record import frozen_array

TIMES = frozen_array(np.arange(3.0))
SCALE = Implausible(
    channels=("tas",),
    what="scale",
    unit="",
    factor=1.1,
    offset=0.0,
    agrees_with=("velocity_north",),
    relative_misfit=0.0,
    rivals=(),
    text="tas is 0.909 times what the ground velocity implies",
    advice="check tas",
    factor_ci95=(1.05, 1.15),
)


def log_with(channel: str, source: str, path: str = "made") -> FlightLog:
    one = Channel(name=channel, values=TIMES, unit="m/s", source=source)
    return FlightLog(path=path, time_s=TIMES, channels={channel: one})


def parameter(name: str, value: float | int) -> bytes:
    """Return the message of a ULog about a parameter."""
    form, layout = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
    key = f"{form} {name}".encode()
    return message("P", bytes([len(key)]) + key + struct.pack(layout, value))


def px4_log(path: Path, *parameters: bytes) -> Path:
    """Write a flight of circles whose airspeed reads 10 % too little, with parameters."""
    stamp = np.round(1e6 * np.arange(0.0, 400.0, 0.2)).astype(np.uint64)
    t = stamp / 1e6
    speed, heading = 25.0 + 2.0 * np.sin(0.11 * t), 2.0 * np.pi * t / 40.0
    airspeed = {"timestamp": stamp, "true_airspeed_m_s": (0.9 * speed).astype(np.float32)}
    ground = {
        "timestamp": stamp,
        "vx": (speed * np.cos(heading) + 5.0).astype(np.float32),
        "vy": (speed * np.sin(heading) - 3.0).astype(np.float32),
        "z": np.full(t.size, -500.0, np.float32),
    }
    whole = ulog_bytes({("airspeed_validated", 0): airspeed, ("vehicle_local_position", 0): ground})
    head = 16 + 3 + 40
    path.write_bytes(whole[:head] + b"".join(parameters) + whole[head:])
    return path


@pytest.mark.parametrize(
    ("source", "channel", "parameters", "name", "value", "ci95"),
    [
        # The airspeed grows with the root of the ratio, and in proportion to the scale.
        ("ARSP.Airspeed", "ias", {"ARSPD_RATIO": 2.0}, "ARSPD_RATIO", 2.0 * 1.21, (2.0 * 1.05**2, 2.0 * 1.15**2)),
        ("ARSP_1.Airspeed", "ias", {"ARSPD_RATIO": 2.0, "ARSPD2_RATIO": 1.8}, "ARSPD2_RATIO", 1.8 * 1.21, None),
        ("airspeed_validated.true_airspeed_m_s", "tas", {"ASPD_SCALE_1": 1.2}, "ASPD_SCALE_1", 1.32, (1.26, 1.38)),
        ("airspeed_validated.true_airspeed_m_s", "tas", {"ASPD_SCALE": 1.2}, "ASPD_SCALE", 1.32, (1.26, 1.38)),
        ("airspeed_validated.indicated_airspeed_m_s", "ias", {"ASPD_SCALE": 1.2}, "ASPD_SCALE", 1.1, (1.05, 1.15)),
        ("airspeed.true_airspeed_m_s", "tas", {"ASPD_SCALE_1": 1.2}, "ASPD_SCALE_1", 1.1, (1.05, 1.15)),
        ("airspeed_1.true_airspeed_m_s", "tas", {"ASPD_SCALE_1": 1.2, "ASPD_SCALE_2": 1.0}, "ASPD_SCALE_2", 1.1, None),
    ],
)
def test_what_mends_the_reading(
    source: str, channel: str, parameters: dict, name: str, value: float, ci95: tuple[float, float] | None
):
    finding = replace(SCALE, channels=(channel,), factor_ci95=SCALE.factor_ci95 if ci95 else None)
    setting = with_setting(log_with(channel, source), finding, parameters).setting
    assert setting is not None
    assert (setting.name, setting.present) == (name, parameters[name])
    assert setting.value == pytest.approx(value, rel=1e-12)
    assert setting.ci95 == (None if ci95 is None else pytest.approx(ci95, rel=1e-12))


@pytest.mark.parametrize(
    ("source", "parameters"),
    [
        ("tas", {"ASPD_SCALE": 1.0}),
        ("airspeed_validated.true_airspeed_m_s", {"ARSPD_RATIO": 2.0}),
        ("airspeed_2.true_airspeed_m_s", {"ASPD_SCALE_1": 1.0}),
        ("airspeed_wind.x", {"ASPD_SCALE_1": 1.0}),
    ],
)
def test_what_no_parameter_of_the_log_mends(source: str, parameters: dict):
    assert with_setting(log_with("tas", source), SCALE, parameters) == SCALE


def test_what_is_no_scale_of_an_airspeed_is_left(tmp_path: Path):
    path = px4_log(tmp_path / "log.ulg", parameter("ASPD_SCALE_1", 1.0))
    log = log_with("tas", "airspeed_validated.true_airspeed_m_s", str(path))
    others = (replace(SCALE, what="offset"), replace(SCALE, channels=("aoa",)), replace(SCALE, rivals=("cas",)))
    assert with_settings(log, others) == others
    assert with_settings(log, (SCALE,))[0].setting is not None


def test_parameters_of_a_ulog_are_those_that_it_ends_with(tmp_path: Path):
    torn = message("P", b"\x40float ASPD_SCALE_1")
    path = px4_log(
        tmp_path / "log.ulg",
        parameter("ASPD_SCALE_1", 1.0),
        torn,
        parameter("SYS_X", 7),
        parameter("ASPD_SCALE_1", 1.25),
    )
    assert parameters_of(str(path)) == {"ASPD_SCALE_1": 1.25, "SYS_X": 7.0}


def test_parameters_of_a_dataflash_log(tmp_path: Path):
    whole = dataflash_bytes()
    said = fmt(9, "PARM", "QNf", "TimeUS,Name,Value")
    for name, value in ((b"ARSPD_RATIO", 2.0), (b"ARSPD_RATIO", 1.75), (b"SIXTEEN_LETTERS_", -1.0)):
        said += b"\xa3\x95\x09" + struct.pack("<Q16sf", 10_000_000, name, value)
    path = tmp_path / "log.bin"
    path.write_bytes(whole + said)
    assert parameters_of(str(path)) == {"ARSPD_RATIO": 1.75, "SIXTEEN_LETTERS_": -1.0}


def test_a_log_without_parameters(tmp_path: Path):
    (tmp_path / "log.csv").write_text("time,tas\n0,1\n1,1\n")
    assert parameters_of(str(tmp_path / "log.csv")) == {}
    assert parameters_of(str(tmp_path / "absent")) == {}
    assert parameters_of(str(px4_log(tmp_path / "log.ulg"))) == {}


def test_info_prints_the_parameter_its_present_value_and_the_interval(bfi: Callable, tmp_path: Path):
    path = px4_log(tmp_path / "log.ulg", parameter("ASPD_SCALE_1", 1.1))
    outcome = bfi("info", path)
    assert outcome.code == 0
    number = r"([\d.]+)"
    sentence = rf"set ASPD_SCALE_1 to {number} \({number} to {number}\), now {number}"
    found = re.search(sentence, " ".join(outcome.stdout.split()))
    assert found
    value, low, high, present = map(float, found.groups())
    assert value == pytest.approx(1.1 / 0.9, rel=1e-3)
    assert low <= value <= high
    assert present == 1.1


def test_the_sentence():
    finding = replace(SCALE, channels=("ias",))
    setting = with_setting(log_with("ias", "ARSP.Airspeed"), finding, {"ARSPD_RATIO": 2.0}).setting
    assert setting is not None
    assert sentence_of_setting(setting) == "set ARSPD_RATIO to 2.42 (2.205 to 2.645), now 2"
