"""What an assessment must be equal to, what it must not depend on, and how it answers the odd dictionary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.audit import audit_on_log
from bfi_cli.config import Config, merge
from bfi_cli.diagnosability import assess
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, DictionaryError, ExcitationError
from bfi_cli.flightlog import inject
from bfi_cli.flightlog.record import frozen_array

QUICK = merge(Config(), {"conditioning.rate_hz": 10.0, "model.order": 4})
EXACT = merge(Config(), {"onset_tolerance_s": 0.0})
BOTH = merge(Config(), {"outputs": ["tas", "aoa"]})


def dictionary(*atoms: dict[str, object]):
    return load_dictionary({"relative_to": "window", "channel": "tas", "atoms": list(atoms)}, where="d.yaml")


AT_LIMIT = {"diagnosability.at_limit": True}


def column(result, key: str) -> np.ndarray:
    return np.array([getattr(atom, key) for atom in result.atoms], dtype=float)


def test_orders_faults_of_unit_magnitude_as_their_minimal_detectable_magnitudes_do(at_unit):
    bits, limits = column(at_unit, "divergence_bits"), column(at_unit, "minimal_detectable")
    np.testing.assert_array_equal(np.argsort(-bits), np.argsort(limits))
    assert len(set(bits)) == bits.size


def test_at_their_limits_all_faults_are_alike(flight, thesis, at_unit):
    result = assess(flight, thesis, merge(EXACT, AT_LIMIT))
    np.testing.assert_allclose(column(result, "magnitude"), column(at_unit, "minimal_detectable"), rtol=1e-12)
    expected = np.interp(result.limit_deviations, result.deviations, result.bits)
    np.testing.assert_allclose(column(result, "divergence_bits"), expected, atol=2e-3)


def test_the_limits_are_those_of_the_audit(flight, thesis, at_unit):
    audited = [atom.minimal_detectable for atom in audit_on_log(flight, thesis, EXACT).atoms]
    np.testing.assert_allclose(column(at_unit, "minimal_detectable"), audited, rtol=1e-12)


def test_between_is_symmetric_zero_with_itself_and_no_more_than_the_more_visible_one_shows(at_unit):
    between, alone = at_unit.between, column(at_unit, "divergence_bits")
    np.testing.assert_array_equal(between, between.T)
    np.testing.assert_array_equal(np.diag(between), 0.0)
    assert (between <= np.maximum(alone[:, None], alone) + 1e-12).all()
    off = ~np.eye(len(alone), dtype=bool)
    assert ((between > 0.0) | ~off).all()


def test_apart_is_less_than_seen(at_unit):
    apart, seen = column(at_unit, "apart_bits"), column(at_unit, "divergence_bits")
    assert (apart <= seen).all()


@pytest.mark.slow
def test_larger_faults_tell_more(flight, thesis, at_unit):
    larger = assess(flight, thesis, merge(EXACT, {"diagnosability.magnitude": 3.0}))
    for key in ("divergence_bits", "sample_bits", "apart_bits"):
        assert (column(larger, key) > column(at_unit, key)).all(), key


@pytest.mark.slow
def test_less_noise_tells_more(fly, thesis, at_unit):
    quiet = assess(fly(tas=0.002), thesis, Config())
    assert (column(quiet, "divergence_bits") > column(at_unit, "divergence_bits")).all()


def test_faults_that_start_nearly_together_are_hard_to_tell_apart(flight):
    atoms = [{"name": f"at_{onset}", "shape": "bias", "onset_s": onset} for onset in (12.0, 12.01, 20.0)]
    result = assess(flight, dictionary(*atoms), merge(QUICK, {"diagnosability.magnitude": 0.1}))
    first, second, third = result.atoms
    assert (first.most_like, second.most_like) == ("at_12.01", "at_12.0")
    assert first.apart_bits < 0.5 * first.divergence_bits
    assert third.apart_bits > 0.8 * third.divergence_bits
    assert result.between[0, 1] < 0.5 * result.between[0, 2]


def test_a_fault_alone_is_like_no_other(flight):
    (only,) = assess(flight, dictionary({"name": "b", "shape": "bias", "onset_s": 12.0}), QUICK).atoms
    assert (only.most_like, only.apart_bits) == (None, None)
    assert only.divergence_bits > 0.5


@pytest.mark.slow
def test_injected_faults_are_taken_out(flight, thesis, at_unit):
    faulty = inject(flight, [replace(thesis.atoms[1], magnitude=4.0)])
    result = assess(faulty, thesis, Config())
    np.testing.assert_array_equal(column(result, "divergence_bits"), column(at_unit, "divergence_bits"))
    assert "the injected faults are taken out" in texts(result.notes)[-1]


def test_what_cannot_be_looked_for_is_named_and_has_no_numbers(flight):
    late = {"name": "late", "shape": "bias", "onset_s": 99.0}
    seen = {"name": "seen", "shape": "bias", "onset_s": 12.0}
    result = assess(flight, dictionary(late, seen), QUICK)
    dead, live = result.atoms
    assert (dead.live, dead.divergence_bits, dead.minimal_detectable, dead.apart_bits) == (False, None, None, None)
    assert "starts at 99 s, after the window ends" in dead.note
    assert live.divergence_bits > 0.5
    assert np.isnan(result.between[0]).all()
    assert np.isnan(result.between[:, 0]).all()
    with pytest.raises(DictionaryError, match="no live atom"):
        assess(flight, dictionary(late), Config())


@pytest.mark.slow
def test_what_the_model_explains_away_tells_nothing(flight, tmp_path):
    """A fault with the course of the elevator is a change of the elevator's effect."""
    table = np.column_stack([flight.time_s, flight.channel("elevator").values])
    np.savetxt(tmp_path / "elevator.csv", table, delimiter=",", header="time,value", comments="")
    course = {"name": "course", "shape": "samples", "file": str(tmp_path / "elevator.csv"), "onset_s": 0.0}
    both = dictionary(course, {"name": "seen", "shape": "bias", "onset_s": 12.0})
    result = assess(flight, both, QUICK)
    hidden = result.atoms[0]
    assert (hidden.live, hidden.divergence_bits, hidden.minimal_detectable) == (True, 0.0, None)
    assert any(
        note.startswith("the inputs and lags of the model explain all of 'course'") for note in texts(result.notes)
    )
    assert result.between[0, 1] == result.atoms[1].divergence_bits
    at_limit = assess(flight, both, merge(QUICK, AT_LIMIT))
    assert (at_limit.atoms[0].magnitude, at_limit.atoms[0].divergence_bits) == (None, None)


