"""Fault dictionaries: grids, names, times, signals, and what is said of a document that cannot be used."""

import hashlib
import json
import math
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.dictionary import MAX_ATOMS, dead_reason, dead_sentences, json_schema, load_dictionary, signals
from bfi_cli.errors import DictionaryError
from bfi_cli.faults import COMMON_KEYS, Fault, fault_from_dict, unit_signal
from bfi_cli.faults.shapes import IN_DICTIONARY, KEY_RULES, LINE_SHAPES, PARAMETERS, SEARCHED, SHAPES

CONFIGS = Path(__file__).parents[2] / "configs"


def names(**document):
    return [atom.name for atom in load_dictionary(document).atoms]


def complaint(document):
    with pytest.raises(DictionaryError) as refusal:
        load_dictionary(document, where="d.yaml")
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


def test_the_document_and_the_command_line_know_the_same_keys():
    definitions = json.loads((CONFIGS / "schema" / "dictionary.json").read_text())["$defs"]
    for shape in IN_DICTIONARY:
        title = "".join(word.capitalize() for word in shape.split("_"))
        for entry in (definitions[title], definitions[f"{title}Grid"]):
            assert set(entry["properties"]) == {*COMMON_KEYS, *(key.name for key in SHAPES[shape].keys)}
            may_be_searched = PARAMETERS if shape in SEARCHED else ()
            required = {key.name for key in SHAPES[shape].keys if key.required} - {*may_be_searched}
            assert set(entry["required"]) == {"shape", *required}


VALUE = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 3), st.floats(), st.sampled_from(["window", "tas", "", "1"]), st.just([1])
)


@pytest.mark.slow
@given(
    st.sampled_from(sorted(set(IN_DICTIONARY) - {"samples", "free"})),
    st.dictionaries(st.sampled_from([*COMMON_KEYS[1:], *KEY_RULES, "onset"]), VALUE, max_size=4),
)
def test_the_document_and_the_command_line_accept_the_same_faults(shape, keys):
    atom = {"frequency_hz": 1.0, "time_constant_s": 1.0, "duration_s": 1.0}
    atom = {"shape": shape} | {key.name: atom[key.name] for key in SHAPES[shape].keys if key.name in atom} | keys
    atom = {"onset_s": 0.0} | {key: value for key, value in atom.items() if value is not None}
    # The channel of an entry of a pressure line is the output that it is looked for in; a fault of one has none.
    output = {"channel": atom.pop("channel")} if shape in LINE_SHAPES and atom.get("channel") in ("tas", "1") else {}
    try:
        one = fault_from_dict(atom)
    except DictionaryError:
        one = None
    try:
        (other,) = load_dictionary({"atoms": [{**atom, **output}]}).atoms
    except DictionaryError:
        other = None
    if shape in LINE_SHAPES and other is not None:
        assert other.channel == output.get("channel", atom.get("channel", "tas"))
        if "channel" in atom:
            return
        other = replace(other, channel="")
    assert (one is None) == (other is None)
    assert one is None or replace(other, name=one.name) == one


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6) | st.sampled_from(tuple(SHAPES)),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["atoms", "grids", "channel", "shape", "onset_s", "start", "stop", "step", "name", "file"])
            | st.text(max_size=4)
            | st.integers(),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@pytest.mark.slow
@given(
    ANYTHING
    | st.fixed_dictionaries(
        {
            "grids": st.lists(
                st.fixed_dictionaries({"shape": st.sampled_from(tuple(SHAPES)), "onset_s": ANYTHING}), max_size=3
            )
        },
        optional={"atoms": ANYTHING, "relative_to": ANYTHING},
    )
)
def test_any_data_is_a_dictionary_or_a_dictionary_error(data):
    try:
        dictionary = load_dictionary(data) if isinstance(data, dict) else load_dictionary({"atoms": data})
    except DictionaryError:
        return
    assert len({atom.name for atom in dictionary.atoms}) == len(dictionary.atoms) > 0
    assert all(math.isfinite(atom.onset_s) for atom in dictionary.atoms)


@given(st.integers(-50, 50), st.integers(0, 60), st.sampled_from([0.1, 0.25, 1.3, 2.6]))
def test_a_range_reaches_every_step_up_to_its_stop(start, count, step):
    stop = start * step + count * step
    grid = {"shape": "bias", "onset_s": {"start": start * step, "stop": stop, "step": step}}
    onsets = [atom.onset_s for atom in load_dictionary({"grids": [grid]}).atoms]
    assert onsets == pytest.approx([(start + i) * step for i in range(count + 1)], rel=1e-11, abs=1e-11)


