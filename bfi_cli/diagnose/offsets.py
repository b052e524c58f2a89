"""Constant errors as long as the flight, which arithmetic between channels shows, as events of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..channels import STANDARD
from ..config import Config
from ..flightlog import FlightLog
from ..plausibility import Implausible
from ..preprocessing.tolerance import tolerance_of
from .flight import Flight
from .result import Event

FEWEST_WITNESSES = 2  # other channels that contradict one which is named; of two alone either may be wrong


def is_fault(log: FlightLog, one: Implausible, config: Config) -> bool:
    """Return whether a finding is a constant error of a channel beyond its tolerance that two others contradict."""
    if one.what != "offset" or len(one.agrees_with) < FEWEST_WITNESSES:
        return False
    channel = one.channels[0]
    return abs(one.offset) > (config.tolerances.get(channel) or tolerance_of(log, log, channel))


def with_faults_marked(log: FlightLog, findings: Sequence[Implausible], config: Config) -> tuple[Implausible, ...]:
    """Return findings of which the faults of one channel alone are marked as left out of the rest of a diagnosis."""
    return tuple(replace(one, fixed=True) if is_fault(log, one, config) and not one.rivals else one for one in findings)


def event_of_offset(flight: Flight, one: Implausible) -> Event:
    """Return a constant error as an event of the whole part that is diagnosed."""
    channel, size = one.channels[0], -one.offset
    tolerance = flight.tolerances.get(channel) or tolerance_of(flight.log, flight.log, channel)
    return Event(
        fault=channel,
        among=(channel, *one.rivals),
        channels=(channel,),
        state="declared",
        kind="slow",
        stages=("static relations",),
        shape="offset",
        constant_s=None,
        frequency_hz=None,
        magnitude=size,
        unit=STANDARD[channel].unit,
        sd=None,
        ci95=None,
        effect={channel: size},
        beyond_tolerance=True,
        onset_s=flight.from_s,
        onset_ci95=(flight.from_s, flight.from_s),
        offset_s=None,
        seen_until_s=flight.to_s,
        window_s=(flight.from_s, flight.to_s),
        statistic=abs(size) / tolerance,
        threshold=1.0,
        p_value=None,
        evidence={},
        note=one.text,
        repeat="",
    )
