"""What ordinarily happens in a flight, and faults that it imitates, as `bfi diagnose` meets them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bars import FULL
from cut_faults import Trial as FaultTrial
from cut_faults import faulty
from flight_faults import Maker, Truth, blocked, course, icing, leak
from jsbsim_trials import AFTER_S, AIRCRAFT, SENSORS, tour
from threadpoolctl import threadpool_limits
from whole_flight_trials import NEAR_S, said_of

from bfi_cli.config import Config
from bfi_cli.faults.ordinary import Occurrence
from bfi_cli.flight import diagnose_flight
from bfi_cli.flight.result import DiagnoseResult, OrdinaryEvent
from bfi_cli.flight.tables import LEVELS, ON_GROUND
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.ordinary import INJECTED
from bfi_cli.jsbsim.ordinary import SIMULATED

# What is a hypothesis with a signature is told by its name; what is mended in the reading or is noise is only no fault.
RIVALS = ("flaps", "wind", "altitude_held", "on_ground", "altimeter_set", "attitude_settles", "wake")
OTHERS = ("gusts", "wind_shear", "clock")
BEGINS_S = (250.0, 600.0)
VISIBLE = 3.0  # standard deviations
CAPTURED_S = 30.0  # after which an autopilot holds its altitude
LANDS_S = 150.0  # after an approach of 3 degrees from 150 m was begun
# Each fault is one that the cause beside it imitates.
IMITATED: Mapping[str, tuple[str, Maker]] = {
    "static_blocked": ("altitude_held", blocked("static")),
    "altitude step": ("altimeter_set", course("altitude", "bias", (40.0, 120.0))),
    "pitot_icing": ("wake", icing((0.001, 0.005))),
    "pitch drift": ("attitude_settles", course("pitch", "drift", (0.0006, 0.0015))),
    "pitch step": ("flaps", course("pitch", "bias", (0.03, 0.08))),
    "aoa step": ("flaps", course("aoa", "bias", (0.03, 0.06))),
    "tas step": ("wind", course("tas", "bias", (5.0, 12.0))),
    "pitot_leak": ("on_ground", leak("pitot", (1.0, 1.0), (2.0, 30.0))),
}
RECORDED = (
    "citation_20180312_f1.h5",
    "citation_20190312_123416.h5",
    "g1000_c172_110812.h5",
    "sr22t_210623_141501.h5",
    "sr22t_220417_135002.h5",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseTrial:
    """A tour of an aircraft of JSBSim in which something ordinary happens."""

    aircraft: str
    cause: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseAnswer:
    """What was said of it: by its name, and as a fault; `others` are ordinary events that were not made.

    `visible` is whether the flight itself leaves it to be seen, see `is_visible`.
    """

    trial: CauseTrial
    visible: bool
    named: bool
    declared: bool
    suspected: bool
    others: int
    said: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultAnswer:
    """What was said of a fault that an ordinary cause imitates."""

    trial: FaultTrial
    cause: str
    state: str
    explained_away: bool
    said: str


def with_cause(trial: CauseTrial) -> tuple[FlightLog, Occurrence]:
    """Return a flight in which a cause acts, and when."""
    makings = SIMULATED if trial.cause in SIMULATED else INJECTED
    rng = np.random.default_rng([trial.seed, AIRCRAFT.index(trial.aircraft), (*RIVALS, *OTHERS).index(trial.cause)])
    at_s = float(rng.uniform(*BEGINS_S))
    made = Occurrence(cause=trial.cause, at_s=at_s, size=makings[trial.cause].size)
    if trial.cause in SIMULATED:
        return tour(trial.aircraft, seed=trial.seed, ordinary=(made,)), made
    return inject(tour(trial.aircraft, seed=trial.seed), ordinary=(made,)), made


def answer_to_cause(trial: CauseTrial) -> CauseAnswer:
    """Diagnose a flight in which something ordinary happens."""
    log, made = with_cause(trial)
    log = log if FULL else log.window(None, made.at_s + AFTER_S)
    with threadpool_limits(1):
        result = diagnose_flight(log, Config())
    right = [event for event in result.ordinary if event.cause == made.cause and abs(event.from_s - made.at_s) < NEAR_S]
    events = [event for event in result.events if event.beyond_tolerance is not False]
    return CauseAnswer(
        trial=trial,
        visible=is_visible(log, made),
        named=bool(right) or (made.cause == ON_GROUND and _lands(result, made.at_s)),
        declared=any(event.state == "declared" for event in events),
        suspected=any(event.state == "suspected" for event in events),
        others=len(result.ordinary) - len(right),
        said=f"at {made.at_s:.0f} s: {said_of(result)} {ordinary_in_words(result)}",
    )


def is_visible(log: FlightLog, made: Occurrence) -> bool:
    """Return whether a cause is larger than what the flight shows without it, by what was made alone.

    An error of the pitch is as large as that of vertical air, which comes and goes within a minute as it does, of three
    standard deviations; an altitude that is held looks like a line that rests where it moves by no more than noise.
    """
    if made.cause == "attitude_settles":
        drafts = LEVELS["vertical_air"].highest / float(np.median(log.channels["tas"].values))
        return abs(made.size or 0.0) > VISIBLE * drafts
    if made.cause == "altitude_held":
        held = (log.time_s > made.at_s + CAPTURED_S) & (log.time_s < made.at_s + (made.size or 0.0))
        return float(np.std(log.channels["altitude"].values[held])) < VISIBLE * SENSORS["altitude"]
    return True


def answer_to_fault(trial: FaultTrial, *, folder: Path) -> FaultAnswer | None:
    """Diagnose a part of a recorded flight with a fault that an ordinary cause imitates, None where it is too small."""
    made = faulty(trial, folder, {kind: maker for kind, (_, maker) in IMITATED.items()})
    if made is None or made[2] < 1.0:
        return None
    log, truth, _ = made
    with threadpool_limits(1):
        result = diagnose_flight(log, Config())
    until_s = np.inf if truth.offset_s is None else truth.offset_s
    during = [event for event in result.events if truth.onset_s - NEAR_S <= event.onset_s <= until_s + NEAR_S]
    named = [event for event in during if truth.fault in event.among]
    states = [event.state for event in named or during]
    told = any(_is_of(event, truth) for event in result.ordinary)
    return FaultAnswer(
        trial=trial,
        cause=IMITATED[trial.kind][0],
        state="declared" if "declared" in states else states[0] if states else "missed",
        explained_away=told and not during,
        said=f"{truth.fault} {truth.about} from {truth.onset_s:.0f} s: {said_of(result)} {ordinary_in_words(result)}",
    )


def _lands(result: DiagnoseResult, at_s: float) -> bool:
    """Return whether the phases of an answer tell a landing that was begun at a time."""
    return any(phase.phase == "ground" and at_s < phase.from_s < at_s + LANDS_S for phase in result.phases)


def _is_of(event: OrdinaryEvent, truth: Truth) -> bool:
    """Return whether an ordinary cause is told where a fault begins or grows, or where it ends."""
    begins = truth.onset_s - NEAR_S <= event.from_s <= truth.onset_s + (truth.grows_s or 0.0) + 2.0 * NEAR_S
    return begins or (truth.offset_s is not None and abs(event.from_s - truth.offset_s) <= NEAR_S)


def ordinary_in_words(result: DiagnoseResult) -> str:
    """Return the ordinary events of an answer for a printed line."""
    return str([(event.cause, round(event.from_s), event.looks_like) for event in result.ordinary])
