"""Short defects of the true airspeed on two recorded flights: how many are named, and how many findings are false.

Each trial has one kind of defect at random moments of a whole flight, through the recorder's low-pass and not: five
dropouts to zero of 1 to 3 s, one freeze of 5 s, or eight spikes of 10 to 40 m/s over one to three samples. The levels
were set on these flights (docs/theory.md, 15.7.1), so that the false findings are in-sample; the moments are not.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bars import FULL
from trials import sized

from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flight.parity.frozen import frozen_sensors
from bfi_cli.flight.parity.record import record_of
from bfi_cli.flight.parity.windows import flight_stretches
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.defects import Defect, find_defects, with_bridges, without_defects
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.quality import with_seen_recorder
from bfi_cli.flightlog.record import frozen_array

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
PLACEMENTS = 12
SHAPES = {"dropout": 5, "frozen": 1, "spikes": 8}
# Of 24 trials a kind, at a share of 95 % named, 21 and more are in 97 % of all draws. Of freezes, which calm air hides,
# 43 of 48 were named when the levels were set; at that share 18 and more of 24 are in 98 % of all draws.
LEAST_NAMED = {"dropout": 21 / 24, "frozen": 18 / 24, "spikes": 21 / 24}
MOST_FALSE_PER_HOUR = 0.3
# Errors that last, by shape with the key of their time; and the length of what is cut from a flight, s.
STEPS, CUT_S = {"bias": "", "lagged_bias": "time_constant_s", "ramp_hold": "duration_s"}, 600.0


def spoilt(log: FlightLog, shape: str, rng: np.random.Generator) -> np.ndarray:
    """Return the error (n,) of the airspeed, as the sensor makes it, in flight."""
    flown = [one for one in phases_of(log) if one.phase in ("climb", "cruise", "descent")]
    allowed = np.zeros(log.n_samples, dtype=bool)
    for one in flown:
        allowed |= (log.time_s >= one.from_s + 10.0) & (log.time_s < one.to_s - 20.0)
    x, error = log.channels["tas"].values, np.zeros(log.n_samples)
    for k in rng.choice(np.flatnonzero(allowed), SHAPES[shape], replace=False):
        if shape == "dropout":
            part = slice(k, k + round(rng.uniform(1.0, 3.0) * log.rate_hz))
            error[part] = -x[part]
        elif shape == "frozen":
            part = slice(k, k + round(5.0 * log.rate_hz))
            error[part] = x[k] - x[part]
        else:
            error[k : k + rng.integers(1, 4)] = rng.uniform(10.0, 40.0) * rng.choice([-1.0, 1.0])
    return error


def found_in(log: FlightLog, shape: str, rng: np.random.Generator, *, recorded: bool) -> tuple[Defect, ...]:
    error = spoilt(log, shape, rng)
    if recorded:
        response = response_of(log.filters or (), log.rate_hz)
        error = response.filtered(np.pad(error, (response.after, response.before), mode="edge"))
    tas = replace(log.channels["tas"], values=frozen_array(log.channels["tas"].values + error))
    return find_defects(replace(log, channels={**log.channels, "tas": tas}))


@pytest.fixture(scope="module")
def logs(flights: Path) -> list[FlightLog]:
    return [read_log(str(flights / name)) for name in FLIGHTS]


def test_untouched_flights_have_none(logs: list[FlightLog]):
    assert [find_defects(log) for log in logs] == [(), ()]


def test_untouched_parts_and_few_channels_have_none(logs: list[FlightLog]):
    rng = np.random.default_rng(11)
    for log in logs:
        for _ in range(sized(24, 1 / 6)):
            length_s = rng.choice([120.0, 300.0, 900.0])
            from_s = rng.uniform(log.time_s[0], log.time_s[-1] - length_s)
            assert find_defects(log.window(from_s, from_s + length_s)) == ()
        for names in (("tas",), ("tas", "altitude"), ("cas", "altitude", "tat"), ("tas", "cas", "pitch", "normal_acc")):
            assert find_defects(replace(log, channels={name: log.channels[name] for name in names})) == ()


@pytest.mark.parametrize("name", ["reader_samples/g1000_c172.csv", "sim_ae4320_de3211_1.h5", "px4_flight3"])
def test_logs_of_others_have_none(flights: Path, name: str):
    assert find_defects(read_log(str(flights / name))) == ()


@pytest.mark.parametrize("recorded", [True, False] if FULL else [True])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_short_defects_are_named(logs: list[FlightLog], shape: str, recorded: bool):
    rng = np.random.default_rng([len(shape), recorded])
    trials, named, false, counted, hours = 0, 0, 0, 0, 0.0
    for log in logs:
        for _ in range(sized(PLACEMENTS, 1 / 6)):
            found = found_in(log, shape, rng, recorded=recorded)
            right = [one for one in found if (one.channel, one.shape) == ("tas", shape)]
            trials, named, false = trials + 1, named + bool(right), false + len(found) - len(right)
            counted += sum(one.count for one in right)
            hours += (log.time_s[-1] - log.time_s[0]) / 3600.0
    print(
        f"{shape}, recorded {recorded}: named {named}/{trials}, {counted}/{trials * SHAPES[shape]} of the single ones"
    )
    print(f"false findings {false} in {hours:.1f} h")
    assert named >= np.floor(LEAST_NAMED[shape] * trials)
    assert false <= max(1.0, MOST_FALSE_PER_HOUR * hours)


def test_an_airspeed_that_steps_does_not_stay_still(flights: Path):
    """Errors of 4 to 15 m/s in cuts of 600 s, of a flight with two airspeeds from the recorder: none freezes beside."""
    rng, alarms, n = np.random.default_rng(7), [], 0
    names = [path.name for path in sorted(flights.glob("*.h5")) if path.name.startswith(("citation", "sr22t"))]
    for name in names:
        log = read_log(flights / name)
        stretches = [stretch for stretch in flight_stretches(phases_of(log)) if stretch[1] - stretch[0] > CUT_S]
        for k in range(sized(12, 1 / 4)):
            first_s, last_s = stretches[int(rng.integers(len(stretches)))]
            from_s = rng.uniform(first_s, last_s - CUT_S)
            shape = tuple(STEPS)[k % len(STEPS)]
            keys = {STEPS[shape]: float(rng.uniform(2.0, 30.0))} if STEPS[shape] else {}
            fault = Fault(
                shape=shape,
                channel="tas",
                magnitude=rng.uniform(4.0, 15.0) * rng.choice([-1.0, 1.0]),
                onset_s=from_s + rng.uniform(120.0, 450.0),
                **keys,
            )
            cut = with_seen_recorder(inject(log.window(from_s, from_s + CUT_S), [fault]))
            defects = find_defects(cut)
            left = without_defects(cut, defects)
            resting = frozen_sensors(left, record_of(left), phases_of(with_bridges(cut, defects)))
            n += 1
            alarms += [(name, fault)] if resting or any(defect.shape == "frozen" for defect in defects) else []
    print(f"\n{len(alarms)} of {n} stay still beside their error")
    assert alarms == []
