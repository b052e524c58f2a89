"""The document of `bfi identify`: its keys, and that nothing is lost on the way to JSON and back."""

import copy
import json
import math
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_results import PROVENANCE, fault_result, inconclusive_result, no_fault_result

from bfi_cli.errors import ConfigError
from bfi_cli.model.result import Candidate, identify_document, identify_from_document

CONTRACT_KEYS = {
    "": {"kind", "schema", "log", "decision", "verdicts", "faults", "candidates", "model", "vaf", "solver", "notes"},
    "log": {"path", "rate_hz", "n_samples", "start_s", "stop_s"},
    "candidates.0": {"name", "state", "magnitude", "sd", "minimal_detectable", "excluded_above", "effect", "note"},
    "model": {"order", "rate_hz", "inputs", "outputs", "noise_sd"},
    "vaf": {"output", "fault"},
    "solver": {"method", "termination", "iterations", "condition_number"},
    "faults.0": {
        *("name", "shape", "channel", "magnitude", "unit", "physical", "sd", "ci95", "onset_s", "offset_s"),
        *("frequency_hz", "phase_rad", "time_constant_s", "duration_s"),
    },
    "faults.0.physical": {"value", "unit"},
    "provenance": {"version", "log_sha256", "config_sha256", "dictionary_sha256", "seed", "numpy", "scipy", "command"},
}


def through_json(document):
    return json.loads(json.dumps(document, allow_nan=False))


def at(document, path):
    for key in filter(None, path.split(".")):
        document = document[int(key) if key.isdigit() else key]
    return document


def test_document_and_result_are_inverse(result, provenance):
    document = through_json(identify_document(result, provenance))
    again = identify_document(*identify_from_document(document))
    assert through_json(again) == document


def test_the_result_read_back_is_the_same(provenance):
    made = fault_result()
    read, origin = identify_from_document(through_json(identify_document(made, provenance)))
    assert origin == provenance
    assert_same(read, made)


def assert_same(left, right):
    """Compare field by field; NaN equals NaN."""
    assert type(left) is type(right)
    for field in fields(left):
        a, b = getattr(left, field.name), getattr(right, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b)
        elif isinstance(a, tuple) and a and is_dataclass(a[0]):
            for one, other in zip(a, b, strict=True):
                assert_same(one, other)
        elif is_dataclass(a):
            assert_same(a, b)
        elif field.name != "inputs":
            assert a == b, field.name


def test_arrays_read_back_are_read_only(provenance):
    read, _ = identify_from_document(identify_document(fault_result(), provenance))
    with pytest.raises(ValueError, match="read-only"):
        read.outputs[0].measured[0] = 0.0


@given(value=st.floats(allow_nan=True, allow_infinity=True))
def test_every_number_survives_or_becomes_null(value):
    made = no_fault_result()
    candidate = replace(made.candidates[0], magnitude=value)
    document = through_json(identify_document(replace(made, candidates=(candidate,)), PROVENANCE))
    assert document["candidates"][0]["magnitude"] == (value if math.isfinite(value) else None)


def test_not_finite_is_null(provenance):
    document = identify_document(inconclusive_result(), provenance)
    assert document["solver"]["condition_number"] is None
    assert document["candidates"][0]["minimal_detectable"] is None
    assert document["series"]["outputs"][0]["predicted"][:5].count(None) == 4
    json.dumps(document, allow_nan=False)


@pytest.mark.parametrize("path", CONTRACT_KEYS)
def test_keys_of_the_contract(path, provenance):
    document = identify_document(fault_result(), provenance)
    assert CONTRACT_KEYS[path] <= set(at(document, path))


def test_values_of_the_contract(provenance):
    document = identify_document(fault_result(), provenance)
    assert (document["kind"], document["schema"], document["decision"]) == ("identify", 4, "fault")
    fault = document["faults"][0]
    assert fault["ci95"] == [3.989, 4.017]
    assert fault["physical"] == {"value": 4.003, "unit": "m/s"}
    assert fault["phase_rad"] is None, "a bias has no phase"
    assert document["vaf"] == {"output": {"tas": 99.99}, "fault": {"tas": 99.998}}
    assert identify_document(inconclusive_result(), provenance)["vaf"]["fault"] is None


def test_keys_added_later_do_not_hurt(provenance):
    document = identify_document(fault_result(), provenance)
    document["model"]["new"] = document["new"] = document["faults"][0]["new"] = 1
    identify_from_document(document)


def change(path, value):
    def changed(document):
        *way, last = path.split(".")
        at(document, ".".join(way))[int(last) if last.isdigit() else last] = value

    return changed


def drop(path):
    def changed(document):
        *way, last = path.split(".")
        del at(document, ".".join(way))[last]

    return changed


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (drop("kind"), "x.json: not a result of this program, it has no 'kind'; give"),
        (change("kind", "detect"), "x.json: kind is 'detect', not 'identify'; give"),
        (change("schema", 1), "x.json: schema is 1, this program reads 4; run bfi identify again"),
        (drop("log.path"), "x.json: log: no key 'path'; the file is damaged"),
        (drop("series"), "x.json: no key 'series'; the file is damaged"),
        (change("series", 3), "x.json: series: not a mapping, got 3; the file is damaged"),
        (change("model.order", "four"), "x.json: model.order: not an integer, got 'four'; the file is damaged"),
        (change("decision", "maybe"), "x.json: decision: not 'fault' or 'no_fault' or 'inconclusive', got 'maybe'"),
        (change("faults.0.sd", "small"), "x.json: faults[0].sd: not a number, got 'small'; the file is damaged"),
        (change("faults.0.ci95", [1.0]), "x.json: faults[0].ci95: not 2 entries, got [1.0]; the file is damaged"),
        (change("faults", None), "x.json: faults: not a list, got None; the file is damaged"),
        (change("series.outputs.0.measured", [1.0]), "x.json: series.outputs[0].measured: 1 numbers instead of 317"),
        (change("series.time_s", ["a"]), "x.json: time_s: not a list of numbers, got ['a']; the file is damaged"),
        (change("order_selection.orders", [4]), "x.json: order_selection.criterion_no_fault: 5 numbers instead of 1"),
        (change("series.outputs", []), "x.json: series: 317 samples of 0 outputs"),
    ],
)
def test_damaged_documents_are_named_in_one_line(damage, message, provenance):
    document = copy.deepcopy(through_json(identify_document(fault_result(), provenance)))
    damage(document)
    with pytest.raises(ConfigError) as caught:
        identify_from_document(document, where="x.json")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("document", [None, [], 3, "identify", {}])
def test_anything_else_is_no_result(document):
    with pytest.raises(ConfigError, match=r"^result: not a result of this program"):
        identify_from_document(document)


def test_absent_and_unknown_stay_apart(provenance):
    made = no_fault_result()
    absent = Candidate(
        **{**dict.fromkeys(f.name for f in fields(Candidate)), "name": "a", "channel": "tas", "unit": ""}
    )
    absent = replace(absent, shape="bias", kind="abrupt", channel_unit="", onsets_checked=())
    read, _ = identify_from_document(identify_document(replace(made, candidates=(absent,)), provenance))
    assert read.candidates[0].magnitude is None
