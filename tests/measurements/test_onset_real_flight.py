"""Onsets in a recorded flight, calibrated on another: low-passed and decimated to 2 Hz, faults added after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from scipy.signal import butter, sosfiltfilt

from bfi_cli.config import Config, merge
from bfi_cli.decision.calibration import save_tables
from bfi_cli.errors import LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log, resample
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import OnsetResult, find_onset, table_of_windows, windows_of
from bfi_cli.serialization import provenance

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

LENGTH_S, STEP_S = 120.0, 60.0
ANALYSED, CALIBRATED = (700.0, 4100.0), (700.0, 4200.0)
STEEPEST_PITCH = np.deg2rad(30.0)
THREE = ("elevator", "pitch", "longitudinal_acc")
FAULTS = {
    "none": None,
    "bias 1": Fault(shape="bias", magnitude=1.0),
    "bias 3": Fault(shape="bias", magnitude=3.0),
    "sine 1": Fault(shape="sine", frequency_hz=0.2, magnitude=1.0),
}
FACTOR, CORNER_HZ, POLES = 5, 0.8, 6


@dataclass(frozen=True)
class Case:
    """One fault in one window."""

    fault: Fault | None
    result: OnsetResult

    @property
    def found(self) -> bool:
        """A fault of the right shape is the strongest."""
        faults = self.result.faults
        return bool(faults) and self.fault is not None and self.strongest.fault.shape == self.fault.shape

    @property
    def strongest(self):
        return max(self.result.faults, key=lambda one: one.statistic)


def sliced(log: FlightLog) -> FlightLog:
    """Return every fifth sample of a log of 10 Hz."""
    return replace(log.take(np.arange(log.n_samples) % FACTOR == 0), filters=())


def lowpassed(log: FlightLog) -> FlightLog:
    """Return the same after a Butterworth filter forwards and backwards."""
    sos = butter(POLES, CORNER_HZ, fs=log.rate_hz, output="sos")
    channels = {
        name: replace(one, values=frozen_array(sosfiltfilt(sos, one.values))) for name, one in log.channels.items()
    }
    return sliced(replace(log, channels=channels))


def usable(log: FlightLog, span: tuple[float, float]) -> list[tuple[float, float]]:
    """Return the windows of the span without the parabola."""
    config = merge(Config(), {"window.from_s": span[0], "window.to_s": span[1]})
    windows = windows_of(log, config, length_s=LENGTH_S, step_s=STEP_S)
    return [w for w in windows if np.abs(log.window(*w).channel("pitch").values).max() < STEEPEST_PITCH]


def settings(inputs: tuple[str, ...], order: int | str, calibration: Path | None) -> Config:
    """Return the configuration of a scan at the log's own 2 Hz."""
    return merge(
        Config(),
        {
            "inputs": inputs,
            "conditioning.rate_hz": "none",
            "model.order": order,
            "start_time.calibration": None if calibration is None else str(calibration),
        },
    )


def cases(
    prepare: Callable[[FlightLog], FlightLog],
    flights: Path,
    folder: Path,
    inputs: tuple[str, ...],
    order: int | str = "auto",
    every: int = 1,
) -> dict[str, list[Case]]:
    """Calibrate on the flight of 2019 and look for every fault in every window of that of 2018."""
    other = prepare(read_log(flights / "citation_20190312_123416.h5"))
    windows = usable(other, CALIBRATED)[:: 1 if FULL else 2]
    table = table_of_windows([(other, window) for window in windows], settings(inputs, order, None))
    path = folder / f"{len(inputs)}_{order}.json"
    path.write_text(save_tables([table], provenance(log_sha256="")))
    log = prepare(read_log(flights / "citation_20180312_f1.h5"))
    config = settings(inputs, order, path)
    found: dict[str, list[Case]] = {name: [] for name in FAULTS}
    rng = np.random.default_rng(0)
    for window in usable(log, ANALYSED)[::every]:
        part = log.window(*window)
        onset_s = float(part.time_s[int(part.n_samples * rng.uniform(0.3, 0.7))])
        for name, unit in FAULTS.items():
            fault = None if unit is None else replace(unit, onset_s=onset_s)
            try:
                found[name].append(Case(fault, find_onset(part if fault is None else inject(part, [fault]), config)))
            except LogError as problem:
                print(f"window from {window[0]:g} s: {problem}")
    return found


def show(title: str, found: dict[str, list[Case]]) -> None:
    """Print a line per fault."""
    alarms = [case for case in found["none"] if case.result.decision == "fault"]
    print(f"\n{title}\n  fault-free: {len(alarms)} alarms in {len(found['none'])} windows")
    for name, of in found.items():
        right = [case for case in of if case.found]
        if name != "none":
            print(f"  {name}: {len(right)} of {len(of)}, {summary(right)}")


def errors(right: list[Case]) -> tuple[float, float]:
    """Return median onset error in s and median relative magnitude error."""
    pairs = [(case.fault, case.strongest) for case in right]
    onset = [abs(one.fault.onset_s - fault.onset_s) for fault, one in pairs]
    size = [abs(abs(one.magnitude) / fault.magnitude - 1.0) for fault, one in pairs]
    return float(np.median(onset)), float(np.median(size))


def summary(right: list[Case]) -> str:
    """Return the errors in words."""
    if not right:
        return "none found"
    onset, size = errors(right)
    return f"median onset error {onset:.2f} s, median magnitude error {size:.1%}"


EVERY = 1 if FULL else 26
LONG = pytest.mark.skipif(not FULL, reason="half an hour: only where BFI_FULL=1 is set")
PREPARED = {"low-passed": lowpassed, "sliced": sliced, "resampled": lambda log: replace(resample(log, 2.0), filters=())}


@pytest.mark.parametrize("prepare", ["low-passed", pytest.param("sliced", marks=LONG)])
def test_with_three_inputs(flights: Path, tmp_path: Path, prepare: str):
    found = cases(PREPARED[prepare], flights, tmp_path, THREE, every=EVERY)
    show(f"{prepare}, inputs {', '.join(THREE)}", found)
    quiet = sum(case.result.decision != "fault" for case in found["none"])
    assert FULL or quiet == len(found["none"])
    assert not_below(quiet / len(found["none"]), 0.92, len(found["none"]))
    for name, bar in {"bias 1": 0.85, "bias 3": 0.98, "sine 1": 0.75}.items():
        right = [case for case in found[name] if case.found]
        assert FULL or len(right) == len(found[name])  # of these every answer is known
        assert not_below(len(right) / len(found[name]), bar, len(found[name]))
        if name.startswith("bias"):
            onset, size = errors(right)
            assert onset <= 0.5
            assert size <= 0.05


@LONG
def test_with_the_elevator_alone(flights: Path, tmp_path: Path):
    found = cases(lowpassed, flights, tmp_path, ("elevator",))
    show("low-passed, elevator only", found)
    right = [case for case in found["bias 3"] if case.found]
    assert not_below(len(right) / len(found["bias 3"]), 0.9, len(found["bias 3"]))
