"""The null-space detector with noise: the Boeing 747 and a recorded flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from trials import sized

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.decision import decide
from bfi_cli.detection import DetectResult, detect_faults
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.low_pass import IDENTITY

pytestmark = pytest.mark.slow

MODEL = find_model("b747")
TRAIN = merge(Config(), {"detect.train": (0.0, 8.0)})
NOISE, STEP_SD, FAR_SD, GAIN = 0.01, 5.0, 20.0, 0.9
EARLIEST_S, LATEST_S, WITHIN_S = 10.0, 18.0, 1.0
CHANNELS = ("tas", "aoa", "pitch", "pitch_rate", "altitude")
INPUTS = (("elevator",), ())
SEGMENTED = ("citation_20180312_f1", "citation_20190312_123416")[: 2 if FULL else 1]


@pytest.fixture(scope="module")
def clean() -> FlightLog:
    """Return 20 s without noise."""
    return simulate(MODEL, manoeuvre("3211", time_axis(duration_s=20.0)), rng=np.random.default_rng(0))


def noise_sd(clean: FlightLog) -> dict[str, float]:
    return {name: NOISE * float(clean.channel(name).values.std()) for name in MODEL.outputs}


def noisy(clean: FlightLog, seed: int) -> FlightLog:
    flight = manoeuvre("3211", time_axis(duration_s=20.0))
    return simulate(MODEL, flight, rng=np.random.default_rng([11, seed]), noise_sd=noise_sd(clean))


def failed(log: FlightLog, clean: FlightLog, kind: str, seed: int) -> tuple[FlightLog, str, float]:
    """Return a log in which one channel fails, its name and when."""
    rng = np.random.default_rng([13, seed])
    while True:
        name = str(rng.choice(MODEL.outputs))
        onset_s = round(float(rng.uniform(EARLIEST_S, LATEST_S)), 2)
        sd = noise_sd(clean)[name]
        channel = log.channel(name)
        deviation = clean.channel(name).values - MODEL.trim.get(name, 0.0)
        k = round(onset_s * log.rate_hz)
        if kind == "bias":
            return (
                inject(log, [Fault(shape="bias", channel=name, magnitude=STEP_SD * sd, onset_s=onset_s)]),
                name,
                onset_s,
            )
        if abs(deviation[k]) >= FAR_SD * sd:
            trim = MODEL.trim.get(name, 0.0)
            values = channel.values.copy()
            values[k:] = trim + GAIN * (values[k:] - trim)
            channels = {**log.channels, name: replace(channel, values=frozen_array(values))}
            return replace(log, channels=channels), name, onset_s


def right(result: DetectResult, name: str, onset_s: float) -> bool:
    """Say whether the first alarm is the channel, within a second."""
    first = result.alarms[0] if result.alarms else None
    return first is not None and first.channel == name and onset_s <= first.time_s <= onset_s + WITHIN_S


def test_healthy_flights_raise_few_alarms(clean: FlightLog):
    n = sized(400, 0.03)
    results = [detect_faults(noisy(clean, seed), TRAIN) for seed in range(n)]
    alarms = sum(bool(one.alarms) for one in results)
    print(f"\nhealthy: {alarms} alarms in {n} flights")
    # The noise is so small that every channel is excluded far within its tolerance.
    assert {one.verdicts["abrupt"] for one in results if not one.alarms} == {"no_fault"}
    assert alarms / n <= (0.03 + 2.0 * np.sqrt(0.03 * 0.97 / n) if FULL else 0.0)


def test_the_minimal_detectable_step_is_what_it_says(clean: FlightLog):
    """A step in any channel at any onset covered, at 0.5, 1 and 2 times what is printed for the healthy record."""
    n, declared = sized(60, 0.1), dict.fromkeys((0.5, 1.0, 2.0), 0)
    for seed in range(n):
        log, rng = noisy(clean, 2000 + seed), np.random.default_rng([29, seed])
        channels = detect_faults(log, TRAIN).candidates
        one = channels[int(rng.integers(len(channels)))]
        onset_s, sign = round(float(rng.uniform(8.5, 18.5)), 2), float(rng.choice([-1.0, 1.0]))
        for share in declared:
            size = sign * share * one.minimal_detectable
            fault = Fault(shape="bias", channel=one.channel, magnitude=size, onset_s=onset_s)
            alarms = detect_faults(inject(log, [fault]), TRAIN).alarms
            declared[share] += one.channel in [alarm.channel for alarm in alarms]
    print(f"\nminimal detectable: declared {declared} of {n} at 0.5, 1, 2 times it")
    assert FULL or declared == {0.5: 1, 1.0: 5, 2.0: 6}  # of these every answer is known
    assert not_below(declared[1.0] / n, 0.8, n)
    assert not_below(1.0 - declared[0.5] / n, 0.6, n)
    assert not_below(declared[2.0] / n, 0.95, n)


def shaken(log: FlightLog, clean: FlightLog, seed: int) -> FlightLog:
    """Return a log with noise on the inputs too."""
    rng, channels = np.random.default_rng([23, seed]), dict(log.channels)
    for name in MODEL.inputs:
        sd = NOISE * float(clean.channel(name).values.std())
        values = log.channel(name).values + sd * rng.standard_normal(log.n_samples)
        channels[name] = replace(log.channel(name), values=frozen_array(values))
    return replace(log, channels=channels)


@pytest.mark.parametrize("everywhere", [False, True], ids=["outputs", "inputs too"])
@pytest.mark.parametrize("kind", ["gain", "bias"])
def test_a_failure_is_localised_within_a_second(clean: FlightLog, kind: str, everywhere: bool):
    n, found, delays = sized(100, 0.05), 0, []
    for seed in range(n):
        log, name, onset_s = failed(noisy(clean, 1000 + seed), clean, kind, seed)
        log = shaken(log, clean, seed) if everywhere else log
        result = detect_faults(log, TRAIN)
        ok = right(result, name, onset_s)
        found += ok
        delays += [result.alarms[0].time_s - onset_s] if ok else []
        if not ok:
            print(f"\n  seed {seed}: {name} at {onset_s:g} s: {[(one.channel, one.time_s) for one in result.alarms]}")
    print(f"\n{kind}: {found} of {n} localised, median delay {np.median(delays):.2f} s")
    assert FULL or found == n  # of these every answer is known
    assert not_below(found / n, 0.90, n)


@pytest.mark.parametrize("noise", [1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.05] if FULL else [1e-5, 0.05])
def test_healthy_flights_raise_few_alarms_at_other_noises(clean: FlightLog, noise: float):
    """No bar of the method's source: what is wanted must hold at every noise; steps are shown beside it."""
    n, alarms, found = sized(100, 0.06), 0, 0
    sds = {name: noise / NOISE * sd for name, sd in noise_sd(clean).items()}
    for seed in range(n):
        flight = manoeuvre("3211", time_axis(duration_s=20.0))
        log = simulate(MODEL, flight, rng=np.random.default_rng([17, seed]), noise_sd=sds)
        alarms += bool(detect_faults(log, TRAIN).alarms)
        rng = np.random.default_rng([19, seed])
        name, onset_s = str(rng.choice(MODEL.outputs)), round(float(rng.uniform(EARLIEST_S, LATEST_S)), 2)
        step = Fault(shape="bias", channel=name, magnitude=STEP_SD * sds[name], onset_s=onset_s)
        found += right(detect_faults(inject(log, [step]), TRAIN), name, onset_s)
    print(f"\nnoise {noise:g}: {alarms} alarms in {n} healthy flights, a bias of 5 sd localised in {found}")
    assert alarms / n <= (0.03 + 2.0 * np.sqrt(0.03 * 0.97 / n) if FULL else 0.0)


