"""Verdicts on recorded flights: never a wrong "no fault", and a "no fault" where there is none.

Faults go through a recorder into 10 Hz logs; sizes are drawn from 0.2 to 10 times the tolerance. A few windows run;
BFI_FULL=1 takes every one.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, at_most, not_above, not_below
from noted import texts
from test_recorded_faults import DICTIONARY, FLIGHTS, LENGTH_S, windows, with_fault
from trials import sized
from verdict_trials import (
    DRONE,
    Trial,
    counts_of,
    cross_calibrated,
    draw,
    flight_log,
    interval,
    resumed,
    run,
    wrong_of,
)

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import find_onset

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

INPUTS = ("elevator", "pitch", "longitudinal_acc")
CONFIG = merge(Config(), {"inputs": INPUTS, "require": ("abrupt", "oscillating")})
TRIALS = 1300
# A ramp that two drifts stood for, oscillations that a lag and a step did, one that lay between two of the onsets that
# were looked at, and one between two of the frequencies.
WRONG_ONCE = (1, 83, 94, 130, 439, 839)


@pytest.fixture(scope="module")
def logs(flights: Path) -> tuple[FlightLog, FlightLog]:
    first, second = (read_log(flights / name) for name in FLIGHTS)
    return first, second


def table_of(trial: Trial) -> tuple[object, ...]:
    """Return what distinguishes the tables of thresholds of trials."""
    return trial.flight, trial.recorder.startswith("again") and trial.recorder, trial.inputs


def test_no_fault_is_never_said_of_an_error_beyond_the_tolerance(tables: Path) -> None:
    """BFI_RESULTS names a file that keeps the answers: a run that was interrupted is continued.

    Without BFI_FULL=1 those are left out that ask for a table of thresholds which the cases below do not make, and
    those within the tolerance, of which "no fault" is right.
    """
    results = Path(os.environ.get("BFI_RESULTS", tables / "trials.jsonl"))
    made = {table_of(one) for one in map(draw, WRONG_ONCE)}
    numbers = [
        one.number
        for one in map(draw, range(sized(TRIALS, 0.02)))
        if FULL or (one.share > 1.0 and (one.flight == DRONE or table_of(one) in made))
    ]
    rows = resumed(numbers, results, lambda number: run(draw(number), tables))
    counts = counts_of(rows)
    for name, (n, wrong) in counts.items():
        print(f"{name}: {wrong} of {n} wrong ({interval(wrong, n)[0]:.1%} to {interval(wrong, n)[1]:.1%})")
    print(*wrong_of(rows), sep="\n")
    for of in ("decision", "kind"):
        n, wrong = counts[of]
        assert n > 0 or not FULL
        # What has to be shown, not only not contradicted. Of 1 % at most 368 answers without a wrong one would tell.
        assert at_most(wrong, n, 0.08)


@pytest.mark.parametrize("number", WRONG_ONCE)
def test_what_was_once_answered_by_no_fault_is_not(tables: Path, number: int) -> None:
    row = run(draw(number), tables)
    assert row["share"] > 1.0
    assert row["claimed"]
    assert row["verdicts"][row["kind"]] != "no_fault"


@pytest.mark.parametrize(("flight", "from_s"), [(FLIGHTS[0], 1050.0), (FLIGHTS[0], 1250.0), (FLIGHTS[1], 2350.0)])
def test_what_the_elevator_does_not_tell_is_suspected(tables: Path, flight: str, from_s: float) -> None:
    """Changes of thrust and wind that stand out with the elevator alone, and not with the log's other channels."""
    config = cross_calibrated(flight, "own", ("elevator",), tables)
    result = find_onset(flight_log(flight, "own").window(from_s, from_s + LENGTH_S), config)
    print(texts(result.notes)[0])
    assert result.decision == "inconclusive"
    assert "its statistic falls from" in texts(result.notes)[0]


def test_no_fault_is_reached(logs: tuple[FlightLog, FlightLog]) -> None:
    with_dictionary, by_scan = [], []
    for log in logs:
        for part in windows(log) if FULL else windows(log, 700):
            with_dictionary.append(identify(part, DICTIONARY, CONFIG)[0].decision)
            by_scan.append(find_onset(part, CONFIG).decision)
    n = len(by_scan)
    print(f"with a dictionary {Counter(with_dictionary)}, by the scan {Counter(by_scan)}")
    assert not_below(with_dictionary.count("no_fault") / n, 0.80, n)
    # 12 of 28 windows at the level of 95 %, half of them at 90 %; no lag and no ramp is what the claim asks for.
    assert not_below(by_scan.count("no_fault") / n, 0.35, n)


