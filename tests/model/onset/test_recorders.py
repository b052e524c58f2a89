"""A fault that hit the aircraft in front of a recorder, of every kind, is the fault that it was.

The recorders are written here with scipy, apart from those of the program, and filter motion and fault alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from noted import texts
from scipy.signal import butter, firwin, oaconvolve, sosfilt, sosfilt_zi, sosfiltfilt

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault, FaultEstimate
from bfi_cli.faults.filters import Filter
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.onset import find_onset

FINE_HZ, FACTOR = 100.0, 10
# Edges with half the gain: a Butterworth filter of order 2 has it at 3^(1/4) of its -3 dB frequency.
EDGES_HZ = {"gaussian": 0.75, "fir": 1.3, "butterworth": 1.3, "causal": 2.0 * 3.0**0.25}
BIAS = Fault(shape="bias", channel="tas", magnitude=3.0, onset_s=15.0, name="step")
SMALL = 0.002


def _record(x: np.ndarray, kind: str) -> np.ndarray:
    edge_hz = EDGES_HZ[kind]
    if kind == "causal":
        sos = butter(2, 2.0, fs=FINE_HZ, output="sos")
        return sosfilt(sos, x, zi=sosfilt_zi(sos) * x[0])[0]
    if kind == "butterworth":
        return sosfiltfilt(butter(4, edge_hz, fs=FINE_HZ, output="sos"), x)
    if kind == "fir":
        half = round(1.3 * FINE_HZ / edge_hz)
        taps = firwin(2 * half + 1, edge_hz, window=("kaiser", 5.0), fs=FINE_HZ)
    else:
        half = int(FINE_HZ)
        taps = np.exp(-0.5 * (np.arange(-half, half + 1) / FINE_HZ / 0.25) ** 2)
    return oaconvolve(np.pad(x, half, mode="edge"), taps / taps.sum(), mode="valid")


@pytest.fixture(params=list(EDGES_HZ))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def recorded(flown: Callable[..., FlightLog], kind: str) -> FlightLog:
    """Return a flight with a step, recorded at 10 Hz behind a low-pass, with the little noise of its quantisation."""
    flight, rng = flown(BIAS, noise=0.0), np.random.default_rng(5)

    def at_10_hz(values: np.ndarray, noise: float) -> np.ndarray:
        kept = _record(values, kind)[::FACTOR]
        return frozen_array(kept + noise * rng.standard_normal(len(kept)))

    channels = {
        name: replace(one, values=at_10_hz(one.values, SMALL if name == "tas" else 0.0))
        for name, one in flight.channels.items()
        if name in ("elevator", "tas")
    }
    return replace(flight, time_s=frozen_array(flight.time_s[::FACTOR]), channels=channels, truth=None, filters=None)


@pytest.mark.first_rows(1)
def test_identify_names_and_measures_it(recorded: FlightLog, kind: str):
    config = merge(Config(), {"recorder.edge_hz": EDGES_HZ[kind], "recorder.kind": kind, "onset_tolerance_s": 0.0})
    atoms = [
        {"name": "step", "shape": "bias", "channel": "tas", "onset_s": 15.0},
        {"name": "ramp", "shape": "drift", "channel": "tas", "onset_s": 15.0},
        {"name": "wave", "shape": "sine", "channel": "tas", "onset_s": 15.0, "frequency_hz": 0.3},
    ]
    result = identify_faults(recorded, load_dictionary({"atoms": atoms}), config)
    (found,) = result.faults
    assert found.name == "step"
    assert found.magnitude == pytest.approx(3.0, rel=0.03)
    assert found.ci95[0] < 3.0 < found.ci95[1]
    assert any(f"the recorder's low-pass ({kind}" in note for note in texts(result.notes))


@pytest.mark.first_rows(1)
def test_start_time_locates_and_measures_it(recorded: FlightLog, kind: str):
    stated = Filter(kind=kind, edge_hz=EDGES_HZ[kind], rate_hz=FINE_HZ)
    config = merge(Config(), {"start_time.shapes": ("bias", "drift")})
    result = find_onset(replace(recorded, filters=(stated,)), config)
    assert result.decision == "fault"
    best = max(result.faults, key=lambda fault: fault.statistic)
    assert best.fault.shape == "bias"
    assert best.fault.onset_s == pytest.approx(15.0, abs=0.1)
    assert best.magnitude == pytest.approx(3.0, rel=0.03)


def _step_with(recorded: FlightLog, recorder: Filter) -> FaultEstimate:
    config = merge(Config(), {"start_time.shapes": ("bias",)})
    faults = find_onset(replace(recorded, filters=(recorder,)), config).faults
    return max(faults, key=lambda fault: fault.statistic)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("kind", ["gaussian", "fir"])
@pytest.mark.parametrize("error", [0.85, 1.2])
def test_an_uncertain_recorder_is_measured_by_the_step(recorded: FlightLog, kind: str, error: float):
    guess = Filter(kind=kind, edge_hz=error * EDGES_HZ[kind], rate_hz=10.0, uncertain=True)
    step = _step_with(recorded, guess)
    assert step.magnitude == pytest.approx(3.0, rel=0.03)
    assert step.ci95[0] < 3.0 < step.ci95[1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gaussian"])
def test_a_wrong_recorder_that_is_taken_for_certain_measures_wrongly(recorded: FlightLog, kind: str):
    wrong = Filter(kind=kind, edge_hz=1.2 * EDGES_HZ[kind], rate_hz=10.0)
    certain, uncertain = (_step_with(recorded, one).magnitude for one in (wrong, replace(wrong, uncertain=True)))
    assert abs(uncertain - 3.0) < 0.5 * abs(certain - 3.0)


@pytest.mark.slow
def test_where_nothing_tells_the_recorder_the_note_says_so(flown: Callable[..., FlightLog]):
    unknown = replace(flown(BIAS).window(0.0, 20.0), filters=None)
    config = merge(Config(), {"start_time.shapes": ("bias",), "conditioning.rate_hz": 10.0, "model.order": 4})
    notes = texts(find_onset(unknown, config).notes)
    assert any("no low-pass is assumed (--recorder HZ states one)" in note for note in notes)
    assert not any(
        "low-pass is assumed" in note for note in texts(find_onset(replace(unknown, filters=()), config).notes)
    )
