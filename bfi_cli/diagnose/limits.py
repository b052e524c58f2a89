"""What a diagnosis excludes: per fault and shape the largest that may hide in the worst stretch of the flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..airdata import air_data_of
from ..channels import STANDARD
from ..parity import Limit, Threshold
from ..parity.lines import METRES
from ..parity.record import STATIC_LEAK
from ..parity.windows import Window, overlaps
from ..preprocessing.tolerance import tolerance_of
from .flight import Flight
from .looks import Scanned
from .relations import StaticWindows
from .result import Event, FlightLimit, Look

__all__ = ["AIRSPEEDS", "limits_of"]

AIRSPEEDS = ("tas", "cas", "ias", "mach")
# Limits are compared over stretches of this length.
BIN_S = 30.0


def limits_of(
    flight: Flight,
    judgements: Sequence[tuple[Scanned, Threshold, Look]],
    static: StaticWindows,
    events: Sequence[Event],
) -> tuple[FlightLimit, ...]:
    """Return per fault and shape what the worst stretch of the flight excludes; of its windows the best counts.

    Stretches in which flaps and gear are moved are left out, since nothing is declared there, and windows with a
    declared fault, which exclude no other of its size. What may last excludes nothing of its own after it.
    """
    left_out = [
        (one.onset_s, one.seen_until_s if one.offset_s is None else one.offset_s)
        for one in events
        if one.state == "declared" and one.stages[0] != "sensors"
    ]
    bins = np.arange(flight.from_s, flight.to_s, BIN_S) + 0.5 * BIN_S
    best: dict[tuple[str, str], list[FlightLimit | None]] = {}

    def offer(limit: FlightLimit) -> None:
        kept = best.setdefault((limit.fault, limit.shape), [None] * len(bins))
        for k in np.flatnonzero((bins >= limit.from_s) & (bins < limit.to_s)).tolist():
            other = kept[k]
            if other is None or limit.effect < other.effect:
                kept[k] = limit

    for one, threshold, _ in judgements:
        window = (one.from_s, one.to_s)
        told = () if overlaps(window, (*flight.moved, *left_out)) else one.magnitude
        for fault in [name for name in told if name not in one.lasting]:
            slope, reached = one.largest_hidden(fault, threshold.level)
            offer(_of_drift(flight, fault, slope, reached, window))
            if fault in AIRSPEEDS and fault == flight.record.airspeed and "q_impact" not in one.magnitude:
                # Where one airspeed stands for the line, what bounds the channel bounds a loss of impact pressure.
                limit = _of_drift(flight, fault, slope, reached, window)
                relative = 2.0 * slope / _speed(flight, window, fault)
                offer(replace(limit, fault="pitot_icing", excluded_above=relative, unit="1/s"))
    for window, answer in static:
        for of_relation in () if overlaps(window, left_out) else answer.limits:
            offer(_flight_limit(flight, of_relation, window))
    worst = (max((one for one in kept if one is not None), key=lambda one: one.effect) for kept in best.values())
    return tuple(sorted(worst, key=lambda one: (one.shape, one.fault)))


def _of_drift(flight: Flight, fault: str, slope: float, reached: float, window: Window) -> FlightLimit:
    name, channel, unit, effect = fault, fault, STANDARD["tas"].unit, reached
    if fault == "q_impact":
        name, channel, unit, effect = "pitot_icing", "tas", "1", 0.5 * reached * _speed(flight, window)
    elif fault == STATIC_LEAK:
        channel, unit = "altitude", "Pa"
        p_static = float(np.nanmedian(air_data_of(flight.record.between(*window).channels).p_static))
        effect = METRES * reached / p_static
    elif fault == "ground_speed":
        channel = "ground_speed"
    else:
        unit = STANDARD[fault].unit
    per_second = {"1": "1/s", "m/s": "m/s^2", "rad": "rad/s", "m/s^2": "m/s^3", "Pa": "Pa/s"}[unit]
    limit = Limit(fault=name, shape="drift", channel=channel, excluded_above=slope, unit=per_second, effect=effect)
    return _flight_limit(flight, limit, window)


def _speed(flight: Flight, window: Window, channel: str = "tas") -> float:
    return float(np.nanmean(flight.record.between(*window).channels[channel]))


def _flight_limit(flight: Flight, one: Limit, window: Window) -> FlightLimit:
    tolerance = _tolerance(flight, one.channel, window)
    return FlightLimit(
        fault=one.fault,
        shape=one.shape,
        channel=one.channel,
        excluded_above=one.excluded_above,
        unit=one.unit,
        effect=one.effect,
        effect_unit=_unit(flight, one.channel),
        tolerance=tolerance,
        within_tolerance=tolerance is not None and one.effect <= tolerance,
        from_s=window[0],
        to_s=window[1],
    )


def _unit(flight: Flight, channel: str) -> str:
    return STANDARD[channel].unit if channel in STANDARD else flight.log.channels[channel].unit


def _tolerance(flight: Flight, channel: str, window: Window) -> float | None:
    if channel in flight.tolerances:
        return flight.tolerances[channel]
    part = flight.log.window(*window)
    if channel not in part.channels:
        return None
    return tolerance_of(flight.log, part, channel)
