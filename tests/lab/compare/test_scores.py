"""The score of a method: it grows with the fault, and is beyond the method's own threshold where that declares one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.kernels.change_alarm import cusum_threshold, glr_threshold
from bfi_cli.lab.compare import PEERS, Statement, compare
from bfi_cli.lab.compare.rivals import MEMORY_S

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[3] / "data"
SCORED = ("risro", "mf2d", "mfddfd", "arx-residual", "null-space", "cusum", "glr", "dmae")
SIZES = (0.0, 0.5, 4.0)


@pytest.fixture(scope="module")
def statements() -> dict[str, list[Statement]]:
    """State biases of the airspeed of three sizes from 13.8 s on, in a record with noise."""
    clean = read_log(DATA / "citation_clean.h5")
    noise = 0.05 * np.random.default_rng(0).standard_normal(clean.n_samples)
    dictionary = load_dictionary("thesis")
    config = merge(Config(), {"dmae.model": "citation"})
    found: dict[str, list[Statement]] = {name: [] for name in SCORED}
    for size in SIZES:
        log = _noisy(clean, noise)
        if size:
            log = inject(log, [Fault(shape="bias", channel="tas", magnitude=size, onset_s=13.8)])
        for one in compare(log, dictionary, config, {name: PEERS[name] for name in SCORED}).outcomes:
            assert one.statement is not None, one.reason
            found[one.method].append(one.statement)
    return found


def _noisy(log: FlightLog, noise: np.ndarray) -> FlightLog:
    from dataclasses import replace

    from bfi_cli.flightlog.record import frozen_array

    tas = log.channels["tas"]
    return replace(log, channels={**log.channels, "tas": replace(tas, values=frozen_array(tas.values + noise))})


@pytest.mark.parametrize("name", SCORED)
def test_a_larger_fault_has_a_larger_score(statements: dict[str, list[Statement]], name: str):
    scores = [one.score for one in statements[name]]
    assert None not in scores
    assert scores[0] < scores[2]
    assert scores[0] <= scores[1] <= scores[2]
    assert [one.decision == "fault" for one in (statements[name][0], statements[name][2])] == [False, True]


def test_a_detector_declares_what_is_beyond_its_threshold(statements: dict[str, list[Statement]]):
    log = read_log(DATA / "citation_clean.h5")
    rate_hz = 10.0
    rows = round(rate_hz * (log.time_s[-1] - log.time_s[0]))
    lengths = min(rows, round(MEMORY_S * rate_hz))
    # The rows that a lag of the model takes, tens of hundreds, change these thresholds by a few percent.
    thresholds = {
        "arx-residual": 5.0,
        "null-space": 1.0,
        "cusum": cusum_threshold(rows, 0.01),
        "glr": glr_threshold(rows, lengths, 0.01),
        "dmae": 0.0,
    }
    for name, threshold in thresholds.items():
        for one in statements[name]:
            assert one.score is not None
            if abs(one.score / threshold - 1.0 if threshold else one.score) > 0.1:
                assert (one.score > threshold) == (one.decision == "fault"), name
