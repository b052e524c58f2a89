"""Records with measurement noise, the default settings: isolation, intervals, comparison with the truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.model import identify_faults

WELL_SEEN = ("sine_2.25", "bias_13.8", "sine_0.35")
# Without what takes most of the time: the search for an order, and limits for onsets known to a tolerance only.
SETTINGS = {"model": {"order": 5}, "onset_tolerance_s": 0.0}
QUICK = Config.model_validate(SETTINGS)


@pytest.fixture(scope="module")
def found(flight, thesis, faulty):
    """Return a function that gives what is found of one fault, each analysed once: `found("bias_13.8", 2.0)`."""

    @cache
    def identified(name, magnitude):
        return identify_faults(faulty(flight(4), thesis, {name: magnitude}), thesis, QUICK)

    return identified


def by_name(result):
    return {fault.name: fault for fault in result.faults}


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("name", WELL_SEEN)
def test_one_fault_is_isolated(flight, thesis, faulty, name):
    result = identify_faults(faulty(flight(1), thesis, {name: 3.0}), thesis, Config())
    assert result.truth.isolated, texts(result.notes)
    (fault,) = result.faults
    assert abs(fault.magnitude - 3.0) < 4 * fault.sd + 0.01 * 3.0
    assert result.truth.magnitude_error == pytest.approx(abs(fault.magnitude - 3.0) / 3.0)
    assert result.truth.vaf_fault["tas"] > 99.0


def test_three_faults_are_isolated(flight, thesis, faulty):
    magnitudes = {"bias_13.8": 4.0, "sine_1.15": 2.0, "cos_1.125": -1.5}
    result = identify_faults(faulty(flight(2), thesis, magnitudes), thesis, QUICK)
    assert result.truth.isolated, texts(result.notes)
    assert result.truth.magnitude_error < 0.02


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("seed", range(2))
def test_a_fault_free_record_has_no_fault(flight, thesis, seed):
    result = identify_faults(flight(seed), thesis, Config())
    assert (result.decision, result.faults) == ("inconclusive", ())
    assert result.verdicts["abrupt"] == "no_fault"
    assert result.verdicts["slow"] == "inconclusive", "a drift of 31 s that reaches 5 kt cannot be excluded"
    assert result.truth is None
    assert result.model.rate_hz == 10.0


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("name", ["bias_13.8", "sine_1.15"])
def test_twice_the_fault_is_twice_the_magnitude(found, name):
    one, two = (by_name(found(name, z))[name] for z in (2.0, 4.0))
    assert abs(two.magnitude - 2 * one.magnitude) < 3 * np.hypot(two.sd, 2 * one.sd)


def test_a_fault_of_the_other_sign_is_found_as_large(found):
    up, down = (found("bias_13.8", z).faults[0] for z in (2.0, -2.0))
    assert abs(up.magnitude + down.magnitude) < 3 * np.hypot(up.sd, down.sd)


def test_intervals_and_detectable_magnitudes_make_sense(flight, thesis, faulty):
    result = identify_faults(faulty(flight(5), thesis, {"bias_13.8": 3.0, "sine_2.25": 1.0}), thesis, QUICK)
    for fault in result.faults:
        assert fault.ci95[0] < fault.magnitude < fault.ci95[1]
        assert fault.ci95[0] * fault.ci95[1] > 0
        assert fault.ci95[1] - fault.ci95[0] > 2 * 1.95 * fault.sd
    seen = [candidate for candidate in result.candidates if candidate.sd is not None]
    assert len(seen) == 7
    for candidate in seen:
        assert candidate.minimal_detectable > 1.95 * candidate.sd
        if candidate.state == "declared":
            assert abs(candidate.magnitude) > 2 * candidate.sd


def test_the_order_of_the_dictionary_does_not_matter(flight, thesis, faulty):
    magnitudes = {"bias_13.8": 4.0, "sine_1.15": 2.0}
    log = faulty(flight(6), thesis, magnitudes)
    config = Config.model_validate({"model": {"orders": [4, 6]}, "onset_tolerance_s": 0.0})
    turned = replace(thesis, atoms=thesis.atoms[::-1])
    one, other = (identify_faults(log, dictionary, config) for dictionary in (thesis, turned))
    assert by_name(one).keys() == by_name(other).keys() == magnitudes.keys()
    for name, fault in by_name(one).items():
        assert by_name(other)[name].magnitude == pytest.approx(fault.magnitude, rel=1e-5)
        assert by_name(other)[name].sd == pytest.approx(fault.sd, rel=1e-3)
    assert one.model.order == other.model.order
    assert [candidate.name for candidate in other.candidates] == [atom.name for atom in turned.atoms]


def test_another_time_axis_changes_only_the_times(flight, thesis, faulty):
    log = faulty(flight(7), thesis, {"bias_13.8": 4.0})
    later = replace(
        log,
        time_s=log.time_s + 5000.0,
        truth=replace(log.truth, faults=tuple(replace(f, onset_s=f.onset_s + 5000.0) for f in log.truth.faults)),
    )
    one, other = (identify_faults(each, thesis, QUICK) for each in (log, later))
    assert other.faults[0].fault.onset_s == pytest.approx(5013.8)
    assert other.faults[0].magnitude == pytest.approx(one.faults[0].magnitude, rel=1e-6)
    assert other.faults[0].sd == pytest.approx(one.faults[0].sd, rel=1e-4)
    assert other.truth.isolated
    np.testing.assert_allclose(other.time_s, one.time_s + 5000.0)
    np.testing.assert_allclose(other.outputs[0].corrected, one.outputs[0].corrected, atol=1e-5)


def test_a_fault_on_each_of_two_outputs(flight, faulty):
    both = load_dictionary(
        {
            "relative_to": "window",
            "atoms": [
                {"name": f"{shape}_{channel}", "shape": shape, "channel": channel, "onset_s": onset} | extra
                for channel in ("tas", "aoa")
                for shape, onset, extra in (("bias", 13.8, {}), ("sine", 8.0, {"frequency_hz": 0.7}))
            ],
        }
    )
    magnitudes = {"bias_tas": 3.0, "sine_aoa": 0.01}
    config = Config.model_validate({**SETTINGS, "outputs": ["tas", "aoa"]})
    result = identify_faults(faulty(flight(8), both, magnitudes), both, config)
    assert result.truth.isolated, texts(result.notes)
    assert result.truth.magnitude_error < 0.05
    assert {fault.name: fault.fault.channel for fault in result.faults} == {"bias_tas": "tas", "sine_aoa": "aoa"}
    assert {fault.unit for fault in result.faults} == {"m/s", "rad"}
    assert set(result.truth.vaf_fault) == set(result.model.noise_sd) == {"tas", "aoa"}
    assert identify_faults(flight(8), both, config).faults == ()


def test_a_fault_on_the_second_of_two_outputs_is_not_blamed_on_the_first(flight, thesis, faulty):
    atoms = tuple(
        replace(atom, name=f"{atom.name}_{c}", channel=c) for c in ("tas", "aoa") for atom in thesis.atoms[1:3]
    )
    both = replace(thesis, atoms=atoms)
    result = identify_faults(
        faulty(flight(9), both, {"bias_13.8_aoa": 0.02}),
        both,
        Config.model_validate({**SETTINGS, "outputs": ["tas", "aoa"]}),
    )
    assert [fault.name for fault in result.faults] == ["bias_13.8_aoa"]


def test_no_more_faults_than_asked_for(flight, thesis, faulty):
    magnitudes = {"bias_13.8": 4.0, "sine_1.15": 2.0, "sine_2.25": 3.0}
    config = Config.model_validate({**SETTINGS, "selection": {"max_active": 2}})
    result = identify_faults(faulty(flight(2), thesis, magnitudes), thesis, config)
    assert len(result.faults) == 2
    assert not result.truth.isolated
    assert len(result.truth.missed) == 1


def test_causal_filtering_finds_the_same_fault(flight, thesis, faulty):
    config = Config.model_validate({**SETTINGS, "conditioning": {"filter": "causal"}})
    result = identify_faults(faulty(flight(1), thesis, {"bias_13.8": 3.0}), thesis, config)
    assert result.truth.isolated
    assert result.truth.magnitude_error < 0.02


def test_a_window_keeps_the_fault_that_lies_in_it(flight, thesis, faulty):
    late = replace(thesis, relative_to="log")
    config = Config.model_validate({**SETTINGS, "window": {"from_s": 4.0, "to_s": 28.0}})
    result = identify_faults(faulty(flight(2), thesis, {"bias_13.8": 3.0}), late, config)
    assert result.truth.isolated, texts(result.notes)
    assert 4.0 <= result.log.start_s < result.log.stop_s < 28.0
    assert result.faults[0].fault.onset_s == 13.8


def test_an_input_that_follows_from_another_changes_no_size(flight, thesis, faulty):
    """The space of the regressors is the same; only their coefficients are not determined, which a note says."""
    log = faulty(flight(4), thesis, {"bias_13.8": 2.0})
    elevator = log.channel("elevator")
    twice = replace(elevator, name="elevator_copy", values=1.0 - 2.0 * elevator.values)
    both = replace(log, channels={**log.channels, "elevator_copy": twice})
    alone, beside = (
        identify_faults(each, thesis, Config.model_validate({**SETTINGS, "inputs": inputs}))
        for each, inputs in ((log, ["elevator"]), (both, ["elevator", "elevator_copy"]))
    )
    assert by_name(beside)["bias_13.8"].magnitude == pytest.approx(by_name(alone)["bias_13.8"].magnitude, rel=1e-3)
    assert any("follow from others to round-off" in text for text in texts(beside.notes))
    assert not any("nearly dependent" in text for text in texts(beside.notes))
