"""Short windows with earlier records of the same aircraft and without: intervals, power, alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bars import not_above, not_below
from threadpoolctl import threadpool_limits
from trials import sized
from window_trials import CITATION, FLIGHTS, flight_log, starts_s

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.quality import recorder_filters
from bfi_cli.model.identify import identify_faults
from bfi_cli.model.preprocessing.window import with_inputs_of
from bfi_cli.model.result import IdentifyResult
from bfi_cli.model.shared_model import with_those_that_share

pytestmark = pytest.mark.slow

TRIALS = sized(100, share=0.06)


def drift_at(onset_s: float):
    return load_dictionary({"channel": "tas", "atoms": [{"name": "drift", "shape": "drift", "onset_s": onset_s}]})


def flown(seed: int) -> FlightLog:
    time_s, rng = time_axis(duration_s=31.72, rate_hz=100.0), np.random.default_rng(seed)
    return simulate(find_model("citation"), manoeuvre("3211", time_s), rng=rng, rate_hz=100.0, noise_sd={"tas": 0.02})


def answers(log: FlightLog, onset_s: float, config: Config) -> tuple[IdentifyResult, IdentifyResult, bool]:
    """Return what is said without the earlier records and with them, and whether they count."""
    dictionary = drift_at(onset_s)
    with threadpool_limits(1):
        alone = identify_faults(replace(log, earlier=()), dictionary, config)
        shared, _ = with_those_that_share(log, dictionary, config)
        return alone, identify_faults(shared, dictionary, config), bool(shared.earlier)


def counted(label: str, results: list[tuple[IdentifyResult, float]]) -> tuple[float, float, float]:
    """Print and return the shares of faults told, of intervals that cover, and of healthy windows with a fault."""
    told = [one.faults[0].ci95 for one, size in results if size and one.faults]
    faulty = sum(bool(size) for _, size in results)
    covers = [low <= size <= high for one, size in results if size and one.faults for low, high in [one.faults[0].ci95]]
    alarms = [bool(one.faults) for one, size in results if not size]
    width = float(np.median([high - low for low, high in told])) if told else np.nan
    share = len(told) / faulty, float(np.mean(covers)) if covers else np.nan, float(np.mean(alarms))
    print(
        f"\n{label}: told {share[0]:.0%} of {faulty}, covered {share[1]:.0%}, median width {width:.3g}, alarms "
        f"{share[2]:.0%} of {len(alarms)}"
    )
    return share


def test_ten_seconds_of_a_simulated_flight_with_three_earlier_ones():
    config = merge(Config(), {"onset_tolerance_s": 0.0, "window.from_s": 5.0, "window.to_s": 15.0})
    alone, together, shares = [], [], []
    for seed in range(TRIALS):
        for size in (0.3, 0.0):
            log = flown(1000 + seed)
            log = inject(log, [Fault(shape="drift", channel="tas", onset_s=10.0, magnitude=size)]) if size else log
            log = replace(log, earlier=tuple(flown(5000 + 3 * seed + k) for k in range(3)))
            without, beside, shared = answers(log, 10.0, config)
            alone.append((without, size))
            together.append((beside, size))
            shares.append(shared)
    print(f"\nthe models are one in {np.mean(shares):.0%}")
    counted("alone", alone)
    told, covered, alarms = counted("together", together)
    assert not_below(float(np.mean(shares)), 0.95, len(shares))
    assert not_below(told, 0.9, TRIALS)
    assert not_below(covered, 0.93, TRIALS)
    assert alarms <= 0.02


@pytest.mark.realdata
@pytest.mark.skipif(not FLIGHTS.is_dir(), reason="needs the recorded flights")
def test_windows_of_recorded_flights_with_the_two_minutes_before():
    alone, together, shares = [], [], []
    for number in range(TRIALS):
        rng = np.random.default_rng([77, number])
        name = CITATION[number % 2]
        log, start = flight_log(name), float(rng.choice(starts_s(name)))
        config = merge(
            Config(),
            {
                "inputs": ("auto",),
                "onset_tolerance_s": 0.0,
                "window.from_s": start + 60.0,
                "window.to_s": start + 120.0,
            },
        )
        config, before = with_inputs_of(log, config), log.window(start - 60.0, start + 60.0)
        for size in (0.5, 0.0):
            faulty = log
            if size:
                fault = Fault(shape="drift", channel="tas", onset_s=start + 80.0, magnitude=size)
                faulty = inject(log, [fault], response=response_of(recorder_filters(log)[0], log.rate_hz))
            without, beside, shared = answers(replace(faulty, earlier=(before,)), start + 80.0, config)
            alone.append((without, size))
            together.append((beside, size))
            shares.append(shared)
    print(f"\nthe models are one in {np.mean(shares):.0%}")
    _, _, before = counted("recorded, alone", alone)
    _, covered, alarms = counted("recorded, with the two minutes before", together)
    assert not_above(alarms, max(before, 0.05), TRIALS)
    assert not_below(covered, 0.85, TRIALS)
