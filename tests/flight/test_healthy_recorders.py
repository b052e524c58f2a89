"""Healthy flights of recorders and aircraft that no threshold was made on: nothing is declared.

A fault is added to a quarter of an hour about its onset, and of the Cessna's training the half hour with a stall is
healthy; BFI_FULL=1 takes whole flights, and more onsets.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from bars import FULL

from bfi_cli.analysis import identify, start_time
from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flight.diagnose import diagnose_flight
from bfi_cli.flightlog import FlightLog, inject, read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]
LONG = pytest.mark.skipif(not FULL, reason="another onset of the one above: only where BFI_FULL=1 is set")
BESIDE_S = 450.0  # of the flight, on either side of an onset where BFI_FULL=1 is not set


def about(log: FlightLog, onset_s: float) -> FlightLog:
    """Return the part of a log about an onset, or the whole where all trials are asked for."""
    return log if FULL else log.window(onset_s - BESIDE_S, onset_s + BESIDE_S)


@pytest.mark.parametrize(
    ("name", "part"), [("reader_samples/g1000_c172.csv", (50_000.0, 51_800.0)), ("px4_flight3", (None, None))]
)
def test_nothing_is_declared(flights: Path, name: str, part: tuple[float | None, float | None]) -> None:
    """The Cessna's wind changes by 5 m/s within half an hour of training, the drone flies at 15 m/s."""
    log = read_log(flights / name)
    result = diagnose_flight(log if FULL else log.window(*part), Config())
    assert [one.fault for one in result.events if one.state == "declared"] == []
    assert result.decision != "fault"


@pytest.mark.parametrize("from_s", [50_700.0, pytest.param(50_758.0, marks=LONG)])
def test_a_practised_stall_is_no_fault(flights: Path, from_s: float) -> None:
    """The airspeed falls to 12 m/s and rises by 10 m/s within two seconds, which no linear model follows."""
    log = read_log(flights / "reader_samples" / "g1000_c172.csv")
    config = merge(
        Config(), {"inputs": ("auto",), "window.from_s": from_s, "window.to_s": from_s + (250.0 if FULL else 150.0)}
    )
    for result in (start_time(log, config), identify(log, None, config)[0]):
        assert (result.decision, result.faults) == ("inconclusive", ())
        assert any("of a stall (50789 to 50810 s)" in note.text for note in result.notes)


@pytest.mark.parametrize(
    ("fault", "onset_s"), [("pitot_blocked", 51_500.0), pytest.param("static_blocked", 51_000.0, marks=LONG)]
)
def test_a_leak_that_is_only_suspected_explains_no_blocked_line(flights: Path, fault: str, onset_s: float) -> None:
    """In this flight a static leak cannot be told from none; two landings follow."""
    log = read_log(flights / "reader_samples" / "g1000_c172.csv").window(None if FULL else onset_s - BESIDE_S, None)
    result = diagnose_flight(inject(log, [Fault(shape=fault, onset_s=onset_s)]), Config())
    declared = [one for one in result.events if one.state == "declared"]
    assert (declared[0].fault, declared[0].onset_s) == (fault, pytest.approx(onset_s, abs=5.0))


@pytest.mark.parametrize(
    ("fault", "onset_s"),
    [
        ("pitot_blocked", 49_300.0),
        pytest.param("pitot_blocked", 50_100.0, marks=LONG),
        ("static_blocked", 50_300.0),
        pytest.param("static_blocked", 52_300.0, marks=LONG),
    ],
)
def test_a_blocked_line_is_named_from_its_onset(flights: Path, fault: str, onset_s: float) -> None:
    """The true airspeed in whole knots hides a trapped pressure, the indicated one in hundredths does not."""
    log = read_log(flights / "reader_samples" / "g1000_c172.csv")
    result = diagnose_flight(inject(about(log, onset_s), [Fault(shape=fault, onset_s=onset_s)]), Config())
    declared = [(one.fault, one.onset_s) for one in result.events if one.state == "declared"]
    assert declared == [(fault, pytest.approx(onset_s, abs=5.0))]


@pytest.mark.parametrize(
    "fault",
    [
        Fault(shape="drift", channel="tas", magnitude=0.05, onset_s=52_000.0),
        Fault(shape="bias", channel="ias", magnitude=-3.0, onset_s=50_900.0),
    ],
    ids=lambda fault: fault.channel,
)
def test_an_airspeed_that_is_held_against_the_other_is_told_from_its_onset(flights: Path, fault: Fault) -> None:
    log = read_log(flights / "reader_samples" / "g1000_c172.csv")
    result = diagnose_flight(inject(about(log, fault.onset_s), [fault]), Config())
    (declared,) = (one for one in result.events if one.state == "declared")
    assert {fault.channel} <= {*declared.among} <= {"tas", "ias", "altitude"}
    assert declared.onset_s == pytest.approx(fault.onset_s, abs=5.0)
