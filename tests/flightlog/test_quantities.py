"""Altitudes and what follows from them: the altimeter's equation, then logs whose altitude follows the knob or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_logs import made_log
from noted import texts

from bfi_cli.airdata import altitude_of, pressure_at
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, read_log, write_log
from bfi_cli.flightlog.derived import follows_setting, pressure_altitude, with_quantities
from bfi_cli.kernels.quantisation import find_quantum
from bfi_cli.quantities.channels import STANDARD

TIME = np.arange(0.0, 1200.0)


@pytest.mark.parametrize("setting", [95_000.0, 101_325.0, 104_500.0])
@pytest.mark.parametrize("height", [-100.0, 0.0, 1500.0, 9000.0])
def test_an_altimeter_shows_the_altitude_of_the_pressure_less_that_of_its_setting(setting: float, height: float):
    shown = np.array([height - float(altitude_of(setting))])
    assert pressure_altitude(shown, np.array([setting])) == pytest.approx(height, abs=1e-9)


def test_near_the_ground_a_pascal_of_the_setting_is_eight_centimetres():
    one = pressure_altitude(np.zeros(2), np.array([101_325.0, 101_326.0]))
    assert np.diff(one) == pytest.approx(-0.083, abs=5e-4)


def test_a_setting_that_is_missing_is_the_one_before():
    setting = np.array([np.nan, 100_000.0, np.nan, 0.0, 102_000.0, np.nan])
    known = np.array([100_000.0] * 4 + [102_000.0] * 2)
    np.testing.assert_array_equal(pressure_altitude(np.zeros(6), setting), pressure_altitude(np.zeros(6), known))
    assert np.isnan(pressure_altitude(np.zeros(2), np.array([29.92, np.nan]))).all()


def recorded(**signals: np.ndarray):
    """Return a log of these standard channels, a sample a second."""
    return made_log(TIME, {name: STANDARD[name].unit for name in signals}, **signals)


def flight(*, step: float = 0.3048, climb: float = 1.0, seed: int = 0, clicks: tuple[tuple[float, float], ...]):
    """Return times, the pressure altitude, the setting, and the altitude by it, in steps; a click is (s, Pa)."""
    rng = np.random.default_rng(seed)
    rate = climb * np.convolve(rng.standard_normal(TIME.size + 60), np.ones(61) / 8.0, mode="valid")
    height = 500.0 + np.cumsum(rate)
    setting = np.full(TIME.size, 101_325.0) + sum(size * (at <= TIME) for at, size in clicks)
    return height, setting, np.round((height - altitude_of(setting)) / step) * step


CLICKS = {
    "one of 3 hPa": ((600.0, 305.0),),
    "one of 0.01 inHg": ((600.0, 34.0),),
    "several within seconds": ((600.0, -20.0), (601.0, -110.0), (602.0, -106.0), (604.0, 71.0), (605.0, 268.0)),
    "two changes, up and down": ((300.0, 102.0), (900.0, -102.0)),
    "beside the end": ((1190.0, 305.0),),
}


@pytest.mark.parametrize("clicks", CLICKS.values(), ids=CLICKS)
@pytest.mark.parametrize("climb", [0.0, 1.0, 5.0])
@pytest.mark.parametrize("step", [0.01, 0.3048, 3.048])
def test_an_altitude_follows_the_setting_or_it_does_not(clicks, climb: float, step: float):
    height, setting, shown = flight(climb=climb, step=step, clicks=clicks)
    pressure = np.round(height / step) * step
    assert not follows_setting(TIME, pressure, setting)
    # A click of a step of the altitude, or of what the flight does within seconds, need not be seen.
    if abs(altitude_of(setting[0]) - altitude_of(setting[-1])) > 3.0 * step + 3.0 * climb:
        assert follows_setting(TIME, shown, setting)


@pytest.mark.parametrize("behind", [-1, 1])
def test_an_altitude_a_sample_before_or_behind_its_setting_follows_it_and_has_no_spike(behind: int):
    height, setting, shown = flight(clicks=CLICKS["one of 3 hPa"])
    shown += altitude_of(setting) - altitude_of(np.roll(setting, behind))
    log = with_quantities(recorded(altitude=shown, baro_setting=setting), ())
    altitude = log.channels["altitude"].values
    known = np.isfinite(altitude)
    assert np.flatnonzero(~known).tolist() == [600 if behind > 0 else 599]
    np.testing.assert_allclose(altitude[known][1:-1], height[known][1:-1], atol=0.31)


def test_a_setting_that_never_changes_says_nothing():
    _, setting, shown = flight(clicks=())
    assert not follows_setting(TIME, shown, setting)
    assert not follows_setting(TIME, shown, np.full(TIME.size, np.nan))
    assert not follows_setting(TIME[:4], shown[:4], np.array([101_325.0, 101_325.0, 101_000.0, 101_000.0]))


def test_an_altitude_that_follows_the_knob_is_a_baro_altitude_unless_it_was_typed():
    height, setting, shown = flight(clicks=CLICKS["one of 3 hPa"])
    log = recorded(altitude=shown, baro_setting=setting)
    made = with_quantities(log, ())
    assert made.channels["baro_altitude"].values.tolist() == shown.tolist()
    assert made.channels["altitude"].derived_from == ("baro_altitude", "baro_setting")
    np.testing.assert_allclose(made.channels["altitude"].values, height, atol=0.31)
    assert any("steps with 'baro_setting' and is taken for baro_altitude" in text for text in texts(made.notes))
    assert with_quantities(log, ("altitude",)) is log


@pytest.mark.parametrize(
    ("channels", "derived", "note"),
    [
        (("baro_altitude", "baro_setting"), ("baro_altitude", "baro_setting"), "at the setting 'baro_setting'"),
        (("baro_altitude", "p_static"), ("p_static", "baro_altitude"), "is the pressure altitude of 'p_static'"),
        (("baro_altitude",), ("baro_altitude",), "it steps where the knob is turned"),
    ],
)
def test_what_a_missing_altitude_follows_from(channels: tuple[str, ...], derived: tuple[str, ...], note: str):
    height, setting, shown = flight(clicks=CLICKS["one of 3 hPa"])
    values = {"baro_altitude": shown, "baro_setting": setting, "p_static": pressure_at(height)}
    log = with_quantities(recorded(**{name: values[name] for name in channels}), ())
    assert log.channels["altitude"].derived_from == derived
    expected = shown if len(channels) == 1 else height
    np.testing.assert_allclose(log.channels["altitude"].values, expected, atol=0.31)
    assert note in " ".join(texts(log.notes))


def test_a_geometric_altitude_is_no_altitude_and_a_geometric_rate_stands_in_for_the_rate():
    log = with_quantities(recorded(gps_altitude=TIME, radio_altitude=TIME, gps_altitude_rate=TIME), ())
    assert "altitude" not in log.channels
    assert log.channels["altitude_rate"].derived_from == ("gps_altitude_rate",)


def test_a_static_fault_moves_both_altitudes_and_no_geometric_one(tmp_path: Path):
    height, setting, shown = flight(clicks=CLICKS["one of 3 hPa"])
    rate = np.gradient(height)
    log = recorded(baro_altitude=shown, baro_setting=setting, gps_altitude=height, gps_altitude_rate=rate)
    log = with_quantities(log, ())
    faulty = inject(log, (Fault(shape="static_blocked", channel="", onset_s=700.0),))
    moved = {name for name in log.channels if np.any(faulty.channels[name].values != log.channels[name].values)}
    assert moved == {"altitude", "baro_altitude"}
    change = {name: faulty.channels[name].values - log.channels[name].values for name in sorted(moved)}
    np.testing.assert_allclose(change["altitude"], change["baro_altitude"], atol=1e-9)
    # What is derived is not written, and derived again when it is read.
    write_log(faulty, tmp_path / "a.h5")
    read = read_log(tmp_path / "a.h5")
    np.testing.assert_allclose(read.channels["altitude"].values, faulty.channels["altitude"].values, atol=1e-9)
    assert read.truth is not None
    np.testing.assert_allclose(read.truth.clean["altitude"], log.channels["altitude"].values, atol=1e-9)


def test_a_fault_of_a_derived_channel_is_written_and_read(tmp_path: Path):
    _, setting, shown = flight(clicks=CLICKS["one of 3 hPa"])
    log = with_quantities(recorded(baro_altitude=shown, baro_setting=setting), ())
    faulty = inject(log, (Fault(shape="bias", channel="altitude", magnitude=50.0, onset_s=700.0),))
    write_log(faulty, tmp_path / "a.csv")
    read = read_log(tmp_path / "a.csv")
    np.testing.assert_allclose(read.channels["altitude"].values - log.channels["altitude"].values, 50.0 * (TIME >= 700))
    assert read.channels["altitude"].derived_from == ()


def test_ground_speed_and_track_are_the_ground_velocity_and_a_magnetic_track_is_turned_first():
    speed, track = np.full(TIME.size, 60.0), 0.01 * TIME
    log = with_quantities(
        recorded(ground_speed=speed, magnetic_track=track, magnetic_variation=np.full(TIME.size, 0.06)), ()
    )
    np.testing.assert_allclose(log.channels["velocity_north"].values, 60.0 * np.cos(track + 0.06), atol=1e-9)
    np.testing.assert_allclose(log.channels["velocity_east"].values, 60.0 * np.sin(track + 0.06), atol=1e-9)
    assert log.independent(("ground_speed", "velocity_north")) == ("ground_speed",)
    assert log.independent(("velocity_north", "velocity_east")) == ("velocity_north", "velocity_east")
    recorded_already = recorded(ground_speed=speed, track=track, velocity_north=speed, velocity_east=speed)
    assert with_quantities(recorded_already, ()) is recorded_already


def test_the_steps_of_the_reading_are_those_of_the_pressure_altitude():
    _, setting, shown = flight(clicks=CLICKS["several within seconds"], step=0.3048)
    assert find_quantum(pressure_altitude(shown, setting)) == pytest.approx(0.3048, rel=1e-3)
