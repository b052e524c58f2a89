"""The share of a healthy flight in which a fault of three tolerances is declared.

A step of one airspeed alone, of either sign, is added at random times between take-off and landing, each drawn in
its own stretch of equal length, with ten minutes about it. Declared with the airspeed in its set, and its onset in the
interval, it is covered. Beside it, without a bar, ice that closes the tube for a minute: where only a receiver of
satellites bounds the airspeed, a wind explains it as well. The short form takes one flight of a light aircraft;
BFI_FULL=1 all healthy ones:
`BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=14400 tests/measurements/test_coverage.py`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from stated_sizes import PART_S, begins_within, text_of
from test_levels_without_aircraft import AIRCRAFT

from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flight import diagnose_flight
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.unwatched import flown_of
from bfi_cli.flightlog import FlightLog, inject, read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

TOLERANCES = 3.0
ONSETS = 10  # per flight and kind
ICES_S = 60.0
SHORT = {"G3X home-built": ("g3x_homebuilt_pfd2",)}
WANTED = 0.8


def airspeed_of(log: FlightLog) -> str:
    """Return the airspeed of a log to which the fault is added."""
    return next(name for name in ("tas", "cas", "ias") if name in log.channels)


def faults_of(log: FlightLog, rng: np.random.Generator) -> list[Fault]:
    """Return faults of three tolerances at times that are spread over the flight."""
    flight = flight_of(log, Config())
    stretches = flown_of(flight)
    name, airborne_s = airspeed_of(log), sum(last - first for first, last in stretches)
    faults = []
    for shape in ("bias", "pitot_icing"):
        for k in range(ONSETS):
            since_s = airborne_s * (k + rng.uniform()) / ONSETS
            for first, last in stretches:
                if since_s <= last - first:
                    break
                since_s -= last - first
            onset_s = first + since_s
            tolerance = flight.tolerance(name, (max(first, onset_s - 60.0), min(last, onset_s + 60.0)))
            assert tolerance is not None
            size = TOLERANCES * tolerance
            if shape == "bias":
                sign = float(rng.choice([-1.0, 1.0]))
                faults.append(Fault(shape=shape, channel=name, magnitude=sign * size, onset_s=onset_s))
            else:
                speed = float(np.nanmedian(log.window(onset_s, onset_s + ICES_S).channel(name).values))
                lost = 1.0 - (1.0 - min(size / speed, 0.9)) ** 2
                faults.append(Fault(shape=shape, magnitude=lost / ICES_S, onset_s=onset_s, offset_s=onset_s + ICES_S))
    return faults


def is_covered(log: FlightLog, fault: Fault) -> bool:
    """Return whether a fault is declared by its name, alone or in a set, in the part of the log about it."""
    grown_s = 0.0 if fault.offset_s is None else fault.offset_s - fault.onset_s
    part = replace(inject(log, [fault]), truth=None).window(
        max(float(log.time_s[0]), fault.onset_s - PART_S), min(float(log.time_s[-1]), fault.onset_s + grown_s + PART_S)
    )
    answer = diagnose_flight(part, Config())
    name = fault.channel or fault.shape
    declared = [event for event in answer.events if event.state == "declared"]
    covered = any(begins_within(event, name, fault.onset_s, fault.onset_s + grown_s) for event in declared)
    print(f"{name} {fault.magnitude:.3g} from {fault.onset_s:.0f} s", covered, text_of(answer), sep=" | ", flush=True)
    return covered


def marked(aircraft: str) -> object:
    """Return an aircraft, of which a bar that is not kept is expected to fail."""
    short = pytest.mark.xfail(strict=True, reason="flights of 150 s at 15 m/s: no step of 3.5 to 5 m/s is declared")
    return pytest.param(aircraft, marks=short) if aircraft.startswith("PX4") else aircraft


@pytest.mark.parametrize("aircraft", [marked(aircraft) for aircraft in (AIRCRAFT if FULL else SHORT)])
def test_steps_of_three_tolerances_are_declared_in_most_of_a_flight(aircraft: str, flights: Path) -> None:
    every: list[bool] = []
    for name in AIRCRAFT[aircraft] if FULL else SHORT[aircraft]:
        log = read_log(flights / f"{name}.h5")
        faults = faults_of(log, np.random.default_rng(37))
        covered = [is_covered(log, fault) for fault in (faults if FULL else faults[:ONSETS:3])]
        steps, ices = covered[:ONSETS], covered[ONSETS:]
        print(f"{name}: steps {sum(steps)} of {len(steps)}, ice {sum(ices)} of {len(ices)}", flush=True)
        every += steps
    if not FULL:  # of these every answer is known
        assert all(every)
    assert not_below(sum(every) / len(every), WANTED, len(every))