def test_the_grid_of_the_contract():
    grid = {"shape": "bias", "channel": ["tas", "altitude_rate"], "onset_s": {"start": 2.6, "stop": 100, "step": 2.6}}
    atoms = load_dictionary({"grids": [grid]}).atoms
    assert len(atoms) == 2 * 38
    assert [atom.name for atom in atoms[:3]] == ["bias_tas_2.6", "bias_tas_5.2", "bias_tas_7.8"]
    assert atoms[-1] == Fault(shape="bias", channel="altitude_rate", onset_s=98.8, name="bias_altitude_rate_98.8")


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ({"atoms": [{"shape": "bias"}, {"shape": "bias", "name": "x"}]}, ["bias_tas", "x"]),
        ({"atoms": [{"shape": "bias"}, {"shape": "bias"}]}, ["bias_tas", "bias_tas_2"]),
        ({"atoms": [{"shape": "bias"}, {"shape": "drift", "name": "bias_tas"}]}, ["bias_tas_2", "bias_tas"]),
        ({"channel": "cas", "atoms": [{"shape": "bias", "onset_s": 1.5}]}, ["bias_cas_1.5"]),
        ({"grids": [{"shape": "bias", "name": "leak", "onset_s": [1, 2]}]}, ["leak_tas_1", "leak_tas_2"]),
        (
            {"grids": [{"shape": "sine", "frequency_hz": [0.5, 1], "onset_s": 3}]},
            ["sine_tas_3_frequency_hz_0.5", "sine_tas_3_frequency_hz_1"],
        ),
        ({"grids": [{"shape": "sine", "frequency_hz": [0.5], "onset_s": [3]}]}, ["sine_tas_3"]),
        (
            {"grids": [{"shape": "bias", "onset_s": [1, 5], "offset_s": [4, 9]}]},
            ["bias_tas_1_offset_s_4", "bias_tas_1_offset_s_9", "bias_tas_5_offset_s_9"],
        ),
    ],
)
def test_names(document, expected):
    assert names(**document) == expected


@pytest.mark.parametrize(
    ("keys", "onsets_s", "parameters"),
    [
        ({"shape": "bias"}, (-math.inf, math.inf), None),
        ({"shape": "drift", "onset_s": {"from": 20, "to": 100}}, (20.0, 100.0), None),
        ({"shape": "sine", "onset_s": {"to": 100}}, (-math.inf, 100.0), None),
        ({"shape": "sine", "frequency_hz": {"from": 0.1, "to": 0.5}}, (-math.inf, math.inf), (0.1, 0.5)),
        ({"shape": "lagged_bias", "time_constant_s": 2.0}, (-math.inf, math.inf), None),
        ({"shape": "pitot_icing"}, (-math.inf, math.inf), None),
    ],
)
def test_an_entry_without_a_number_for_its_onset_is_searched(keys, onsets_s, parameters):
    document = {"atoms": [keys, {"shape": "bias", "onset_s": 3}]}
    dictionary = load_dictionary(document)
    assert [one.name for one in dictionary.exact.atoms] == ["bias_tas_3"]
    (kind,) = dictionary.searched.atoms
    assert (kind.onset_range_s, kind.parameter_range) == (onsets_s, parameters)
    moved = load_dictionary({**document, "relative_to": "window"}).resolved(50.0)[0]
    assert moved.onset_range_s == tuple(50.0 + end for end in onsets_s)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"shape": "bias", "onset_s": {"from": 9, "to": 3}}, "onset_s: to must be after from (9), got 3; swap them"),
        ({"shape": "bias", "onset_s": {"from": 3, "until": 9}}, "onset_s.until: unknown key; known: from, to"),
        ({"shape": "sine", "onset_s": 3}, "frequency_hz: missing; add it"),
        ({"shape": "sine", "onset_s": 3, "frequency_hz": {"from": 1}}, "frequency_hz: must be a number, got "),
        ({"shape": "lagged_bias", "time_constant_s": {"from": -1}}, "time_constant_s: must be greater than 0, got -1"),
    ],
)
def test_kinds_of_fault_that_are_refused(keys, expected):
    assert complaint({"atoms": [keys]}).startswith(f"d.yaml: atoms[0].{expected}")


