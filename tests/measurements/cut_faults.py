"""Parts of 600 to 1600 s of flights of many aircraft, each with one fault, as `bfi diagnose` meets them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from flight_faults import (
    Channels,
    Maker,
    Truth,
    blocked,
    computed,
    course,
    frozen,
    icing,
    impact_pressure,
    leak,
    static_pressure,
    swinging,
)
from jsbsim_trials import tour
from threadpoolctl import threadpool_limits
from whole_flight_trials import NEAR_S, flight, recorder, said_of

from bfi_cli.config import Config
from bfi_cli.flight import diagnose_flight
from bfi_cli.flight.parity.windows import flight_stretches
from bfi_cli.flight.result import Event
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.record import frozen_array

RECORDED = (
    "citation_20180312_f1.h5",
    "citation_20190312_123416.h5",
    "g1000_c172_110812.h5",
    "sr22t_210623_141501.h5",
    "sr22t_220417_135002.h5",
)
SIMULATED = ("c172p", "737", "f16")
AIRCRAFT = (*RECORDED, *SIMULATED)
LENGTHS_S = (600.0, 1600.0)
# A fault begins so long after the part's begin and before its end.
AFTER_S, BEFORE_S = 150.0, 200.0
# A fault counts where it makes an error of so much somewhere: one that changes nothing is nobody's to find.
LEAST: Mapping[str, float] = {
    "tas": 4.0,
    "cas": 4.0,
    "altitude": 40.0,
    "aoa": 0.03,
    "pitch": 0.03,
    "tat": 4.0,
    "normal_acc": 0.8,
}


KINDS: Mapping[str, Maker] = {
    "pitot_blocked": blocked("pitot"),
    "static_blocked": blocked("static"),
    "pitot_leak": leak("pitot", (1.0, 1.0), (2.0, 30.0)),
    "static_leak": leak("static", (0.03, 0.2), (2.0, 20.0)),
    "pitot_icing": icing((0.001, 0.005)),
    "tas step": course("tas", "bias", (5.0, 12.0)),
    "cas step": course("cas", "bias", (5.0, 12.0)),
    "altitude step": course("altitude", "bias", (60.0, 200.0)),
    "tas drift": course("tas", "drift", (0.1, 0.25)),
    "aoa step": course("aoa", "bias", (0.03, 0.06)),
    "aoa frozen": frozen("aoa", (60.0, 300.0)),
    "pitch step": course("pitch", "bias", (0.05, 0.12)),
    "normal_acc step": course("normal_acc", "bias", (1.0, 3.0)),
    "tat step": course("tat", "bias", (5.0, 10.0)),
}
# Of the frequencies that the seconds of a flight show; from 1.5 times the tolerance of an airspeed on.
OSCILLATIONS: Mapping[str, Maker] = {
    "pitot_water": swinging("", (4.0, 10.0), (0.055, 0.42)),
    "tas sine": swinging("tas", (4.0, 10.0), (0.055, 0.42)),
    "cas sine": swinging("cas", (4.0, 10.0), (0.055, 0.42)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One part of a flight with one fault."""

    aircraft: str
    kind: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the program said of a trial; `declared` and `suspected` are events beyond tolerance."""

    trial: Trial
    truth: Truth
    worst: float
    state: str
    wrong: bool
    covered: bool | None
    onset_covered: bool | None
    others: int
    hours: float
    events: str


@cache
def journey(aircraft: str, seed: int, folder: Path) -> FlightLog:
    """Return a recorded flight of light aircraft or the Citation, or a tour of JSBSim of its own seed."""
    return (
        tour(aircraft, seed=seed % 3, duration_s=LENGTHS_S[1]) if aircraft in SIMULATED else flight(folder / aircraft)
    )


def canonical(log: FlightLog) -> dict[str, str]:
    """Return the recorded channel of each name that the makers know."""
    names = {name: name for name in log.channels}
    if "cas" not in names and "ias" in names:
        names["cas"] = "ias"
    return names


def faulty(trial: Trial, folder: Path, kinds: Mapping[str, Maker] = KINDS) -> tuple[FlightLog, Truth, float] | None:
    """Return the part with its fault and the worst error in units of `LEAST`; None where the aircraft lacks it."""
    rng = np.random.default_rng([trial.seed, AIRCRAFT.index(trial.aircraft), list(kinds).index(trial.kind)])
    whole = journey(trial.aircraft, trial.seed, folder)
    length_s = float(rng.uniform(*LENGTHS_S))
    stretches = [(a, b) for a, b in flight_stretches(phases_of(whole)) if b - a > AFTER_S + BEFORE_S + 60.0]
    from_s, to_s = stretches[int(rng.integers(len(stretches)))]
    length_s = min(length_s, to_s - from_s)
    start_s = float(rng.uniform(from_s, to_s - length_s))
    log = whole.window(start_s, start_s + length_s)
    names = canonical(log)
    values: Channels = {name: np.array(log.channels[at].values, dtype=float) for name, at in names.items()}
    if "tat" not in values and "sat" in values:
        mach = computed(static_pressure(values["altitude"]), impact_pressure(values["cas"]), values["sat"], 1.0)["mach"]
        values["tat"] = values["sat"] * (1.0 + 0.2 * mach**2)
    channel = trial.kind.split()[0]
    if " " in trial.kind and channel not in names:
        return None
    free = (log.time_s > start_s + AFTER_S) & (log.time_s < start_s + length_s - BEFORE_S)
    record = recorder(folder.parent / "tools" / "recorder.py").record
    low = partial(record, rate_hz=log.rate_hz)
    changed, truth = kinds[trial.kind](values, np.array(log.time_s), free, rng, low)
    worst = max(
        (float(np.nanmax(np.abs(changed[n] - values[n]))) / LEAST[n] for n in LEAST if n in changed), default=9.0
    )
    channels = dict(log.channels)
    for name, after in changed.items():
        if name not in names:
            continue
        for at in {names[name], *(("baro_altitude",) if name == "altitude" else ())} & set(channels):
            error = np.nan_to_num(after - values[name])
            channels[at] = replace(channels[at], values=frozen_array(channels[at].values + error))
    fault = names.get(truth.fault, truth.fault)
    return replace(log, channels=channels), replace(truth, fault=fault), worst


def answer_of(trial: Trial, *, folder: Path, kinds: Mapping[str, Maker] = KINDS) -> Answer | None:
    """Diagnose one trial, None where its fault makes no error or the aircraft lacks its sensor."""
    made = faulty(trial, folder, kinds)
    if made is None or made[2] < 1.0:
        return None
    log, truth, worst = made
    with threadpool_limits(1):
        result = diagnose_flight(log, Config())
    right = [event for event in result.events if truth.fault in event.among and _begins(event, truth)]
    right.sort(key=lambda event: (event.state != "declared", abs(event.onset_s - truth.onset_s)))
    best = right[0] if right else None
    declared = [event for event in result.events if event.state == "declared" and event.beyond_tolerance is not False]
    end_s = np.inf if truth.offset_s is None else truth.offset_s
    others = [event for event in declared if event is not best and truth.fault not in event.among]
    during = [event for event in others if truth.onset_s - NEAR_S <= event.onset_s <= end_s + NEAR_S]
    covered = None
    if best is not None and truth.magnitude is not None and best.ci95 is not None and best.fault == truth.fault:
        size = truth.magnitude * truth.grows_s if best.shape == "ramp_hold" and truth.grows_s else truth.magnitude
        covered = bool(best.ci95[0] <= size <= best.ci95[1])
    return Answer(
        trial=trial,
        truth=truth,
        worst=worst,
        state=best.state if best else "missed",
        wrong=bool(during) and (best is None or best.state != "declared"),
        covered=covered,
        onset_covered=None if best is None else best.onset_ci95[0] <= truth.onset_s <= best.onset_ci95[1],
        others=len(others),
        hours=float(log.time_s[-1] - log.time_s[0]) / 3600.0,
        events=said_of(result),
    )


def answer_to_oscillation(trial: Trial, *, folder: Path) -> Answer | None:
    """Diagnose one trial of `OSCILLATIONS`, None where its fault makes no error or the aircraft lacks its sensor."""
    return answer_of(trial, folder=folder, kinds=OSCILLATIONS)


def _begins(event: Event, truth: Truth) -> bool:
    low, high = event.onset_ci95
    return abs(event.onset_s - truth.onset_s) <= NEAR_S or low <= truth.onset_s <= high
