"""Events that need no scan: short defects of a channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..flightlog.defects import Defect, sentence_of_defect
from ..model.preprocessing.defaults import tolerance_of
from ..notes import Note
from .flight import Flight
from .result import Event

AROUND_S = 30.0  # shown beside a short defect
AFTER_HOLD_S = 20.0  # after a held line, when a jump back is its end and no fault of its own


def events_of_defects(flight: Flight) -> tuple[Event, ...]:
    """Return an event for each channel and kind of short defect in the part that is diagnosed.

    What begins while a pressure line is held, or where it lets go, is no defect of the channels that follow from it.
    """
    events = []
    for defect in _in_part(flight):
        lines = [line for line in flight.held.findings if defect.channel in line.channels and not line.doubt]
        held = [(line.onset_ci95[0], line.until_s) for line in lines]
        outside = [
            k
            for k, time_s in enumerate(defect.times_s)
            if not any(first_s <= time_s <= last_s + AFTER_HOLD_S for first_s, last_s in held)
        ]
        if outside:
            kept = replace(
                defect,
                times_s=tuple(defect.times_s[k] for k in outside),
                durations_s=tuple(defect.durations_s[k] for k in outside),
                hidden=tuple(defect.hidden[k] for k in outside),
            )
            events.append(_event(flight, kept))
    return tuple(events)


def notes_on_defects(flight: Flight) -> list[Note]:
    """Return what was left out of the other analyses."""
    return [Note.method(f"{sentence_of_defect(defect)}; left out of the other analyses") for defect in _in_part(flight)]


def _in_part(flight: Flight) -> list[Defect]:
    return [inside for defect in flight.defects if (inside := defect.between(flight.from_s, flight.to_s)) is not None]


def _event(flight: Flight, defect: Defect) -> Event:
    onset_s, last_s = defect.times_s[0], defect.times_s[-1] + defect.durations_s[-1]
    beside_s = max(onset_s - defect.hidden[0][0], 1.0 / flight.log.rate_hz)
    tolerance = flight.tolerances.get(defect.channel) or tolerance_of(flight.log, flight.log, defect.channel)
    return Event(
        fault=defect.channel,
        among=(defect.channel,),
        channels=(defect.channel,),
        state="declared",
        kind="abrupt",
        stages=("sensors",),
        shape=defect.shape,
        unit=defect.unit,
        effect={defect.channel: defect.largest},
        onset_s=onset_s,
        onset_ci95=(onset_s - beside_s, onset_s + beside_s),
        offset_s=last_s,
        seen_until_s=last_s,
        window_s=(max(onset_s - AROUND_S, flight.from_s), min(last_s + AROUND_S, flight.to_s)),
        statistic=defect.statistic,
        threshold=1.0,
        beyond_tolerance=bool(np.abs(defect.largest) > tolerance),
        count=defect.count,
        times_s=defect.times_s,
        duration_s=defect.duration_s,
    )
