"""The detector on every 300 s window of two recorded flights, faults through the recorder, trained on the first third.

A seeded part runs; BFI_FULL=1 takes every window, four choices of channels and three onsets. What is excluded is tried,
too, on the same logs with a recorder that nobody states. Windows overlap by half and several runs look at one window:
bars count as many trials as there are windows side by side.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below

from bfi_cli.config import Config, merge
from bfi_cli.detection import detect_faults
from bfi_cli.detection.parity import monitor_sequentially
from bfi_cli.detection.preparation import decimate_record, prepare_detection
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import FlightLog, inject, read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
LENGTH_S, STEP_S = 300.0, 150.0
FLYING_M_S, STEEPEST_PITCH = 60.0, np.deg2rad(30.0)
# A sixth of the windows otherwise, and one onset.
SHARE = 1.0 if FULL else 0.16
ONSETS = (0.4, 0.6, 0.8) if FULL else (0.6,)
FAULTS = {"tas": 2.0, "aoa": float(np.deg2rad(1.0))}
WITH_ALTITUDE = ("tas", "aoa", "pitch", "pitch_rate", "altitude")
WITH_NORMAL_ACC = ("tas", "aoa", "pitch", "pitch_rate", "normal_acc")
CASES: dict[str, dict[str, tuple[str, ...]]] = {
    "altitude": {"outputs": WITH_ALTITUDE},
    "normal_acc": {"outputs": WITH_NORMAL_ACC},
    "altitude, elevator alone": {"outputs": WITH_ALTITUDE, "inputs": ("elevator",)},
    "normal_acc, elevator alone": {"outputs": WITH_NORMAL_ACC, "inputs": ("elevator",)},
}


@dataclass(frozen=True)
class Healthy:
    """A window without a fault: its largest deviate relative to its level."""

    flight: str
    ratio: float
    alarms: tuple[str, ...]
    after_s: float
    left_s: float


@pytest.fixture(scope="module")
def logs(flights: Path) -> tuple[FlightLog, ...]:
    return tuple(read_log(flights / name) for name in FLIGHTS)


def windows(log: FlightLog) -> Iterator[FlightLog]:
    """Yield the airborne windows of a flight without its parabola."""
    flying = np.flatnonzero(log.channel("tas").values > FLYING_M_S)
    first_s, last_s = (float(log.time_s[k]) for k in flying[[0, -1]])
    starts = np.arange(first_s, last_s - LENGTH_S, STEP_S)
    keep = np.random.default_rng(4).random(len(starts)) < SHARE
    for start_s in starts[keep]:
        part = log.window(float(start_s), float(start_s) + LENGTH_S)
        steepest = float(np.abs(part.channel("pitch").values).max())
        if part.channel("tas").values.min() > FLYING_M_S and steepest < STEEPEST_PITCH:
            yield part


def healthy(part: FlightLog, flight: str, config: Config) -> Healthy:
    prepared = prepare_detection(part, config)
    samples = decimate_record(prepared, prepared.factor)
    alarms, (first, *_) = monitor_sequentially(samples, false_alarm=config.detect.false_alarm)
    at = first.model.n_healthy - first.model.errors.start
    ratios = first.drops.deviate[at:] / first.threshold.level
    time_s = samples.time_s[first.model.samples[first.model.n_healthy :]]
    when_s = alarms[0].time_s - samples.reach_s if alarms else np.nan
    return Healthy(
        flight=flight,
        ratio=float(ratios.max()),
        alarms=tuple(one.channel for one in alarms),
        after_s=when_s - float(time_s[0]),
        left_s=float(time_s[-1]) - when_s,
    )


def test_healthy_windows_raise_few_alarms(logs: tuple[FlightLog, ...]) -> None:
    runs: dict[str, list[Healthy]] = {name: [] for name in CASES}
    for log in logs:
        for part in windows(log):
            for name, given in CASES.items():
                runs[name].append(healthy(part, log.path, merge(Config(), given)))
    for name, found in runs.items():
        declared = [(one.alarms, round(one.after_s, 1), round(one.left_s, 1)) for one in found if one.alarms]
        highest = sorted((round(one.ratio, 2) for one in found), reverse=True)[:4]
        print(f"\n{name}: {len(declared)} of {len(found)} windows alarm {declared}, highest ratios {highest}")
    every = [one for found in runs.values() for one in found]
    for log in logs:
        own = [one for one in every if one.flight == log.path]
        alarms = sum(bool(one.alarms) for one in own)
        print(f"{alarms} of {len(own)} runs on {log.path} alarm")
        assert not_above(alarms / len(own), 0.05, len(own) // (2 * len(CASES)))
    for found, each in (*((found, 1) for found in runs.values()), (every, len(CASES))):
        alarms = sum(bool(one.alarms) for one in found)
        assert not_above(alarms / len(found), 0.05, len(found) // (2 * each))


@pytest.mark.parametrize("case", CASES if FULL else ["altitude", "normal_acc"])
def test_faults_through_the_recorder_are_localised(logs: tuple[FlightLog, ...], case: str) -> None:
    config, counts, n, errors = merge(Config(), CASES[case]), Counter[str](), 0, []
    for log in logs:
        for part in windows(log):
            for share in ONSETS:
                onset_s, n = float(part.time_s[0]) + share * LENGTH_S, n + 1
                for channel, size in FAULTS.items():
                    fault = Fault(shape="bias", channel=channel, magnitude=size, onset_s=onset_s)
                    alarms = detect_faults(inject(part, [fault]), config).alarms
                    if alarms and alarms[0].channel == channel:
                        counts[channel] += 1
                        errors.append(abs(alarms[0].onset_s - onset_s))
    print(f"\n{case}: localised {dict(counts)} of {n} each, onset off by {np.median(errors):.2f} s in the median")
    for channel in FAULTS:
        assert not_below(counts[channel] / n, 0.7, n // (2 * len(ONSETS)))
    assert np.median(errors) <= 1.0


CAUSAL = Filter(kind="causal", edge_hz=2.6, rate_hz=10.0)
WINDOWED_SINC = Filter(kind="fir", edge_hz=1.3, rate_hz=10.0)


@pytest.mark.parametrize("rate_hz", ["auto", 2.0])
@pytest.mark.parametrize("stated", [True, False], ids=["stated", "unstated"])
def test_steps_just_above_what_is_excluded_raise_an_alarm(
    logs: tuple[FlightLog, ...], stated: bool, rate_hz: str | float
) -> None:
    """Through the flights' own recorder and, where none is stated, through others, at random onsets."""
    config = merge(Config(), {"outputs": WITH_ALTITUDE, "conditioning.rate_hz": rate_hz})
    rng, found, n, rates = np.random.default_rng(11), Counter[str](), 0, Counter[float]()
    for log in logs:
        (own,) = log.filters or ()
        recorders = [own] if stated else [own, CAUSAL, WINDOWED_SINC]
        for part in windows(log):
            known = replace(part, filters=part.filters if stated else None)
            result = detect_faults(known, config)
            rates[round(result.log.rate_hz, 2)] += 1
            for one in result.candidates:
                if one.state == "excluded" and one.excluded_above is not None:
                    onset_s = float(rng.uniform(part.time_s[0] + LENGTH_S / 3.0 + 1.0, part.time_s[-1] - 5.0))
                    size, n = 1.02 * float(rng.choice([-1.0, 1.0])) * one.excluded_above, n + 1
                    fault = Fault(shape="bias", channel=one.channel, magnitude=size, onset_s=onset_s)
                    for recorder in recorders:
                        failing = inject(known, [fault], response=response_of([recorder], log.rate_hz))
                        found[recorder.kind] += bool(detect_faults(failing, config).alarms)
    print(f"\nrates {dict(rates)}: of {n} steps just above what is excluded {dict(found)} raise an alarm")
    assert n > 0
    assert len(found) == (1 if stated else 3)
    assert any(found.values())
    assert all(not_below(count / n, 0.95, n // 2, worse=0.75) for count in found.values())
