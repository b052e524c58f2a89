"""Eddies: what is noisier alone for a while is told with start, end and ratio; what stirs others too is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from made_events import event_of
from made_journeys import made_journey

from bfi_cli.decision import State
from bfi_cli.flight.noise import TOLD, noisy_events
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array

FROM_S, TO_S = 450.0, 495.0
CALM_S = (500.0, 600.0)


def stirred(noise: Mapping[str, float], *, seed: int = 0, until_s: float = TO_S) -> FlightLog:
    """Return a flight in which some channels have more noise for a while."""
    log, rng = made_journey(rate_hz=2.0), np.random.default_rng(seed)
    inside = (log.time_s >= FROM_S) & (log.time_s < until_s)
    channels = dict(log.channels)
    for name, sd in noise.items():
        more = sd * inside * rng.standard_normal(log.n_samples)
        channels[name] = replace(channels[name], values=frozen_array(channels[name].values + more))
    return replace(log, channels=channels)


@pytest.mark.parametrize("sd", [0.2, 0.5])
def test_eddies_are_told_with_start_end_and_ratio(sd: float) -> None:
    log = stirred({"tas": sd, "cas": sd})
    (event,) = noisy_events(log, phases_of(log), ())
    assert (event.cause, event.looks_like) == ("wake", "")
    assert event.from_s == pytest.approx(FROM_S, abs=3.0)
    assert event.to_s == pytest.approx(TO_S, abs=3.0)
    inside, calm = (np.std(np.diff(log.window(*span).channel("tas").values, 2)) for span in ((FROM_S, TO_S), CALM_S))
    assert event.magnitude == pytest.approx(inside / calm, rel=0.2)
    assert event.evidence["gain"] > TOLD


@pytest.mark.parametrize(
    ("noise", "until_s"),
    [
        ({}, TO_S),
        ({"tas": 0.3, "normal_acc": 2.0}, TO_S),  # turbulence
        ({"tas": 0.3}, 960.0),  # for good
        ({"tas": 30.0}, FROM_S + 1.0),  # spikes
    ],
)
def test_what_is_healthy_stirs_others_or_does_not_pass_is_no_wake(noise: Mapping[str, float], until_s: float) -> None:
    log = stirred(noise, until_s=until_s)
    assert list(noisy_events(log, phases_of(log), ())) == []


@pytest.mark.parametrize(("state", "looks_like"), [("suspected", ["tas"]), ("declared", [])])
def test_what_is_declared_of_the_airspeed_disturbs_it(state: State, looks_like: list[str]) -> None:
    log = stirred({"tas": 0.5})
    events = noisy_events(log, phases_of(log), [event_of("tas", FROM_S, state)])
    assert [event.looks_like for event in events] == looks_like


def rattling(sizes: tuple[float, float, float]) -> FlightLog:
    """Return a flight whose airspeed jumps to and fro by sizes, of which the second and the third are for a while."""
    log = made_journey(rate_hz=2.0)
    usual, beside, inside = sizes
    t, sign = log.time_s, (-1.0) ** np.arange(log.n_samples)
    size = np.where((t >= FROM_S) & (t < TO_S), inside, np.where((t >= FROM_S - 40) & (t < TO_S + 40), beside, usual))
    steady = replace(log.channels["tas"], values=frozen_array(100.0 + size * sign))
    return replace(log, channels={"tas": steady, **{name: log.channels[name] for name in ("altitude", "cas", "pitch")}})


@pytest.mark.parametrize(("ratio", "told"), [(2.08, True), (1.9, False)])
def test_eddies_are_told_from_a_log_density_of_forty_on(ratio: float, told: bool) -> None:
    """In 45 s 45/2 (r^2 - 1 - ln r^2) nats: 42 of 2.08 times the noise beside, 30 of 1.9."""
    log = rattling((1.0, 1.0, ratio))
    gains = [event.evidence["gain"] for event in noisy_events(log, phases_of(log), ())]
    assert [40.0 < gain < 46.0 for gain in gains] == ([True] if told else [])


def test_a_calm_that_is_rounding_is_no_calmer_than_a_fifth_of_the_noise() -> None:
    log = rattling((1.0, 0.0, 1.0))
    (event,) = noisy_events(log, phases_of(log), ())
    assert event.magnitude == pytest.approx(5.0, rel=0.1)
