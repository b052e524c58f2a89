"""Events that need no scan: short defects of a channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..flightlog.defects import Defect, sentence_of_defect
from ..notes import Note
from ..preprocessing.tolerance import tolerance_of
from .flight import Flight
from .result import Event

AROUND_S = 30.0  # shown beside a short defect
AFTER_HOLD_S = 20.0  # after a held line, when a jump back is its end and no fault of its own


def events_of_defects(flight: Flight) -> tuple[Event, ...]:
    """Return an event for each channel and kind of short defect in the part that is diagnosed.

    What begins while a pressure line is held, or where it lets go, is no defect of the channels that follow from it.
    """
    found = []
    for one in _in_part(flight):
        lines = [line for line in flight.held.findings if one.channel in line.channels and not line.doubt]
        held = [(line.onset_ci95[0], np.inf if line.offset_s is None else line.offset_s) for line in lines]
        own = [
            k
            for k, time_s in enumerate(one.times_s)
            if not any(first_s <= time_s <= last_s + AFTER_HOLD_S for first_s, last_s in held)
        ]
        if own:
            kept = replace(
                one,
                times_s=tuple(one.times_s[k] for k in own),
                durations_s=tuple(one.durations_s[k] for k in own),
                hidden=tuple(one.hidden[k] for k in own),
            )
            found.append(_event(flight, kept))
    return tuple(found)


def notes_on_defects(flight: Flight) -> list[Note]:
    """Return what was left out of the other analyses."""
    return [Note.method(f"{sentence_of_defect(one)}; left out of the other analyses") for one in _in_part(flight)]


def _in_part(flight: Flight) -> list[Defect]:
    return [inside for one in flight.defects if (inside := one.between(flight.from_s, flight.to_s)) is not None]


def _event(flight: Flight, one: Defect) -> Event:
    onset_s, last_s = one.times_s[0], one.times_s[-1] + one.durations_s[-1]
    beside_s = max(onset_s - one.hidden[0][0], 1.0 / flight.log.rate_hz)
    return Event(
        fault=one.channel,
        among=(one.channel,),
        channels=(one.channel,),
        state="declared",
        kind="abrupt",
        stages=("sensors",),
        shape=one.shape,
        constant_s=None,
        frequency_hz=None,
        magnitude=None,
        unit=one.unit,
        sd=None,
        ci95=None,
        effect={one.channel: one.largest},
        onset_s=onset_s,
        onset_ci95=(onset_s - beside_s, onset_s + beside_s),
        offset_s=last_s,
        seen_until_s=last_s,
        window_s=(max(onset_s - AROUND_S, flight.from_s), min(last_s + AROUND_S, flight.to_s)),
        statistic=one.statistic,
        threshold=1.0,
        p_value=None,
        evidence={},
        note="",
        repeat="",
        beyond_tolerance=bool(np.abs(one.largest) > _tolerance(flight, one.channel)),
        count=one.count,
        times_s=one.times_s,
        duration_s=one.duration_s,
    )


def _tolerance(flight: Flight, channel: str) -> float:
    return flight.tolerances.get(channel) or tolerance_of(flight.log, flight.log, channel)
