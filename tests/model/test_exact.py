"""Noise-free records: the faults come back, by either method, with nothing added."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.config import Config
from bfi_cli.model import identify_faults

NAMES = ("sine_2.25", "bias_13.8", "sine_1.15", "cos_1.125", "sine_0.35", "drift_7.93", "bias_6.35")
METHODS = pytest.mark.parametrize("method", ["ml", "risro"])


def drawn(seed: int) -> dict[str, float]:
    """Draw 2 to 6 faults of integer magnitude 1 to 10, as the thesis does."""
    rng = np.random.default_rng(seed)
    names = rng.choice(NAMES, rng.integers(2, 7), replace=False)
    return {str(name): float(rng.integers(1, 11)) for name in names}


def assert_found(result, magnitudes):
    assert result.decision == "fault"
    assert {fault.name for fault in result.faults} == set(magnitudes)
    for fault in result.faults:
        assert fault.magnitude == pytest.approx(magnitudes[fault.name], rel=1e-4)
        assert fault.ci95[0] <= fault.magnitude <= fault.ci95[1]
    assert result.truth.isolated
    assert result.truth.magnitude_error < 1e-4
    assert result.truth.vaf_fault["tas"] > 99.99


@pytest.mark.first_rows(1)
@METHODS
@pytest.mark.parametrize("name", ["bias_13.8", "cos_1.125", "drift_7.93"])
def test_each_fault_alone(flight, thesis, faulty, exact, method, name):
    assert_found(identify_faults(faulty(flight(), thesis, {name: 3.0}), thesis, exact(method)), {name: 3.0})


@pytest.mark.first_rows(1)
@METHODS
@pytest.mark.parametrize("seed", range(2))
def test_combinations(flight, thesis, faulty, exact, method, seed):
    magnitudes = drawn(seed)
    assert_found(identify_faults(faulty(flight(), thesis, magnitudes), thesis, exact(method)), magnitudes)


@METHODS
def test_no_fault(flight, thesis, exact, method):
    result = identify_faults(flight(), thesis, exact(method))
    assert result.faults == ()
    # A method without intervals excludes nothing; the default excludes every entry down to round-off.
    state, decision = ("excluded", "no_fault") if method == "ml" else ("not_seen", "inconclusive")
    assert {candidate.state for candidate in result.candidates} == {state}
    assert result.decision == decision
    assert result.vaf_output["tas"] > 99.9999


def test_the_automatic_rate_and_order_are_exact_too(flight, thesis, faulty):
    magnitudes = drawn(3)
    result = identify_faults(faulty(flight(), thesis, magnitudes), thesis, Config())
    assert_found(result, magnitudes)
    assert result.model.rate_hz == 100.0
