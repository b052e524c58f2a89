"""A drone's flight of 262 s, its airspeed at 5 Hz: a bias located with the calibration that is the default.

The flight holds no table's windows, so that its own serve: at 20 s there are 20 to 22 beside the analysed one, at 60 s
shorter ones do.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from bars import FULL

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import Channel, FlightLog, inject
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.low_pass import IDENTITY
from bfi_cli.model.onset import find_onset

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

RATE_HZ = 5.0
INPUTS = ("elevator", "pitch", "longitudinal_acc")
ONSETS_S = (610.0, 650.0, 690.0, 730.0, 770.0, 810.0)[:: 1 if FULL else 6]
LONG = pytest.mark.skipif(not FULL, reason="minutes: only where BFI_FULL=1 is set")
MAGNITUDE = -3.0
GRAVITY = 9.80665
# Of an elevator at full travel, rad: any number serves, since the model scales its inputs.
ELEVATOR_TRAVEL = 0.35


def topic(folder: Path, name: str) -> dict[str, np.ndarray]:
    """Return the columns of a topic of the log as ulog2csv writes it."""
    with (folder / f"flight3_{name}_0.csv").open() as file:
        heads = next(csv.reader(file))
        rows = np.genfromtxt(file, delimiter=",")
    return dict(zip(heads, rows[np.diff(rows[:, 0], prepend=-1.0) > 0].T, strict=True))


@pytest.fixture(scope="module")
def log(flights: Path) -> FlightLog:
    """Return the flight on the clock of its airspeed; the other channels are interpolated linearly."""
    folder = flights / "px4_flight3"
    air = topic(folder, "airspeed_validated")
    start_s = air["timestamp"][0] * 1e-6
    time_s = np.arange(round((air["timestamp"][-1] * 1e-6 - start_s) * RATE_HZ)) / RATE_HZ

    def on_the_clock(of: dict[str, np.ndarray], values: np.ndarray) -> np.ndarray:
        return np.interp(time_s, of["timestamp"] * 1e-6 - start_s, values)

    attitude, acceleration = topic(folder, "vehicle_attitude"), topic(folder, "vehicle_acceleration")
    w, x, y, z = (attitude[f"q[{i}]"] for i in range(4))
    controls = topic(folder, "actuator_controls_0")
    values = {
        "tas": ("m/s", on_the_clock(air, air["true_airspeed_m_s"])),
        "cas": ("m/s", on_the_clock(air, air["calibrated_airspeed_m_s"])),
        "pitch": ("rad", on_the_clock(attitude, np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)))),
        "longitudinal_acc": ("m/s^2", on_the_clock(acceleration, acceleration["xyz[0]"])),
        "normal_acc": ("m/s^2", on_the_clock(acceleration, -acceleration["xyz[2]"] - GRAVITY)),
        "elevator": ("rad", on_the_clock(controls, -ELEVATOR_TRAVEL * controls["control[1]"])),
    }
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=unit, source=name)
        for name, (unit, one) in values.items()
    }
    return FlightLog(path="px4_flight3", time_s=frozen_array(time_s), channels=channels)


def test_the_flight_is_seen_without_the_suspect(log: FlightLog) -> None:
    (stretch,) = airborne_stretches(log, suspects=["tas"])
    assert stretch == pytest.approx((577.0, 838.0), abs=5.0)


@pytest.mark.parametrize(
    ("length_s", "matches", "recorder"),
    [
        (20.0, True, None),
        (60.0, False, None),
        pytest.param(20.0, True, Filter(kind="gaussian", edge_hz=1.5, rate_hz=RATE_HZ), marks=LONG),
    ],
)
def test_a_bias_is_located_with_the_default_calibration(
    log: FlightLog, length_s: float, matches: bool, recorder: Filter | None
) -> None:
    ((first_s, last_s),) = airborne_stretches(log, suspects=["tas"])
    stated = "none" if recorder is None else recorder.edge_hz
    response = IDENTITY if recorder is None else response_of([recorder], RATE_HZ)
    located, alarms, healthy = 0, 0, np.arange(first_s, last_s - length_s, (0.5 if FULL else 5.0) * length_s)

    def located_at(one: FlightLog, from_s: float) -> float | None:
        window = {"from_s": from_s, "to_s": from_s + length_s}
        result = find_onset(one, merge(Config(), {"inputs": INPUTS, "window": window, "recorder.edge_hz": stated}))
        assert result.calibration is not None
        assert (result.calibration.source, result.calibration.matches) == ("self", matches)
        assert result.calibration.n_windows >= 20
        print(f"from {from_s:.4g} s: {result.decision}, {result.statistic:.3g} of {result.threshold:.3g}")
        best = max(result.faults, key=lambda fault: fault.statistic, default=None)
        return None if best is None else best.fault.onset_s

    for onset_s in ONSETS_S:
        fault = Fault(shape="bias", channel="tas", magnitude=MAGNITUDE, onset_s=onset_s)
        from_s = float(np.clip(onset_s - 0.5 * length_s, first_s, last_s - length_s))
        found_s = located_at(inject(log, [fault], response=response), from_s)
        located += found_s is not None and abs(found_s - onset_s) <= 0.5
    for from_s in healthy:
        alarms += located_at(log, float(from_s)) is not None
    print(f"{length_s:g} s: {located} of {len(ONSETS_S)} located, {alarms} alarms in {len(healthy)} healthy windows")
    assert located >= 0.8 * len(ONSETS_S)
    assert alarms == 0
