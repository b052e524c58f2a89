"""Isolation and coverage on a nonlinear Citation simulation, measurement noise added, default settings.

A few of the trials run; BFI_FULL=1 takes all.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below
from trials import CONFIGS, Outcome, draw, run_all, sized

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import FlightLog, read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

DICTIONARY = load_dictionary(CONFIGS / "thesis_dictionary.yaml")
SEEDS = range(sized(100, 0.04))
SIZES = (1, 2, 4)
NOISES = {0.01: 0.95, 0.05: 0.90}


@pytest.fixture(scope="module")
def log(flights: Path) -> FlightLog:
    return read_log(flights / "de3211_1.mat").window(19.0, 50.7)


@pytest.fixture(scope="module")
def outcomes(log: FlightLog) -> list[Outcome]:
    trials = [draw(DICTIONARY, n, seed, noise) for noise in NOISES for n in SIZES for seed in SEEDS]
    return run_all(trials, log, DICTIONARY, Config())


def rate(outcomes: list[Outcome]) -> float:
    return float(np.mean([outcome.isolated for outcome in outcomes]))


def test_isolation(outcomes: list[Outcome]) -> None:
    for noise, wanted in NOISES.items():
        here = [outcome for outcome in outcomes if outcome.trial.noise == noise]
        by_size = {n: rate([outcome for outcome in here if len(outcome.trial.truth) == n]) for n in SIZES}
        print(f"\nnoise {noise} m/s: isolated {rate(here):.1%} of {len(here)}, by number active {by_size}")
        for outcome in here:
            if not outcome.isolated:
                print(f"  seed {outcome.trial.seed}: {outcome.trial.truth} -> {outcome.found}")
        assert not_below(rate(here), wanted, len(here))


def test_coverage_of_the_intervals(outcomes: list[Outcome]) -> None:
    covered: dict[str, list[bool]] = defaultdict(list)
    for outcome in outcomes:
        for name, z in outcome.trial.truth.items():
            if name in outcome.found:
                _, low, high = outcome.found[name]
                covered[name].append(low <= z <= high)
    shares = {name: (float(np.mean(hits)), len(hits)) for name, hits in covered.items()}
    everything = [hit for hits in covered.values() for hit in hits]
    print(f"\n95 % intervals cover {np.mean(everything):.1%} of {len(everything)} active atoms; by atom {shares}")
    worst = min(shares, key=lambda name: shares[name][0])
    print(f"worst atom: {worst}, {shares[worst][0]:.1%}")
    assert not_below(float(np.mean(everything)), 0.90, len(everything))
    assert not_above(float(np.mean(everything)), 0.99, len(everything))
    assert all(not_below(share, 0.80, n) for share, n in shares.values())


def test_fault_free(log: FlightLog) -> None:
    outcomes = run_all(
        [draw(DICTIONARY, 0, seed, noise) for noise in NOISES for seed in SEEDS], log, DICTIONARY, Config()
    )
    for noise in NOISES:
        here = [outcome for outcome in outcomes if outcome.trial.noise == noise]
        share = np.mean([outcome.decision != "fault" for outcome in here])
        print(f"\nnoise {noise} m/s, no fault declared: {share:.1%} of {len(here)}")
        for outcome in here:
            if outcome.decision == "fault":
                print(f"  seed {outcome.trial.seed}: {outcome.decision} {outcome.found}")
        assert not_below(float(share), 0.97, len(here))


@pytest.mark.skipif(not FULL, reason="it has no bar: only where BFI_FULL=1 is set")
def test_the_rule_of_the_thesis_beside_it(log: FlightLog) -> None:
    """No bar: printed, so that the default's numbers have something to stand beside."""
    rule = {"method": "risro", "risro.sparsity": "none", "model.order": 4}
    published = merge(Config(), {**rule, "conditioning.rate_hz": "none"})
    decimated = merge(Config(), {**rule, "conditioning.rate_hz": 10.0})
    for noise in NOISES:
        trials = [draw(DICTIONARY, n, seed, noise) for n in (0, *SIZES) for seed in range(sized(25, 0.1))]
        for name, config in {"100 Hz": published, "10 Hz": decimated}.items():
            outcomes = run_all(trials, log, DICTIONARY, config)
            print(f"\nthesis rule, {name}, noise {noise} m/s: isolated {rate(outcomes):.1%} of {len(outcomes)}")
            assert len(outcomes) == len(trials)
