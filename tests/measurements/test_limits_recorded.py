"""Limits of slow faults on recorded flights: what was not watched is named, and few faults are beyond them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_above, not_below
from test_recorded_faults import FLIGHTS
from trials import sized
from whole_flight_trials import recorder

from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.flight import diagnose_flight
from bfi_cli.flight.evidence import physics_evidence
from bfi_cli.flight.flight import Flight, flight_of
from bfi_cli.flight.limits import bounds_of
from bfi_cli.flight.looks import scan_flight, thresholds_of
from bfi_cli.flight.parity import LENGTHS_S, Hidden
from bfi_cli.flight.parity.record import record_of
from bfi_cli.flight.parity.windows import windows_in
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.injection import inject
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array

pytestmark = pytest.mark.realdata

LOST = ("tas", "cas", "mach", "latitude", "longitude")


def test_a_flight_whose_airspeeds_are_lost_is_no_clean_flight(flights: Path):
    log = read_log(flights / FLIGHTS[1]).window(1000.0, 2800.0)
    inside = (log.time_s >= 1500.0) & (log.time_s < 2500.0)
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
    assert last == pytest.approx(2500.0, abs=2.0)
    assert f"{first:.0f} to {last:.0f} s ({why})" in result.summary


WINDOWS, SIZES = sized(60, 0.2), (1.0, 1.5, 2.0, 3.0, 5.0)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["tas", "aoa", "pitot_icing"])
def test_of_faults_through_the_recorder_5_percent_are_beyond_the_limit_of_a_window_at_most(flights: Path, shape: str):
    """Of either sign, at a random onset of random windows, of so many times what the noise of the window allows."""
    wrong, rng = {size: list[bool]() for size in SIZES}, np.random.default_rng(1)
    record = recorder(flights.parent / "tools" / "recorder.py").record
    for name in FLIGHTS:
        log = read_log(flights / name)
        flight = flight_of(log, Config())
        every = [window for length_s in LENGTHS_S for window in flight.windows(length_s)]
        for i in rng.permutation(len(every))[: WINDOWS // 2]:
            window, part = every[i], log.window(*every[i])
            hidden, stands_out = hidden_in(flight, window, shape)
            if hidden is None or stands_out:
                continue
            k = int(rng.integers(len(hidden.onsets_s)))
            onset_s = float(hidden.onsets_s[k])
            for size in SIZES:
                slope = size * float(hidden.spreads[k]) * (1.0 if shape == "pitot_icing" else rng.choice([-1.0, 1.0]))
                if shape == "pitot_icing":
                    faulty = inject(part, [Fault(shape=shape, magnitude=slope, onset_s=onset_s)])
                else:
                    error = record(slope * np.maximum(part.time_s - onset_s, 0.0), part.rate_hz)
                    wrong_one = replace(part.channels[shape], values=part.channels[shape].values + error)
                    faulty = replace(part, channels={**part.channels, shape: wrong_one})
                shown, declared = hidden_in(replace(flight, record=record_of(faulty)), window, shape)
                wrong[size].append(shown is not None and not declared and shown.sizes[k] < abs(slope))
    for size, own in wrong.items():
        print(f"{shape} of {size:g} times the noise: {np.mean(own):.1%} of {len(own)} excluded")
    pooled = [one for own in wrong.values() for one in own]
    assert not_above(float(np.mean(pooled)), 0.05, len(pooled) // len(SIZES))


def hidden_in(flight: Flight, window: tuple[float, float], fault: str) -> tuple[Hidden | None, bool]:
    """Return what a window leaves unseen of a fault, and whether it stands out, so that it excludes nothing."""
    rates = dict.fromkeys(LENGTHS_S, 0.01)
    scanned = scan_flight(flight, [window], thresholds_of(flight.tables, rates, rates, 1.0))
    found = [windows[0] for windows in bounds_of(flight, scanned, (), ()) if windows[0].fault == fault]
    return (found[0] if found else None), any(one.statistic > one.threshold for one in scanned)


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_of_windows_of_four_minutes_physics_leaves_two_and_a_half_tolerances_in_most(flights: Path, name: str):
    """Of an airspeed and of the vane, without a fault: the largest error that may hide at the window's end."""
    log, left = read_log(flights / name), {"tas": list[float](), "cas": list[float](), "aoa": list[float]()}
    declared = 0
    for from_s, to_s in windows_in(phases_of(log), 240.0, step_s=240.0 if FULL else 960.0):
        values = {"window": {"from_s": from_s, "to_s": to_s}, "outputs": tuple(left)}
        found = physics_evidence(log, Config.model_validate(values))
        declared += bool(found.faults)
        for channel, shares in left.items():
            one = next((one for one in found.candidates if one.channel == channel and one.effect is not None), None)
            shares.append(np.inf if one is None else one.effect / one.tolerance)
    for channel, shares in left.items():
        low, middle, most, high = np.quantile(shares, (0.2, 0.5, 0.8, 0.95), method="inverted_cdf")
        print(f"{name}, {channel}: {low:.2f}, {middle:.2f}, {most:.2f}, {high:.2f} of the tolerance", end=" ")
        print(f"in 20, 50, 80 and 95 % of {len(shares)} windows")
        assert not_below(float(np.mean(np.array(shares) <= 2.5)), 0.6, len(shares))
    assert not_above(declared / len(shares), 0.01, len(shares))
