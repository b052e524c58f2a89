"""Whole recorded flights with one fault each, made from first principles, and what `bfi diagnose` says of them.

Every flight is diagnosed as a user would: all channels, no calibration of its own.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from types import ModuleType

import numpy as np
from flight_faults import KINDS, Channels, Truth
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bfi_cli.config import Config
from bfi_cli.flight import DiagnoseResult, diagnose_flight
from bfi_cli.flight.parity.windows import configuration_changes, flight_stretches
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array

# A fault begins at least so long after the flight's begin and before its last descent.
BEFORE_S, AFTER_S = 300.0, 240.0
# A declared event names the fault if it is the first of its set and begins so near, or its interval holds the onset.
NEAR_S = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One flight with one fault, None for a healthy one."""

    path: Path
    kind: str | None
    seed: int
    base: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the program said of a trial."""

    trial: Trial
    truth: Truth | None
    named: bool
    extra: tuple[str, ...]
    onset_error_s: float | None
    covered: bool | None
    hours: float
    said: str


@cache
def flight(path: Path) -> FlightLog:
    return read_log(path)


@cache
def recorder(path: Path) -> ModuleType:
    """Return the recorder that lies beside the flights."""
    spec = importlib.util.spec_from_file_location("recorder", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def may_begin(log: FlightLog) -> NDArray[np.bool_]:
    """Return at which samples a fault may begin: in flight, flaps and gear at rest, well inside."""
    phases, free = phases_of(log), np.zeros(len(log.time_s), dtype=bool)
    moved = configuration_changes(phases)
    stretches = flight_stretches(phases)
    low, high = min(one[0] for one in stretches) + BEFORE_S, max(one[1] for one in stretches) - AFTER_S
    for from_s, to_s in stretches:
        free |= (log.time_s >= max(from_s, low)) & (log.time_s < min(to_s, high))
    for from_s, to_s in moved:
        free &= ~((log.time_s >= from_s - AFTER_S) & (log.time_s < to_s))
    return free


def faulty(trial: Trial) -> tuple[FlightLog, Truth | None]:
    """Return the flight with the fault of a trial."""
    log = flight(trial.path)
    if trial.kind is None:
        return log, None
    rng = np.random.default_rng([trial.base, trial.seed, list(KINDS).index(trial.kind)])
    record = recorder(trial.path.parents[1] / "tools" / "recorder.py").record
    low = partial(record, rate_hz=log.rate_hz)
    values: Channels = {name: np.array(one.values) for name, one in log.channels.items()}
    changed, truth = KINDS[trial.kind](values, np.array(log.time_s), may_begin(log), rng, low)
    channels = {
        name: replace(one, values=frozen_array(changed[name])) if name in changed else one
        for name, one in log.channels.items()
    }
    return replace(log, channels=channels), truth


def answer_of(trial: Trial) -> Answer:
    """Diagnose one trial."""
    log, truth = faulty(trial)
    with threadpool_limits(1):
        result = diagnose_flight(log, Config())
    events = [one for one in result.events if one.state == "declared"]
    right = [
        one
        for one in events
        if truth is not None
        and one.fault == truth.fault
        and (truth.shape in (None, "bias") or one.shape == truth.shape)
        and (abs(one.onset_s - truth.onset_s) <= NEAR_S or one.onset_ci95[0] <= truth.onset_s <= one.onset_ci95[1])
    ]
    best = min(right, key=lambda one: abs(one.onset_s - truth.onset_s), default=None) if truth is not None else None
    extra = [one for one in events if one is not best and one.beyond_tolerance is not False]
    covered = None
    if best is not None and truth is not None and truth.magnitude is not None and best.ci95 is not None:
        # A ramp that ends is told by what it has reached, one that does not by its slope.
        size = truth.magnitude * truth.grows_s if best.shape == "ramp_hold" and truth.grows_s else truth.magnitude
        covered = best.ci95[0] <= size <= best.ci95[1]
    return Answer(
        trial=trial,
        truth=truth,
        named=best is not None,
        extra=tuple(f"{one.fault} {one.shape} at {one.onset_s:.0f} s" for one in extra),
        onset_error_s=None if best is None or truth is None else best.onset_s - truth.onset_s,
        covered=covered,
        hours=in_flight_h(log, result),
        said=said_of(result),
    )


def in_flight_h(log: FlightLog, result: DiagnoseResult) -> float:
    return sum(to_s - from_s for from_s, to_s in flight_stretches(result.phases)) / 3600.0


def said_of(result: DiagnoseResult) -> str:
    lines = []
    for one in result.events:
        size = "" if one.magnitude is None else f" {one.magnitude:.3g}"
        if one.ci95 is not None:
            size += f" ({one.ci95[0]:.3g} to {one.ci95[1]:.3g})"
        end = "" if one.offset_s is None else f" to {one.offset_s:.0f}"
        lines.append(f"{'/'.join(one.among)} {one.shape}{size} {one.onset_s:.1f}{end} s {one.state}")
    return "; ".join(lines) or "nothing"
