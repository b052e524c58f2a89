"""Kinds of fault, whose onsets are searched: named and located where they may begin, refused where they cannot."""

from __future__ import annotations

from pathlib import Path

import pytest
from noted import texts

from bfi_cli.analysis import identify, start_time
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import DictionaryError
from bfi_cli.flightlog import FlightLog, read_log

BIAS = Path(__file__).parents[2] / "data" / "citation_bias.h5"
CONFIG = merge(Config(), {"conditioning.rate_hz": 5.0, "model.order": 3})


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return read_log(BIAS)


def answer(log: FlightLog, *atoms: dict, **changes: object):
    return identify(log, load_dictionary({"atoms": list(atoms)}), merge(CONFIG, changes))[0]


@pytest.mark.slow
def test_kinds_find_what_start_time_finds(log):
    kinds = identify(log, load_dictionary("airdata"), CONFIG)[0]
    searched = start_time(log, CONFIG)
    (fault,), (other,) = kinds.faults, searched.faults
    assert fault.fault.shape == other.fault.shape == "bias"
    assert fault.fault.onset_s == other.fault.onset_s == pytest.approx(13.8, abs=0.02)
    assert fault.ci95[0] <= 4.0 <= fault.ci95[1]
    assert (kinds.decision, kinds.verdicts) == (searched.decision, searched.verdicts)
    assert fault.beyond_tolerance is True
    assert fault.among[0] == "bias"


def test_an_interval_that_holds_the_onset_names_it(log):
    result = answer(log, {"name": "jump", "shape": "bias", "onset_s": {"from": 10, "to": 16}})
    (fault,) = result.faults
    assert fault.fault.onset_s == pytest.approx(13.8, abs=0.02)
    assert [one.name for one in result.candidates if one.state == "declared"] == ["jump"]


@pytest.mark.slow
def test_candidates_tell_the_onsets_that_were_checked(log):
    result = answer(log, {"shape": "sine", "onset_s": {"from": 10, "to": 16}}, {"shape": "bias"})
    spans = {one.shape: one.onsets_checked for one in result.candidates}
    assert spans["sine"] == ((10.0, 16.0),)


def test_a_stated_entry_and_a_kind_are_told_apart(log):
    result = answer(log, {"name": "stated", "shape": "bias", "onset_s": 13.8}, {"name": "any", "shape": "drift"})
    assert [one.name for one in result.faults] == ["stated"]


def test_an_interval_outside_of_the_window_is_refused(log):
    outside = "'bias_tas' begins between 300 and 400 s, outside of the window"
    with pytest.raises(DictionaryError, match=outside) as said:
        answer(log, {"shape": "bias", "onset_s": {"from": 300, "to": 400}})
    assert "\n" not in str(said.value)


def test_a_kind_of_a_channel_that_is_no_output_is_refused(log):
    with pytest.raises(DictionaryError, match="add --output aoa"):
        answer(log, {"shape": "bias", "channel": "aoa"})


def test_a_claim_of_an_interval_says_its_onsets(log):
    """The step at 13.8 s is outside of it: no sentence may say that there is none."""
    result = answer(log, {"shape": "bias", "onset_s": {"from": 5.5, "to": 9}}, require=("abrupt",))
    (candidate,) = (one for one in result.candidates if one.shape == "bias")
    assert candidate.onsets_checked is not None
    assert "that begins from" in (candidate.note or "")
    if result.verdicts["abrupt"] == "no_fault":
        assert "that begins from" in result.summary


def test_kinds_that_cannot_begin_or_that_nothing_tells_are_named(log):
    late = {"name": "late", "shape": "drift", "onset_s": {"from": 300}}
    result = answer(log, {"shape": "bias"}, late, {"name": "ice", "shape": "pitot_icing"})
    assert any("no onset of 'late'" in note for note in texts(result.notes))
    assert any("no channel of the log tells 'ice'" in note for note in texts(result.notes))


@pytest.mark.slow
def test_a_dictionary_of_line_faults_alone_is_searched_for_whatever_is_there(log):
    result = answer(log, {"name": "ice", "shape": "pitot_icing"})
    assert [one.fault.shape for one in result.faults] == ["bias"]
