"""The table of options against the configuration: every option has a key, and a value comes to the same either way."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path

import click
import h5py
import pytest

from bfi_cli.commands import COMMANDS, cli
from bfi_cli.commands.options import HELP_GROUPS, OPTIONS, GroupedCommand, config_of
from bfi_cli.config import Config, load_config
from bfi_cli.errors import ConfigError

ROOT = Path(__file__).parents[2]
CLEAN, FAULTS = ROOT / "data" / "citation_clean.h5", ROOT / "configs" / "thesis_dictionary.yaml"
# What concerns one call and not the analysis: its files, what it prints, and what a file must not permit itself.
OF_ONE_CALL = {
    "together",
    "recursive",
    "list_file",
    "config_path",
    "out",
    "force",
    "append",
    "progress",
    "as_json",
    "series",
    "allow_outside",
    "verbose",
    "prove",
    "workers",
}
SPANNED = {"from_s": 5.0, "to_s": 21.5, "rate": 10, "order": 4, "feedthrough": False, "group": "flight"}
VALUES = {**SPANNED, "shapes": ("bias",), "ends": True, "frequency": (0.1, 2.0), "train": (0.0, 8.0), "draws": 2}
FILE = """
window: {from_s: 5, to_s: 21.5}
conditioning: {rate_hz: 10}
model: {order: 4, feedthrough: false}
group: flight
start_time: {shapes: [bias], ends: true, frequency_hz: [0.1, 2]}
detect: {train: [0, 8]}
diagnosability: {draws: 2}
"""


def commands() -> dict[str, click.Command]:
    found = {name: cli.get_command(click.Context(cli), name) for name in COMMANDS}
    return {name: command for name, command in found.items() if command is not None}


@pytest.mark.parametrize("name", ["identify", "start-time", "calibrate", "detect", "diagnosability", "dictionary"])
def test_every_option_of_an_analysis_has_a_key(name: str):
    options = {one.name for one in commands()[name].params if isinstance(one, click.Option)}
    assert {option for option in options - OF_ONE_CALL if not OPTIONS[str(option)].key} == set()
    assert options >= {"config_path", "channel_map", "allow_outside"}


def test_the_help_of_every_analysis_lists_each_option_once_and_the_common_ones_first():
    grouped = [name for names in HELP_GROUPS.values() for name in names]
    assert len(grouped) == len(set(grouped))
    assert set(grouped) <= OPTIONS.keys()
    for command in commands().values():
        if not isinstance(command, GroupedCommand):
            continue
        options = [one for one in command.params if isinstance(one, click.Option) and not one.hidden]
        text = command.get_help(click.Context(command, info_name="x"))
        assert all(re.search(rf"{one.opts[0]}[,\s]", text) for one in options), command.name
        if command.name in ("identify", "start-time", "detect", "diagnose"):
            assert {one.name for one in options} <= {*grouped, "help", "events_csv"}
        assert text.index("Common options:") < text.index("Output:")


@pytest.mark.parametrize("name", [name for name, row in OPTIONS.items() if row.key])
def test_every_key_is_one_of_the_configuration(name: str):
    attrgetter(str(OPTIONS[name].key))(Config())


def test_a_value_comes_to_the_same_from_the_command_line_and_from_the_file(tmp_path: Path):
    (tmp_path / "c.yaml").write_text(FILE)
    assert config_of(None, VALUES).model_dump() == load_config(tmp_path / "c.yaml").model_dump()


def test_the_command_line_wins_and_names_are_added(tmp_path: Path):
    (tmp_path / "c.yaml").write_text("{seed: 3, channels: {tas: a, aoa: b}, outputs: [aoa]}")
    given = {"allow_outside": False, "seed": 4, "channel_map": {"tas": "c"}, "unit_map": {}, "outputs": ()}
    config = config_of(str(tmp_path / "c.yaml"), given)
    assert (config.seed, config.channels, config.outputs) == (4, {"tas": "c", "aoa": "b"}, ("aoa",))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"from_s": 9.0, "to_s": 2.0}, "--from/--to: to_s must be after from_s (9 s), got 2 s"),
        ({"frequency": (2.0, 1.0)}, "--frequency: frequency_hz must be [low, high], got [2, 1]"),
        ({"samples": "x.csv"}, "--samples: samples names x.csv, but shapes has no samples; add it"),
        ({"shapes": ("samples",), "seed": -1}, "--shape: the shape samples has no file; give samples a CSV of time, "),
        ({"shapes": ("samples",), "seed": -1}, " | --seed: must be greater than or equal to 0, got -1"),
        ({"inputs": ("tas",)}, "command line: 'tas' is both an input and an output; keep one"),
    ],
)
def test_complaints_name_the_options_that_were_given(given: dict[str, object], message: str):
    with pytest.raises(ConfigError) as refused:
        config_of(None, given)
    assert message in str(refused.value)


@pytest.mark.slow
def test_the_key_group_names_the_part_of_the_file_that_is_read(bfi: Callable, tmp_path: Path):
    with h5py.File(CLEAN) as source, h5py.File(tmp_path / "two.h5", "w") as file:
        for group in ("flight", "other"):
            target = file.create_group(group)
            for name in source:
                source.copy(name, target)
    (tmp_path / "c.yaml").write_text("group: flight\n")
    words = (
        "start-time",
        tmp_path / "two.h5",
        "--rate",
        10,
        "--order",
        4,
        "--shape",
        "bias",
        "--calibration",
        "gaussian",
    )
    assert bfi(*words).code == 3
    by_option, by_key = bfi(*words, "--group", "flight", "--json"), bfi(*words, "-c", tmp_path / "c.yaml", "--json")
    assert (by_option.code, by_key.code) == (0, 0)
    assert json.loads(by_option.stdout)["statistic"] == json.loads(by_key.stdout)["statistic"]


def test_the_keys_of_calibrate_and_audit_are_those_of_their_options(bfi: Callable, tmp_path: Path):
    (tmp_path / "c.yaml").write_text("calibrate: {length_s: 16, step_s: 5}\naudit: {duration_s: 9}\n")
    quick = ("calibrate", CLEAN, "--rate", 10, "--order", 4, "--shape", "bias", "--json", "-o")
    options = bfi(*quick, tmp_path / "a.json", "--length", 16, "--step", 5)
    keys = bfi(*quick, tmp_path / "b.json", "-c", tmp_path / "c.yaml")
    assert json.loads(options.stdout)["tables"] == json.loads(keys.stdout)["tables"]
    options = bfi("dictionary", FAULTS, "--duration", 9, "--json")
    keys = bfi("dictionary", FAULTS, "-c", tmp_path / "c.yaml", "--json")
    assert json.loads(options.stdout)["atoms"] == json.loads(keys.stdout)["atoms"]
    assert json.loads(options.stdout)["window"] == json.loads(keys.stdout)["window"]