def test_a_shape_that_no_analysis_searches_needs_its_onset():
    said = complaint({"atoms": [{"shape": "cosine", "frequency_hz": 1, "onset_s": {"from": 9}}]})
    assert said.startswith("d.yaml: atoms[0]: onset_s: a cosine is not searched, give its onset; searched: bias, ")
    said = complaint({"atoms": [{"shape": "bias", "offset_s": 9}]})
    assert said == "d.yaml: atoms[0]: offset_s: a fault that is searched lasts; leave it out, or give its onset_s"


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ({"atoms": [{"shape": "bias", "onset": 3}]}, "d.yaml: atoms[0].onset: unknown key; did you mean 'onset_s'?"),
        ({"atom": []}, "d.yaml: atom: unknown key; did you mean 'atoms'?"),
        (
            {"atoms": [{"shape": "bais"}, {"onset_s": 1}]},
            "d.yaml: atoms[0].shape: unknown shape, got 'bais'; did you mean 'bias'? | atoms[1].shape: missing; add it",
        ),
        (
            {"atoms": [{"shape": "bias", "slope": 1}]},
            "d.yaml: atoms[0].slope: not a key of this shape; known: name, channel, magnitude, onset_s, offset_s",
        ),
        (
            {"atoms": [3, {"shape": "sine", "onset_s": "a"}]},
            "d.yaml: atoms[0]: must be a mapping of key: value, got 3 | atoms[1].onset_s: must be a number, got 'a'",
        ),
        ({"atoms": [{"shape": "bias", "onset_s": True}]}, "d.yaml: atoms[0].onset_s: must be a number, got true"),
        ({"atoms": [{"shape": "bias", "name": 3}]}, "d.yaml: atoms[0].name: must be text, got 3; put it in quotes"),
        (
            {"atoms": [{"shape": "lagged_bias", "time_constant_s": 0}]},
            "d.yaml: atoms[0].time_constant_s: must be greater than 0, got 0",
        ),
        ({"atoms": [{"shape": "drift", "slope": 0}]}, "d.yaml: atoms[0].slope: must not be 0, got 0; leave it out"),
        (
            {"atoms": [{"shape": "bias", "onset_s": 5, "offset_s": 4}]},
            "d.yaml: atoms[0]: offset_s must be after onset_s (5 s), got 4 s",
        ),
        (
            {"relative_to": "windo", "atoms": []},
            "d.yaml: relative_to: not one of the choices, got 'windo'; did you mean",
        ),
        ({}, "d.yaml: no faults; add atoms or grids"),
        (None, "d.yaml: must be a mapping of key: value, got null"),
        ({"atoms": {"shape": "bias"}}, "d.yaml: atoms: must be a list, got {'shape': 'bias'}"),
        (
            {"atoms": [{"shape": "bias", "name": "x"}, {"shape": "drift", "name": "x"}]},
            "d.yaml: atoms[1].name: 'x' is also atoms[0]; choose another",
        ),
        (
            {"grids": [{"shape": "bias", "onset_s": {"start": 1, "stop": 2, "steps": 1}}]},
            "d.yaml: grids[0].onset_s.step: missing; add it | "
            "grids[0].onset_s.steps: unknown key; did you mean 'step'?",
        ),
        (
            {"grids": [{"shape": "bias", "onset_s": {"start": 3, "stop": 2, "step": 1}}]},
            "d.yaml: grids[0].onset_s: stop must not be before start (3), got 2",
        ),
        (
            {"grids": [{"shape": "bias", "onset_s": {"start": 0, "stop": 1, "step": 1e-6}}]},
            f"d.yaml: grids[0].onset_s: more than {MAX_ATOMS} values; give a larger step",
        ),
        (
            {"grids": [{"shape": "bias", "onset_s": list(range(200)), "magnitude": list(range(200))}]},
            f"d.yaml: 40000 faults are more than {MAX_ATOMS}; give larger steps",
        ),
        ({"grids": [{"shape": "bias", "onset_s": []}]}, "d.yaml: grids[0].onset_s: must not be empty, got []"),
        ({"grids": [{"shape": "bias", "channel": ["tas", 1]}]}, "d.yaml: grids[0].channel[1]: must be text, got 1"),
        (
            {"grids": [{"shape": "sine", "frequency_hz": {"start": 0, "stop": 1, "step": 0.5}}]},
            "d.yaml: grids[0].frequency_hz: must be greater than 0, got 0",
        ),
        (
            {"grids": [{"shape": "bias", "onset_s": [5, 6], "offset_s": [1, 2]}]},
            "d.yaml: grids[0]: every offset_s is before every onset_s; swap them",
        ),
    ],
)
def test_documents_that_are_refused(document, expected):
    assert complaint(document).startswith(expected)


