"""Limits of slow faults on recorded flights: what was not watched is named, and what is above a limit stands out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import not_below
from test_recorded_faults import FLIGHTS

from bfi_cli.config import Config
from bfi_cli.diagnose import diagnose_flight
from bfi_cli.diagnose.flight import flight_of
from bfi_cli.diagnose.limits import bounds_of
from bfi_cli.diagnose.looks import look_at, scan_flight
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.parity import LENGTHS_S, scan_window
from bfi_cli.parity.scan import with_lasting

pytestmark = pytest.mark.realdata

LOST = ("tas", "cas", "mach", "latitude", "longitude")


def test_a_flight_whose_airspeeds_are_lost_is_no_clean_flight(flights: Path):
    log = read_log(flights / FLIGHTS[1])
    inside = (log.time_s >= 1500.0) & (log.time_s < 4000.0)
    channels = {
        name: replace(one, values=frozen_array(np.where(inside & (name in LOST), np.nan, one.values)))
        for name, one in log.channels.items()
        if name != "elevator"
    }
    config = Config.model_validate({"require": ["slow"], "tolerances": {"tas": 15.0, "cas": 15.0, "mach": 0.1}})
    result = diagnose_flight(replace(log, channels=channels), config)
    assert (result.decision, result.verdicts["slow"]) == ("inconclusive", "inconclusive")
    first, last, why = max(result.unwatched, key=lambda one: one[1] - one[0])
    assert why == "no airspeed is recorded, or none that is right"
    assert first < 1500.0
    assert last == pytest.approx(4000.0, abs=2.0)
    assert f"{first:.0f} to {last:.0f} s ({why})" in result.summary


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_drift_a_hundredth_above_its_limit_stands_out(flights: Path, name: str):
    """At a random onset of random windows of which each is the only one."""
    flight, rng = flight_of(read_log(flights / name), Config()), np.random.default_rng(1)
    shown = []
    for length_s in (60.0, 120.0, 240.0):
        windows = flight.windows(length_s)
        for i in rng.permutation(len(windows))[:25]:
            rates = dict.fromkeys(LENGTHS_S, 0.01)
            looks = list(
                look_at(scan_flight(flight, [windows[i]]), flight.tables, rates=rates, suspicions=rates, scale=1.0)
            )
            part = flight.record.between(*windows[i])
            for one in bounds_of(flight, looks, (), ()):
                if one.fault not in ("tas", "cas", "pitot_icing"):
                    continue
                (hidden,) = one.windows
                known = np.flatnonzero(np.isfinite(hidden.sizes))
                if not known.size:
                    continue
                k = rng.choice(known)
                slope = 1.01 * rng.choice([-1.0, 1.0]) * hidden.sizes[k]
                fault = "q_impact" if one.fault == "pitot_icing" else one.fault
                faulty = with_lasting(part, fault, slope * np.maximum(part.time_s - hidden.onsets_s[k], 0.0))
                scan = scan_window(faulty, zero_lift=flight.zero_lift, only=looks[0][0].residuals)
                shown.append(scan is not None and scan.statistic > looks[0][1].level)
    print(f"\n{name}: {sum(shown)} of {len(shown)}")
    assert not_below(sum(shown) / len(shown), 0.95, len(shown))
