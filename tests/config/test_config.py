"""The configuration: defaults of the contract, the command line on top, complaints by key."""

import hashlib
import json
import pickle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from bfi_cli.config import Config, json_schema, load_config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.yaml12 import load_yaml

CONFIGS = Path(__file__).parents[2] / "configs"
DEFAULTS = """
inputs: [elevator]
outputs: [tas]
channels: {}
units: {}
group: null
sample_rate_hz: null
columns: []
keep: []
fill_s: null
fix_units: false
boot: null
shown_units: si
window: {from_s: null, to_s: null}
tolerances: {}
onset_tolerance_s: 1.0
require: [abrupt, oscillating, slow]
recorder: {edge_hz: auto, kind: auto}
conditioning: {rate_hz: auto, detrend: constant, variance: running, filter: linear-phase}
model: {order: auto, orders: [2, 4, 6, 8, 12], feedthrough: null}
method: ml
risro:
  {as_published: false, max_iterations: 50, tolerance: 1e-10, sparsity: exp-l0, alpha: auto, r: auto, p0: auto,
    updates: 1}
dmae: {model: null, reference: trim, process_variance: 4e-6, measurement_variance: {}, fault_variance: 0.0,
  adaptive_window: 20}
selection: {criterion: ebic, evidence: 4.6, max_active: null, threshold: null}
dictionary: null
start_time: {shapes: [bias, drift, sine], samples: null, false_alarm: 0.01, calibration: null, ends: false,
  frequency_hz: null}
calibrate: {length_s: null, step_s: null}
detect: {train: null, false_alarm: 0.01, method: auto, turns: true}
diagnose: {false_alarm: 0.05, calibration: null, judge: true, events: []}
diagnosability: {magnitude: 1.0, magnitudes: {}, at_limit: false, model: null,
  manoeuvres: ["3211", doublet, multisine], noise: {}, amplitude_rad: 0.035, start_s: 0.2, step_s: 1.0,
  duration_s: 31.72, turbulence_m_s: 0.0, draws: 5}
audit: {duration_s: null}
seed: 0
strict: false
fail_on: null
"""


def written(tmp_path, text):
    file = tmp_path / "c.yaml"
    file.write_text(text)
    return file


def complaint(call):
    with pytest.raises(ConfigError) as refusal:
        call()
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


def keys_of(model, prefix=""):
    """Return every dotted key of a model."""
    for key, value in model:
        yield f"{prefix}{key}"
        if isinstance(value, BaseModel):
            yield from keys_of(value, f"{prefix}{key}.")


def keys_in(data, prefix=""):
    """Return every dotted key of nested mappings, the free ones of channels and units left out."""
    for key, value in data.items():
        yield f"{prefix}{key}"
        if isinstance(value, dict) and key not in ("channels", "units", "tolerances"):
            yield from keys_in(value, f"{prefix}{key}.")


def test_defaults_are_those_of_the_contract():
    assert json.loads(Config().model_dump_json()) == load_yaml(DEFAULTS)


def test_a_file_of_all_defaults_and_an_empty_file_are_the_defaults(tmp_path):
    assert load_config(written(tmp_path, DEFAULTS)).model_dump() == Config().model_dump()
    assert load_config(written(tmp_path, "# nothing\n")).model_dump() == Config().model_dump()


def test_the_example_has_every_key_and_says_the_defaults():
    example = load_config(CONFIGS / "example.yaml")
    data = load_yaml(CONFIGS / "example.yaml")
    assert list(keys_in(data)) == list(keys_of(Config()))
    changed = ("channels", "units", "tolerances", "dictionary")
    assert example.model_dump(exclude=set(changed)) == Config().model_dump(exclude=set(changed))
    assert example.load_dictionary() == load_dictionary(CONFIGS / "thesis_dictionary.yaml")


@pytest.mark.slow  # tests/lab/montecarlo/test_scenarios.py has the same definitions
def test_the_shipped_schema_is_the_one_of_the_models():
    assert json.loads((CONFIGS / "schema" / "config.json").read_text()) == json_schema()
    assert (CONFIGS / "example.yaml").read_text().startswith("# yaml-language-server: $schema=schema/config.json\n")


