"""Grids: every combination once, random numbers that depend on the trial alone, complaints by key."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.errors import BfiError, ConfigError
from bfi_cli.lab.montecarlo import Sweep, load_sweep
from bfi_cli.lab.montecarlo.definition import json_schema
from bfi_cli.lab.montecarlo.trial import draw

CONFIGS = Path(__file__).parents[3] / "configs"
HEAD = "record: {model: citation}\ndictionary: dictionary.yaml\n"


def test_every_combination_is_a_scenario(sweep: Callable[..., Sweep]):
    whole = sweep(
        "record: [{model: citation}, {model: citation, manoeuvre: doublet}]\n"
        "dictionary: [dictionary.yaml, dictionary.yaml]\nnoise: {tas: [0, 0.1], aoa: 0.01}\nactive: [0, 1, 2]\n"
        "grid: {method: [ml, risro], conditioning.rate_hz: [none, 5.0], model.order: 4}\n"
    )
    assert len(whole.scenarios) == 2 * 2 * 2 * 3 * 4
    assert len({scenario.name for scenario in whole.scenarios}) == len(whole.scenarios)
    one = whole.scenarios[-1]
    assert one.setting.config.method == "risro"
    assert one.setting.config.conditioning.rate_hz == 5.0
    assert one.setting.config.model.order == 4
    assert one.setting.noise == (("tas", 0.1), ("aoa", 0.01))
    assert one.name == (
        "record=citation-doublet dictionary=dictionary-2 noise.tas=0.1 active=2 method=risro conditioning.rate_hz=5.0"
    )


def test_seeds_are_those_of_spawned_sequences(sweep: Callable[..., Sweep]):
    whole = sweep("noisy", trials=2)
    for trial in whole.trials():
        (of_dictionary,) = np.random.SeedSequence(whole.seed).spawn(1)
        of_active = of_dictionary.spawn(3)[trial.scenario.n_active]
        child = of_active.spawn(trial.number + 1)[trial.number]
        assert trial.seed == child.generate_state(1, np.uint64)[0]


def test_a_longer_sweep_begins_with_a_shorter_one(sweep: Callable[..., Sweep]):
    shorter, longer = list(sweep("noisy", trials=2).trials()), list(sweep("noisy", trials=5).trials())
    assert longer[: len(shorter)] == shorter


def test_noise_levels_and_methods_meet_the_same_faults(sweep: Callable[..., Sweep]):
    whole = sweep(f"{HEAD}noise: {{tas: [0, 1]}}\nactive: 2\ntrials: 9\ngrid: {{method: [ml, risro]}}\n")
    by_number: dict[int, set[int]] = {}
    for trial in whole.trials():
        by_number.setdefault(trial.number, set()).add(trial.seed)
    assert all(len(seeds) == 1 for seeds in by_number.values())
    assert len(set.union(*by_number.values())) == 9
    assert sweep("noisy", seed=1).digest != sweep("noisy").digest


def test_faults_are_drawn_as_the_sweep_says(sweep: Callable[..., Sweep]):
    whole = sweep(f"{HEAD}active: 2\ntrials: 300\nmagnitudes: {{low: 3, high: 5}}\n")
    rng = np.random.default_rng(0)
    drawn = [draw(trial, rng) for trial in whole.trials()]
    assert all(len(truth) == 2 for truth in drawn)
    assert {z for truth in drawn for z in truth.values()} == {3.0, 4.0, 5.0}
    counts = np.array([sum(name in truth for truth in drawn) for name in ("bias", "sine", "drift")])
    assert np.all(np.abs(counts - 200) < 5 * np.sqrt(300 * 2 / 9))


def test_shipped_sweep_is_that_of_the_thesis():
    whole = load_sweep(CONFIGS / "montecarlo_thesis.yaml")
    assert [scenario.n_active for scenario in whole.scenarios if scenario.setting.config.method == "ml"] == [
        *range(1, 8)
    ]
    assert len(whole.scenarios) == 14
    assert whole.n_trials == 100
    assert whole.scenarios[0].sizes == tuple(range(1, 11))


@pytest.mark.parametrize(
    ("text", "complaints"),
    [
        ("", ["record: missing; add it", "dictionary: missing", "active: missing"]),
        (f"{HEAD}active: 1\nnose: {{}}\n", ["nose: unknown key; did you mean 'noise'?"]),
        (
            f"{HEAD}active: -1\ntrials: 0\n",
            ["active[0]: must be greater than or equal to 0, got -1", "trials: must be"],
        ),
        (f"{HEAD}active: 4\n", ["active: more than the 3 faults of", "got 4; lower it"]),
        (f"{HEAD}active: [1, 1]\n", ["a value stands twice, got two scenarios 'active=1'; keep one"]),
        (f"{HEAD}active: []\n", ["active: must not be empty"]),
        (f"{HEAD}active: 1\nnoise: {{tas: -1}}\n", ["noise.tas[0]: must be greater than or equal to 0, got -1"]),
        (f"{HEAD}active: 1\nmagnitudes: {{low: 2, high: 1}}\n", ["magnitudes: high must be at least low (2), got 1"]),
        (f"{HEAD}active: 1\nmagnitudes: {{low: -2, high: 1}}\n", ["magnitudes: 0 is no fault; leave it out"]),
        (f"{HEAD}active: 1\nmagnitudes: [1, 0]\n", ["magnitudes: 0 is no fault; leave it out"]),
        (
            f"{HEAD}active: 1\ngrid: {{modle.order: 4, method: [ml, rsro]}}\n",
            ["grid.modle: unknown key; did you mean 'model'?", "grid.method: not one of the choices, got 'rsro'"],
        ),
        (f"{HEAD}active: 1\ngrid: {{dictionary: a.yaml}}\n", ["name it at the top, as dictionary"]),
        (f"{HEAD}active: 1\nidentify: {{model: {{order: 0}}}}\n", ["identify.model.order: must be"]),
        ("record: {model: citatoin}\ndictionary: x\nactive: 1\n", ["record[0].model: no such model", "'citation'?"]),
        (
            "record: {model: citation, manoeuvre: 3211, rate: 1}\ndictionary: x\nactive: 1\n",
            ["record[0].manoeuvre: must be text, got 3211; put it in quotes", "record[0].rate: unknown key"],
        ),
        ("record: {lgo: x.h5}\ndictionary: x\nactive: 1\n", ["record[0].model: missing", "record[0].lgo: unknown key"]),
        ("record: {log: x.h5}\ndictionary: missing.yaml\nactive: 1\n", ["missing.yaml: cannot be read"]),
    ],
)
def test_complaints(sweep: Callable[..., Sweep], text: str, complaints: list[str]):
    with pytest.raises(BfiError) as refusal:
        sweep(text)
    message = str(refusal.value)
    assert "\n" not in message
    for complaint in complaints:
        assert complaint in message


def test_all_complaints_come_at_once(sweep: Callable[..., Sweep]):
    with pytest.raises(ConfigError, match=r"active: missing.*\| trials:"):
        sweep(f"{HEAD}trials: many\n")


@pytest.mark.slow
def test_the_shipped_schema_is_the_one_of_the_rules():
    assert json.loads((CONFIGS / "schema" / "montecarlo.json").read_text()) == json_schema()
    assert "$schema=schema/montecarlo.json" in (CONFIGS / "montecarlo_thesis.yaml").read_text().splitlines()[0]


@pytest.mark.parametrize(("name", "part"), [("config", "Config"), ("dictionary", "DictionaryDocument")])
def test_the_shipped_schemas_say_the_same_of_the_same(name: str, part: str):
    """That of a sweep holds those of a configuration and of a dictionary, which are dear to make anew."""
    schemas = {key: json.loads((CONFIGS / "schema" / f"{key}.json").read_text()) for key in (name, "montecarlo")}
    whole, definitions = schemas[name], schemas["montecarlo"]["$defs"]
    named = {"$schema", "$defs", "title"}
    assert {key: value for key, value in whole.items() if key not in named} | {"title": part} == definitions[part]
    assert {key: definitions[key] for key in whole["$defs"]} == whole["$defs"]
