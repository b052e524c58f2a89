"""Derived channels: used like recorded ones, made of what there is, refused with what is missing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_logs import made_log
from noted import texts

from bfi_cli.airdata import (
    G,
    calibrated_airspeed,
    impact_pressure_of_mach,
    isa_temperature,
    mach_of_tas,
    pressure_at,
    total_temperature,
)
from bfi_cli.commands import run_command
from bfi_cli.errors import LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, write_log
from bfi_cli.flightlog.derived import DERIVED, missing_for, with_derived
from bfi_cli.quantities.channels import STANDARD

RATE_HZ, N = 5.0, 3000
T = np.arange(N) / RATE_HZ
ZERO_LIFT = -0.02
WIND = (6.0, -9.0)


def flight() -> FlightLog:
    """Return ten minutes of a flight of which every derived channel is known."""
    altitude, tas = 2000.0 + 0.5 * T, 100.0 + 15.0 * np.sin(0.02 * T) + 3.0 * np.sin(0.4 * T)
    sat = isa_temperature(altitude) + 5.0
    mach = tas / np.sqrt(1.4 * 287.05287 * sat)
    p_static = pressure_at(altitude)
    normal_acc = 1.5 * np.sin(0.5 * T)
    aoa = ZERO_LIFT + 40.0 * (normal_acc + G) / (p_static / sat * tas**2)
    heading = 0.01 * T
    horizontal = np.sqrt(tas**2 - 0.5**2)
    signals = {
        "elevator": 0.02 * np.sin(0.5 * T),
        "tas": tas,
        "cas": calibrated_airspeed(impact_pressure_of_mach(mach, p_static)),
        "altitude": altitude,
        "altitude_rate": np.full(N, 0.5),
        "tat": total_temperature(sat, mach),
        "aoa": aoa,
        "pitch": aoa + np.arcsin(0.5 / tas),
        "roll": np.zeros(N),
        "normal_acc": normal_acc,
        "longitudinal_acc": 0.3 * np.cos(0.2 * T),
        "velocity_north": horizontal * np.cos(heading) + WIND[0],
        "velocity_east": horizontal * np.sin(heading) + WIND[1],
    }
    return made_log(1000.0 + T, {name: STANDARD[name].unit for name in signals}, **signals)


LOG = flight()


def without(*names: str) -> FlightLog:
    return replace(LOG, channels={name: one for name, one in LOG.channels.items() if name not in names})


def values(log: FlightLog, name: str):
    return log.channel(name).values


def test_pressures_are_those_of_altitude_and_airspeed():
    made = with_derived(LOG, ["p_static", "p_total", "q_impact"])
    p_static = pressure_at(values(LOG, "altitude"))
    np.testing.assert_allclose(values(made, "p_static"), p_static, rtol=1e-13)
    np.testing.assert_allclose(values(made, "p_total"), values(made, "p_static") + values(made, "q_impact"), rtol=1e-13)
    np.testing.assert_allclose(
        values(made, "q_impact"),
        impact_pressure_of_mach(mach_of_tas(values(LOG, "tas"), values(LOG, "tat")), p_static),
        rtol=1e-11,
    )


def test_lift_shows_the_airspeed_and_ground_velocity_does():
    made = with_derived(LOG, ["lift_speed", "ground_airspeed"], from_s=1400.0, to_s=1500.0)
    inside = (made.time_s >= 1400.0) & (made.time_s <= 1500.0)
    tas = values(LOG, "tas")
    # Lift is taken to grow as tas^2, the angle of zero lift from q_impact, which grows by M^2 / 4 more: M^2 / 8 of tas.
    assert np.abs(values(made, "lift_speed") / tas - 1.0)[inside].max() < 0.35**2 / 8.0
    assert np.abs(values(made, "ground_airspeed") - tas)[inside].max() < 0.02
    lift, ground = texts(made.notes)
    assert lift.startswith(
        "'lift_speed' is derived from altitude, aoa, normal_acc, tas, with an angle of zero lift of -"
    )
    assert ground.startswith(
        "'ground_airspeed' is derived from altitude_rate, tas, velocity_east, velocity_north, with"
    )


def test_the_climb_angle_is_rise_over_way():
    made = with_derived(LOG, ["climb_angle"])
    np.testing.assert_allclose(np.sin(values(made, "climb_angle")), 0.5 / values(LOG, "tas"), rtol=1e-9)


def test_a_channel_has_its_standard_unit_and_the_rest_of_the_log_is_as_it_was():
    made = with_derived(LOG, list(DERIVED))
    for name in DERIVED:
        assert made.channel(name).unit == STANDARD[name].unit
        assert not made.channel(name).values.flags.writeable
    assert {name: made.channels[name] for name in LOG.channels} == LOG.channels
    assert set(made.channels) - set(LOG.channels) == set(DERIVED)
    assert with_derived(LOG, ["tas", "aileron"]) is LOG


def test_a_recorded_channel_is_taken_as_it_is():
    made = with_derived(LOG, ["lift_speed"])
    assert with_derived(made, ["lift_speed"]) is made


def test_the_angle_of_zero_lift_comes_from_the_flight_before_the_window():
    """Where that is long enough: a window in which the vane stands still could not tell it."""
    aoa = values(LOG, "aoa").copy()
    aoa[T >= 400.0] = 0.07
    frozen = replace(LOG, channels={**LOG.channels, "aoa": replace(LOG.channels["aoa"], values=aoa)})
    whole = with_derived(LOG, ["lift_speed"], from_s=1400.0)
    assert texts(with_derived(frozen, ["lift_speed"], from_s=1400.0).notes) == texts(whole.notes)
    with pytest.raises(LogError, match=r"'lift_speed' cannot be derived: .* zero lift .*; give a log with 300 s of"):
        with_derived(frozen.window(1400.0, None), ["lift_speed"])


def test_a_drift_of_the_airspeed_after_the_first_quarter_does_not_reach_the_lift_speed():
    drift = Fault(shape="drift", magnitude=0.2, onset_s=1450.0)
    span = {"from_s": 1400.0, "to_s": 1540.0}
    faulty = with_derived(inject(LOG, [drift]), ["lift_speed"], **span)
    np.testing.assert_allclose(
        values(faulty, "lift_speed"), values(with_derived(LOG, ["lift_speed"], **span), "lift_speed"), rtol=1e-3
    )


def test_the_truth_of_a_derived_channel_is_made_of_the_clean_ones():
    fault = Fault(shape="bias", channel="altitude", magnitude=100.0, onset_s=1300.0)
    made = with_derived(inject(LOG, [fault]), ["p_static", "climb_angle"])
    assert made.truth is not None
    assert set(made.truth.clean) == {"altitude", "p_static"}
    clean = with_derived(LOG, ["p_static"])
    np.testing.assert_array_equal(made.truth.clean["p_static"], values(clean, "p_static"))
    assert (values(made, "p_static") != values(clean, "p_static")).tolist() == (LOG.time_s >= 1300.0).tolist()


@pytest.mark.parametrize(
    ("name", "removed", "lacking"),
    [
        ("lift_speed", ("aoa",), "aoa"),
        ("lift_speed", ("aoa", "altitude"), "aoa, p_static or altitude"),
        ("p_static", ("altitude",), "p_static or altitude"),
        ("q_impact", ("cas", "tas"), "q_impact or p_total or cas or mach or ias or tas"),
        ("kinematic_acc", ("roll",), "roll"),
        ("climb_angle", ("pitch", "roll"), "pitch, roll"),
        ("ground_airspeed", ("velocity_east",), "velocity_north and velocity_east or latitude and longitude"),
    ],
)
def test_what_is_missing_is_named(name, removed, lacking):
    log = without(*removed)
    assert ", ".join(missing_for(name, log.channels)) == lacking
    with pytest.raises(LogError) as refusal:
        with_derived(log, [name])
    first = lacking.split()[0].rstrip(",")
    start = f"made.h5: '{name}' is not recorded, and to derive it the log lacks {lacking}; the log has: "
    assert str(refusal.value).startswith(start)
    assert str(refusal.value).endswith(f"map one with --channel {first}=NAME")


def spoilt(name: str, value: float) -> FlightLog:
    changed = values(LOG, name).copy()
    changed[500] = value
    return replace(LOG, channels={**LOG.channels, name: replace(LOG.channels[name], values=changed)})


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("cas", 350.0, "'cas' is 350 m/s at sample 500 (1100 s), 0 to 340.3 m/s, the equations hold below Mach 1"),
        ("altitude", 90_000.0, "'altitude' is 90000 m at sample 500 (1100 s), known between -5000 and 20000 m"),
        ("tat", -5.0, "'tat' is -5 K at sample 500 (1100 s), no air temperature in kelvin"),
    ],
)
def test_what_no_flight_has_is_refused_in_the_window_and_left_out_elsewhere(name, value, message):
    log = spoilt(name, value)
    with pytest.raises(LogError) as refusal:
        with_derived(log, ["p_total"])
    assert message in str(refusal.value)
    elsewhere = values(with_derived(log, ["p_total"], from_s=1200.0), "p_total")
    assert np.flatnonzero(~np.isfinite(elsewhere)).tolist() == ([500] if name != "tat" else [])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("derived") / "flight.h5"
    noise = np.random.default_rng(3)
    channels = {
        name: replace(one, values=one.values + 1e-3 * np.std(one.values) * noise.standard_normal(N))
        for name, one in LOG.channels.items()
    }
    write_log(replace(LOG, channels=channels), place)
    return place


@pytest.mark.usefixtures("unscanned")
def test_derived_channels_are_outputs_and_inputs_of_an_analysis(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    dictionary = tmp_path / "d.yaml"
    dictionary.write_text("atoms: [{shape: bias, channel: tas, onset_s: 1450}]\n")
    window = ["--from", "1400", "--to", "1500", "-d", str(dictionary), "--order", "2", "--json"]
    names = ["--output", "tas", "--output", "lift_speed", "--input", "climb_angle", "--input", "kinematic_acc"]
    code = run_command(["identify", str(path), *window, *names])
    document = json.loads(capsys.readouterr().out)
    assert code == 0
    assert document["model"]["outputs"] == ["tas", "lift_speed"]
    assert document["model"]["inputs"] == ["climb_angle", "kinematic_acc"]
    assert "'lift_speed' is derived from altitude, aoa, normal_acc, tas" in " ".join(texts(document["notes"]))


def test_info_says_what_can_be_derived_and_what_follows_from_which_pressure(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert run_command(["info", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {one["name"]: one["lacks"] for one in document["derived"]} == {name: [] for name in DERIVED}
    pressures = {one["name"]: one["pressures"] for one in document["channels"]}
    assert pressures["tas"] == pressures["cas"] == ["p_static", "p_total"]
    assert pressures["altitude"] == pressures["altitude_rate"] == ["p_static"]
    assert pressures["tat"] == pressures["aoa"] == []
    lean = write_log(without("aoa", "cas", "tas"), tmp_path / "lean.h5")
    assert lean is None
    assert run_command(["info", str(tmp_path / "lean.h5")]) == 0
    shown = capsys.readouterr().out
    assert "Channels that can be derived, for --input and --output" in shown
    assert "aoa, tas" in shown