def segments(flights: Path) -> list[FlightLog]:
    logs = [read_log(flights / f"{name}.h5") for name in SEGMENTED]
    return [
        log.window(one.start_s, one.stop_s)
        for log in logs
        for one in log.segments
        if one.label in ("manual_trim_curve", "trim_cgshift_phugoid_sp")
    ]


@pytest.mark.realdata
@pytest.mark.parametrize("inputs", INPUTS, ids=["elevator", "default"])
def test_hand_flown_segments(flights: Path, inputs: tuple[str, ...]):
    settings = merge(Config(), {"outputs": CHANNELS, "inputs": inputs or None})
    faults = {"tas": 1.0, "aoa": np.deg2rad(0.5)}
    found = dict.fromkeys(faults, 0)
    logs = segments(flights)
    alarms = 0
    for log in logs:
        start_s, length_s = float(log.time_s[0]), float(np.ptp(log.time_s))
        healthy = detect_faults(log, settings)
        alarms += bool(healthy.alarms)
        assert healthy.decision == decide(healthy.verdicts, ("abrupt",))
        print(f"\n{start_s:g} s: {healthy.decision}, {healthy.summary}")
        for channel, size in faults.items():
            onset_s = start_s + 0.6 * length_s
            fault = Fault(shape="bias", channel=channel, magnitude=size, onset_s=onset_s)
            result = detect_faults(inject(log, [fault], response=IDENTITY), settings)  # sharp, after the recorder
            found[channel] += bool(result.alarms) and result.alarms[0].channel == channel
    print(f"\ninputs {', '.join(inputs) or 'by default'}: {alarms} of {len(logs)} segments alarm; localised {found}")
    assert alarms == 0
    # Such small steps are near what a threshold that holds in later gusts leaves: with default inputs a step of 1 m/s
    # of tas is missed in one of three segments, with the elevator alone it is not asked for.
    assert found["aoa"] >= len(logs) - bool(inputs)
    assert inputs or found["tas"] >= len(logs) - 1
