"""Faults of 1 to 10 tolerances in windows of whole recorded flights: do identify and start-time answer, and alike?

Every trial is drawn from its own number: python tests/measurements/window_trials.py --first 0 --last 60 --results FILE
runs those that the file does not hold yet and prints the counts of all that it holds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numbered import run_numbered

from bfi_cli.analysis import identify, start_time
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.quality import recorder_filters
from bfi_cli.model.onset import OnsetResult
from bfi_cli.model.preprocessing.defaults import tolerance_of
from bfi_cli.model.result import IdentifyResult

FLIGHTS = Path(__file__).resolve().parents[3] / "shared" / "flights"
CITATION = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
LENGTH_S = 120.0
STEEPEST_PITCH = np.deg2rad(30.0)
HEALTHY_SHARE = 0.25
KINDS: dict[str, dict[str, tuple[float, float]]] = {
    "bias": {},
    "drift": {},
    "lagged_bias": {"time_constant_s": (1.0, 8.0)},
    "ramp_hold": {"duration_s": (2.0, 10.0)},
    "sine": {"frequency_hz": (0.06, 0.4)},
}
ALIKE = {"bias": "abrupt", "lagged_bias": "abrupt", "ramp_hold": "abrupt", "drift": "slow", "sine": "oscillating"}


@cache
def flight_log(name: str) -> FlightLog:
    """Return a recorded flight."""
    return read_log(FLIGHTS / name)


@cache
def starts_s(name: str) -> tuple[float, ...]:
    """Return where airborne windows without a parabola begin, every 20 s."""
    log = flight_log(name)
    found = []
    for first, last in airborne_stretches(log):
        for start in np.arange(first + 60.0, last - LENGTH_S - 60.0, 20.0):
            part = log.window(float(start), float(start) + LENGTH_S)
            if np.abs(part.channel("pitch").values).max() < STEEPEST_PITCH:
                found.append(float(start))
    return tuple(found)


def drawn(number: int) -> dict[str, Any]:
    """Return a window and the fault that is added to it, None of a kind of "healthy"."""
    rng = np.random.default_rng([20, number])
    flight = CITATION[number % 2]
    log, start = flight_log(flight), float(rng.choice(starts_s(flight)))
    row: dict[str, Any] = {"number": number, "flight": flight, "from_s": start, "kind": "healthy", "share": 0.0}
    if rng.random() > HEALTHY_SHARE:
        shape = str(rng.choice(list(KINDS)))
        onset_s = start + float(rng.uniform(15.0, 100.0))
        share = float(np.exp(rng.uniform(0.0, np.log(10.0)))) * float(rng.choice([-1.0, 1.0]))
        keys = {key: float(rng.uniform(*span)) for key, span in KINDS[shape].items()}
        size = share * tolerance_of(log, log.window(start, start + LENGTH_S), "tas")
        size /= (start + LENGTH_S - onset_s) if shape == "drift" else 1.0
        row |= {"kind": shape, "share": share, "onset_s": onset_s, "magnitude": size, **keys}
    return row


def posed(row: Mapping[str, Any]) -> tuple[FlightLog, Config]:
    """Return the flight of a window with its fault, and the configuration of the analysis."""
    log, start = flight_log(row["flight"]), row["from_s"]
    if (shape := row["kind"]) != "healthy":
        keys = {key: row[key] for key in ("magnitude", "onset_s", *KINDS[shape], "phase_rad") if key in row}
        filters = recorder_filters(log)[0]
        log = inject(log, [Fault(shape=shape, channel="tas", **keys)], response=response_of(filters, log.rate_hz))
    window = {"window.from_s": start, "window.to_s": start + LENGTH_S}
    return log, merge(Config(), {"inputs": ("auto",), **window})


def answers(log: FlightLog, config: Config) -> tuple[IdentifyResult, OnsetResult]:
    """Return what identify and start-time say of a window."""
    return identify(log, load_dictionary("airdata", channel="tas"), config)[0], start_time(log, config)


def trial(number: int) -> dict[str, Any]:
    """Return what both commands say of one window."""
    row = drawn(number)
    for name, answer in zip(("identify", "start-time"), answers(*posed(row)), strict=True):
        row[name] = {
            "decision": answer.decision,
            "verdicts": dict(answer.verdicts),
            "faults": [
                (one.fault.shape, one.fault.onset_s, one.magnitude, *one.ci95, one.beyond_tolerance, one.source)
                for one in answer.faults
            ],
            "slow_limit": max(
                (
                    np.inf if one.effect is None or one.tolerance is None else one.effect / one.tolerance
                    for one in answer.candidates
                    if one.kind == "slow" and one.state in ("excluded", "not_seen")
                ),
                default=None,
            ),
        }
    return row


def report(rows: list[dict[str, Any]]) -> None:
    """Print the counts."""
    faulty = [row for row in rows if row["kind"] != "healthy"]
    healthy = [row for row in rows if row["kind"] == "healthy"]
    same = sum(row["identify"]["decision"] == row["start-time"]["decision"] for row in rows)
    print(f"the same decision: {same} of {len(rows)}")
    for name in ("identify", "start-time"):
        said = Counter(row[name]["decision"] for row in healthy)
        wrong = sum(row[name]["verdicts"][ALIKE[row["kind"]]] == "no_fault" for row in faulty)
        print(f"{name}: healthy {dict(said)}; wrong no fault {wrong} of {len(faulty)}")
        for kind in KINDS:
            own = [row for row in faulty if row["kind"] == kind]
            named = [row for row in own if row[name]["faults"] and row[name]["faults"][0][0] == kind]
            alike = [row for row in own if any(ALIKE.get(f[0]) == ALIKE[kind] for f in row[name]["faults"])]
            other = [row for row in own if row[name]["faults"] and row not in alike]
            several = sum(len(row[name]["faults"]) > 1 for row in own)
            # The phase of an oscillation takes its sign.
            sized = [
                (row[name]["faults"][0], abs(row["magnitude"]) if kind == "sine" else row["magnitude"]) for row in named
            ]
            ends = [(sorted(map(abs, f[3:5])) if kind == "sine" else f[3:5], size) for f, size in sized]
            covered = sum(low <= size <= high for (low, high), size in ends)
            print(
                f"  {kind}: {len(own)}, named {len(named)}, of its kind {len(alike)}, another kind {len(other)}, "
                f"several {several}, covered {covered} of {len(named)}"
            )
        limits = [row[name]["slow_limit"] for row in healthy if row[name]["slow_limit"] is not None]
        if limits:
            print("  slow limit in tolerances, quartiles:", np.round(np.quantile(limits, [0.1, 0.25, 0.5, 0.75]), 2))
        for kind in ("abrupt", "oscillating"):
            excluded = sum(row[name]["verdicts"][kind] == "no_fault" for row in healthy)
            print(f"  {kind} excluded in {excluded} of {len(healthy)} healthy windows")


if __name__ == "__main__":
    run_numbered(trial, report)
