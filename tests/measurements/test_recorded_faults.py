"""Faults that went through the recorder, in recorded flights at 10 Hz; thresholds always from the other flight.

Six windows run, whose answers are known; BFI_FULL=1 takes every one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below
from verdict_trials import RECORDER_SD_S, SHAPES, cross_calibrated, gaussian

from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import find_onset

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
LENGTH_S, STEP_S, SPAN_S = 120.0, 50 if FULL else 1300, range(700, 4200)
STEEPEST_PITCH = np.deg2rad(30.0)
ONSET = {"channel": "tas", "onset_s": 60.0}
DICTIONARY = load_dictionary(
    {"relative_to": "window", "atoms": [{"name": name, **keys, **ONSET} for name, keys in SHAPES.items()]}
)


def windows(log: FlightLog, step_s: int = STEP_S) -> Iterator[FlightLog]:
    """Yield the airborne windows of a flight without its parabola."""
    for start in SPAN_S[::step_s]:
        part = log.window(float(start), start + LENGTH_S)
        if np.abs(part.channel("pitch").values).max() < STEEPEST_PITCH:
            yield part


def with_fault(log: FlightLog, part: FlightLog, fault: Fault) -> FlightLog:
    """Return a window of a log with a fault that went through the recorder."""
    start_s = float(part.time_s[0])
    added = fault.magnitude * gaussian(unit_signal(fault, log.time_s, window_start_s=start_s), log.rate_hz)
    first = int(np.searchsorted(log.time_s, start_s - 1e-6))
    tas = part.channel("tas")
    faulty = replace(tas, values=frozen_array(tas.values + added[first : first + part.n_samples]))
    return replace(part, channels={**part.channels, "tas": faulty})


@dataclass
class Count:
    """What came of one fault."""

    n: int = 0
    right: int = 0
    wrong: int = 0
    named: int = 0
    covered: int = 0
    onset_covered: int = 0


@pytest.fixture(scope="module")
def logs(flights: Path) -> tuple[FlightLog, FlightLog]:
    first, second = (read_log(flights / name) for name in FLIGHTS)
    return first, second


def test_the_recorder_is_seen_in_both_flights(logs: tuple[FlightLog, FlightLog]) -> None:
    for log in logs:
        (recorder,) = log.filters or ()
        print(log.path, recorder)
        assert recorder.kind == "gaussian"
        assert recorder.edge_hz == pytest.approx(np.sqrt(np.log(2) / 2) / np.pi / RECORDER_SD_S, rel=0.02)


def test_identify_with_a_known_onset(logs: tuple[FlightLog, FlightLog]) -> None:
    magnitudes = [("bias", 1.0), ("bias", 3.0), ("drift", 0.5), ("lagged_bias", 3.0), ("ramp_hold", -4.0)]
    counts = {case: Count() for case in [None, *magnitudes, ("sine_0.2", 1.0)]}
    for log in logs:
        for part in windows(log):
            for case, count in counts.items():
                faulty = part
                if case is not None:
                    atom = next(one for one in DICTIONARY.resolved(float(part.time_s[0])) if one.name == case[0])
                    faulty = with_fault(log, part, replace(atom, magnitude=case[1]))
                result = identify_faults(faulty, DICTIONARY, Config())
                found = {fault.name: fault for fault in result.faults}
                wanted = set() if case is None else {case[0]}
                count.n += 1
                count.right += set(found) == wanted
                count.wrong += not set(found) <= wanted
                if case is not None and case[0] in found:
                    low, high = found[case[0]].ci95
                    count.named, count.covered = count.named + 1, count.covered + (low <= case[1] <= high)
    for case, count in counts.items():
        print(case or "no fault", count)
    shapes = [count for case, count in counts.items() if case is not None]
    covered, named = sum(count.covered for count in shapes), sum(count.named for count in shapes)
    print(f"95 % intervals cover {covered} of {named} ({covered / named:.1%})")
    none = counts[None]
    if not FULL:
        assert none.right == none.n
        assert {count.named for case, count in counts.items() if case and case[0] in ("bias", "sine_0.2")} == {none.n}
        assert named - covered <= 1
    assert not_below(1.0 - none.wrong / none.n, 0.97, none.n)
    for case, bar in {("bias", 1.0): 0.85, ("bias", 3.0): 0.97, ("sine_0.2", 1.0): 0.90}.items():
        assert not_below(counts[case].named / counts[case].n, bar, counts[case].n)
    assert not_below(covered / named, 0.91, named)
    assert not_above(covered / named, 0.98, named)
    for count in shapes:
        assert not_below(count.covered / count.named, 0.88, count.named)


@pytest.mark.parametrize(
    ("inputs", "bars"),
    [
        pytest.param(
            ("auto",),
            {"bias 1": 0.75, "bias 3": 0.95, "drift 0.5": 0.65},
            marks=pytest.mark.skipif(not FULL, reason="minutes: only where BFI_FULL=1 is set"),
        ),
        # Whose tables test_verdicts makes as well.
        (("elevator", "pitch", "longitudinal_acc"), {"bias 1": 0.55, "bias 3": 0.85, "drift 0.5": 0.45}),
    ],
)
def test_start_time_with_the_other_flights_thresholds(
    logs: tuple[FlightLog, FlightLog], tables: Path, inputs: tuple[str, ...], bars: dict[str, float]
) -> None:
    faults = {
        "none": None,
        "bias 1": Fault(shape="bias", channel="tas", magnitude=1.0),
        "bias 3": Fault(shape="bias", channel="tas", magnitude=3.0),
        "drift 0.5": Fault(shape="drift", channel="tas", magnitude=0.5),
    }
    counts, onsets, sizes = {name: Count() for name in faults}, [], []
    rng = np.random.default_rng(0)
    for flight, log in zip(FLIGHTS, logs, strict=True):
        config = cross_calibrated(flight, "own", inputs, tables)
        for part in windows(log):
            onset_s = float(part.time_s[int(part.n_samples * rng.uniform(0.3, 0.7))])
            for name, fault in faults.items():
                count = counts[name]
                placed = None if fault is None else replace(fault, onset_s=onset_s)
                result = find_onset(part if placed is None else with_fault(log, part, placed), config)
                assert result.calibration is not None
                assert result.calibration.matches
                count.n, count.wrong = count.n + 1, count.wrong + (placed is None and result.decision == "fault")
                best = max(result.faults, key=lambda one: one.statistic, default=None)
                if placed is None or best is None or best.fault.shape != placed.shape:
                    continue
                count.right += 1
                count.covered += best.ci95[0] <= placed.magnitude <= best.ci95[1]
                count.onset_covered += best.onset_ci95[0] <= onset_s <= best.onset_ci95[1]
                onsets.append(abs(best.fault.onset_s - onset_s))
                sizes.append(abs(best.magnitude / placed.magnitude - 1.0))
    for name, count in counts.items():
        print(", ".join(inputs), name, count)
    print(f"median onset error {np.median(onsets):.2f} s, median magnitude error {np.median(sizes):.1%}")
    assert not_below(1.0 - counts["none"].wrong / counts["none"].n, 0.97, counts["none"].n)
    if not FULL:
        assert counts["none"].wrong == 0
        assert all(counts[name].right >= known for name, known in {"bias 1": 4, "bias 3": 6, "drift 0.5": 2}.items())
    for name, bar in bars.items():
        count = counts[name]
        assert not_below(count.right / count.n, bar, count.n)
        assert not_below(count.covered / count.right, 0.88, count.right)
        assert not_below(count.onset_covered / count.right, 0.88, count.right)
    assert np.median(onsets) <= 0.1
    assert np.median(sizes) <= 0.05
