"""Faults that last to the end of a recorded flight: one event with the right name, and no other declared.

Each is put at three moments of both flights, the whole of which is diagnosed; a third of them runs, with BFI_FULL=1
all. Positions are left out, since one flight has none.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shipped_parity import FLIGHTS
from trials import FULL

from bfi_cli.config import Config
from bfi_cli.diagnose import DiagnoseResult, diagnose_flight
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.recorder import with_seen_recorder

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

# The elevator too, since the scan for steps takes most of the time and what lasts is not its to find.
LEFT_OUT = ("latitude", "longitude", "elevator")
LACKING = ("cas", "mach", "tat", "sat")  # of a log whose only airspeed is the true one
STAYS = {"shape": "ramp_hold", "duration_s": 120.0}
VANE = Fault(channel="aoa", magnitude=float(np.radians(2.4)), **STAYS)
SPEED = Fault(channel="tas", magnitude=12.0, **STAYS)
# The fault, what it may be named, whether the true airspeed is the only one.
CASES = (
    (VANE, {"aoa"}, False),
    (VANE, {"aoa"}, True),
    (SPEED, {"tas", "pitot_icing"}, True),
    (Fault(shape="drift", channel="tas", magnitude=0.02), {"tas"}, False),
    (Fault(shape="bias", channel="tas", magnitude=0.5), {"tas"}, False),
    (Fault(shape="drift", channel="pitch", magnitude=float(np.radians(0.05))), {"pitch", "altitude_rate"}, False),
    (Fault(shape="pitot_icing", magnitude=0.0025), {"pitot_icing"}, False),
    (Fault(shape="pitot_blocked"), {"pitot_blocked"}, False),
)
ONSETS_S = (900.0, 2000.0, 2900.0)
LATE_S = 90.0  # of the onset, at most


@pytest.fixture(scope="module")
def logs(flights: Path) -> list[FlightLog]:
    return [without(with_seen_recorder(read_log(flights / name)), LEFT_OUT) for name in FLIGHTS]


def without(log: FlightLog, names: tuple[str, ...]) -> FlightLog:
    return replace(log, channels={name: one for name, one in log.channels.items() if name not in names})


def told(result: DiagnoseResult, names: set[str], onset_s: float) -> tuple[bool, int]:
    """Return whether the fault is declared and named, and how many other events are declared."""
    declared = [one for one in result.events if one.state == "declared"]
    right = [one for one in declared if one.fault in names and abs(one.onset_s - onset_s) <= LATE_S]
    return bool(right), len(declared) - len(right[:1])


def test_one_fault_is_one_event(logs: list[FlightLog]) -> None:
    named, others, n = 0, 0, 0
    for k, (fault, names, bare) in enumerate(CASES):
        trials = [(log, onset_s) for log in logs for onset_s in ONSETS_S]
        for log, onset_s in trials if FULL else trials[k % 3 :: 3]:
            onset_s = float(log.time_s[0]) + onset_s
            faulty = inject(log, (replace(fault, onset_s=onset_s),))
            right, wrong = told(diagnose_flight(without(faulty, LACKING if bare else ()), Config()), names, onset_s)
            named, others, n = named + right, others + wrong, n + 1
            print(
                f"{fault.shape} {fault.channel or ''} at {onset_s:.0f} s: {'named' if right else '-'}, {wrong} others"
            )
    print(f"named {named} of {n}, {others} other events declared")
    assert named >= 0.8 * n
    assert others <= 0.3 * n
