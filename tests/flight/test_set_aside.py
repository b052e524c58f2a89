"""Channels that no aircraft can have are set aside: no residual, relation or event uses them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bfi_cli.config import Config
from bfi_cli.flight.flight import flight_of
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array


def test_an_index_read_as_radians_is_not_used(journey: FlightLog):
    aoa, whole = journey.channels["aoa"], flight_of(journey, Config())
    assert "aoa" in whole.log.channels
    index = frozen_array(-0.7 + 3.0 * (aoa.values - np.median(aoa.values)))
    flight = flight_of(replace(journey, channels={**journey.channels, "aoa": replace(aoa, values=index)}), Config())
    assert "aoa" not in flight.log.channels
    assert "aoa" not in flight.record.channels
    [sentence] = [one for one in flight.unused if "aoa" in one]
    assert "which no aircraft has; it may be an index" in sentence