def test_every_key_has_help_in_the_schema_or_says_its_choices():
    schema = json.loads((CONFIGS / "schema" / "config.json").read_text())
    sections = ("Window", "Conditioning", "Model", "Selection", "StartTime", "Detect", "Diagnosability")
    parts = [schema, *(schema["$defs"][name] for name in sections)]
    bare = [
        key for part in parts for key, entry in part["properties"].items() if not entry.keys() & {"description", "$ref"}
    ]
    assert set(bare) <= {"criterion", "shapes", "seed"}


def test_a_configuration_is_not_changed(tmp_path):
    config = load_config(written(tmp_path, "seed: 3"))
    with pytest.raises(ValidationError, match="frozen"):
        config.seed = 4
    with pytest.raises(ValidationError, match="frozen"):
        config.model.order = 4
    merged = merge(config, {"seed": 4, "model.order": 2})
    assert (config.seed, config.model.order, merged.seed, merged.model.order) == (3, "auto", 4, 2)


def test_a_configuration_remembers_its_file(tmp_path):
    file = written(tmp_path, "seed: 3")
    for config in (
        load_config(file),
        merge(load_config(file), {"seed": 4}),
        pickle.loads(pickle.dumps(load_config(file))),
    ):
        assert (config.path, config.sha256) == (str(file), hashlib.sha256(b"seed: 3").hexdigest())
    assert (Config().path, Config().sha256) == (None, None)


LEAVES = {
    "seed": st.integers(0, 9),
    "strict": st.booleans(),
    "method": st.sampled_from(["ml", "risro"]),
    "inputs": st.lists(st.sampled_from(["elevator", "pitch", "rudder"]), min_size=1, max_size=3, unique=True),
    "model.order": st.integers(1, 20) | st.just("auto"),
    "model.feedthrough": st.booleans(),
    "conditioning.rate_hz": st.floats(0.1, 100.0) | st.sampled_from(["none", "auto"]),
    "window.from_s": st.floats(0.0, 10.0),
    "window.to_s": st.floats(10.5, 20.0),
    "risro.tolerance": st.floats(1e-12, 1e-2),
    "channels": st.dictionaries(st.sampled_from(["tas", "cas"]), st.just("x")),
}
OVERRIDES = st.fixed_dictionaries({}, optional=LEAVES)


def value_at(config, dotted):
    for key in dotted.split("."):
        config = getattr(config, key)
    return list(config) if isinstance(config, tuple) else config


