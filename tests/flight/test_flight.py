"""What a flight is made of: channels that are not what their names say are left out."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_journeys import made_journey

from bfi_cli.flight.flight import without_other_conventions
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array


@pytest.mark.parametrize(("off", "is_used"), [(0.33, True), (0.37, False), (-0.37, False)])
def test_an_acceleration_that_differs_from_the_airspeeds_by_two_degrees_of_attitude_is_left_out(
    off: float, is_used: bool
) -> None:
    """In the mean over the flight, as one from which gravity was taken."""
    log = made_journey(rate_hz=2.0)
    along = log.channels["longitudinal_acc"]
    moved = replace(log, channels={**log.channels, along.name: replace(along, values=frozen_array(along.values + off))})
    kept, sentences = without_other_conventions(moved, phases_of(moved))
    assert (along.name in kept.channels) == is_used
    assert bool(sentences) != is_used
