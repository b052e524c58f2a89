"""Airspeed, angle of attack and pitch as outputs of one model: faults of each in windows of recorded flights.

Windows of 120 s, onset unknown, faults through the recorder that the flight shows; inputs are the elevator and what
the inertial unit measures, which answers to gusts as the outputs do; thresholds from fault-free windows of both
flights, those that are analysed among them. Half an hour: only where BFI_FULL=1 is set.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from window_trials import CITATION, FLIGHTS, LENGTH_S, flight_log, starts_s

from bfi_cli.analysis import start_time
from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.quality import recorder_filters

pytestmark = [
    pytest.mark.slow,
    pytest.mark.realdata,
    pytest.mark.skipif(not FLIGHTS.is_dir(), reason="needs the recorded flights"),
    pytest.mark.skipif(not FULL, reason="half an hour: only where BFI_FULL=1 is set"),
]

TRIALS = 40
INPUTS = ("elevator", "normal_acc", "longitudinal_acc", "pitch_rate")
OUTPUTS = ("tas", "aoa", "pitch")
FAULTS = {
    "tas drift 0.5 m/s^2": Fault(shape="drift", channel="tas", magnitude=0.5),
    "aoa step 1 degree": Fault(shape="bias", channel="aoa", magnitude=float(np.deg2rad(1.0))),
    "pitch drift 0.05 deg/s": Fault(shape="drift", channel="pitch", magnitude=float(np.deg2rad(0.05))),
}


def with_fault(log: FlightLog, fault: Fault, stop_s: float) -> FlightLog:
    """Return a flight with a fault that ends with the window, so that what is around it stays as it flew."""
    faulty = inject(log, [fault], response=response_of(recorder_filters(log)[0], log.rate_hz))
    channel = faulty.channels[fault.channel]
    values = np.where(log.time_s < stop_s, channel.values, log.channels[fault.channel].values)
    return replace(faulty, channels={**faulty.channels, fault.channel: replace(channel, values=values)})


def test_faults_of_three_outputs_in_recorded_windows(bfi, tmp_path: Path):
    table, words = tmp_path / "table.json", [word for name in OUTPUTS for word in ("--output", name)]
    words += [word for name in INPUTS for word in ("--input", name)]
    logs = [FLIGHTS / name for name in CITATION]
    assert bfi("calibrate", *logs, *words, "--length", LENGTH_S, "-o", table).code == 0
    counts = dict.fromkeys((*FAULTS, "healthy"), 0)
    for number in range(TRIALS):
        rng = np.random.default_rng([23, number])
        name = CITATION[number % 2]
        log, start = flight_log(name), float(rng.choice(starts_s(name)))
        window = {"window.from_s": start, "window.to_s": start + LENGTH_S}
        config = merge(Config(), {"inputs": INPUTS, "outputs": OUTPUTS, "start_time.calibration": str(table), **window})
        onset_s = start + float(rng.uniform(20.0, 80.0))
        counts["healthy"] += bool(start_time(log, config).faults)
        for kind, fault in FAULTS.items():
            found = start_time(with_fault(log, replace(fault, onset_s=onset_s), start + LENGTH_S), config).faults
            named = [(one.fault.channel, one.fault.shape) for one in found]
            counts[kind] += bool(named) and {channel for channel, _ in named} == {fault.channel}
            print(f"{number} {kind}: {named}")
        print(f"after {number + 1}: {counts}")
    for kind, wanted in zip(FAULTS, (0.7, 0.85, 0.6), strict=True):
        assert not_below(counts[kind] / TRIALS, wanted, TRIALS)
    assert not_below(1.0 - counts["healthy"] / TRIALS, 0.97, TRIALS)
