"""The scale of the airspeed by circles in a wind: exact without noise, nothing said of what circles cannot tell."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.flight.plausibility.implausible import circle_scales, scale_by_circles
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array

T = np.arange(0.0, 400.0, 0.2)


def flight(scale: float = 1.0, *, turn_s: float = 40.0, gust: float = 0.0, seed: int = 0) -> FlightLog:
    """Return a flight of circles in a wind of 6 m/s, `scale` times too fast on its airspeed."""
    rng = np.random.default_rng(seed)
    speed = 25.0 + 2.0 * np.sin(0.11 * T)
    heading = 2.0 * np.pi * T / turn_s
    wind = gust * rng.normal(size=(2, T.size))
    values = {
        "tas": scale * speed,
        "velocity_north": speed * np.cos(heading) + 5.0 + wind[0],
        "velocity_east": speed * np.sin(heading) - 3.0 + wind[1],
        "altitude": 500.0 + 0.0 * T,
    }
    units = {"altitude": "m"}
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=units.get(name, "m/s"), source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(T), channels=channels)


@pytest.mark.parametrize("scale", [0.8, 0.9, 1.0, 1.25])
def test_without_noise_every_circle_gives_the_scale(scale: float):
    np.testing.assert_allclose(circle_scales(flight(scale)), 1.0 / scale, rtol=1e-7)


@pytest.mark.parametrize("scale", [0.87, 1.15])
def test_a_wrong_scale_is_named_with_its_interval(scale: float):
    finding = scale_by_circles(flight(scale, gust=1.0))
    assert finding is not None
    assert (finding.what, finding.channels) == ("scale", ("tas",))
    low, high = finding.factor_ci95 or (0.0, 0.0)
    assert low < 1.0 / scale < high
    assert high - low < 0.05
    assert "the wind would have to turn with the aircraft" in finding.text


def test_a_right_airspeed_and_a_flight_without_circles_give_no_finding():
    assert scale_by_circles(flight(gust=1.0)) is None
    assert scale_by_circles(flight(0.8, turn_s=900.0)) is None
    log = flight(0.8)
    assert scale_by_circles(FlightLog(path="made", time_s=log.time_s, channels={"tas": log.channels["tas"]})) is None


def test_a_scale_is_told_by_half_circles():
    """Ten circles of 40 s: over the ground a half takes 20 s, and the first sample of the next is no part of it."""
    assert 18 <= circle_scales(flight()).size <= 20
