"""The table of fault shapes: every signal against its formula, and every list of shapes against the table."""

import pickle
from dataclasses import fields
from inspect import Parameter, signature
from typing import get_args

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import DictionaryDocument, load_dictionary
from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.faults import Fault, fault_from_dict, unit_signal
from bfi_cli.faults.shapes import IN_DICTIONARY, SCANNED, SHAPES, FaultShape, ScannedShape, Shape

ONSET_S, WINDOW_S = 3.0, 1.0
T = np.arange(0.0, 12.0, 0.05)
CSV = "time,value\n0,1\n2,5\n4,3\n"
FORMULAS = [
    ("bias", {}, lambda t: 1.0 + 0.0 * t),
    ("drift", {}, lambda t: t - 3.0),
    ("drift", {"slope": -0.23}, lambda t: -0.23 * (t - 3.0)),
    ("sine", {"frequency_hz": 1.15, "phase_rad": 0.4}, lambda t: np.sin(2 * np.pi * 1.15 * (t - 3.0) + 0.4)),
    ("sine", {"frequency_hz": 1.15, "phase_reference": "window"}, lambda t: np.sin(2 * np.pi * 1.15 * (t - 1.0))),
    ("cosine", {"frequency_hz": 0.7, "phase_rad": -1.0}, lambda t: np.cos(2 * np.pi * 0.7 * (t - 3.0) - 1.0)),
    ("cosine", {"frequency_hz": 0.7, "phase_reference": "window"}, lambda t: np.cos(2 * np.pi * 0.7 * (t - 1.0))),
    (
        "square",
        {"frequency_hz": 0.7, "phase_rad": 0.4},
        lambda t: np.where(np.sin(2 * np.pi * 0.7 * (t - 3.0) + 0.4) >= 0.0, 1.0, -1.0),
    ),
    ("lagged_bias", {"time_constant_s": 2.0}, lambda t: 1.0 - np.exp(-(t - 3.0) / 2.0)),
    ("ramp_hold", {"duration_s": 5.0}, lambda t: np.where(t < 8.0, (t - 3.0) / 5.0, 1.0)),
    ("ramp_hold", {"duration_s": 5.0, "slope": 0.1}, lambda t: np.where(t < 8.0, 0.1 * (t - 3.0), 0.5)),
    ("decaying_bias", {"time_constant_s": 2.0}, lambda t: np.exp(-(t - 3.0) / 2.0)),
    ("free", {}, lambda t: 1.0 + 0.0 * t),
    ("scale", {}, lambda t: 1.0 + 0.0 * t),
    ("frozen", {}, lambda t: 1.0 + 0.0 * t),
    ("pitot_blocked", {}, lambda t: 1.0 + 0.0 * t),
    ("static_blocked", {}, lambda t: 1.0 + 0.0 * t),
    ("pitot_leak", {"time_constant_s": 2.0}, lambda t: 1.0 - np.exp(-(t - 3.0) / 2.0)),
    (
        "static_leak",
        {"time_constant_s": 2.0, "cabin_altitude_m": 2400.0},
        lambda t: 1.0 - np.exp(-(t - 3.0) / 2.0),
    ),
    ("pitot_icing", {}, lambda t: t - 3.0),
    ("pitot_water", {"frequency_hz": 0.3}, lambda t: np.sin(2 * np.pi * 0.3 * (t - 3.0))),
    ("samples", {"file": CSV}, lambda t: np.select([t < 5.0, t < 7.0], [1 + 2 * (t - 3.0), 5 - (t - 5.0)], 3.0)),
]


@pytest.mark.parametrize(("shape", "keys", "formula"), FORMULAS)
def test_the_signal_is_the_formula_from_the_onset_on(tmp_path, shape, keys, formula):
    if "file" in keys:
        (tmp_path / "shape.csv").write_text(keys["file"])
        keys = {"file": str(tmp_path / "shape.csv")}
    made = unit_signal(fault_from_dict({"shape": shape, "onset_s": ONSET_S, **keys}), T, window_start_s=WINDOW_S)
    after = ONSET_S - 1e-9 <= T
    np.testing.assert_allclose(made, np.where(after, formula(T), 0.0), rtol=1e-12, atol=1e-12)


