"""Altitudes that step by 12 to 120 m in recorded flights; other faults, and healthy flights, in which none does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from shipped_parity import FLIGHTS

from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.parity.windows import flight_stretches
from bfi_cli.flight.relations import drafts_of_relations, find_relations
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import phases_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

TRIALS = 24 if FULL else 2
BESIDE_S = 600.0  # of the flight, before an onset and after it
RECORDERS = (*FLIGHTS, "reader_samples/g1000_c172.csv")
OTHERS: dict[str, dict[str, float]] = {
    "static_blocked": {},
    "static_leak": {"magnitude": 0.1, "time_constant_s": 2.0},
    "pitot_blocked": {},
}


def steps_in(log: FlightLog) -> list[tuple[float, float]]:
    """Return onset and size of every step of the altitude."""
    found = [one for one in flight_of(log, Config()).stepped if one.fault == "altitude"]
    return [(one.onset_s, one.magnitude or 0.0) for one in found]


def around(log: FlightLog, onset_s: float) -> FlightLog:
    """Return the flight, or without BFI_FULL=1 what lies about an onset."""
    first_s, last_s = float(log.time_s[0]), float(log.time_s[-1])
    return log if FULL else log.window(max(first_s, onset_s - BESIDE_S), min(last_s, onset_s + BESIDE_S))


def onsets(log: FlightLog) -> list[float]:
    rng = np.random.default_rng(0)
    stretches = [one for one in flight_stretches(phases_of(log)) if one[1] - one[0] > 180.0]
    return [rng.uniform(a + 60.0, b - 90.0) for a, b in (stretches[k % len(stretches)] for k in range(TRIALS))]


@pytest.mark.parametrize("name", RECORDERS)
def test_an_altimeter_that_steps_is_found_with_its_size(flights: Path, name: str) -> None:
    log, rng = read_log(flights / name), np.random.default_rng(1)
    found = []
    for onset_s in onsets(log):
        size = float(rng.choice([-1.0, 1.0]) * rng.uniform(12.0, 120.0))
        step = Fault(shape="bias", channel="altitude", onset_s=onset_s, magnitude=size)
        told = steps_in(inject(around(log, onset_s), [step]))
        found.append(len(told) == 1 and abs(told[0][0] - onset_s) < 4.0 and abs(told[0][1] / size - 1.0) < 0.15)
    print(f"\n{name}: {sum(found)} of {len(found)}")
    assert FULL or all(found)  # of these every answer is known
    assert not_below(sum(found) / len(found), 0.8, len(found))


@pytest.mark.parametrize("name", RECORDERS)
def test_other_faults_and_healthy_flights_have_none(flights: Path, name: str) -> None:
    log = read_log(flights / name)
    assert steps_in(log) == []
    told = {}
    for shape, keys in OTHERS.items():
        for onset_s in onsets(log):
            fault = Fault(shape=shape, onset_s=onset_s, **keys)  # type: ignore[arg-type]
            found = steps_in(inject(around(log, onset_s), [fault]))
            if found:
                told[shape, round(onset_s)] = found
    print(f"\n{name}: {told}")
    assert told == {}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_small_step_of_cas_is_not_taken_for_a_large_one_of_the_altitude(flights: Path, name: str) -> None:
    log = read_log(flights / name)
    named = []
    for onset_s in onsets(log):
        fault = Fault(shape="bias", channel="cas", onset_s=onset_s, magnitude=0.5)
        flight = flight_of(inject(around(log, onset_s), [fault]), Config())
        drafts = drafts_of_relations(flight, find_relations(flight))
        named += [one.finding.among for one in drafts if abs(one.finding.onset_s - onset_s) < 4.0]
    print(f"\n{name}: {named}")
    assert len(named) >= 0.9 * TRIALS
    assert all("altitude" not in among for among in named)
