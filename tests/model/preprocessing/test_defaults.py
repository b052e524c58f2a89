"""What an analysis takes of a log that lacks its defaults; a log that has them is analysed as it always was."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_dataflash import dataflash_bytes
from made_logs import made_log
from made_px4 import px4_topics, write_ulog
from made_tlog import tlog_bytes
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import SHIPPED, load_dictionary
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.model.preprocessing.defaults import with_defaults_of

CONFIGS = Path(__file__).parents[3] / "configs"
TIME_S = np.arange(0.0, 1200.0, 0.2)
# At rest, a take-off run, a flight, a landing, at rest; an altitude above the field.
FLIGHT = np.interp(TIME_S, [0, 280, 330, 870, 930, 1200], [0, 0, 1, 1, 0, 0])
SPEED, ALTITUDE, WAVE = 100.0 * FLIGHT, 1000.0 * FLIGHT, np.sin(TIME_S)
UNITS = {"tas": "m/s", "cas": "m/s", "ias": "m/s", "ground_speed": "m/s", "altitude": "m"}


PUBLISHED = merge(Config(), {"method": "risro"})


def log_of(**signals: np.ndarray) -> FlightLog:
    return made_log(TIME_S, units={name: UNITS.get(name, "rad") for name in signals}, **signals)


def with_rates(log: FlightLog, **rates_hz: float) -> FlightLog:
    """Return the log with channels that have a rate of their own."""
    channels = {
        name: replace(channel, own_rate_hz=rates_hz.get(name, log.rate_hz)) for name, channel in log.channels.items()
    }
    return replace(log, channels=channels)


@pytest.mark.parametrize("rest", [{}, {"cas": SPEED, "pitch": WAVE, "throttle": 0.02 * WAVE, "longitudinal_acc": WAVE}])
def test_of_published_methods_a_log_with_the_defaults_is_left_as_it_is(rest: dict):
    log = log_of(tas=100.0 + WAVE, elevator=WAVE, **rest)
    assert with_defaults_of(log, PUBLISHED) == (PUBLISHED, ())


def test_the_inputs_are_the_trusted_channels_that_move_and_are_there_throughout_the_window():
    holes = np.where(TIME_S < 400.0, np.nan, WAVE)
    log = log_of(tas=100.0 + WAVE, elevator=WAVE, pitch=WAVE, pitch_rate=0.0 * WAVE, aoa=holes, cas=SPEED)
    derived = replace(log.channels["pitch"], name="longitudinal_acc", derived_from=("tas",))
    log = replace(log, channels={**log.channels, "longitudinal_acc": derived})
    config, notes = with_defaults_of(log, Config())
    assert config.inputs == ("elevator", "pitch")
    assert "all trusted channels: the inputs are elevator, pitch" in texts(notes)
    late = with_defaults_of(log, merge(Config(), {"window.from_s": 500.0}))[0]
    assert late.inputs == ("elevator", "pitch", "aoa")
    alone = log_of(tas=100.0 + WAVE, elevator=WAVE)
    assert with_defaults_of(alone, Config()) == (Config(), ())


def test_what_was_asked_for_is_left_as_it_is():
    log = with_rates(log_of(ias=SPEED, cas=SPEED, pitch=WAVE, altitude=ALTITUDE), cas=1.0)
    asked = merge(Config(), {"outputs": ["cas"], "inputs": ["altitude"], "window.to_s": 900.0})
    assert with_defaults_of(log, asked) == (asked, ())


@pytest.mark.parametrize(
    ("rates_hz", "output"),
    [({}, "cas"), ({"cas": 1.0}, "ias"), ({"ias": 1.0}, "cas"), ({"cas": 1.0, "ias": 0.5}, "cas")],
)
def test_the_output_is_the_fastest_airspeed_where_there_is_no_tas(rates_hz: dict, output: str):
    log = with_rates(log_of(ias=100.0 + WAVE, cas=100.0 + WAVE, elevator=WAVE), **rates_hz)
    config, notes = with_defaults_of(log, Config())
    assert config.outputs == (output,)
    assert f"the output is '{output}'" in notes[0].text
    with_tas = with_rates(log_of(tas=100.0 + WAVE, cas=100.0 + WAVE, elevator=WAVE), tas=0.5)
    assert with_defaults_of(with_tas, Config())[0].outputs == ("tas",)


@pytest.mark.parametrize(
    ("channels", "inputs"),
    [
        ({"throttle": WAVE, "pitch": WAVE, "longitudinal_acc": WAVE}, ("throttle", "pitch", "longitudinal_acc")),
        ({"throttle": 0.0 * WAVE, "n1_left": WAVE, "pitch": WAVE}, ("n1_left", "pitch")),
        ({"elevator": 0.0 * WAVE, "elevator_inner_left": WAVE, "pitch": WAVE}, ("elevator_inner_left", "pitch")),
        ({"throttle": np.round(WAVE[np.arange(TIME_S.size) // 10 * 10], 6), "pitch": WAVE}, ("pitch",)),
        ({"elevator": 0.0 * WAVE}, ("elevator",)),
        ({"elevator": np.where(TIME_S < 3.0, np.nan, WAVE), "pitch": WAVE}, ("elevator", "pitch")),
    ],
    ids=["nothing", "n1", "other surface", "held", "no other", "elevator"],
)
def test_inputs_in_place_of_an_elevator_are_those_that_move(channels: dict, inputs: tuple[str, ...]):
    config, notes = with_defaults_of(log_of(tas=100.0 + WAVE, **channels), Config())
    assert config.inputs == inputs
    assert [note for note in texts(notes) if "inputs" in note] == (
        [] if inputs == ("elevator",) else [note for note in texts(notes) if ", ".join(inputs) in note]
    )


@pytest.mark.parametrize("lever", ["throttle", "n1_left"])
def test_a_lever_that_is_moved_is_an_input_beside_the_elevator(lever: str):
    """And pitch and acceleration, since thrust lags behind it; only if it moves in the window."""
    moved = np.where(TIME_S < 600.0, 0.6, 0.7)
    log = log_of(tas=100.0 + WAVE, elevator=WAVE, pitch=WAVE, longitudinal_acc=WAVE, **{lever: moved + 0.001 * WAVE})
    config, (said,) = with_defaults_of(log, PUBLISHED)
    assert config.inputs == ("elevator", lever, "pitch", "longitudinal_acc")
    assert said.text == (
        f"'{lever}' moves, which changes the airspeed too: the inputs are elevator, {lever}, pitch, longitudinal_acc"
    )
    before = merge(PUBLISHED, {"window.to_s": 500.0})
    assert with_defaults_of(log, before) == (before, ())
    asked = merge(Config(), {"inputs": ["elevator"]})
    assert with_defaults_of(log, asked) == (asked, ())


@pytest.mark.parametrize("witness", ["ground_speed", "altitude"])
def test_the_window_is_the_flight_from_take_off_to_landing(witness: str):
    log = log_of(tas=SPEED, elevator=WAVE, **{witness: SPEED if witness == "ground_speed" else ALTITUDE})
    config, (said,) = with_defaults_of(log, Config())
    assert 280.0 < config.window.from_s < 340.0
    assert 860.0 < config.window.to_s < 930.0
    assert "after take-off" in said.text
    assert "before landing" in said.text
    part = log.window(300.0, 800.0)
    assert with_defaults_of(part, Config())[0].window.to_s is None
    assert with_defaults_of(log.window(400.0, 800.0), Config())[1] == ()


def test_an_airspeed_that_fails_is_no_landing():
    """The tube blocks and drains at 700 s: nothing but the airspeed says that the aircraft stands."""
    cruise = np.where(TIME_S < 700.0, 100.0 + WAVE, 0.0)
    alone = log_of(tas=cruise, elevator=WAVE)
    level = log_of(tas=cruise, elevator=WAVE, altitude=1000.0 + 300.0 * np.minimum(TIME_S / 600.0, 1.0))
    moving = log_of(tas=cruise, elevator=WAVE, ground_speed=100.0 + WAVE)
    for log in (alone, level, moving):
        assert with_defaults_of(log, Config()) == (Config(), ())


def test_of_a_log_with_clocks_of_its_own_the_longest_stretch_without_gaps_is_taken():
    elevator = np.where((TIME_S < 10.0) | (np.abs(TIME_S - 900.0) < 1.0), np.nan, WAVE)
    plain = log_of(tas=100.0 + WAVE, elevator=elevator)
    keep = np.abs(TIME_S - 300.0) > 5.0
    log = with_rates(plain.take(keep))
    config, (said,) = with_defaults_of(log, Config())
    assert (config.window.from_s, config.window.to_s) == pytest.approx((305.2, 898.9), abs=0.3)
    assert "gaps" in said.text
    part = log.window(config.window.from_s, config.window.to_s)
    assert np.isfinite(part.channels["elevator"].values).all()
    assert with_defaults_of(plain, Config()) == (Config(), ())  # a file of the user's own is refused, see test_quality


def test_shipped_dictionaries_are_those_of_the_folder_configs():
    for name in SHIPPED:
        ours, template = load_dictionary(name), load_dictionary(CONFIGS / f"{name}_dictionary.yaml")
        assert ours.atoms == template.atoms
        assert ours.relative_to == template.relative_to


def test_entries_of_a_shipped_dictionary_act_on_the_output_of_the_analysis():
    for outputs, channel in ((["tas"], "tas"), (["ias"], "ias"), (["cas", "tas"], "tas"), (["cas", "ias"], "cas")):
        dictionary = merge(Config(), {"dictionary": "airdata", "outputs": outputs}).load_dictionary()
        assert dictionary is not None
        assert {atom.channel for atom in dictionary.atoms} == {channel}
    named = load_dictionary({"channel": "mach", "atoms": [{"shape": "bias"}]}, channel="ias")
    assert named.atoms[0].channel == "mach"


def test_a_file_of_the_name_of_a_shipped_dictionary_is_meant(
    bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.yaml").write_text("dictionary: thesis\n")
    assert bfi("dictionary", "thesis", "--json").code == 0
    (tmp_path / "thesis").write_text("atoms: [{shape: drift}]\n")
    document = json.loads(bfi("dictionary", "thesis", "--json").stdout)
    assert [atom["name"] for atom in document["atoms"]] == ["drift_tas"]
    outcome = bfi("dictionary", "airdate")
    assert outcome.code == 2
    assert outcome.stderr.endswith(
        "airdate: no such file or shipped dictionary; the shipped ones are airdata, thesis\n"
    )


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("kind", ["ulg", "bin", "tlog"])
@pytest.mark.parametrize("command", ["identify", "start-time"])
def test_logs_of_autopilots_are_identified_as_typed(bfi: Callable, tmp_path: Path, command: str, kind: str):
    path = tmp_path / f"flight.{kind}"
    if kind == "ulg":
        write_ulog(path, px4_topics())
    else:
        path.write_bytes(dataflash_bytes() if kind == "bin" else tlog_bytes(length_s=60.0))
    outcome = bfi(command, path, *(("-d", "airdata") if command == "identify" else ("--shape", "bias")), "--json")
    assert (outcome.code, outcome.stderr) == (0, "")
    document = json.loads(outcome.stdout)
    has = read_log(path).channels
    output = "tas" if "tas" in has else "ias"
    assert document["model"]["outputs"] == [output]
    assert set(document["model"]["inputs"]) <= set(has)
    assert any("the output is 'ias'" in note for note in texts(document["notes"])) == (output == "ias")
    said = any("the inputs are" in note for note in texts(document["notes"]))
    assert said == (document["model"]["inputs"] != ["elevator"])


def test_a_missing_last_sample_of_a_short_log_leaves_nothing_out():
    """Of 12 s nearly ten were left out as a landing, and a fault in them."""
    time_s = np.arange(0.0, 12.0, 0.05)
    speed = 47.0 + np.sin(time_s)
    end = np.where(time_s < time_s[-1], speed + 1.0, np.nan)
    units = {"tas": "m/s", "ground_speed": "m/s", "elevator": "rad"}
    log = made_log(time_s, units=units, tas=speed, ground_speed=end, elevator=np.sin(2.0 * time_s))
    assert with_defaults_of(log, Config()) == (Config(), ())