def test_every_shape_has_its_formula_here():
    assert {shape for shape, _, _ in FORMULAS} == set(SHAPES)


def test_a_lagged_and_a_decaying_bias_of_one_time_constant_are_a_bias():
    pair = [Fault(shape=shape, onset_s=ONSET_S, time_constant_s=2.0) for shape in ("lagged_bias", "decaying_bias")]
    parts = [unit_signal(fault, T, window_start_s=0.0) for fault in pair]
    step = unit_signal(Fault(shape="bias", onset_s=ONSET_S), T, window_start_s=0.0)
    np.testing.assert_allclose(sum(parts), step, rtol=1e-12)


def test_an_entry_without_a_signal_cannot_be_made():
    with pytest.raises(TypeError, match="signal"):
        FaultShape(formula="1 from the onset.", kind="abrupt", label="bias")


@pytest.mark.parametrize("name", SHAPES)
def test_the_signal_takes_the_keys_of_the_entry_and_a_fault_has_them(name):
    keys = {key.name for key in SHAPES[name].keys}
    taken = {
        key for key, one in signature(SHAPES[name].signal).parameters.items() if one.kind is Parameter.KEYWORD_ONLY
    }
    if name != "bias":  # a function of numpy with keywords of its own
        assert taken == keys - {"phase_reference"}
    assert keys <= {field.name for field in fields(Fault)}


def test_a_fault_of_an_unknown_shape_cannot_be_made():
    with pytest.raises(DictionaryError, match="fault: shape: unknown shape, got 'bais'; did you mean 'bias'"):
        Fault(shape="bais")


def test_the_types_are_those_of_the_table():
    assert get_args(Shape) == tuple(SHAPES)
    assert get_args(ScannedShape) == SCANNED == tuple(name for name in SHAPES if SHAPES[name].is_scanned)


@pytest.mark.parametrize("name", SHAPES)
def test_a_configuration_takes_the_scanned_shapes_and_no_other(name):
    samples = {"start_time.samples": __file__} if name == "samples" else {}
    wanted = {"start_time.shapes": [name], **samples}
    if name in SCANNED:
        assert merge(Config(), wanted).start_time.shapes == (name,)
    else:
        with pytest.raises(ConfigError, match=f"not one of the choices, got '{name}'"):
            merge(Config(), wanted)


@pytest.mark.parametrize("name", sorted(set(SHAPES) - set(IN_DICTIONARY)))
@pytest.mark.parametrize("part", ["atoms", "grids"])
def test_a_dictionary_holds_no_shape_that_depends_on_the_flight(part, name):
    entries = [{"shape": "bias"}, {"shape": name, "onset_s": 3.0}]
    with pytest.raises(DictionaryError) as refusal:
        load_dictionary({part: entries})
    assert str(refusal.value) == (
        f"dictionary: {part}[1].shape: no log tells the signal of a trapped line, which keeps no trace of the pressure "
        f"outside, got '{name}'; use bfi diagnose, which holds the line's pressure against lift and altitude"
    )


def test_only_the_faults_of_a_pressure_line_make_other_pressures():
    assert {name for name, shape in SHAPES.items() if shape.lines is not None} == {
        name for name, shape in SHAPES.items() if shape.acts_on in ("p_static", "p_total")
    }


def test_a_dictionary_survives_the_way_to_another_process():
    keys = {"frequency_hz": 1.0, "time_constant_s": 1.0, "duration_s": 1.0, "file": __file__}
    entries = [
        {"shape": name} | {key.name: keys[key.name] for key in shape.keys if key.required}
        for name, shape in SHAPES.items()
        if name in IN_DICTIONARY
    ]
    document = DictionaryDocument.model_validate({"atoms": entries, "grids": entries})
    assert pickle.loads(pickle.dumps(document)) == document