@pytest.mark.parametrize("file", ["none.csv", ".", "a\0b", "x" * 5000, "\u00e9" * 300])
def test_sample_files_that_cannot_be(file):
    expected = "d.yaml: atoms[0].file: no such file, got '"
    refusal = complaint({"atoms": [{"shape": "samples", "file": file}]})
    assert refusal.startswith(expected)
    assert len(refusal) < 250


def test_many_complaints_are_cut():
    assert complaint({"atoms": [{"shape": "x" * i} for i in range(1, 80)]}).endswith(" | and 74 more; mend these first")


def test_a_file_knows_its_digest_and_its_complaints_their_place(tmp_path):
    file = tmp_path / "d.yaml"
    file.write_text("atoms: [{shape: bias, onset_s: 1e-3}]\n")
    dictionary = load_dictionary(file)
    assert dictionary.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert (dictionary.path, dictionary.relative_to, dictionary.atoms[0].onset_s) == (str(file), "log", 0.001)
    assert load_dictionary(str(file)) == dictionary
    with pytest.raises(FrozenInstanceError):
        dictionary.path = ""
    file.write_text("atoms: [\n  {shape: bias, shape: drift}]\n")
    with pytest.raises(DictionaryError, match=r"d\.yaml: line 2, column 17: key 'shape' stands twice"):
        load_dictionary(file)
    with pytest.raises(DictionaryError, match=r"none\.yaml: cannot be read, no such file"):
        load_dictionary(tmp_path / "none.yaml")


def test_the_digest_of_a_mapping_is_of_what_it_says():
    one = load_dictionary({"channel": "tas", "atoms": [{"shape": "bias", "onset_s": 1}]}).sha256
    assert one == load_dictionary({"atoms": [{"onset_s": 1.0, "shape": "bias"}], "channel": "tas"}).sha256
    assert one != load_dictionary({"channel": "tas", "atoms": [{"shape": "bias", "onset_s": 2}]}).sha256


def test_sample_files_are_missed_at_once_and_read_when_needed(tmp_path):
    file = tmp_path / "d.yaml"
    file.write_text("atoms: [{shape: samples, file: shape.csv, onset_s: 2}]\n")
    with pytest.raises(DictionaryError, match=r"atoms\[0\]\.file: no such file, got '.*'; give a CSV file"):
        load_dictionary(file)
    (tmp_path / "shape.csv").write_text("nonsense")
    (atom,) = load_dictionary(file).atoms
    with pytest.raises(DictionaryError, match="times do not increase"):
        signals([atom], np.arange(5.0), ["tas"], window_start_s=0.0)
    (tmp_path / "shape.csv").write_text("0,1\n1,3\n")
    assert signals([atom], np.arange(5.0), ["tas"], window_start_s=0.0)[:, 0, 0] == pytest.approx([0, 0, 1, 3, 3])


def test_times_relative_to_the_window_move_with_it():
    document = {"atoms": [{"shape": "bias", "onset_s": 2, "offset_s": 3}, {"shape": "bias", "onset_s": 4}]}
    log = load_dictionary(document | {"relative_to": "log"})
    window = load_dictionary(document | {"relative_to": "window"})
    assert log.resolved(100.0) == log.atoms == window.atoms == window.resolved(0.0)
    assert [(atom.onset_s, atom.offset_s) for atom in window.resolved(100.0)] == [(102.0, 103.0), (104.0, None)]


def test_signals_stand_in_the_column_of_their_channel():
    faults = [Fault(shape="bias", channel="cas", onset_s=1.0), Fault(shape="drift", channel="tas", onset_s=2.0)]
    time_s = np.arange(0.0, 4.0, 0.5)
    columns = signals(faults, time_s, ("tas", "cas"), window_start_s=0.0)
    assert columns.shape == (8, 2, 2)
    np.testing.assert_array_equal(columns[:, 1, 0], unit_signal(faults[0], time_s, window_start_s=0.0))
    np.testing.assert_array_equal(columns[:, 0, 1], unit_signal(faults[1], time_s, window_start_s=0.0))
    assert not columns[:, 0, 0].any()
    assert not columns[:, 1, 1].any()
    with pytest.raises(DictionaryError, match=r"'bias' acts on 'cas', which is no output \(tas\); add --output cas"):
        signals(faults, time_s, ("tas",), window_start_s=0.0)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"onset_s": 40.0}, "'x' starts at 40 s, after the window ends (31.7 s); move its onset or widen the window"),
        ({"onset_s": 31.6}, None),
        ({"onset_s": -5.0, "offset_s": 10.0}, "'x' ends at 10 s, before the window starts (10 s); move its offset or"),
        ({"onset_s": -5.0, "offset_s": 10.1}, None),
        ({"channel": "aoa"}, "'x' acts on 'aoa', which is no output (tas); add --output aoa"),
    ],
)
def test_dead_atoms(keys, reason):
    fault = Fault(shape="bias", name="x", **keys)
    found = dead_reason(fault, 10.0, 31.7, outputs=("tas",))
    assert found is None if reason is None else found.startswith(reason)
    time_s = np.arange(100, 317) / 10.0
    assert (reason is None or "acts on" in reason) == unit_signal(fault, time_s, window_start_s=10.0).any()