def test_a_large_drift_is_no_fault_in_no_command(logs: tuple[FlightLog, FlightLog]) -> None:
    """A drift of 3 m/s^2 was located by the scan and answered "no fault" by identify in 0.1.0."""
    log = logs[0]
    for inputs in (("elevator",), INPUTS) if FULL else (("elevator",),):
        config = merge(Config(), {"inputs": inputs})
        for start_s in (1000.0, 2000.0, 3000.0) if FULL else (2000.0,):
            part = log.window(start_s, start_s + LENGTH_S)
            faulty = with_fault(log, part, Fault(shape="drift", magnitude=3.0, onset_s=start_s + 60.0))
            steps = load_dictionary({"relative_to": "window", "atoms": [{"shape": "bias", "onset_s": 60}]})
            results = (
                find_onset(faulty, config),
                identify(faulty, None, config)[0],
                identify(faulty, DICTIONARY, config)[0],
                identify(faulty, steps, config)[0],
            )
            print(inputs, start_s, [(one.decision, dict(one.verdicts)) for one in results])
            for one in results:
                assert one.decision != "no_fault"
                assert one.verdicts["slow"] != "no_fault"


def test_a_ramp_of_four_is_covered_or_not_declared(logs: tuple[FlightLog, FlightLog]) -> None:
    """A ramp of -4 m/s was answered -9.0 with an interval without the truth in 0.1.0."""
    missed = 0
    named = 0
    for log in logs:
        for part in windows(log):
            atom = next(one for one in DICTIONARY.resolved(float(part.time_s[0])) if one.name == "ramp_hold")
            result = identify_faults(with_fault(log, part, replace(atom, magnitude=-4.0)), DICTIONARY, Config())
            for fault in result.faults:
                if fault.name == "ramp_hold":
                    named += 1
                    missed += not fault.ci95[0] <= -4.0 <= fault.ci95[1]
    print(f"{named} named, {missed} not covered")
    assert not_below(1.0 - missed / named, 0.88, named)


@pytest.mark.parametrize(
    ("inputs", "tolerance_s"),
    [
        (("elevator",), 0.0),
        pytest.param(INPUTS, 0.0, marks=pytest.mark.skipif(not FULL, reason="only where BFI_FULL=1 is set")),
        (INPUTS, 1.0),
    ],
)
def test_minimal_detectable_magnitudes_are_detected(
    logs: tuple[FlightLog, FlightLog], inputs: tuple[str, ...], tolerance_s: float
) -> None:
    """With a tolerance the fault begins that much before or after the onset stated."""
    config = merge(Config(), {"inputs": inputs, "onset_tolerance_s": tolerance_s})
    found: dict[tuple[str, float], list[bool]] = {}
    rng = np.random.default_rng(1)
    for log in logs:
        for part in windows(log) if FULL else windows(log, 4000):
            without = identify_faults(part, DICTIONARY, config)
            if without.faults:
                continue
            limits = {one.name: one.minimal_detectable for one in without.candidates}
            for atom in DICTIONARY.resolved(float(part.time_s[0])):
                sign, shift_s = rng.choice([-1.0, 1.0], 2)
                shifted = replace(atom, onset_s=atom.onset_s + tolerance_s * shift_s)
                for multiple in (0.5, 1.0, 2.0):
                    magnitude = sign * multiple * (limits[atom.name or ""] or 0.0)
                    result = identify_faults(
                        with_fault(log, part, replace(shifted, magnitude=magnitude)), DICTIONARY, config
                    )
                    declared = atom.name in {fault.name for fault in result.faults}
                    found.setdefault((atom.name or "", multiple), []).append(declared)
    pooled: dict[float, list[bool]] = {}
    for (name, multiple), declared in found.items():
        print(
            f"{', '.join(inputs)}: {name} at {multiple:g} times its limit: {np.mean(declared):.0%} of {len(declared)}"
        )
        pooled.setdefault(multiple, []).extend(declared)
    shares = {multiple: float(np.mean(declared)) for multiple, declared in pooled.items()}
    print(shares)
    assert not_above(shares[0.5], 0.40, len(pooled[0.5]))
    assert not_below(shares[1.0], 0.80, len(pooled[1.0]))
    assert not_above(shares[1.0], 0.97, len(pooled[1.0]))
    assert not_below(shares[2.0], 0.95, len(pooled[2.0]))
