"""The registry of methods: what each says it gives, it gives; what it lacks, it names."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, LogError
from bfi_cli.flightlog import read_log
from bfi_cli.methods import METHODS
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import find_onset
from bfi_cli.model.preprocessing.window import prepare_window, regression_of
from bfi_cli.model.selection import MethodResult

DATA = Path(__file__).parents[2] / "data"
GIVEN = {"dmae.model": "citation"}
EVERY_METHOD = pytest.mark.parametrize("name", METHODS)


@pytest.fixture(scope="module")
def log():
    return read_log(DATA / "citation_bias.h5")


def settings(name, **overrides):
    needs = {key: GIVEN[key] for key in METHODS[name].needs}
    return merge(Config(), {"method": name, **needs, **overrides})


@pytest.mark.first_rows(6)
@EVERY_METHOD
def test_a_method_gives_what_it_says(log, thesis, name):
    """At 10 Hz and order 6; the log holds a bias of 4 m/s from 13.8 s."""
    config = settings(name, **{"conditioning.rate_hz": 10.0, "model.order": 6})
    module, _, function = METHODS[name].function.partition(":")
    window = prepare_window(log, thesis, config)
    regression = regression_of(window, config)
    found = getattr(import_module(f"bfi_cli.{module}"), function)(window, regression, config)
    assert isinstance(found, MethodResult)
    n_live, declared = len(window.live), list(found.atoms)
    assert found.magnitudes.value.shape == found.magnitudes.variance.shape == (n_live,)
    assert found.magnitudes.covariance.shape == (len(declared), len(declared))
    assert found.error.shape == found.plain_error.shape
    assert 0 < len(found.error) <= len(window.signals.time_s)
    assert "bias_13.8" in [window.names[window.live[n]] for n in declared]
    assert np.isfinite(found.magnitudes.value[declared]).all()
    if METHODS[name].intervals:
        assert (found.magnitudes.variance[declared] > 0).all()
    others = np.delete(found.magnitudes.value, declared)
    assert np.isfinite(others).all() if METHODS[name].candidates else np.isnan(others).all()
    assert regression.layout.feedthrough == METHODS[name].feedthrough


@EVERY_METHOD
def test_a_method_of_one_output_refuses_two(log, thesis, name):
    quick = {"conditioning.rate_hz": 5.0, "model.order": 3, "onset_tolerance_s": 0.0}
    config = settings(name, outputs=["tas", "aoa"], **quick)
    if METHODS[name].several_outputs:
        assert identify_faults(log, thesis, config).model.outputs == ("tas", "aoa")
    else:
        with pytest.raises(ConfigError, match=f"^--method {name}: works on one output, got 2; give one --output"):
            identify_faults(log, thesis, config)


@pytest.mark.parametrize("rule", [{}, {"selection.threshold": 0.05}])
def test_risro_of_two_outputs_names_the_fault_of_one(log, thesis, rule):
    found = identify_faults(log, thesis, settings("risro", outputs=["tas", "aoa"], **{"model.order": 4}, **rule))
    assert found.model.outputs == ("tas", "aoa")
    assert {fault.name for fault in found.faults} >= {"bias_13.8"}


def test_the_published_key_refuses_two_outputs(log, thesis):
    with pytest.raises(ConfigError, match=r"^risro\.as_published: .* works on one output, got 2; give one --output"):
        identify_faults(log, thesis, settings("risro", outputs=["tas", "aoa"], **{"risro.as_published": True}))


def test_risro_as_published_is_risro_with_its_key(log, thesis):
    rate = {"conditioning.rate_hz": 10.0, "model.order": 4}
    one = identify_faults(log, thesis, settings("risro-as-published", **rate))
    other = identify_faults(log, thesis, settings("risro", **rate, **{"risro.as_published": True}))
    imposed = identify_faults(log, thesis, settings("risro", **rate))
    assert one.faults == other.faults != imposed.faults
    assert (one.solver.method, other.solver.method) == ("risro-as-published", "risro")


def test_an_unknown_method_is_refused_with_the_nearest():
    with pytest.raises(ConfigError, match="not one of the choices, got 'dmea'; did you mean 'dmae'"):
        merge(Config(), {"method": "dmea"}, where="--method")


@pytest.mark.parametrize("name", ["dmae", "risro-as-published"])
def test_the_scan_refuses_a_method_that_has_no_onsets(log, name):
    with pytest.raises(ConfigError, match=f"^method: start-time has ml and risro, got {name}; give --method"):
        find_onset(log, settings(name))


def test_dmae_refuses_what_it_cannot_work_with(log, thesis):
    with pytest.raises(LogError, match=r"citation_bias\.h5: method dmae needs a model, .*; give --model NAME"):
        identify_faults(log, thesis, merge(Config(), {"method": "dmae"}))
    short = read_log(DATA / "citation_bias.csv").window(None, 30.0)
    with pytest.raises(LogError, match=r"csv: method dmae needs aoa, pitch, pitch_rate of the model 'citation'; "):
        identify_faults(short, thesis, settings("dmae"))
    for model in ("citatoin", "f16"):
        with pytest.raises(ConfigError, match=f"^dmae.model: no linear model, got '{model}'; "):
            identify_faults(log, thesis, settings("dmae", **{"dmae.model": model}))
    pitch = load_dictionary({"channel": "altitude", "atoms": [{"shape": "bias", "onset_s": 9}]})
    with pytest.raises(LogError, match="no channel 'altitude'"):
        identify_faults(log, pitch, settings("dmae", outputs=["altitude"]))


@pytest.mark.slow
def test_dmae_explains_the_course_it_estimates_by_the_dictionary(thesis):
    result = identify_faults(read_log(DATA / "citation_two_faults.h5"), thesis, settings("dmae"))
    assert result.decision == "fault"
    assert result.truth.isolated
    assert result.truth.magnitude_error < 0.2
    assert all(np.isnan([fault.sd, *fault.ci95]).all() for fault in result.faults)
    assert [one.sd for one in result.candidates] == [None] * len(thesis.atoms)
    assert "more probable than not from 6.35 s on" in texts(result.notes)[0]


def test_dmae_declares_nothing_on_a_clean_log(thesis):
    result = identify_faults(read_log(DATA / "citation_clean.h5"), thesis, settings("dmae", **{"window.to_s": 15.0}))
    assert (result.decision, result.faults) == ("inconclusive", ()), "a method without intervals excludes nothing"
    assert "never exceeds" in texts(result.notes)[0]


@pytest.mark.slow
def test_what_dmae_finds_beside_the_dictionary_is_a_fault_without_a_name(log, thesis):
    late = load_dictionary({"channel": "tas", "atoms": [{"name": "late", "shape": "bias", "onset_s": 17.0}]})
    result = identify_faults(log, late, settings("dmae", **{"window.to_s": 20.0}))
    assert result.decision == "fault"
    assert "the entries of the dictionary explain" in texts(result.notes)[1]