def test_what_is_true_of_several_entries_is_said_once_with_all_their_names():
    late = [Fault(shape="bias", name=name, onset_s=at) for name, at in (("a", 40.0), ("b", 35.0), ("c", 40.0))]
    others = [
        Fault(shape="bias", name="seen", onset_s=20.0),
        *(Fault(shape="bias", name=name, offset_s=5.0) for name in "de"),
        *(Fault(shape="bias", name=name, channel="aoa") for name in "fg"),
    ]
    assert dead_sentences([*late, *others], 10.0, 31.7, outputs=("tas",)) == (
        "'a', 'b', 'c' start at 35 to 40 s, after the window ends (31.7 s); move their onsets or widen the window",
        "'d', 'e' end at 5 s, before the window starts (10 s); move their offsets or widen the window",
        "'f', 'g' act on 'aoa', which is no output (tas); add --output aoa",
    )
    every = [dead_reason(one, 10.0, 31.7, outputs=("tas",)) for one in (*late, *others)]
    alone = [dead_sentences([one], 10.0, 31.7, outputs=("tas",)) for one in (*late, *others)]
    assert alone == [() if reason is None else (reason,) for reason in every]


@pytest.mark.parametrize("name", ["thesis_dictionary", "listing_dictionary", "airdata_dictionary"])
def test_shipped_dictionaries_load_and_name_their_schema(name):
    file = CONFIGS / f"{name}.yaml"
    dictionary = load_dictionary(file)
    schema = file.read_text().splitlines()[0].removeprefix("# yaml-language-server: $schema=")
    assert (CONFIGS / schema).is_file()
    assert all(dead_reason(atom, 0.0, 60.0) is None for atom in dictionary.exact.resolved(0.0))


@pytest.mark.slow  # tests/lab/montecarlo/test_scenarios.py has the same definitions
def test_the_shipped_schema_is_the_one_of_the_models():
    assert json.loads((CONFIGS / "schema" / "dictionary.json").read_text()) == json_schema()


@pytest.mark.parametrize("start_s", [0.0, 250.0])
def test_the_thesis_dictionary_is_the_listing_sample_by_sample(start_s):
    n = 3172
    t = np.arange(n) / 100.0
    k = np.arange(n)
    divided = {d: math.ceil(n / d) for d in (2.3, 3, 4, 5, 6)}
    expected = [
        np.where(k >= 20, np.sin(4.5 * np.pi * t), 0),
        k >= divided[2.3],
        np.where(k >= divided[5], np.sin(2.3 * np.pi * t), 0),
        np.where(k >= divided[3], np.cos(2.25 * np.pi * t), 0),
        np.where(k >= divided[6], np.sin(0.7 * np.pi * t), 0),
        np.concatenate([np.zeros(divided[4]), 0.23 * t[: n - n // 4]]),
        k >= divided[5],
    ]
    faults = load_dictionary(CONFIGS / "thesis_dictionary.yaml").resolved(start_s)
    columns = signals(faults, t + start_s, ["tas"], window_start_s=start_s)
    np.testing.assert_allclose(columns[:, 0, :], np.column_stack(expected), atol=1e-10)


def test_the_second_dictionary_is_the_listing_sample_by_sample():
    n = 2001
    t = np.arange(n) / 100.0
    expected = [
        np.concatenate([np.zeros(500), np.ones(n - 500)]),
        np.concatenate([np.zeros(200), 0.05 * t[: n - 200]]),
        np.concatenate([np.zeros(150), np.sin(4.5 * np.pi * t[150:])]),
    ]
    faults = load_dictionary(CONFIGS / "listing_dictionary.yaml").resolved(0.0)
    columns = signals(faults, t, ["tas"], window_start_s=0.0)
    np.testing.assert_allclose(columns[:, 0, :], np.column_stack(expected), atol=1e-12)
