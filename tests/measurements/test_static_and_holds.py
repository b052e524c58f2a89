"""Static relations and holds on recorded flights: what is named right, and false alarms.

Nothing is learnt from another flight: limits come from the steps and the noise of the log itself. A few windows run;
BFI_FULL=1 takes every one.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below
from pressure_records import recorded_anew
from test_recorded_faults import FLIGHTS, LENGTH_S, windows

from bfi_cli.faults import Fault
from bfi_cli.flight.parity.holds import find_holds
from bfi_cli.flight.parity.lines import lines_of
from bfi_cli.flight.parity.relation_series import relation_series
from bfi_cli.flight.parity.static_relations import find_static
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.model.preprocessing.defaults import tolerance_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

# Left after the onset at least, s. A fault ends after the window, so that the rest of the log is a flight.
TAIL_S = {"pitot_blocked": 30.0, "static_blocked": 40.0, "pitot_leak": 30.0}
AFTER_S = 5.0
LINES = [("pitot_blocked", None, 0.95), ("static_blocked", None, 0.93), ("pitot_leak", 2.0, 0.97)]
LINES += [("pitot_leak", 10.0, 0.97)]
# Channel, size and the share that is named alone or in a set.
ERRORS = [("tas", 0.1, 0.97), ("tas", -0.1, 0.97), ("tas", 0.05, 0.0), ("tat", 1.0, 0.9), ("mach", 3e-4, 0.9)]
ERRORS += [("cas", 0.3, 0.9), ("altitude", 50.0, 0.8), ("sat", 1.0, 0.9)]


@pytest.fixture(scope="module")
def logs(flights: Path) -> tuple[FlightLog, FlightLog]:
    first, second = (read_log(flights / name) for name in FLIGHTS)
    return first, second


@pytest.mark.parametrize(("shape", "time_constant_s", "bar"), LINES)
@pytest.mark.parametrize("how", ["by differences", "recorded anew"])
def test_lines_that_hold_are_named(
    logs: tuple[FlightLog, FlightLog], shape: str, time_constant_s: float | None, bar: float, how: str
) -> None:
    rng, counts, errors, covered = np.random.default_rng(0), Counter[str](), [], 0
    for log in logs:
        for part in windows(log):
            start_s = float(part.time_s[0])
            onset_s = start_s + rng.uniform(0.25 * LENGTH_S, LENGTH_S - TAIL_S[shape])
            fault = Fault(
                shape=shape, onset_s=onset_s, offset_s=start_s + LENGTH_S + AFTER_S, time_constant_s=time_constant_s
            )
            faulty = (
                inject(log, [fault]) if how == "by differences" else recorded_anew(log, fault, noise_pa=2.0, rng=rng)
            )
            found = find_holds(faulty, start_s, start_s + LENGTH_S).findings
            counts[", ".join(one.fault for one in found) or "none"] += 1
            if [one.fault for one in found] == [shape]:
                errors.append(abs(found[0].onset_s - onset_s))
                covered += found[0].onset_ci95[0] <= onset_s <= found[0].onset_ci95[1]
    n = counts.total()
    late = np.quantile(errors, [0.5, 0.9]).round(2).tolist()
    print(f"{shape} {time_constant_s or ''} {how}: {dict(counts)} of {n}, onset {late} s off, {covered} covered")
    assert not_below(counts[shape] / n, bar, n)
    assert not_below(covered / len(errors), 0.90, len(errors))


@pytest.mark.parametrize(("channel", "size", "bar"), ERRORS)
def test_channels_that_err_are_named(logs: tuple[FlightLog, FlightLog], channel: str, size: float, bar: float) -> None:
    rng, counts, onsets, off = np.random.default_rng(1), Counter[str](), [], []
    for log in logs:
        for part in windows(log):
            start_s = float(part.time_s[0])
            onset_s = start_s + rng.uniform(0.3, 0.7) * LENGTH_S
            end_s = start_s + LENGTH_S + AFTER_S
            faulty = inject(
                log, [Fault(shape="bias", channel=channel, magnitude=size, onset_s=onset_s, offset_s=end_s)]
            )
            found = find_static(faulty, start_s, start_s + LENGTH_S).findings
            among = found[0].among if found else ()
            counts["alone" if among == (channel,) else "in a set" if channel in among else str(among)] += 1
            if channel in among:
                onsets.append(abs(found[0].onset_s - onset_s))
                if found[0].fault == channel and found[0].shape == "bias":
                    off.append(abs((found[0].magnitude or 0.0) / size - 1.0))
    n = counts.total()
    print(f"{channel} {size:+g}: {dict(counts)} of {n}, onset {np.median(onsets):.2f} s off")
    if off:
        print(f"size {np.median(off):.0%} off")
    named = counts["alone"] + counts["in a set"]
    assert not_below(named / n, bar, n)
    if channel in ("tas", "tat", "sat") and bar:
        assert not_below(counts["alone"] / n, bar, n)
    assert not_above((n - named - counts["()"]) / n, 0.01, n, worse=0.06)


@pytest.mark.parametrize("known", ["the whole log", "the window"])
def test_healthy_windows_raise_no_alarm(logs: tuple[FlightLog, FlightLog], known: str) -> None:
    """The bar is 1 % of both together, where the whole log tells its steps and its noise."""
    counts: Counter[str] = Counter()
    step_s, most = 10 if FULL else 120, 0.01 if known == "the whole log" else 0.03
    for log in logs:
        series, lines = relation_series(log), lines_of(log)
        for part in windows(log, step_s):
            start_s = float(part.time_s[0])
            if known == "the window":
                relations = find_static(part, start_s, start_s + LENGTH_S)
                holds = find_holds(part, start_s, start_s + LENGTH_S)
            else:
                relations = find_static(log, start_s, start_s + LENGTH_S, series=series)
                holds = find_holds(log, start_s, start_s + LENGTH_S, lines=lines)
            counts["windows"] += 1
            counts.update(f"static relations: {one.among}" for one in relations.findings)
            counts.update(f"holds: {one.fault}" for one in holds.findings)
    print(known, dict(counts))
    n = counts.pop("windows")
    # Windows side by side are trials of their own; of the full set there is nothing to allow for.
    assert not_above(counts.total() / n, most, round(n * step_s / LENGTH_S))
    assert not FULL or counts.total() <= most * n


def test_a_whole_flight_has_no_false_event(logs: tuple[FlightLog, FlightLog]) -> None:
    """From the first to the last sample, the parabola, take-off and landing with it."""
    hours, events = 0.0, []
    for log in logs:
        series, ends = relation_series(log), (float(log.time_s[0]), float(log.time_s[-1]) + 1.0)
        holds = find_holds(log, *ends)
        events += [(one.fault, round(one.onset_s)) for one in holds.findings]
        print(holds.untold)
        for start_s, end_s in airborne_stretches(log):
            hours += (end_s - start_s) / 3600.0
            for from_s in np.arange(start_s, end_s - LENGTH_S, 30.0 if FULL else 120.0):
                part, found = (
                    log.window(from_s, from_s + LENGTH_S),
                    find_static(log, from_s, from_s + LENGTH_S, series=series),
                )
                events += [
                    (one.among, round(one.onset_s), size)
                    for one in found.findings
                    for name, size in one.effect.items()
                    # What is small is no fault of the flight: 0.14 m/s of cas in the parabola.
                    if abs(size) > tolerance_of(log, part, name)
                ]
    print(f"{hours:.1f} h, events {events}")
    assert len(events) <= 0.3 * hours  # none in the 2.3 hours, which shows 1.6 an hour at most


@pytest.mark.parametrize(("shape", "time_constant_s", "_"), LINES)
def test_a_line_that_errs_breaks_no_static_relation(
    logs: tuple[FlightLog, FlightLog], shape: str, time_constant_s: float | None, _: float
) -> None:
    """As long as the aircraft has an airspeed: what follows from a wrong pressure is wrong alike."""
    counts: Counter[str] = Counter()
    for log in logs:
        for part in windows(log):
            start_s = float(part.time_s[0])
            end_s = start_s + LENGTH_S + AFTER_S
            fault = Fault(shape=shape, onset_s=start_s + 60.0, offset_s=end_s, time_constant_s=time_constant_s)
            found = find_static(inject(log, [fault]), start_s, start_s + LENGTH_S).findings
            counts[str(found[0].among) if found else "none"] += 1
    print(shape, time_constant_s or "", dict(counts))
    n = counts.total()
    assert not_below(counts["none"] / n, 0.90, n)
