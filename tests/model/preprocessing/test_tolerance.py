"""The error that may stay unseen: of the flight's airspeed, whatever of it is lost, and never nothing."""

from __future__ import annotations

import numpy as np
import pytest
from made_logs import made_log

from bfi_cli.model.preprocessing.defaults import AIRSPEED_LEAST, FOOT, tolerance_of

T = np.arange(1000) / 10.0


@pytest.mark.parametrize(
    ("tas", "tolerance"),
    [
        (np.full(T.size, 120.0), 3.6),
        (np.where(T < 80.0, 120.0, 0.0), 3.6),
        (np.where(T < 20.0, 120.0, 0.0), 3.6),
        (np.where(T < 20.0, 120.0, np.nan), 3.6),
        (np.full(T.size, 60.0), AIRSPEED_LEAST),
        (np.full(T.size, 15.0), 1.5),
        (np.zeros(T.size), AIRSPEED_LEAST),
        (np.full(T.size, np.nan), AIRSPEED_LEAST),
    ],
    ids=["fast", "lost late", "lost early", "missing", "regulation", "slow", "lost", "not a number"],
)
def test_an_airspeed_that_is_lost_in_part_keeps_the_tolerance_of_the_flight(tas: np.ndarray, tolerance: float):
    log = made_log(T, {"tas": "m/s"}, tas=tas)
    assert tolerance_of(log, log, "tas") == pytest.approx(tolerance)


@pytest.mark.parametrize("outside", [7.0, np.nan], ids=["rests", "missing"])
def test_a_channel_that_moves_in_the_window_alone_is_measured_there(outside: float):
    thrust = np.where((T > 30.0) & (T < 60.0), T, outside)
    log = made_log(T, {"thrust": "N"}, thrust=thrust)
    window = log.window(30.1, 60.0)
    assert tolerance_of(log, window, "thrust") == pytest.approx(0.1 * np.ptp(window.channel("thrust").values))


def test_an_altitude_without_an_airspeed_has_the_least_tolerance_of_the_regulation():
    log = made_log(T, {"altitude": "m"}, altitude=1000.0 + T)
    assert tolerance_of(log, log, "altitude") == pytest.approx(30.0 * FOOT)


@pytest.mark.parametrize("name", ["tat", "sat"])
def test_a_probe_that_drifts_raises_no_tolerance_of_its_own(name: str):
    log = made_log(T, {name: "K"}, **{name: 280.0 + T})
    assert tolerance_of(log, log.window(20.0, 60.0), name) == 2.0
