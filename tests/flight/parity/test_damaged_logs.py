"""Channels that are missing, zero, impossible or frozen: an answer without an invented hold, never an exception."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flights import RECORDED, made_flight

from bfi_cli.flight.parity.holds import find_holds
from bfi_cli.flight.parity.relation_series import relation_series
from bfi_cli.flight.parity.static_relations import find_static
from bfi_cli.flightlog.record import frozen_array

DAMAGE = {
    "missing": lambda x: None,
    "not a number": lambda x: np.full_like(x, np.nan),
    "zero": np.zeros_like,
    "negative": lambda x: -np.abs(x),
    "huge": lambda x: np.full_like(x, 1e6),
    "frozen": lambda x: np.full_like(x, x[0]),
}


@pytest.mark.first_rows(12)
@pytest.mark.parametrize("channel", RECORDED)
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_channel_is_no_exception(channel: str, damage: str):
    log = made_flight(seconds=300.0)
    values = DAMAGE[damage](np.array(log.channels[channel].values))
    channels = {name: one for name, one in log.channels.items() if name != channel}
    if values is not None:
        channels[channel] = replace(log.channels[channel], values=frozen_array(values))
    damaged = replace(log, channels=channels)
    holds, relations = find_holds(damaged, 0.0, 300.0), find_static(damaged, 60.0, 180.0)
    assert holds.findings == ()
    assert relations.relations or relation_series(damaged)[1]
    if damage in ("missing", "not a number"):
        assert relations.findings == ()


@pytest.mark.parametrize("window", [(1000.0, 1100.0), (200.0, 100.0), (0.0, 20.0), (0.0, 0.0)])
def test_a_window_without_enough_of_the_log_has_no_findings(window: tuple[float, float]):
    log = made_flight(seconds=300.0)
    assert find_holds(log, *window).findings == ()
    relations = find_static(log, *window)
    assert relations.findings == relations.relations == ()


@pytest.mark.parametrize("rate_hz", [0.2, 1.0, 100.0])
def test_every_rate_has_an_answer(rate_hz: float):
    log = made_flight(seconds=300.0, rate_hz=rate_hz)
    assert find_holds(log, 0.0, 300.0).findings == ()
    assert find_static(log, 0.0, 300.0).findings == ()
