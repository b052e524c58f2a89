"""The levels from which on an ordinary cause, eddies and a step of the pitch are told, with one aircraft left out.

What healthy flights show of each without the level is counted, but for flaps that move before a landing. For every
aircraft the level is ten to one above what the flights of the others show; a flight of it above that is a false one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from bars import not_above
from test_levels_without_aircraft import AIRCRAFT

from bfi_cli.config import Config
from bfi_cli.flight import noise, placing, proposals, surprises, weighing, weight
from bfi_cli.flight.bench import bench_of
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.model import flight_model
from bfi_cli.flight.parity import sensors
from bfi_cli.flight.parity.record import record_of
from bfi_cli.flight.parity.windows import flight_stretches
from bfi_cli.flight.seconds import seconds_of
from bfi_cli.flight.weight import ALIKE
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.phases import phases_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

LEAST, FALSE = 10.0, 0.05
BEFORE_LANDING_S = 600.0  # in which flaps move


def largest_surprise(log: FlightLog) -> float:
    """Return the log density of the surest ordinary cause that no fault does as well, beside flaps before a landing."""
    seconds, phases = seconds_of(log), phases_of(log)
    model = None if seconds is None else flight_model(seconds)
    assert model is not None
    bench = bench_of(model)
    lands_s = flight_stretches(phases)[-1][1] - BEFORE_LANDING_S
    gains = [
        event.evidence["gain"]
        for event in surprises.surprising_events(bench, phases, (), surprises.change_gains(bench))
        if event.cause != "flaps" or event.from_s < lands_s
    ]
    return max(gains, default=0.0)


def largest_step(log: FlightLog) -> float:
    """Return the log density of the surest step of a channel, surely beyond its tolerance, that the model proposes."""
    answer = weighing.weigh_events(flight_of(log, Config()), (), Config().diagnose)
    return max((event.margin or 0.0 for event in answer.events if event.stages == (placing.MODEL,)), default=0.0)


def largest_noise(log: FlightLog) -> float:
    """Return the log density of the stretch in which the airspeed alone is noisiest."""
    return max((event.evidence["gain"] for event in noise.noisy_events(log, phases_of(log), ())), default=0.0)


def largest_pitch_step(log: FlightLog) -> float:
    """Return by how many times the usual the pitch steps, beside climb and lift and beside its own minute."""
    return max((step.statistic for step in sensors.pitch_steps(record_of(log), phases_of(log))), default=0.0)


LEVELS: Mapping[str, tuple[Callable[[FlightLog], float], float, float]] = {
    "ordinary cause": (largest_surprise, surprises.TOLD, ALIKE),
    "step of a channel": (largest_step, weight.DECLARED, 0.0),
    "eddies": (largest_noise, noise.TOLD, ALIKE),
    "step of the pitch": (largest_pitch_step, sensors.UNUSUAL_PITCH, 0.0),
}


@pytest.mark.parametrize("what", LEVELS)
def test_few_healthy_flights_reach_the_level(what: str, flights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    largest, level, above = LEVELS[what]
    for module, name in ((surprises, "TOLD"), (surprises, "PROPOSED"), (noise, "TOLD")):
        monkeypatch.setattr(module, name, LEAST)
    for module in (weighing, proposals, placing):
        monkeypatch.setattr(module, "DECLARED", LEAST)
    for name in ("UNUSUAL_PITCH", "UNUSUAL_JUMP"):
        monkeypatch.setattr(sensors, name, 1.0)
    shown = {
        aircraft: [largest(read_log(flights / f"{name}.h5")) for name in names] for aircraft, names in AIRCRAFT.items()
    }
    n = sum(map(len, shown.values()))
    for aircraft, values in shown.items():
        without = above + max([value for other, of_it in shown.items() if other != aircraft for value in of_it])
        false = sum(value > without for value in values)
        print(f"{what}, {aircraft}: {np.round(values, 1)}, level without it {without:.1f}, false {false}")
    reached = sum(value > level for values in shown.values() for value in values)
    print(f"{what}: above {level:g} on {reached} of {n} healthy flights of {len(shown)} aircraft")
    assert not_above(reached / n, FALSE, n)
