"""Faults that err by 1.2 tolerances, from any time of windows of recorded flights on: how often start-time sees none.

Every trial is drawn from its own number: python tests/measurements/tolerance_trials.py --first 0 --last 500
--results FILE runs those that the file does not hold yet and prints the counts of all that it holds.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numbered import Row, run_numbered
from window_trials import ALIKE, CITATION, KINDS, LENGTH_S, flight_log, posed, starts_s

from bfi_cli.analysis import start_time
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.model.onset.claims import CYCLES_LEFT
from bfi_cli.model.onset.scan_record import FASTEST
from bfi_cli.model.preprocessing.defaults import tolerance_of

ABOVE = 1.2
FLIGHTS = (
    *CITATION,
    "citation_20170308_084248.h5",
    "citation_20190305_v4.h5",
    "g1000_c172_110812.h5",
    "gnxi_pa28_240720.h5",
    "sr22t_210623_141501.h5",
    "sr22t_220417_125002.h5",
    "sr22t_220417_135002.h5",
    "sr22t_220825_142831.h5",
)


def drawn(number: int) -> Row:
    """Return a window, and a fault whose largest error in it is 1.2 tolerances of the true airspeed.

    An oscillation has any phase, two cycles left, and a frequency that a log of its rate shows.
    """
    rng = np.random.default_rng([38, 12, number])
    flight = FLIGHTS[number % len(FLIGHTS)]
    log, from_s = flight_log(flight), float(rng.choice(starts_s(flight)))
    window = log.window(from_s, from_s + LENGTH_S)
    shape = str(rng.choice(list(KINDS)))
    keys: dict[str, Any] = {key: float(rng.uniform(*span)) for key, span in KINDS[shape].items()}
    last_s = LENGTH_S
    if shape == "sine":
        low_hz, high_hz = KINDS[shape]["frequency_hz"]
        keys["frequency_hz"] = float(rng.uniform(low_hz, min(high_hz, FASTEST * log.rate_hz)))
        keys["phase_rad"] = float(rng.uniform(-np.pi, np.pi))
        last_s -= CYCLES_LEFT / keys["frequency_hz"]
    onset_s = min(from_s + float(rng.uniform(0.0, last_s)), float(window.time_s[-1]))
    unit = Fault(shape=shape, channel="tas", magnitude=1.0, onset_s=onset_s, **keys)
    largest = float(np.abs(unit_signal(unit, window.time_s, window_start_s=from_s)).max())
    error = ABOVE * tolerance_of(log, window, "tas") * float(rng.choice([-1.0, 1.0]))
    keys |= {"onset_s": onset_s, "magnitude": error / largest if largest else 0.0}
    return {"number": number, "flight": flight, "from_s": from_s, "kind": shape, **keys}


def trial(number: int) -> Row:
    """Return what start-time says of a window with a fault."""
    row = drawn(number)
    answer = start_time(*posed(row))
    covered_s = answer.covered_s
    return row | {
        "verdict": answer.verdicts[ALIKE[row["kind"]]],
        "decision": answer.decision,
        "is_claimed": covered_s is not None and covered_s[0] <= row["onset_s"] <= covered_s[1],
        "faults": [(estimate.fault.shape, estimate.fault.onset_s, estimate.magnitude) for estimate in answer.faults],
    }


def wrong_of(rows: list[Row]) -> list[Row]:
    """Return the windows of which it is said that there is no fault of the kind that is there."""
    return [row for row in rows if row["is_claimed"] and row["verdict"] == "no_fault"]


def report(rows: list[Row]) -> None:
    """Print the counts, and each window in which no fault of its kind is said to be."""
    for flights in (FLIGHTS[:4], FLIGHTS[4:]):
        for shape in KINDS:
            alike = [row for row in rows if row["kind"] == shape and row["flight"] in flights]
            claimed = [row for row in alike if row["is_claimed"]]
            verdicts = dict(Counter(row["verdict"] for row in claimed))
            print(f"{flights[0]} ...: {shape}: {len(alike)}, {len(claimed)} begin where claims hold: {verdicts}")
    decisions = sum(row["is_claimed"] and row["decision"] == "no_fault" for row in rows)
    early = [row for row in rows if not row["is_claimed"] and row["verdict"] == "no_fault"]
    print(f"no fault of any kind in {decisions} of {len(rows)}; of the kind that is there in {len(wrong_of(rows))},")
    print(f"  and in {len(early)} more that begin before or after what the claim names")
    print(*wrong_of(rows), sep="\n")


if __name__ == "__main__":
    run_numbered(trial, report)
