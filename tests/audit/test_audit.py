"""The audit of a dictionary: what it must be equal to, what it must not depend on, and what it says of bad entries."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noted import texts
from scipy import stats

from bfi_cli.aircraft import MODELS, flight_of
from bfi_cli.audit import audit_content, audit_dictionary, audit_document, audit_on_log
from bfi_cli.audit.entries import AuditWindow, oddities, same_definition, span_of
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import Channel, FlightLog, read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import search_onsets
from bfi_cli.model.preprocessing.window import prepare_window, with_inputs_of
from bfi_cli.serialization import provenance, to_json

ROOT = Path(__file__).parents[2]
THESIS = ROOT / "configs" / "thesis_dictionary.yaml"
WHOLE = {"shape": "sine", "frequency_hz": 0.5, "name": "whole", "onset_s": 0}
EXACT = merge(Config(), {"onset_tolerance_s": 0.0})
ORDER_4 = merge(EXACT, {"model.order": 4})


@pytest.fixture(scope="module")
def clean():
    return read_log(ROOT / "data" / "citation_clean.h5")


@pytest.fixture(scope="module")
def on_clean(clean):
    return audit_on_log(clean, load_dictionary(THESIS), ORDER_4)


def dictionary(*atoms, **keys):
    return load_dictionary({"relative_to": "window", "atoms": list(atoms), **keys}, where="d.yaml")


def atom(found, name):
    return next(entry for entry in found.atoms if entry.name == name)


def test_the_limits_are_those_of_an_identification_that_declares_nothing(clean, on_clean):
    result = identify_faults(clean, load_dictionary(THESIS), ORDER_4)
    assert result.faults == ()
    expected = [candidate.minimal_detectable for candidate in result.candidates]
    np.testing.assert_allclose([entry.minimal_detectable for entry in on_clean.atoms], expected, rtol=1e-6)


def test_the_coherence_is_that_of_the_predictor_written_out(clean, on_clean):
    signals = prepare_window(clean, load_dictionary(THESIS), ORDER_4).signals
    u, y, theta = signals.u, signals.y[:, 0], np.asarray(signals.theta)[:, 0, :]
    past = [y[4 - i : len(y) - i] for i in range(1, 5)]
    X = np.column_stack([np.ones(len(y) - 4), *past, *(u[4 - i : len(y) - i, 0] for i in range(5))])
    K = np.linalg.lstsq(X - X.mean(axis=0), y[4:] - y[4:].mean(), rcond=None)[0][1:5]
    g = theta[4:] - sum(K[i - 1] * theta[4 - i : len(y) - i] for i in range(1, 5))
    Q = np.linalg.qr(X / np.linalg.norm(X, axis=0))[0]
    g -= Q @ (Q.T @ g)
    g /= np.linalg.norm(g, axis=0)
    np.testing.assert_allclose(on_clean.signatures.coherence, np.abs(g.T @ g), atol=1e-5)


def test_coherence_is_symmetric_with_a_unit_diagonal(on_clean):
    coherence = on_clean.signatures.coherence
    np.testing.assert_array_equal(coherence, coherence.T)
    np.testing.assert_array_equal(np.diag(coherence), 1.0)
    for n, entry in enumerate(entry for entry in on_clean.atoms if entry.live):
        assert entry.coherence == np.max(np.delete(coherence[n], n))


def test_a_slope_changes_the_magnitude_and_nothing_that_is_measured(clean):
    drift = {"shape": "drift", "onset_s": 8}
    found = audit_on_log(clean, dictionary({**drift, "name": "a", "slope": 0.25}), ORDER_4).atoms[0]
    other = audit_on_log(clean, dictionary({**drift, "name": "a"}), ORDER_4).atoms[0]
    assert found.minimal_detectable == pytest.approx(4.0 * other.minimal_detectable, rel=1e-9)
    assert (found.unit, other.unit) == ("", "m/s^2")
    assert found.minimal_physical == (pytest.approx(other.minimal_detectable, rel=1e-9), "m/s^2")
    assert found.minimal_peak == pytest.approx(other.minimal_peak, rel=1e-9)


def test_the_unit_of_the_output_scales_the_limits(clean):
    tas = clean.channel("tas")
    scaled = replace(clean, channels={**clean.channels, "tas": replace(tas, values=1000.0 * tas.values)})
    entries = dictionary({"shape": "bias", "onset_s": 12}, {"shape": "drift", "onset_s": 9})
    before, after = (audit_on_log(log, entries, ORDER_4) for log in (clean, scaled))
    for a, b in zip(before.atoms, after.atoms, strict=True):
        assert b.minimal_detectable == pytest.approx(1000.0 * a.minimal_detectable, rel=1e-6)
    np.testing.assert_allclose(after.signatures.coherence, before.signatures.coherence, atol=1e-6)


def test_faults_injected_into_the_log_do_not_matter(on_clean):
    found = audit_on_log(read_log(ROOT / "data" / "citation_bias.h5"), load_dictionary(THESIS), ORDER_4)
    for entry, expected in zip(found.atoms, on_clean.atoms, strict=True):
        assert entry.minimal_detectable == pytest.approx(expected.minimal_detectable, rel=1e-6)
    assert any("injected" in note for note in texts(found.notes))
    assert not any("injected" in note for note in texts(on_clean.notes))


def test_a_fault_that_nobody_knows_of_is_suspected(on_clean):
    found = audit_on_log(read_log(ROOT / "data" / "citation_bias.csv"), load_dictionary(THESIS), ORDER_4)
    assert any(note.startswith("'tas' jumps away from its prediction at 13.7 s") for note in texts(found.notes))
    assert atom(found, "bias_13.8").minimal_detectable > 3.0 * atom(on_clean, "bias_13.8").minimal_detectable


def test_two_outputs_share_the_dictionary_but_not_the_signatures(clean):
    config = merge(ORDER_4, {"outputs": ["tas", "pitch"]})
    bias = {"shape": "bias", "onset_s": 12}
    found = audit_on_log(clean, dictionary({**bias, "name": "v"}, {**bias, "name": "p", "channel": "pitch"}), config)
    assert [entry.unit for entry in found.atoms] == ["m/s", "rad"]
    assert set(found.model.noise_sd) == {"tas", "pitch"}
    assert 0.0 <= found.signatures.coherence[0, 1] < 1.0


def second_order_log():
    rng, u = np.random.default_rng(0), np.sign(np.sin(0.05 * np.arange(400)))
    y = np.zeros(400)
    for k in range(2, 400):
        y[k] = 1.6 * y[k - 1] - 0.7 * y[k - 2] + 0.1 * u[k - 1] + 0.01 * rng.normal()
    channels = {
        "elevator": Channel(name="elevator", values=frozen_array(u), unit="rad", source="elevator"),
        "tas": Channel(name="tas", values=frozen_array(y), unit="m/s", source="tas"),
    }
    return FlightLog(path="made.h5", time_s=frozen_array(np.arange(400) / 10.0), channels=channels)


def test_an_atom_whose_onset_the_lags_swallow_is_seen_nowhere():
    entries = dictionary({"shape": "bias", "onset_s": 0.45, "name": "early"}, {"shape": "bias", "onset_s": 15})
    config = merge(EXACT, {"model.orders": [2, 12], "conditioning.rate_hz": "none"})
    found = audit_on_log(second_order_log(), entries, config)
    early = found.atoms[0]
    assert found.model.order == 2
    assert (early.live, early.minimal_detectable, early.coherence) == (True, None, None)
    assert "obeys an equation of order 1 after the first 12 samples, which the model's lags use up" in early.note
    assert np.isnan(found.signatures.coherence[0]).all()
    assert any(
        note.startswith("the inputs and lags of the model explain all of 'early'") for note in texts(found.notes)
    )
    assert (found.signatures.among.rank, found.signatures.among.condition_number) == (1, pytest.approx(1.0))


def test_a_late_atom_is_limited_by_its_prediction_error_alone():
    """A step through 1 - 1.6 q + 0.7 q^2 leaves 1, -0.6, 0.1, 0.1, ...; the constant takes half of the tail."""
    entries = dictionary({"shape": "bias", "onset_s": 20, "name": "step"})
    config = merge(EXACT, {"model.order": 2, "conditioning.rate_hz": "none"})
    found = audit_on_log(second_order_log(), entries, config)
    g_norm = np.sqrt(1.0 + 0.36 + 198 * 0.05**2)
    deviations = np.sqrt(np.log(398) + 6.0) + stats.norm.isf(0.1)
    # Larger by what the same step shows at other onsets of this record, and no smaller.
    assert 0.9 < found.atoms[0].minimal_detectable / (deviations * 0.01 / g_norm) < 1.5


def test_an_onset_within_the_lags_of_a_fault_that_ends_is_said():
    entries = dictionary({"shape": "bias", "onset_s": 0.45, "offset_s": 20, "name": "early"})
    config = merge(Config(), {"model.orders": [2, 12], "conditioning.rate_hz": "none"})
    (early,) = audit_on_log(second_order_log(), entries, config).atoms
    assert early.note == (
        "'early' starts within the first 12 samples, which the model's lags use up; start the window earlier"
    )


@pytest.mark.parametrize("with_log", [True, False])
def test_only_what_acts_over_the_whole_window_can_be_absorbed(clean, with_log):
    entries = dictionary(
        WHOLE,
        {**WHOLE, "name": "begins", "onset_s": 12},
        {**WHOLE, "name": "ends", "shape": "cosine", "offset_s": 20},
        {"shape": "drift", "name": "ramp", "onset_s": 0},
    )
    found = audit_on_log(clean, entries, Config()) if with_log else audit_dictionary(entries, Config())
    notes = {entry.name: entry.note or "" for entry in found.atoms}
    assert "obeys an equation of order 2" in notes["whole"]
    assert "obeys an equation of order 2" in notes["ramp"]
    assert "order below n + 2" in notes["whole"]
    assert (notes["begins"], notes["ends"]) == ("", "")


def test_a_model_too_small_to_absorb_is_not_warned_of(clean):
    found = audit_on_log(clean, dictionary(WHOLE), merge(Config(), {"model.order": 2}))
    assert found.atoms[0].note is None


def test_entries_left_out_are_named_with_what_to_do(clean):
    entries = dictionary(
        {"shape": "bias", "onset_s": 10, "name": "first"},
        {"shape": "bias", "onset_s": 10, "name": "again", "magnitude": 3},
        {"shape": "sine", "frequency_hz": 0.2, "phase_rad": 0.5, "onset_s": 5, "name": "sine"},
        {"shape": "cosine", "frequency_hz": 0.2, "phase_rad": 0.5 - np.pi / 2, "onset_s": 5, "name": "same signal"},
        {"shape": "bias", "onset_s": 500, "name": "late"},
        {"shape": "bias", "name": "always", "onset_s": 0},
        {"shape": "bias", "onset_s": 10, "channel": "aoa", "name": "elsewhere"},
    )
    found = audit_on_log(clean, entries, ORDER_4)
    assert [entry.live for entry in found.atoms] == [True, False, True, False, False, False, False]
    notes = {entry.name: entry.note for entry in found.atoms}
    assert notes["again"] == "'again' is defined as 'first' is; drop one of them"
    assert "same signal as 'sine'" in notes["same signal"]
    assert "drop one, or move an onset" in notes["same signal"]
    assert "move its onset" in notes["late"]
    assert "does not change in the window" in notes["always"]
    assert "--output aoa" in notes["elsewhere"]
    assert texts(found.all_notes)[:5] == tuple(note for note in notes.values() if note)


def test_neighbours_are_warned_of():
    near = [{"shape": "bias", "onset_s": onset, "name": f"at {onset}"} for onset in (10, 10.01, 40)]
    found = audit_dictionary(dictionary(*near), Config(), duration_s=60)
    assert any("'at 10' and 'at 10.01' can hardly be told apart" in note for note in texts(found.notes))
    assert found.atoms[0].most_coherent_with == "at 10.01"
    assert found.atoms[0].coherence > 0.99


def test_many_neighbours_are_counted_and_their_combination_is_named():
    grid = {"shape": "bias", "onset_s": {"start": 10, "stop": 10.1, "step": 0.01}}
    found = audit_dictionary(load_dictionary({"relative_to": "window", "grids": [grid]}), Config(), duration_s=60)
    assert sum("can hardly be told apart" in note for note in texts(found.notes)) == 5
    assert any("more pairs have a coherence of 0.99 or more" in note for note in texts(found.notes))
    assert any(note.startswith("the magnitudes of 'bias_tas_10") for note in texts(found.notes))


def test_the_signals_compared_without_a_log_are_those_defined():
    found = audit_dictionary(load_dictionary(THESIS), Config(), duration_s=30.0)
    for n, entry in enumerate(entry for entry in found.atoms if entry.live):
        expected = unit_signal(entry.fault, found.signatures.time_s, window_start_s=0.0)
        np.testing.assert_array_equal(found.signatures.values[:, n], expected)
    assert (found.fastest_hz, found.signatures.among.rank) == (2.25, 7)
    assert found.model is None
    assert all(entry.minimal_detectable is None for entry in found.atoms)


@given(
    st.lists(
        st.builds(
            Fault,
            shape=st.just("lagged_bias"),
            time_constant_s=st.floats(0.1, 20.0),
            onset_s=st.floats(0.0, 5000.0),
        ),
        min_size=1,
        max_size=5,
    ),
    st.booleans(),
)
def test_the_default_window_shows_every_fault_and_nothing_looks_odd_in_it(faults, from_zero):
    span = span_of(faults, None, from_zero=from_zero)
    assert all(span.start_s <= fault.onset_s < span.stop_s for fault in faults)
    assert not any(list(oddities(fault, span)) for fault in faults)


def test_a_window_stated_on_the_command_line_is_kept():
    entries = load_dictionary({"atoms": [{"shape": "bias", "onset_s": 2431}]})
    assert audit_dictionary(entries, Config()).window.start_s == 2421.0
    found = audit_dictionary(entries, merge(Config(), {"window.from_s": 2400.0}), duration_s=50.0)
    assert (found.window.start_s, found.window.stop_s) == (2400.0, 2450.0)


def test_too_many_signals_are_listed_and_not_compared():
    found = audit_dictionary(load_dictionary(THESIS), Config(), duration_s=1e9)
    assert found.signatures is None
    assert sum(entry.live for entry in found.atoms) == 7
    assert any("too many signals to compare" in note for note in texts(found.notes))


def test_a_name_or_a_magnitude_makes_no_other_fault():
    a = Fault(shape="bias", onset_s=3.0, name="a")
    faults = [a, replace(a, name="b", magnitude=2.0), replace(a, name="c", onset_s=4.0), replace(a, name="d")]
    assert same_definition(faults) == {1: 0, 3: 0}


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (Fault(shape="sine", frequency_hz=0.01, onset_s=10), "only 0.2 of a cycle"),
        (Fault(shape="sine", frequency_hz=3.0), "only 3.3 samples per cycle at 10 Hz; give --rate 12 or more"),
        (Fault(shape="lagged_bias", time_constant_s=30.0, onset_s=10), "settles in 30 s but shows for 20 s"),
        (Fault(shape="lagged_bias", time_constant_s=0.05, onset_s=10), "settles within a sample at 10 Hz"),
        (Fault(shape="ramp_hold", duration_s=25.0, onset_s=10), "never holds in the window"),
    ],
)
def test_what_looks_like_something_else_is_said(fault, sentence):
    (said,) = oddities(fault, AuditWindow(start_s=0.0, stop_s=30.0, rate_hz=10.0, lags=4))
    assert sentence in said
    assert ";" in said


def test_an_unknown_channel_is_guessed():
    found = audit_dictionary(dictionary({"shape": "bias", "onset_s": 3, "channel": "altitud"}), Config())
    assert texts(found.notes)[0] == "'altitud' is no standard channel name; did you mean 'altitude'?"


@pytest.mark.parametrize(
    ("window", "duration_s", "error", "sentence"),
    [
        ({}, 5.0, DictionaryError, "no live atom: 'late' starts at 10 s, after the window ends (5 s)"),
        ({}, -1.0, ConfigError, "--duration: must be more than 0 s, got -1"),
        ({"window.to_s": 20.0}, 5.0, ConfigError, "keep --duration or --to"),
        ({"window.to_s": -3.0}, None, ConfigError, "--to: the window starts at 0 s, got -3"),
    ],
)
def test_a_window_that_cannot_be_is_refused(window, duration_s, error, sentence):
    late = dictionary({"shape": "bias", "onset_s": 10, "name": "late"})
    with pytest.raises(error) as refusal:
        audit_dictionary(late, merge(Config(), window), duration_s=duration_s)
    assert sentence in str(refusal.value)


KINDS = [
    {"name": "step", "shape": "bias"},
    {"name": "slope", "shape": "drift", "onset_s": {"from": 5, "to": 20}},
    {"name": "oscillation", "shape": "sine"},
]
EXACT_ATOMS = [{"name": "at_12", "shape": "bias", "onset_s": 12}, {"name": "at_20", "shape": "bias", "onset_s": 20}]


def test_kinds_of_fault_leave_the_audit_of_the_others_as_it_is():
    mixed = audit_dictionary(dictionary(*KINDS[:2], *EXACT_ATOMS, *KINDS[2:]), Config())
    alone = audit_dictionary(dictionary(*EXACT_ATOMS), Config())
    assert [entry.name for entry in mixed.atoms] == ["step", "slope", "at_12", "at_20", "oscillation"]
    assert mixed.atoms[2:4] == alone.atoms
    assert all(entry.live and entry.coherence is None for entry in mixed.atoms if entry.fault.onset_range_s)
    np.testing.assert_array_equal(mixed.signatures.coherence, alone.signatures.coherence)
    times = {row[1]: row[2] for row in audit_content(audit_document(mixed, provenance(log_sha256=""))).tables[0].rows}
    assert times == {"step": "any", "slope": "any in 5 to 20", "at_12": "12", "at_20": "20", "oscillation": "any"}


def test_a_dictionary_of_kinds_has_an_audit_too():
    found = audit_dictionary(dictionary(*KINDS), Config())
    assert ([entry.live for entry in found.atoms], found.signatures) == ([True] * 3, None)
    document = json.loads(to_json(audit_document(found, provenance(log_sha256=""))))
    assert [atom["onset_s"] for atom in document["atoms"]] == [None] * 3
    assert [atom["onset_range_s"] for atom in document["atoms"]] == [[None, None], [5.0, 20.0], [None, None]]
    assert audit_content(document).verdict == "3 faults, 3 of them can be looked for"


@pytest.mark.slow
def test_the_limits_of_kinds_on_a_log_are_those_of_the_search():
    changes = {"model.order": 4, "conditioning.rate_hz": "none", "start_time.calibration": "gaussian"}
    config = merge(Config(), changes)
    rng = np.random.default_rng(0)
    log = flight_of(MODELS["citation"], "3211", rng=rng, duration_s=30.0, rate_hz=10.0, noise_sd={"tas": 0.05})
    kinds = dictionary(*KINDS[:2], {"name": "late", "shape": "bias", "onset_s": {"from": 50, "to": 90}})
    found = audit_on_log(log, kinds, config)
    searched = search_onsets(log, with_inputs_of(log, config), kinds=kinds.resolved(0.0)[:2])
    expected = {one.name: one.minimal_detectable_scan for one in searched.evidence.candidates}
    assert {entry.name: entry.minimal_detectable for entry in found.atoms} == {**expected, "late": None}
    assert expected["step"] > 0.0
    assert [entry.live for entry in found.atoms] == [True, True, False]
    assert "begins between 50 and 90 s, outside of the window (0 to 29.9 s)" in found.atoms[2].note
    assert audit_content(audit_document(found, provenance(log_sha256=""))).drawings[-1].name == "limits"
    with pytest.raises(DictionaryError, match="no live atom: 'late' begins between 50 and 90 s"):
        audit_on_log(log, dictionary({"name": "late", "shape": "bias", "onset_s": {"from": 50, "to": 90}}), config)
