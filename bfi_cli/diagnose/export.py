"""The events of a diagnosis for other programs: a CSV file of which the first line is the header."""

from __future__ import annotations

from collections.abc import Sequence

from ..files import EVENTS
from ..serialization import csv_lines
from .result import Event


def events_csv(events: Sequence[Event]) -> bytes:
    """Return a row for each event in order of time: seconds of the log, SI and radians, empty where nothing is known.

    `time` is the onset, so that a program for time series shows each number as a point there. `low` and `high` are the
    ends of the 95 % interval of the magnitude.
    """
    rows = [
        (
            *(one.onset_s, one.offset_s, one.fault, " ".join(one.channels), one.state, one.kind, one.shape),
            *(one.magnitude, one.unit, *(one.ci95 or (None, None)), one.p_value),
        )
        for one in sorted(events, key=lambda one: one.onset_s)
    ]
    return f"{EVENTS}\n{csv_lines(rows)}".encode()
