"""A sensor that freezes in a window that no other channel bounds: the search says so, and excludes nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, flight_of
from bfi_cli.analysis import identify, start_time
from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject


@pytest.fixture(scope="module")
def frozen() -> FlightLog:
    rng = np.random.default_rng(0)
    log = flight_of(
        find_model("citation"), "3211-pairs", rng=rng, duration_s=60.0, rate_hz=10.0, noise_sd={"tas": 0.05}
    )
    return inject(log, [Fault(shape="frozen", channel="tas", onset_s=30.0)])


def test_the_search_names_it(frozen: FlightLog):
    result = start_time(frozen, Config())
    assert [(one.fault.shape, one.fault.channel) for one in result.faults] == [("frozen", "tas")]
    assert result.faults[0].fault.onset_s == pytest.approx(30.0, abs=0.2)
    assert {one.state for one in result.candidates if one.kind != "slow"} == {"not_seen"}


@pytest.mark.slow
def test_a_dictionary_that_lacks_it_does_not_hide_it(frozen: FlightLog):
    step = {"name": "step", "shape": "bias", "onset_s": 20.0}
    result, _ = identify(frozen, load_dictionary({"channel": "tas", "atoms": [step]}), Config())
    assert [one.fault.shape for one in result.faults] == ["frozen"]
