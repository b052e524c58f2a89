"""Lines that hold and leak on recorded flights whose altitude comes in steps, at several rates.

Altitudes of flight recorders are in steps of one foot, of transponders in steps of 25 and 100 ft. Level flight then
stands still for minutes within a step.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL
from test_recorded_faults import FLIGHTS

from bfi_cli.faults import Fault
from bfi_cli.flight.parity.holds import find_holds
from bfi_cli.flight.parity.relation_series import relation_series
from bfi_cli.flight.parity.static_relations import find_static
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.quality import with_seen_recorder
from bfi_cli.flightlog.record import frozen_array

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

FOOT_M = 0.3048
STEPS_FT = (0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0)
SPEEDS, AIRSPEED_STEPS = ("tas", "cas"), (0.05, 0.1, 0.25, 0.5, 0.5144, 1.0, 2.5)  # m/s
RATES_HZ = (10.0, 1.0, 0.5)
TIME_CONSTANTS_S = (1.0, 2.0, 5.0, 10.0, 20.0)
CABINS_M = (None, 0.0, 1200.0, 1800.0, 2400.0)  # altitudes; None where it is open to the ground


@pytest.fixture(scope="module")
def logs(flights: Path) -> list[FlightLog]:
    return [with_seen_recorder(read_log(flights / name)) for name in FLIGHTS]


def coarse(log: FlightLog, rate_hz: float, step_m: float) -> FlightLog:
    """Return every n-th sample of a log, its altitude rounded to steps."""
    every = max(1, round(log.rate_hz / rate_hz))
    channels = {name: replace(one, values=frozen_array(one.values[::every])) for name, one in log.channels.items()}
    if step_m:
        altitude = channels["altitude"]
        rounded = np.round(altitude.values / step_m) * step_m
        channels["altitude"] = replace(altitude, values=frozen_array(rounded))
    return replace(log, time_s=frozen_array(log.time_s[::every]), channels=channels)


def test_a_healthy_flight_has_no_hold_in_coarse_steps(logs: list[FlightLog]) -> None:
    trials = [(log, rate_hz, feet) for log in logs for rate_hz in RATES_HZ for feet in STEPS_FT]
    for log, rate_hz, feet in trials if FULL else trials[::13]:
        holds = find_holds(coarse(log, rate_hz, feet * FOOT_M), -np.inf, np.inf)
        assert holds.findings == (), (log.path, rate_hz, feet)
        if feet >= 10.0:
            assert any("static_blocked could hide" in sentence for sentence in holds.missing())


def test_a_healthy_flight_has_no_hold_in_coarse_airspeeds(logs: list[FlightLog]) -> None:
    """Without mach, which would tell the airspeed more finely."""
    trials = [(log, rate_hz, step) for log in logs for rate_hz in RATES_HZ for step in AIRSPEED_STEPS]
    for log, rate_hz, step in trials if FULL else trials[::13]:
        made = coarse(log, rate_hz, FOOT_M)
        rounded = {
            name: replace(
                one, values=frozen_array(np.round(one.values / step) * step if name in SPEEDS else one.values)
            )
            for name, one in made.channels.items()
            if name != "mach"
        }
        found = find_holds(replace(made, channels=rounded), -np.inf, np.inf).findings
        assert found == (), (log.path, rate_hz, step)


def test_coarse_steps_of_altitude_break_no_static_relation(logs: list[FlightLog]) -> None:
    for log in logs:
        for rate_hz, feet in ((10.0, 5.0), (10.0, 10.0), (5.0, 25.0), (1.0, 25.0)):
            made = coarse(log, rate_hz, feet * FOOT_M)
            series, found, n = relation_series(made), 0, 0
            for from_s, to_s in airborne_stretches(made):
                for start_s in np.arange(from_s, to_s - 240.0, 60.0 if FULL else 180.0):
                    found, n = found + len(find_static(made, start_s, start_s + 240.0, series=series).findings), n + 1
            print(f"{rate_hz:g} Hz, {feet:g} ft: {found} of {n} windows")
            assert found <= 0.02 * n


@pytest.mark.parametrize(("shape", "step_m", "bar"), [("static_blocked", FOOT_M, 0.8), ("pitot_blocked", 1.0, 0.7)])
def test_a_blocked_line_is_named_in_what_steps_allow(
    logs: list[FlightLog], shape: str, step_m: float, bar: float
) -> None:
    named, others, n = 0, 0, 0
    for log in logs:
        for after_s in np.arange(700.0, 4000.0, 300.0 if FULL else 900.0):
            onset_s = float(log.time_s[0]) + float(after_s)
            faulty = inject(log, [Fault(shape=shape, onset_s=onset_s, offset_s=onset_s + 120.0)])
            found = find_holds(coarse(faulty, 10.0, step_m), -np.inf, np.inf).findings
            right = [one for one in found if one.fault == shape and abs(one.onset_s - onset_s) <= 15.0]
            named, others, n = named + bool(right), others + len(found) - len(right), n + 1
    print(f"{shape}, steps of {step_m:g} m: {named} of {n} named, {others} others")
    assert named >= bar * n
    assert others <= 0.1 * n


def test_a_static_line_that_leaks_is_named_with_its_time_constant(logs: list[FlightLog]) -> None:
    rng, off, away, n = np.random.default_rng(5), list[float](), list[float](), 0
    for log in logs:
        for _ in range(40 if FULL else 5):
            leak = Fault(
                shape="static_leak",
                onset_s=float(log.time_s[0]) + rng.uniform(700.0, 3900.0),
                time_constant_s=float(rng.choice(TIME_CONSTANTS_S)),
                cabin_altitude_m=CABINS_M[rng.integers(len(CABINS_M))],
            )
            found, n = find_holds(inject(log, [leak]), -np.inf, np.inf).findings, n + 1
            if [one.fault for one in found] != ["static_leak"]:
                print(leak, [(one.fault, one.onset_s) for one in found])
                continue
            off.append(found[0].evidence["time_constant_s"] / (leak.time_constant_s or np.nan) - 1.0)
            away.append(found[0].onset_s - leak.onset_s)
    errors, late = np.abs(off), np.abs(away)
    print(
        f"static leaks: {len(errors)} of {n} named alone, time constant off by {np.median(errors):.1%} (at most "
        f"{errors.max():.1%}), onset by {np.median(late):.2f} s (at most {late.max():.2f} s)"
    )
    assert len(errors) >= 0.9 * n
    assert np.median(errors) <= 0.08
    assert errors.max() <= 0.25
    assert late.max() <= 1.0
