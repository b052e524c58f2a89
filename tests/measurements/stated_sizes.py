"""Faults of the sizes from which on a diagnosis says that they would have been found, added to the log that says so."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bfi_cli.airdata import DEPENDS_ON, air_data_of, channels_of
from bfi_cli.config import Config
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flight import DiagnoseResult, FlightLimit, diagnose_flight
from bfi_cli.flight.parity.record import STATIC_LEAK
from bfi_cli.flight.result import Event
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.derived import pressures_of
from bfi_cli.flightlog.record import FloatArray, frozen_array

LARGER = 1.5  # times the stated size
DRAWS = 1000
SLACK_S = 5.0  # of an onset beside its interval, for a fault that is named with the one that began it
PART_S = 300.0  # of the flight to both sides of the onset, which is diagnosed
ICING = "pitot_icing"

Named = Literal["named", "in a set", "deviation", "suspected", "nothing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """A fault of a stated size in a part of its log.

    Attributes
    ----------
    limit : what states it; size : of the fault, of the sign that it has; from onset_s on, it grows for length_s.
    """

    limit: FlightLimit
    size: float
    onset_s: float
    length_s: float

    @property
    def grows(self) -> bool:
        return self.limit.shape == "drift"

    @property
    def words(self) -> str:
        shape = f"{self.limit.fault} {self.limit.shape} ({self.limit.bounds})"
        return f"{shape} {self.size:.4g} {self.limit.unit} from {self.onset_s:.0f} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """What a diagnosis says of a fault: `others` are declared events beside it that the healthy part does not show."""

    added: Added
    named: Named
    margin: float | None
    others: tuple[str, ...]
    text: str


def statements(result: DiagnoseResult) -> tuple[FlightLimit, ...]:
    """Return the limits of most of the flight that say from which size on a fault would have been found."""
    mostly = [limit for limit in result.limits if limit.holds_in < 1.0 and limit.seen_above is not None]
    return tuple({(limit.fault, limit.shape): limit for limit in mostly}.values())


def drawn(limit: FlightLimit, result: DiagnoseResult, rng: np.random.Generator) -> Added | None:
    """Return a fault of a stated size, times `LARGER`, at a random time that is watched for it; None where none is."""
    assert limit.seen_above is not None
    assert limit.seen_within_s is not None
    length_s = limit.seen_within_s
    for _ in range(DRAWS):
        onset_s = float(rng.uniform(result.log.start_s, result.log.stop_s - length_s))
        is_watched = any(look.from_s <= onset_s <= look.to_s for look in result.windows)
        if is_watched and not any(
            from_s <= onset_s + length_s and onset_s <= to_s for from_s, to_s, _ in result.unwatched
        ):
            sign = 1.0 if limit.fault == ICING else float(rng.choice([-1.0, 1.0]))
            return Added(limit=limit, size=sign * LARGER * limit.seen_above, onset_s=onset_s, length_s=length_s)
    return None


def faulty(log: FlightLog, added: Added) -> FlightLog:
    """Return a log with the fault, which passes the filters of its recorder and stays as it has grown."""
    limit = added.limit
    if limit.fault == STATIC_LEAK:
        return _with_static_error(log, added)
    onset_s, length_s = added.onset_s, added.length_s
    if limit.fault == ICING:
        fault = Fault(shape=ICING, magnitude=added.size, onset_s=onset_s, offset_s=onset_s + length_s)
    else:
        grown = added.size * length_s if added.grows else added.size
        fault = Fault(shape="bias", channel=limit.fault, magnitude=grown, onset_s=onset_s)
        fault = replace(fault, shape="ramp_hold", duration_s=length_s) if added.grows else fault
    return replace(inject(log, [fault]), truth=None)


def _with_static_error(log: FlightLog, added: Added) -> FlightLog:
    """Return a log whose static pressure is wrong by a rate, while it grows, on every channel that follows from it."""
    names = [name for name in DEPENDS_ON if name in log.channels and "p_static" in pressures_of(log, name)]
    air = air_data_of({name: channel.values for name, channel in log.channels.items()})
    error = added.size * np.clip(log.time_s - added.onset_s, 0.0, added.length_s)
    moving = np.isfinite(air.p_static + air.q_impact)
    impact = np.where(moving, air.q_impact, 0.0)
    old, new = (
        channels_of(air.p_static + by, np.maximum(impact - by, 0.0), air.tat, rate_of=log.time_s)
        for by in (np.zeros_like(error), error)
    )
    response = response_of(log.filters or (), log.rate_hz)
    channels = dict(log.channels)
    for name in names:
        change: FloatArray = np.nan_to_num(new[name] - old[name]) if name in new else np.zeros_like(error)
        if not response.changes_nothing:
            change = response.filtered(np.pad(change, (response.after, response.before), mode="edge"))
        channels[name] = replace(channels[name], values=frozen_array(channels[name].values + change))
    return replace(log, channels=channels, sha256="")


def part_of(log: FlightLog, added: Added) -> FlightLog:
    """Return the part of a log about a fault."""
    return log.window(
        max(float(log.time_s[0]), added.onset_s - PART_S),
        min(float(log.time_s[-1]), added.onset_s + added.length_s + PART_S),
    )


def begins_within(event: Event, name: str, from_s: float, to_s: float) -> bool:
    """Return whether an event may be a fault that begins between two times, both with the slack of an onset."""
    return name in event.among and event.onset_ci95[0] <= to_s + SLACK_S and from_s - SLACK_S <= event.onset_ci95[1]


def text_of(answer: DiagnoseResult) -> str:
    """Return the events and deviations of a diagnosis in a line."""
    return "; ".join(
        f"{event.state} {'/'.join(event.among)} {event.shape} {event.magnitude or 0.0:.3g} at {event.onset_s:.0f} s"
        for event in (*answer.events, *answer.deviations)
    )


def said_of(log: FlightLog, added: Added) -> Said:
    """Diagnose the part of a log about a fault, and say whether that is named."""
    answer = diagnose_flight(part_of(faulty(log, added), added), Config())
    name, last_s = added.limit.fault, added.onset_s + (added.length_s if added.grows else 0.0)

    def is_it(event: Event) -> bool:
        return begins_within(event, name, added.onset_s, last_s)

    def order(event: Event) -> tuple[bool, bool, float]:
        return event.state == "declared", event.fault == name, event.margin or 0.0

    events = [event for event in (*answer.events, *answer.deviations) if is_it(event)]
    best = max(events, key=order, default=None)
    named: Named = "nothing"
    if best is not None and any(best is event for event in answer.deviations):
        named = "deviation"
    elif best is not None:
        named = "suspected" if best.state == "suspected" else "in a set" if len(best.among) > 1 else "named"
    others = [event for event in answer.events if event.state == "declared" and not is_it(event)]
    if others:
        healthy = diagnose_flight(part_of(log, added), Config()).events
        known = [event.among for event in healthy if event.state == "declared"]
        others = [event for event in others if event.among not in known]
    return Said(
        added=added,
        named=named,
        margin=None if best is None else best.margin,
        others=tuple("/".join(event.among) for event in others),
        text=text_of(answer),
    )
