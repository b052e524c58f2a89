"""Two airspeed sensors on recorded flights, one of which fails: and which of them the static relations name.

The second sensor is the recorded one with an offset, noise and quantisation of its own. A fault counts that makes an
error of at least `LEAST` in its window: a sensor that freezes in steady flight makes none. A seeded tenth of the trials
runs; BFI_FULL=1 takes 200.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below
from test_recorded_faults import FLIGHTS, LENGTH_S, windows

from bfi_cli.faults import Fault
from bfi_cli.flight.parity.static_relations import find_static
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.record import frozen_array

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

KINDS = ("bias", "drift", "freeze", "block")
# m/s: the least error of a trial, the second sensor's offset, noise and step (the recorded one's step: 1/16 kt).
LEAST, OFFSET, NOISE, STEP = 1.0, 0.4, 0.05, 1852.0 / 3600.0 / 16.0
# s from the window's start and to its end, between which faults begin.
BEGINS_S = (30.0, 40.0)
TRIALS = 200 if FULL else 20


def two_sensors(log: FlightLog, tas: list[np.ndarray]) -> FlightLog:
    """Return the log with two airspeeds in place of its one."""
    only = log.channels["tas"]
    kept = {name: one for name, one in log.channels.items() if name != "tas"}
    for k, values in enumerate(tas, 1):
        kept[f"tas_{k}"] = replace(only, name=f"tas_{k}", source=f"tas_{k}", values=frozen_array(values))
    return replace(log, channels=kept)


def with_fault(log: FlightLog, kind: str, onset_s: float, end_s: float, rng: np.random.Generator) -> np.ndarray:
    """Return the airspeed of a sensor that fails at a time; what blocks is its own pitot line."""
    healthy = log.channels["tas"].values
    after = (log.time_s >= onset_s) & (log.time_s < end_s)
    if kind == "block":
        blocked = inject(log, [Fault(shape="pitot_blocked", onset_s=onset_s, offset_s=end_s)])
        return np.asarray(blocked.channel("tas").values)
    if kind == "freeze":
        return np.where(after, healthy[np.argmax(after)], healthy)
    sign = rng.choice([-1.0, 1.0])
    size = rng.uniform(1.0, 3.0) if kind == "bias" else rng.uniform(0.03, 0.1) * (log.time_s - onset_s)
    return healthy + sign * after * size


def test_the_faulty_sensor_is_named(flights: Path) -> None:
    rng, counts = np.random.default_rng(22), Counter[str]()
    logs = [read_log(flights / name) for name in FLIGHTS]
    parts = [(log, part) for log in logs for part in windows(log)]
    for trial in range(20 * TRIALS):
        if counts["trials"] == TRIALS:
            break
        log, part = parts[rng.integers(len(parts))]
        start_s = float(part.time_s[0])
        end_s = start_s + LENGTH_S
        onset_s = rng.uniform(start_s + BEGINS_S[0], end_s - BEGINS_S[1])
        cut = log.window(max(start_s - 300.0, 0.0), end_s + 300.0)
        kind, faulty = KINDS[trial % len(KINDS)], int(rng.integers(2))
        healthy = cut.channels["tas"].values
        wrong = with_fault(cut, kind, onset_s, end_s, rng)
        if counts[kind] == TRIALS // len(KINDS) or np.nanmax(np.abs(wrong - healthy)) < LEAST:
            continue

        def sensors(first: np.ndarray, second: np.ndarray, noise: np.ndarray) -> list[np.ndarray]:
            return [first, STEP * np.round((second + OFFSET + noise) / STEP)]

        noise = rng.normal(0.0, NOISE, healthy.size)
        calm = two_sensors(cut, sensors(healthy, healthy, noise))
        first, second = (healthy, wrong) if faulty else (wrong, healthy)
        given = two_sensors(cut, sensors(first, second, noise))
        counts["trials"] += 1
        counts[kind] += 1
        counts["alarms"] += bool(find_static(calm, start_s, end_s).findings)
        findings = find_static(given, start_s, end_s).findings
        right = bool(findings) and findings[0].among == (f"tas_{faulty + 1}",)
        counts[f"{kind} {'named' if right else 'wrong' if findings else 'missed'}"] += 1
    print(dict(sorted(counts.items())))
    assert counts["trials"] == TRIALS
    n = TRIALS // len(KINDS)
    for kind in KINDS:
        assert not_below(counts[f"{kind} named"] / n, 0.97, n)
    assert not_above(sum(counts[f"{kind} wrong"] for kind in KINDS) / TRIALS, 0.03, TRIALS)
    assert not_above(counts["alarms"] / TRIALS, 0.01, TRIALS)
