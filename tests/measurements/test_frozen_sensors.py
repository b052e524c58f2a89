"""Sensors that hold their reading for 40 s or to the end of recorded flights, and healthy windows of all recorders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from shipped_parity import FLIGHTS

from bfi_cli.faults import Fault
from bfi_cli.flight.parity.frozen import MOVING, frozen_sensors
from bfi_cli.flight.parity.record import record_of
from bfi_cli.flight.parity.windows import flight_stretches
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.quantities.channels import quantity_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

PLACEMENTS, LASTS_S, WINDOW_S = (24 if FULL else 2), 40.0, 120.0
OTHERS = ("reader_samples/g1000_c172.csv", "px4_flight3", "sim_ae4320_de3211_1.h5", "de3211_1.mat")


def frozen_in(log: FlightLog) -> list[str]:
    return [one.fault for one in frozen_sensors(log, record_of(log), phases_of(log))]


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_sensor_that_freezes_is_named_alone(flights: Path, name: str) -> None:
    log, rng = read_log(flights / name), np.random.default_rng(0)
    stretches = [one for one in flight_stretches(phases_of(log)) if one[1] - one[0] > 3.0 * LASTS_S]
    named = []
    for channel in (one for one in log.channels if quantity_of(one) in MOVING):
        for _ in range(PLACEMENTS):
            from_s, to_s = stretches[int(rng.integers(len(stretches)))]
            onset_s = rng.uniform(from_s, to_s - 1.5 * LASTS_S)
            offset_s = None if rng.random() < 0.5 else onset_s + LASTS_S
            fault = Fault(shape="frozen", channel=channel, onset_s=onset_s, offset_s=offset_s)
            named.append(frozen_in(inject(log, [fault])) == [channel])
    print(f"\n{name}: {sum(named)} of {len(named)} named alone")
    assert FULL or sum(named) >= len(named) - 1  # of these every answer is known
    assert not_below(sum(named) / len(named), 0.93, len(named))


@pytest.mark.parametrize("name", [*FLIGHTS, *OTHERS])
def test_none_freezes_in_healthy_flight(flights: Path, name: str) -> None:
    log = read_log(flights / name)
    assert frozen_in(log) == []
    starts_s = [
        start_s
        for from_s, to_s in flight_stretches(phases_of(log))
        for start_s in np.arange(from_s, to_s - WINDOW_S, 0.5 * WINDOW_S)
    ]
    alarms = [start_s for start_s in starts_s if frozen_in(log.window(start_s, start_s + WINDOW_S))]
    print(f"\n{name}: {len(alarms)} of {len(starts_s)} windows")
    assert alarms == []
