"""The thesis's problem without noise: simulated Citation, 3172 samples at 100 Hz, seven atoms (table 5-2)."""

from __future__ import annotations

from itertools import chain

import numpy as np
import pytest
from trials import CONFIGS, Trial, draw, run_all, sized, worst_relative_error

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import Dictionary, load_dictionary
from bfi_cli.flightlog import FlightLog

pytestmark = pytest.mark.slow

DICTIONARY = load_dictionary(CONFIGS / "thesis_dictionary.yaml")
OWN_RATE = {"conditioning.rate_hz": "none", "model.order": 4}


@pytest.fixture(scope="module")
def log() -> FlightLog:
    time_s = time_axis(duration_s=31.72, rate_hz=100.0)
    return simulate(find_model("citation"), manoeuvre("3211", time_s), rng=np.random.default_rng(0), rate_hz=100.0)


def trials_of(dictionary: Dictionary) -> list[Trial]:
    """Each single atom at one drawn magnitude, then ten random combinations of each size from 2 to 7, or two."""
    rng = np.random.default_rng(7)
    single = [Trial(j, 0.0, {str(atom.name): float(rng.integers(1, 11))}) for j, atom in enumerate(dictionary.atoms)]
    several = chain.from_iterable(
        [draw(dictionary, n, seed, 0.0) for seed in range(sized(10, 0.2))] for n in range(2, 8)
    )
    return [*single, *several]


@pytest.mark.parametrize("settings", [OWN_RATE, OWN_RATE | {"method": "risro"}, {}], ids=["ml", "risro", "default"])
def test_support_exact_and_magnitudes_to_1e_4(log: FlightLog, settings: dict[str, object]) -> None:
    outcomes = run_all(trials_of(DICTIONARY), log, DICTIONARY, merge(Config(), settings))
    wrong = [outcome for outcome in outcomes if not outcome.isolated]
    errors = [worst_relative_error(outcome) for outcome in outcomes if outcome.isolated]
    print(f"\n{settings or 'default'}: {len(wrong)} wrong of {len(outcomes)}, worst relative error {max(errors):.1e}")
    assert not wrong, [(outcome.trial.truth, outcome.found) for outcome in wrong]
    assert max(errors) < 1e-4


def test_fault_free_log_is_not_over_explained(log: FlightLog) -> None:
    for settings in ({}, OWN_RATE):
        (outcome,) = run_all([Trial(0, 0.0, {})], log, DICTIONARY, merge(Config(), settings))
        assert outcome.decision == "no_fault"