@given(OVERRIDES, OVERRIDES)
def test_the_last_one_wins_and_the_others_stay(first, second):
    base = merge(Config(), first)
    merged = merge(base, second)
    for dotted in LEAVES:
        expected = second.get(dotted, first.get(dotted, value_at(Config(), dotted)))
        assert value_at(merged, dotted) == expected
    assert merge(merged, {}) == merged == merge(merged, dict.fromkeys(LEAVES))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("input: [a]", "input: unknown key; did you mean 'inputs'?"),
        ("model: {ordr: 2}", "model.ordr: unknown key; did you mean 'order'?"),
        ("model: {order: 0}", "model.order: must be greater than or equal to 1, got 0"),
        ("model: {order: many}", "model.order: not a number or one of the choices, got 'many'; known: auto"),
        ("model: {orders: [2, 2]}", "model.orders: a value stands twice, got [2, 2]; keep one"),
        ("model: {orders: [2, 2.5]}", "model.orders[1]: must be a whole number, got 2.5"),
        ("model: {orders: []}", "model.orders: must not be empty, got []"),
        ("model: 3", "model: must be a mapping of key: value, got 3"),
        ("conditioning: {rate_hz: -1}", "conditioning.rate_hz: must be greater than 0, got -1"),
        ("conditioning: {rate_hz: null}", "conditioning.rate_hz: must be a number, got null"),
        (
            "conditioning: {filter: causl}",
            "conditioning.filter: not one of the choices, got 'causl'; did you mean 'causal'?",
        ),
        ("strict: no", "strict: must be true or false, got 'no'"),
        ("seed: 1.5", "seed: must be a whole number, got 1.5"),
        ("inputs: elevator", "inputs: must be a list, got 'elevator'"),
        ("outputs: [elevator]", "'elevator' is both an input and an output; keep one"),
        ("channels: {tas: 3}", "channels.tas: must be text, got 3; put it in quotes"),
        ("window: {from_s: 3, to_s: 3}", "window: to_s must be after from_s (3 s), got 3 s"),
        ("start_time: {frequency_hz: [2, 1]}", "start_time: frequency_hz must be [low, high], got [2, 1]"),
        ("start_time: {false_alarm: 1}", "start_time.false_alarm: must be less than 1, got 1"),
        ("dictionary: 3", "dictionary: must be a mapping of key: value, got 3"),
        ("dictionary: {}", "dictionary: no faults; add atoms or grids"),
        (
            "dictionary: {atoms: [{shape: bias, onset: 1}]}",
            "dictionary.atoms[0].onset: unknown key; did you mean 'onset_s'?",
        ),
        ("[1]", "must be a mapping of key: value, got [1]"),
        (
            "method: mle\nseed: -1",
            "method: not one of the choices, got 'mle'; did you mean 'ml'? | seed: must be greater",
        ),
        ("a: [", "line 1, column 5: "),
    ],
)
def test_files_that_are_refused(tmp_path, text, expected):
    file = written(tmp_path, text)
    assert complaint(lambda: load_config(file)).startswith(f"{file}: {expected}")


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ({"model.ordr": 3}, "command line: model.ordr: unknown key; did you mean 'order'?"),
        ({"modl.order": 3}, "command line: modl: unknown key; did you mean 'model'?"),
        ({"seed.x": 1}, "command line: seed: must be a whole number, got {'x': 1}"),
        ({"window.from_s": 9.0, "window.to_s": 2.0}, "command line: window: to_s must be after from_s (9 s), got 2 s"),
        ({"": 1}, "command line: '': unknown key"),
    ],
)
def test_overrides_that_are_refused(overrides, expected):
    assert complaint(lambda: merge(Config(), overrides)).startswith(expected)


def test_a_dictionary_is_found_beside_the_configuration(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "d.yaml").write_text("atoms: [{shape: bias, onset_s: 3}]")
    config = load_config(written(tmp_path, "dictionary: sub/d.yaml"))
    assert config.dictionary == str(tmp_path / "sub" / "d.yaml")
    assert config.load_dictionary() == load_dictionary(tmp_path / "sub" / "d.yaml")
    assert merge(config, {"seed": 1}).dictionary == config.dictionary
    assert merge(config, {"dictionary": "other.yaml"}).dictionary == "other.yaml"
    with pytest.raises(DictionaryError, match=r"none\.yaml: cannot be read"):
        load_config(written(tmp_path, "dictionary: none.yaml")).load_dictionary()
    assert Config().load_dictionary() is None


def test_a_dictionary_in_the_configuration_and_its_sample_files(tmp_path):
    text = "dictionary: {atoms: [{shape: samples, file: s.csv}], grids: [{shape: bias, onset_s: [1, 2]}]}"
    expected = "dictionary.atoms[0].file: no such file, got"
    assert expected in complaint(lambda: load_config(written(tmp_path, text)))
    (tmp_path / "s.csv").write_text("0,1\n1,2\n")
    config = load_config(written(tmp_path, text))
    found = config.load_dictionary()
    assert [atom.name for atom in found.atoms] == ["samples_tas_0", "bias_tas_1", "bias_tas_2"]
    assert found.atoms[0].file == str(tmp_path / "s.csv")
    assert found.path == f"{tmp_path / 'c.yaml'}: dictionary"
    assert merge(config, {"seed": 1}).load_dictionary() == found


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6) | st.sampled_from(["auto", "ml"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["order", "orders", "rate_hz", "from_s", "shapes", "atoms", "shape"]) | st.integers(),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(list(keys_of(Config()))) | st.text(max_size=6), ANYTHING, max_size=4))
def test_any_data_is_a_configuration_or_a_config_error(overrides):
    before = repr(overrides)
    try:
        config = merge(Config(), overrides)
    except ConfigError:
        config = Config()
    assert repr(overrides) == before
    assert merge(Config(), config.model_dump()).model_dump() == config.model_dump()
