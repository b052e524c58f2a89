"""Faults through the filters of a log: the same as filtering the record, and files that carry them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.errors import LogError
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.faults.filters import (
    Filter,
    alternatives,
    filters_from_json,
    filters_to_json,
    recorded_signal,
    response_of,
)
from bfi_cli.flightlog import read_log, write_log
from bfi_cli.flightlog.record import Channel, FlightLog, frozen_array
from bfi_cli.kernels.low_pass import low_pass

RECORDER = Filter(kind="gaussian", edge_hz=0.75, rate_hz=10.0, source="as stated")
CONVERSION = Filter(kind="sinc", edge_hz=0.8, rate_hz=10.0, stage="convert")
TIME = np.arange(600) / 10.0


@pytest.mark.parametrize(
    "fault",
    [
        Fault(shape="bias", channel="tas", onset_s=20.0),
        Fault(shape="drift", channel="tas", onset_s=-3.0),
        Fault(shape="sine", channel="tas", onset_s=20.0, offset_s=40.0, frequency_hz=0.3),
    ],
)
def test_a_fault_is_filtered_as_the_record_is(fault):
    response = response_of([RECORDER], 10.0)
    wide = (np.arange(1200) - 300) / 10.0
    whole = response.filtered(unit_signal(fault, wide, window_start_s=0.0))
    expected = whole[300 - response.after :][: len(TIME)]
    np.testing.assert_allclose(recorded_signal(fault, TIME, response, window_start_s=0.0), expected, atol=1e-9)


def test_filters_follow_each_other():
    both = response_of([RECORDER, CONVERSION], 10.0)
    alone = low_pass("gaussian", 0.75, 10.0).then(low_pass("sinc", 0.8, 10.0))
    np.testing.assert_allclose(both.taps, alone.taps)


@pytest.mark.parametrize("suffix", ["h5", "csv"])
@pytest.mark.parametrize("filters", [None, (), (RECORDER, CONVERSION)])
def test_a_file_carries_the_filters(tmp_path, suffix, filters):
    tas = Channel(name="tas", values=frozen_array(100.0 + np.sin(TIME)), unit="m/s", source="tas")
    log = FlightLog(path="", time_s=frozen_array(TIME), channels={"tas": tas}, filters=filters)
    write_log(log, tmp_path / f"log.{suffix}")
    assert read_log(tmp_path / f"log.{suffix}").filters == filters


def test_json_and_back():
    assert filters_from_json(filters_to_json((RECORDER, CONVERSION)), where="x") == (RECORDER, CONVERSION)
    short = '[{"kind": "causal", "edge_hz": 1, "rate_hz": 20}]'
    assert filters_from_json(short, where="x") == (Filter(kind="causal", edge_hz=1, rate_hz=20),)


@pytest.mark.parametrize(
    "text",
    ["{", "{}", '[{"kind": "boxcar", "edge_hz": 1, "rate_hz": 20}]', '[{"kind": "fir", "edge_hz": -1, "rate_hz": 20}]'],
)
def test_what_is_no_list_of_filters_is_refused(text):
    with pytest.raises(LogError, match=r"x: .*; mend the file"):
        filters_from_json(text, where="x")


def test_a_known_recorder_is_what_the_file_states():
    assert (
        replace(RECORDER, source="stated in the file")
        == filters_from_json('[{"kind": "gaussian", "edge_hz": 0.75, "rate_hz": 10.0}]', where="x")[0]
    )


def test_only_an_uncertain_recorder_has_alternatives():
    recorder = Filter(kind="gaussian", edge_hz=0.75, rate_hz=10.0)
    convert = Filter(kind="sinc", edge_hz=2.0, rate_hz=10.0, stage="convert")
    assert alternatives((recorder, convert)) == alternatives((convert,)) == alternatives(()) == []
    guessed = replace(recorder, uncertain=True)
    chains = alternatives((guessed, convert))
    assert (guessed, convert) in chains
    assert {chain[0].kind for chain in chains} == {"gaussian", "fir"}
    assert all(chain[1] == convert for chain in chains)
    as_fir = replace(guessed, kind="fir", edge_hz=0.75 * 1.77)
    for ours, theirs in zip(chains, alternatives((as_fir, convert)), strict=True):
        assert (ours[0].kind, ours[0].edge_hz) == (theirs[0].kind, pytest.approx(theirs[0].edge_hz))


def test_a_guess_stays_one_in_the_file():
    for uncertain in (False, True):
        filters = (Filter(kind="fir", edge_hz=1.3, rate_hz=10.0, source="spectra", uncertain=uncertain),)
        assert filters_from_json(filters_to_json(filters), where="x") == filters