@pytest.mark.slow
def test_without_noise_everything_is_told_and_the_notes_say_why(fly, thesis):
    result = assess(fly(), thesis, Config())
    np.testing.assert_allclose(column(result, "divergence_bits"), 1.0, atol=1e-4)
    assert any("the log has no noise" in note for note in texts(result.notes))


@pytest.mark.slow
def test_faults_of_several_outputs(fly):
    shared = {"shape": "bias", "onset_s": 12.0}
    both = dictionary({"name": "tas", **shared}, {"name": "aoa", "channel": "aoa", **shared})
    result = assess(
        fly(tas=0.02, aoa=0.001),
        both,
        merge(BOTH, {"diagnosability.magnitude": 0.1, "diagnosability.magnitudes": {"aoa": 0.01}}),
    )
    assert [(atom.channel, atom.unit, atom.magnitude) for atom in result.atoms] == [
        ("tas", "m/s", 0.1),
        ("aoa", "rad", 0.01),
    ]
    assert ((column(result, "divergence_bits") > 0.1) & (column(result, "sample_bits") < 0.5)).all()


@pytest.mark.slow
def test_the_unit_of_a_channel_does_not_matter(flight, thesis, at_unit):
    """A flight a thousand times slower, with faults a thousand times smaller, is the same flight."""
    tas = flight.channel("tas")
    small = replace(tas, values=frozen_array(1e-3 * tas.values))
    result = assess(
        replace(flight, channels={**flight.channels, "tas": small}),
        thesis,
        merge(Config(), {"diagnosability.magnitude": 1e-3}),
    )
    np.testing.assert_allclose(column(result, "divergence_bits"), column(at_unit, "divergence_bits"), atol=1e-6)
    np.testing.assert_allclose(column(result, "sample_bits"), column(at_unit, "sample_bits"), atol=1e-6)


@pytest.mark.slow
def test_what_is_hard_is_said(flight, thesis):
    result = assess(flight, thesis, merge(EXACT, {"diagnosability.magnitude": 0.01}))
    assert any(note.startswith("'drift_7.93' of 0.0023 m/s^2 can hardly be seen") for note in texts(result.notes))


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        (
            {"diagnosability.magnitudes": {"bias_13": 1.0}},
            "no entry of the dictionary, got 'bias_13'; did you mean 'bias_13.8'",
        ),
        ({"diagnosability.magnitude": 0.0}, "diagnosability.magnitude: must be greater than 0, got 0"),
        ({"diagnosability.magnitudes": {"bias_13.8": -2.0}}, "must be greater than 0, got -2"),
        ({"diagnosability.magnitude": float("nan")}, "must be a finite number, got nan"),
    ],
)
def test_magnitudes_that_cannot_be(flight, thesis, sizes, message):
    with pytest.raises(ConfigError, match=message):
        assess(flight, thesis, merge(EXACT, sizes))


def test_a_flight_without_a_manoeuvre_cannot_be_used(flight, thesis):
    still = replace(flight.channel("elevator"), values=frozen_array(np.zeros(flight.n_samples)))
    with pytest.raises(ExcitationError, match="'elevator' does not move"):
        assess(replace(flight, channels={**flight.channels, "elevator": still}), thesis, Config())


@pytest.mark.slow
def test_kinds_of_fault_are_left_out_and_named_in_a_note(flight):
    stated = [{"name": f"at_{onset}", "shape": "bias", "onset_s": onset} for onset in (12.0, 20.0)]
    kinds = [{"name": "kind", "shape": "drift"}, {"name": "part", "shape": "bias", "onset_s": {"from": 5, "to": 9}}]
    mixed, alone = (assess(flight, dictionary(*atoms), QUICK) for atoms in ([*kinds, *stated], stated))
    assert mixed.atoms == alone.atoms
    assert texts(mixed.notes) == (*texts(alone.notes), "left out, as they state no onset: 2 entries of the dictionary")
    with pytest.raises(DictionaryError, match="no entry states its onset, and a signature is that of a fault at an"):
        assess(flight, dictionary(*kinds), QUICK)
