"""Faults that last to the end of a recorded flight: one event with the right name, and hardly another declared.

Each is put at three moments of both flights, the whole of which is diagnosed; one of the first and the last fault runs,
with BFI_FULL=1 all. Positions are left out, since one flight has none.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, most_events, not_below
from shipped_parity import FLIGHTS

from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flight import DiagnoseResult, diagnose_flight
from bfi_cli.flight.result import Event
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.quality import with_seen_recorder

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
    (Fault(shape="static_leak", time_constant_s=5.0), {"static_leak"}, False),
)
ONSETS_S = (900.0, 2000.0, 2900.0)
LATE_S = 90.0  # of the onset, at most
MOST_OTHERS = 0.1  # events an hour of flight beside the fault: one in seven flights of 80 minutes


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
    named, others, n, hours = 0, 0, 0, 0.0
    for k, (fault, names, bare) in list(enumerate(CASES))[:: 1 if FULL else len(CASES) - 1]:
        trials = [(log, onset_s) for log in logs for onset_s in ONSETS_S]
        for log, onset_s in trials if FULL else trials[k % 6 :: 6]:
            onset_s = float(log.time_s[0]) + onset_s
            faulty = inject(log, (replace(fault, onset_s=onset_s),))
            right, wrong = told(diagnose_flight(without(faulty, LACKING if bare else ()), Config()), names, onset_s)
            named, others, n = named + right, others + wrong, n + 1
            hours += float(log.time_s[-1] - log.time_s[0]) / 3600.0
            print(
                f"{fault.shape} {fault.channel or ''} at {onset_s:.0f} s: {'named' if right else '-'}, {wrong} others"
            )
    # Of both flights again and again, so that a false event of a flight itself counts in every trial of it.
    most = int(MOST_OTHERS * hours) if FULL else most_events(MOST_OTHERS * hours)
    print(f"named {named} of {n}, {others} other events declared in {hours:.0f} h, {most} keep {MOST_OTHERS:g} an hour")
    assert FULL or (named, others) == (n, 0)  # of these every answer is known
    assert not_below(named / n, 0.8, n, worse=0.6)
    assert others <= most


RETURNS = (
    Fault(shape="bias", channel="aoa", magnitude=float(np.radians(2.4)), onset_s=1500.0, offset_s=1600.0),
    Fault(shape="drift", channel="aoa", magnitude=float(np.radians(0.03)), onset_s=1500.0, offset_s=1650.0),
    Fault(shape="pitot_icing", magnitude=0.002, onset_s=1500.0, offset_s=1700.0),
)
LATER = Fault(shape="drift", channel="pitch", magnitude=float(np.radians(0.05)), onset_s=2300.0)


@pytest.mark.parametrize("number", range(2 if FULL else 1))
def test_a_sensor_that_recovers_costs_the_rest_of_the_flight_nothing(logs: list[FlightLog], number: int) -> None:
    """A later drift is declared as without the first fault, and the first one has its end."""
    start_s = float(logs[number].time_s[0])
    log = logs[number] if FULL else logs[number].window(start_s + 800.0, start_s + 2900.0)

    def later(fault: Fault) -> Fault:
        offset_s = None if fault.offset_s is None else fault.offset_s + start_s
        return replace(fault, onset_s=fault.onset_s + start_s, offset_s=offset_s)

    def declared(*faults: Fault) -> list[Event]:
        result = diagnose_flight(inject(log, [later(fault) for fault in faults]), Config())
        return [one for one in result.events if one.state == "declared"]

    alone = next(one for one in declared(LATER) if one.fault == "pitch")
    ended = 0
    returns = RETURNS if FULL else RETURNS[1:]
    for fault in returns:
        first, *others = sorted(declared(fault, LATER), key=lambda one: one.onset_s)
        print(f"{fault.shape}: {first.fault} to {first.offset_s}, then {[one.fault for one in others]}")
        assert first.fault == (fault.channel or fault.shape)
        # The step of a recovery, a third of the pressure within a second, may break a static relation by 0.1 m/s.
        (pitch,) = (one for one in others if "parity" in one.stages)
        assert pitch.fault == "pitch"
        assert pitch.magnitude == pytest.approx(alone.magnitude, rel=0.05)
        assert pitch.onset_s == pytest.approx(alone.onset_s, abs=3.0)
        assert pitch.statistic / pitch.threshold > 0.8 * alone.statistic / alone.threshold
        ended += first.offset_s is not None and abs(first.offset_s - later(fault).offset_s) <= 3.0
    assert ended >= len(returns) - 1
