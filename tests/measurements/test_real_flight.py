"""Sharp faults in a recorded flight, added after its low-pass and decimation to 2 Hz: six shapes to choose from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from trials import Outcome, Trial, run_all

from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import FlightLog, read_log, resample

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

ONSET = {"channel": "tas", "onset_s": 60.0}
DICTIONARY = load_dictionary(
    {
        "relative_to": "window",
        "atoms": [
            {"name": "bias", "shape": "bias", **ONSET},
            {"name": "drift", "shape": "drift", **ONSET},
            {"name": "lagged_bias", "shape": "lagged_bias", "time_constant_s": 5.0, **ONSET},
            {"name": "ramp_hold", "shape": "ramp_hold", "duration_s": 10.0, **ONSET},
            {"name": "sine_0.2", "shape": "sine", "frequency_hz": 0.2, **ONSET},
            {"name": "sine_0.05", "shape": "sine", "frequency_hz": 0.05, **ONSET},
        ],
    }
)
FAULTS: list[dict[str, float]] = [{}, {"bias": 0.5}, {"bias": 1.0}, {"drift": 0.5}, {"sine_0.2": 1.0}]
STARTS = range(2000, 2801, 60 if FULL else 120)


def results(log: FlightLog, starts: range) -> dict[str, list[Outcome]]:
    """Identify every window with every fault."""
    at_2_hz = replace(resample(log, 2.0), filters=())
    found: dict[str, list[Outcome]] = {str(truth): [] for truth in FAULTS}
    for start in starts:
        window = at_2_hz.window(float(start), start + 120.0)
        for outcome in run_all([Trial(start, 0.0, truth) for truth in FAULTS], window, DICTIONARY, Config()):
            found[str(outcome.trial.truth)].append(outcome)
    return found


def show(found: dict[str, list[Outcome]]) -> float:
    """Print a line per fault and return the median relative magnitude error of the right answers."""
    errors = []
    for truth, outcomes in found.items():
        right = [outcome for outcome in outcomes if outcome.isolated]
        print(f"\n{truth}: right in {len(right)} of {len(outcomes)} windows")
        for outcome in outcomes:
            if not outcome.isolated:
                print(f"  window from {outcome.trial.seed} s: {outcome.decision} {outcome.found}")
        errors += [
            abs(outcome.found[name][0] / z - 1.0) for outcome in right for name, z in outcome.trial.truth.items()
        ]
    print(f"\nmedian magnitude error {np.median(errors):.2%}")
    return float(np.median(errors))


def test_hand_flown_windows(flights: Path) -> None:
    found = results(read_log(flights / "citation_20180312_f1.h5"), STARTS)
    error = show(found)
    for outcomes in found.values():
        assert not_below(sum(outcome.isolated for outcome in outcomes) / len(outcomes), 13 / 14, len(outcomes))
    assert error <= 0.02


@pytest.mark.skipif(not FULL, reason="it has no bar: only where BFI_FULL=1 is set")
def test_the_other_flight_beside_it(flights: Path) -> None:
    """No bar: how often the same settings are right where nobody looked when they were chosen."""
    found = results(read_log(flights / "citation_20190312_123416.h5"), range(1000, 4001, 300))
    assert show(found) < 1.0
