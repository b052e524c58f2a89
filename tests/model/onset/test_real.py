"""The scan on recorded flights: a fault added to a real record, calibrated on its own past or on another flight."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.model.onset import find_onset, windows_of
from bfi_cli.model.preprocessing.defaults import manoeuvres_of

pytestmark = pytest.mark.realdata

FROM_S, TO_S, ONSET_S = 3000.0, 3120.0, 3051.5


@pytest.fixture(scope="module")
def flight(flights: Path) -> FlightLog:
    """Return the flight of 2019-03-12 before its parabola."""
    return read_log(flights / "citation_20190312_123416.h5").window(1500.0, 3800.0)


@pytest.fixture
def settings() -> Callable[..., Config]:
    """Return a function that gives the settings for a window of two minutes at 2 Hz."""

    def make(**start_time: object) -> Config:
        return Config.model_validate(
            {
                "inputs": ("elevator", "pitch", "longitudinal_acc"),
                "window": {"from_s": FROM_S, "to_s": TO_S},
                "conditioning": {"rate_hz": 2.0},
                "model": {"order": 4},
                "start_time": {"shapes": ("bias", "drift"), **start_time},
            }
        )

    return make


def test_a_step_stands_out_of_the_past_of_its_own_flight(flight: FlightLog, settings: Callable[..., Config]):
    faulty = inject(flight, [Fault(shape="bias", magnitude=3.0, onset_s=ONSET_S)])
    result = find_onset(faulty, settings(calibration="self"))
    (found,) = result.faults
    assert (result.calibration.source, result.calibration.matches) == ("self", True)
    assert result.calibration.n_windows > 40
    # So clear a step that no window of the past shows its like.
    assert result.p_value == pytest.approx(1.0 / (result.calibration.n_windows + 1))
    assert found.fault.shape == "bias"
    assert found.fault.onset_s == pytest.approx(ONSET_S, abs=0.5)
    assert found.magnitude == pytest.approx(3.0, rel=0.1)


def test_without_a_fault_nothing_stands_out(flight: FlightLog, settings: Callable[..., Config]):
    result = find_onset(flight, settings(calibration="self"))
    assert (result.decision, result.faults) == ("inconclusive", ())


@pytest.mark.parametrize(
    "shape",
    [
        "bias",
        pytest.param(
            "drift",
            marks=pytest.mark.xfail(
                strict=True, reason="1.3 or 2.0 times, by half a second in where the windows of a flight begin"
            ),
        ),
    ],
)
def test_real_flights_need_a_higher_threshold_than_white_noise(
    flight: FlightLog, settings: Callable[..., Config], shape: str
):
    own = find_onset(flight, settings(calibration="self"))
    white = find_onset(flight, settings(calibration="gaussian"))
    thresholds = [{one.shape: one.threshold for one in result.profiles} for result in (own, white)]
    print(thresholds)
    assert thresholds[0][shape] > 1.5 * thresholds[1][shape]


def test_windows_fill_the_flight_but_for_its_stall(flight: FlightLog, settings: Callable[..., Config]):
    config = settings().model_copy(update={"window": Config().window})
    windows = windows_of(flight, config, length_s=120.0, step_s=60.0)
    assert windows[0][0] == pytest.approx(1500.0)
    assert windows[-1][1] <= 3800.0 + 0.11
    (stall,) = manoeuvres_of(flight, ()).manoeuvres
    assert not any(from_s < stall.reach_s[1] and to_s > stall.reach_s[0] for from_s, to_s in windows)
    assert len(windows) == 34
