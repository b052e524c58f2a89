"""Steps, lags and ramps of a pitot line on recorded flights: does physics exclude one that is there?

A few windows run; BFI_FULL=1 takes 200.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above
from tolerance_trials import FLIGHTS
from window_trials import LENGTH_S, flight_log, starts_s

from bfi_cli.config import Config, merge
from bfi_cli.decision import STEPS
from bfi_cli.faults.shapes import SHAPES
from bfi_cli.flight.evidence import physics_evidence
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.preprocessing.defaults import tolerance_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

WINDOWS = 200 if FULL else 12
AIRSPEEDS = ("tas", "cas", "ias", "mach")


def with_line_fault(log: FlightLog, share: np.ndarray) -> FlightLog:
    """Return a log whose airspeeds have lost a share of themselves, (n_samples,), as by their pitot line."""
    lost = {name: log.channel(name) for name in AIRSPEEDS if name in log.channels}
    channels = {
        name: replace(channel, values=frozen_array(channel.values * (1.0 - share))) for name, channel in lost.items()
    }
    return replace(log, channels={**log.channels, **channels})


def test_a_step_that_is_there_is_seldom_excluded(flights: Path) -> None:
    wrong, bounded, declared = list[int](), 0, 0
    for number in range(WINDOWS):
        rng = np.random.default_rng([38, 10, number])
        name = FLIGHTS[number % len(FLIGHTS)]
        log, from_s = flight_log(name), float(rng.choice(starts_s(name)))
        window = log.window(from_s, from_s + LENGTH_S)
        shape = str(rng.choice(STEPS))
        seconds = float(rng.uniform(1.0, max(SHAPES[shape].claimed_s, default=1.0)))
        onset_s = from_s + float(rng.uniform(12.0, LENGTH_S - 5.0))
        course, to_s = SHAPES[shape].course, from_s + LENGTH_S
        assert course is not None
        # No fault lasts beyond the window, and the flight after it counts for the angle of zero lift.
        unit = np.where(log.time_s < to_s, course(log.time_s - onset_s, seconds), 0.0)
        error = tolerance_of(log, window, "tas") * float(rng.uniform(0.3, 1.5)) * float(rng.choice([-1.0, 1.0]))
        largest = float(course(np.array([to_s - onset_s]), seconds)[0])
        share = error * unit / largest / float(np.nanmedian(window.channel("tas").values))
        limits = {"window.from_s": from_s, "window.to_s": to_s, "outputs": ("tas",)}
        evidence = physics_evidence(with_line_fault(log, share), merge(Config(), limits))
        declared += bool(evidence.faults)
        for bound in evidence.bounds if not evidence.faults else ():
            hidden, _ = bound.over(((onset_s, onset_s),), None)
            bounded += np.isfinite(hidden)
            wrong += [number] if hidden < abs(error) else []
    print(f"of {WINDOWS} {declared} declared, {bounded} bounded, {len(wrong)} wrongly excluded: {wrong}")
    assert not_above(len(wrong) / max(bounded, 1), 0.05, max(bounded, 1))
